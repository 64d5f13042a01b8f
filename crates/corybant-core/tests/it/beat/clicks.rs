//! Tests of beat tracking: predictions are made before the beats fall, in order, and depend on no
//! later sample.

#![allow(clippy::unwrap_used)]

use std::f64::consts::TAU;

use assert_no_alloc::assert_no_alloc;
use corybant_core::beat::bar_length::BarLength;
use corybant_core::beat::tempo::period_range::PeriodRange;
use corybant_core::beat::tracker::{
    BeatSource, BeatTracker, PredictedBeat, TrackerKind, TrackerSettings,
};
use corybant_core::beat::tsv::write_beats;
use corybant_core::dsp::SAMPLE_RATE;
use corybant_core::maths;
use corybant_core::tempo::command::{CommandResolver, TempoCommand};
use corybant_core::time::{Beats, Bpm, Seconds};
use proptest::prelude::*;

const RATE: f64 = SAMPLE_RATE as f64;

/// One tempo command of each kind that edits the beat grid.
const HANDS: [TempoCommand; 6] = [
    TempoCommand::Tap,
    TempoCommand::Nudge(Seconds(0.001)),
    TempoCommand::Half,
    TempoCommand::Double,
    TempoCommand::Downbeat,
    TempoCommand::Tempo(Bpm(120.0)),
];

const TRACKERS: &[TrackerKind] = &[
    TrackerKind::Net,
    TrackerKind::Flux,
    #[cfg(feature = "aubio")]
    TrackerKind::Aubio,
];

fn clock() -> BeatTracker {
    clock_of(TrackerKind::default())
}

fn clock_of(tracker: TrackerKind) -> BeatTracker {
    BeatTracker::new(
        &TrackerSettings {
            tracker,
            ..TrackerSettings::default()
        },
        BeatSource::Audio,
    )
    .unwrap()
}

fn silence(seconds: f64) -> Vec<f32> {
    vec![0.0; (seconds * RATE) as usize]
}

/// Returns reproducible white noise.
fn noise(seconds: f64, gain: f32) -> Vec<f32> {
    let mut random = fastrand::Rng::with_seed(7);
    (0..(seconds * RATE) as usize)
        .map(|_| gain * (2.0 * random.f32() - 1.0))
        .collect()
}

/// Returns clicks at `bpm`; the first click is after one beat period.
fn clicks(bpm: f64, seconds: f64) -> Vec<f32> {
    let mut samples = silence(seconds);
    let period = 60.0 / bpm;
    for beat in 1..=(seconds / period) as usize {
        let start = (beat as f64 * period * RATE) as usize;
        for (i, sample) in samples.iter_mut().skip(start).take(1500).enumerate() {
            *sample += (0.3
                * maths::exp(-(i as f64) / 300.0)
                * maths::sin(TAU * 1500.0 * i as f64 / RATE)) as f32;
        }
    }
    samples
}

/// Feeds `samples` in blocks of `size` and returns all predicted beats.
fn decided(clock: &mut BeatTracker, samples: &[f32], size: usize) -> Vec<PredictedBeat> {
    let mut beats = Vec::new();
    for piece in samples.chunks(size) {
        clock.feed(piece);
        beats.extend(std::iter::from_fn(|| clock.next_predicted()));
    }
    beats
}

/// Checks the properties that all predicted beats must have.
fn check_order(beats: &[PredictedBeat]) {
    for beat in beats {
        assert!(
            beat.at.0 + 0.0199 <= beat.time.0 && beat.time.0 <= beat.at.0 + 0.0601,
            "{beat:?}"
        );
        assert!(
            (0.0..=1.0).contains(&beat.confidence) && beat.bpm.0.is_finite(),
            "{beat:?}"
        );
    }
    for pair in beats.windows(2) {
        assert!(
            pair[0].time < pair[1].time
                && pair[0].number < pair[1].number
                && pair[0].at <= pair[1].at,
            "{pair:?}"
        );
    }
}

