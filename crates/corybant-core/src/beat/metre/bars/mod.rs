//! The bar filter: decides how long the bars are, and which beats are the first of their bars.
//!
//! In: for each beat, its downbeat activation, the log odds from its downbeat features, and the log
//! odds that bars have three and not four beats.
//! Out: where bars start, and their length.
//! Thread: show.
//! Allocates: never.
//!
//! A forward (Bayesian) filter over the length of the bar and the position in it, with one step per
//! beat. Tempo and phase come from the bar pointer HMM.
//!
//! An observation of a beat multiplies the probability of every bar grid that has a bar start at
//! this beat, whatever its length. It therefore must be near 0 on average, or it would favour short
//! bars. Results that assume a bar length change only the grids of this length, and leave their sum
//! as it is.
//!
//! If the length is not fixed, music counts as having bars of four until bars of three are much
//! likelier for a whole bar.

use crate::beat::bar_length::BarLength;
use crate::beat::metre::repetition::History;
use crate::maths;
use crate::time::Bars;

/// Number of beats in the longest supported bar.
const BEATS_MAX: usize = 4;
/// The two bar lengths between which the filter decides, in beats.
const LENGTHS: [usize; 2] = [3, 4];
/// Probability, before any observation, of bars of three beats and of four beats.
const PRIOR: [f32; 2] = [0.1, 0.9];
/// Probability, at each beat, that the bars shift: all later bars start one or more beats earlier
/// or later than before, because the music or the tracker dropped or added a beat.
const SLIP: f32 = 0.01;
/// Probability, at each beat, that other music starts, whose bars may have another length.
const NEW_MUSIC: f32 = 0.002;
/// Share of the knowledge of the bar length that remains when the beats were lost.
const KEPT_AFTER_LOSS: f32 = 0.5;
/// Constant that reduces the effect of differences between small activations. The downbeat
/// activation of a beat is divided by its running mean; the constant is added to both first.
const FLOOR: f32 = 0.1;
/// Weight of the downbeat activation of a beat, used as an exponent. The activation divided by its
/// running mean, to this power, multiplies the odds that a bar starts at the beat.
const DOWNBEAT_WEIGHT: f32 = 0.5;
/// Greatest factor by which one observation multiplies or divides the odds that a bar starts at a
/// beat. An observation comes from the downbeat activation, the downbeat features or the rhythm
/// pattern.
const TIMES_MAX: f32 = 8.0;
/// Weight (0..1) of the old value when a beat updates the running mean of the downbeat activations.
const KEEP: f32 = 0.9;
/// Least probability of another bar start, among the starts of bars of the present length, at which
/// the filter moves the bars to it. This start must also be more than [`BETTER`] times as probable
/// as the present one.
const SURE: f32 = 0.4;
/// Least ratio of the probability of another bar start to that of the present one at which the
/// filter moves the bars. The other start must also be more probable than [`SURE`].
const BETTER: f32 = 1.3;
/// Least probability of bars of three beats and of four beats at which the filter changes to this
/// length. It is lower for four, because most music has bars of four.
const LENGTH_SURE: [f32; 2] = [0.9, 0.5];
/// Number of beats in a row for which another length must be as probable as [`LENGTH_SURE`] before
/// the bars change to it.
const LENGTH_BEATS: u32 = 4;

/// Greatest factor by which one observation multiplies or divides the odds that bars have three
/// beats.
const LENGTH_TIMES_MAX: f32 = std::f32::consts::E;

/// Estimates the length of the bars and which beats are the first of their bars: a Bayesian filter
/// over the downbeat activation and the downbeat features of each beat.
pub struct BarFilter {
    bars: Bars,
    grids: BarGrids,
    /// Running mean of the downbeat activations of the beats, 0..1; `None` before the first beat.
    mean: Option<f32>,
    /// Log ratios of the downbeat activations of the latest beats to their running mean.
    activations: History<f32>,
    /// Number of beats in a row at which another length was as probable as [`LENGTH_SURE`].
    other_length_beats: u32,
    /// True if a performer chose the beat at which bars start. The observations then do not change
    /// it.
    held: bool,
}

/// The probabilities of all bar grids: of all lengths and all starts.
struct BarGrids {
    /// Number of valid entries in `lengths` and `first`: 1 if the length of the bars is fixed.
    count: usize,
    /// Lengths that bars can have, in beats.
    lengths: [usize; LENGTHS.len()],
    /// Probability of each length before any observation.
    prior: [f32; LENGTHS.len()],
    /// `[i][n]`: probability that bars have `lengths[i]` beats and start at the beats n, n +
    /// length, n + 2 length and so on. Entries from n = length on are not used.
    first: [[f32; BEATS_MAX]; LENGTHS.len()],
}

