//! MIDI timecode (MTC): quarter frames and full frames. In: MIDI messages with their times. Out:
//! places in timecode. Thread: MIDI. Allocates: never.
//!
//! The crate `smpte-timecode` assembles the messages; this file adds the time at which the timecode
//! was at the place.

use std::time::Duration;

use smpte_timecode::{Motion, MtcDecoder, MtcError};

use super::{Place, Rate, Reading};
use crate::time::Seconds;

/// Number of frames from the place that the decoder reports for the last of eight quarter frames to
/// the place at which that message is sent. The decoder reports where the next group begins, a
/// quarter of a frame later.
const LAST_QUARTER: f64 = -0.25;
/// Typical error of the arrival times of MIDI messages.
const JITTER: Seconds = Seconds(0.002);

/// Assembles the messages of MIDI timecode.
#[derive(Clone, Debug, Default)]
pub struct MtcReceiver {
    decoder: MtcDecoder,
}

impl MtcReceiver {
    /// Creates a receiver. A fixed `rate` tells apart the rates that MTC sends alike, such as 29.97
    /// and 30.
    pub fn new(rate: Rate) -> Self {
        let mut decoder = MtcDecoder::new();
        decoder.set_rate_hint(rate.fixed());
        Self { decoder }
    }

    /// Processes the MIDI message `bytes`, which arrived at the show time `at`. Returns a reading
    /// with the last of eight quarter frames, and with each full frame.
    ///
    /// # Errors
    /// [`MtcError`] if a message of timecode is malformed or names a frame that does not exist.
    pub fn receive(&mut self, bytes: &[u8], at: Seconds) -> Result<Option<Reading>, MtcError> {
        // Times before the start of the show count as 0; no cycle spans them.
        let since = Duration::try_from_secs_f64(at.0).unwrap_or_default();
        let Some(event) = self.decoder.feed(bytes, since)? else {
            return Ok(None);
        };
        let after_frames = match event.motion {
            Motion::Forward => LAST_QUARTER,
            Motion::Reverse | Motion::Located => 0.0,
        };
        let rate = event.timecode.rate();
        Ok(Some(Reading {
            at,
            place: Place::Frame {
                fields: event.timecode.fields(),
                rate: Some(rate),
                drops: rate.is_drop_frame(),
                after_frames,
            },
            frame: None,
            jitter: JITTER,
            is_locate: event.motion == Motion::Located,
        }))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use smpte_timecode::{Direction, FrameRate, MtcEncoder, Timecode};

    use super::*;

    #[test]
    fn the_last_quarter_frame_gives_the_place_at_its_own_time() {
        let start = Timecode::parse("01:00:00:00", FrameRate::FPS_25).unwrap();
        let mut receiver = MtcReceiver::new(Rate::Auto);
        let messages = MtcEncoder::new(start, Direction::Forward).unwrap().take(8);
        let readings: Vec<Reading> = messages
            .enumerate()
            .filter_map(|(n, bytes)| receiver.receive(&bytes, Seconds(n as f64 * 0.01)).unwrap())
            .collect();
        let [
            Reading {
                at,
                place:
                    Place::Frame {
                        fields,
                        after_frames,
                        ..
                    },
                ..
            },
        ] = readings[..]
        else {
            panic!("{readings:?}");
        };
        // The message 7 comes 1.75 frames after the frame 0.
        assert_eq!((at.0, fields.frames, after_frames), (0.07, 2, -0.25));
    }

    proptest! {
        #[test]
        fn any_messages_are_read_or_refused(
            messages in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..12), 0..64),
            is_timecode: bool,
        ) {
            let mut receiver = MtcReceiver::default();
            for (n, message) in messages.iter().enumerate() {
                let message = match is_timecode {
                    true => [&[0xf0, 0x7f, 0x7f, 1, 1][..], message, &[0xf7]].concat(),
                    false => [&[0xf1][..], message].concat(),
                };
                for at in [n as f64 * 0.01, -1.0, f64::NAN] {
                    let _ = receiver.receive(&message, Seconds(at));
                }
            }
        }
    }
}
