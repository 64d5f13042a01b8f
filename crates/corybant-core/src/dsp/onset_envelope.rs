//! Onsets in a level: how far the level rises above an envelope that falls slowly.
//!
//! In: the level of each chunk of 10 ms, in dB. Out: the onset strength of each chunk, 0..1.
//! Thread: show. Allocates: never.

use crate::maths;

/// Lower limit of levels, in dBFS; lower levels are raised to this value.
const FLOOR_DB: f64 = -100.0;
/// Rate at which the envelope falls, in dB per chunk of 10 ms. The envelope rises with the level at
/// once.
const RELEASE_DB: f64 = 1.2;
/// Height of the level above the envelope, in dB, above which there is an onset.
const RISE_DB_MIN: f64 = 2.5;
/// Least rise, in dB, at which the onset strength is 1, its greatest value. The rise is the height
/// of the level above the slowly falling envelope. A smaller rise gives a proportionally smaller
/// onset strength, and a rise up to [`RISE_DB_MIN`] gives 0.
const RISE_DB: f64 = 10.0;

/// The envelope of a level in dB. It rises with the level at once and falls by [`RELEASE_DB`] per
/// chunk of 10 ms.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnsetEnvelope {
    db: f64,
}

impl Default for OnsetEnvelope {
    fn default() -> Self {
        Self { db: FLOOR_DB }
    }
}

impl OnsetEnvelope {
    /// Updates the envelope with the level `level_db` of the next chunk of 10 ms, and returns the
    /// onset strength of this chunk, 0..1.
    pub(crate) fn rise(&mut self, level_db: f64) -> f64 {
        let rise_db = level_db - (self.db - RELEASE_DB);
        self.db = level_db.max(self.db - RELEASE_DB);
        if rise_db > RISE_DB_MIN {
            (rise_db / RISE_DB).min(1.0)
        } else {
            0.0
        }
    }
}

/// Converts a mean square (full scale is 1) to decibels, at least [`FLOOR_DB`].
pub(crate) fn db(power: f64) -> f64 {
    (10.0 * maths::log10(power)).max(FLOOR_DB)
}
