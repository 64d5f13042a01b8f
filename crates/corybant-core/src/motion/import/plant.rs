//! Plants feet: removes the creeping of standing heels and toes from a clip.
//!
//! In: a cleaned clip and its foot contacts.
//! Out: the clip, in which heels and toes stand still during their contacts.
//! Thread: any.
//! Allocates: freely.
//! Source: compare Kovar et al., "Footskate Cleanup for Motion Capture Editing", 2002.
//!
//! A heel or toe that creeps is moved to its mean place of the contact; one that stands still for
//! half of its contact is moved to where it stands. The correction changes smoothly between two
//! contacts. Heel and toes are corrected by a shift and a turn of the foot about a vertical axis;
//! the leg follows by inverse kinematics. A heel or toe that moves farther during its contact does
//! so on purpose, as in a twist, and is not corrected.

use glam::{Quat, Vec3};

use crate::maths;
use crate::motion::leg::{Foot, Leg, smooth};
use crate::motion::{Clip, Contact, FootPart, Pose};

/// Largest distance of a creeping point from its mean place that is corrected, in metres.
const CREEP_MAX: f32 = 0.045;
/// Distance that a point moves at most in the half of a contact in which it stands still, in
/// metres.
const STILL_M: f32 = 0.002;
/// Longest time before and after a contact in which its correction fades, in frames.
const FADE_FRAMES: usize = 15;
/// Half the width of the window over which corrections are smoothed, in frames.
const SMOOTH_FRAMES: usize = 2;
/// Weight of a part of the foot that does not stand, compared with one that stands.
const FREE_WEIGHT: f32 = 0.05;
/// Height above its lowest height in a contact from which on a part of the foot does not stand, in
/// metres. A heel rises by some centimetres before its contact ends.
const RISEN: f32 = 0.012;
/// Largest turn of a foot, in radians.
const TURN_MAX: f32 = 0.3;
/// Correction below which a frame is not changed, and from which on the knee is fully guarded, in
/// metres.
const CORRECTION: (f32, f32) = (2e-4, 0.01);

/// Moves the feet of `clip` so that heels and toes stand still during `contacts`. A clip without
/// humanoid legs does not change.
pub fn plant(clip: &mut Clip, contacts: &[Contact]) {
    for leg in Leg::both(&clip.skeleton) {
        let of = |part| {
            let mine = |it: &&Contact| usize::from(it.joint) == leg.joints[2] && it.part == part;
            contacts.iter().filter(mine).copied().collect::<Vec<_>>()
        };
        plant_foot(clip, &leg, [of(FootPart::Heel), of(FootPart::Toe)]);
    }
}

/// Plants one foot. `contacts` are those of its heel and of its toes.
fn plant_foot(clip: &mut Clip, leg: &Leg, contacts: [Vec<Contact>; 2]) {
    let feet: Vec<Foot> = (0..clip.frames())
        .map(|frame| {
            let leg_pose = leg.pose_of(&clip.skeleton, &clip.pose(frame));
            Foot {
                place: leg_pose.places[2],
                turn: leg_pose.turns[2],
            }
        })
        .collect();
    let parts = [Vec3::ZERO, leg.toe];
    let parts: [Part; 2] = std::array::from_fn(|i| Part::of(&feet, parts[i], &contacts[i]));
    for (frame, foot) in feet.iter().enumerate() {
        let target = corrected(foot, leg.toe, &parts, frame);
        let far = [Vec3::ZERO, leg.toe]
            .map(|at| target.point(at).distance(foot.point(at)))
            .into_iter()
            .fold(0.0, f32::max);
        if far > CORRECTION.0 {
            reach(clip, leg, frame, target, smooth(far / CORRECTION.1));
        }
    }
}

/// The correction of the heel or the toes of one foot.
struct Part {
    /// `[frame]`: shift of the part along the floor, in metres.
    shifts: Vec<Vec3>,
    /// `[frame]`: weight of the part, 1 while it stands.
    weights: Vec<f32>,
}

impl Part {
    /// Returns the correction of the point `at` of the foot, given in the space of the ankle.
    fn of(feet: &[Foot], at: Vec3, contacts: &[Contact]) -> Self {
        let mut known: Vec<Option<Vec3>> = vec![None; feet.len()];
        let mut weights = vec![FREE_WEIGHT; feet.len()];
        for contact in contacts {
            let frames = contact.first as usize..=contact.last as usize;
            let height = |frame: usize| feet[frame].point(at).y;
            let lowest = frames.clone().map(height).fold(f32::INFINITY, f32::min);
            let stands = |frame: usize| 1.0 - smooth((height(frame) - lowest) / RISEN);
            let place = |frame: usize| feet[frame].point(at) * Vec3::new(1.0, 0.0, 1.0);
            let low = frames.filter(|&frame| stands(frame) > 0.0);
            let places: Vec<Vec3> = low.clone().map(place).collect();
            let anchor = anchor_of(&places);
            for frame in low {
                known[frame] = Some(anchor.map_or(Vec3::ZERO, |anchor| anchor - place(frame)));
                weights[frame] = FREE_WEIGHT.max(stands(frame));
            }
        }
        let shifts = filled(feet.len(), |frame| known[frame]);
        Self {
            shifts: smoothed(&shifts),
            weights: smoothed(&weights),
        }
    }
}

