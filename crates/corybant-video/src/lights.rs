//! Computes the lights of a picture, which follow the music: the key light and the coloured lights
//! pulse on the beat, the coloured lights change their colours every two bars, beams swing and rings
//! run over the floor.
//!
//! In: the beats of a song, a look, the camera.
//! Out: the numbers of the lights for the shader.
//! Thread: any.
//! Allocates: never.

use std::f32::consts::TAU;

use glam::{Mat4, Vec2, Vec3, Vec4};

use crate::look::Colours;
use corybant_core::beat::offline::Beat;

/// Time in which the brightness of the light decays to 1/e after a beat, in seconds.
const FADE_S: f64 = 0.16;
/// Brightness of the light on a beat that is not a downbeat, at full energy. On a downbeat the
/// brightness is 1.
const BEAT: f32 = 0.55;
/// Factor by which the brightness of the light is multiplied if the energy of the music is 0. The
/// factor rises linearly to 1 at energy 1.
const LEAST: f32 = 0.6;
/// Number of beats in which a beam swings to one side, to the other and back.
const SWING_BEATS: f32 = 8.0;
/// Number of bars after which the coloured lights change their colours.
const COLOUR_BARS: usize = 2;
/// Number of rings on the floor. Each beat starts one; it lasts for this number of beats.
pub(crate) const RINGS: usize = 3;
/// The number of beams around the stage, and the largest number that a picture shows.
const BEAMS: usize = 8;
pub(crate) const BEAMS_MAX: usize = 4;
/// Height of the lamps of the beams above the floor and length of the beams, in metres.
const BEAM_HEIGHT: f32 = 7.0;
const BEAM_LENGTH: f32 = 7.5;
/// Half the width of a beam at its end, in metres.
const BEAM_WIDTH: f32 = 0.4;

/// What the music does at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Music {
    /// Brightness of a light that flashes on each beat, 0..1: 1 on a downbeat with full energy. It decays
    /// until the next beat. It is 0 before the first beat and where there is no music.
    pub pulse: f32,
    /// Number of beats before this time, with the passed fraction of the current beat.
    pub beat: f32,
    /// Number of downbeats up to this time.
    pub bar: usize,
    /// Energy of the music, 0..1.
    pub energy: f32,
}

impl Music {
    /// Returns what the music with these beats does at `time`, in seconds.
    pub fn at(beats: &[Beat], time: f64) -> Self {
        let after = beats.partition_point(|beat| beat.time <= time + 1e-6);
        let Some(last) = after.checked_sub(1) else {
            return Self::default();
        };
        let beat = &beats[last];
        let passed = beats.get(after).map_or(0.0, |next| {
            (time - beat.time) / (next.time - beat.time).max(1e-3)
        });
        let bars = beats[..after].iter().filter(|beat| beat.bar_position == 0);
        let strength = if beat.bar_position == 0 { 1.0 } else { BEAT };
        let energy = beat.energy.clamp(0.0, 1.0);
        let loudness = LEAST + (1.0 - LEAST) * energy;
        let fade = (-(time - beat.time).max(0.0) / FADE_S).exp() as f32;
        Self {
            pulse: if beat.music {
                strength * loudness * fade
            } else {
                0.0
            },
            beat: last as f32 + passed.clamp(0.0, 1.0) as f32,
            bar: bars.count(),
            energy,
        }
    }

    /// Returns by how much the coloured lights follow the energy of the music, 0..1.
    fn lively(&self) -> f32 {
        0.35 + 0.65 * self.energy
    }
}

/// The stage as a camera sees it.
pub(crate) struct StageView {
    /// Matrix from stage space to clip space.
    pub view: Mat4,
    /// Position of the camera and middle of all dancers, in stage space, in metres.
    pub eye: Vec3,
    pub middle: Vec3,
    /// Distance between the middle of the dancers and the lamps, in metres.
    pub radius: f32,
}

