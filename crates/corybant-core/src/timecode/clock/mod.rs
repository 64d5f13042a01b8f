//! The timecode clock: the position of a timecode source at any time. In: readings, the time. Out:
//! position, speed and state. Thread: show. Allocates: never.
//!
//! A position is believed once [`CONFIRMATIONS`] readings agree, so that a single wrong frame moves
//! nothing. While readings agree with the present line, the clock follows them; readings elsewhere
//! become the new line as soon as enough of them agree with each other: the source has located.
//! Without readings the clock runs on for some frames (freewheel).

use smpte_timecode::{FrameRate, Timecode};

use super::fit::{Fit, SPEED_MAX};
use super::{DAY_S, Place, Rate, RateDetector, Reading};
use crate::time::Seconds;

/// Number of readings that must agree before the clock believes them.
pub const CONFIRMATIONS: usize = 3;
/// Number of frames by which a reading may differ from the expected one.
const TOLERANCE_FRAMES: f64 = 2.0;
/// Number of usual intervals between readings, and number of frames, after which a missing reading
/// counts as a drop-out.
const LATE: (f64, f64) = (2.5, 3.0);
/// Greatest absolute show time of a reading, in seconds; 30 years.
const TIME_S_MAX: f64 = 1e9;
/// Below this speed the source stands.
const SPEED_STANDING: f64 = 0.05;

/// The state of a timecode source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// No timecode has arrived yet.
    #[default]
    Waiting,
    /// The position follows timecode.
    Locked,
    /// Timecode arrives, and it stands.
    Standing,
    /// Timecode is missing; the position runs on at the last speed.
    Freewheel,
    /// Timecode is missing for longer than the freewheel.
    Lost,
}

impl State {
    /// Returns the name of the state in the user interface.
    pub fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Locked => "locked",
            Self::Standing => "standing",
            Self::Freewheel => "freewheel",
            Self::Lost => "lost",
        }
    }

    /// Returns true if the position moves with timecode.
    pub fn runs(self) -> bool {
        matches!(self, Self::Locked | Self::Freewheel)
    }
}

/// The position of a timecode source at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Position {
    /// Position as a time of the day, in seconds of real time at the usual speed. After a loss, it
    /// is the last one before the loss.
    pub seconds: f64,
    /// Seconds of timecode per second; negative in reverse.
    pub speed: f64,
    /// The state of the source.
    pub state: State,
    /// The frame rate; `None` before the first position or if the source sends seconds.
    pub rate: Option<FrameRate>,
    /// Number of times that the source has gone to another place. The first lock counts.
    pub locates: u32,
}

impl Position {
    /// Returns the frame at this position; `None` if the frame rate is not known.
    pub fn timecode(&self) -> Option<Timecode> {
        let rate = self.rate?;
        let frames = self.seconds.rem_euclid(DAY_S) * rate.frames_per_second().to_f64();
        // The small part corrects the rounding of a whole frame.
        let frames = ((frames + 1e-3) as u32).min(rate.frames_per_day() - 1);
        Timecode::from_frames(frames, rate).ok()
    }
}

/// A line through readings, with the frame rate of the readings.
#[derive(Clone, Copy, Debug)]
struct Line {
    fit: Fit,
    rate: Option<FrameRate>,
    /// Duration of a frame, in seconds.
    frame: f64,
    /// True if the source stands at this place by its own word.
    is_located: bool,
}

impl Line {
    /// Returns true if the position `position` at `time` continues this line. `jitter` is the
    /// typical error of the time.
    fn continues(&self, time: f64, position: f64, rate: Option<FrameRate>, jitter: f64) -> bool {
        let error = (position - self.fit.position(time)).abs();
        rate == self.rate && error <= TOLERANCE_FRAMES * self.frame + 2.0 * jitter
    }
}

/// Follows the readings of a timecode source.
#[derive(Clone, Debug)]
pub struct TimecodeClock {
    rates: RateDetector,
    /// Number of frames for which the clock runs on without readings.
    freewheel_frames: u32,
    /// The line that the clock follows; `None` before the first one.
    line: Option<Line>,
    /// Readings at another place, which may become the next line.
    candidate: Option<Line>,
    locates: u32,
    /// Number of readings that were ignored: strays, and frames that do not exist.
    ignored: u64,
}

impl TimecodeClock {
    /// Creates a clock for a source with the frame rate `rate`, which runs on for
    /// `freewheel_frames` frames without readings.
    pub fn new(rate: Rate, freewheel_frames: u32) -> Self {
        Self {
            rates: RateDetector::new(rate),
            freewheel_frames,
            line: None,
            candidate: None,
            locates: 0,
            ignored: 0,
        }
    }

    /// Returns the number of readings that were ignored so far: readings that neither continued the
    /// timecode nor agreed with others, and frames that do not exist at the frame rate.
    pub fn ignored(&self) -> u64 {
        self.ignored
    }

