use super::*;

/// A peak that is neither quiet nor clipped.
const LOUD: f32 = 0.5;

/// One input, fed second by second.
struct Simulation {
    diagnosis: InputDiagnosis,
    sound: InputSound,
    mix: SoundCheck,
}

impl Simulation {
    /// Creates an input whose channels have the given peaks; the channels in `chosen` are mixed.
    fn new(is_loopback: bool, peaks: &[f32], chosen: &[usize]) -> Self {
        let level = |(number, &peak): (usize, &f32)| ChannelLevel {
            peak,
            clipped: false,
            chosen: chosen.contains(&number),
        };
        Self {
            diagnosis: InputDiagnosis::default(),
            sound: InputSound {
                is_loopback,
                channels: (1..).zip(peaks).map(level).collect(),
                rate_hz: 48_000,
                frames: 0,
            },
            mix: SoundCheck {
                peak: LOUD,
                ..SoundCheck::default()
            },
        }
    }

    /// Advances by one second, in which the device delivers `frames` frames.
    fn second(&mut self, frames: u64) -> Vec<InputProblem> {
        self.sound.frames += frames;
        self.diagnosis
            .update(Duration::from_secs(1), &self.sound, self.mix)
    }

    /// Returns the second in which the problem `kind` appears first, within a minute, and its text.
    fn first(&mut self, kind: &str) -> Option<(u32, String)> {
        (1..=60).find_map(|second| {
            let mut problems = self.second(48_000).into_iter();
            let found = problems.find(|problem| problem.kind == kind)?;
            Some((second, found.text))
        })
    }
}

#[test]
fn music_on_the_chosen_channels_is_no_problem() {
    for is_loopback in [false, true] {
        let mut input = Simulation::new(is_loopback, &[LOUD, LOUD], &[1, 2]);
        for _ in 0..60 {
            assert_eq!(input.second(48_000), []);
        }
    }
}

#[test]
fn exact_zeros_are_a_problem_after_four_seconds_and_after_ten_of_a_loopback() {
    let (second, text) = Simulation::new(false, &[0.0], &[1])
        .first("silence")
        .unwrap();
    assert_eq!(second, 4);
    let remedy = if cfg!(target_os = "macos") {
        "Privacy & Security > Microphone"
    } else {
        "muted, switched off or unplugged"
    };
    assert!(text.contains(remedy), "{text}");
    let (second, text) = Simulation::new(true, &[0.0], &[1])
        .first("silence")
        .unwrap();
    assert_eq!(second, 10);
    assert!(text.starts_with("the computer plays nothing"), "{text}");
    // A pause between two songs.
    let mut input = Simulation::new(true, &[0.0, 0.0], &[1, 2]);
    (0..9).for_each(|_| assert_eq!(input.second(0), []));
    input.sound.channels[0].peak = LOUD;
    assert_eq!(input.second(48_000), []);
    input.sound.channels[0].peak = 0.0;
    (0..9).for_each(|_| assert_eq!(input.second(0), []));
}

#[test]
fn a_very_low_level_is_a_problem_and_not_silence() {
    let mut input = Simulation::new(false, &[0.001], &[1]);
    let (second, text) = input.first("quiet").unwrap();
    assert_eq!(second, 10);
    assert!(
        text.contains("peak -60 dBFS") && text.contains("raise the input level"),
        "{text}"
    );
    let (_, text) = Simulation::new(true, &[0.001], &[1])
        .first("quiet")
        .unwrap();
    assert!(text.contains("the program that plays"), "{text}");
}

#[test]
fn music_on_another_channel_names_the_channels() {
    let peaks = [0.0, 0.0001, LOUD, LOUD];
    let (second, text) = Simulation::new(false, &peaks, &[1, 2])
        .first("channel")
        .unwrap();
    assert_eq!(second, 4);
    assert!(
        text.contains("the music is on channels 3 and 4, but the show listens to channels 1 and 2"),
        "{text}"
    );
    assert!(text.ends_with("set audio.channels = [3, 4]"), "{text}");
    let mut input = Simulation::new(false, &peaks, &[1, 2]);
    (0..10).for_each(|_| drop(input.second(48_000)));
    let kinds: Vec<_> = input
        .second(48_000)
        .iter()
        .map(|problem| problem.kind)
        .collect();
    assert_eq!(kinds, ["channel"], "one cause is one problem");
    assert_eq!(
        Simulation::new(false, &[LOUD, LOUD], &[1]).first("channel"),
        None
    );
}

