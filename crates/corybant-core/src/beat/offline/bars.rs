//! Offline estimation of the bars of a recording: the length of each bar, and the bar position of
//! each beat.
//!
//! In: for each beat, log odds that the beat is the first of its bar, and that bars have three and
//! not four beats.
//! Out: the position of each beat in its bar, and the length of this bar.
//! Thread: any.
//! Allocates: yes.
//!
//! A. J. Viterbi's algorithm (1967) finds the likeliest sequence of bar lengths and bar positions;
//! at low probability, a beat may be dropped or added, or the length may change at a bar line.

use crate::beat::bar_length::BarLength;
use crate::beat::phase::pattern::BAR;

/// Natural logarithm of the probability, at each beat, that the bars shift: all later bars start
/// one or more beats earlier or later than before, because a beat was dropped or added.
const SLIP: f32 = -7.0;
/// Natural logarithm of the probability, at each beat, that the length of the bars changes.
const CHANGE: f32 = -12.0;
/// Natural logarithm of the probability that a recording starts with bars of three beats, compared
/// with bars of four.
const THREE: f32 = -2.2;
/// The lengths that bars can have, in beats, if the length is not fixed.
const LENGTHS: [usize; 2] = [3, 4];

/// What is known of one beat, as natural logarithms of odds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BarOdds {
    /// Odds that the beat is the first of its bar.
    pub first: f32,
    /// Odds that bars have three and not four beats.
    pub three: f32,
    /// Odds that the beat is the first of its bar, if bars have four beats. They do not count for
    /// the decision between lengths.
    pub first_of_four: f32,
}

/// The place of a beat in its bar.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// Position of the beat in its bar, counted from 0.
    pub position: u32,
    /// Number of beats in the bar.
    pub beats: u32,
}

/// Returns the place of each beat in its bar.
pub fn places(odds: &[BarOdds], length: BarLength) -> Vec<Place> {
    match length {
        BarLength::Beats(beats) => likeliest_places(odds, &[beats.max(1) as usize], &[]),
        BarLength::Auto => {
            let of_four = likeliest_places(odds, &[BAR], &[]);
            let gains: Vec<f32> = odds
                .iter()
                .zip(&of_four)
                .map(|(odds, place)| {
                    if place.position == 0 {
                        odds.first_of_four
                    } else {
                        0.0
                    }
                })
                .collect();
            likeliest_places(odds, &LENGTHS, &gains)
        }
    }
}

/// A bar grid: bars of `beats` beats that start at the beats `first`, `first + beats`, and so on.
#[derive(Clone, Copy)]
struct Grid {
    beats: usize,
    first: usize,
}

impl Grid {
    fn position(self, beat: usize) -> usize {
        (beat + self.beats - self.first) % self.beats
    }

    /// Returns the log likelihood of the observation `odds` of beat `beat`. Bars of three beats
    /// gain `gain` more.
    fn likelihood(self, beat: usize, odds: &BarOdds, gain: f32) -> f32 {
        let first = match self.beats {
            BAR => odds.first + odds.first_of_four,
            _ => odds.first,
        };
        let at_first = if self.position(beat) == 0 { first } else { 0.0 };
        let of_length = if self.beats == LENGTHS[0] {
            odds.three + gain
        } else {
            0.0
        };
        at_first + of_length
    }
}

