//! The channels of an audio input: which of them are mixed to mono (this can change during the
//! show), the peak level of each, and whether it clipped. In: chosen channels, blocks of samples.
//! Out: chosen channels, levels, number of samples. Thread: any; the show thread reads the chosen
//! channels and measures. Real-time: never waits. Allocates: `chosen` and `take_levels`.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

use serde::Serialize;

use corybant_core::dsp::sound_check::{CLIPPED_RUN, FULL_SCALE};

/// Highest channel number that can be chosen for the input; channels are counted from 1.
pub const CHANNELS_MAX: u16 = 256;

/// The channels of an audio input: which of them are chosen to be mixed to mono, and the peak level
/// of each. Clones share the state.
#[derive(Clone)]
pub struct Channels(Arc<Inner>);

struct Inner {
    /// Number of channels of the open input device; 0 if no device is open.
    count: AtomicU32,
    /// Sample rate that the open input device reports, in Hz.
    rate_hz: AtomicU32,
    /// Number of samples per channel that were measured so far.
    frames: AtomicU64,
    /// Number of times that the choice of the channels to mix has changed so far.
    version: AtomicU32,
    /// Number of the channel that carries timecode, counted from 1; 0 if there is none.
    timecode: AtomicU32,
    chosen: [AtomicBool; CHANNELS_MAX as usize],
    /// Largest absolute sample of each channel, indexed by channel number - 1, as the bits of an
    /// `f32`. For floats >= 0, a larger value has larger bits, so peaks can be compared as
    /// integers.
    peaks: [AtomicU32; CHANNELS_MAX as usize],
    /// Number of consecutive samples at full scale of each channel, up to its last sample.
    runs: [AtomicU32; CHANNELS_MAX as usize],
    /// True for each channel that clipped.
    clipped: [AtomicBool; CHANNELS_MAX as usize],
}

/// The level of one channel of an audio input.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChannelLevel {
    /// Largest absolute sample of the channel since the last call of [`Channels::take_levels`];
    /// full scale is 1.
    pub peak: f32,
    /// True if the channel clipped since the last call of [`Channels::take_levels`].
    pub clipped: bool,
    /// True if the channel is one of those that are mixed into the mono sound.
    pub chosen: bool,
}

impl Channels {
    /// Creates the channels of an input. The channels with the numbers `chosen`, counted from 1,
    /// are mixed to mono; an empty list means all channels.
    pub fn new(chosen: &[u16]) -> Self {
        let inner = Inner {
            count: AtomicU32::new(0),
            rate_hz: AtomicU32::new(0),
            frames: AtomicU64::new(0),
            version: AtomicU32::new(0),
            timecode: AtomicU32::new(0),
            chosen: [const { AtomicBool::new(false) }; CHANNELS_MAX as usize],
            peaks: [const { AtomicU32::new(0) }; CHANNELS_MAX as usize],
            runs: [const { AtomicU32::new(0) }; CHANNELS_MAX as usize],
            clipped: [const { AtomicBool::new(false) }; CHANNELS_MAX as usize],
        };
        let channels = Self(Arc::new(inner));
        channels.choose(chosen);
        channels
    }

    /// Selects the channels with the numbers `chosen`, counted from 1, to be mixed to mono from the
    /// next block on. An empty list means all channels.
    pub fn choose(&self, chosen: &[u16]) {
        for (number, flag) in (1..=CHANNELS_MAX).zip(&self.0.chosen) {
            flag.store(chosen.contains(&number), Ordering::Relaxed);
        }
        self.0.version.fetch_add(1, Ordering::Release);
    }

    /// Returns the numbers of the chosen channels, counted from 1, in ascending order; an empty
    /// list means that all channels are mixed.
    pub fn chosen(&self) -> Vec<u16> {
        (1..=CHANNELS_MAX)
            .filter(|&number| self.is_chosen(number))
            .collect()
    }

    /// Returns true if the channel `number`, counted from 1, was chosen to be mixed. Returns false
    /// for every channel if none was chosen, although all channels are then mixed.
    pub fn is_chosen(&self, number: u16) -> bool {
        number
            .checked_sub(1)
            .and_then(|i| self.0.chosen.get(usize::from(i)))
            .is_some_and(|flag| flag.load(Ordering::Relaxed))
    }

    /// Sets the number of the channel that carries timecode, counted from 1; `None` if there is none.
    /// If no channels are chosen, this channel is left out of the mix.
    pub fn set_timecode(&self, number: Option<u16>) {
        let number = number.unwrap_or_default();
        self.0.timecode.store(number.into(), Ordering::Relaxed);
        self.0.version.fetch_add(1, Ordering::Release);
    }

    /// Returns the number of the channel that carries timecode, counted from 1; `None` if there is
    /// none.
    pub fn timecode(&self) -> Option<u16> {
        let number = self.0.timecode.load(Ordering::Relaxed);
        u16::try_from(number).ok().filter(|&number| number > 0)
    }

