//! Linear timecode from a sound file. In: the samples of one channel, the show time. Out: readings of
//! timecode. Thread: show. Allocates: only in `new`.

use super::feed::FileFeed;
use corybant_core::dsp::SAMPLE_RATE;
use corybant_core::time::Seconds;
use corybant_core::timecode::Reading;
use corybant_core::timecode::ltc::LtcDecoder;

/// Delivers the timecode of a sound file in step with the clock of the show.
#[derive(Debug)]
pub struct LtcFeed {
    feed: FileFeed,
    decoder: LtcDecoder,
    samples: Box<[f32]>,
}

impl LtcFeed {
    /// Creates a feed of the sound of `feed`, which carries timecode.
    pub fn new(feed: FileFeed) -> Self {
        Self {
            feed,
            decoder: LtcDecoder::new(SAMPLE_RATE),
            samples: vec![0.0; SAMPLE_RATE as usize / 4].into(),
        }
    }

    /// Calls `each` for each frame of timecode that ended since the last call, up to the show time
    /// `now`.
    pub fn read_until(&mut self, now: Seconds, each: &mut dyn FnMut(Reading)) {
        let count = self.feed.read_until(now, &mut self.samples);
        self.decoder.process(self.samples[..count].iter().copied());
        let skipped = self.feed.position() - self.decoder.processed();
        self.decoder.take_frames(|frame| {
            let at = (frame.end + skipped as f64) / f64::from(SAMPLE_RATE);
            each(frame.reading(Seconds(at), SAMPLE_RATE));
        });
    }
}
