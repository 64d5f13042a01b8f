//! Tests of the timecode clock, with sources on a virtual clock.

use proptest::prelude::*;
use smpte_timecode::{Direction, Fields, MtcEncoder};

use super::super::ltc::LtcDecoder;
use super::super::ltc::generator::LtcGenerator;
use super::super::mtc::MtcReceiver;
use super::super::{art_net, parse_label};
use super::*;

const RATES: [FrameRate; 4] = [
    FrameRate::FPS_24,
    FrameRate::FPS_25,
    FrameRate::FPS_29_97_DF,
    FrameRate::FPS_30,
];
/// Errors are measured from this time after the first sample or message on, in seconds.
const LOCK_S: f64 = 0.5;
const ERROR_S: f64 = 0.005;

fn fps(rate: FrameRate) -> f64 {
    rate.frames_per_second().to_f64()
}

/// A source that runs from `first` on with `speed`.
#[derive(Clone, Copy, Debug)]
struct Run {
    first: Timecode,
    speed: f64,
}

impl Run {
    fn new(label: &str, rate: FrameRate, speed: f64) -> Self {
        let (fields, _) = parse_label(label).unwrap();
        let first = Timecode::from_fields(fields, rate).unwrap();
        Self { first, speed }
    }

    fn rate(self) -> FrameRate {
        self.first.rate()
    }

    /// Returns the true position after `time` seconds.
    fn position(self, time: f64) -> f64 {
        f64::from(self.first.frames()) / fps(self.rate()) + self.speed * time
    }

    fn linear(self, rate_hz: u32, seconds: f64) -> Vec<Reading> {
        let mut generator = LtcGenerator::new(self.first, self.speed, rate_hz, 0.2);
        // In reverse, the first frame ends at the beginning of its label.
        let mut samples = Vec::new();
        while samples.len() < (seconds * f64::from(rate_hz)) as usize {
            generator.frame(&mut samples);
        }
        let mut decoder = LtcDecoder::new(rate_hz);
        let mut readings = Vec::new();
        for block in samples.chunks(256) {
            decoder.process(block.iter().copied());
            decoder.take_frames(|frame| {
                let at = Seconds(frame.end / f64::from(rate_hz));
                readings.push(frame.reading(at, rate_hz));
            });
        }
        if self.speed < 0.0 {
            // The first frame was written whole, so the position began one frame later.
            let frame = Seconds(1.0 / (fps(self.rate()) * -self.speed));
            return readings.into_iter().map(|it| it.later(-frame)).collect();
        }
        readings
    }

    fn midi(self, rate: Rate, seconds: f64) -> Vec<Reading> {
        let direction = match self.speed > 0.0 {
            true => Direction::Forward,
            false => Direction::Reverse,
        };
        let mut receiver = MtcReceiver::new(rate);
        let quarter = 0.25 / (fps(self.rate()) * self.speed.abs());
        // Reverse cycles begin 1.75 frames after the place that they carry.
        let start = if self.speed > 0.0 {
            0.0
        } else {
            -7.0 * quarter
        };
        let messages = MtcEncoder::new(self.first, direction).unwrap();
        let count = (seconds / quarter) as usize;
        let read = |(n, bytes): (usize, [u8; 2])| {
            let at = Seconds(start + n as f64 * quarter);
            receiver
                .receive(&bytes, at + Seconds(10.0))
                .unwrap()
                .map(|it| it.later(Seconds(-10.0)))
        };
        messages.take(count).enumerate().filter_map(read).collect()
    }

    /// Readings of whole frames that arrive late by up to `jitter` seconds.
    fn packets(self, jitter: f64, seconds: f64) -> Vec<Reading> {
        let mut random = fastrand::Rng::with_seed(3);
        let frame = 1.0 / (fps(self.rate()) * self.speed.abs());
        let count = (seconds / frame) as i64;
        let read = |n: i64| {
            let steps = if self.speed > 0.0 { n } else { -n };
            let packet = art_net::packet(self.first.wrapping_add_frames(steps));
            Reading {
                at: Seconds(n as f64 * frame + jitter * random.f64()),
                place: art_net::parse(&packet).unwrap().unwrap(),
                frame: None,
                jitter: Seconds(0.005),
                is_locate: false,
            }
        };
        (0..count).map(read).collect()
    }
}

