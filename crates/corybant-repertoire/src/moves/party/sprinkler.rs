//! The choreography of the move "sprinkler".
//!
//! In: nothing.
//! Out: a choreography.
//! Thread: any, before the show.
//! Allocates: freely.

use crate::moves::arm::Arm;
use crate::moves::choreography::{Choreography, Part, Side};
use crate::moves::poses::{READY, bounce, to};

/// Returns the choreography of the sprinkler: one hand is behind the head, and the other arm points
/// away and turns with chest and waist in steps. In the second half the arms change roles.
pub(in crate::moves) fn sprinkler() -> Choreography {
    let mut dance = Choreography::new(16.0, 32, 0.40);
    dance.snap = 0.3;
    bounce(&mut dance, 0.03);
    let [left, right] = &mut dance.feet;
    left.step(to(8.0), 0.23, 0.05, 20.0)
        .step(to(16.0), 0.20, 0.0, 12.0);
    right
        .step(to(7.0), -0.18, 0.0, -12.0)
        .step(to(15.0), -0.20, 0.0, -12.0);
    let head = Arm::reach([0.11, 0.20, -0.11], [1.0, 0.25, -0.2]).hand(0.0, 10.0);
    let points = [(40.0, 70.0), (54.0, 54.0), (68.0, 34.0)]
        .map(|(fwd, side)| Arm::angles(fwd, side, 0.0, 6.0));
    let yaw = [(0.0, 0.0), (1.0, -26.0), (2.0, 2.0), (3.0, 28.0)];
    for (from, turn, pointing, resting) in [
        (0.0, -1.0, Side::Left, Side::Right),
        (8.0, 1.0, Side::Right, Side::Left),
    ] {
        let turned = |size: f32| yaw.map(|(beat, yaw)| (beat, turn * size * yaw));
        dance
            .cycle(Part::ChestYaw, from..from + 8.0, 4.0, &turned(0.8))
            .cycle(Part::WaistYaw, from..from + 8.0, 4.0, &turned(0.6))
            .cycle(Part::HipYaw, from..from + 8.0, 4.0, &turned(0.4))
            .cycle(Part::Weight, from..from + 8.0, 4.0, &turned(0.012))
            .cycle(Part::WaistRoll, from..from + 8.0, 4.0, &turned(0.2))
            .arm_cycle(
                resting,
                from..from + 8.0,
                4.0,
                &[(0.0, READY), (1.0, head), (2.0, head), (3.0, head)],
            )
            .arm_cycle(
                pointing,
                from..from + 8.0,
                4.0,
                &[
                    (0.0, READY),
                    (1.0, points[0]),
                    (2.0, points[1]),
                    (3.0, points[2]),
                ],
            );
    }
    dance.set(Part::WaistPitch, &[(0.0, 8.0), (7.0, 4.0), (12.0, 9.0)]);
    dance.finish()
}
