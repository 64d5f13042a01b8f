//! Tests of the schedule: when cues start, how long they last and how they end.

use super::*;
use crate::time::Bars;

fn trigger(label: LabelId, beats: u32) -> DanceCommand {
    DanceCommand::Launch(Launch::new(label, beats))
}

fn launch(label: LabelId, beats: u32, change: impl Fn(&mut Launch)) -> DanceCommand {
    let mut launch = Launch::new(label, beats);
    change(&mut launch);
    DanceCommand::Launch(launch)
}

/// Commits the wanted attribute on each beat of `beats`, and returns these attributes.
fn dance(schedule: &mut Schedule, beats: std::ops::Range<i64>) -> Vec<Attribute> {
    let each = |beat| {
        let wanted = wanted_now(schedule, beat);
        schedule.commit(beat, 1, wanted);
        wanted
    };
    beats.map(each).collect()
}

const NONE: Attribute = Attribute::None;
const A: Attribute = Attribute::Label(0);
const B: Attribute = Attribute::Label(1);

fn wanted_now(schedule: &Schedule, beat: i64) -> Attribute {
    let mut wanted = [Attribute::None];
    schedule.wanted(beat, true, |_| 0, &mut wanted);
    wanted[0]
}

#[test]
fn the_length_counts_from_the_first_beat_that_carries_the_label() {
    let mut schedule = Schedule::new();
    schedule.apply(trigger(2, 4), 10);
    schedule.commit(10, 1, Attribute::None);
    schedule.commit(11, 1, Attribute::None);
    schedule.commit(12, 1, Attribute::Label(2));
    for beat in 13..16 {
        assert_eq!(
            wanted_now(&schedule, beat),
            Attribute::Label(2),
            "beat {beat}"
        );
        schedule.commit(beat, 1, Attribute::Label(2));
    }
    assert_eq!(wanted_now(&schedule, 16), Attribute::None);
}

#[test]
fn a_later_cue_is_in_force_and_the_earlier_one_resumes() {
    let mut schedule = Schedule::new();
    schedule.apply(trigger(0, 8), 0);
    schedule.commit(0, 1, Attribute::Label(0));
    schedule.apply(trigger(1, 2), 1);
    for beat in 1..3 {
        assert_eq!(wanted_now(&schedule, beat), Attribute::Label(1));
        schedule.commit(beat, 1, Attribute::Label(1));
    }
    for beat in 3..8 {
        assert_eq!(
            wanted_now(&schedule, beat),
            Attribute::Label(0),
            "beat {beat}"
        );
        schedule.commit(beat, 1, Attribute::Label(0));
    }
    assert_eq!(wanted_now(&schedule, 8), Attribute::None);
}

#[test]
fn an_unreachable_cue_is_dropped_after_eight_beats() {
    let mut schedule = Schedule::new();
    schedule.apply(trigger(3, 8), 0);
    let dropped: Vec<_> = (0..8)
        .filter_map(|beat| schedule.commit(beat, 1, Attribute::None).dropped)
        .collect();
    assert_eq!(dropped, [3]);
    assert_eq!(wanted_now(&schedule, 8), Attribute::None);
}

#[test]
fn panic_idles_until_the_next_trigger() {
    let mut schedule = Schedule::new();
    schedule.apply(trigger(0, 8), 0);
    schedule.apply(DanceCommand::Panic, 0);
    assert_eq!(wanted_now(&schedule, 1), Attribute::Idle);
    schedule.apply(trigger(1, 8), 1);
    assert_eq!(wanted_now(&schedule, 2), Attribute::Label(1));
}

#[test]
fn only_the_cue_that_is_danced_is_shown_as_dancing() {
    let mut schedule = Schedule::new();
    schedule.apply(trigger(0, 8), 4);
    schedule.commit(4, 1, Attribute::Label(0));
    schedule.apply(trigger(1, 8), 5);
    let shown = |danced| {
        schedule
            .shown(5, danced)
            .map(|cue| cue.map(|cue| (cue.label, cue.dancing, cue.beats_left)))
    };
    assert_eq!(
        shown(Attribute::Label(0))[..3],
        [Some((1, false, 8)), Some((0, true, 7)), None]
    );
    assert_eq!(
        shown(Attribute::None)[..2],
        [Some((1, false, 8)), Some((0, false, 7))]
    );
}

