//! Downbeat features: how much the spectrum and the harmony change at a beat, and how strong the
//! onset at the beat is.
//!
//! In: band levels and decimated samples, hop by hop; and each beat once its sound is complete.
//! Out: log odds that a beat is the first of its bar, and that bars have three and not four beats,
//! for [`bars`](crate::beat::metre::bars).
//! Thread: show.
//! Allocates: never after `new`.
//!
//! Harmony changes mostly at bar lines (M. Goto, "An audio-based real-time beat tracking system for
//! music with or without drum-sounds", JNMR 2001). Novelty compares the band levels and semitone
//! levels of two beats with those of the two beats before them.

use crate::beat::metre::chroma::{self, Chroma, NOTES};
use crate::beat::metre::repetition::{History, OnsetBands};
use crate::dsp::ACTIVATION_HOP;
use crate::dsp::SAMPLE_RATE;
use crate::dsp::decimator::{DECIMATED_HOP, DECIMATED_RATE_HZ, DECIMATOR_DELAY_S, DecimatedHop};
use crate::maths;

/// Length, in hops, of the ring buffers of band levels and decimated samples (20 s). If the beat
/// grid is found late, the beats before that moment can still be analysed.
pub const HOPS: usize = 2048;
/// Number of activation hops per second (100).
const HOPS_HZ: f64 = SAMPLE_RATE as f64 / ACTIVATION_HOP as f64;
/// Time, in seconds, from a beat to the hop in whose spectrum the beat appears.
const DELAY_S: f64 = 0.03;
/// Hops in which the onset of a beat is searched: the number of hops before the beat, and the
/// number of hops after it.
const AROUND: (usize, usize) = (3, 5);
/// Number of hops over which the rise of a spectrum band is measured. The rise is the level of the
/// band minus its level this many hops before.
const RISE_HOPS: usize = 2;
/// The two frequency ranges in which onset strengths are measured: up to 350 Hz, and 350 Hz to 2
/// kHz. Each pair is the index of the first spectrum band and the index after the last one.
const PARTS: [(usize, usize); 2] = [(0, 14), (14, 34)];
/// Number of spectrum bands that are analysed: all bands up to 2 kHz.
const BANDS: usize = 34;
/// Weights of two onset strengths in the log odds of a bar start. The entries are for onsets below
/// 350 Hz, such as those of a bass drum, and for onsets from 350 Hz to 2 kHz, such as those of a
/// snare drum, which mostly plays on other beats. The second weight was set on the validation set of
/// the training, the first one was fitted to music that was composed for training.
const ONSET_WEIGHTS: [f32; 2] = [0.55, -0.2];
/// Weights of three novelties (measures of the change of the sound) in the log odds of a bar start.
/// The entries are for the spectrum bands from 350 Hz to 2 kHz, for the semitones below 370 Hz, and
/// for the semitones above 370 Hz. The weights were fitted to music that was composed for training.
const NOVELTY_WEIGHTS: [f32; 3] = [0.95, 0.95, 0.7];
/// Number of analysed semitones below 370 Hz: those with the lowest indices.
const LOW_NOTES: usize = 21;
/// Constant that reduces the effect of differences between small novelties (changes of the sound).
/// A novelty is divided by its running mean; the constant is added to both first.
const NOVELTY_FLOOR: f32 = 0.05;
/// Constant that reduces the effect of differences between small onset strengths. An onset strength
/// is divided by its running mean; the constant is added to both first.
const ONSET_FLOOR: f32 = 0.1;
/// Limit of the absolute value of a natural logarithm: that of a novelty, or an onset strength,
/// divided by its running mean. Greater values are clamped.
const RATIO_MAX: f32 = 2.0;
/// Weight (0..1) of the old value when a beat updates the running mean of a novelty (change of the
/// sound) or of an onset strength.
const KEEP: f32 = 0.9;
/// Number of beats whose sound is compared to compute novelty: the last two beats are compared with
/// the two beats before them.
const COMPARED: usize = 4;

/// `[band]`: level of a spectrum band; only the first [`BANDS`] bands are stored.
type Levels = [f32; BANDS];

/// The sound of one beat: its band levels and its semitone levels.
#[derive(Clone, Copy)]
struct Beat {
    /// `[band]`: mean level of the spectrum band over the beat.
    bands: Levels,
    /// `[semitone]`: level of the semitone in the spectrum of the whole beat.
    notes: chroma::Levels,
}

/// Results for the beats, as natural logarithms of odds; 0 where nothing is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BeatOdds {
    /// Odds that the beat before the latest beat is the first of its bar.
    pub first: f32,
    /// Odds that bars have three and not four beats, as far as the onset of the latest beat shows.
    pub three: f32,
}

/// A running mean over beats; `mean` is `None` before the first beat.
#[derive(Clone, Copy, Debug, Default)]
struct RunningMean {
    mean: Option<f32>,
}

