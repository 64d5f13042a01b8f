//! Foot lock: keeps planted feet in place during and after a blend, lets other feet step, and keeps
//! all feet above the floor.
//!
//! In: a motion before and after blending, and its foot contacts. Out: the pose with changed legs,
//! by two-bone inverse kinematics. Space: stage space. Thread: show. Allocates: only in `new`.
//!
//! At a splice each foot gets a path ([`FootPath`]): a foot that stands before and after it stays
//! where it is, and any other foot gets to its place in the new motion through the air. After its
//! path, a foot follows the clip.

use glam::{Quat, Vec3};

use crate::graph::ClipInfo;
use crate::motion::leg::{Leg, smooth};
use crate::motion::{Contact, FootPart, Pose, Skeleton};

pub use super::foot_path::{FootPath, Meeting};
pub use crate::motion::leg::Foot;

/// Number of feet of a dancer.
pub const FEET: usize = 2;
/// Number of frames between two contacts of a foot up to which both belong to one stance, because
/// a lock cannot fade out in between.
const SWING_FRAMES_MIN: f64 = 8.0;
/// Largest distance, in metres along the floor, at which a foot is locked: the distance between its
/// position in the sent pose and its position in the clip.
const LOCK_DISTANCE_MAX: f32 = 0.12;
/// Largest angle, in radians, at which a foot is locked: the angle between its heading in the
/// sent pose and its heading in the clip.
const TURN_MAX: f32 = 0.7;
/// Lowest allowed height of the sole of a foot above the floor, in metres; a sole that is lower is
/// raised to it.
const FLOOR: f32 = -0.003;
/// Distance by which the edge of the stage moves a foot relative to the hips at which the hips give
/// way fully, in metres.
const WARP_FULL: f32 = 0.05;
/// Fraction of a blend over which the correction of knees that bend backwards fades in at the start
/// of the blend, and fades out at its end.
const KNEE_GUARD_SHARE: f32 = 0.3;
/// Least depth of a sole below its lowest allowed height, in metres, at which the correction of
/// knees that bend backwards is fully active. A smaller depth activates it partly.
const KNEE_GUARD_HEIGHT: f32 = 0.04;

/// `[foot]`, left foot first: the path of the foot; `None` for a foot that follows the clip.
pub type FootPaths = [Option<FootPath>; FEET];

/// A time in which the heel or the toes of a foot stand, or one after the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stance {
    /// First and last frame of the clip in which the foot stands.
    pub frames: (f64, f64),
    /// First frame of the next stance of the foot; infinite if there is none.
    pub next: f64,
    /// `[part]`, heel first: true if the part stands at the frame that was asked for.
    pub parts: [bool; 2],
}

/// The input of `Feet::plant`, which corrects the feet of a blended pose.
#[derive(Clone, Copy, Debug)]
pub struct Planting<'a> {
    /// Frame of the clip that is danced at this time, with fractions.
    pub frame: f64,
    /// Paths of the feet in the part of the clip that is danced.
    pub paths: &'a FootPaths,
    /// `[foot]`: position and rotation of the foot in the clip without the blend, in stage space.
    pub clip: &'a [Foot; FEET],
    /// Progress of the blend from the previous motion, from 0 (its start) to 1 (its end).
    pub blended: f32,
}

/// The two legs of a skeleton, whose feet can be locked in place.
#[derive(Clone, Debug)]
pub struct Feet {
    /// Left and right leg; empty if the skeleton is not a humanoid with two legs.
    legs: Vec<Leg>,
    /// Largest distance of a point of a foot from the root, in metres.
    reach: f32,
}

impl Feet {
    /// Finds the legs of `skeleton`. For a skeleton without two humanoid legs the result has no
    /// legs, and no foot is ever locked.
    pub fn new(skeleton: &Skeleton) -> Self {
        let legs = Leg::both(skeleton);
        let length = |leg: &Leg| -> f32 {
            let up = |&joint: &usize| skeleton.joints[joint].parent;
            let chain = std::iter::successors(Some(leg.joints[2]), up);
            let bones = chain.filter(|&joint| skeleton.joints[joint].parent.is_some());
            bones
                .map(|joint| skeleton.joints[joint].offset.length())
                .sum::<f32>()
                + leg.toe.length()
        };
        Self {
            reach: legs.iter().map(length).fold(0.0, f32::max),
            legs,
        }
    }

    /// Returns the largest distance of a point of a foot from the root, in metres.
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// Returns the indices in the skeleton of the left and the right ankle joint; empty if the
    /// skeleton has no humanoid legs.
    pub fn ankles(&self) -> Vec<usize> {
        self.legs.iter().map(|leg| leg.joints[2]).collect()
    }

