//! The choreography of the move "robot".
//!
//! In: nothing.
//! Out: a choreography.
//! Thread: any, before the show.
//! Allocates: freely.

use crate::moves::arm::Arm;
use crate::moves::choreography::{Choreography, Part, Side};
use crate::moves::poses::to;

/// Returns the choreography of the robot: the forearms move like hinges at still elbows, and the
/// trunk turns in steps. Every movement ends abruptly with a small shiver.
pub(in crate::moves) fn robot() -> Choreography {
    let mut dance = Choreography::new(16.0, 34, 0.26);
    dance.ease = 0.0;
    dance.snap = 0.66;
    dance.lag = 0.0;
    dance.arm_lag = 0.0;
    dance.level_head = 0.0;
    feet(&mut dance);
    hips(&mut dance);
    torso(&mut dance);
    head(&mut dance);
    arms(&mut dance);
    dance.finish()
}

/// Adds the steps of both feet in the robot move to `dance`.
fn feet(dance: &mut Choreography) {
    let [left, right] = &mut dance.feet;
    left.arc(to(10.0), 0.06, glam::Vec3::new(0.13, 0.0, 0.08), 0.0)
        .arc(to(14.0), 0.06, glam::Vec3::new(0.13, 0.0, 0.0), 12.0);
    right
        .arc(to(11.0), 0.06, glam::Vec3::new(-0.13, 0.0, 0.08), 0.0)
        .arc(to(15.0), 0.06, glam::Vec3::new(-0.13, 0.0, 0.0), -12.0);
}

/// Adds the keys (values at beats) for the weight and the hips in the robot move to `dance`.
fn hips(dance: &mut Choreography) {
    dance
        .pulse(Part::Rise, 1.0, &[(0.0, -0.014), (0.5, 0.0)])
        .set(Part::Rise, &[(0.0, 0.0)])
        .set(
            Part::Weight,
            &[
                (0.0, 0.0),
                (1.0, 0.25),
                (3.0, -0.25),
                (5.0, -0.25),
                (7.0, 0.25),
                (8.0, 0.0),
                (10.0, -0.7),
                (11.0, 0.7),
                (12.0, 0.0),
            ],
        )
        .set(Part::Weight, &[(13.0, 0.0), (14.0, -0.7), (15.0, 0.7)]);
}

/// Adds the keys (values at beats) for the waist in the robot move to `dance`.
fn torso(dance: &mut Choreography) {
    let shiver = |size: f32| {
        [
            (0.0, 0.0),
            (0.07, size),
            (0.15, -0.6 * size),
            (0.23, 0.3 * size),
            (0.32, 0.0),
            (0.9, 0.0),
        ]
    };
    dance
        .pulse(Part::WaistYaw, 1.0, &shiver(0.5))
        .set(
            Part::WaistYaw,
            &[
                (0.0, 0.0),
                (1.0, 24.0),
                (2.0, 24.0),
                (3.0, -24.0),
                (4.0, 0.0),
                (5.0, -24.0),
                (6.0, -24.0),
                (7.0, 24.0),
                (8.0, 0.0),
            ],
        )
        .set(
            Part::WaistYaw,
            &[
                (9.0, 20.0),
                (10.0, -20.0),
                (11.0, 20.0),
                (12.0, 0.0),
                (13.0, -28.0),
                (14.0, 0.0),
                (15.0, 28.0),
            ],
        )
        .set(
            Part::WaistPitch,
            &[
                (0.0, 0.0),
                (2.0, 0.0),
                (3.0, 14.0),
                (4.0, 0.0),
                (7.0, 14.0),
                (8.0, 0.0),
                (12.0, 0.0),
                (13.0, 24.0),
                (14.0, 2.0),
                (15.0, 24.0),
            ],
        );
}

/// Adds the keys (values at beats) for the head in the robot move to `dance`.
fn head(dance: &mut Choreography) {
    let shiver = |size: f32| {
        [
            (0.0, 0.0),
            (0.07, size),
            (0.15, -0.6 * size),
            (0.23, 0.3 * size),
            (0.32, 0.0),
            (0.9, 0.0),
        ]
    };
    dance
        .pulse(Part::HeadYaw, 1.0, &shiver(1.2))
        .set(
            Part::HeadYaw,
            &[
                (0.0, 0.0),
                (1.0, 0.0),
                (2.0, 34.0),
                (3.0, 0.0),
                (5.0, 0.0),
                (6.0, -34.0),
                (7.0, 0.0),
                (8.0, 0.0),
            ],
        )
        .set(
            Part::HeadYaw,
            &[(9.0, -22.0), (10.0, 22.0), (11.0, -22.0), (12.0, 0.0)],
        )
        .set(
            Part::HeadRoll,
            &[
                (0.0, 0.0),
                (12.0, 0.0),
                (13.0, 16.0),
                (14.0, 0.0),
                (15.0, -16.0),
            ],
        );
}

/// Adds the poses of both arms in the robot move to `dance`.
fn arms(dance: &mut Choreography) {
    let level = Arm::angles(8.0, 14.0, -4.0, 90.0);
    let gate_up = Arm::angles(0.0, 84.0, 88.0, 90.0);
    let gate_down = Arm::angles(0.0, 84.0, -80.0, 90.0);
    let ahead = Arm::angles(48.0, 12.0, 0.0, 42.0);
    let raised = Arm::angles(18.0, 14.0, 0.0, 128.0);
    let left = [
        level, gate_up, gate_down, raised, level, gate_down, gate_up, ahead, level, raised, ahead,
        raised, level, gate_down, raised, gate_up,
    ];
    let right = [
        level, gate_down, gate_up, ahead, level, gate_up, gate_down, raised, level, ahead, raised,
        ahead, level, gate_up, raised, gate_down,
    ];
    dance
        .arm_beats(Side::Left, 0.0, &left)
        .arm_beats(Side::Right, 0.0, &right);
}