impl BarFilter {
    /// Creates a filter for bars of this length. Each beat is equally likely as the start of a bar.
    pub fn new(length: BarLength) -> Self {
        let beats = length.initial().clamp(1, BEATS_MAX as u32);
        Self {
            bars: Bars { first: 0, beats },
            grids: BarGrids::new(length),
            mean: None,
            activations: History::new(),
            other_length_beats: 0,
            held: false,
        }
    }

    /// Processes the downbeat activation (0..1) of beat `number`. If another beat has become
    /// clearly likelier as the start of the bar, bars start there from now on.
    pub fn add_downbeat(&mut self, number: i64, downbeat: f32) {
        self.grids.step();
        let mean = self.mean.unwrap_or(downbeat);
        self.mean = Some(downbeat + (mean - downbeat) * KEEP);
        let ratio = maths::ln((downbeat + FLOOR) / (mean + FLOOR));
        self.add_odds(number, DOWNBEAT_WEIGHT * ratio);
        self.activations.add(ratio);
        self.grids
            .multiply_length(times(self.activations.activation_odds(), LENGTH_TIMES_MAX));
    }

    /// Processes an observation of beat `number`: `log_odds` is the natural logarithm of the odds
    /// that this beat is the first of its bar. If another beat has become clearly likelier as the
    /// start of the bar, bars start there from now on.
    pub fn add_odds(&mut self, number: i64, log_odds: f32) {
        self.grids.multiply(number, times(log_odds, TIMES_MAX));
        self.decide_first();
    }

    /// Processes an observation of beat `number` that assumes bars of `length` beats: `log_odds` is
    /// the natural logarithm of the odds that this beat is the first of its bar. It does not change
    /// the probability of the length.
    pub fn add_odds_of_length(&mut self, number: i64, log_odds: f32, length: usize) {
        self.grids
            .multiply_within(number, times(log_odds, TIMES_MAX), length);
        self.decide_first();
    }

    /// Processes an observation of the latest beat: `log_odds` is the natural logarithm of the odds
    /// that bars have three and not four beats. Must be called once per beat. If another length has
    /// been clearly likelier for a whole bar, bars have this length from now on.
    pub fn add_length_odds(&mut self, log_odds: f32) {
        self.grids
            .multiply_length(times(log_odds, LENGTH_TIMES_MAX));
        let present = self.bars.beats as usize;
        let other = self
            .grids
            .lengths()
            .position(|length| length != present && self.grids.share(length) > length_sure(length));
        let Some(other) = other.filter(|_| !self.held) else {
            self.other_length_beats = 0;
            return;
        };
        self.other_length_beats += 1;
        if self.other_length_beats == LENGTH_BEATS {
            self.other_length_beats = 0;
            let length = self.grids.lengths[other];
            self.bars = Bars {
                first: self.grids.likeliest(length) as i64,
                beats: length as u32,
            };
        }
    }

    /// Makes each beat equally likely as the start of a bar. The bars do not change until new
    /// observations show another start.
    pub fn forget(&mut self) {
        self.restart(1.0);
    }

    /// Adds `by` to the numbers of all past beats; bars then still start at the same beats, under
    /// their new numbers.
    pub fn renumber(&mut self, by: i64) {
        self.bars.first += by;
        self.grids.renumber(by);
        self.activations.forget();
    }

    /// Makes beat `number` the first of its bar. Observations then change neither the start nor the
    /// length of the bars until [`BarFilter::release`] is called.
    ///
    /// If the length is not fixed and the last call chose a beat one bar of an allowed length
    /// before, bars have this length.
    pub fn hold(&mut self, number: i64) {
        let apart = number - self.bars.first;
        if self.held && self.grids.count > 1 && self.grids.lengths().any(|n| n as i64 == apart) {
            self.bars.beats = apart as u32;
        }
        self.bars.first = number;
        self.held = true;
    }

    /// Ends the effect of [`BarFilter::hold`]: observations can change the bars again. Each beat is
    /// then equally likely as the start of a bar.
    pub fn release(&mut self) {
        self.held = false;
        self.restart(KEPT_AFTER_LOSS);
    }

    /// Returns the metre: a beat at which a bar starts, and the number of beats per bar.
    pub fn bars(&self) -> Bars {
        self.bars
    }

    fn restart(&mut self, kept: f32) {
        self.grids.forget(kept);
        self.activations.forget();
        self.other_length_beats = 0;
    }

    /// Moves the start of the bars if another start has become clearly likelier.
    fn decide_first(&mut self) {
        let length = self.bars.beats as usize;
        let Some(first) = self.grids.first_of(length).filter(|_| !self.held) else {
            return;
        };
        let now = self.bars.first.rem_euclid(length as i64) as usize;
        let best = self.grids.likeliest(length);
        let sum: f32 = first.iter().sum();
        if first[best] > SURE * sum && first[best] > BETTER * first[now] {
            self.bars.first = best as i64;
        }
    }
}