/// Sends `readings` to a clock. Returns the time of the lock, and the greatest error from [`LOCK_S`]
/// on until the last reading, at any time between readings.
fn follow(clock: &mut TimecodeClock, readings: &[Reading], run: Run) -> (f64, f64) {
    let (mut lock, mut worst) = (f64::INFINITY, 0.0f64);
    let mut next = readings.iter().peekable();
    let end = readings.last().unwrap().at.0;
    for tick in 0..(end * 480.0) as u32 {
        let now = f64::from(tick) / 480.0;
        while let Some(reading) = next.next_if(|reading| reading.at.0 <= now) {
            clock.receive(reading);
        }
        let position = clock.position(Seconds(now));
        if position.state == State::Locked {
            lock = lock.min(now);
        }
        if now >= LOCK_S {
            assert_eq!(position.state, State::Locked, "{run:?} at {now} s");
            worst = worst.max((position.seconds - run.position(now)).abs());
        }
    }
    (lock, worst)
}

#[test]
fn all_sources_lock_in_half_a_second_within_five_milliseconds() {
    let (mut lock_max, mut error_max) = (0.0f64, 0.0f64);
    for rate in RATES {
        for speed in [1.0, 0.9, 1.1, -1.0, -0.9, -1.1] {
            let run = Run::new("01:00:58:20", rate, speed);
            let fixed = Rate::Fixed(rate);
            let sources = [
                ("LTC 44.1 kHz", run.linear(44_100, 5.0)),
                ("LTC 48 kHz", run.linear(48_000, 5.0)),
                ("MTC", run.midi(Rate::Auto, 5.0)),
                ("Art-Net", run.packets(0.0, 5.0)),
                ("Art-Net with jitter", run.packets(0.004, 5.0)),
            ];
            for (name, readings) in sources {
                let mut clock = TimecodeClock::new(fixed, 25);
                let (lock, error) = follow(&mut clock, &readings, run);
                assert!(lock <= LOCK_S, "{name}, {run:?}: locked after {lock} s");
                assert!(error <= ERROR_S, "{name}, {run:?}: {error} s");
                assert_eq!((clock.locates, clock.ignored), (1, 0), "{name}, {run:?}");
                (lock_max, error_max) = (lock_max.max(lock), error_max.max(error));
            }
        }
    }
    // These bounds are tighter than the promise, so that a loss of accuracy is noticed.
    assert!(
        lock_max < 0.4 && error_max < 0.0045,
        "{lock_max} s, {error_max} s"
    );
}

#[test]
fn the_rate_of_linear_timecode_is_detected() {
    for rate in RATES {
        for (speed, proof) in [
            (1.0, 0.0),
            (0.985, 0.0),
            (1.015, 0.0),
            (0.9, 1.3),
            (1.1, 1.3),
            (-1.0, 0.0),
        ] {
            let run = Run::new("10:00:00:12", rate, speed);
            let mut clock = TimecodeClock::new(Rate::Auto, 25);
            let readings = run.linear(48_000, 6.0);
            readings
                .iter()
                .filter(|it| it.at.0 < proof)
                .for_each(|it| clock.receive(it));
            let rest: Vec<Reading> = readings.into_iter().filter(|it| it.at.0 >= proof).collect();
            let mut worst = 0.0f64;
            for reading in rest {
                clock.receive(&reading);
                if reading.at.0 > proof + LOCK_S {
                    let position = clock.position(reading.at);
                    worst = worst.max((position.seconds - run.position(reading.at.0)).abs());
                }
            }
            assert!(worst <= ERROR_S, "{run:?}: {worst} s");
        }
    }
}

#[test]
fn the_clock_runs_on_through_a_drop_out_and_is_lost_after_the_freewheel() {
    let run = Run::new("00:59:59:20", FrameRate::FPS_25, 1.03);
    let mut clock = TimecodeClock::new(Rate::Auto, 25);
    let readings = run.linear(48_000, 12.0);
    let part = |from: f64, to: f64| {
        let is_in = move |it: &&Reading| (from..to).contains(&it.at.0);
        readings.iter().filter(is_in).collect::<Vec<_>>()
    };
    part(0.0, 3.0).iter().for_each(|it| clock.receive(it));
    let at = |clock: &TimecodeClock, now: f64| clock.position(Seconds(now));
    for now in [3.0, 3.3, 3.9] {
        let position = at(&clock, now);
        assert!(
            (position.seconds - run.position(now)).abs() < 0.001,
            "{position:?}"
        );
    }
    assert_eq!(at(&clock, 3.05).state, State::Locked);
    assert_eq!(at(&clock, 3.9).state, State::Freewheel);
    part(3.9, 5.0).iter().for_each(|it| clock.receive(it));
    assert_eq!((at(&clock, 5.0).state, clock.locates), (State::Locked, 1));
    // 25 frames and the three that may be missing.
    assert_eq!(at(&clock, 6.05).state, State::Freewheel);
    assert_eq!(at(&clock, 6.2).state, State::Lost);
    assert_eq!(at(&clock, 6.2).seconds, at(&clock, 9.0).seconds);
    part(9.0, 10.0).iter().for_each(|it| clock.receive(it));
    let position = at(&clock, 10.0);
    assert!((position.seconds - run.position(10.0)).abs() < 0.005);
    assert_eq!((position.state, position.locates), (State::Locked, 2));
}

