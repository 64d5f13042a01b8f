//! The bits of a biphase mark signal. In: times of edges. Out: bits. Thread: show. Allocates: never.
//!
//! A period without an edge in its middle is a 0, one with an edge is a 1. The period is found from
//! the distances of edges, all of which are one period or half of it, and then followed.

/// Number of distances between edges from which the period is found. Each sync word has 24 half
/// periods in a row and, beside them, whole ones.
const SEARCHED: usize = 40;
/// Slowest and fastest stream in which a period is found, in bits per second: 24 frames of 80 bits
/// at half speed, 30 frames at twice the speed.
const BITS_PER_SECOND: (f64, f64) = (960.0, 4_800.0);
/// Part of the difference between a measured and the followed period by which the latter changes.
const FOLLOW: f64 = 0.08;
/// Limits of the distance of two edges, in periods: shorter is noise, up to the second half a
/// period, up to the third a period, and longer is a gap.
const LIMITS: (f64, f64, f64) = (0.2, 0.75, 1.5);

/// What an edge means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// Nothing yet.
    Nothing,
    /// The end of a bit.
    Bit(bool),
    /// The signal is damaged: the bits before do not belong to those after.
    Lost,
}

/// Finds and follows the period of the bits.
#[derive(Clone, Debug)]
pub(super) struct BitClock {
    /// Shortest and longest period that is possible, in samples.
    periods: (f64, f64),
    /// The followed period, in samples; `None` while it is searched.
    period: Option<f64>,
    last_edge: f64,
    /// Distances of the last edges, while the period is searched.
    distances: [f64; SEARCHED],
    distance_count: usize,
    /// Position of the edge at the beginning of a bit whose middle edge has passed.
    half: Option<f64>,
    /// True once a whole period has shown which edges lie between bits.
    is_aligned: bool,
}

impl BitClock {
    pub(super) fn new(rate_hz: u32) -> Self {
        let rate_hz = f64::from(rate_hz);
        Self {
            periods: (rate_hz / BITS_PER_SECOND.1, rate_hz / BITS_PER_SECOND.0),
            period: None,
            last_edge: 0.0,
            distances: [0.0; SEARCHED],
            distance_count: 0,
            half: None,
            is_aligned: false,
        }
    }

    /// Processes the edge at the position `edge`, in samples.
    pub(super) fn process(&mut self, edge: f64) -> Found {
        let start = std::mem::replace(&mut self.last_edge, edge);
        let distance = edge - start;
        let Some(period) = self.period else {
            self.search(distance);
            return Found::Nothing;
        };
        let periods = distance / period;
        if periods > LIMITS.2 {
            self.period = None;
            self.distance_count = 0;
            return self.lose();
        }
        if periods < LIMITS.0 {
            return self.lose();
        }
        let is_half = periods < LIMITS.1;
        match (self.half.take(), is_half) {
            (None, true) if self.is_aligned => {
                self.half = Some(start);
                Found::Nothing
            }
            (None, true) => Found::Nothing,
            (Some(begin), true) => {
                self.follow(period, edge - begin);
                Found::Bit(true)
            }
            (None, false) => {
                let was_aligned = std::mem::replace(&mut self.is_aligned, true);
                self.follow(period, distance);
                if was_aligned {
                    Found::Bit(false)
                } else {
                    Found::Lost
                }
            }
            // A whole period follows half a bit: an edge is missing or one is too many.
            (Some(_), false) => {
                let lost = self.lose();
                self.is_aligned = true;
                lost
            }
        }
    }

    fn lose(&mut self) -> Found {
        self.half = None;
        self.is_aligned = false;
        Found::Lost
    }

    fn follow(&mut self, period: f64, measured: f64) {
        let next = period + FOLLOW * (measured - period);
        self.period = (self.periods.0..=self.periods.1)
            .contains(&next)
            .then_some(next);
        if self.period.is_none() {
            self.distance_count = 0;
        }
    }

    /// Adds a distance of two edges; sets the period if the last distances agree on one.
    fn search(&mut self, distance: f64) {
        self.distances[self.distance_count % SEARCHED] = distance;
        self.distance_count += 1;
        if self.distance_count < SEARCHED {
            return;
        }
        let longest = self.distances.iter().fold(0.0, |a: f64, &b| a.max(b));
        let (mut sum, mut count, mut is_clear) = (0.0, 0, true);
        for &distance in &self.distances {
            let part = distance / longest;
            if part > 0.78 {
                sum += distance;
                count += 1;
            }
            is_clear &= part > 0.78 || (0.35..0.68).contains(&part);
        }
        let period = sum / f64::from(count.max(1));
        // Only halves or only whole periods would be taken for the other.
        let has_both = (1..SEARCHED as i32).contains(&count);
        if is_clear && has_both && (self.periods.0..=self.periods.1).contains(&period) {
            self.period = Some(period);
            self.half = None;
            self.is_aligned = false;
        }
    }
}
