//! The edges of a square-like signal: the times at which it crosses its middle. In: samples. Out:
//! positions in samples, with fractions. Thread: show. Allocates: never.

/// Time in which the tracked highest and lowest sample approach the middle by a factor of e, in
/// seconds. It is long against a bit (0.4 to 0.6 ms) and short against a change of the level.
const DECAY_S: f32 = 0.02;
/// Distance of a crossing from the middle, as a part of the distance of highest and lowest sample.
/// Noise below it causes no edge.
const HYSTERESIS: f32 = 0.12;
/// Least distance of highest and lowest sample; a weaker signal has no edges (-60 dBFS).
const RANGE_MIN: f32 = 0.002;

/// Finds the edges of a signal of any level, polarity and offset.
#[derive(Clone, Debug)]
pub(super) struct EdgeDetector {
    /// Part of the distance to the middle that highest and lowest sample keep with each sample.
    keep: f32,
    highest: f32,
    lowest: f32,
    is_high: bool,
    last: f32,
    count: u64,
}

impl EdgeDetector {
    pub(super) fn new(rate_hz: u32) -> Self {
        Self {
            keep: 1.0 - 1.0 / (DECAY_S * rate_hz.max(1) as f32),
            highest: 0.0,
            lowest: 0.0,
            is_high: false,
            last: 0.0,
            count: 0,
        }
    }

    /// Returns the number of processed samples.
    pub(super) fn processed(&self) -> u64 {
        self.count
    }

    /// Processes a sample; one that is not finite counts as 0. Returns the position of the edge
    /// between the previous sample and this one, if there is one.
    pub(super) fn process(&mut self, sample: f32) -> Option<f64> {
        let sample = if sample.is_finite() { sample } else { 0.0 };
        let middle = 0.5 * (self.highest + self.lowest);
        self.highest = sample.max(middle + (self.highest - middle) * self.keep);
        self.lowest = sample.min(middle + (self.lowest - middle) * self.keep);
        let range = self.highest - self.lowest;
        let middle = 0.5 * (self.highest + self.lowest);
        let before = std::mem::replace(&mut self.last, sample);
        self.count += 1;
        if range < RANGE_MIN {
            return None;
        }
        let sign = if self.is_high { -1.0 } else { 1.0 };
        let level = middle + sign * HYSTERESIS * range;
        if sign * (sample - level) <= 0.0 {
            return None;
        }
        self.is_high = !self.is_high;
        let step = sample - before;
        let part = if step == 0.0 {
            1.0
        } else {
            ((level - before) / step).clamp(0.0, 1.0)
        };
        Some((self.count - 1) as f64 - 1.0 + f64::from(part))
    }
}
