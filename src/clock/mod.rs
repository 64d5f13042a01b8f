//! Tempo, beats and timecode from and to other machines: MIDI clock, OSC beats, Ableton Link, MIDI
//! timecode, Art-Net timecode. In: the tempo
//! of the show, MIDI bytes, a Link session. Out: tempo messages for the show, clock messages for
//! others.

pub mod art_net;
#[cfg(feature = "link")]
pub mod link;
pub mod midi_in;
pub mod out;
