//! Linear timecode (LTC): a sound that carries timecode, 80 bits a frame. In: samples of one channel
//! at any rate. Out: frames, each with the sample at which it ends. Thread: show. Allocates: never.
//!
//! A bit lasts one period; a 1 also changes the sign in the middle of its period (biphase mark). The
//! last 16 bits of a frame are the sync word, which tells the direction in which the source runs.
//! The polarity does not matter. Source: SMPTE ST 12-1.
//!
//! | module | contents |
//! |---|---|
//! | `edges` | samples → times at which the signal crosses its middle |
//! | `bits` | times of crossings → bits |
//! | `arrival` | the show times of samples |
//! | `generator` | timecode → samples |

pub mod arrival;
mod bits;
mod edges;
pub mod generator;

use smpte_timecode::Fields;

use super::{Place, Reading};
use crate::time::Seconds;
use bits::BitClock;
use edges::EdgeDetector;

/// Number of bits of a frame.
pub const BITS: usize = 80;
/// The bits 64 to 79 of a frame, the first of them in the lowest bit.
const SYNC_WORD: u16 = 0xbffc;
/// Mask of the bits of one frame.
const FRAME_MASK: u128 = (1 << BITS) - 1;
/// Number of frames that a decoder keeps until they are read. A show reads them 120 times a second.
const FRAMES_MAX: usize = 64;
/// Typical error of the time at which a frame ends.
const JITTER: Seconds = Seconds(0.0005);

/// A decoded frame of linear timecode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LtcFrame {
    /// Hours, minutes, seconds and frame; not checked against a frame rate.
    pub fields: Fields,
    /// True if the frame has the flag of drop frame.
    pub drops: bool,
    /// True if the source runs in reverse: the frame ended with its first bit.
    pub is_reverse: bool,
    /// Position of the end of the frame, in samples since the decoder was created.
    pub end: f64,
    /// Duration of the frame, in samples.
    pub length: f64,
}

impl LtcFrame {
    /// Returns the reading of this frame, which ended at the time `at`. The samples have the rate
    /// `rate_hz`.
    pub fn reading(&self, at: Seconds, rate_hz: u32) -> Reading {
        Reading {
            at,
            place: Place::Frame {
                fields: self.fields,
                rate: None,
                drops: self.drops,
                after_frames: if self.is_reverse { 0.0 } else { 1.0 },
            },
            frame: Some(Seconds(self.length / f64::from(rate_hz))),
            jitter: JITTER,
            is_locate: false,
        }
    }
}

/// A decoder of linear timecode from half to twice its usual speed, in both directions.
#[derive(Clone, Debug)]
pub struct LtcDecoder {
    edges: EdgeDetector,
    bits: BitClock,
    /// The last 80 bits, the newest in the highest bit.
    forward: u128,
    /// The last 80 bits, the newest in the lowest bit.
    reverse: u128,
    /// Positions of the ends of the last bits, by their number.
    ends: [f64; BITS + 1],
    /// Number of bits since the signal was found.
    bit_count: usize,
    frames: arrayvec::ArrayVec<LtcFrame, FRAMES_MAX>,
}

impl LtcDecoder {
    /// Creates a decoder of samples at `rate_hz` samples per second.
    pub fn new(rate_hz: u32) -> Self {
        Self {
            edges: EdgeDetector::new(rate_hz),
            bits: BitClock::new(rate_hz),
            forward: 0,
            reverse: 0,
            ends: [0.0; BITS + 1],
            bit_count: 0,
            frames: arrayvec::ArrayVec::new(),
        }
    }

    /// Processes samples. If more than 64 frames wait, the oldest are dropped.
    pub fn process(&mut self, samples: impl Iterator<Item = f32>) {
        for sample in samples {
            if let Some(edge) = self.edges.process(sample) {
                match self.bits.process(edge) {
                    bits::Found::Nothing => {}
                    bits::Found::Lost => self.bit_count = 0,
                    bits::Found::Bit(bit) => self.process_bit(bit, edge),
                }
            }
        }
    }

    /// Returns the number of samples that were processed so far.
    pub fn processed(&self) -> u64 {
        self.edges.processed()
    }

    /// Removes all frames that were decoded since the last call, and calls `each` for each of them.
    pub fn take_frames(&mut self, each: impl FnMut(LtcFrame)) {
        self.frames.drain(..).for_each(each);
    }

    /// Adds the bit that ended at the position `end`.
    fn process_bit(&mut self, bit: bool, end: f64) {
        let bit = u128::from(bit);
        self.forward = self.forward >> 1 | bit << (BITS - 1);
        self.reverse = (self.reverse << 1 | bit) & FRAME_MASK;
        self.bit_count += 1;
        self.ends[self.bit_count % (BITS + 1)] = end;
        if self.bit_count <= BITS {
            return;
        }
        let found = |bits: u128| (bits >> 64) as u16 == SYNC_WORD;
        let (data, is_reverse) = if found(self.forward) {
            (self.forward as u64, false)
        } else if found(self.reverse) {
            (self.reverse as u64, true)
        } else {
            return;
        };
        let Some((fields, drops)) = read_fields(data) else {
            return;
        };
        if self.frames.is_full() {
            self.frames.remove(0);
        }
        // The position after the current one in the ring is the oldest: 80 bits before.
        let length = end - self.ends[(self.bit_count + 1) % (BITS + 1)];
        self.frames.push(LtcFrame {
            fields,
            drops,
            is_reverse,
            end,
            length,
        });
    }
}

/// Returns the label in the first 64 bits of a frame, and its flag of drop frame; `None` if a digit
/// is out of range.
fn read_fields(data: u64) -> Option<(Fields, bool)> {
    let digits = |units: u32, tens: u32, tens_bits: u32, below: u8| {
        let unit = (data >> units & 0xf) as u8;
        let ten = (data >> tens & ((1 << tens_bits) - 1)) as u8;
        let value = 10 * ten + unit;
        (unit < 10 && value < below).then_some(value)
    };
    let fields = Fields {
        frames: digits(0, 8, 2, 30)?,
        seconds: digits(16, 24, 3, 60)?,
        minutes: digits(32, 40, 3, 60)?,
        hours: digits(48, 56, 2, 24)?,
    };
    Some((fields, data >> 10 & 1 == 1))
}

#[cfg(test)]
mod tests;