#[test]
fn a_waiting_cue_is_wanted_until_it_is_reached_and_for_its_length() {
    let mut schedule = Schedule::new();
    schedule.apply(trigger(0, 3), 20);
    let mut wanted = [Attribute::None; 8];
    schedule.wanted(20, true, |_| 2, &mut wanted);
    let on = wanted
        .iter()
        .filter(|&&attribute| attribute == Attribute::Label(0))
        .count();
    assert_eq!(on, 5);
    assert_eq!(wanted[5], Attribute::None);
}

#[test]
fn a_gate_lasts_while_it_is_held() {
    let mut schedule = Schedule::new();
    schedule.apply(launch(0, 2, |launch| launch.mode = Mode::Gate), 0);
    assert_eq!(dance(&mut schedule, 0..20), [A; 20]);
    schedule.apply(DanceCommand::Lift { label: 0 }, 20);
    assert_eq!(dance(&mut schedule, 20..22), [NONE; 2]);
    // The release of a pad does not end a trigger.
    schedule.apply(trigger(0, 3), 22);
    schedule.apply(DanceCommand::Lift { label: 0 }, 22);
    assert_eq!(dance(&mut schedule, 22..26), [A, A, A, NONE]);
    // A gate from a cue list is held for its beats, whether its label is danced or not.
    schedule.apply(
        launch(1, 8, |launch| {
            (launch.mode, launch.held_beats) = (Mode::Gate, Some(3))
        }),
        26,
    );
    schedule.commit(26, 1, NONE);
    assert_eq!(dance(&mut schedule, 27..30), [B, B, NONE]);
}

#[test]
fn a_toggle_lasts_until_it_is_pressed_again() {
    let mut schedule = Schedule::new();
    let toggle = launch(0, 2, |launch| launch.mode = Mode::Toggle);
    schedule.apply(toggle, 0);
    assert_eq!(dance(&mut schedule, 0..9), [A; 9]);
    schedule.apply(trigger(1, 2), 9);
    assert_eq!(dance(&mut schedule, 9..12), [B, B, A]);
    schedule.apply(toggle, 12);
    assert_eq!(dance(&mut schedule, 12..14), [NONE; 2]);
    schedule.apply(toggle, 14);
    assert_eq!(dance(&mut schedule, 14..16), [A; 2]);
}

#[test]
fn a_held_repeat_in_force_repeats_after_its_beats() {
    let mut schedule = Schedule::new();
    schedule.apply(launch(0, 3, |launch| launch.mode = Mode::Repeat), 0);
    schedule.commit(0, 1, NONE);
    dance(&mut schedule, 1..4);
    assert_eq!(
        [1, 3, 4, 9].map(|beat| schedule.repeats(beat)),
        [false, false, true, true]
    );
    schedule.apply(trigger(1, 2), 9);
    assert!(!schedule.repeats(9));
    schedule.apply(DanceCommand::Lift { label: 0 }, 11);
    assert!(!schedule.repeats(13));
    assert_eq!(dance(&mut schedule, 13..16), [B, B, NONE]);
}

#[test]
fn a_cue_waits_for_the_next_bar_and_a_second_press_cancels_it() {
    let mut schedule = Schedule::new();
    schedule.set_metre(Metre {
        bars: Bars { first: 2, beats: 4 },
        ..Metre::default()
    });
    let bar = launch(0, 2, |launch| launch.quantise = Quantise::Bar);
    schedule.apply(bar, 3);
    assert_eq!(
        schedule.shown(3, NONE)[0],
        Some(QueuedCue {
            label: 0,
            dancing: false,
            beats_left: 2
        })
    );
    let mut ahead = [NONE; 6];
    schedule.wanted(3, true, |_| 0, &mut ahead);
    assert_eq!(ahead, [NONE, NONE, NONE, A, A, NONE]);
    // The label may be danced on a beat before the bar, but its length counts from the start of the
    // bar.
    schedule.commit(3, 1, A);
    assert_eq!(dance(&mut schedule, 4..10), [NONE, NONE, A, A, NONE, NONE]);
    schedule.apply(bar, 11);
    schedule.apply(bar, 12);
    assert_eq!(dance(&mut schedule, 12..18), [NONE; 6]);
}

