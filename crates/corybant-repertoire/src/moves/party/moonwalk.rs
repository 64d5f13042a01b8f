//! The choreography of the move "moonwalk".
//!
//! In: nothing.
//! Out: a choreography.
//! Thread: any, before the show.
//! Allocates: freely.

use glam::{Quat, Vec3};

use crate::moves::arm::Arm;
use crate::moves::choreography::{Choreography, Part, Side};
use crate::moves::poses::{LOW, READY};

/// Heading of the dancer during the backslide, in degrees: nearly in profile.
const PROFILE: f32 = -58.0;
/// Distance by which each slide moves the body back, in metres. A foot slides twice as far.
const SLIDE: f32 = 0.21;

/// Returns the choreography of the moonwalk (backslide): one straight leg glides back past the other,
/// which stands on the ball of its foot with a bent knee. The dancer, in profile, glides back and
/// then returns and turns to the front.
pub(in crate::moves) fn moonwalk() -> Choreography {
    let mut dance = Choreography::new(16.0, 34, 0.20);
    feet(&mut dance);
    let turn = [
        (0.0, 0.0),
        (1.2, PROFILE),
        (8.0, PROFILE),
        (12.0, 0.4 * PROFILE),
        (14.0, 0.0),
    ];
    dance
        .set(Part::Turn, &turn)
        .set(
            Part::Rise,
            &[
                (0.0, -0.02),
                (1.0, 0.01),
                (7.0, 0.01),
                (8.0, -0.02),
                (9.5, -0.005),
            ],
        )
        .pulse(Part::Rise, 1.0, &[(0.0, -0.008), (0.5, 0.002)])
        .set(
            Part::WaistPitch,
            &[(0.0, 4.0), (1.5, 13.0), (7.0, 13.0), (9.0, 5.0)],
        )
        .set(
            Part::HeadPitch,
            &[(0.0, 0.0), (2.0, 9.0), (7.0, 9.0), (9.0, 0.0)],
        )
        .cycle(Part::Weight, 8.0..16.0, 2.0, &[(0.0, 0.4), (1.0, -0.4)])
        .set(Part::Weight, &[(1.0, 0.0), (7.0, 0.0)])
        .cycle(Part::WaistYaw, 0.0..16.0, 2.0, &[(0.0, 7.0), (1.0, -7.0)]);
    arms(&mut dance);
    dance.finish()
}

/// Adds the slides of both feet on the beats 1 to 7 to `dance`, and eight steps back to their first
/// places.
fn feet(dance: &mut Choreography) {
    let facing = Quat::from_rotation_y(PROFILE.to_radians());
    for beat in 1..=16 {
        let foot = usize::from(beat % 2 == 0);
        let at = beat as f32;
        // Narrow in profile, wider at the front.
        let side = [1.0, -1.0][foot];
        if beat < 8 {
            let place = facing * Vec3::new(0.075 * side, 0.0, -SLIDE * at);
            dance.feet[foot]
                .slide((at - 0.93, at - 0.2), place, PROFILE)
                .pitch(at - 0.94, 0.0)
                .pitch(at - 0.2, 0.0)
                .pitch(at + 0.03, 55.0)
                .pitch(at + 0.8, 55.0);
        } else {
            let left = (16.0 - at) / 9.0;
            let yaw = PROFILE * (1.4 * left - 0.4).max(0.0);
            let place = facing * Vec3::NEG_Z * (7.0 * SLIDE * left)
                + Quat::from_rotation_y(yaw.to_radians()) * Vec3::X * (0.10 * side);
            dance.feet[foot].step((at - 0.6, at - 0.05), place.x, place.z, yaw + 12.0 * side);
        }
    }
    dance.feet[0].step((15.2, 15.9), 0.10, 0.0, 12.0);
    dance.feet[1].pitch(0.5, 50.0).pitch(0.8, 50.0);
}

/// Adds the poses of both arms in the moonwalk to `dance`.
fn arms(dance: &mut Choreography) {
    let (fore, back) = (
        Arm::angles(30.0, 8.0, -12.0, 44.0),
        Arm::angles(-28.0, 10.0, -6.0, 26.0),
    );
    dance
        .arm_cycle(
            Side::Left,
            0.0..16.0,
            4.0,
            &[(0.0, READY), (1.0, fore), (2.0, back), (3.0, fore)],
        )
        .arm_cycle(
            Side::Right,
            0.0..16.0,
            4.0,
            &[(0.0, READY), (1.0, back), (2.0, fore), (3.0, LOW)],
        );
}
