//! Repetition: whether the music of a beat resembles the beats three and six beats before, or those
//! four and eight beats before.
//!
//! In: a value of each beat.
//! Out: log odds that bars have three and not four beats.
//! Thread: show.
//! Allocates: never.
//!
//! Beats at the same position of their bars sound alike (M. Gainza, "Automatic musical meter
//! detection", ICASSP 2009). The log odds need no knowledge of where bars start. Their weights were
//! fitted to the validation set of the training.

use crate::maths;

/// Number of latest beats that are stored: the present one and the eight before it.
const STORED: usize = 9;
/// Weight of the products of downbeat activations in the log odds.
const ACTIVATION_WEIGHT: f32 = 1.0;
/// Weight of the similarity of onsets in the log odds.
const ONSET_WEIGHT: f32 = 0.6;
/// Constant that is added to sums of differences of onsets before their ratio is computed.
const DIFFERENCE_MIN: f32 = 0.2;

/// The values of the latest beats.
#[derive(Clone, Debug)]
pub struct History<T> {
    /// Ring buffer: beat number n (since the first one) is at index n modulo its length.
    values: [T; STORED],
    /// Number of beats that were added since the last call of [`History::forget`].
    added: usize,
}

impl<T: Copy + Default> History<T> {
    /// Creates an empty history.
    pub fn new() -> Self {
        Self {
            values: [T::default(); STORED],
            added: 0,
        }
    }

    /// Adds the value of the next beat.
    pub fn add(&mut self, value: T) {
        self.values[self.added % STORED] = value;
        self.added += 1;
    }

    /// Forgets all beats.
    pub fn forget(&mut self) {
        self.added = 0;
    }

    /// Returns the value of the latest beat, and the values of the beats three, six, four and eight
    /// beats before it; `None` if fewer than nine beats are known.
    fn compared(&self) -> Option<(T, [T; 4])> {
        let latest = self.added.checked_sub(STORED)? + STORED - 1;
        let value = |back: usize| self.values[(latest - back) % STORED];
        Some((value(0), [3, 6, 4, 8].map(value)))
    }
}

impl History<f32> {
    /// Returns the log odds that bars have three and not four beats, from the downbeat activations.
    /// A value is the log ratio of the activation to its running mean. Returns 0 if too few beats
    /// are known.
    pub fn activation_odds(&self) -> f32 {
        self.compared()
            .map_or(0.0, |(now, [three, six, four, eight])| {
                ACTIVATION_WEIGHT * now * (three + six - four - eight)
            })
    }
}

impl<const BANDS: usize> History<OnsetBands<BANDS>> {
    /// Returns the log odds that bars have three and not four beats, from the onsets of the beats.
    /// A value is the rise of the level in each frequency band. Returns 0 if too few beats are
    /// known.
    pub fn onset_odds(&self) -> f32 {
        self.compared()
            .map_or(0.0, |(now, [three, six, four, eight])| {
                let difference = |other: OnsetBands<BANDS>| {
                    let bands = now.0.iter().zip(&other.0);
                    bands.map(|(now, other)| (now - other).abs()).sum::<f32>() / BANDS as f32
                };
                let sum = |one, other| difference(one) + difference(other) + DIFFERENCE_MIN;
                ONSET_WEIGHT * maths::ln(sum(four, eight) / sum(three, six))
            })
    }
}

/// The rise of the level in each frequency band at a beat.
#[derive(Clone, Copy, Debug)]
pub struct OnsetBands<const BANDS: usize>(pub [f32; BANDS]);

impl<const BANDS: usize> Default for OnsetBands<BANDS> {
    fn default() -> Self {
        Self([0.0; BANDS])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_repeat_after_a_bar_show_its_length() {
        for length in [3, 4] {
            let (mut activations, mut onsets) = (History::new(), History::new());
            let (mut activation_sum, mut onset_sum) = (0.0, 0.0);
            for beat in 0..40 {
                let is_first = beat % length == 1;
                activations.add(if is_first { 1.2f32 } else { -0.4 });
                onsets.add(OnsetBands(if is_first { [2.0, 0.1] } else { [0.1, 2.0] }));
                let odds = (activations.activation_odds(), onsets.onset_odds());
                assert!(beat >= 8 || odds == (0.0, 0.0), "beat {beat}: {odds:?}");
                activation_sum += odds.0;
                onset_sum += odds.1;
            }
            let is_three = length == 3;
            assert_eq!(activation_sum > 5.0, is_three, "{activation_sum}");
            assert_eq!(activation_sum < -5.0, !is_three, "{activation_sum}");
            assert_eq!(onset_sum > 5.0, is_three, "{onset_sum}");
            assert_eq!(onset_sum < -5.0, !is_three, "{onset_sum}");
        }
    }

    #[test]
    fn equal_beats_show_nothing() {
        let (mut activations, mut onsets) = (History::new(), History::new());
        for _ in 0..20 {
            activations.add(0.3);
            onsets.add(OnsetBands([1.0; 3]));
        }
        assert!(activations.activation_odds().abs() < 1e-6);
        assert_eq!(onsets.onset_odds(), 0.0);
        onsets.forget();
        onsets.add(OnsetBands([5.0; 3]));
        assert_eq!(onsets.onset_odds(), 0.0);
    }
}
