//! Writes linear timecode, for tests and for the check of an installation. In: a timecode, speed and
//! sample rate. Out: samples. Thread: any. Allocates: in the caller's vector.

use smpte_timecode::{Fields, Timecode};

use super::{BITS, SYNC_WORD};

/// A generator of linear timecode.
#[derive(Clone, Debug)]
pub struct LtcGenerator {
    timecode: Timecode,
    /// Number of samples per bit.
    samples_per_bit: f64,
    is_reverse: bool,
    level: f32,
    is_high: bool,
    /// Position of the end of the last bit, in samples.
    end: f64,
    /// Number of samples that were written.
    written: u64,
}

impl LtcGenerator {
    /// Creates a generator at `rate_hz` samples per second whose first frame is `first`. `speed` is
    /// the speed as a multiple of the usual one, negative in reverse, and not 0. `level` is the
    /// absolute value of the samples.
    pub fn new(first: Timecode, speed: f64, rate_hz: u32, level: f32) -> Self {
        let bits_per_second = first.rate().frames_per_second().to_f64() * speed.abs() * BITS as f64;
        Self {
            timecode: first,
            samples_per_bit: f64::from(rate_hz) / bits_per_second,
            is_reverse: speed < 0.0,
            level,
            is_high: false,
            end: 0.0,
            written: 0,
        }
    }

    /// Returns the next frame that is written.
    pub fn timecode(&self) -> Timecode {
        self.timecode
    }

    /// Appends one frame to `samples`, and moves to the next one.
    pub fn frame(&mut self, samples: &mut Vec<f32>) {
        let bits = frame_bits(self.timecode);
        for n in 0..BITS {
            let number = if self.is_reverse { BITS - 1 - n } else { n };
            self.is_high = !self.is_high;
            let begin = self.end;
            self.end = begin + self.samples_per_bit;
            if bits >> number & 1 == 1 {
                self.write_until(0.5 * (begin + self.end), samples);
                self.is_high = !self.is_high;
            }
            self.write_until(self.end, samples);
        }
        let step = if self.is_reverse { -1 } else { 1 };
        self.timecode = self.timecode.wrapping_add_frames(step);
    }

    /// Writes the present level up to the position `end`. The sample across an edge gets the mean
    /// of both levels, by the parts that they last, so that edges lie between samples.
    fn write_until(&mut self, end: f64, samples: &mut Vec<f32>) {
        let level = if self.is_high {
            self.level
        } else {
            -self.level
        };
        while (self.written + 1) as f64 <= end {
            samples.push(level);
            self.written += 1;
        }
        let rest = (end - self.written as f64) as f32;
        if rest > 0.0 {
            // After the edge, the signal has the opposite level.
            samples.push(level * (2.0 * rest - 1.0));
            self.written += 1;
        }
    }
}

/// Returns the 80 bits of a frame, the first one in the lowest bit.
fn frame_bits(timecode: Timecode) -> u128 {
    let Fields {
        hours,
        minutes,
        seconds,
        frames,
    } = timecode.fields();
    let digits = |value: u8, units: u32, tens: u32| {
        u128::from(value % 10) << units | u128::from(value / 10) << tens
    };
    digits(frames, 0, 8)
        | u128::from(timecode.rate().is_drop_frame()) << 10
        | digits(seconds, 16, 24)
        | digits(minutes, 32, 40)
        | digits(hours, 48, 56)
        | u128::from(SYNC_WORD) << 64
}