/// Returns the distance of `time` from the nearest click at `bpm`, in seconds.
fn off(time: f64, bpm: f64) -> f64 {
    let period = 60.0 / bpm;
    (time - (time / period).round() * period).abs()
}

/// Returns the fraction of `beats` after `from` that fall on clicks at `bpm` that began at `start`.
fn on_clicks(beats: &[PredictedBeat], from: f64, start: f64, bpm: f64) -> f64 {
    let late: Vec<_> = beats.iter().filter(|beat| beat.time.0 >= from).collect();
    assert!(!late.is_empty(), "no beats after {from} s");
    late.iter()
        .filter(|beat| off(beat.time.0 - start, bpm) < 0.04)
        .count() as f64
        / late.len() as f64
}

#[test]
fn clicks_are_followed_at_every_tempo_or_its_octave() {
    for tracker in TRACKERS.iter().copied() {
        for bpm in [
            60.0, 75.0, 90.0, 100.0, 120.0, 128.0, 140.0, 160.0, 180.0, 200.0,
        ] {
            let mut clock = clock_of(tracker);
            let beats = decided(&mut clock, &clicks(bpm, 30.0), 441);
            check_order(&beats);
            assert!(on_clicks(&beats, 12.0, 0.0, bpm) > 0.97, "{bpm} bpm");
            let told = beats.last().unwrap().bpm.0;
            assert!(
                [0.5, 1.0]
                    .iter()
                    .any(|octave| (told / (bpm * octave) - 1.0).abs() < 0.003),
                "{bpm} bpm is tracked as {told} bpm"
            );
            assert!(
                clock.confidence() > 0.7 && clock.music(),
                "{bpm} bpm: {}",
                clock.confidence()
            );
            let next = clock
                .timeline()
                .time_of(Beats(beats.last().unwrap().number as f64 + 4.0))
                .0;
            assert!(
                off(next, bpm) < 0.04,
                "{bpm} bpm: the beat after next is {} s off",
                off(next, bpm)
            );
        }
    }
}

/// Checks that, starting with click number `first` (counted from 1) at `bpm`, there is one beat
/// within `most` seconds of each click, and no other beat.
fn check_clicks(tracker: TrackerKind, bpm: f64, first: f64, most: f64) {
    let beats = decided(&mut clock_of(tracker), &clicks(bpm, 12.0), 441);
    check_order(&beats);
    let period = 60.0 / bpm;
    // The last click is not checked, because its beat may not be predicted yet when the sound ends.
    let last = (12.0 / period).floor() - 1.0;
    let judged = (first - 0.5) * period..(last + 0.5) * period;
    let late: Vec<f64> = beats
        .iter()
        .map(|beat| beat.time.0)
        .filter(|time| judged.contains(time))
        .collect();
    let worst = late.iter().map(|&time| off(time, bpm)).fold(0.0, f64::max);
    assert!(
        worst <= most,
        "{tracker:?}, {bpm} bpm: {worst} s off, {late:.3?}"
    );
    assert_eq!(
        late.len(),
        (last - first) as usize + 1,
        "{tracker:?}, {bpm} bpm: {late:.3?}"
    );
}

#[test]
fn beats_are_found_within_four_clicks_and_15_ms() {
    for bpm in (60..=200).step_by(5).map(f64::from) {
        // Above 196 bpm, the network first follows every second click.
        check_clicks(
            TrackerKind::Net,
            bpm,
            if bpm > 196.0 { 9.0 } else { 5.0 },
            0.015,
        );
        // The activation of spectral flux peaks for one or two hops.
        check_clicks(TrackerKind::Flux, bpm, 5.0, 0.018);
    }
}

