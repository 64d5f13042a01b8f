//! Fuzz target: no datagrams of sACN sources cause a panic, a universe out of range, or a cue while
//! the levels stay.
//!
//! The first two bytes of each part of the input are the length of a datagram, the third one the
//! time until it arrives.
#![no_main]

use corybant_core::cue::dmx::{DmxPatch, Merge, PatchEntry, sacn};
use corybant_core::time::Seconds;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let labels = ["salsa", "pop"].map(String::from);
    let entries = [
        PatchEntry {
            channel: 1,
            labels: labels.to_vec(),
            ..PatchEntry::default()
        },
        PatchEntry {
            channel: 2,
            label: "!intensity".into(),
            ..PatchEntry::default()
        },
    ];
    let mut patch = DmxPatch::new(&entries, (&labels).into()).expect("the labels exist");
    let (mut merge, mut rest, mut now) = (Merge::new(Seconds(sacn::LOST_AFTER_S)), bytes, 0.0);
    while let [high, low, when, after @ ..] = rest {
        let length = usize::from(u16::from_be_bytes([*high, *low])).min(after.len());
        let (datagram, next) = after.split_at(length);
        rest = next;
        now += f64::from(*when) / 50.0;
        merge.expire(Seconds(now));
        if let Ok(Some((universe, frame))) = sacn::parse(datagram) {
            assert!(sacn::UNIVERSES.contains(&universe) && frame.levels.len() <= 512);
            merge.receive(Seconds(now), &frame);
        }
        patch.update(merge.levels(), &mut |_| {});
        patch.update(merge.levels(), &mut |cue| panic!("{cue:?} again"));
    }
});
