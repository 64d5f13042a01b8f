//! The choreography of the move "floss".
//!
//! In: nothing.
//! Out: a choreography.
//! Thread: any, before the show.
//! Allocates: freely.

use crate::moves::arm::Arm;
use crate::moves::choreography::{Choreography, Part, Side};

/// Returns the choreography of the floss: the straight arms swing to one side, one of them in front
/// of the body, while the hips move to the other side. In the second half the arms swing higher and
/// the waist turns further.
pub(in crate::moves) fn floss() -> Choreography {
    let mut dance = Choreography::new(16.0, 31, 0.32);
    dance.lag = 0.02;
    dance
        .pulse(Part::Rise, 1.0, &[(0.0, -0.022), (0.5, 0.0)])
        .cycle(
            Part::HipX,
            0.0..16.0,
            4.0,
            &[(0.0, 0.04), (1.0, -0.07), (2.0, 0.07), (3.0, -0.07)],
        )
        .cycle(Part::Weight, 0.0..16.0, 2.0, &[(0.0, 0.25), (1.0, -0.25)])
        .cycle(Part::HipRoll, 0.0..16.0, 2.0, &[(0.0, 7.0), (1.0, -7.0)])
        .cycle(
            Part::WaistRoll,
            0.0..16.0,
            2.0,
            &[(0.0, 10.0), (1.0, -10.0)],
        )
        .cycle(Part::WaistYaw, 0.0..8.0, 2.0, &[(0.0, -5.0), (1.0, 5.0)])
        .cycle(Part::WaistYaw, 8.0..16.0, 2.0, &[(0.0, -16.0), (1.0, 16.0)])
        .cycle(Part::HeadYaw, 0.0..16.0, 4.0, &[(0.0, -6.0), (2.0, 6.0)])
        .set(Part::HeadPitch, &[(0.0, 0.0), (6.0, -4.0), (12.0, 5.0)])
        .set(Part::WaistPitch, &[(0.0, 4.0), (8.0, 6.0), (12.0, 12.0)]);
    let (out, before) = (
        Arm::angles(-4.0, 40.0, 0.0, 8.0),
        Arm::reach([-0.23, -0.37, 0.30], [0.4, -0.4, 0.5]),
    );
    let (small_out, small_before) = (
        Arm::angles(2.0, 24.0, -4.0, 34.0),
        Arm::angles(20.0, 2.0, -8.0, 34.0),
    );
    let (higher, over) = (
        Arm::angles(6.0, 54.0, 0.0, 10.0),
        Arm::reach([-0.27, -0.28, 0.35], [0.4, -0.4, 0.5]),
    );
    dance
        .arm_cycle(
            Side::Left,
            0.0..8.0,
            4.0,
            &[(0.0, small_before), (1.0, out), (2.0, before), (3.0, out)],
        )
        .arm_cycle(
            Side::Right,
            0.0..8.0,
            4.0,
            &[(0.0, small_out), (1.0, before), (2.0, out), (3.0, before)],
        )
        .arm_cycle(
            Side::Left,
            8.0..16.0,
            4.0,
            &[
                (0.0, small_before),
                (1.0, higher),
                (2.0, over),
                (3.0, higher),
            ],
        )
        .arm_cycle(
            Side::Right,
            8.0..16.0,
            4.0,
            &[(0.0, small_out), (1.0, over), (2.0, higher), (3.0, over)],
        );
    dance.finish()
}