    /// Returns the position and rotation in stage space of the left and the right foot of `pose`.
    pub fn of(&self, skeleton: &Skeleton, pose: &Pose) -> [Foot; FEET] {
        let mut feet = [Foot {
            place: Vec3::ZERO,
            turn: Quat::IDENTITY,
        }; FEET];
        for (foot, leg) in feet.iter_mut().zip(&self.legs) {
            let leg_pose = leg.pose_of(skeleton, pose);
            *foot = Foot {
                place: leg_pose.places[2],
                turn: leg_pose.turns[2],
            };
        }
        feet
    }

    /// Returns the point of a foot on which it stands, in the space of the ankle. `parts` says
    /// whether heel and toes stand; if both or neither stands, it is the middle.
    pub fn standing_point(&self, foot: usize, parts: [bool; 2]) -> Vec3 {
        let toe = self.legs.get(foot).map_or(Vec3::ZERO, |leg| leg.toe);
        match parts {
            [true, false] => Vec3::ZERO,
            [false, true] => toe,
            _ => 0.5 * toe,
        }
    }

    /// Returns, for each foot, its stance (time in which it stands) at `frame` of `clip` or, without
    /// one, the next stance; `None` if there is no later one.
    pub fn stances(&self, clip: &ClipInfo, frame: f64) -> [Option<Stance>; FEET] {
        let mut found = [None; FEET];
        for (found, leg) in found.iter_mut().zip(&self.legs) {
            let contacts = || {
                let mine = |it: &&Contact| usize::from(it.joint) == leg.joints[2];
                clip.contacts.iter().filter(mine)
            };
            *found = stance(contacts, frame);
        }
        found
    }

    /// Returns, for each foot, the first and the last frame of its stance, as in
    /// [`Feet::stances`].
    pub fn contacts(&self, clip: &ClipInfo, frame: f64) -> [Option<(f64, f64)>; FEET] {
        self.stances(clip, frame)
            .map(|stance| stance.map(|stance| stance.frames))
    }

    /// Returns true if a foot that stands can keep its place: in the sent pose, it is near enough
    /// to its place and its heading in the clip.
    pub fn may_lock(meeting: &Meeting, at: Vec3) -> bool {
        meeting.away(at).length() <= LOCK_DISTANCE_MAX && Self::may_turn(meeting)
    }

    /// Returns true if a foot that stands can keep its heading.
    pub fn may_turn(meeting: &Meeting) -> bool {
        meeting.turn_angle() <= TURN_MAX
    }

    /// Moves locked feet of `pose` to their places, and raises feet that are below the floor. Also
    /// corrects knees that a blend would bend backwards.
    pub fn plant(&self, skeleton: &Skeleton, planting: &Planting, pose: &mut Pose) {
        let &Planting {
            frame,
            paths,
            clip,
            blended,
        } = planting;
        let in_blend = smooth(blended.min(1.0 - blended) / KNEE_GUARD_SHARE);
        let mut drop = 0.0_f32;
        let targets: [Option<Foot>; FEET] = std::array::from_fn(|i| {
            let path = paths[i].filter(|path| path.share(frame) > 0.0)?;
            let leg = self.legs.get(i)?;
            let leg_pose = leg.pose_of(skeleton, pose);
            let target = leg_pose.near(path.foot(frame, &clip[i], &leg_pose.foot()));
            drop = drop.max(path.strain(frame) * leg.drop_for(&leg_pose, target.place));
            Some(target)
        });
        pose.root.y -= drop;
        for (i, leg) in self.legs.iter().enumerate() {
            let leg_pose = leg.pose_of(skeleton, pose);
            let mut foot = targets[i].unwrap_or(Foot {
                place: leg_pose.places[2] + Vec3::Y * drop,
                turn: leg_pose.turns[2],
            });
            let sole = foot.place.y + leg.lowest(skeleton, pose, foot.turn);
            let sunk = (FLOOR - sole).max(0.0);
            foot.place.y += sunk;
            let strain = paths[i].map_or(0.0, |path| path.strain(frame));
            let led = in_blend.max(strain).max(smooth(sunk / KNEE_GUARD_HEIGHT));
            if led > 0.0 || drop > 0.0 || targets[i].is_some() {
                leg.reach(&leg_pose, foot, led, pose);
            }
        }
    }
}