#[test]
fn jumps_of_an_offset_have_no_beats() {
    let level = |second: usize| [0.0, 0.5, 0.5, 0.4, -0.5, 0.0][second * 3 / 4 % 6];
    let jumps: Vec<f32> = (0..20 * SAMPLE_RATE as usize)
        .map(|i| {
            if i < 3 * RATE as usize {
                0.0
            } else {
                level(i / SAMPLE_RATE as usize)
            }
        })
        .collect();
    let one: Vec<f32> = (0..20 * SAMPLE_RATE)
        .map(|i| if i > 7 * SAMPLE_RATE { 0.3 } else { 0.0 })
        .collect();
    for tracker in TRACKERS.iter().copied() {
        for (name, samples) in [("many", &jumps), ("one", &one)] {
            let mut clock = clock_of(tracker);
            assert_eq!(decided(&mut clock, samples, 441), [], "{tracker:?}, {name}");
            assert!(!clock.music(), "{tracker:?}, {name}");
        }
    }
}

#[test]
fn a_jump_of_the_offset_in_music_moves_no_beat() {
    let music = clicks(120.0, 12.0);
    // A time between two clicks.
    let jump: Vec<f32> = music
        .iter()
        .enumerate()
        .map(|(i, sample)| sample + if i as f64 > 6.2 * RATE { 0.3 } else { 0.0 })
        .collect();
    for tracker in [TrackerKind::Net, TrackerKind::Flux] {
        let beats = decided(&mut clock_of(tracker), &jump, 441);
        let late: Vec<f64> = beats
            .iter()
            .map(|beat| beat.time.0)
            .filter(|&time| (5.8..11.9).contains(&time))
            .collect();
        assert!(
            late.len() == 12 && late.iter().all(|&time| off(time, 120.0) < 0.02),
            "{tracker:?}: {late:.3?}"
        );
    }
}

#[test]
fn silence_noise_and_tones_have_no_beats() {
    let tone: Vec<f32> = (0..30 * SAMPLE_RATE)
        .map(|i| (0.3 * maths::sin(TAU * 440.0 * f64::from(i) / RATE)) as f32)
        .collect();
    let still = vec![0.5; 30 * SAMPLE_RATE as usize];
    let quiet = [
        ("silence", silence(30.0)),
        ("noise", noise(30.0, 0.2)),
        ("hiss", noise(30.0, 0.001)),
        ("a tone", tone),
        ("DC", still),
    ];
    for (tracker, (name, samples)) in TRACKERS
        .iter()
        .flat_map(|&tracker| quiet.iter().map(move |quiet| (tracker, quiet)))
    {
        let mut clock = clock_of(tracker);
        let beats = decided(&mut clock, samples, 441);
        assert_eq!(beats, [], "{tracker:?}, {name}");
        assert!(
            !clock.music() && clock.confidence() < 1e-6,
            "{tracker:?}, {name}: {}",
            clock.confidence()
        );
        let running =
            clock.timeline().beat_at(Seconds(30.0)) - clock.timeline().beat_at(Seconds(29.0));
        assert!(
            (running.0 - 2.0).abs() < 1e-9,
            "{tracker:?}, {name}: the tempo is 120 bpm until a beat is found"
        );
    }
}

#[test]
fn samples_that_are_not_finite_count_as_silence() {
    let music = clicks(120.0, 15.0);
    let mut dirty = music.clone();
    let mut clean = music;
    for (i, odd) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -f32::NAN]
        .into_iter()
        .cycle()
        .take(400)
        .enumerate()
    {
        dirty[i * 1500] = odd;
        clean[i * 1500] = 0.0;
    }
    assert_eq!(
        decided(&mut clock(), &dirty, 441),
        decided(&mut clock(), &clean, 441)
    );
    let mut clock = clock();
    for odd in [f32::NAN, f32::MAX, f32::MIN, f32::MIN_POSITIVE / 4.0, 1e30] {
        check_order(&decided(&mut clock, &vec![odd; 200_000], 10_007));
        assert!(clock.level_db().is_finite() && clock.confidence().is_finite());
    }
    let beats = decided(&mut clock, &clicks(120.0, 60.0), 441);
    assert!(
        beats.last().unwrap().confidence > 0.78,
        "it recovers: {:?}",
        beats.last()
    );
}

