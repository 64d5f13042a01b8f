use proptest::prelude::*;

use super::*;

fn fixed(beats: u32) -> BarFilter {
    BarFilter::new(BarLength::Beats(beats))
}

/// Adds beat `number` of music whose downbeats have a higher activation and higher odds.
fn add(filter: &mut BarFilter, number: i64, is_first: bool) {
    filter.add_downbeat(number, if is_first { 0.9 } else { 0.1 });
    filter.add_odds(number, if is_first { 0.6 } else { -0.2 });
    filter.add_length_odds(0.0);
}

/// Adds the beats `numbers` of music in bars of `length` beats, one of which starts at beat
/// `first`.
fn play(filter: &mut BarFilter, numbers: std::ops::Range<i64>, length: i64, first: i64) {
    numbers.for_each(|number| add(filter, number, (number - first).rem_euclid(length) == 0));
}

#[test]
fn bars_start_at_high_downbeat_activations() {
    for length in 2..=4 {
        let mut filter = fixed(length);
        for number in 10..40 {
            filter.add_downbeat(number, 0.0);
        }
        assert_eq!(
            filter.bars().position(0),
            0,
            "activations of 0 must not move the bars"
        );
        for number in 40..60 {
            let is_first = number % i64::from(length) == 1;
            filter.add_downbeat(number, if is_first { 0.9 } else { 0.05 });
        }
        assert_eq!(filter.bars().position(1), 0);
        assert_eq!(filter.bars().beats, length);
    }
}

#[test]
fn bars_start_at_high_feature_odds() {
    let mut filter = fixed(4);
    for number in 0..16 {
        filter.add_downbeat(number, 0.0);
        filter.add_odds(number - 2, if number % 4 == 1 { 0.8 } else { -0.2 });
    }
    assert_eq!(filter.bars().position(3), 0);
}

#[test]
fn one_outlier_moves_nothing_and_a_dropped_beat_moves_the_bars() {
    for length in [BarLength::Beats(4), BarLength::Auto] {
        let mut filter = BarFilter::new(length);
        play(&mut filter, 0..40, 4, 1);
        assert_eq!(filter.bars().position(1), 0);
        add(&mut filter, 40, true);
        play(&mut filter, 41..44, 4, 1);
        assert_eq!(filter.bars().position(1), 0);
        play(&mut filter, 44..64, 4, 2);
        assert_eq!((filter.bars().position(2), filter.bars().beats), (0, 4));
    }
}

#[test]
fn bars_of_a_performer_stay() {
    for length in [BarLength::Beats(4), BarLength::Auto] {
        let mut filter = BarFilter::new(length);
        filter.hold(7);
        play(&mut filter, 8..80, 3, 1);
        assert_eq!(filter.bars(), Bars { first: 7, beats: 4 });
        filter.release();
        play(&mut filter, 80..120, 4, 0);
        assert_eq!(filter.bars().position(8), 0);
    }
}

#[test]
fn two_downbeats_of_a_performer_set_the_length() {
    let mut filter = BarFilter::new(BarLength::Auto);
    filter.hold(7);
    filter.hold(10);
    play(&mut filter, 11..60, 4, 0);
    assert_eq!(
        filter.bars(),
        Bars {
            first: 10,
            beats: 3
        }
    );
    filter.hold(15);
    assert_eq!(
        filter.bars(),
        Bars {
            first: 15,
            beats: 3
        }
    );
    let mut filter = fixed(4);
    filter.hold(7);
    filter.hold(10);
    assert_eq!(
        filter.bars(),
        Bars {
            first: 10,
            beats: 4
        }
    );
}

#[test]
fn odds_of_one_length_do_not_change_the_length() {
    let mut filter = BarFilter::new(BarLength::Auto);
    let before = filter.grids.share(4);
    for number in 0..40 {
        let odds = if number % 4 == 2 { 2.0 } else { -1.0 };
        filter.add_odds_of_length(number, odds, 4);
        assert!((filter.grids.share(4) - before).abs() < 1e-5);
    }
    assert_eq!(filter.bars(), Bars { first: 2, beats: 4 });
}

#[test]
fn the_length_changes_after_a_whole_bar_of_evidence() {
    let mut filter = BarFilter::new(BarLength::Auto);
    for changes in 1..=4 {
        filter.grids.multiply_length(100.0);
        filter.add_length_odds(0.0);
        assert_eq!(filter.bars().beats, if changes < 4 { 4 } else { 3 });
    }
}

#[test]
fn music_may_change_from_four_to_three_and_back() {
    let mut filter = BarFilter::new(BarLength::Auto);
    play(&mut filter, 0..64, 4, 1);
    assert_eq!((filter.bars().position(61), filter.bars().beats), (0, 4));
    play(&mut filter, 64..112, 3, 64);
    assert_eq!((filter.bars().position(109), filter.bars().beats), (0, 3));
    play(&mut filter, 112..160, 4, 2);
    assert_eq!((filter.bars().position(158), filter.bars().beats), (0, 4));
}

