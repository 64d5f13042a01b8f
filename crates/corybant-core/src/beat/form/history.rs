//! The inputs of the form network: the sound of the last beats, relative to the loud beats before
//! them. In: the sound of each beat. Out: [`INPUTS`] values per beat. Thread: show. Allocates:
//! never.

use super::sound::{BANDS, BeatSound};
use crate::time::Bars;

/// Number of values per beat: `[0..3]` level of each band, `[3..6]` onsets of each band, `[6]` kick.
const VALUES: usize = 2 * BANDS + 1;
/// Number of inputs of the network: the values of the last beat, their mean over four beats, their
/// difference from the eight beats before, the novelty now and some beats ago, and the place of the
/// next beat in its bar.
pub(super) const INPUTS: usize = 3 * VALUES + 1 + LAGS.len() + 2;
/// Ages of the novelty inputs, in beats: the lengths of phrases.
const LAGS: [usize; 4] = [8, 16, 32, 64];
/// Number of beats whose levels give the reference level of a band.
const REFERENCE_BEATS: usize = 256;
/// Quantile of the levels that is the reference level.
const REFERENCE_QUANTILE: f32 = 0.85;
/// Number of decibels of one unit of the level inputs, and the limits of these inputs.
const LEVEL_UNIT_DB: f32 = 10.0;
const LEVEL_LIMITS: (f32, f32) = (-4.0, 0.6);
/// Number of onset strengths of one unit of the onset inputs.
const ONSET_UNIT: f32 = 4.0;
/// Number of beats whose values are stored: more than the oldest one that is used.
const STORED: usize = 128;

/// The values of the last beats.
pub(super) struct History {
    /// `[band][beat % REFERENCE_BEATS]`: levels, in dBFS.
    levels_db: [[f32; REFERENCE_BEATS]; BANDS],
    /// `[beat % STORED]`: the values of a beat.
    values: [[f32; VALUES]; STORED],
    /// `[beat % STORED]`: the novelty of a beat.
    novelty: [f32; STORED],
    /// Number of beats so far.
    beats: usize,
}

impl History {
    /// Creates a history without beats.
    pub(super) fn new() -> Self {
        Self {
            levels_db: [[0.0; REFERENCE_BEATS]; BANDS],
            values: [[0.0; VALUES]; STORED],
            novelty: [0.0; STORED],
            beats: 0,
        }
    }

    /// Forgets all beats.
    pub(super) fn clear(&mut self) {
        self.beats = 0;
    }

    /// Adds the sound of the beat before the beat `next` of a music with the metre `bars`. Sets
    /// `inputs` to the inputs of the network.
    pub(super) fn push(
        &mut self,
        sound: &BeatSound,
        next: i64,
        bars: Bars,
        inputs: &mut [f32; INPUTS],
    ) {
        let at = self.beats;
        self.beats += 1;
        self.values[at % STORED] = self.relative(sound, at);
        let recent = self.mean(0, 4);
        let before = self.mean(4, 12);
        let distance = recent.iter().zip(before).map(|(a, b)| (a - b) * (a - b));
        self.novelty[at % STORED] = distance.sum::<f32>().sqrt();
        let last = self.values[at % STORED];
        let bar = self.mean(1, 9);
        inputs[..VALUES].copy_from_slice(&last);
        inputs[VALUES..2 * VALUES].copy_from_slice(&recent);
        for (input, (now, then)) in inputs[2 * VALUES..].iter_mut().zip(last.iter().zip(bar)) {
            *input = now - then;
        }
        let novelty = |age: usize| {
            let at = at.checked_sub(age);
            at.map_or(0.0, |at| self.novelty[at % STORED])
        };
        let rest = &mut inputs[3 * VALUES..];
        rest[0] = novelty(0);
        for (input, age) in rest[1..].iter_mut().zip(LAGS) {
            *input = novelty(age);
        }
        let place = bars.position(next);
        rest[1 + LAGS.len()] = f32::from(u8::from(place == 0));
        rest[2 + LAGS.len()] = f32::from(u8::from(place == 2 && bars.beats == 4));
    }

    /// Returns the values of beat number `at`, whose levels are relative to the reference levels.
    fn relative(&mut self, sound: &BeatSound, at: usize) -> [f32; VALUES] {
        let mut values = [0.0; VALUES];
        for band in 0..BANDS {
            self.levels_db[band][at % REFERENCE_BEATS] = sound.levels_db[band];
            let above_db = sound.levels_db[band] - self.reference_db(band);
            values[band] = (above_db / LEVEL_UNIT_DB).clamp(LEVEL_LIMITS.0, LEVEL_LIMITS.1);
            values[BANDS + band] = sound.onsets[band] / ONSET_UNIT;
        }
        values[2 * BANDS] = sound.kick;
        values
    }

    /// Returns the reference level of `band`, in dBFS: a quantile of the levels of the last beats,
    /// between two of them by linear interpolation.
    fn reference_db(&self, band: usize) -> f32 {
        let count = self.beats.min(REFERENCE_BEATS);
        let mut sorted = self.levels_db[band];
        sorted[..count].sort_unstable_by(f32::total_cmp);
        let place = REFERENCE_QUANTILE * (count - 1) as f32;
        let below = place as usize;
        let above = (below + 1).min(count - 1);
        sorted[below] + (sorted[above] - sorted[below]) * (place - below as f32)
    }

    /// Returns the mean of the values of the beats that are `from` to `to` beats old, without `to`;
    /// of the oldest beat if there is none so old.
    fn mean(&self, from: usize, to: usize) -> [f32; VALUES] {
        let end = (self.beats.saturating_sub(from)).max(1);
        let start = self.beats.saturating_sub(to).min(end - 1);
        let mut mean = [0.0; VALUES];
        for at in start..end {
            for (sum, value) in mean.iter_mut().zip(self.values[at % STORED]) {
                *sum += value / (end - start) as f32;
            }
        }
        mean
    }
}