impl BarGrids {
    fn new(length: BarLength) -> Self {
        let fixed = |beats: u32| {
            (
                1,
                [beats.clamp(1, BEATS_MAX as u32) as usize; 2],
                [1.0, 0.0],
            )
        };
        let (count, lengths, prior) = match length {
            BarLength::Auto => (LENGTHS.len(), LENGTHS, PRIOR),
            BarLength::Beats(beats) => fixed(beats),
        };
        let mut grids = Self {
            count,
            lengths,
            prior,
            first: [[0.0; BEATS_MAX]; LENGTHS.len()],
        };
        grids.forget(0.0);
        grids
    }

    /// Returns the lengths that bars can have.
    fn lengths(&self) -> impl Iterator<Item = usize> + '_ {
        self.lengths[..self.count].iter().copied()
    }

    /// Returns the probabilities of the starts of bars of `length` beats; `None` if bars cannot
    /// have this length.
    fn first_of(&self, length: usize) -> Option<&[f32]> {
        let index = self.lengths().position(|other| other == length)?;
        Some(&self.first[index][..length])
    }

    /// Returns the probability that bars have `length` beats.
    fn share(&self, length: usize) -> f32 {
        self.first_of(length)
            .map_or(0.0, |first| first.iter().sum())
    }

    /// Returns the likeliest start of bars of `length` beats.
    fn likeliest(&self, length: usize) -> usize {
        let first = self.first_of(length).unwrap_or(&[]);
        (0..first.len()).fold(0, |best, n| if first[n] > first[best] { n } else { best })
    }

    /// Calls `change` with the index, the length and the probabilities of the starts of each
    /// length. Then divides all probabilities by their sum.
    fn change(&mut self, mut change: impl FnMut(usize, usize, &mut [f32])) {
        for index in 0..self.count {
            let length = self.lengths[index];
            change(index, length, &mut self.first[index][..length]);
        }
        let sum: f32 = self.lengths().map(|length| self.share(length)).sum();
        for first in &mut self.first[..self.count] {
            first.iter_mut().for_each(|first| *first /= sum);
        }
    }

    /// Moves the probabilities on by one beat: bars may shift, and other music may start.
    fn step(&mut self) {
        let prior = self.prior;
        self.change(|index, length, first| {
            let share: f32 = first.iter().sum();
            let added = (SLIP * share + NEW_MUSIC * prior[index]) / length as f32;
            for first in first {
                *first = *first * (1.0 - SLIP - NEW_MUSIC) + added;
            }
        });
    }

    /// Multiplies by `times` the probabilities of all grids with a bar start at beat `number`.
    fn multiply(&mut self, number: i64, times: f32) {
        self.change(|_, length, first| {
            first[number.rem_euclid(length as i64) as usize] *= times;
        });
    }

    /// Multiplies by `times` the probability that bars have `within` beats and one starts at beat
    /// `number`. The probability that bars have `within` beats stays the same.
    fn multiply_within(&mut self, number: i64, times: f32, within: usize) {
        self.change(|_, length, first| {
            if length == within {
                let before: f32 = first.iter().sum();
                first[number.rem_euclid(length as i64) as usize] *= times;
                let after: f32 = first.iter().sum();
                first.iter_mut().for_each(|first| *first *= before / after);
            }
        });
    }

    /// Multiplies by `times` the odds that bars have three and not four beats. Does nothing if the
    /// length is fixed.
    fn multiply_length(&mut self, times: f32) {
        if self.count > 1 {
            self.change(|_, length, first| {
                if length == LENGTHS[0] {
                    first.iter_mut().for_each(|first| *first *= times);
                }
            });
        }
    }

    /// Makes all starts of the same length equally likely. `kept` is the share, 0..1, of the
    /// present probability of each length that remains; the rest is its prior.
    fn forget(&mut self, kept: f32) {
        let prior = self.prior;
        self.change(|index, length, first| {
            let share: f32 = first.iter().sum();
            first.fill((kept * share + (1.0 - kept) * prior[index]) / length as f32);
        });
    }

    fn renumber(&mut self, by: i64) {
        self.change(|_, length, first| first.rotate_right(by.rem_euclid(length as i64) as usize));
    }
}

/// Returns the factor e to the power of `log_odds`, clamped to 1 / `most` to `most`.
fn times(log_odds: f32, most: f32) -> f32 {
    maths::exp(log_odds).clamp(1.0 / most, most)
}

/// Returns the least probability of bars of `length` beats at which the filter changes to this
/// length.
fn length_sure(length: usize) -> f32 {
    LENGTH_SURE[usize::from(length != LENGTHS[0])]
}

#[cfg(test)]
mod tests;