    /// Processes a reading. A reading that is not later than the last one, or has a value that is
    /// not finite, is ignored.
    pub fn receive(&mut self, reading: &Reading) {
        let Some((position, rate)) = self.resolve(reading) else {
            self.ignored += 1;
            return;
        };
        let (time, jitter) = (reading.at.0, reading.jitter.0);
        if !(time.abs() < TIME_S_MAX && (0.0..1.0).contains(&jitter)) {
            self.ignored += 1;
            return;
        }
        let was_lost = self.state(time).0 == State::Lost;
        let frame = rate.map_or(1.0 / 30.0, |rate| 1.0 / rate.frames_per_second().to_f64());
        if reading.is_locate {
            return self.locate(time, position, rate, frame);
        }
        match &mut self.line {
            Some(line) if !line.is_located && line.continues(time, position, rate, jitter) => {
                if time > line.fit.last_time() {
                    line.fit.add(time, position, jitter);
                }
                self.locates = self.locates.wrapping_add(u32::from(was_lost));
                if let Some(stray) = self.candidate.take() {
                    self.ignored += stray.fit.len() as u64;
                }
            }
            _ => self.try_candidate(
                time,
                position,
                jitter,
                Line {
                    fit: Fit::new(time, position, 1.0),
                    rate,
                    frame,
                    is_located: false,
                },
            ),
        }
    }

    /// Adds a reading to the candidate; if enough readings agree, the clock follows them.
    fn try_candidate(&mut self, time: f64, position: f64, jitter: f64, new: Line) {
        let Some(candidate) = &mut self.candidate else {
            self.candidate = Some(new);
            return;
        };
        let (rate, frame) = (new.rate, new.frame);
        let since = time - candidate.fit.last_time();
        let is_second = candidate.fit.len() == 1;
        let moved = position - candidate.fit.position(candidate.fit.last_time());
        let can_be =
            since > 0.0 && rate == candidate.rate && moved.abs() <= SPEED_MAX * since + frame;
        let agrees = can_be && (is_second || candidate.continues(time, position, rate, jitter));
        if !agrees {
            self.ignored += candidate.fit.len() as u64;
            *candidate = new;
            return;
        }
        candidate.fit.add(time, position, jitter);
        if candidate.fit.len() >= CONFIRMATIONS {
            self.line = self.candidate.take();
            self.locates = self.locates.wrapping_add(1);
        }
    }

    /// Goes to a place at which the source stands.
    fn locate(&mut self, time: f64, position: f64, rate: Option<FrameRate>, frame: f64) {
        self.line = Some(Line {
            fit: Fit::new(time, position, 0.0),
            rate,
            frame,
            is_located: true,
        });
        self.candidate = None;
        self.locates = self.locates.wrapping_add(1);
    }

    /// Returns the position of a reading, in seconds, and its frame rate. `None` if the frame does
    /// not exist at the frame rate.
    fn resolve(&mut self, reading: &Reading) -> Option<(f64, Option<FrameRate>)> {
        match reading.place {
            Place::Seconds(seconds) => (0.0..DAY_S).contains(&seconds).then_some((seconds, None)),
            Place::Frame {
                fields,
                rate,
                drops,
                after_frames,
            } => {
                let rate = rate.unwrap_or_else(|| self.rates.observe(fields, drops, reading.frame));
                let timecode = Timecode::from_fields(fields, rate).ok()?;
                if after_frames.is_nan() || after_frames.abs() > 100.0 {
                    return None;
                }
                let frames = f64::from(timecode.frames()) + after_frames;
                Some((frames / rate.frames_per_second().to_f64(), Some(rate)))
            }
        }
    }

    /// Returns the state of the source at the show time `time`, and the time until which the
    /// position runs.
    fn state(&self, time: f64) -> (State, f64) {
        let Some(line) = &self.line else {
            return (State::Waiting, time);
        };
        if line.is_located {
            return (State::Standing, time);
        }
        let last = line.fit.last_time();
        let late = last + (LATE.0 * line.fit.interval()).max(LATE.1 * line.frame);
        let lost = late + f64::from(self.freewheel_frames) * line.frame;
        let state = if time > lost {
            State::Lost
        } else if line.fit.speed().abs() < SPEED_STANDING {
            State::Standing
        } else if time > late {
            State::Freewheel
        } else {
            State::Locked
        };
        (state, time.min(lost))
    }

    /// Returns the position of the source at the show time `now`.
    pub fn position(&self, now: Seconds) -> Position {
        let (state, until) = self.state(now.0);
        let Some(line) = &self.line else {
            return Position::default();
        };
        Position {
            seconds: line.fit.position(until),
            speed: line.fit.speed(),
            state,
            rate: line.rate,
            locates: self.locates,
        }
    }
}

#[cfg(test)]
mod tests;
