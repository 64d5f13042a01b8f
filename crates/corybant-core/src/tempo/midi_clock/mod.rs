//! MIDI clock: 24 clock messages ("pulses") per beat, each of which arrives some milliseconds late.
//!
//! In: clock and transport messages with their times. Out: the beat grid of the song.
//! Thread: show.
//! Allocates: never.
//!
//! Pulses are numbered from the start of the song. A straight line (pulse number to time) is fitted
//! to the pulses of the last four beats by least squares. If the latest pulses are on average too
//! early or too late for the line, the tempo has changed and a new line starts. Single pulses far
//! from the line are outliers. If the pulses after them are on the line again, the outliers were
//! late. If eight in a row are off by a whole number of pulses, pulses were lost.

use super::source::TempoMessage;
use crate::maths;
use crate::time::BeatGrid;

/// Number of pulses (MIDI clock messages) per beat.
pub(super) const PULSES: i64 = 24;
/// Number of pulses per sixteenth note, which is the unit of song positions.
const PULSES_PER_SIXTEENTH: i64 = 6;
/// The greatest number of latest pulses (clock messages) to which a straight line is fitted: four
/// beats. The line gives the time of each pulse number.
const PULSES_MAX: usize = 4 * PULSES as usize;
/// The least number of pulses (clock messages) from which a straight line (time of each pulse
/// number) is fitted. If the time from one pulse to the next is already known, one pulse is enough.
const PULSES_MIN: usize = 6;
/// Number of latest pulses whose mean timing error decides whether the tempo has changed. Also the
/// number of consecutive outliers (pulses far from the fitted line) that decide together whether
/// pulses were lost or the tempo has jumped.
const RECENT: usize = 8;
/// Mean timing error of the latest pulses above which the tempo has changed, as a multiple of the
/// standard deviation of this mean. The mean error must also exceed [`CHANGE_MIN_S`] seconds.
const CHANGE_DEVIATIONS: f64 = 4.0;
/// Mean timing error of the latest pulses, in seconds, above which the tempo has changed. The mean
/// error must also exceed [`CHANGE_DEVIATIONS`] standard deviations.
const CHANGE_MIN_S: f64 = 0.0015;
/// Timing error of a pulse above which the pulse is an outlier, as a fraction of the time from one
/// pulse to the next. The error must also exceed [`OUTLIER_MIN_S`] seconds.
const OUTLIER_LENGTHS: f64 = 0.35;
/// Timing error of a pulse above which the pulse is an outlier, in seconds. The error must also
/// exceed the fraction [`OUTLIER_LENGTHS`] of the time from one pulse to the next.
const OUTLIER_MIN_S: f64 = 0.006;
/// Relative difference in tempo, between consecutive outliers (pulses far from the fitted line) and
/// the fitted line, below which the tempo counts as unchanged.
const SAME_TEMPO: f64 = 0.05;
/// Weight of the previously known time between pulses when a new straight line is fitted, in pulses
/// squared. The previous time counts as much in the fit as 12 consecutive pulses (half a beat).
const PRIOR_WEIGHT: f64 = 143.0;
/// Time without a pulse (MIDI clock message) after which the MIDI clock counts as lost, in seconds.
pub(super) const LOST_AFTER_S: f64 = 1.0;
/// The range of possible times from one pulse to the next, in seconds, for 999 to 20 beats per
/// minute.
const LENGTH_S: std::ops::RangeInclusive<f64> =
    60.0 / (999.0 * PULSES as f64)..=60.0 / (20.0 * PULSES as f64);

/// The state of the sender's playback (transport) after its latest message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Transport {
    /// Unknown: the sender has sent no transport message (start, continue, stop); some senders
    /// never do.
    Unknown,
    /// Running: the sender plays the song.
    Running,
    /// Stopped: the sender does not play the song.
    Stopped,
}

/// A pulse (MIDI clock message) that was received.
#[derive(Clone, Copy, Debug, Default)]
struct ClockPulse {
    /// Pulse number, counted from the start of the song.
    number: i64,
    /// Show time of the pulse, in seconds.
    time: f64,
}

