use corybant_core::dsp::SAMPLE_RATE;
use ringbuf::HeapRb;
use ringbuf::traits::{Producer, Split};

use super::*;
use corybant_core::timecode::Place;
use corybant_core::timecode::ltc::generator::LtcGenerator;
use smpte_timecode::{FrameRate, Timecode};

#[test]
fn valid_settings_have_no_problems() {
    let mut problems = Vec::new();
    Settings::default().check("audio", &mut problems);
    Settings {
        input: "jack".into(),
        channels: vec![1, 4],
        input_latency_ms: 500.0,
    }
    .check("audio", &mut problems);
    assert_eq!(problems, Vec::<String>::new());
}

#[test]
fn every_invalid_value_is_reported() {
    let settings = Settings {
        input: " ".into(),
        channels: vec![0, 3, 3, 300],
        input_latency_ms: f64::NAN,
    };
    let mut problems = Vec::new();
    settings.check("audio", &mut problems);
    let expected = [
        "audio.input is empty; give \"default\", \"output\" (what the computer plays), \"jack\" or an input device's name (`corybant devices` lists them).",
        "audio.channels has 0; channels count from 1 and go up to 256.",
        "audio.channels has 3 more than once; name each channel once.",
        "audio.channels has 300; channels count from 1 and go up to 256.",
        "audio.input_latency_ms is NaN; it must be from 0 to 500.",
    ];
    assert_eq!(problems, expected);
}

#[test]
fn unknown_settings_are_refused() {
    let settings: Settings = toml::from_str("input = \"jack\"\nchannels = [2]").unwrap();
    assert_eq!(
        settings,
        Settings {
            input: "jack".into(),
            channels: vec![2],
            input_latency_ms: 0.0
        }
    );
    assert!(toml::from_str::<Settings>("inputs = \"jack\"").is_err());
}

#[test]
fn an_audio_system_that_hangs_does_not_block_the_start() {
    let named = Settings {
        input: "Line 1".into(),
        ..Settings::default()
    };
    let (sender, receiver) = channel();
    let warnings = Warnings::default();
    let wait = |timeout| wait_for_device(&receiver, &named, &warnings, timeout);
    assert!(wait(Duration::ZERO).unwrap().is_none());
    assert!(
        warnings.list()[0].contains("has not answered"),
        "{:?}",
        warnings.list()
    );
    sender.send(Ok(Some("a card".into()))).unwrap();
    assert_eq!(wait(Duration::ZERO).unwrap().as_deref(), Some("a card"));
    drop(sender);
    let error = wait(START_TIMEOUT).unwrap_err().to_string();
    assert!(
        error.contains("Line 1") && error.contains("the audio thread has ended"),
        "{error}"
    );
}

#[test]
fn a_source_returns_the_samples_that_fit_and_keeps_the_rest() {
    let (mut producer, consumer) = HeapRb::new(20_000).split();
    let mut source = Source::new(consumer, SAMPLE_RATE, 2, Channels::new(&[2])).unwrap();
    let sound: Vec<f32> = (0..1_000).map(|i| i as f32 / 1_000.0).collect();
    producer.push_iter(sound.iter().flat_map(|&x| [9.0, x]));
    let (mut received, mut mono) = (Vec::new(), [0.0; 77]);
    while received.len() < sound.len() {
        let n = source.read(&mut mono);
        assert!(n > 0);
        received.extend_from_slice(&mono[..n]);
    }
    assert_eq!(received, sound);
    assert_eq!(source.read(&mut mono), 0);
    assert_eq!(source.read(&mut []), 0);
}

#[test]
fn a_chosen_channel_is_mixed_at_once() {
    let (mut producer, consumer) = HeapRb::new(20_000).split();
    let channels = Channels::new(&[]);
    channels.set_format(2, SAMPLE_RATE);
    let mut source = Source::new(consumer, SAMPLE_RATE, 2, channels.clone()).unwrap();
    let mut mono = [0.0; 100];
    for (chosen, expected) in [(&[][..], 0.375), (&[1], 0.25), (&[2], 0.5), (&[9], 0.375)] {
        channels.choose(chosen);
        producer.push_iter([0.25, 0.5].repeat(100).into_iter());
        assert_eq!(source.read(&mut mono), 100);
        assert_eq!(mono, [expected; 100], "{chosen:?}");
    }
    assert_eq!(
        channels
            .take_levels()
            .iter()
            .map(|channel| channel.peak)
            .collect::<Vec<_>>(),
        [0.25, 0.5]
    );
}

#[test]
fn the_timecode_of_a_channel_is_decoded_and_left_out_of_the_mix() {
    const RATE_HZ: u32 = 48_000;
    let first = Timecode::parse("01:00:00:00", FrameRate::FPS_25).unwrap();
    let mut generator = LtcGenerator::new(first, 1.0, RATE_HZ, 0.3);
    let mut ltc = Vec::new();
    (0..50).for_each(|_| generator.frame(&mut ltc));
    let (mut producer, consumer) = HeapRb::new(40_000).split();
    let channels = Channels::new(&[]);
    channels.set_timecode(Some(2));
    let mut source = Source::new(consumer, RATE_HZ, 2, channels).unwrap();
    let (mut mono, mut readings) = ([0.0; 4_000], Vec::new());
    let mut time = Seconds(0.0);
    // A device with blocks of 512 samples, read a little after each block.
    for (number, block) in (1..).zip(ltc.chunks(512)) {
        producer.push_iter(block.iter().flat_map(|&x| [0.25, x]));
        let count = source.read(&mut mono);
        // The first samples have the start of the filter.
        let is_music = |x: &f32| (x - 0.25).abs() < 0.01;
        assert!(number < 5 || mono[..count].iter().all(is_music));
        time = Seconds(f64::from(number) * 512.0 / f64::from(RATE_HZ) + 0.002);
        source.read_timecode(time, &mut |reading| readings.push(reading));
    }
    assert!(readings.len() >= 47, "{} of 50 frames", readings.len());
    let last = readings.last().unwrap();
    let Place::Frame {
        fields,
        after_frames,
        ..
    } = last.place
    else {
        panic!("{last:?}");
    };
    let place = f64::from(
        Timecode::from_fields(fields, FrameRate::FPS_25)
            .unwrap()
            .frames(),
    );
    let expected = (place + after_frames) / 25.0 - 3_600.0;
    // The samples arrive when their block is complete and 2 ms later.
    let error = last.at.0 - expected;
    assert!((0.0015..0.0045).contains(&error), "{error} s at {time:?}");
}
