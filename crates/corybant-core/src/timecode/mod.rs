//! Timecode: the position of a tape, a player or a lighting desk, which a show follows.
//!
//! ```text
//! LTC: samples ──▶ ltc ──┐
//! MTC: MIDI bytes ─▶ mtc ┼──▶ Reading ──▶ TimecodeClock ──▶ position at any time
//! Art-Net, OSC ──────────┘
//! ```
//! In: samples, MIDI messages, datagrams, each with its time. Out: positions in timecode. Thread:
//! the decoders on the thread of their input, the clock on the show thread. Allocates: never.
//! Sources: SMPTE ST 12-1 (LTC, drop frame), MIDI Time Code (MMA 1987), Art-Net 4.
//!
//! The arithmetic of frames and the messages of MTC come from the crate `smpte-timecode`. LTC has a
//! decoder of its own: the crate `ltc` 0.2.0 reads no reverse timecode and does not report at which
//! sample a frame ends, and `timecode-coder` 0.3.0 reads no reverse timecode either.

pub mod art_net;
pub mod clock;
mod fit;
pub mod ltc;
pub mod mtc;
mod rate;
pub mod settings;

use smpte_timecode::{Fields, FrameRate, Timecode};

use crate::time::Seconds;

pub use clock::{Position, State, TimecodeClock};
pub use rate::{Rate, RateDetector, name as rate_name};

/// Length of a day, in seconds. Timecode counts the time of one day.
pub const DAY_S: f64 = 86_400.0;

/// A place in timecode, as a source reports it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// A frame, and the part of it that has passed.
    Frame {
        /// Hours, minutes, seconds and frame.
        fields: Fields,
        /// The frame rate; `None` if the source does not report it.
        rate: Option<FrameRate>,
        /// True if the source says that frames are dropped (29.97 drop frame).
        drops: bool,
        /// Number of frames from the beginning of this frame to the reported place; negative values
        /// are before it.
        after_frames: f64,
    },
    /// A time of the day, in seconds.
    Seconds(f64),
}

/// What a source reports: the place of its timecode at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Show time at which the timecode was at `place`.
    pub at: Seconds,
    /// The place in timecode.
    pub place: Place,
    /// Duration of a frame as the source sends it; `None` if it was not measured.
    pub frame: Option<Seconds>,
    /// Typical error of `at`. The clock averages errors of this size.
    pub jitter: Seconds,
    /// True if the source says that its playback stands at `place` (a full frame of MTC): the clock
    /// then goes there at once.
    pub is_locate: bool,
}

impl Reading {
    /// Returns this reading with its times later by `by`.
    #[must_use]
    pub fn later(self, by: Seconds) -> Self {
        Self {
            at: self.at + by,
            ..self
        }
    }
}

/// A change of a timecode source that a show follows, for the log. Each has the frame, if the source
/// sends frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimecodeEvent {
    /// Timecode has arrived, or arrives again after a loss.
    Locked(Option<Timecode>),
    /// The source has gone to another place.
    Located(Option<Timecode>),
    /// Timecode is missing for longer than the freewheel.
    Lost(Option<Timecode>),
    /// Timecode leads the cue list (true), or the list waits (false).
    Engaged(bool),
}

/// Parses a label of timecode such as `01:00:00:00` or, with drop frame, `01:00:00;00`. Returns the
/// fields, and true if the last separator is that of drop frame. `None` if `text` has another form
/// or a field that no frame rate has.
pub fn parse_label(text: &str) -> Option<(Fields, bool)> {
    let text = text.trim();
    let (front, frames) = text.rsplit_once([':', ';', '.'])?;
    let drops = !text[front.len()..].starts_with(':');
    let mut parts = front.split(':');
    let mut field = |max: u8| {
        let part = parts.next()?;
        let is_number = (1..=2).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit());
        part.parse().ok().filter(|&n: &u8| is_number && n <= max)
    };
    let (hours, minutes, seconds) = (field(23)?, field(59)?, field(59)?);
    let is_number = (1..=2).contains(&frames.len()) && frames.bytes().all(|b| b.is_ascii_digit());
    let frames = frames.parse().ok().filter(|&n: &u8| is_number && n <= 29)?;
    let fields = Fields {
        hours,
        minutes,
        seconds,
        frames,
    };
    parts.next().is_none().then_some((fields, drops))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_parsed_and_wrong_ones_refused() {
        let fields = Fields {
            hours: 1,
            minutes: 2,
            seconds: 3,
            frames: 29,
        };
        assert_eq!(parse_label("01:02:03:29"), Some((fields, false)));
        assert_eq!(parse_label(" 1:2:3;29 "), Some((fields, true)));
        for wrong in [
            "",
            "01:02:03",
            "24:00:00:00",
            "01:60:00:00",
            "01:00:00:30",
            "1:2:3:4:5",
            "-1:0:0:0",
            "01:00:00:+1",
            "a:b:c:d",
            "01;00;00;00",
        ] {
            assert_eq!(parse_label(wrong), None, "{wrong}");
        }
    }
}
