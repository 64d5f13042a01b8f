//! Tracks beats in live audio: connects the backend, the beat scheduler and the bar filter.
//!
//! In: hops of samples, and a performer's edits of the beat grid.
//! Out: each beat once it is due, and the timeline.
//! Thread: show.
//! Allocates: never after `new`.
//!
//! The backend finds tempo and phase, the scheduler numbers the beats, and the bar filter finds the
//! downbeats. A performer's edit takes effect at once: the backend continues from the edited grid
//! and keeps the octave of a tempo that a performer set.

use super::backend::TrackerBackend;
use super::bar_length::BarLength;
use super::edit::{GridEdit, NUDGE_MAX_S};
use super::metre::bars::BarFilter;
use super::phase::pattern::BAR;
use super::tempo::period_range::PeriodRange;
use super::tempo::scheduler::BeatScheduler;
use crate::dsp::HOP;
use crate::time::{BeatGrid, Seconds, Timeline};

/// Greatest difference between an old and a new beat grid, as a fraction of the old beat period. If
/// their phases or their periods differ more, the new grid counts as a different grid.
const DIFFERENT: f64 = 0.2;
/// Duration, in seconds, of the stored sound that is searched again for downbeats after a change to
/// a different beat grid.
const HISTORY_S: f64 = 15.0;
/// Factor for the log odds of a bar start from the rhythm pattern (mean sound of the last beats).
/// It is small because the patterns of neighbouring beats share most of their sound, so that each
/// new result adds little.
const PATTERN_WEIGHT: f32 = 0.1;

/// Tracks the beats of a live audio input: finds the beat grid, numbers its beats, and finds the
/// first beats of the bars.
pub(super) struct AudioBeatTracker {
    backend: TrackerBackend,
    scheduler: BeatScheduler,
    bars: BarFilter,
    /// Number (on the timeline) of the latest beat whose downbeat activation the bar filter has
    /// processed.
    bars_until: i64,
    /// True if the beat grid changed to a clearly different one (see [`DIFFERENT`]) after the last
    /// beat got its final time.
    grid_changed: bool,
    /// Sample time (seconds since the first sample) at which the tracker last lost the beats of the
    /// music; 0 if it never lost them.
    lost_at: f64,
    /// Sum of all nudges (shifts of the beats by a performer), in seconds. It is added to the times
    /// of the beats that the backend finds.
    nudge: f64,
    range: PeriodRange,
}

impl AudioBeatTracker {
    /// Creates a tracker whose beats are found by `backend`. Beat periods stay within `range`
    /// (seconds), and bars have the length `bars`.
    pub(super) fn new(backend: TrackerBackend, range: PeriodRange, bars: BarLength) -> Self {
        Self {
            backend,
            scheduler: BeatScheduler::new(bars.initial()),
            bars: BarFilter::new(bars),
            bars_until: 0,
            grid_changed: true,
            lost_at: 0.0,
            nudge: 0.0,
            range,
        }
    }

    /// Processes one hop of `samples`, which ends at sample time `now` (seconds). `active` is true
    /// if the activity gate is open: the input contains music.
    pub(super) fn hop(&mut self, samples: &[f32; HOP], now: f64, active: bool) {
        let had_beat = self.backend.has_beat();
        if let Some(grid) = self.backend.hop(samples, now, active) {
            self.set_grid(grid, now);
        }
        if had_beat && !self.backend.has_beat() {
            self.bars.release();
            self.lost_at = now;
        }
        self.update_bars();
        self.add_pattern_odds();
    }

    /// Makes the time of the next beat final if the beat falls at most 0.06 s after sample time
    /// `now` (seconds). Returns the number and the sample time (seconds) of this beat, or `None` if
    /// the next beat falls later.
    pub(super) fn next_due(&mut self, now: f64) -> Option<(i64, f64)> {
        let due = self.scheduler.next_due(now)?;
        let (before, beat) = self.scheduler.last_complete();
        if let Some(grid) = self
            .backend
            .beat_scheduled(before - self.nudge, beat - self.nudge)
        {
            self.set_grid(grid, now);
        }
        if std::mem::take(&mut self.grid_changed) {
            self.restart_bars(now);
        }
        self.update_bars();
        if self.bars.bars().position(due.0) == 0 {
            self.scheduler.set_bars(self.bars.bars());
        }
        Some(due)
    }

