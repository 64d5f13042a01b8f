//! Fades: values that change in a number of beats. In: beats. Out: values. Thread: show. Allocates:
//! never.

/// A value on its way to a new value, along a straight line over the beats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fade {
    /// The value at the start of the fade.
    from: f64,
    /// Length of the fade in beats, at least 0.
    beats: f64,
    /// Number of beats since the start of the fade.
    passed: f64,
}

impl Fade {
    /// Creates a fade of `beats` beats that begins at the value `from`.
    pub(super) fn new(from: f64, beats: f64) -> Self {
        Self {
            from,
            beats: beats.max(0.0),
            passed: 0.0,
        }
    }

    /// Advances the fade by `beats` beats. Beats below 0 count as 0, because beats may get new
    /// numbers.
    pub(super) fn advance(&mut self, beats: f64) {
        self.passed += beats.max(0.0);
    }

    /// Returns true if the value has reached its end.
    pub(super) fn is_over(&self) -> bool {
        self.passed >= self.beats
    }

    /// Returns the value now; `to` is the value at the end of the fade.
    pub(super) fn value(&self, to: f64) -> f64 {
        if self.is_over() {
            return to;
        }
        self.from + (to - self.from) * (self.passed / self.beats)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fade_moves_along_a_line_and_ends() {
        let mut fade = Fade::new(1.0, 4.0);
        let mut values = Vec::new();
        for _ in 0..6 {
            values.push(fade.value(3.0));
            fade.advance(1.0);
        }
        assert_eq!(values, [1.0, 1.5, 2.0, 2.5, 3.0, 3.0]);
        assert!(Fade::new(1.0, 0.0).is_over());
        assert_eq!(Fade::new(1.0, 0.0).value(2.0), 2.0);
        let mut back = Fade::new(0.0, 2.0);
        back.advance(-100.0);
        assert_eq!(back.value(1.0), 0.0);
    }
}
