//! Feeds: a decoded sound as samples for the show, as a live input would deliver them. In: a sound,
//! the time. Out: mono samples at [`SAMPLE_RATE`].
//!
//! [`FileFeed`] follows the clock of the show; [`PlayedFeed`] follows an output device that plays
//! the same sound. Thread: show. Allocates: never after `new`.

use std::sync::Arc;

use crate::audio::callback::Progress;
use corybant_core::dsp::SAMPLE_RATE;
use corybant_core::time::Seconds;

/// Longest part of a sound, in seconds, that a [`FileFeed`] keeps until the show reads it. A live
/// input keeps the same length.
pub const BACKLOG_S: u64 = 2;
/// A feed treats an output device as stopped if the device has consumed no samples for this time,
/// in seconds.
const STOPPED_S: f64 = 0.5;
/// If more than this time, in seconds, passes between two calls of a feed, the feed concludes that
/// the system had suspended the whole program.
const SUSPENDED_S: f64 = 0.25;

/// Delivers the samples of a decoded sound to the show, in step with a clock.
#[derive(Clone, Debug)]
pub struct FileFeed {
    samples: Arc<[f32]>,
    /// Number of samples of the sound that were read or skipped so far. It keeps increasing when a
    /// looped sound starts again.
    position: u64,
    looped: bool,
}

impl FileFeed {
    /// Creates a feed of the sound `samples`, mono at [`SAMPLE_RATE`]. The feed delivers the sound
    /// once or, if `looped` is true, for ever without a gap.
    pub fn new(samples: Arc<[f32]>, looped: bool) -> Self {
        Self {
            samples,
            position: 0,
            looped,
        }
    }

    /// Returns all samples of the sound, mono at [`SAMPLE_RATE`].
    pub fn samples(&self) -> &[f32] {
        &self.samples
    }

    /// Copies the unread samples up to the time `now`, counted from the start of the sound, to the
    /// start of `mono` and returns their number. Samples that do not fit into `mono` are delivered
    /// by the next call. If more than [`BACKLOG_S`] seconds of samples are unread, all of them are
    /// skipped. Returns 0 if all samples up to `now` have been read already.
    pub fn read_until(&mut self, now: Seconds, mono: &mut [f32]) -> usize {
        let end = self.samples_until(now);
        if end.saturating_sub(self.position) > BACKLOG_S * u64::from(SAMPLE_RATE) {
            self.position = end;
        }
        self.read_all_until(now, mono)
    }

    /// Copies the unread samples up to the time `now`, counted from the start of the sound, to the
    /// start of `mono` and returns their number. No unread samples are skipped.
    fn read_all_until(&mut self, now: Seconds, mono: &mut [f32]) -> usize {
        let (end, length) = (self.samples_until(now), self.samples.len() as u64);
        let mut n = 0;
        while n < mono.len() && self.position < end {
            let from = (self.position % length) as usize;
            let run = (mono.len() - n)
                .min(self.samples.len() - from)
                .min(usize::try_from(end - self.position).unwrap_or(usize::MAX));
            mono[n..n + run].copy_from_slice(&self.samples[from..from + run]);
            n += run;
            self.position += run as u64;
        }
        n
    }

    /// Returns the number of samples from the start of the sound to the time `now`. If the sound is
    /// looped, the samples of each repetition count.
    fn samples_until(&self, now: Seconds) -> u64 {
        // A rounding error of `now` must not cost a sample; `as` converts negative values and NaN
        // to 0.
        let samples = (now.0 * f64::from(SAMPLE_RATE) + 1e-6).floor() as u64;
        if self.looped && !self.samples.is_empty() {
            samples
        } else {
            samples.min(self.samples.len() as u64)
        }
    }

    /// Moves the feed to the time `at`, counted from the start of the sound. The next read begins
    /// there.
    pub fn skip_to(&mut self, at: Seconds) {
        self.position = (at.0 * f64::from(SAMPLE_RATE)).round() as u64;
    }

    /// Returns the number of samples that were read or skipped so far.
    pub fn position(&self) -> u64 {
        self.position
    }

    /// Returns true if the sound is empty, or if it is not looped and its last sample has been
    /// read.
    pub fn is_done(&self) -> bool {
        self.samples.is_empty() || (!self.looped && self.position >= self.samples.len() as u64)
    }
}

/// Delivers the samples of a sound to the show while an output device plays the same sound. Each
/// sample is delivered when it is audible. If the device stops, the feed follows the clock of the
/// show.
#[derive(Debug)]
pub struct PlayedFeed {
    feed: FileFeed,
    progress: Arc<Progress>,
    /// Duration of one sample of the output device, in seconds.
    sample_s: f64,
    /// Number of samples that the output device had consumed at the time `played_at`.
    played: u64,
    /// Time of the last call of `read_until` that found new samples consumed by the output device,
    /// or that followed a suspension of the program. `None` before the first call.
    played_at: Option<Seconds>,
    /// Time of the last call of `read_until`, by the clock of the show.
    called_at: Seconds,
    /// True while the output device is treated as stopped; the feed then follows the clock of the
    /// show.
    stopped: bool,
}

