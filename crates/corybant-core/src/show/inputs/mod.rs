//! The music of a show: tracked in samples or read from a recording, with the times of the show.

pub mod music;
mod output_cues;
pub(in crate::show) mod sample_clock;
pub(in crate::show) mod source_watch;