impl Feet {
    /// Moves the root and the feet of `pose` to the places that `warp` returns for them. A foot
    /// that stands also stands afterwards.
    pub fn warp(&self, skeleton: &Skeleton, warp: impl Fn(Vec3) -> Vec3, pose: &mut Pose) {
        let feet = self.of(skeleton, pose);
        let root = warp(pose.root);
        let moved = root - pose.root;
        pose.root = root;
        let mut drop = 0.0_f32;
        let targets: [Option<Foot>; FEET] = std::array::from_fn(|i| {
            let (leg, foot) = (self.legs.get(i)?, feet[i]);
            let middle = foot.point(0.5 * leg.toe);
            let place = foot.place + warp(middle) - middle;
            let pulled = smooth((place - foot.place - moved).length() / WARP_FULL);
            let leg_pose = leg.pose_of(skeleton, pose);
            drop = drop.max(pulled * leg.drop_for(&leg_pose, place));
            (pulled > 0.0).then_some(Foot { place, ..foot })
        });
        if targets == [None; FEET] {
            return;
        }
        pose.root.y -= drop;
        for (leg, (target, foot)) in self.legs.iter().zip(targets.into_iter().zip(feet)) {
            let place = foot.place + moved;
            let leg_pose = leg.pose_of(skeleton, pose);
            leg.reach(
                &leg_pose,
                target.unwrap_or(Foot { place, ..foot }),
                0.0,
                pose,
            );
        }
    }
}

/// Returns the stance at `frame`, or the next one, of a foot with `contacts`, which are sorted by
/// part and then by time.
fn stance<'a, I>(contacts: impl Fn() -> I, frame: f64) -> Option<Stance>
where
    I: Iterator<Item = &'a Contact>,
{
    let span = |it: &Contact| (f64::from(it.first), f64::from(it.last));
    let later = contacts().map(span).filter(|it| it.1 > frame);
    let mut frames = later.min_by(|a, b| a.0.total_cmp(&b.0))?;
    // Heel and toes overlap; each round adds the contacts that begin in the stance.
    loop {
        let joined = contacts()
            .map(span)
            .filter(|it| it.0 < frames.1 + SWING_FRAMES_MIN && it.1 + SWING_FRAMES_MIN > frames.0);
        let whole = joined.fold(frames, |all, it| (all.0.min(it.0), all.1.max(it.1)));
        if whole == frames {
            break;
        }
        frames = whole;
    }
    let after = contacts().map(|it| f64::from(it.first));
    let stands =
        |part| contacts().any(|it| it.part == part && span(it).0 <= frame && frame <= span(it).1);
    Some(Stance {
        frames,
        next: after
            .filter(|&it| it > frames.1)
            .fold(f64::INFINITY, f64::min),
        parts: [stands(FootPart::Heel), stands(FootPart::Toe)],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maths;
    use crate::motion::Joint;

    /// Returns a skeleton of hips with two legs of 0.9 m, and a pose of it.
    fn legs_fixture() -> (Skeleton, Pose) {
        let joint = |name: &str, parent, offset: Vec3| Joint {
            name: name.into(),
            parent,
            offset,
            ends: Vec::new(),
        };
        let mut joints = vec![joint("Hips", None, Vec3::ZERO)];
        for (side, x) in [("Left", 0.1), ("Right", -0.1)] {
            let hips = joints.len();
            joints.push(joint(&format!("{side}UpLeg"), Some(0), Vec3::X * x));
            joints.push(joint(&format!("{side}Leg"), Some(hips), Vec3::NEG_Y * 0.45));
            joints.push(joint(
                &format!("{side}Foot"),
                Some(hips + 1),
                Vec3::NEG_Y * 0.45,
            ));
        }
        let mut pose = Pose::rest(joints.len());
        pose.root.y = 0.8;
        // The knees are bent so that the ankles are 0.015 m above the floor.
        for hip in [1, 4] {
            let bend = maths::acos(0.785_f32 / 0.9);
            pose.rotations[hip] = Quat::from_rotation_x(-bend);
            pose.rotations[hip + 1] = Quat::from_rotation_x(2.0 * bend);
            pose.rotations[hip + 2] = Quat::from_rotation_x(-bend);
        }
        (Skeleton { joints }, pose)
    }

    #[test]
    fn a_foot_below_the_floor_is_lifted() {
        let (skeleton, mut pose) = legs_fixture();
        pose.root.y -= 0.1;
        let feet = Feet::new(&skeleton);
        let clip = feet.of(&skeleton, &pose);
        let planting = Planting {
            frame: 0.0,
            paths: &FootPaths::default(),
            clip: &clip,
            blended: 1.0,
        };
        feet.plant(&skeleton, &planting, &mut pose);
        let lifted = feet.of(&skeleton, &pose);
        assert!(
            (lifted[0].place.y - FLOOR).abs() < 1e-3
                && (lifted[0].place.x - clip[0].place.x).abs() < 1e-3,
            "{lifted:?}"
        );
    }
}