    /// Applies a performer's `edit` of the beat grid, made at sample time `at` (seconds). All
    /// samples up to sample time `now` (seconds) are already processed.
    pub(super) fn apply(&mut self, edit: GridEdit, at: f64, now: f64) {
        let last = self.scheduler.last() - self.nudge;
        let period = self.scheduler.period();
        match edit {
            GridEdit::Tap { period: tapped } => {
                let grid = BeatGrid::from_beat(at - self.nudge, tapped.unwrap_or(period));
                self.seed(grid, now, tapped.is_some());
                self.backend.hold_phase();
            }
            GridEdit::Shift(by) => {
                let nudge = (self.nudge + by).clamp(-NUDGE_MAX_S, NUDGE_MAX_S);
                let grid = self.scheduler.grid().shifted(nudge - self.nudge);
                self.nudge = nudge;
                self.scheduler.set_grid(grid, now);
            }
            GridEdit::ScalePeriod(factor) => {
                let period = period * factor;
                if self.range.contains(period) {
                    self.seed(BeatGrid::from_beat(last, period), now, true);
                }
            }
            GridEdit::SetPeriod(period) => {
                self.seed(BeatGrid::from_beat(last, period), now, true);
            }
            GridEdit::Downbeat => {
                let beat = self.scheduler.timeline().beat_at(Seconds(at)).0.round();
                self.bars.hold(beat as i64);
                self.scheduler.set_bars(self.bars.bars());
            }
        }
    }

    /// Makes tempi near the beat period `period` (seconds) more probable; `None` ends this.
    pub(super) fn hint(&mut self, period: Option<f64>) {
        self.backend.hint(period);
    }

    /// Corrects the bars after input samples were lost. `beats` is the number of beats in the lost
    /// samples; the bars continue as if these beats had been counted.
    pub(super) fn skip_beats(&mut self, beats: i64) {
        self.bars.renumber(-beats);
        self.scheduler.set_bars(self.bars.bars());
    }

    /// Returns true while the tracker follows the beats of the music: false before the first beat
    /// grid is found and after the beats were lost.
    pub(super) fn has_beat(&self) -> bool {
        self.backend.has_beat()
    }

    /// Returns the confidence: the probability that the next beat is right, 0..1.
    pub(super) fn confidence(&self) -> f32 {
        self.backend.confidence()
    }

    /// Returns the current beat period, in seconds.
    pub(super) fn period(&self) -> f64 {
        self.scheduler.period()
    }

    /// Returns the timeline with the latest beats, whose times are final, and the beats predicted
    /// after them. Its times are sample times.
    pub(super) fn timeline(&self) -> &Timeline {
        self.scheduler.timeline()
    }

    /// Makes `grid`, the present grid of the backend, apply to all beats after sample time `now`
    /// (seconds) that have no final time yet. First shifts the grid by the sum of the performer's
    /// nudges.
    fn set_grid(&mut self, grid: BeatGrid, now: f64) {
        let before = self.scheduler.grid();
        let grid = grid.shifted(self.nudge);
        if before.phase_error(grid.time).abs() > DIFFERENT
            || (grid.period / before.period - 1.0).abs() > DIFFERENT
        {
            self.grid_changed = true;
        }
        self.scheduler.set_grid(grid, now);
    }

    /// Returns the number of the latest beat that has been heard in full. It is one less than the
    /// number of the last scheduled beat (beat with a final time).
    fn last_complete(&self) -> i64 {
        self.scheduler.next().0 - 2
    }

    /// Makes each beat equally likely as the start of a bar. Downbeats are then detected again in
    /// up to [`HISTORY_S`] of the sound before sample time `now` (seconds), with the current beat
    /// grid.
    fn restart_bars(&mut self, now: f64) {
        self.bars.forget();
        self.backend.forget_features();
        let since = (now - self.lost_at).min(HISTORY_S);
        self.bars_until = self.last_complete() - 1 - (since / self.period()) as i64;
    }

    /// Processes the next beat if its sound is complete. Passes to the bar filter the downbeat
    /// activation of this beat, and the log odds of the beat that is two beats earlier. Processes
    /// at most one beat per call, to limit the work per hop.
    fn update_bars(&mut self) {
        if self.bars_until >= self.last_complete() {
            return;
        }
        self.bars_until += 1;
        let ((next, at), period) = (self.scheduler.next(), self.period());
        let beat = at - (next - self.bars_until) as f64 * period - self.nudge;
        self.bars
            .add_downbeat(self.bars_until, self.backend.downbeat_at(beat));
        let odds = self.backend.bar_odds(beat - period, beat);
        self.bars.add_odds(self.bars_until - 2, odds.first);
        self.bars.add_length_odds(odds.three);
        self.publish_bars();
    }

    /// Passes the bars that the bar filter has found to the scheduler, unless they have another
    /// length than before. Bars of a new length begin when the first beat of such a bar is
    /// scheduled; until then, the beats are counted as before.
    fn publish_bars(&mut self) {
        let bars = self.bars.bars();
        if bars.beats == self.scheduler.timeline().beats_per_bar() {
            self.scheduler.set_bars(bars);
        }
    }

    /// Takes a new result of the phase classifier, if there is one: the log odds that a certain
    /// beat is the first of its bar, if bars have four beats. Passes it to the bar filter, which
    /// finds the downbeats.
    fn add_pattern_odds(&mut self) {
        let Some((time, odds)) = self.backend.take_bar_start() else {
            return;
        };
        let (next, at) = self.scheduler.next();
        let back = (at - self.nudge - time) / self.period();
        let beat = next - back.round() as i64;
        self.bars
            .add_odds_of_length(beat, PATTERN_WEIGHT * odds, BAR);
        self.publish_bars();
    }

