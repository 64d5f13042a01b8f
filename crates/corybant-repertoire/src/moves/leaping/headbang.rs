//! The choreography of the move "headbang".
//!
//! In: nothing.
//! Out: a choreography.
//! Thread: any, before the show.
//! Allocates: freely.

use crate::moves::arm::Arm;
use crate::moves::choreography::{BOTH, Choreography, Part, Side};
use crate::moves::poses::to;

/// Returns the choreography of headbanging in a wide stance: the upper body swings down and up. In
/// the second half the arms also play an air guitar.
pub(in crate::moves) fn headbang() -> Choreography {
    let mut dance = Choreography::new(16.0, 29, 0.46);
    dance.lag = 0.05;
    dance.level_head = 0.0;
    feet(&mut dance);
    hips(&mut dance);
    torso(&mut dance);
    arms(&mut dance);
    dance.finish()
}

/// Adds the steps of both feet in headbanging to `dance`.
fn feet(dance: &mut Choreography) {
    let [left, right] = &mut dance.feet;
    right
        .step(to(8.0), -0.20, -0.10, -30.0)
        .step(to(16.0), -0.23, 0.0, -12.0);
    left.step(to(9.0), 0.24, 0.12, 8.0)
        .step(to(15.0), 0.23, 0.0, 12.0);
}

/// Adds the keys (values at beats) for the weight, the hips and the knees in headbanging to
/// `dance`.
fn hips(dance: &mut Choreography) {
    dance
        .cycle(Part::HipPitch, 0.0..16.0, 2.0, &[(0.0, -2.0), (1.0, 12.0)])
        .cycle(Part::HipZ, 0.0..16.0, 2.0, &[(0.0, 0.02), (1.0, -0.09)])
        .cycle(
            Part::Rise,
            0.0..16.0,
            2.0,
            &[(0.0, -0.008), (0.5, 0.0), (1.0, -0.02)],
        )
        .cycle(Part::Weight, 0.0..16.0, 4.0, &[(0.0, -0.15), (2.0, 0.15)])
        .set(Part::KneeLeft, &[(0.0, 12.0)])
        .set(Part::KneeRight, &[(0.0, 12.0)]);
}

/// Adds the keys (values at beats) for the waist, the chest and the head in headbanging to `dance`.
fn torso(dance: &mut Choreography) {
    dance
        .cycle(
            Part::WaistPitch,
            0.0..16.0,
            2.0,
            &[(0.0, -2.0), (1.0, 20.0)],
        )
        .cycle(
            Part::ChestPitch,
            0.0..16.0,
            2.0,
            &[(0.0, -4.0), (1.0, 14.0)],
        )
        .cycle(
            Part::HeadPitch,
            0.0..16.0,
            2.0,
            &[(0.0, -18.0), (1.0, 46.0)],
        )
        .cycle(
            Part::HeadRoll,
            0.0..16.0,
            4.0,
            &[(0.0, 0.0), (1.0, 10.0), (2.0, 0.0), (3.0, -10.0)],
        )
        .cycle(
            Part::WaistYaw,
            0.0..8.0,
            4.0,
            &[(0.0, 0.0), (1.0, 7.0), (3.0, -7.0)],
        )
        .set(Part::WaistYaw, &[(8.0, 0.0), (9.0, -14.0), (15.0, -12.0)]);
}

/// Adds the poses of both arms in headbanging to `dance`.
fn arms(dance: &mut Choreography) {
    let loose = Arm::angles(2.0, 18.0, -8.0, 52.0);
    let thrown = Arm::angles(30.0, 26.0, -6.0, 34.0);
    let neck = Arm::reach([0.18, -0.28, 0.25], [0.6, -0.8, -0.2]).hand(60.0, 20.0);
    let fret = Arm::reach([0.28, -0.20, 0.28], [0.6, -0.8, -0.2]).hand(60.0, 20.0);
    let strum = Arm::reach([-0.03, -0.29, 0.28], [1.0, -0.1, -0.3]);
    let lifted = Arm::reach([0.04, -0.18, 0.33], [1.0, -0.1, -0.3]);
    for side in BOTH {
        dance.arm_cycle(side, 0.0..8.0, 2.0, &[(0.0, loose), (1.0, thrown)]);
    }
    dance
        .arm_beats(
            Side::Left,
            8.0,
            &[loose, neck, fret, neck, fret, neck, fret, neck],
        )
        .arm(Side::Right, &[(8.0, loose)])
        .arm_cycle(Side::Right, 9.0..15.5, 1.0, &[(0.0, strum), (0.5, lifted)]);
}