#[test]
fn a_queued_gate_that_is_released_while_it_waits_never_starts() {
    let mut schedule = Schedule::new();
    schedule.apply(trigger(0, 2), 0);
    let gate = |launch: &mut Launch| (launch.mode, launch.queued) = (Mode::Gate, true);
    schedule.apply(launch(1, 4, gate), 0);
    schedule.apply(DanceCommand::Lift { label: 1 }, 1);
    assert_eq!(dance(&mut schedule, 0..4), [A, A, NONE, NONE]);
}

#[test]
fn a_queued_cue_follows_after_the_others() {
    let mut schedule = Schedule::new();
    schedule.apply(trigger(0, 2), 0);
    schedule.apply(launch(1, 2, |launch| launch.queued = true), 0);
    schedule.apply(launch(2, 1, |launch| launch.queued = true), 0);
    let mut ahead = [NONE; 6];
    schedule.wanted(0, true, |_| 0, &mut ahead);
    let expected = [A, A, B, B, Attribute::Label(2), NONE];
    assert_eq!(ahead, expected);
    assert_eq!(dance(&mut schedule, 0..6), expected);
}

#[test]
fn an_avoided_label_is_reported_and_not_wanted() {
    let mut schedule = Schedule::new();
    let avoided = |schedule: &Schedule, from| {
        let mut labels = Vec::new();
        schedule.avoided(from, |label| labels.push(label));
        labels
    };
    schedule.apply(launch(0, 3, |launch| launch.avoid = true), 5);
    assert_eq!(dance(&mut schedule, 5..7), [NONE; 2]);
    assert_eq!(avoided(&schedule, 7), [0]);
    assert!(avoided(&schedule, 8).is_empty());
    schedule.apply(launch(0, 8, |launch| launch.avoid = true), 8);
    schedule.apply(trigger(0, 1), 8);
    assert!(
        avoided(&schedule, 8).is_empty(),
        "the later cue is in force"
    );
    assert_eq!(dance(&mut schedule, 8..10), [A, NONE]);
}

#[test]
fn a_cue_for_now_jumps_and_sets_the_intensity() {
    let mut schedule = Schedule::new();
    let taken = schedule.apply(
        launch(1, 2, |launch| {
            (launch.quantise, launch.intensity) = (Quantise::Now, Some(0.9))
        }),
        4,
    );
    assert_eq!(taken.jump_to, Some(1));
    assert_eq!(schedule.intensity(4), Some(0.9));
    assert!(schedule.commit(4, 1, B).arrived);
    assert!(!schedule.commit(5, 1, B).arrived);
    assert_eq!(schedule.intensity(6), None);
}

#[test]
fn the_intensity_is_the_performers_until_released_and_a_launch_has_its_own() {
    let mut schedule = Schedule::new();
    schedule.apply(DanceCommand::Intensity(Some(0.25)), 0);
    assert_eq!(schedule.intensity(0), Some(0.25));
    schedule.apply(launch(1, 2, |launch| launch.intensity = Some(0.9)), 4);
    assert_eq!(schedule.intensity(4), Some(0.9));
    dance(&mut schedule, 4..6);
    schedule.apply(DanceCommand::Panic, 6);
    assert_eq!(schedule.intensity(6), Some(0.25));
    for (asked, had) in [(7.0, Some(1.0)), (-1.0, Some(0.0)), (f32::NAN, None)] {
        schedule.apply(DanceCommand::Intensity(Some(asked)), 6);
        assert_eq!(schedule.intensity(6), had, "{asked}");
    }
    schedule.apply(DanceCommand::Intensity(Some(0.5)), 6);
    schedule.apply(DanceCommand::Intensity(None), 6);
    assert_eq!(schedule.intensity(6), None);
}