/// Returns the place to which a point of a foot is moved that has the places `places` in a contact:
/// where it stands still for half of the contact, or else its mean place. `None` if the point moves
/// on purpose.
fn anchor_of(places: &[Vec3]) -> Option<Vec3> {
    let half = places.len() / 2;
    let stays = |from: &usize| places[*from].distance(places[from + half]) <= STILL_M;
    let still = (0..places.len() - half).find(stays);
    let mean = || places.iter().sum::<Vec3>() / places.len() as f32;
    let anchor = still.map_or_else(mean, |from| places[from + half / 2]);
    let far = places.iter().map(|place| place.distance(anchor));
    (far.fold(0.0, f32::max) <= CREEP_MAX).then_some(anchor)
}

/// Returns a value for each of `frames`: the known ones, and between them smooth transitions, which
/// fade to zero in a long gap.
fn filled(frames: usize, known: impl Fn(usize) -> Option<Vec3>) -> Vec<Vec3> {
    let mut values: Vec<Vec3> = (0..frames)
        .map(|it| known(it).unwrap_or_default())
        .collect();
    let mut before: Option<usize> = None;
    for frame in (0..=frames).filter(|&it| it == frames || known(it).is_some()) {
        let first = before.map_or(0, |before| before + 1);
        let next = (frame < frames).then_some(frame);
        let [from, to] = [before, next].map(|it| it.map(|it| values[it]));
        let gap = before.zip(next).map_or(usize::MAX, |(a, b)| b - a);
        let fade = gap.min(FADE_FRAMES) as f32;
        for (at, value) in values.iter_mut().enumerate().take(frame).skip(first) {
            let since = before.map_or(f32::INFINITY, |before| (at - before) as f32);
            let left = from.unwrap_or_default() * (1.0 - smooth(since / fade));
            let until = (frame - at) as f32;
            *value = left + to.unwrap_or_default() * (1.0 - smooth(until / fade));
        }
        before = next;
    }
    values
}

/// Returns the means of `values` over a window of a few frames.
fn smoothed<T>(values: &[T]) -> Vec<T>
where
    T: Copy + std::iter::Sum + std::ops::Div<f32, Output = T>,
{
    let window = |frame: usize| {
        let reach = SMOOTH_FRAMES.min(frame).min(values.len() - 1 - frame);
        let window = &values[frame - reach..=frame + reach];
        window.iter().copied().sum::<T>() / window.len() as f32
    };
    (0..values.len()).map(window).collect()
}

/// Returns the foot `foot` with the corrections of its heel and its toes at `frame`. `toe` is the
/// place of the toes in the space of the ankle.
fn corrected(foot: &Foot, toe: Vec3, parts: &[Part; 2], frame: usize) -> Foot {
    let [heel_shift, toe_shift] = [0, 1].map(|part| parts[part].shifts[frame]);
    let [heel_weight, toe_weight] = [0, 1].map(|part| parts[part].weights[frame]);
    let along = foot.turn * toe;
    let wanted = along + toe_shift - heel_shift;
    let angle = |v: Vec3| maths::atan2(v.x, v.z);
    let level = maths::hypot(along.x, along.z);
    let mut turn = angle(wanted) - angle(along);
    if turn.abs() > std::f32::consts::PI {
        turn -= std::f32::consts::TAU * turn.signum();
    }
    // A foot that points up or down has no direction along the floor.
    let sure = smooth(level / (0.5 * toe.length()).max(1e-3));
    let turn = Quat::from_rotation_y(turn.clamp(-TURN_MAX, TURN_MAX) * sure);
    let by_toes = foot.place + along + toe_shift - turn * along;
    let by_heel = foot.place + heel_shift;
    let share = if toe == Vec3::ZERO {
        0.0
    } else {
        toe_weight / (heel_weight + toe_weight)
    };
    Foot {
        place: by_heel.lerp(by_toes, share),
        turn: turn * foot.turn,
    }
}

/// Moves the foot of `leg` to `target` in one frame of `clip`. `led` is the strength with which a
/// knee that bends backwards is corrected.
fn reach(clip: &mut Clip, leg: &Leg, frame: usize, target: Foot, led: f32) {
    let mut pose: Pose = clip.pose(frame);
    let leg_pose = leg.pose_of(&clip.skeleton, &pose);
    leg.reach(&leg_pose, target, led, &mut pose);
    let joints = clip.skeleton.len();
    for joint in leg.joints {
        let turn = pose.rotations[joint];
        let before = clip.rotations[frame.saturating_sub(1) * joints + joint];
        let near = turn.dot(before) >= 0.0;
        clip.rotations[frame * joints + joint] = if near { turn } else { -turn };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_creeping_points_are_moved() {
        let places = |speed: f32| -> Vec<Vec3> {
            (0..40)
                .map(|frame| Vec3::X * speed * frame as f32)
                .collect()
        };
        let creeping = anchor_of(&places(0.001)).unwrap();
        assert!(creeping.distance(Vec3::X * 0.0195) < 1e-5, "{creeping}");
        let mut landing = places(0.0);
        landing[0] = Vec3::X * 0.01;
        assert_eq!(anchor_of(&landing), Some(Vec3::ZERO), "a point that lands");
        assert_eq!(anchor_of(&places(0.004)), None, "a point that is moved");
    }

    #[test]
    fn a_gap_between_two_corrections_is_filled_smoothly() {
        let known = |frame: usize| match frame {
            20..=30 => Some(Vec3::X),
            36..=40 => Some(Vec3::Z),
            _ => None,
        };
        let filled = filled(80, known);
        assert_eq!(
            (filled[0], filled[25], filled[38]),
            (Vec3::ZERO, Vec3::X, Vec3::Z)
        );
        assert!(filled[33].distance(Vec3::new(0.5, 0.0, 0.5)) < 1e-6);
        assert_eq!(filled[60], Vec3::ZERO);
        let steps = filled.windows(2).map(|it| it[0].distance(it[1]));
        assert!(steps.fold(0.0, f32::max) < 0.45);
    }
}
