//! The choreography of the move "spin".
//!
//! In: nothing.
//! Out: a choreography.
//! Thread: any, before the show.
//! Allocates: freely.

use crate::moves::arm::Arm;
use crate::moves::choreography::{Choreography, Part, Side};
use crate::moves::poses::{CLOSED, OPEN, READY, bounce, to};

/// Returns the choreography of the spin: a full turn to the left in three steps and a touch, with
/// the arms close to the body. The same turn to the right follows after four beats on the spot.
pub(in crate::moves) fn spin() -> Choreography {
    let mut dance = Choreography::new(16.0, 32, 0.28);
    feet(&mut dance);
    hips(&mut dance);
    torso(&mut dance);
    arms(&mut dance);
    dance.finish()
}

/// Adds the steps and pivots of both feet in the spin move to `dance`, and keys that raise the
/// heels.
fn feet(dance: &mut Choreography) {
    let [left, right] = &mut dance.feet;
    left.step(to(1.0), 0.40, 0.0, 100.0)
        .pivot((1.1, 1.9), 190.0)
        .step(to(3.0), 0.88, 0.0, 366.0)
        .bow(-0.18)
        .step(to(6.0), 0.70, 0.15, 366.0);
    right
        .step(to(2.0), 0.64, -0.04, 225.0)
        .bow(-0.22)
        .pivot((2.1, 2.9), 300.0)
        .step(to(4.0), 0.60, 0.0, 348.0);
    left.pitch(0.85, 4.0).pitch(1.3, 14.0).pitch(1.9, 14.0);
    right
        .pitch(2.15, 12.0)
        .pitch(2.9, 12.0)
        .pitch(4.45, 22.0)
        .pitch(4.9, 0.0)
        .pitch(5.4, 0.0);
    left.step(to(8.0), 0.88, 0.0, 372.0);
    right
        .step(to(9.0), 0.34, 0.0, 260.0)
        .pivot((9.1, 9.9), 170.0)
        .step(to(11.0), -0.14, 0.0, -6.0)
        .bow(0.18);
    left.step(to(10.0), 0.10, -0.04, 135.0)
        .bow(0.22)
        .pivot((10.1, 10.9), 60.0)
        .step(to(12.0), 0.14, 0.0, 12.0);
    right.pitch(8.85, 4.0).pitch(9.3, 14.0).pitch(9.9, 14.0);
    left.pitch(10.15, 12.0)
        .pitch(10.9, 12.0)
        .pitch(12.45, 22.0)
        .pitch(12.9, 0.0);
    right
        .step(to(14.0), -0.05, 0.16, -6.0)
        .step(to(16.0), -0.14, 0.0, -12.0);
}

/// Adds the keys (values at beats) for the heading, the weight and the hips in the spin move to
/// `dance`. Also adds a bounce on every beat.
fn hips(dance: &mut Choreography) {
    bounce(dance, 0.026);
    let turn = [
        (0.0, 0.0),
        (1.0, 82.0),
        (2.0, 212.0),
        (3.0, 345.0),
        (4.0, 360.0),
        (8.0, 360.0),
        (9.0, 278.0),
        (10.0, 148.0),
        (11.0, 15.0),
        (12.0, 0.0),
    ];
    dance
        .set(Part::Turn, &turn)
        .set(
            Part::Weight,
            &[
                (0.0, -0.5),
                (1.0, 0.6),
                (2.0, -0.6),
                (3.0, 0.6),
                (4.0, 0.75),
                (5.0, 0.0),
                (6.0, -0.75),
                (7.0, -0.5),
            ],
        )
        .set(
            Part::Weight,
            &[
                (8.0, 0.5),
                (9.0, -0.6),
                (10.0, 0.6),
                (11.0, -0.6),
                (12.0, -0.75),
                (13.0, 0.0),
                (14.0, 0.75),
                (15.0, 0.4),
            ],
        )
        .set(
            Part::Rise,
            &[
                (0.0, -0.02),
                (1.5, 0.0),
                (2.5, 0.0),
                (4.0, -0.03),
                (8.0, -0.02),
                (9.5, 0.0),
                (10.5, 0.0),
                (12.0, -0.03),
            ],
        )
        .set(
            Part::HipRoll,
            &[
                (4.0, 0.0),
                (5.0, 4.0),
                (6.0, -5.0),
                (7.0, 4.0),
                (8.0, 0.0),
                (12.0, 0.0),
                (13.0, -4.0),
                (14.0, 5.0),
                (15.0, -4.0),
            ],
        );
}

/// Adds the keys (values at beats) for the waist and the head in the spin move to `dance`.
fn torso(dance: &mut Choreography) {
    dance
        .set(
            Part::WaistYaw,
            &[
                (0.0, -20.0),
                (0.6, 14.0),
                (2.0, 10.0),
                (4.0, -8.0),
                (5.0, 10.0),
                (6.0, -12.0),
                (7.0, 12.0),
            ],
        )
        .set(
            Part::WaistYaw,
            &[
                (8.0, 20.0),
                (8.6, -14.0),
                (10.0, -10.0),
                (12.0, 8.0),
                (13.0, -10.0),
                (14.0, 12.0),
                (15.0, -12.0),
            ],
        )
        .set(
            Part::HeadYaw,
            &[
                (0.0, 0.0),
                (1.2, -48.0),
                (1.9, 44.0),
                (3.0, 10.0),
                (4.0, 0.0),
                (6.0, 10.0),
            ],
        )
        .set(
            Part::HeadYaw,
            &[
                (8.0, 0.0),
                (9.2, 48.0),
                (9.9, -44.0),
                (11.0, -10.0),
                (12.0, 0.0),
                (14.0, -10.0),
            ],
        );
}

/// Adds the poses of both arms in the spin move to `dance`.
fn arms(dance: &mut Choreography) {
    let wide = Arm::angles(10.0, 66.0, 16.0, 38.0);
    let drawn = |side| {
        Arm::reach(
            [-0.11, if side == Side::Left { -0.05 } else { -0.19 }, 0.27],
            [0.9, -0.4, 0.1],
        )
    };
    for (side, start) in [
        (Side::Left, 0.0),
        (Side::Right, 0.0),
        (Side::Left, 8.0),
        (Side::Right, 8.0),
    ] {
        let turning = [
            (start, READY),
            (start + 1.0, wide),
            (start + 1.7, drawn(side)),
            (start + 2.3, drawn(side)),
            (start + 3.0, wide),
            (start + 4.0, READY),
        ];
        dance.arm(side, &turning);
        let opens = (side == Side::Left) == (start < 4.0);
        let (odd, even) = if opens {
            (OPEN, CLOSED)
        } else {
            (CLOSED, OPEN)
        };
        dance.arm(
            side,
            &[(start + 5.0, odd), (start + 6.0, even), (start + 7.0, odd)],
        );
    }
}
