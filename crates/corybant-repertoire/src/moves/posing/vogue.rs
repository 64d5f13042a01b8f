//! The choreography of the move "vogue".
//!
//! In: nothing.
//! Out: a choreography.
//! Thread: any, before the show.
//! Allocates: freely.

use crate::moves::arm::Arm;
use crate::moves::choreography::{Choreography, Part, Side};
use crate::moves::poses::{READY, high, on_hip, to};

/// Returns the choreography of voguing, with one sharp pose on each beat. The hands frame the face,
/// draw lines and boxes in the air, and rest on the hips at the start of the first three bars.
pub(in crate::moves) fn vogue() -> Choreography {
    let mut dance = Choreography::new(16.0, 30, 0.30);
    dance.ease = 0.0;
    dance.snap = 0.42;
    feet(&mut dance);
    hips(&mut dance);
    torso(&mut dance);
    arms(&mut dance);
    dance.finish()
}

/// Adds the steps of both feet in voguing to `dance`.
fn feet(dance: &mut Choreography) {
    let [left, right] = &mut dance.feet;
    left.step(to(1.0), 0.13, 0.16, 4.0)
        .step(to(5.0), 0.15, 0.0, 12.0)
        .step(to(11.0), 0.24, 0.02, 24.0)
        .step(to(16.0), 0.15, 0.0, 12.0);
    right
        .step(to(6.0), -0.13, 0.16, -4.0)
        .step(to(9.0), -0.15, 0.0, -12.0)
        .step(to(13.0), -0.24, 0.05, -20.0)
        .step(to(15.0), -0.15, 0.0, -12.0);
}

/// Adds the keys (values at beats) for the weight and the hips in voguing to `dance`.
fn hips(dance: &mut Choreography) {
    dance
        .pulse(Part::Rise, 1.0, &[(0.0, -0.015), (0.5, 0.0)])
        .set(
            Part::Rise,
            &[
                (0.0, -0.01),
                (4.0, -0.02),
                (8.0, -0.01),
                (10.0, -0.06),
                (11.0, -0.12),
                (12.0, -0.05),
                (16.0, -0.01),
            ],
        )
        .set(
            Part::Weight,
            &[
                (0.0, -0.5),
                (1.0, -0.8),
                (2.0, 0.5),
                (3.0, -0.6),
                (4.0, 0.5),
                (5.0, -0.7),
                (6.0, 0.8),
                (7.0, -0.4),
            ],
        )
        .set(
            Part::Weight,
            &[
                (8.0, 0.6),
                (9.0, -0.5),
                (10.0, 0.5),
                (11.0, -0.4),
                (12.0, 0.6),
                (13.0, 0.8),
                (14.0, -0.5),
                (15.0, 0.6),
            ],
        )
        .cycle(Part::HipRoll, 0.0..16.0, 2.0, &[(0.0, -5.0), (1.0, 6.0)])
        .cycle(
            Part::HipYaw,
            0.0..16.0,
            4.0,
            &[(0.0, 0.0), (1.0, -14.0), (2.0, 14.0), (3.0, -6.0)],
        );
}

/// Adds the keys (values at beats) for the waist and the head in voguing to `dance`.
fn torso(dance: &mut Choreography) {
    dance
        .cycle(
            Part::WaistRoll,
            0.0..16.0,
            4.0,
            &[(0.0, 3.0), (1.0, -8.0), (2.0, 9.0), (3.0, -4.0)],
        )
        .cycle(
            Part::WaistYaw,
            0.0..16.0,
            4.0,
            &[(0.0, 0.0), (1.0, 24.0), (2.0, -24.0), (3.0, 8.0)],
        )
        .cycle(
            Part::HeadYaw,
            0.0..16.0,
            4.0,
            &[(0.0, 0.0), (1.0, -36.0), (2.0, 36.0), (3.0, 0.0)],
        )
        .cycle(
            Part::HeadPitch,
            0.0..16.0,
            4.0,
            &[(0.0, 0.0), (1.0, -8.0), (2.0, -8.0), (3.0, 8.0)],
        );
}

/// Adds the poses of both arms in voguing to `dance`.
fn arms(dance: &mut Choreography) {
    let crown = Arm::reach([-0.10, 0.39, 0.12], [1.0, 0.3, 0.1]).hand(0.0, 30.0);
    let chin = Arm::reach([-0.06, 0.02, 0.26], [0.8, -0.6, 0.3]).hand(40.0, 20.0);
    let temple = Arm::reach([0.04, 0.17, 0.16], [1.0, 0.1, -0.1]).hand(0.0, 20.0);
    let line = Arm::angles(10.0, 92.0, -10.0, 5.0).hand(0.0, -25.0);
    let lintel = Arm::reach([-0.12, 0.30, 0.16], [1.0, 0.4, 0.2]);
    let sill = Arm::reach([-0.16, -0.06, 0.28], [1.0, -0.1, 0.2]);
    let (hip, high) = (on_hip(), high());
    let left = [
        hip, crown, chin, lintel, hip, line, temple, sill, hip, temple, crown, line, READY, chin,
        high, temple,
    ];
    let right = [
        hip, chin, crown, sill, hip, temple, line, lintel, hip, crown, temple, line, READY, high,
        chin, temple,
    ];
    dance
        .arm_beats(Side::Left, 0.0, &left)
        .arm_beats(Side::Right, 0.0, &right);
}