    /// Makes the backend follow `grid`, which a performer set, from sample time `now` (seconds) on.
    /// If `set_tempo` is true, beat periods then stay within half an octave of the grid's period.
    fn seed(&mut self, grid: BeatGrid, now: f64, set_tempo: bool) {
        self.backend.seed(grid, now);
        if set_tempo {
            self.backend.hold_octave(grid.period);
        }
        self.set_grid(grid, now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beat::activation::{Activation, FrontEnd};
    use crate::dsp::{ACTIVATION_HOP, SAMPLE_RATE};

    /// A front end for music with beats at 120 bpm. Its activations are 0 before sample time
    /// `from_s` (seconds); its spectrum changes with every bar of `length` beats.
    struct LateBeats {
        hops: usize,
        from_s: f64,
        length: usize,
        levels: [f32; 58],
    }

    /// Number of the first beat that starts a bar.
    const FIRST: usize = 3;

    impl LateBeats {
        fn new(from_s: f64, length: usize) -> Box<Self> {
            Box::new(Self {
                hops: 0,
                from_s,
                length,
                levels: [0.0; 58],
            })
        }
    }

    impl FrontEnd for LateBeats {
        fn hop(&mut self, _: &[f32; ACTIVATION_HOP]) -> Activation {
            let beat = self.hops / 50 + 4 * self.length - FIRST;
            let chord = beat / self.length % 2;
            self.levels = std::array::from_fn(|band| if band % 2 == chord { 4.0 } else { 1.0 });
            let is_beat = self.hops.is_multiple_of(50) && self.hops as f64 * 0.01 >= self.from_s;
            let is_first = beat.is_multiple_of(self.length);
            self.hops += 1;
            Activation {
                beat: if is_beat { 0.9 } else { 0.02 },
                downbeat: if is_beat && is_first { 0.5 } else { 0.02 },
            }
        }

        fn levels(&self) -> &[f32] {
            &self.levels
        }

        fn delay(&self) -> Seconds {
            Seconds(0.01)
        }
    }

    /// A scheduled beat: its number, its time (seconds), and the bars when it was scheduled.
    type Scheduled = (i64, f64, crate::time::Bars);

    /// Tracks `front_end` for `seconds` and returns the beats that were scheduled on its beats.
    fn track(front_end: Box<LateBeats>, bars: BarLength, seconds: usize) -> Vec<Scheduled> {
        let range = PeriodRange::from_bpm(55.0, 215.0);
        let backend = TrackerBackend::activation(front_end, range);
        let mut tracker = AudioBeatTracker::new(backend, range, bars);
        let mut scheduled = Vec::new();
        for hop in 1..seconds * SAMPLE_RATE as usize / HOP {
            let now = (hop * HOP) as f64 / f64::from(SAMPLE_RATE);
            tracker.hop(&[0.1; HOP], now, true);
            while let Some((number, time)) = tracker.next_due(now) {
                if tracker.has_beat() && (tracker.period() - 0.5).abs() < 0.02 {
                    scheduled.push((number, time, tracker.timeline().bars()));
                }
            }
        }
        scheduled
    }

    #[test]
    fn bars_are_known_soon_after_beats_are_found_late() {
        for bars in [BarLength::Beats(4), BarLength::Auto] {
            let scheduled = track(LateBeats::new(10.0, 4), bars, 14);
            let right: Vec<bool> = scheduled
                .iter()
                .map(|&(number, time, bars)| {
                    let position = ((time / 0.5).round() as usize + 4 - FIRST) % 4;
                    bars.position(number) as usize == position
                })
                .collect();
            // The re-run of downbeat detection starts with the first of these beats.
            assert!(
                right.len() >= 4 && right[1..].iter().all(|&right| right),
                "{right:?}"
            );
        }
    }

    #[test]
    fn a_waltz_is_counted_in_three_from_a_bar_line_on_and_its_beats_stay() {
        let scheduled = track(LateBeats::new(0.0, 3), BarLength::Auto, 30);
        let three = scheduled.iter().position(|(.., bars)| bars.beats == 3);
        let three = three.unwrap();
        assert!(three < 24, "the waltz was found at beat {three}");
        let (before, after) = scheduled.split_at(three);
        assert!(before.iter().all(|(.., bars)| bars.beats == 4));
        assert_eq!(after[0].2.position(after[0].0), 0, "{:?}", after[0]);
        for &(number, time, bars) in after {
            let position = ((time / 0.5).round() as usize + 3 - FIRST) % 3;
            assert_eq!((bars.beats, bars.position(number) as usize), (3, position));
        }
        let fixed = track(LateBeats::new(0.0, 3), BarLength::Beats(4), 30);
        let beats = |all: &[Scheduled]| all.iter().map(|beat| (beat.0, beat.1)).collect::<Vec<_>>();
        assert_eq!(beats(&scheduled), beats(&fixed));
        assert!(fixed.iter().all(|(.., bars)| bars.beats == 4));
    }
}