impl RunningMean {
    /// Updates the running mean with `value` and returns the natural logarithm of the ratio of
    /// `value` to the old mean. `floor` is added to both before the division. The result is clamped
    /// to plus or minus [`RATIO_MAX`].
    fn ratio(&mut self, value: f32, floor: f32) -> f32 {
        let mean = self.mean.unwrap_or(value);
        self.mean = Some(value + (mean - value) * KEEP);
        maths::ln((value + floor) / (mean + floor)).clamp(-RATIO_MAX, RATIO_MAX)
    }
}

/// Computes for each beat the log odds that the beat is the first of its bar, from changes of the
/// sound and from onset strengths.
pub struct DownbeatFeatures {
    /// Ring buffer of the band levels of the latest `HOPS` hops.
    hops: Vec<Levels>,
    /// Ring buffer of the decimated samples of the latest `HOPS` hops.
    decimated: Vec<DecimatedHop>,
    notes: Chroma,
    /// Number of hops that were processed since the start.
    hop_count: usize,
    /// The latest beats whose sound is complete, the newest first. Only the first `known` entries
    /// are valid.
    beats: [Beat; COMPARED],
    /// Number of valid entries in `beats`.
    known: usize,
    /// Log odds that the latest beat is the first of its bar, from its onset strength only. The
    /// part from the change of the sound is added when the next beat is complete.
    onset: f32,
    novelties: [RunningMean; NOVELTY_WEIGHTS.len()],
    onsets: [RunningMean; PARTS.len()],
    /// The rises of the spectrum bands at the onsets of the latest beats.
    rises: History<OnsetBands<BANDS>>,
}

impl DownbeatFeatures {
    /// Creates a state that has processed no hops and no beats.
    pub fn new() -> Self {
        Self {
            hops: vec![[0.0; BANDS]; HOPS],
            decimated: vec![[0.0; DECIMATED_HOP]; HOPS],
            notes: Chroma::new(),
            hop_count: 0,
            beats: [Beat {
                bands: [0.0; BANDS],
                notes: [0.0; NOTES],
            }; COMPARED],
            known: 0,
            onset: 0.0,
            novelties: [RunningMean::default(); NOVELTY_WEIGHTS.len()],
            onsets: [RunningMean::default(); PARTS.len()],
            rises: History::new(),
        }
    }

    /// Adds one hop to the ring buffers: its spectrum band `levels` (the first [`BANDS`] are
    /// stored) and its decimated samples.
    pub fn hop(&mut self, levels: &[f32], decimated: &DecimatedHop) {
        if let Some(levels) = levels.first_chunk() {
            self.hops[self.hop_count % HOPS] = *levels;
        }
        self.decimated[self.hop_count % HOPS] = *decimated;
        self.hop_count += 1;
    }

    /// Processes the sound of the beat from `from` to `to` (sample times in seconds). Returns the
    /// log odds that the beat of the *previous* call is the first of its bar, and those that bars
    /// have three and not four beats.
    pub fn beat(&mut self, from: f64, to: f64) -> BeatOdds {
        let hop = |time: f64| ((time + DELAY_S) * HOPS_HZ).round().max(0.0) as usize;
        let (first, end) = (hop(from), hop(to).min(self.hop_count));
        if end <= first || first + HOPS < self.hop_count + RISE_HOPS + AROUND.0 {
            self.forget();
            return BeatOdds::default();
        }
        self.beats.rotate_right(1);
        self.beats[0] = Beat {
            bands: self.mean(first, end),
            notes: self.notes(from, to),
        };
        self.known = (self.known + 1).min(COMPARED);
        let novelty = if self.known == COMPARED {
            self.novelty()
        } else {
            0.0
        };
        let rises = self.rises_at(first, end);
        let onset = self.onset(&rises);
        self.rises.add(OnsetBands(rises));
        BeatOdds {
            first: novelty + std::mem::replace(&mut self.onset, onset),
            three: self.rises.onset_odds(),
        }
    }

    /// Forgets the sound of all past beats. Later beats are then not compared with them.
    pub fn forget(&mut self) {
        self.known = 0;
        self.onset = 0.0;
        self.rises.forget();
    }

    fn mean(&self, first: usize, end: usize) -> Levels {
        let mut mean = [0.0; BANDS];
        for hop in first..end {
            mean.iter_mut()
                .zip(&self.hops[hop % HOPS])
                .for_each(|(mean, level)| *mean += level);
        }
        mean.map(|sum| sum / (end - first) as f32)
    }

    /// Returns the level of each semitone in the sound between the sample times `from` and `to`
    /// (seconds).
    fn notes(&mut self, from: f64, to: f64) -> chroma::Levels {
        let at = |time: f64| {
            (((time + DECIMATOR_DELAY_S) * DECIMATED_RATE_HZ)
                .round()
                .max(0.0) as usize)
                .min(self.hop_count * DECIMATED_HOP)
        };
        let decimated = &self.decimated;
        self.notes.levels(
            (at(from)..at(to)).map(|n| decimated[n / DECIMATED_HOP % HOPS][n % DECIMATED_HOP]),
        )
    }

