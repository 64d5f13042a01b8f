//! DMX input: converts the levels of a lighting desk to cues by a patch.
//!
//! | module | contents |
//! |---|---|
//! | `sacn` | packets of sACN (ANSI E1.31) → frames of levels |
//! | `art_net` | packets ArtDmx → frames of levels |
//! | `merge` | frames of several sources → the levels of one universe |
//! | `entry` | one entry `[[dmx_in.patch]]` of a show file: a channel and what it sends |
//! | `patch` | levels → the cues that they send |
//!
//! In: bytes. Out: cues. Thread: any. Pure.

pub mod art_net;
pub mod entry;
pub mod merge;
pub mod patch;
pub mod sacn;

pub use entry::{PatchEntry, PatchError};
pub use merge::{Frame, Merge, Received};
pub use patch::DmxPatch;

/// Number of channels of a universe.
pub const CHANNELS: usize = 512;
