//! The show time of samples that arrive in blocks. In: times at which samples have arrived. Out: the
//! show time of any sample. Thread: show. Allocates: never.
//!
//! A block delays its samples by different times, and the show reads them at its ticks. The shortest
//! delay of the last second is nearly the same at all times, so it is used: an average would move
//! with every block.

use crate::time::Seconds;

/// Time after which the older half of the measured delays is forgotten, in seconds. It is long
/// against a block and short against the drift of a sound card.
const HALF_S: f64 = 0.5;

/// Converts times of samples, counted in samples, to show times.
#[derive(Clone, Copy, Debug)]
pub struct SampleArrival {
    /// Least difference of show time and sample time in the present and in the previous half second.
    least: [f64; 2],
    /// Show time at which the present half second began.
    began: f64,
}

impl Default for SampleArrival {
    fn default() -> Self {
        Self {
            least: [f64::INFINITY; 2],
            began: f64::NEG_INFINITY,
        }
    }
}

impl SampleArrival {
    /// Measures that all samples up to the sample time `sample` have arrived at the show time `now`.
    pub fn observe(&mut self, now: Seconds, sample: Seconds) {
        if now.0 - self.began > HALF_S {
            self.least = [f64::INFINITY, self.least[0]];
            self.began = now.0;
        }
        self.least[0] = self.least[0].min(now.0 - sample.0);
    }

    /// Returns the show time of the sample time `sample`. Before the first measurement, the time is
    /// infinite.
    pub fn show_time(&self, sample: Seconds) -> Seconds {
        sample + Seconds(self.least[0].min(self.least[1]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_and_a_drifting_card_do_not_move_the_times() {
        for (block, drift) in [(256.0, 1.0), (1_024.0, 1.0001), (2_048.0, 0.9999)] {
            let mut arrival = SampleArrival::default();
            let rate = 48_000.0 * drift;
            let mut errors = Vec::new();
            for tick in 0..1_200 {
                let now = f64::from(tick) / 120.0;
                let arrived = (now * rate / block).floor() * block;
                arrival.observe(Seconds(now), Seconds(arrived / 48_000.0));
                if tick > 60 {
                    let sample = Seconds(now * drift);
                    errors.push(arrival.show_time(sample).0 - now);
                }
            }
            let worst = errors
                .iter()
                .fold(0.0f64, |worst, error| worst.max(error.abs()));
            assert!(worst < 0.004, "blocks of {block}: {worst} s");
        }
    }
}
