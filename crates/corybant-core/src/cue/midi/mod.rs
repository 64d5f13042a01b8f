//! MIDI input: converts MIDI messages to cues by the map of a device.
//!
//! | module | contents |
//! |---|---|
//! | `message` | bytes → messages |
//! | `entry` | one entry `[[midi.map]]` of a show file: a control and what it sends |
//! | `map` | messages → the cues and requests for takes that they send |
//!
//! In: bytes. Out: cues, requests. Thread: any. Pure.

pub mod entry;
pub mod map;
pub mod message;

pub use entry::{BEATS_MAX, CC_MAX, Control, MapEntry, MapError};
pub use map::{ControlChange, MidiMap, MidiRequest};
