//! Measures the input for a sound check: peak, clipping and mains hum.
//!
//! In: hops of samples. Out: peak, clipping flag, hum frequency.
//! Thread: show.
//! Allocates: never.

use super::hum::HumDetector;
use super::{HOP, SAMPLE_RATE};
use crate::maths;

/// Rate at which the reported peak (greatest recent absolute sample) falls, in dB per second.
const PEAK_FALL_DB_PER_S: f32 = 12.0;
/// Absolute value from which on a sample counts as being at full scale. Full scale is 1.
pub const FULL_SCALE: f32 = 0.9995;
/// Least number of consecutive samples at full scale that counts as clipping. A loud recording can
/// have shorter runs of such samples without clipping.
pub const CLIPPED_RUN: u32 = 3;
/// Number of hops after the last clipped sample for which clipping is reported (2 s).
const CLIPPED_HOPS: u32 = 2 * SAMPLE_RATE / HOP as u32;
/// The mains frequencies whose hum is detected, in hertz.
const MAINS_HZ: [f64; 2] = [50.0, 60.0];
/// Least number of consecutive seconds with mains hum before the hum is reported.
const HUM_S: u32 = 3;

/// The result of a sound check: peak, clipping and mains hum of the recent input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SoundCheck {
    /// Peak of the recent input: the greatest absolute value of a sample, where full scale is 1.
    /// The peak falls by 12 dB per second.
    pub peak: f32,
    /// True if the input clipped in the last 2 s.
    pub clipped: bool,
    /// Mains frequency of the hum in the input, 50 or 60 Hz; 0 if there is no hum.
    pub hum_hz: u8,
}

/// Checks the input hop by hop for peak, clipping and mains hum.
pub(crate) struct SoundChecker {
    found: SoundCheck,
    /// Number of consecutive samples at full scale, up to and including the last sample; 0 if the
    /// last sample was below full scale.
    run: u32,
    /// Number of coming hops for which clipping is still reported; 0 if no clipping is reported.
    clipped_hops: u32,
    /// Hum detectors, one for each mains frequency in [`MAINS_HZ`].
    hums: [HumDetector; MAINS_HZ.len()],
}

impl SoundChecker {
    /// Creates a checker for a new input: no peak, no clipping, no hum.
    pub(crate) fn new() -> Self {
        Self {
            found: SoundCheck::default(),
            run: 0,
            clipped_hops: 0,
            hums: MAINS_HZ.map(HumDetector::new),
        }
    }

    /// Checks one hop of `samples`, which must be finite.
    pub(crate) fn hop(&mut self, samples: &[f32; HOP]) {
        self.clipped_hops = self.clipped_hops.saturating_sub(1);
        let fall_db = -PEAK_FALL_DB_PER_S / 20.0 * HOP as f32 / SAMPLE_RATE as f32;
        let mut peak = self.found.peak * maths::powf(10_f32, fall_db);
        for &sample in samples {
            peak = peak.max(sample.abs());
            self.run = if sample.abs() >= FULL_SCALE {
                self.run + 1
            } else {
                0
            };
            if self.run >= CLIPPED_RUN {
                self.clipped_hops = CLIPPED_HOPS;
            }
        }
        self.hums.iter_mut().for_each(|hum| hum.hop(samples));
        let humming = self
            .hums
            .iter()
            .zip(MAINS_HZ)
            .find(|(hum, _)| hum.seconds() >= HUM_S);
        self.found = SoundCheck {
            peak,
            clipped: self.clipped_hops > 0,
            hum_hz: humming.map_or(0, |(_, hz)| hz as u8),
        };
    }

    /// Returns the result of the sound check up to the last hop: peak, clipping and mains hum.
    pub(crate) fn found(&self) -> SoundCheck {
        self.found
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// Returns the sound check of `seconds` seconds of sound; sample number i is `at(i)`.
    fn check(seconds: usize, at: impl Fn(usize) -> f32) -> SoundCheck {
        let mut checker = SoundChecker::new();
        for hop in 0..seconds * SAMPLE_RATE as usize / HOP {
            checker.hop(&std::array::from_fn(|i| at(hop * HOP + i)));
        }
        checker.found()
    }

    fn tone(hz: f64, level: f32) -> impl Fn(usize) -> f32 {
        move |i| level * maths::sin(TAU * hz * i as f64 / f64::from(SAMPLE_RATE)) as f32
    }

    #[test]
    fn hum_is_found_with_its_mains_frequency() {
        let noise = |i: usize| {
            0.05 * ((i as u32)
                .wrapping_mul(2_654_435_761)
                .rotate_left(13)
                .wrapping_mul(0x9e37_79b9) as f32
                / maths::powi(2_f32, 31)
                - 1.0)
        };
        assert_eq!(check(6, tone(50.0, 0.01)).hum_hz, 50);
        assert_eq!(check(6, tone(60.0, 0.01)).hum_hz, 60);
        // A rectifier hums at twice the mains frequency.
        assert_eq!(check(6, tone(120.0, 0.01)).hum_hz, 60);
        assert_eq!(
            check(6, |i| tone(49.95, 0.05)(i) + noise(i)).hum_hz,
            50,
            "mains frequencies drift"
        );
        assert_eq!(check(6, noise).hum_hz, 0);
        assert_eq!(
            check(6, tone(50.0, 0.0005)).hum_hz,
            0,
            "hum below the threshold is not reported"
        );
        assert_eq!(
            check(6, tone(55.0, 0.5)).hum_hz,
            0,
            "a bass note of 55 Hz is not hum"
        );
    }

    #[test]
    fn bass_notes_are_no_hum() {
        // G1, 49 Hz, one note every 0.5 s.
        let bass = |i: usize| {
            let since = i % (SAMPLE_RATE as usize / 2);
            0.5 * maths::exp(-3.0 * since as f64 / f64::from(SAMPLE_RATE)) as f32
                * tone(49.0, 1.0)(since)
        };
        assert_eq!(check(8, bass).hum_hz, 0);
    }

    #[test]
    fn clipping_is_reported_and_single_peaks_are_not() {
        assert!(check(1, |i| (3.0 * tone(100.0, 1.0)(i)).clamp(-1.0, 1.0)).clipped);
        assert!(!check(1, |i| if i % 1000 == 0 { 1.0 } else { 0.1 }).clipped);
        assert!(!check(1, tone(100.0, 0.99)).clipped);
        let early = |i: usize| if i < 2000 { 1.0 } else { 0.1 };
        assert!(
            check(1, early).clipped && !check(4, early).clipped,
            "clipping is reported for two seconds"
        );
    }

    #[test]
    fn peak_is_held_and_falls() {
        let click = |i: usize| if i == 100 { 0.8 } else { 0.0 };
        let after = check(1, click).peak;
        assert!((0.15..0.25).contains(&after), "{after}");
        assert!(check(5, click).peak < 0.001);
    }
}