#[test]
fn clipped_music_keeps_its_beats() {
    let samples: Vec<f32> = clicks(120.0, 15.0)
        .iter()
        .map(|sample| (sample * 1e6).clamp(-1.0, 1.0))
        .collect();
    assert!(on_clicks(&decided(&mut clock(), &samples, 441), 5.0, 0.0, 120.0) > 0.97);
}

#[test]
fn beats_are_found_again_after_lost_samples() {
    let mut samples = clicks(120.0, 30.0);
    let lost = (0.13 * RATE) as usize;
    samples.drain((15.2 * RATE) as usize..(15.2 * RATE) as usize + lost);
    let beats = decided(&mut clock(), &samples, 441);
    check_order(&beats);
    assert!(on_clicks(&beats, 18.0, 30.0 - lost as f64 / RATE, 120.0) > 0.97);
    assert!(
        beats
            .windows(2)
            .all(|pair| (0.2..0.9).contains(&(pair[1].time.0 - pair[0].time.0)))
    );
}

#[test]
fn a_tempo_step_is_followed_within_seconds() {
    for (from, to, seconds) in [
        (120.0, 128.0, 6.0),
        (128.0, 120.0, 10.0),
        (120.0, 126.0, 6.0),
    ] {
        let mut samples = clicks(from, 20.0);
        samples.extend(clicks(to, 20.0));
        let beats = decided(&mut clock(), &samples, 441);
        check_order(&beats);
        assert!(
            on_clicks(&beats, 20.0 + seconds, 20.0, to) > 0.97,
            "{from} to {to} bpm"
        );
        let told = beats.last().unwrap().bpm.0;
        assert!(
            (told / to - 1.0).abs() < 0.004,
            "{from} to {to} bpm: {told}"
        );
    }
}

#[test]
fn music_ends_four_seconds_after_the_last_sound_or_the_last_beat_in_noise() {
    for (name, after) in [
        ("silence", silence(10.0)),
        ("hiss", noise(10.0, 0.001)),
        ("noise", noise(10.0, 0.02)),
    ] {
        let mut clock = clock();
        decided(&mut clock, &clicks(120.0, 20.0), 441);
        let before = clock.confidence();
        let (mut ended, mut lowest) = (None, before);
        for piece in after.chunks(441) {
            clock.feed(piece);
            if !clock.music() {
                ended = ended.or(Some(clock.fed_until().0));
            }
            assert!(
                clock.confidence() <= lowest + 0.05,
                "{name}: confidence falls"
            );
            lowest = clock.confidence().min(lowest);
        }
        let ended = ended.unwrap() - 19.5;
        assert!((3.9..4.6).contains(&ended), "{name}: {ended} s");
        assert!(lowest < 0.01, "{name}");
        let period = clock.timeline().period_at(clock.fed_until()).0;
        assert!(
            (period - 0.5).abs() < 0.01,
            "{name}: the beat period changed to {period} s"
        );
        while let Some(beat) = clock.next_predicted() {
            assert!(beat.at.0 - 19.5 <= ended, "{name}: {beat:?}");
        }
    }
}

#[test]
fn beats_are_found_again_after_a_break() {
    let mut samples = clicks(120.0, 20.0);
    samples.extend(silence(7.0));
    samples.extend(clicks(130.0, 15.0));
    let beats = decided(&mut clock(), &samples, 441);
    check_order(&beats);
    assert!(
        beats.iter().any(|beat| (27.0..29.5).contains(&beat.time.0)),
        "beats are found within 2.5 s"
    );
    assert!(on_clicks(&beats, 30.0, 27.0, 130.0) > 0.97);
    let across: Vec<_> = beats
        .iter()
        .filter(|beat| beat.time.0 > 23.0)
        .take(12)
        .map(|beat| beat.number)
        .collect();
    assert!(
        across.windows(2).all(|pair| pair[0] < pair[1]),
        "{across:?}"
    );
}

