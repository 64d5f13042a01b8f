//! Computes the brightness of light that pulses with the music.
//!
//! In: the beats of a song.
//! Out: the brightness of the pulse at a time.
//! Thread: any.
//! Allocates: never.

use corybant_core::beat::offline::Beat;

/// Time in which the brightness of the light decays to 1/e after a beat, in seconds.
const FADE_S: f64 = 0.16;
/// Brightness of the light on a beat that is not a downbeat, at full energy. On a downbeat the
/// brightness is 1.
const BEAT: f32 = 0.55;
/// Factor by which the brightness of the light is multiplied if the energy of the music is 0. The
/// factor rises linearly to 1 at energy 1.
const LEAST: f32 = 0.6;

/// Returns the brightness (0..1) at `time` (seconds) of a light that flashes on each of `beats`.
/// The brightness is 1 on a downbeat with full energy and decays until the next beat. It is 0
/// before the first beat and where there is no music.
pub fn pulse(beats: &[Beat], time: f64) -> f32 {
    let after = beats.partition_point(|beat| beat.time <= time + 1e-6);
    let Some(beat) = after
        .checked_sub(1)
        .map(|last| &beats[last])
        .filter(|beat| beat.music)
    else {
        return 0.0;
    };
    let strength = if beat.bar_position == 0 { 1.0 } else { BEAT };
    let energy = LEAST + (1.0 - LEAST) * beat.energy.clamp(0.0, 1.0);
    strength * energy * (-(time - beat.time).max(0.0) / FADE_S).exp() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn beat(time: f64, bar_position: u32, music: bool) -> Beat {
        Beat {
            time,
            bar_position,
            beats_per_bar: 4,
            confidence: 1.0,
            energy: 1.0,
            music,
        }
    }

    #[test]
    fn the_light_pulses_on_beats_and_most_on_the_first_of_a_bar() {
        let beats = [beat(0.5, 3, true), beat(1.0, 0, true), beat(1.5, 1, false)];
        assert_eq!(pulse(&beats, 0.4), 0.0);
        assert!((pulse(&beats, 1.0) - 1.0).abs() < 1e-6);
        assert!(
            pulse(&beats, 0.5) < pulse(&beats, 1.0)
                && pulse(&beats, 0.5) > 2.0 * pulse(&beats, 0.8)
        );
        assert_eq!(pulse(&beats, 1.6), 0.0);
    }
}