/// Appends the numbers of the coloured lights in the order of `Lights` in `film.wgsl` to `into`.
pub(crate) fn add_numbers(
    into: &mut Vec<f32>,
    colours: &Colours,
    music: &Music,
    stage: &StageView,
) {
    let tint = |n: usize| colours.tints[(n + music.bar / COLOUR_BARS) % colours.tints.len()];
    let mut add = |colour: Vec3, last: f32| into.extend(colour.extend(last).to_array());
    let rim = colours.rim * (1.0 + 0.6 * music.pulse);
    (0..2).for_each(|n| add(rim * tint(n), 0.0));
    let swing = (TAU * music.beat / SWING_BEATS).sin();
    for n in 0..2 {
        let side = if n == 0 { -1.0 } else { 1.0 };
        let offset = Vec3::new(side * (1.1 + 0.5 * swing), 0.0, -0.7) * (0.4 * stage.radius);
        let place = stage.middle + offset;
        let strength = colours.wash * (0.5 + music.pulse) * music.lively();
        add(Vec3::new(place.x, place.z, 0.28 * stage.radius), 0.0);
        add(strength * tint(n + 2), 0.0);
    }
    for n in 0..RINGS {
        let age = (music.beat - n as f32).rem_euclid(RINGS as f32);
        let fade = (1.0 - age / RINGS as f32).max(0.0);
        let strength = 0.5 * colours.wash * fade * fade * music.lively();
        add(strength * tint(n), 0.18 * stage.radius * (1.0 + 1.4 * age));
    }
    let mut beams: Vec<[Vec4; 2]> = (0..BEAMS)
        .filter_map(|n| beam(n, tint(n), colours.beam, music, stage))
        .collect();
    beams.resize(BEAMS_MAX, [Vec4::ZERO, Vec4::new(0.0, 0.0, 0.0, 1.0)]);
    beams
        .into_iter()
        .flatten()
        .for_each(|numbers| into.extend(numbers.to_array()));
}

/// Returns the beam with the number `n` in the picture: the coordinates of its lamp and its end, then its
/// colour and its half width at its end. The middle of the picture is 0, and the picture is 2 high. Returns
/// `None` if the beam is not behind the dancers.
fn beam(
    n: usize,
    tint: Vec3,
    strength: f32,
    music: &Music,
    stage: &StageView,
) -> Option<[Vec4; 2]> {
    let (side, ahead) = (TAU * (n as f32 + 0.5) / BEAMS as f32).sin_cos();
    let out = Vec3::new(side, 0.0, ahead);
    let flat = (stage.middle - stage.eye)
        .with_y(0.0)
        .normalize_or(Vec3::NEG_Z);
    let behind = ((out.dot(flat) - 0.2) / 0.5).clamp(0.0, 1.0);
    let swing = 0.3 * (TAU * music.beat / SWING_BEATS + n as f32).sin();
    let lamp = stage.middle.with_y(BEAM_HEIGHT) + 1.4 * stage.radius * out;
    let way = (Vec3::NEG_Y - 0.35 * out + swing * out.cross(Vec3::Y)).normalize();
    let wide = stage.view.row(0).truncate().length();
    let high = stage.view.row(1).truncate().length();
    let place = |at: Vec3| {
        let clip = stage.view * at.extend(1.0);
        let scale = Vec2::new(high / wide, 1.0);
        (clip.w > 0.5).then(|| (scale * clip.truncate().truncate() / clip.w, clip.w))
    };
    let (from, _) = place(lamp)?;
    let (to, depth) = place(lamp + BEAM_LENGTH * way)?;
    let is_turn = n % 2 == music.beat as usize % 2;
    let light = strength * (0.35 + if is_turn { 2.4 * music.pulse } else { 0.0 }) * music.lively();
    (behind * light > 0.0).then(|| {
        [
            Vec4::new(from.x, from.y, to.x, to.y),
            (behind * light * tint).extend(BEAM_WIDTH * high / depth),
        ]
    })
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
            section: None,
            begins_section: false,
        }
    }

    #[test]
    fn the_light_pulses_on_beats_and_most_on_the_first_of_a_bar() {
        let beats = [beat(0.5, 3, true), beat(1.0, 0, true), beat(1.5, 1, false)];
        let pulse = |time| Music::at(&beats, time).pulse;
        assert_eq!(pulse(0.4), 0.0);
        assert!((pulse(1.0) - 1.0).abs() < 1e-6);
        assert!(pulse(0.5) < pulse(1.0) && pulse(0.5) > 2.0 * pulse(0.8));
        assert_eq!(pulse(1.6), 0.0);
        let music = Music::at(&beats, 1.25);
        assert!((music.beat - 1.5).abs() < 1e-6 && music.bar == 1);
    }
}