impl ClockPulse {
    /// Returns by how many seconds the pulse is later than `line` predicts; negative if it is
    /// earlier. `line` is the fitted straight line, as a grid that counts pulses instead of beats.
    fn error(self, line: BeatGrid) -> f64 {
        self.time - line.time_of(self.number as f64)
    }
}

/// Fits a straight line (time of each pulse number) to `pulses` by least squares. The returned grid
/// counts pulses instead of beats. `prior` is the previously known time from one pulse to the next,
/// in seconds. Returns `None` without pulses, or if the tempo is outside the possible range.
fn fit(pulses: &[ClockPulse], prior: Option<f64>) -> Option<BeatGrid> {
    let (first, last) = (pulses.first()?, pulses.last()?);
    let n = pulses.len() as f64;
    let place = |pulse: &ClockPulse| {
        (
            (pulse.number - first.number) as f64,
            pulse.time - first.time,
        )
    };
    let (x, y) = pulses
        .iter()
        .map(place)
        .fold((0.0, 0.0), |(x, y), (px, py)| (x + px / n, y + py / n));
    let (mut xx, mut xy) = (0.0, 0.0);
    for (px, py) in pulses.iter().map(place) {
        xx += (px - x) * (px - x);
        xy += (px - x) * (py - y);
    }
    if let Some(length) = prior {
        xx += PRIOR_WEIGHT;
        xy += PRIOR_WEIGHT * length;
    }
    let length = xy / xx;
    LENGTH_S.contains(&length).then(|| BeatGrid {
        beat: last.number as f64,
        time: first.time + y + ((last.number - first.number) as f64 - x) * length,
        period: length,
    })
}

/// The position in the song and the tempo, estimated from the messages of a MIDI clock (24 pulses
/// per beat).
pub(super) struct MidiClock {
    /// The pulses (clock messages) to which `line` is fitted, the latest last; only the first `len`
    /// entries are valid.
    pulses: [ClockPulse; PULSES_MAX],
    /// Number of valid entries in `pulses`.
    len: usize,
    /// The latest consecutive outliers: pulses whose times are far from those that `line` predicts.
    /// Only the first `outlier_count` entries are valid.
    outliers: [ClockPulse; RECENT],
    /// Number of valid entries in `outliers`.
    outlier_count: usize,
    /// Timing errors of the latest pulses, in seconds, the latest last: positive if the pulse was
    /// later than `line` predicted, negative if it was earlier.
    errors: [f64; RECENT],
    /// The straight line that is fitted to the pulses: a grid that counts pulses instead of beats
    /// and gives the time of each pulse number. `None` before enough pulses were received.
    line: Option<BeatGrid>,
    /// Time from one pulse to the next, in seconds, that was known when the fit of `line` last
    /// started again. `None` if it was not known, or if the tempo has changed since.
    prior: Option<f64>,
    /// Number of the next pulse, counted from the start of the song.
    next: i64,
    /// Number of the pulse at which a stopped song continues, counted from the start of the song.
    stopped_at: i64,
    /// True if the next pulse starts the fit of `line` again, without the earlier pulses.
    restart: bool,
    /// True after a gap (a suspended computer, for example) until the next pulse. Pulses may have
    /// been missed in the gap.
    missed: bool,
    /// The state of the sender's playback: unknown, running or stopped.
    transport: Transport,
    /// Show time, in seconds, of the latest pulse or of the latest message that started playback.
    received_at: f64,
}

impl MidiClock {
    /// Creates the state of a MIDI clock from which no message was received yet.
    pub(super) fn new() -> Self {
        Self {
            pulses: [ClockPulse::default(); PULSES_MAX],
            len: 0,
            outliers: [ClockPulse::default(); RECENT],
            outlier_count: 0,
            errors: [0.0; RECENT],
            line: None,
            prior: None,
            next: 0,
            stopped_at: 0,
            restart: false,
            missed: false,
            transport: Transport::Unknown,
            received_at: f64::NEG_INFINITY,
        }
    }

