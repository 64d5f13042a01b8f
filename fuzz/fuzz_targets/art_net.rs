//! Fuzz target: no datagram of Art-Net causes a panic, a universe out of range or a frame of timecode
//! that does not exist.
#![no_main]

use corybant_core::cue::dmx::art_net;
use corybant_core::timecode::{self, Place};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|datagram: &[u8]| {
    if let Ok(Some((universe, frame))) = art_net::parse(datagram, [0; 16]) {
        assert!(art_net::UNIVERSES.contains(&universe));
        assert!((1..=512).contains(&frame.levels.len()) && frame.sequence != Some(0));
    }
    if let Ok(Some(Place::Frame { fields, .. })) = timecode::art_net::parse(datagram) {
        assert!(fields.hours < 24 && fields.minutes < 60 && fields.seconds < 60);
    }
});
