//! The choreography of the move "egyptian".
//!
//! In: nothing.
//! Out: a choreography.
//! Thread: any, before the show.
//! Allocates: freely.

use crate::moves::arm::Arm;
use crate::moves::choreography::{Choreography, Part, Side};
use crate::moves::poses::{READY, bounce, to};

/// Returns the choreography of the Egyptian walk: one hand points forward at head height and the
/// other back at the hip, like figures on an old wall. The sides change on every beat.
pub(in crate::moves) fn egyptian() -> Choreography {
    let mut dance = Choreography::new(16.0, 34, 0.26);
    dance.ease = 0.0;
    dance.snap = 0.35;
    bounce(&mut dance, 0.02);
    let [left, right] = &mut dance.feet;
    for start in [0.0, 4.0, 8.0, 12.0] {
        let out = if start < 8.0 { 0.16 } else { 0.22 };
        left.step(to(start + 1.0), 0.13 + out, 0.06, 40.0)
            .step(to(start + 3.0), 0.13, 0.0, 12.0);
        right
            .step(to(start + 2.0), -0.13 + 0.5 * out, 0.0, -12.0)
            .step(to(start + 4.0), -0.13, 0.0, -12.0);
    }
    dance.cycle(
        Part::Weight,
        0.0..16.0,
        4.0,
        &[(0.0, -0.3), (1.0, 0.4), (2.0, -0.4), (3.0, 0.4)],
    );
    for (from, way) in [(0.0, 1.0), (8.0, -1.0)] {
        let turned = |size: f32| {
            [
                (0.0, 0.0),
                (1.0, way * size),
                (2.0, -way * size),
                (3.0, way * size),
            ]
        };
        dance
            .cycle(Part::WaistYaw, from..from + 8.0, 4.0, &turned(22.0))
            .cycle(Part::HeadYaw, from..from + 8.0, 4.0, &turned(50.0));
    }
    let front = Arm::angles(20.0, 88.0, 78.0, 88.0).hand(0.0, -62.0);
    let rear = Arm::angles(-8.0, 62.0, -88.0, 78.0).hand(0.0, -60.0);
    for (from, first, second) in [
        (0.0, Side::Left, Side::Right),
        (8.0, Side::Right, Side::Left),
    ] {
        dance
            .arm_cycle(
                first,
                from..from + 8.0,
                4.0,
                &[(0.0, READY), (1.0, front), (2.0, rear), (3.0, front)],
            )
            .arm_cycle(
                second,
                from..from + 8.0,
                4.0,
                &[(0.0, READY), (1.0, rear), (2.0, front), (3.0, rear)],
            );
    }
    dance.finish()
}
