//! A straight line through the last readings: position in timecode over time. In: times and
//! positions. Out: the position at any time. Thread: show. Allocates: never.

/// The greatest number of readings of a line.
const READINGS_MAX: usize = 32;
/// Longest time over which a line is fitted, in seconds.
const SPAN_S_MAX: f64 = 1.0;
/// Number of latest readings that must lie on the same side of the line before the line forgets its
/// older half, because the speed has changed.
const DRIFT_READINGS: usize = 3;
/// Least number of readings of a line.
const READINGS_MIN: usize = 4;

/// Greatest absolute speed, in seconds of timecode per second.
pub(super) const SPEED_MAX: f64 = 8.0;

/// A line through readings, by least squares.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    /// Times and positions of the readings, in seconds, the oldest first.
    readings: [(f64, f64); READINGS_MAX],
    len: usize,
    /// A point of the line: time and position, in seconds.
    origin: (f64, f64),
    /// Seconds of timecode per second.
    speed: f64,
}

impl Fit {
    /// Creates a line through one reading, with the speed `speed`.
    pub(super) fn new(time: f64, position: f64, speed: f64) -> Self {
        Self {
            readings: [(time, position); READINGS_MAX],
            len: 1,
            origin: (time, position),
            speed,
        }
    }

    /// Returns the position at `time`, in seconds.
    pub(super) fn position(&self, time: f64) -> f64 {
        self.origin.1 + self.speed * (time - self.origin.0)
    }

    /// Returns the speed, in seconds of timecode per second.
    pub(super) fn speed(&self) -> f64 {
        self.speed
    }

    /// Returns the number of readings.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// Returns the time of the last reading.
    pub(super) fn last_time(&self) -> f64 {
        self.readings[self.len - 1].0
    }

    /// Returns the mean time between two readings; 0 with one reading.
    pub(super) fn interval(&self) -> f64 {
        (self.last_time() - self.readings[0].0) / (self.len.max(2) - 1) as f64
    }

    /// Adds a reading, which must be later than the last one. `jitter` is the typical error of its
    /// time, in seconds.
    pub(super) fn add(&mut self, time: f64, position: f64, jitter: f64) {
        let old = self.readings[..self.len]
            .iter()
            .filter(|(at, _)| time - at > SPAN_S_MAX)
            .count();
        self.forget(old.max((self.len + 1).saturating_sub(READINGS_MAX)));
        self.readings[self.len] = (time, position);
        self.len += 1;
        self.fit();
        while self.len > READINGS_MIN && self.drifts(jitter) {
            self.forget(self.len.div_ceil(2).min(self.len - READINGS_MIN));
            self.fit();
        }
    }

    /// Removes the oldest `count` readings.
    fn forget(&mut self, count: usize) {
        self.readings.copy_within(count..self.len, 0);
        self.len -= count;
    }

    /// Returns true if the latest readings all lie on the same side of the line and farther from it
    /// than their errors explain.
    fn drifts(&self, jitter: f64) -> bool {
        let latest = &self.readings[self.len - DRIFT_READINGS.min(self.len)..self.len];
        let error = |&(time, position): &(f64, f64)| position - self.position(time);
        let limit = 2.0 * jitter;
        latest.iter().all(|reading| error(reading) > limit)
            || latest.iter().all(|reading| error(reading) < -limit)
    }

    fn fit(&mut self) {
        let readings = &self.readings[..self.len];
        let count = self.len as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| readings.iter().map(of).sum::<f64>() / count;
        let (time, position) = (mean(|reading| reading.0), mean(|reading| reading.1));
        let (mut product, mut square) = (0.0, 0.0);
        for (at, place) in readings {
            product += (at - time) * (place - position);
            square += (at - time) * (at - time);
        }
        self.origin = (time, position);
        if square > 0.0 {
            // Readings in a burst say nothing about the speed.
            self.speed = (product / square).clamp(-SPEED_MAX, SPEED_MAX);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_follows_a_change_of_speed_within_six_readings() {
        let mut fit = Fit::new(0.0, 100.0, 1.0);
        let mut position = 100.0;
        for n in 1..80 {
            let speed = if n < 40 { 1.0 } else { 1.1 };
            position += speed * 0.04;
            let time = f64::from(n) * 0.04;
            fit.add(time, position, 0.0005);
            let error = (fit.position(time + 0.02) - position - speed * 0.02).abs();
            if !(40..46).contains(&n) {
                assert!(error < 0.003, "{error} s after reading {n}");
            }
        }
        assert!((fit.speed() - 1.1).abs() < 0.002, "{}", fit.speed());
    }
}
