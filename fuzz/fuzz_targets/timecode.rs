//! Fuzz target: no MIDI timecode and no samples on an LTC channel cause a panic, or a position that is
//! not a number.
//!
//! Each part of the input is a kind (MIDI message or samples), the time until it arrives, and its
//! bytes.
#![no_main]

use corybant_core::time::Seconds;
use corybant_core::timecode::Rate;
use corybant_core::timecode::clock::TimecodeClock;
use corybant_core::timecode::ltc::LtcDecoder;
use corybant_core::timecode::mtc::MtcReceiver;
use libfuzzer_sys::fuzz_target;

const RATE_HZ: u32 = 48_000;

fuzz_target!(|bytes: &[u8]| {
    let mut clock = TimecodeClock::new(Rate::Auto, 25);
    let mut midi = MtcReceiver::new(Rate::Auto);
    let mut ltc = LtcDecoder::new(RATE_HZ);
    let (mut rest, mut now) = (bytes, 0.0);
    while let [kind, when, length, after @ ..] = rest {
        let (part, next) = after.split_at(usize::from(*length).min(after.len()));
        rest = next;
        now += f64::from(*when) / 500.0;
        if *kind < 128 {
            if let Ok(Some(reading)) = midi.receive(part, Seconds(now)) {
                clock.receive(&reading);
            }
        } else {
            ltc.process(part.iter().map(|&level| f32::from(level as i8) / 128.0));
            ltc.take_frames(|frame| clock.receive(&frame.reading(Seconds(now), RATE_HZ)));
        }
        let position = clock.position(Seconds(now));
        assert!(position.seconds.is_finite() && position.speed.is_finite());
    }
});
