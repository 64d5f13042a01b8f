//! The choreography of the move "monkey".
//!
//! In: nothing.
//! Out: a choreography.
//! Thread: any, before the show.
//! Allocates: freely.

use crate::moves::arm::Arm;
use crate::moves::choreography::{Choreography, Part, Side};
use crate::moves::poses::{READY, bounce};

/// Returns the choreography of the monkey: the fists go up and down by turns in front of a trunk
/// that bends over. In the second half the body turns to each side.
pub(in crate::moves) fn monkey() -> Choreography {
    let mut dance = Choreography::new(16.0, 32, 0.46);
    bounce(&mut dance, 0.055);
    dance
        .set(Part::Rise, &[(0.0, -0.06)])
        .set(Part::HipPitch, &[(0.0, 12.0)])
        .set(Part::HipZ, &[(0.0, -0.07)])
        .cycle(
            Part::WaistPitch,
            0.0..16.0,
            2.0,
            &[(0.0, 10.0), (1.0, 24.0)],
        )
        .cycle(Part::WaistRoll, 0.0..16.0, 2.0, &[(0.0, 8.0), (1.0, -8.0)])
        .cycle(Part::Weight, 0.0..16.0, 2.0, &[(0.0, -0.3), (1.0, 0.3)])
        .cycle(Part::HeadRoll, 0.0..16.0, 2.0, &[(0.0, -6.0), (1.0, 6.0)])
        .set(
            Part::WaistYaw,
            &[
                (0.0, 0.0),
                (8.0, 0.0),
                (9.0, 24.0),
                (11.0, 24.0),
                (12.0, 0.0),
                (13.0, -24.0),
                (15.0, -24.0),
            ],
        );
    let up = Arm::reach([0.05, 0.16, 0.34], [0.3, -1.0, 0.1]).hand(0.0, 30.0);
    let down = Arm::reach([0.05, -0.24, 0.26], [0.35, -0.5, -1.0]).hand(0.0, 30.0);
    dance
        .arm_cycle(
            Side::Left,
            0.0..16.0,
            4.0,
            &[(0.0, READY), (1.0, up), (2.0, down), (3.0, up)],
        )
        .arm_cycle(
            Side::Right,
            0.0..16.0,
            4.0,
            &[(0.0, READY), (1.0, down), (2.0, up), (3.0, down)],
        );
    dance.finish()
}
