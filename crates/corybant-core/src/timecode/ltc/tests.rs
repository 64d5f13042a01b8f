//! Tests of the LTC decoder with generated timecode.

use proptest::prelude::*;
use smpte_timecode::{FrameRate, Timecode};

use super::generator::LtcGenerator;
use super::*;

const RATES: [FrameRate; 4] = [
    FrameRate::FPS_24,
    FrameRate::FPS_25,
    FrameRate::FPS_29_97_DF,
    FrameRate::FPS_30,
];

/// Returns the samples of `count` frames from `label` on.
fn sound(rate: FrameRate, speed: f64, rate_hz: u32, count: usize) -> (Timecode, Vec<f32>) {
    let first = Timecode::from_frames(107_000, rate).unwrap();
    let mut generator = LtcGenerator::new(first, speed, rate_hz, 0.3);
    let mut samples = Vec::new();
    (0..count).for_each(|_| generator.frame(&mut samples));
    (first, samples)
}

fn decode(rate_hz: u32, samples: impl Iterator<Item = f32>) -> Vec<LtcFrame> {
    let mut decoder = LtcDecoder::new(rate_hz);
    let mut frames = Vec::new();
    for sample in samples {
        decoder.process(std::iter::once(sample));
        decoder.take_frames(|frame| frames.push(frame));
    }
    frames
}

#[test]
fn all_rates_directions_and_speeds_are_decoded_at_the_right_samples() {
    for rate_hz in [44_100, 48_000, 96_000] {
        for rate in RATES {
            for speed in [1.0, 0.9, 1.1, 0.55, 1.9, -1.0, -0.9, -1.1] {
                let (first, samples) = sound(rate, speed, rate_hz, 40);
                let frames = decode(rate_hz, samples.iter().copied());
                let what = format!("{rate_hz} Hz, {rate:?}, speed {speed}");
                assert!(frames.len() >= 36, "{what}: {} frames", frames.len());
                let length = f64::from(rate_hz) / (rate.frames_per_second().to_f64() * speed.abs());
                for frame in frames {
                    let number = (frame.end / length).round();
                    let steps = (number as i64 - 1) * if speed < 0.0 { -1 } else { 1 };
                    let expected = first.wrapping_add_frames(steps).fields();
                    assert_eq!(frame.fields, expected, "{what}");
                    assert_eq!(
                        (frame.is_reverse, frame.drops),
                        (speed < 0.0, rate.is_drop_frame())
                    );
                    let error = frame.end - number * length;
                    assert!(error.abs() < 1.5, "{what}: {error} samples");
                    assert!((frame.length / length - 1.0).abs() < 0.002, "{what}");
                }
            }
        }
    }
}

/// The frame 01:02:03:04 of SMPTE ST 12-1, written bit by bit: units and tens of frames, seconds,
/// minutes and hours, each group followed by four user bits, then the sync word.
#[test]
fn the_bits_of_a_frame_are_those_of_the_standard() {
    const BITS_OF_FRAME: &str = concat!(
        "0010",
        "0000",
        "0000",
        "0000",
        "1100",
        "0000",
        "0000",
        "0000",
        "0100",
        "0000",
        "0000",
        "0000",
        "1000",
        "0000",
        "0000",
        "0000",
        "0011111111111101"
    );
    let mut samples = Vec::new();
    let mut level = 0.4;
    for bit in BITS_OF_FRAME.repeat(4).bytes() {
        level = -level;
        samples.extend([level; 10]);
        if bit == b'1' {
            level = -level;
        }
        samples.extend([level; 10]);
    }
    level = -level;
    samples.extend([level; 10]);
    let frames = decode(48_000, samples.into_iter());
    let fields = Fields {
        hours: 1,
        minutes: 2,
        seconds: 3,
        frames: 4,
    };
    assert!(frames.len() >= 2);
    assert!(
        frames
            .iter()
            .all(|it| it.fields == fields && !it.is_reverse && !it.drops)
    );
    let end = frames[0].end / 1_600.0;
    assert!((end - end.round()).abs() < 0.001, "{end} frames");
}

#[test]
fn level_polarity_offset_and_noise_do_not_matter() {
    let (_, samples) = sound(FrameRate::FPS_25, 1.0, 48_000, 100);
    let noise = |n: usize, level: f32| level * (fastrand::Rng::with_seed(n as u64).f32() - 0.5);
    for (gain, offset, hiss) in [
        (0.01, 0.0, 0.0),
        (-3.0, 0.0, 0.0),
        (1.0, 0.2, 0.0),
        // A signal-to-noise ratio of 17 dB.
        (1.0, 0.0, 0.15),
    ] {
        let changed = samples
            .iter()
            .enumerate()
            .map(|(n, x)| gain * x + offset + noise(n, hiss));
        let count = decode(48_000, changed).len();
        assert!(
            count >= 94,
            "gain {gain}, offset {offset}, noise {hiss}: {count} of 100 frames"
        );
    }
}

#[test]
fn the_decoder_finds_the_signal_again_after_a_gap_and_at_another_speed() {
    let (_, one) = sound(FrameRate::FPS_25, 1.0, 48_000, 10);
    let (_, two) = sound(FrameRate::FPS_30, 1.1, 48_000, 10);
    let both = [one, vec![0.0; 12_345], two].concat();
    let frames = decode(48_000, both.into_iter());
    let after: Vec<_> = frames.iter().filter(|frame| frame.end > 31_545.0).collect();
    assert!(
        frames.len() - after.len() >= 8 && after.len() >= 7,
        "{} {}",
        frames.len(),
        after.len()
    );
}

#[test]
fn music_and_silence_are_no_timecode() {
    let mut random = fastrand::Rng::with_seed(1);
    let noise = (0..480_000).map(|_| random.f32() - 0.5);
    assert_eq!(decode(48_000, noise).len(), 0);
    assert_eq!(decode(48_000, std::iter::repeat_n(0.0, 48_000)).len(), 0);
    let square = (0..48_000).map(|n| if n / 20 % 2 == 0 { 0.5 } else { -0.5 });
    assert_eq!(decode(48_000, square).len(), 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_samples_are_decoded_without_a_panic(
        bits in proptest::collection::vec(any::<u32>(), 0..2_000),
        rate_hz in 1u32..400_000,
    ) {
        let mut decoder = LtcDecoder::new(rate_hz);
        decoder.process(bits.iter().map(|&bits| f32::from_bits(bits)));
        decoder.take_frames(|_| ());
        prop_assert_eq!(decoder.processed(), bits.len() as u64);
    }
}