impl PlayedFeed {
    /// Creates a feed that follows an output device. The device plays the sound of `feed` and
    /// reports its position to `progress`. One sample of the device lasts `sample_s` seconds.
    pub(super) fn new(feed: FileFeed, progress: Arc<Progress>, sample_s: f64) -> Self {
        Self {
            feed,
            progress,
            sample_s,
            played: 0,
            played_at: None,
            called_at: Seconds(0.0),
            stopped: false,
        }
    }

    /// Copies the unread samples that are audible by the time `now` (by the clock of the show) to
    /// the start of `mono` and returns their number. The first call starts the playback.
    pub fn read_until(&mut self, now: Seconds, mono: &mut [f32]) -> usize {
        let played = self.progress.played();
        let position = played as f64 * self.sample_s - self.progress.latency_us() as f64 * 1e-6;
        if self.played_at.is_none() {
            self.progress.start();
        }
        if self.played_at.is_none() || played != self.played {
            if self.stopped {
                self.feed.skip_to(Seconds(position));
            }
            (self.played, self.played_at, self.stopped) = (played, Some(now), false);
        }
        let before = std::mem::replace(&mut self.called_at, now);
        if now.0 - before.0 > SUSPENDED_S && self.played_at.is_some() {
            // The whole program was suspended, so this is no sign that the device has stopped.
            self.played_at = Some(now);
        }
        let stopped_for_s = now.0 - self.played_at.unwrap_or(now).0;
        if stopped_for_s < STOPPED_S {
            return self.feed.read_all_until(Seconds(position), mono);
        }
        if !self.stopped {
            // Delivers only as much of the missed sound as fits into `mono`, so that the beats keep
            // their times.
            self.stopped = true;
            self.feed.skip_to(Seconds(
                position + stopped_for_s - mono.len() as f64 / f64::from(SAMPLE_RATE),
            ));
        }
        self.feed
            .read_all_until(Seconds(position + stopped_for_s), mono)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::audio::callback::Playback;

    const LENGTH: usize = 60 * SAMPLE_RATE as usize;
    /// Samples in a block of the device, at [`SAMPLE_RATE`].
    const BLOCK: usize = 441;

    /// A simulated device and the feed that follows it, on a clock that the test moves.
    struct SimulatedDevice {
        playback: Playback,
        feed: PlayedFeed,
        progress: Arc<Progress>,
        received: Vec<f32>,
    }

    impl SimulatedDevice {
        fn new() -> Self {
            let sound: Arc<[f32]> = (0..LENGTH).map(|i| i as f32).collect();
            let progress = Arc::new(Progress::default());
            let stereo = sound.iter().map(|&x| [x; 2]).collect();
            let playback = Playback::new(stereo, true, 1, Arc::default(), progress.clone());
            let feed = PlayedFeed::new(
                FileFeed::new(sound, true),
                progress.clone(),
                1.0 / f64::from(SAMPLE_RATE),
            );
            Self {
                playback,
                feed,
                progress,
                received: Vec::new(),
            }
        }

        /// Runs ticks of 10 ms. In each tick the device consumes the number of blocks that `blocks`
        /// returns.
        fn run(&mut self, ticks: std::ops::Range<u32>, blocks: impl Fn(u32) -> usize) {
            let mut mono = [0.0; 11_025];
            for tick in ticks {
                for _ in 0..blocks(tick) {
                    self.playback.fill(&mut [0.0f32; BLOCK]);
                }
                let n = self
                    .feed
                    .read_until(Seconds(f64::from(tick) * 0.01), &mut mono);
                self.received.extend_from_slice(&mono[..n]);
            }
        }
    }

    #[test]
    fn the_sound_starts_with_the_first_tick() {
        let mut device = SimulatedDevice::new();
        device.playback.fill(&mut [0.0f32; 5 * BLOCK]);
        assert_eq!(device.progress.played(), 0);
        device.run(100..102, |_| 1);
        assert_eq!(
            device.received.len(),
            BLOCK,
            "the first block is silence, the second has sound"
        );
    }

    #[test]
    fn the_feed_follows_a_slow_device_and_its_latency() {
        let mut device = SimulatedDevice::new();
        device.playback.set_latency(Duration::from_millis(20));
        device.run(0..5_000, |tick| usize::from(tick % 100 != 0));
        let played = device.progress.played() as usize;
        assert_eq!(played, 4_950 * BLOCK);
        assert_eq!(
            device.received.len(),
            played - 2 * BLOCK,
            "by the clock it would be half a second more"
        );
        assert!(
            device
                .received
                .iter()
                .enumerate()
                .all(|(i, &sample)| sample == (i % LENGTH) as f32)
        );
    }

    #[test]
    fn the_feed_continues_while_the_device_stops_and_follows_it_again() {
        let mut device = SimulatedDevice::new();
        device.run(0..300, |_| 1);
        device.received.clear();
        device.run(300..1_000, |_| 0);
        // No samples for half a second; then the feed continues as if the device had not stopped.
        let expected = (700 - 25) * BLOCK;
        assert!(
            device.received.len().abs_diff(expected) <= 2 * BLOCK,
            "{} of {expected}",
            device.received.len()
        );
        let last = *device.received.last().unwrap() as usize;
        assert!(last.abs_diff(999 * BLOCK) <= BLOCK, "{last}");
        device.received.clear();
        device.run(1_000..1_100, |_| 1);
        let last = *device.received.last().unwrap() as usize;
        assert_eq!(
            last + 1,
            device.progress.played() as usize,
            "the position of the device"
        );
    }

    #[test]
    fn after_a_suspension_the_feed_continues_at_the_position_of_the_device() {
        let mut device = SimulatedDevice::new();
        device.run(0..300, |_| 1);
        // A minute later the first call comes before the first block of the device.
        device.run(6_300..6_301, |_| 0);
        device.run(6_301..6_400, |_| 1);
        let expected = device.progress.played() as usize;
        assert_eq!(device.received.len(), expected);
        let continues = |(i, &sample): (usize, &f32)| sample == i as f32;
        assert!(device.received.iter().enumerate().all(continues));
    }

    #[test]
    fn a_feed_follows_the_clock() {
        let samples: Arc<[f32]> = (0..44_100).map(|i| i as f32).collect();
        let mut feed = FileFeed::new(samples.clone(), false);
        let (mut received, mut mono) = (Vec::new(), [0.0; 400]);
        for tick in 0..=125 {
            let n = feed.read_until(Seconds(f64::from(tick) / 120.0), &mut mono);
            received.extend_from_slice(&mono[..n]);
            if tick <= 120 {
                assert_eq!(received.len(), tick as usize * 44_100 / 120);
            }
        }
        assert!(feed.is_done());
        assert_eq!(received, *samples);
    }

    #[test]
    fn a_feed_catches_up_in_steps_and_ignores_a_clock_that_goes_back() {
        let mut feed = FileFeed::new((0..1_000).map(|i| i as f32).collect(), false);
        let mut mono = [0.0; 300];
        for now in [-1.0, f64::NAN, 0.0] {
            assert_eq!(feed.read_until(Seconds(now), &mut mono), 0);
        }
        assert_eq!(
            feed.read_until(Seconds(500.0 / 44_100.0 + 1e-9), &mut mono),
            300
        );
        assert_eq!(feed.read_until(Seconds(0.001), &mut mono), 0);
        assert_eq!(
            feed.read_until(Seconds(500.0 / 44_100.0 + 1e-9), &mut mono),
            200
        );
        assert_eq!(mono[199], 499.0);
        assert!(!feed.is_done());
    }

    #[test]
    fn samples_that_wait_too_long_are_skipped() {
        let samples: Arc<[f32]> = (0..10 * SAMPLE_RATE).map(|i| i as f32).collect();
        let mut mono = vec![0.0; 11_025];
        for looped in [false, true] {
            let mut feed = FileFeed::new(samples.clone(), looped);
            assert_eq!(
                feed.read_until(Seconds(1.9), &mut mono),
                mono.len(),
                "the samples waited"
            );
            assert_eq!(mono[11_024], 11_024.0);
            assert_eq!(
                feed.read_until(Seconds(6.0), &mut mono),
                0,
                "the samples are skipped"
            );
            assert_eq!(feed.read_until(Seconds(6.01), &mut mono), 441);
            assert_eq!(
                mono[0],
                6.0 * SAMPLE_RATE as f32,
                "the feed continues there"
            );
            assert_eq!(feed.read_until(Seconds(3_600.0), &mut mono), 0);
            assert_eq!(feed.is_done(), !looped);
        }
    }

    #[test]
    fn a_loop_has_no_gap_and_no_end() {
        let mut feed = FileFeed::new([1.0, 2.0, 3.0].into(), true);
        let mut mono = [0.0; 8];
        assert_eq!(feed.read_until(Seconds(1.0), &mut mono), 8);
        assert_eq!(mono, [1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 1.0, 2.0]);
        assert!(!feed.is_done());
        let mut empty = FileFeed::new([].into(), true);
        assert_eq!(empty.read_until(Seconds(1.0), &mut mono), 0);
        assert!(empty.is_done());
    }
}