#[test]
fn channels_that_cancel_each_other_are_found() {
    let mut input = Simulation::new(false, &[LOUD, LOUD], &[1, 2]);
    input.mix.peak = 0.001;
    let (second, text) = input.first("phase").unwrap();
    assert_eq!(second, 4);
    assert!(
        text.starts_with("channels 1 and 2 cancel each other"),
        "{text}"
    );
    let mut one = Simulation::new(false, &[LOUD], &[1]);
    one.mix.peak = 0.001;
    assert_eq!(one.first("phase"), None);
}

#[test]
fn clipping_and_hum_are_reported_at_once_and_end() {
    let mut input = Simulation::new(false, &[1.0, LOUD, 1.0], &[1, 2]);
    input.sound.channels[0].clipped = true;
    input.sound.channels[2].clipped = true;
    input.mix.hum_hz = 50;
    let problems = input.second(48_000);
    let texts: Vec<_> = problems
        .iter()
        .map(|problem| problem.text.as_str())
        .collect();
    assert!(
        texts[0].starts_with("the input clips on channel 1: lower"),
        "{texts:?}"
    );
    assert!(texts[1].contains("50 Hz hum"), "{texts:?}");
    input.sound.channels[0].clipped = false;
    input.mix.hum_hz = 0;
    assert_eq!(input.second(48_000), []);
}

#[test]
fn a_low_rate_for_calls_is_a_problem() {
    let mut input = Simulation::new(false, &[LOUD], &[1]);
    input.sound.rate_hz = 16_000;
    let problems = input.second(16_000);
    assert!(
        problems[0].text.contains("only 16000 samples per second"),
        "{problems:?}"
    );
}

#[test]
fn a_rate_that_differs_from_the_reported_one_is_measured() {
    let mut input = Simulation::new(false, &[LOUD], &[1]);
    let wrong = (1..=60).find_map(|second| Some((second, input.second(44_100).pop()?)));
    let (second, problem) = wrong.unwrap();
    assert_eq!(second, 21, "two measurements of ten seconds");
    assert!(
        problem
            .text
            .contains("delivers 44100 samples per second instead of 48000"),
        "{problem:?}"
    );
    (0..20).for_each(|_| drop(input.second(48_000)));
    assert_eq!(input.second(48_000), [], "the right rate ends it");
}

#[test]
fn jitter_dropouts_pauses_and_a_suspension_are_no_wrong_rate() {
    let mut jitter = Simulation::new(false, &[LOUD], &[1]);
    for second in 0..60 {
        let frames = if second % 2 == 0 { 44_000 } else { 52_000 };
        assert_eq!(jitter.second(frames), []);
    }
    let mut reopened = Simulation::new(false, &[LOUD], &[1]);
    for second in 0..60 {
        assert_eq!(reopened.second(if second == 12 { 0 } else { 48_000 }), []);
    }
    let mut pause = Simulation::new(true, &[LOUD], &[1]);
    (0..60).for_each(|_| assert_eq!(pause.second(1_000), []));
    let mut suspended = Simulation::new(false, &[LOUD], &[1]);
    for _ in 0..5 {
        (0..8).for_each(|_| assert_eq!(suspended.second(48_000), []));
        let minute = Duration::from_secs(60);
        let (sound, mix) = (&suspended.sound, suspended.mix);
        assert_eq!(suspended.diagnosis.update(minute, sound, mix), []);
    }
}

#[test]
fn a_closed_device_starts_a_new_diagnosis() {
    let mut input = Simulation::new(false, &[0.0], &[1]);
    (0..3).for_each(|_| assert_eq!(input.second(48_000), []));
    let channels = std::mem::take(&mut input.sound.channels);
    assert_eq!(input.second(0), []);
    input.sound.channels = channels;
    (0..3).for_each(|_| assert_eq!(input.second(48_000), []));
    assert_eq!(input.second(48_000)[0].kind, "silence");
}

#[test]
fn channels_are_listed_briefly() {
    for (numbers, text) in [
        (&[3][..], "channel 3"),
        (&[1, 2], "channels 1 and 2"),
        (&[5, 6, 7, 8], "channels 5 to 8"),
        (&[1, 3, 8], "channels 1, 3, 8"),
    ] {
        assert_eq!(channels(numbers), text);
    }
}

#[test]
fn a_replaced_input_is_diagnosed_anew() {
    let mut input = Simulation::new(false, &[0.0], &[1]);
    assert!(input.first("silence").is_some());
    input.sound.is_loopback = true;
    assert_eq!(input.second(48_000), []);
    let (second, text) = input.first("silence").expect("no problem of silence");
    assert!(second > 5 && text.contains("plays"), "{second} s: {text}");
}