    /// Processes a MIDI clock message or a start, stop, continue or position message, sent at time
    /// `at` (seconds). Ignores messages of other tempo sources.
    pub(super) fn receive(&mut self, message: TempoMessage, at: f64) {
        match message {
            TempoMessage::Pulse => self.pulse(at),
            TempoMessage::Start => self.start(0, at),
            // A repeated Continue message has no effect.
            TempoMessage::Continue if self.transport == Transport::Running => {}
            TempoMessage::Continue => self.start(self.stopped_at, at),
            TempoMessage::Stop => {
                if self.transport != Transport::Stopped {
                    self.stopped_at = self.next;
                }
                self.transport = Transport::Stopped;
            }
            TempoMessage::Position(sixteenths) => {
                self.stopped_at = i64::from(sixteenths) * PULSES_PER_SIXTEENTH;
                if self.transport == Transport::Running {
                    self.run_from(self.stopped_at);
                }
            }
            TempoMessage::Session { .. }
            | TempoMessage::Beat { .. }
            | TempoMessage::Song { .. } => {}
        }
    }

    /// Marks the end of a gap (a suspended computer, for example). The number of the next pulse is
    /// then computed from its time, because pulses may have been missed.
    pub(super) fn resume(&mut self) {
        self.missed = true;
    }

    /// Returns the beat grid of the song; `None` until enough pulses were received. The beat grid
    /// also predicts beats after the last received pulse.
    pub(super) fn grid(&self) -> Option<BeatGrid> {
        let line = self.line.filter(|_| !self.restart)?;
        Some(BeatGrid {
            beat: line.beat / PULSES as f64,
            time: line.time,
            period: line.period * PULSES as f64,
        })
    }

    /// Returns true if a pulse, or a message that starts playback, was received in the last second
    /// before `now` (seconds).
    pub(super) fn is_alive(&self, now: f64) -> bool {
        now - self.received_at < LOST_AFTER_S
    }

    /// Returns true if a pulse of the MIDI clock was ever received.
    pub(super) fn is_known(&self) -> bool {
        self.received_at.is_finite()
    }

    /// Returns true while the playback of the sender is stopped by a MIDI stop message.
    pub(super) fn is_stopped(&self) -> bool {
        self.transport == Transport::Stopped
    }

    /// Returns true if a start, stop or continue message was received. Before such a message, it is
    /// not known which of the pulses are on a beat.
    pub(super) fn position_is_known(&self) -> bool {
        self.transport != Transport::Unknown
    }

    /// Starts playback: the next pulse has the number `number`. `at` is the time of the start or
    /// continue message, in seconds. If pulses were received before, the MIDI clock counts as alive
    /// at once.
    fn start(&mut self, number: i64, at: f64) {
        if self.is_known() {
            self.received_at = at;
        }
        self.run_from(number);
    }

    /// Sets the state to running. At the next pulse, which has the number `number`, the fit of the
    /// straight line starts again without the earlier pulses.
    fn run_from(&mut self, number: i64) {
        self.transport = Transport::Running;
        self.next = number;
        self.prior = self.line.map(|line| line.period).or(self.prior);
        self.restart = true;
    }

    /// Processes a pulse (MIDI clock message) that was sent at time `at` (seconds).
    fn pulse(&mut self, at: f64) {
        let silent = at - self.received_at;
        self.received_at = at;
        if std::mem::take(&mut self.missed)
            && let Some(line) = self.line.filter(|_| !self.restart)
        {
            self.next = (line.beat + ((at - line.time) / line.period).round()) as i64;
            self.outlier_count = 0;
        }
        let pulse = ClockPulse {
            number: self.next,
            time: at,
        };
        self.next += 1;
        if self.restart {
            self.restart = false;
            (self.len, self.outlier_count, self.errors) = (0, 0, [0.0; RECENT]);
            self.line = self.prior.map(|length| BeatGrid {
                beat: pulse.number as f64,
                time: at,
                period: length,
            });
        } else if silent > LOST_AFTER_S && self.line.is_none() {
            self.len = 0;
        }
        let Some(line) = self.line else {
            self.add(pulse);
            self.update_line(None);
            return;
        };
        let error = pulse.error(line);
        if error.abs() > (OUTLIER_LENGTHS * line.period).max(OUTLIER_MIN_S) {
            return self.add_outlier(pulse, line);
        }
        self.outlier_count = 0;
        self.add(pulse);
        self.errors.rotate_left(1);
        self.errors[RECENT - 1] = error;
        if self.tempo_changed(line) {
            self.keep_latest(RECENT - 2);
        }
        self.update_line(self.prior);
    }

