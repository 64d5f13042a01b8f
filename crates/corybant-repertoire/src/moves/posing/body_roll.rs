//! The choreography of the move "body roll".
//!
//! In: nothing.
//! Out: a choreography.
//! Thread: any, before the show.
//! Allocates: freely.

use crate::moves::arm::Arm;
use crate::moves::choreography::{BOTH, Choreography, Part};
use crate::moves::poses::to;

/// Returns the choreography of the body roll: every two beats a wave passes down the body, from the
/// head over chest, belly and hips to the knees, each an eighth of the cycle after the one above it. In the second half the wave passes sideways, while
/// the arms sweep up.
pub(in crate::moves) fn body_roll() -> Choreography {
    let mut dance = Choreography::new(16.0, 35, 0.40);
    dance.level_head = 0.6;
    feet(&mut dance);
    hips(&mut dance);
    torso(&mut dance);
    arms(&mut dance);
    dance.finish()
}

/// Adds the steps of both feet in the body roll to `dance`.
fn feet(dance: &mut Choreography) {
    let [left, right] = &mut dance.feet;
    right
        .step(to(9.0), -0.22, 0.08, -30.0)
        .step(to(12.0), -0.20, 0.0, -12.0);
    left.step(to(13.0), 0.22, 0.08, 30.0)
        .step(to(16.0), 0.20, 0.0, 12.0);
}

/// Adds a movement to the channel `part` of `dance` that goes to and fro every two beats: `degrees`
/// (or metres) at the beat `first`, and the opposite one beat later, about the middle `middle`. At
/// the start of each bar it is smaller, near the stance of the other moves.
fn roll(dance: &mut Choreography, part: Part, first: f32, degrees: f32, middle: f32) {
    for beat in 0..16u8 {
        let size = match beat % 8 {
            0 => 0.4,
            4 => 0.7,
            _ if beat % 2 == 0 => 1.0,
            _ => -1.0,
        };
        dance.set(part, &[(first + f32::from(beat), middle + size * degrees)]);
    }
}

/// Adds the keys (values at beats) for the weight and the hips in the body roll to `dance`. The hips
/// are back on even beats and in front on odd beats; a little later they tilt.
fn hips(dance: &mut Choreography) {
    roll(dance, Part::HipZ, 0.02, -0.095, 0.0);
    roll(dance, Part::HipPitch, 0.08, 18.0, -1.0);
    roll(dance, Part::Rise, 0.0, -0.016, -0.012);
    dance
        .cycle(Part::Weight, 0.0..8.0, 4.0, &[(0.0, -0.25), (2.0, 0.25)])
        .set(
            Part::Weight,
            &[
                (8.0, 0.2),
                (9.0, -0.4),
                (11.0, -0.5),
                (12.0, -0.2),
                (13.0, 0.4),
                (15.0, 0.5),
            ],
        )
        .cycle(Part::HipYaw, 0.0..16.0, 8.0, &sides(26.0));
}

/// Returns keys of eight beats that are `degrees` to the right in the first bar and as much to the
/// left in the second, so that the audience sees the roll from the side.
fn sides(degrees: f32) -> [(f32, f32); 6] {
    [
        (0.0, 0.0),
        (1.0, -degrees),
        (3.0, -degrees),
        (4.0, 0.0),
        (5.0, degrees),
        (7.0, degrees),
    ]
}

/// Adds the keys (values at beats) for the waist, the chest and the head in the body roll to
/// `dance`. While the hips are back, the chest is out in front and the head is up; while the hips are
/// tucked, the chest is back and hollow.
fn torso(dance: &mut Choreography) {
    roll(dance, Part::HeadPitch, -0.6, -9.0, -4.0);
    roll(dance, Part::ChestPitch, -0.45, -16.0, 2.0);
    roll(dance, Part::WaistPitch, -0.2, 12.0, 3.0);
    dance
        .cycle(Part::WaistYaw, 0.0..16.0, 8.0, &sides(12.0))
        .cycle(Part::WaistRoll, 0.0..16.0, 4.0, &[(0.0, 3.0), (2.0, -3.0)]);
}

/// Adds the poses of both arms in the body roll to `dance`.
fn arms(dance: &mut Choreography) {
    let back = Arm::angles(-24.0, 26.0, -8.0, 40.0);
    let front = Arm::angles(26.0, 24.0, -14.0, 62.0);
    let swept = Arm::reach([0.06, 0.30, 0.26], [1.0, -0.2, 0.1]).hand(0.0, -20.0);
    for side in BOTH {
        dance
            .arm_cycle(side, 0.0..8.0, 2.0, &[(0.0, front), (1.0, back)])
            .arm_cycle(side, 8.0..16.0, 2.0, &[(0.0, front), (1.0, swept)]);
    }
}