    /// Returns the part of the log odds of a bar start that results from novelty: the change of the
    /// sound from two beats to the next two. A change of the overall level has no effect.
    fn novelty(&mut self) -> f32 {
        let [a, b, c, d] = &self.beats;
        let (low, high) = PARTS[1];
        let bands =
            deviation((low..high).map(|i| a.bands[i] + b.bands[i] - c.bands[i] - d.bands[i]));
        let notes = |part: std::ops::Range<usize>| {
            deviation(part.map(|i| a.notes[i] + b.notes[i] - c.notes[i] - d.notes[i]))
        };
        let changes = [bands, notes(0..LOW_NOTES), notes(LOW_NOTES..NOTES)];
        let weighted = changes.iter().zip(NOVELTY_WEIGHTS).zip(&mut self.novelties);
        weighted
            .map(|((change, weight), usual)| weight * usual.ratio(change / 2.0, NOVELTY_FLOOR))
            .sum()
    }

    /// Returns the greatest rise of each spectrum band around the beat at hop number `at`. Hops from
    /// number `end` on are not used.
    fn rises_at(&self, at: usize, end: usize) -> Levels {
        let mut rises = [0.0f32; BANDS];
        for hop in at.saturating_sub(AROUND.0).max(RISE_HOPS)..(at + AROUND.1 + 1).min(end) {
            let (now, before) = (&self.hops[hop % HOPS], &self.hops[(hop - RISE_HOPS) % HOPS]);
            rises
                .iter_mut()
                .zip(now.iter().zip(before))
                .for_each(|(rise, (now, before))| *rise = rise.max(now - before));
        }
        rises
    }

    /// Returns the part of the log odds of a bar start that results from the onset strength of a
    /// beat, whose spectrum bands rise by `rises`.
    fn onset(&mut self, rises: &Levels) -> f32 {
        let weighted = PARTS.iter().zip(ONSET_WEIGHTS).zip(&mut self.onsets);
        let mean =
            |low: usize, high: usize| rises[low..high].iter().sum::<f32>() / (high - low) as f32;
        weighted
            .map(|((&(low, high), weight), usual)| {
                weight * usual.ratio(mean(low, high), ONSET_FLOOR)
            })
            .sum()
    }
}

/// Returns the population standard deviation of `values`.
fn deviation(values: impl ExactSizeIterator<Item = f32> + Clone) -> f32 {
    let count = values.len() as f32;
    let mean = values.clone().sum::<f32>() / count;
    (values
        .map(|value| maths::powi(value - mean, 2))
        .sum::<f32>()
        / count)
        .sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns, for each beat from beat 0, the log odds that it is the first of its bar. The sound
    /// changes every `hold` beats between two spectra; beat `first` has the first change. A beat is
    /// 0.5 s long.
    fn odds(hold: usize, first: usize) -> Vec<f32> {
        let mut features = DownbeatFeatures::new();
        let mut all = Vec::new();
        for beat in 0..40 {
            let chord = (beat + hold - first) / hold % 2;
            let levels: Vec<f32> = (0..BANDS)
                .map(|band| if band % 2 == chord { 4.0 } else { 1.0 })
                .collect();
            (0..50).for_each(|_| features.hop(&levels, &[0.0; DECIMATED_HOP]));
            if beat > 1 {
                all.push(
                    features
                        .beat((beat - 1) as f64 * 0.5, beat as f64 * 0.5)
                        .first,
                );
            }
        }
        all
    }

    #[test]
    fn beats_with_a_chord_change_have_high_odds() {
        for first in 0..4 {
            // `all[i]` belongs to beat i.
            let all = odds(4, first);
            for (beat, &odds) in all.iter().enumerate().skip(12) {
                assert_eq!(
                    odds > 0.5,
                    beat % 4 == first,
                    "beat {beat}, first {first}: {odds}"
                );
            }
        }
    }

    #[test]
    fn steady_sound_has_no_odds() {
        let mut features = DownbeatFeatures::new();
        (0..200).for_each(|_| features.hop(&[1.0; BANDS], &[0.0; DECIMATED_HOP]));
        let odds: Vec<BeatOdds> = (0..3)
            .map(|beat| features.beat(0.1 + f64::from(beat) * 0.5, 0.6 + f64::from(beat) * 0.5))
            .collect();
        assert_eq!(odds, [BeatOdds::default(); 3]);
    }

    #[test]
    fn beats_outside_the_memory_and_empty_beats_are_skipped() {
        let mut features = DownbeatFeatures::new();
        (0..1000).for_each(|_| features.hop(&[1.0; BANDS], &[0.0; DECIMATED_HOP]));
        let unknown = BeatOdds::default();
        assert_eq!(features.beat(0.0, 0.5), unknown);
        assert_eq!(features.beat(9.0, 9.0), unknown);
        assert_eq!(features.beat(12.0, 12.5), unknown);
        assert_eq!(features.beat(f64::NAN, f64::INFINITY), unknown);
    }
}
