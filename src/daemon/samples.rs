//! The music samples of a show. In: an audio device or a decoded file. Out: mono samples, and the
//! timecode on a channel of a device. Thread: show. Allocates: never after it was opened.

use crate::audio::feed::{FileFeed, PlayedFeed};
use crate::audio::input::{AudioIn, InputControl};
use corybant_core::show::Show;
use corybant_core::time::Seconds;
use corybant_core::timecode::Reading;

/// The source of the music samples of a show.
pub enum Samples {
    /// An audio input device, whose sound is captured live.
    Device(Box<AudioIn>),
    /// A decoded music file that is not played aloud. Its samples are delivered at the pace of the
    /// show time.
    File(FileFeed),
    /// A decoded music file that the daemon also plays on the default audio output. Its samples are
    /// delivered at the pace of the playback.
    Played(PlayedFeed),
}

impl Samples {
    /// Returns a handle that replaces the input device; `None` if the samples come from a file.
    pub(super) fn control(&self) -> Option<InputControl> {
        match self {
            Self::Device(device) => Some(device.control()),
            Self::File(_) | Self::Played(_) => None,
        }
    }

    /// Copies the samples that are due at the show time `now` into `buffer` and returns the number
    /// of samples. For an input device, also sets the input latency of `show`.
    pub(super) fn read(&mut self, show: &mut Show, now: Seconds, buffer: &mut [f32]) -> usize {
        match self {
            Self::Device(device) => {
                let count = device.read(buffer);
                show.set_input_latency(device.latency());
                count
            }
            Self::File(file) => file.read_until(now, buffer),
            Self::Played(played) => played.read_until(now, buffer),
        }
    }

    /// Calls `each` for each frame of timecode in the samples that the last call of
    /// [`Samples::read`] has read from a device. `now` is the show time.
    pub(super) fn read_timecode(&mut self, now: Seconds, each: &mut dyn FnMut(Reading)) {
        match self {
            Self::Device(device) => device.read_timecode(now, each),
            Self::File(_) | Self::Played(_) => {}
        }
    }
}