#[test]
fn predicted_beats_stay_on_the_timeline() {
    let mut clock = clock();
    let mut samples = clicks(120.0, 12.0);
    samples.extend(clicks(140.0, 12.0));
    for piece in samples.chunks(200) {
        clock.feed(piece);
        while let Some(beat) = clock.next_predicted() {
            let time = clock.timeline().time_of(Beats(beat.number as f64));
            assert!(
                (time.0 - beat.time.0).abs() < 1e-9,
                "{beat:?} is at {time:?}"
            );
        }
    }
}

#[test]
fn annotated_beats_are_predicted_unchanged() {
    let times: Vec<f64> = (0..30)
        .map(|i| 2.0 + f64::from(i) * 0.45 + 0.04 * maths::sin(f64::from(i)))
        .collect();
    let mut clock = BeatTracker::new(
        &TrackerSettings::default(),
        BeatSource::Annotated(times.clone()),
    )
    .unwrap();
    assert!(clock.music() && clock.confidence() == 1.0);
    let beats = decided(&mut clock, &silence(25.0), 10_007);
    assert_eq!(
        beats.iter().map(|beat| beat.time.0).collect::<Vec<_>>(),
        times
    );
    assert_eq!(
        beats.iter().map(|beat| beat.number).collect::<Vec<_>>(),
        (0..30).collect::<Vec<_>>()
    );
    assert!(
        beats
            .iter()
            .all(|beat| beat.at <= beat.time && beat.time.0 - beat.at.0 <= 0.0601)
    );
    assert!(!clock.music());
    let mut clock = BeatTracker::new(
        &TrackerSettings::default(),
        BeatSource::Annotated(vec![0.0, 0.5]),
    )
    .unwrap();
    let first = clock.next_predicted().unwrap();
    assert_eq!(
        (first.time, first.at),
        (Seconds(0.0), Seconds(0.0)),
        "a beat at the start is predicted before the first sample"
    );
}

#[test]
fn feeding_never_allocates() {
    let mut samples = clicks(125.0, 12.0);
    samples.extend(noise(6.0, 0.1));
    samples.extend(silence(6.0));
    for source in [
        BeatSource::Audio,
        BeatSource::Annotated((1..40).map(|i| f64::from(i) * 0.5).collect()),
    ] {
        let mut clock = BeatTracker::new(&TrackerSettings::default(), source).unwrap();
        let mut commands = CommandResolver::new(PeriodRange::from_bpm(55.0, 215.0));
        let beats = assert_no_alloc(|| {
            let mut beats = 0;
            for piece in samples.chunks(480) {
                clock.feed(piece);
                while clock.next_predicted().is_some() {
                    beats += 1;
                }
                let late = clock.fed_until().0 > 9.0;
                for (i, hand) in HANDS.into_iter().enumerate().filter(|_| late) {
                    let at = clock.fed_until() - Seconds(0.01 * i as f64);
                    if let Some(edit) = commands.resolve(hand, at.0) {
                        clock.apply(edit, at);
                    }
                }
                let _ = (
                    clock.timeline().beat_at(clock.fed_until()),
                    clock.confidence(),
                    clock.music(),
                    clock.level_db(),
                );
            }
            clock.feed(&samples);
            beats
        });
        assert!(beats > 15);
    }
}

