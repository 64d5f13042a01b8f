//! Beat tracking: mono samples in, a [`Timeline`](crate::time::Timeline) of coming beats out. Live
//! tracking is causal.
//!
//! ```text
//! samples ─▶ level: activity gate ─┐                             ┌▶ scheduler ─▶ timeline
//!         ├▶ activation ─▶ bar pointer HMM ─▶ tempo hypothesis ──┤
//!         │     └▶ rhythm pattern ─▶ phase classifier ─┘         │
//!         ├▶ beat detector (aubio) ─▶ estimate follower ─────────┤
//!         └▶ decimator ─▶ chroma ─▶ downbeat features ─▶ bars ───┘
//! ```
//!
//! In: hops of samples, edits of a performer.
//! Out: timelines and predicted beats.
//! Thread: show; `offline` any except audio and show.
//! Allocates: never after `new`; `offline` does.
//!
//! The unit of time is sample time: seconds since the first sample.

use thiserror::Error;

use crate::dsp::HOP;
use crate::text::one_line_each;
use crate::time::Seconds;

pub mod activation;
mod annotated;
#[cfg(feature = "aubio")]
pub mod aubio;
mod audio_tracker;
#[cfg_attr(not(feature = "aubio"), allow(dead_code))] // Only aubio reports single beats.
mod backend;
pub mod bar_length;
pub mod edit;
pub mod form;
mod metre;
pub mod offline;
pub mod phase;
pub mod tempo;
pub mod tracker;
pub mod tsv;

/// An estimate of tempo and phase by a beat detector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Sample time of a beat: the latest beat or the next beat.
    pub beat: Seconds,
    /// Estimated beat period.
    pub period: Seconds,
    /// Confidence of the detector in this estimate, 0..1.
    pub confidence: f32,
}

/// A detector that reports single beats, hop by hop.
///
/// Thread: show. Allocates: never after construction.
pub trait BeatDetector: Send {
    /// Processes one hop of [`HOP`] mono samples at [`SAMPLE_RATE`](crate::dsp::SAMPLE_RATE).
    /// Returns an estimate if a beat falls in the hop or the estimate of the coming beats changes,
    /// otherwise `None`.
    fn hop(&mut self, samples: &[f32; HOP]) -> Option<Estimate>;
}

/// The reasons why beats cannot be tracked, or annotated beats cannot be used.
#[derive(Debug, Error, PartialEq)]
pub enum BeatError {
    /// A beat tracker could not be initialised.
    #[error("the beat tracker {name} cannot be set up; is there memory left?")]
    Tracker {
        /// Name of the beat tracker that could not be initialised.
        name: &'static str,
    },
    /// The user selected aubio, but this build lacks the feature `aubio`.
    #[error(
        "this build has no beat tracker aubio; use net or flux, or build with the feature `aubio`"
    )]
    WithoutAubio,
    /// The built-in weights of the beat network are not usable.
    #[error("the beat tracker net cannot be set up: {0}")]
    Net(#[from] activation::net::error::NetError),
    /// The name that the user gave is not the name of a beat tracker.
    #[error("there is no beat tracker `{name}`; use {allowed}")]
    UnknownTracker {
        /// The tracker name that the user requested.
        name: String,
        /// The names of all beat trackers, separated by commas, for the error message.
        allowed: &'static str,
    },
    /// A setting of the beat tracker is outside its allowed range.
    #[error("{}", one_line_each(problems))]
    Settings {
        /// One sentence for each beat tracker setting that is outside its allowed range.
        problems: Vec<String>,
    },
    /// The selected beat tracker only works live and cannot process a whole recording.
    #[error("the beat tracker {name} only follows live; for a whole file use {allowed}")]
    LiveOnly {
        /// Name of the beat tracker that only works live.
        name: &'static str,
        /// Names of the beat trackers that can process a whole recording, for the error message.
        allowed: &'static str,
    },
    /// The list of annotated beats is empty.
    #[error("the list of beats is empty; give at least one beat time in seconds")]
    NoBeats,
    /// The time of an annotated beat is negative, not finite or above the limit.
    #[error("beat {line} is at {time} s; beat times are seconds from the start, 0 to {max}")]
    BeatTime {
        /// Position of the refused beat in the list of beats, counted from 1.
        line: usize,
        /// The time of the refused beat, in seconds.
        time: f64,
        /// The latest allowed time of a beat, in seconds.
        max: f64,
    },
    /// An annotated beat is too soon after the previous one, or before it.
    #[error(
        "beat {line} at {time} s comes {gap} s after the one before; beats must be at least {min} s apart, in order"
    )]
    BeatOrder {
        /// Position of the refused beat in the list of beats, counted from 1.
        line: usize,
        /// The time of the refused beat, in seconds.
        time: f64,
        /// Time from the previous beat to the refused beat, in seconds.
        gap: f64,
        /// The shortest allowed time between two beats, in seconds.
        min: f64,
    },
}