#[test]
fn silence_after_a_waltz_does_not_change_its_bars() {
    let mut filter = BarFilter::new(BarLength::Auto);
    play(&mut filter, 0..60, 3, 1);
    assert_eq!((filter.bars().position(58), filter.bars().beats), (0, 3));
    filter.forget();
    play(&mut filter, 60..90, 3, 1);
    assert_eq!((filter.bars().position(88), filter.bars().beats), (0, 3));
}

#[test]
fn beats_that_are_left_out_change_no_bar() {
    for (length, setting) in [
        (3, BarLength::Beats(3)),
        (4, BarLength::Beats(4)),
        (3, BarLength::Auto),
    ] {
        for left_out in [1, 2, 5, 11] {
            let mut filter = BarFilter::new(setting);
            play(&mut filter, 0..60, length, 1);
            let before = filter.grids.first_of(length as usize).map(<[f32]>::to_vec);
            let before = before.unwrap();
            // The beat that is number 60 now would have had a higher number without the gap.
            filter.renumber(-left_out);
            let after = filter.grids.first_of(length as usize).unwrap();
            for number in 60..63 {
                let expected = (number + left_out - 1).rem_euclid(length);
                assert_eq!(i64::from(filter.bars().position(number)), expected);
                let here = |number: i64| number.rem_euclid(length) as usize;
                let change = after[here(number)] - before[here(number + left_out)];
                assert!(change.abs() < 1e-6);
            }
        }
    }
}

/// The observations of a beat: a value, 0..1, of the noise of its activation, and of its odds.
type Noise = (f32, f32);

/// Adds beat `number` with noise. The observations still favour the downbeats, on average.
fn add_noisy(filter: &mut BarFilter, number: i64, (activation, odds): Noise, is_first: bool) {
    let (level, sign) = if is_first { (0.4, 0.5) } else { (0.05, -0.2) };
    filter.add_downbeat(number, level + 0.3 * activation);
    filter.add_odds(number, sign + odds - 0.5);
    filter.add_length_odds(0.0);
}

fn noise(beats: usize) -> impl Strategy<Value = Vec<Noise>> {
    prop::collection::vec((0.0..1.0f32, 0.0..1.0f32), beats)
}

proptest! {
    #[test]
    fn a_waltz_has_bars_of_three_within_sixteen_bars(noise in noise(48), first in 0..3i64) {
        let mut filter = BarFilter::new(BarLength::Auto);
        for (number, noise) in (0..).zip(noise) {
            add_noisy(&mut filter, number, noise, number % 3 == first);
        }
        prop_assert_eq!(filter.bars().beats, 3);
        prop_assert_eq!(filter.bars().position(first), 0);
    }

    #[test]
    fn music_in_four_with_a_dropped_beat_never_has_bars_of_three(
        noise in noise(120),
        first in 0..4i64,
        dropped in 0..120i64,
    ) {
        let mut filter = BarFilter::new(BarLength::Auto);
        for (number, noise) in (0..).zip(noise) {
            let in_music = number + i64::from(number >= dropped);
            add_noisy(&mut filter, number, noise, in_music % 4 == first);
            prop_assert_eq!(filter.bars().beats, 4);
        }
    }

    #[test]
    fn a_fixed_length_stays_whatever_is_heard(
        beats in 2..=4u32,
        observations in prop::collection::vec((0.0..1.0f32, -9.0..9.0f32, -9.0..9.0f32), 1..200),
    ) {
        let mut filter = fixed(beats);
        for (number, (downbeat, odds, three)) in (0..).zip(observations) {
            filter.add_downbeat(number, downbeat);
            filter.add_odds(number, odds);
            filter.add_length_odds(three);
            prop_assert_eq!(filter.bars().beats, beats);
        }
    }

    #[test]
    fn probabilities_stay_probabilities(
        observations in prop::collection::vec((0.0..1.0f32, -99.0..99.0f32, -99.0..99.0f32), 1..300),
    ) {
        let mut filter = BarFilter::new(BarLength::Auto);
        for (number, (downbeat, odds, three)) in (0..).zip(observations) {
            filter.add_downbeat(number, downbeat);
            filter.add_odds(number - 2, odds);
            filter.add_odds_of_length(number - 1, -odds, 4);
            filter.add_length_odds(three);
            let (threes, fours) = (filter.grids.share(3), filter.grids.share(4));
            prop_assert!((threes + fours - 1.0).abs() < 1e-4);
            prop_assert!(threes > 0.0 && fours > 0.0);
        }
    }
}