#[test]
fn beat_lines_do_not_depend_on_the_block_size() {
    let samples = clicks(120.0, 15.0);
    let mut whole = Vec::new();
    let lines = write_beats(&mut clock(), &samples, false, &mut whole).unwrap();
    let mut pieces = Vec::new();
    let mut clock = clock();
    for piece in samples.chunks(10_007) {
        write_beats(&mut clock, piece, false, &mut pieces).unwrap();
    }
    let text = String::from_utf8(whole.clone()).unwrap();
    assert_eq!(whole, pieces);
    assert_eq!(text.lines().count(), lines);
    assert!(lines > 20);
    for line in text.lines() {
        let numbers: Vec<f64> = line
            .split('\t')
            .map(|number| number.parse().unwrap())
            .collect();
        assert!(
            numbers.len() == 4 && numbers[1] <= numbers[0] && (0.0..=1.0).contains(&numbers[3]),
            "{line}"
        );
    }
}

#[test]
fn beat_lines_have_the_bar_position_if_requested() {
    let mut text = Vec::new();
    write_beats(&mut clock(), &clicks(120.0, 10.0), true, &mut text).unwrap();
    let places: Vec<u32> = String::from_utf8(text)
        .unwrap()
        .lines()
        .map(|line| line.split('\t').nth(4).unwrap().parse().unwrap())
        .collect();
    assert!(
        places.len() > 10
            && places[2..]
                .windows(2)
                .all(|pair| pair[1] == pair[0] % 4 + 1),
        "{places:?}"
    );
}

#[test]
fn every_setting_that_is_not_allowed_is_reported() {
    let settings = TrackerSettings {
        bpm_min: 100.0,
        bpm_max: 150.0,
        beats_per_bar: BarLength::Beats(5),
        ..TrackerSettings::default()
    };
    let mut problems = Vec::new();
    settings.check("tempo", &mut problems);
    assert_eq!(problems.len(), 2, "{problems:?}");
    assert!(
        problems[0].contains("tempo.bpm_max is 150")
            && problems[1].contains("tempo.beats_per_bar is 5")
    );
    for bpm in [f64::NAN, f64::INFINITY, -1.0, 0.0, 49.9] {
        assert!(
            BeatTracker::new(
                &TrackerSettings {
                    bpm_min: bpm,
                    ..TrackerSettings::default()
                },
                BeatSource::Audio
            )
            .is_err(),
            "{bpm}"
        );
        assert!(
            BeatTracker::new(
                &TrackerSettings {
                    bpm_max: bpm,
                    ..TrackerSettings::default()
                },
                BeatSource::Audio
            )
            .is_err(),
            "{bpm}"
        );
    }
    assert!(
        BeatTracker::new(
            &TrackerSettings {
                bpm_min: 50.0,
                ..TrackerSettings::default()
            },
            BeatSource::Audio
        )
        .is_ok()
    );
    assert_eq!("aubio".parse(), Ok(TrackerKind::Aubio));
    assert_eq!("flux".parse(), Ok(TrackerKind::Flux));
    assert_eq!(
        "drum".parse::<TrackerKind>().unwrap_err().to_string(),
        "there is no beat tracker `drum`; use net, flux or aubio"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    #[test]
    fn predicted_beats_do_not_depend_on_the_block_size_or_later_samples(
        bpm in 70.0..190.0f64,
        level in 0.0..0.05f32,
        tracker in prop::sample::select(TRACKERS.to_vec()),
        size in prop::sample::select(vec![1usize, 64, 255, 256, 257, 441, 10_007, 1_000_000]),
        cut in 0.3..1.0f64,
    ) {
        let mut samples = clicks(bpm, 14.0);
        samples.iter_mut().zip(noise(14.0, level)).for_each(|(sample, noise)| *sample += noise);
        let whole = decided(&mut clock_of(tracker), &samples, 480);
        check_order(&whole);
        prop_assert_eq!(&decided(&mut clock_of(tracker), &samples, size), &whole);
        let end = (samples.len() as f64 * cut) as usize;
        let before: Vec<_> = whole.iter().copied().filter(|beat| beat.at.0 * RATE <= end as f64 + 0.5).collect();
        prop_assert_eq!(decided(&mut clock_of(tracker), &samples[..end], size), before);
    }
}
