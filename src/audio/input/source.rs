//! The show's side of the ring buffer between an audio device and the show.
//!
//! In: interleaved samples at the device's rate. Out: mono samples at [`SAMPLE_RATE`]. Thread:
//! show. Allocates: never after `new`.

use ringbuf::HeapCons;
use ringbuf::traits::{Consumer, Observer};

use crate::audio::channels::Channels;
use crate::audio::resample::{Mix, RateError, Resampler};
use corybant_core::dsp::SAMPLE_RATE;
use corybant_core::time::Seconds;
use corybant_core::timecode::Reading;
use corybant_core::timecode::ltc::LtcDecoder;
use corybant_core::timecode::ltc::arrival::SampleArrival;

/// Reads interleaved samples of one device from the ring buffer, mixes them to mono and resamples
/// them.
pub struct Source {
    ring: HeapCons<f32>,
    mix: Mix,
    channels: Channels,
    /// Value of `channels.version()` for which `mix` was made; if the version has changed, `mix` is
    /// made again.
    mix_version: u32,
    resampler: Resampler,
    interleaved: Box<[f32]>,
    mono: Box<[f32]>,
    rate_hz: u32,
    /// Decoder of the channel that carries timecode, and the times of its samples.
    ltc: LtcDecoder,
    arrival: SampleArrival,
    /// Index of the channel that carries timecode; `None` if no channel of the device does.
    timecode: Option<usize>,
}

impl Source {
    /// Creates a reader of the ring buffer `ring` of a device with `channel_count` channels at
    /// `rate_hz` samples per second. It mixes the channels that are chosen in `channels`.
    ///
    /// # Errors
    /// [`RateError`] if the sample rate is not supported.
    pub fn new(
        ring: HeapCons<f32>,
        rate_hz: u32,
        channel_count: u16,
        channels: Channels,
    ) -> Result<Self, RateError> {
        let resampler = Resampler::new(rate_hz, SAMPLE_RATE)?;
        let block = resampler.vacant();
        let mix = Mix::new(channel_count, &[]);
        let interleaved = vec![0.0; block * mix.channels()].into();
        let mut source = Self {
            interleaved,
            mono: vec![0.0; block].into(),
            ring,
            mix,
            channels,
            mix_version: 0,
            resampler,
            rate_hz,
            ltc: LtcDecoder::new(rate_hz),
            arrival: SampleArrival::default(),
            timecode: None,
        };
        source.choose_channels();
        Ok(source)
    }

    /// Takes over the choice of the channels to mix and of the one that carries timecode.
    fn choose_channels(&mut self) {
        self.mix_version = self.channels.version();
        self.mix.choose(|number| self.channels.is_mixed(number));
        let number = self.channels.timecode().map(usize::from);
        self.timecode = number
            .filter(|&number| number <= self.mix.channels())
            .map(|number| number - 1);
    }

    /// Copies received samples, mono at [`SAMPLE_RATE`], to the start of `mono` and returns their
    /// number. Samples that do not fit are kept for the next call.
    pub fn read(&mut self, mono: &mut [f32]) -> usize {
        if self.channels.version() != self.mix_version {
            self.choose_channels();
        }
        let channel_count = self.mix.channels();
        let mut n = 0;
        loop {
            n += self.resampler.read(&mut mono[n..]);
            let frames = (self.ring.occupied_len() / channel_count).min(self.resampler.vacant());
            if n == mono.len() || frames == 0 {
                return n;
            }
            let block = &mut self.interleaved[..frames * channel_count];
            self.ring.pop_slice(block);
            self.channels.measure(block, channel_count);
            if let Some(channel) = self.timecode {
                let samples = block.iter().skip(channel).step_by(channel_count);
                self.ltc.process(samples.copied());
            }
            self.mix.mono(block, &mut self.mono);
            self.resampler.write(&self.mono[..frames]);
        }
    }

    /// Calls `each` for each frame of timecode in the samples that [`Source::read`] has read since
    /// the last call. `now` is the show time. The times of the frames have the latency of the input.
    pub fn read_timecode(&mut self, now: Seconds, each: &mut dyn FnMut(Reading)) {
        if self.timecode.is_none() {
            return;
        }
        let Self {
            rate_hz,
            ltc,
            arrival,
            ..
        } = self;
        let time = |samples: f64| Seconds(samples / f64::from(*rate_hz));
        arrival.observe(now, time(ltc.processed() as f64));
        ltc.take_frames(|frame| {
            let at = arrival.show_time(time(frame.end));
            each(frame.reading(at, *rate_hz));
        });
    }

    /// Returns the latency of the conversion to [`SAMPLE_RATE`], in seconds.
    pub(super) fn latency_s(&self) -> f64 {
        self.resampler.latency_s()
    }
}