/// Returns the likeliest place of each beat for bars whose lengths are among `lengths`.
/// `gains[beat]` is the log likelihood that bars of three beats gain at a beat to make up for the
/// odds that only bars of four have; it may be empty.
fn likeliest_places(odds: &[BarOdds], lengths: &[usize], gains: &[f32]) -> Vec<Place> {
    let grids: Vec<Grid> = lengths
        .iter()
        .flat_map(|&beats| (0..beats).map(move |first| Grid { beats, first }))
        .collect();
    let mixed = lengths.len() > 1;
    // `sums[grid]`: log probability of the best sequence up to the current beat that ends in this
    // grid. `from[beat][grid]`: the grid before that beat in the same sequence.
    let mut sums: Vec<f32> = grids
        .iter()
        .map(|grid| {
            if mixed && grid.beats == LENGTHS[0] {
                THREE
            } else {
                0.0
            }
        })
        .collect();
    let mut from: Vec<Vec<usize>> = Vec::with_capacity(odds.len());
    for (beat, odds) in odds.iter().enumerate() {
        let best_before = |to: Grid| {
            let price = |from: Grid| match () {
                () if from.beats != to.beats && to.position(beat) == 0 => CHANGE,
                () if from.beats != to.beats => f32::NEG_INFINITY,
                () if from.first != to.first => SLIP,
                () => 0.0,
            };
            let reached = |n: usize| sums[n] + price(grids[n]);
            (0..grids.len()).fold((0, f32::NEG_INFINITY), |best, n| {
                let sum = reached(n);
                if sum > best.1 { (n, sum) } else { best }
            })
        };
        let before: Vec<(usize, f32)> = grids.iter().map(|&to| best_before(to)).collect();
        let gain = gains.get(beat).copied().unwrap_or(0.0);
        sums = grids
            .iter()
            .zip(&before)
            .map(|(grid, (_, sum))| sum + grid.likelihood(beat, odds, gain))
            .collect();
        from.push(before.iter().map(|&(grid, _)| grid).collect());
    }
    let mut grid = (0..sums.len()).fold(0, |best, n| if sums[n] > sums[best] { n } else { best });
    let mut places = vec![Place::default(); odds.len()];
    for beat in (0..odds.len()).rev() {
        places[beat] = Place {
            position: grids[grid].position(beat) as u32,
            beats: grids[grid].beats as u32,
        };
        grid = from[beat][grid];
    }
    places
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn odds(beats: usize, is_first: impl Fn(usize) -> bool) -> Vec<BarOdds> {
        let odds = |beat| BarOdds {
            first: if is_first(beat) { 2.0 } else { -0.5 },
            ..BarOdds::default()
        };
        (0..beats).map(odds).collect()
    }

    fn place(position: usize, beats: u32) -> Place {
        Place {
            position: position as u32,
            beats,
        }
    }

    #[test]
    fn later_odds_set_earlier_bars() {
        let odds: Vec<BarOdds> = (0..40)
            .map(|beat| BarOdds {
                first: match beat {
                    0..20 => 0.0,
                    _ if beat % 4 == 3 => 1.0,
                    _ => -0.3,
                },
                ..BarOdds::default()
            })
            .collect();
        for length in [BarLength::Beats(4), BarLength::Auto] {
            let found = places(&odds, length);
            assert!(
                (0..40).all(|beat| found[beat] == place((beat + 1) % 4, 4)),
                "{found:?}"
            );
        }
    }

    #[test]
    fn added_beat_moves_the_bars_and_one_outlier_does_not() {
        let added = odds(80, |beat| (beat + beat / 41) % 4 == 0);
        for length in [BarLength::Beats(4), BarLength::Auto] {
            let found = places(&added, length);
            assert!(
                (0..36).all(|beat| found[beat] == place(beat % 4, 4))
                    && (44..80).all(|beat| found[beat] == place((beat + 1) % 4, 4)),
                "{found:?}"
            );
        }
        let outlier = odds(40, |beat| beat % 3 == 0 || beat == 16);
        for length in [BarLength::Beats(3), BarLength::Auto] {
            let found = places(&outlier, length);
            assert!(
                (0..40).all(|beat| found[beat] == place(beat % 3, 3)),
                "{found:?}"
            );
        }
    }

    #[test]
    fn the_length_changes_at_a_bar_line() {
        let odds = odds(100, |beat| {
            if beat < 48 {
                beat % 4 == 0
            } else {
                beat % 3 == 0
            }
        });
        let found = places(&odds, BarLength::Auto);
        let expected = |beat| {
            if beat < 48 {
                place(beat % 4, 4)
            } else {
                place(beat % 3, 3)
            }
        };
        assert!(
            (0..100).all(|beat| found[beat] == expected(beat)),
            "{found:?}"
        );
        let fixed = places(&odds, BarLength::Beats(4));
        assert!(fixed.iter().all(|place| place.beats == 4));
    }

    #[test]
    fn nothing_known_means_bars_of_four() {
        let found = places(&[BarOdds::default(); 9], BarLength::Auto);
        assert!(
            (0..9).all(|beat| found[beat] == place(beat % 4, 4)),
            "{found:?}"
        );
        assert!(places(&[], BarLength::Auto).is_empty());
    }

    #[test]
    fn odds_for_bars_of_four_do_not_favour_them() {
        let mut waltz = odds(60, |beat| beat % 3 == 1);
        for (beat, odds) in waltz.iter_mut().enumerate() {
            odds.first_of_four = if beat % 4 == 0 { 3.0 } else { -3.0 };
        }
        let found = places(&waltz, BarLength::Auto);
        assert!(
            (0..60).all(|beat| found[beat] == place((beat + 2) % 3, 3)),
            "{found:?}"
        );
    }

    proptest! {
        #[test]
        fn every_bar_is_counted_from_the_start(
            observed in prop::collection::vec((-4.0..4.0f32, -2.0..2.0f32, -1.0..1.0f32), 0..200)
        ) {
            let odds: Vec<BarOdds> = observed
                .iter()
                .map(|&(first, three, first_of_four)| BarOdds { first, three, first_of_four })
                .collect();
            let found = places(&odds, BarLength::Auto);
            prop_assert_eq!(found.len(), odds.len());
            for pair in found.windows(2) {
                prop_assert!(pair[1].position < pair[1].beats);
                prop_assert!(pair[0].beats == pair[1].beats || pair[1].position == 0);
            }
        }
    }
}