    /// Stores a pulse for the fit of `line`. If the array is full, drops the oldest pulse.
    fn add(&mut self, pulse: ClockPulse) {
        if self.len == PULSES_MAX {
            self.pulses.rotate_left(1);
            self.len -= 1;
        }
        self.pulses[self.len] = pulse;
        self.len += 1;
    }

    /// Fits `line` (the time of each pulse number) to the stored pulses, if there are enough.
    /// `prior` is the previously known time from one pulse to the next, in seconds; `None` if it
    /// was not known.
    fn update_line(&mut self, prior: Option<f64>) {
        if self.len >= PULSES_MIN || (prior.is_some() && self.len > 0) {
            self.line = fit(&self.pulses[..self.len], prior);
        }
    }

    /// Returns true if the tempo has changed: the mean timing error of the latest pulses, relative
    /// to the fitted straight line `line`, is larger than random delays explain.
    fn tempo_changed(&self, line: BeatGrid) -> bool {
        if self.len < 2 * RECENT {
            return false;
        }
        let older = &self.pulses[..self.len - RECENT];
        let variance = older
            .iter()
            .map(|pulse| maths::powi(pulse.error(line), 2))
            .sum::<f64>()
            / older.len() as f64;
        let mean = self.errors.iter().sum::<f64>() / RECENT as f64;
        // The mean error varies with the random delays of the latest pulses and with the error of
        // the line. At the end of a line, the variance of the line is that of the mean of a quarter
        // of its pulses.
        let mean_variance = variance * (1.0 / RECENT as f64 + 4.0 / older.len() as f64);
        mean.abs() > (CHANGE_DEVIATIONS * mean_variance.sqrt()).max(CHANGE_MIN_S)
    }

    /// Forgets all stored pulses except the latest `n`, all timing errors, and `prior` (the
    /// previously known time from one pulse to the next).
    fn keep_latest(&mut self, n: usize) {
        self.pulses.copy_within(self.len - n..self.len, 0);
        (self.len, self.prior, self.errors) = (n, None, [0.0; RECENT]);
    }

    /// Stores an outlier: a pulse whose time is far from the fitted straight line `line`. After
    /// eight consecutive outliers, decides whether pulses were lost or the tempo has jumped.
    fn add_outlier(&mut self, pulse: ClockPulse, line: BeatGrid) {
        self.outliers[self.outlier_count] = pulse;
        self.outlier_count += 1;
        if self.outlier_count < RECENT {
            return;
        }
        self.outlier_count = 0;
        let outliers = self.outliers;
        let Some(other) = fit(&outliers, None) else {
            return;
        };
        let error = outliers.iter().map(|pulse| pulse.error(line)).sum::<f64>() / RECENT as f64;
        let lost = (error / line.period).round();
        let same = (other.period / line.period - 1.0).abs() < SAME_TEMPO
            && (error / line.period - lost).abs() < OUTLIER_LENGTHS;
        if same && lost >= 1.0 {
            self.next += lost as i64;
            outliers.iter().for_each(|&ClockPulse { number, time }| {
                self.add(ClockPulse {
                    number: number + lost as i64,
                    time,
                });
            });
            self.line = fit(&self.pulses[..self.len], None);
        } else {
            self.len = 0;
            outliers.iter().for_each(|&pulse| self.add(pulse));
            (self.prior, self.line) = (None, Some(other));
        }
        self.errors = [0.0; RECENT];
    }
}

#[cfg(test)]
mod tests;
