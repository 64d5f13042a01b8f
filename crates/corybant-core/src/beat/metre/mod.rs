//! Metre: how long bars are, and which beats are the first of their bars.
//!
//! Thread: show.
//! Allocates: only in `new`.

pub mod bars;
pub mod chroma;
pub mod features;
pub mod repetition;