#[test]
fn a_stray_frame_moves_nothing_and_a_locate_is_followed_after_three_frames() {
    let run = Run::new("01:00:00:00", FrameRate::FPS_25, 1.0);
    let mut clock = TimecodeClock::new(Rate::Auto, 25);
    let mut readings = run.packets(0.0, 4.0);
    let stray = |fields: Fields| Place::Frame {
        fields,
        rate: Some(FrameRate::FPS_25),
        drops: false,
        after_frames: 0.0,
    };
    for (n, label) in [
        (30, "23:00:00:00"),
        (50, "00:00:00:00"),
        (51, "05:00:00:00"),
    ] {
        readings[n].place = stray(parse_label(label).unwrap().0);
    }
    let (_, error) = follow(&mut clock, &readings, run);
    assert!(
        error < 0.001 && clock.locates == 1,
        "{error} {}",
        clock.locates
    );
    assert_eq!(clock.ignored(), 3);
    let there = Run::new("02:00:00:00", FrameRate::FPS_25, 1.0);
    for (n, reading) in there.packets(0.0, 0.2).iter().enumerate() {
        let reading = reading.later(Seconds(4.0));
        clock.receive(&reading);
        let is_there = clock.position(reading.at).seconds > 7_000.0;
        assert_eq!(is_there, n >= 2, "after {} frames", n + 1);
    }
}

#[test]
fn a_paused_source_stands_and_a_full_frame_of_midi_is_believed_at_once() {
    let mut clock = TimecodeClock::new(Rate::Auto, 25);
    let run = Run::new("01:00:00:00", FrameRate::FPS_30, 1.0);
    let mut readings = run.packets(0.0, 4.0);
    let paused = readings[60].place;
    readings[60..].iter_mut().for_each(|it| it.place = paused);
    readings.iter().for_each(|it| clock.receive(it));
    let position = clock.position(Seconds(4.0));
    assert_eq!(position.state, State::Standing);
    assert!((position.seconds - 3_602.0).abs() < 0.005, "{position:?}");
    let place = Timecode::parse("10:00:00:00", FrameRate::FPS_25).unwrap();
    let full = MtcEncoder::full_frame(place).unwrap();
    let reading = MtcReceiver::default()
        .receive(&full, Seconds(5.0))
        .unwrap()
        .unwrap();
    clock.receive(&reading);
    for now in [5.0, 500.0] {
        let position = clock.position(Seconds(now));
        assert_eq!(
            (position.seconds, position.state),
            (36_000.0, State::Standing)
        );
        assert_eq!(position.timecode().unwrap().to_string(), "10:00:00:00");
    }
}

#[test]
fn a_change_of_speed_or_direction_is_followed() {
    let mut clock = TimecodeClock::new(Rate::Auto, 25);
    let there = Run::new("01:00:00:00", FrameRate::FPS_25, 1.0);
    there
        .linear(48_000, 4.0)
        .iter()
        .for_each(|it| clock.receive(it));
    let back = Run::new("01:00:04:00", FrameRate::FPS_25, -1.0);
    let readings: Vec<Reading> = back
        .packets(0.0, 2.0)
        .iter()
        .map(|it| it.later(Seconds(4.0)))
        .collect();
    readings.iter().for_each(|it| clock.receive(it));
    let position = clock.position(Seconds(6.0));
    assert!(
        (position.seconds - 3_602.0).abs() < 0.005 && position.speed < -0.99,
        "{position:?}"
    );
}

proptest! {
    #[test]
    fn any_readings_are_followed_or_ignored(
        readings in proptest::collection::vec((any::<u8>(), any::<u8>(), any::<f64>(), -1.0..2.0f64, any::<bool>()), 0..200),
    ) {
        let mut clock = TimecodeClock::new(Rate::Auto, 25);
        let mut now = 0.0;
        for (seconds, frames, value, step, is_locate) in readings {
            now += step;
            let fields = Fields { hours: 1, minutes: 0, seconds, frames };
            let place = match seconds % 3 {
                0 => Place::Seconds(value),
                n => Place::Frame { fields, rate: None, drops: n == 1, after_frames: value % 2.0 },
            };
            let at = Seconds(if frames == 7 { value } else { now });
            clock.receive(&Reading { at, place, frame: None, jitter: Seconds(0.005), is_locate });
            let position = clock.position(Seconds(now));
            prop_assert!(position.seconds.is_finite() && position.speed.is_finite());
            let _ = position.timecode();
        }
    }
}
