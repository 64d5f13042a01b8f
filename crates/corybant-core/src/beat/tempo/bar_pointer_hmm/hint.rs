//! A tempo hint: the tempo that the music probably has. In: a beat period. Out: probabilities of the
//! tempi, and factors for music that plays. Thread: show. Allocates: never.

use super::BarPointerHmm;
use crate::maths;

/// Standard deviation, around a tempo hint, of the natural logarithm of the beat period.
const HINT_PERIOD: f32 = 0.03;
/// Natural logarithm of the factor by which a tempo hint makes a tempo far from it less probable,
/// once per beat. Music with another tempo contradicts more strongly.
const HINT_WORTH: f32 = 0.7;

impl BarPointerHmm {
    /// Sets the tempo hint, a beat period in hops that makes tempi near it more probable wherever the
    /// prior is used. `None` removes the hint. A hint that is not near an allowed period has no
    /// effect.
    pub fn set_hint(&mut self, period: Option<f64>) {
        self.hint.copy_from_slice(&self.prior);
        self.end_hint_gain();
        let Some(period) = period else { return };
        let tempo = |hops: usize| {
            let off = maths::ln(hops as f32 / period as f32) / HINT_PERIOD;
            maths::exp(-0.5 * off * off)
        };
        let sum: f32 = self.rings.iter().map(|ring| tempo(ring.hops)).sum();
        if sum > f32::MIN_POSITIVE {
            let hints = self.hint.iter_mut().zip(&mut self.hint_gain);
            for ((hint, gain), ring) in hints.zip(&self.rings) {
                *hint = tempo(ring.hops) / sum;
                *gain = maths::exp(HINT_WORTH * (tempo(ring.hops) - 1.0));
            }
        }
    }

    /// Ends the effect of the tempo hint on music that plays. It still counts where the prior is
    /// used.
    pub fn end_hint_gain(&mut self) {
        self.hint_gain.fill(1.0);
    }
}