    /// Returns true if the channel `number` is mixed, if the mix is made of at least one channel
    /// like it: chosen, or any channel without timecode if none was chosen.
    pub fn is_mixed(&self, number: u16) -> bool {
        let is_chosen = |number| self.is_chosen(number);
        match (1..=CHANNELS_MAX).any(is_chosen) {
            true => self.is_chosen(number),
            false => self.timecode().is_some_and(|timecode| number != timecode),
        }
    }

    /// Returns a number that increases with each new choice of channels, so that a reader notices
    /// it.
    pub fn version(&self) -> u32 {
        self.0.version.load(Ordering::Acquire)
    }

    /// Sets the number of channels and the sample rate, in Hz, of the open input device; both are 0
    /// if no device is open.
    pub fn set_format(&self, count: u16, rate_hz: u32) {
        self.0.count.store(count.into(), Ordering::Relaxed);
        self.0.rate_hz.store(rate_hz, Ordering::Relaxed);
    }

    /// Returns the sample rate that the open input device reports, in Hz; 0 if no device is open.
    pub fn rate_hz(&self) -> u32 {
        self.0.rate_hz.load(Ordering::Relaxed)
    }

    /// Returns the number of samples per channel that were measured so far.
    pub fn frames(&self) -> u64 {
        self.0.frames.load(Ordering::Relaxed)
    }

    /// Measures a block of interleaved samples of `channels` channels: the peak level of each
    /// channel, clipping, and the number of samples.
    pub fn measure(&self, interleaved: &[f32], channels: usize) {
        let frames = interleaved.len() / channels.max(1);
        self.0.frames.fetch_add(frames as u64, Ordering::Relaxed);
        for (c, peak) in self.0.peaks.iter().enumerate().take(channels) {
            let (mut largest, mut is_clipped) = (0.0f32, false);
            let mut run = self.0.runs[c].load(Ordering::Relaxed);
            for x in interleaved.iter().skip(c).step_by(channels) {
                largest = largest.max(x.abs());
                run = if x.abs() >= FULL_SCALE {
                    run.saturating_add(1)
                } else {
                    0
                };
                is_clipped |= run >= CLIPPED_RUN;
            }
            peak.fetch_max(largest.to_bits(), Ordering::Relaxed);
            self.0.runs[c].store(run, Ordering::Relaxed);
            if is_clipped {
                self.0.clipped[c].store(true, Ordering::Relaxed);
            }
        }
    }

    /// Returns the level of each channel of the open device, and resets peaks and clipping.
    pub fn take_levels(&self) -> Vec<ChannelLevel> {
        let count = self.0.count.load(Ordering::Relaxed) as usize;
        let all = self.chosen().is_empty();
        let level = |c: usize| ChannelLevel {
            peak: f32::from_bits(self.0.peaks[c].swap(0, Ordering::Relaxed)),
            clipped: self.0.clipped[c].swap(false, Ordering::Relaxed),
            chosen: all || self.0.chosen[c].load(Ordering::Relaxed),
        };
        (0..count.min(CHANNELS_MAX.into())).map(level).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_channel_has_a_peak_and_is_mixed_if_chosen() {
        let channels = Channels::new(&[2]);
        assert_eq!(channels.take_levels(), []);
        channels.set_format(2, 48_000);
        channels.measure(&[0.5, -0.25, 0.1, 0.75], 2);
        channels.measure(&[f32::NAN, 0.0], 2);
        assert_eq!(
            channels.take_levels(),
            [
                ChannelLevel {
                    peak: 0.5,
                    clipped: false,
                    chosen: false
                },
                ChannelLevel {
                    peak: 0.75,
                    clipped: false,
                    chosen: true
                }
            ]
        );
        let version = channels.version();
        channels.choose(&[]);
        assert!(channels.version() != version && channels.chosen().is_empty());
        assert_eq!(
            channels.take_levels(),
            [ChannelLevel {
                peak: 0.0,
                clipped: false,
                chosen: true
            }; 2]
        );
        channels.choose(&[256, 1, 300]);
        assert_eq!(channels.chosen(), [1, 256]);
    }

    #[test]
    fn three_samples_in_a_row_at_full_scale_are_clipped() {
        let channels = Channels::new(&[]);
        channels.set_format(2, 48_000);
        let clipped = || {
            channels
                .take_levels()
                .iter()
                .map(|level| level.clipped)
                .collect::<Vec<_>>()
        };
        channels.measure(&[1.0, 1.0, -1.0, 0.5, 0.0, 1.0], 2);
        assert_eq!(clipped(), [false, false]);
        // The run of channel 2 goes on from the last block.
        channels.measure(&[0.0, 1.0, 0.0, -1.0], 2);
        assert_eq!(clipped(), [false, true]);
        channels.measure(&[0.0, 0.5], 2);
        assert_eq!(clipped(), [false, false]);
        assert_eq!((channels.frames(), channels.rate_hz()), (6, 48_000));
    }
}
