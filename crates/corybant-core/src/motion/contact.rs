//! Detects foot contacts in a clip.
//!
//! In: a cleaned clip.
//! Out: the intervals in which each foot stands on the floor, so that the dancer can keep it in
//! place.
//! Thread: any.
//! Allocates: freely.
//! Source: Lee et al., "Interactive Control of Avatars Animated with Human Motion Data", 2002.
//!
//! The heel and the toes of a foot have separate contacts, because a foot rolls: the heel lands
//! before the toes and lifts before them. A part of a foot stands while one of its points is near
//! the floor and almost still. Two speed thresholds (a hysteresis) prevent noise from ending a
//! contact.

use super::humanoid::{Bone, Humanoid};
use super::{Clip, Skeleton};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// The part of a foot that stands on the floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum FootPart {
    /// The ankle joint of a humanoid, which stands above the heel, or the whole foot of another
    /// body.
    Heel,
    /// The toes: the toe joint and what is below it or, in a skeleton without toe joints, the tips
    /// of the foot.
    Toe,
}

/// A time during which the heel or the toes of one foot stand on the floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Contact {
    /// Index of the joint that is the foot: the ankle of a humanoid, or an end joint of another
    /// body.
    pub joint: u16,
    /// The part of the foot that stands.
    pub part: FootPart,
    /// Index of the first frame of the contact in its clip.
    pub first: u32,
    /// Index of the last frame of the contact in its clip; this frame still belongs to the contact.
    pub last: u32,
}

/// Greatest height at which a point of a foot counts as near the floor, as a fraction of the body's
/// height. It is measured from the lowest height of this point in the clip, or from the floor if
/// the floor is higher.
const NEAR_SHARE: f32 = 0.03;
/// Greatest speed at which a contact starts (the foot begins to stand), in body heights per second.
/// The speed is that along the floor, of the slowest point near the floor.
const PLANTED_SPEED: f32 = 0.17;
/// Speed above which a contact ends (the foot no longer stands), in body heights per second. The
/// speed is that along the floor, of the slowest point near the floor.
const LIFTED_SPEED: f32 = 0.25;
/// Duration of the shortest contact (time in which a foot stands) that is kept, in seconds; shorter
/// contacts are dropped.
const CONTACT_S_MIN: f64 = 0.1;
/// Longest time between two contacts of one foot for which the two are merged into one contact, in
/// seconds.
const GAP_S_MAX: f64 = 0.05;
/// Half the width of the time window over which the speed of a point is measured, in seconds.
const SPEED_S: f64 = 1.0 / 30.0;
/// Greatest height of a foot above the floor, in a body without human feet, as a fraction of the
/// body's height. A joint without children is a foot if its lowest height in the clip is at most
/// this.
const FOOT_SHARE: f32 = 0.05;
/// Fraction of the clip's frames that are ignored before the lowest height of a point is
/// determined. They are the frames in which the point is lowest, which may be outliers.
const LOWEST_SHARE: f32 = 0.05;

/// Returns all contacts (times in which a foot stands on the floor) in `clip`, sorted by the index
/// of the joint of the foot, then by its part and then by time.
pub fn contacts(clip: &Clip) -> Vec<Contact> {
    if clip.frames() < 2 {
        return Vec::new();
    }
    let height = clip.skeleton.rest_height();
    let mut found = Vec::new();
    for (joint, part, points) in feet(clip) {
        let tracks: Vec<Track> = points.iter().map(|&point| Track::of(clip, point)).collect();
        found.extend(
            planted(clip, height, &tracks)
                .into_iter()
                .map(|(first, last)| Contact {
                    joint,
                    part,
                    first,
                    last,
                }),
        );
    }
    found.sort_by_key(|contact| (contact.joint, contact.part, contact.first));
    found
}

/// A point that is fixed to a joint: index of the joint, and position of the point in the joint's
/// space.
pub type Point = (usize, Vec3);

/// Returns the parts of the feet, each as the index of the joint of the foot, the part and its
/// points that may touch the floor. The feet are the ankles of a humanoid, or the end joints near
/// the floor of any other body, whose feet have no toes.
fn feet(clip: &Clip) -> Vec<(u16, FootPart, Vec<Point>)> {
    let humanoid = Humanoid::new(&clip.skeleton);
    let joint = |bone| Some(humanoid.bones[humanoid.find(bone)?].joint);
    let sides = [
        (Bone::LeftFoot, Bone::LeftToes),
        (Bone::RightFoot, Bone::RightToes),
    ];
    let mut feet = Vec::new();
    for (foot, toes) in sides {
        let Some(ankle) = joint(foot) else { continue };
        let mut toes = match joint(toes) {
            Some(toes) => below(&clip.skeleton, toes),
            None => below(&clip.skeleton, ankle),
        };
        toes.retain(|&point| point != (ankle, Vec3::ZERO));
        feet.push((ankle as u16, FootPart::Heel, vec![(ankle, Vec3::ZERO)]));
        if !toes.is_empty() {
            feet.push((ankle as u16, FootPart::Toe, toes));
        }
    }
    if !feet.is_empty() {
        return feet;
    }
    let floor = FOOT_SHARE * clip.skeleton.rest_height();
    let tips = (1..clip.skeleton.len()).filter(|&joint| {
        !clip
            .skeleton
            .joints
            .iter()
            .any(|other| other.parent == Some(joint))
    });
    let low = |point: &Point| Track::of(clip, *point).lowest <= floor;
    tips.map(|tip| (tip as u16, FootPart::Heel, below(&clip.skeleton, tip)))
        .filter(|(_, _, points)| points.iter().any(low))
        .collect()
}

/// Returns the points that move with `joint`: the joint itself, its descendants, and all their end
/// sites.
pub fn below(skeleton: &Skeleton, joint: usize) -> Vec<Point> {
    let mut inside = vec![false; skeleton.len()];
    inside[joint] = true;
    let mut points = Vec::new();
    for (i, it) in skeleton.joints.iter().enumerate().skip(joint) {
        inside[i] |= it.parent.is_some_and(|parent| inside[parent]);
        if inside[i] {
            points.push((i, Vec3::ZERO));
            points.extend(it.ends.iter().map(|&end| (i, end)));
        }
    }
    points
}

/// The path of one point through a clip.
struct Track {
    /// `[frame]`: position of the point in model space, in metres.
    places: Vec<Vec3>,
    /// The lowest height of the point in the clip, in metres; the lowest 5 % of the frames are
    /// ignored as outliers.
    lowest: f32,
}

impl Track {
    fn of(clip: &Clip, (joint, place): Point) -> Self {
        let mut chain = vec![joint];
        while let Some(parent) = chain
            .last()
            .and_then(|&last| clip.skeleton.joints[last].parent)
        {
            chain.push(parent);
        }
        let at = |frame: usize| {
            let local = clip.rotations_at(frame);
            // From the joint up to the root: each rotation applies to all points below its joint.
            let carried = chain.iter().fold((place, Vec3::ZERO), |(below, _), &i| {
                let turned = local[i] * below;
                (clip.skeleton.joints[i].offset + turned, turned)
            });
            clip.roots[frame] + carried.1
        };
        let places: Vec<Vec3> = (0..clip.frames()).map(at).collect();
        let mut heights: Vec<f32> = places.iter().map(|place| place.y).collect();
        let rank = (LOWEST_SHARE * (heights.len() - 1) as f32) as usize;
        let (_, lowest, _) = heights.select_nth_unstable_by(rank, f32::total_cmp);
        let lowest = *lowest;
        Self { places, lowest }
    }

    /// Returns the speed along the floor at `frame`, in metres per second.
    fn speed(&self, frame: usize, reach: usize, fps: f64) -> f32 {
        let (before, after) = (
            frame.saturating_sub(reach),
            (frame + reach).min(self.places.len() - 1),
        );
        let way = (self.places[after] - self.places[before]) * Vec3::new(1.0, 0.0, 1.0);
        way.length() * fps as f32 / (after - before) as f32
    }
}

/// Returns the contacts (times in which the foot stands), each as the indices of its first and last
/// frame. `tracks` are the paths of the points of this part of the foot, and `height` is the height of the body
/// in metres.
fn planted(clip: &Clip, height: f32, tracks: &[Track]) -> Vec<(u32, u32)> {
    let reach = ((SPEED_S * clip.fps).round() as usize).max(1);
    let slowest = |frame: usize| {
        let low = tracks
            .iter()
            .filter(|track| track.places[frame].y <= track.lowest.max(0.0) + NEAR_SHARE * height);
        low.map(|track| track.speed(frame, reach, clip.fps))
            .fold(f32::INFINITY, f32::min)
    };
    let mut stretches: Vec<(u32, u32)> = Vec::new();
    let mut stands = false;
    for frame in 0..clip.frames() {
        let limit = if stands { LIFTED_SPEED } else { PLANTED_SPEED };
        let before = std::mem::replace(&mut stands, slowest(frame) <= limit * height);
        match stretches.last_mut() {
            Some(last) if stands && before => last.1 = frame as u32,
            Some(last) if stands && f64::from(frame as u32 - last.1) <= GAP_S_MAX * clip.fps => {
                last.1 = frame as u32
            }
            _ if stands => stretches.push((frame as u32, frame as u32)),
            _ => {}
        }
    }
    stretches.retain(|(first, last)| f64::from(last - first) >= CONTACT_S_MIN * clip.fps);
    stretches
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{Joint, MOTION_FPS};
    use glam::Quat;

    /// Returns a clip of two stiff legs of 0.9 m with joints called `names`. The left leg is lifted
    /// sideways in the frames for which `lifted` returns true.
    fn stepping(names: [&str; 2], lifted: impl Fn(usize) -> bool) -> Clip {
        let leg = |name: &str, x: f32| {
            [
                (name.to_string(), Some(0), Vec3::new(x, 0.0, 0.0)),
                (format!("{name}Foot"), None, Vec3::NEG_Y * 0.9),
            ]
        };
        let mut joints = vec![Joint {
            name: "Hips".into(),
            parent: None,
            offset: Vec3::ZERO,
            ends: vec![Vec3::Y * 0.8],
        }];
        for (side, x) in names.into_iter().zip([0.1, -0.1]) {
            for (name, parent, offset) in leg(side, x) {
                let parent = parent.or(Some(joints.len() - 1));
                joints.push(Joint {
                    name,
                    parent,
                    offset,
                    ends: Vec::new(),
                });
            }
        }
        let mut angle: f32 = 0.0;
        let mut rotations = Vec::new();
        for frame in 0..120 {
            angle = if lifted(frame) {
                (angle + 0.1).min(0.8)
            } else {
                (angle - 0.1).max(0.0)
            };
            rotations.extend([
                Quat::IDENTITY,
                Quat::from_rotation_z(angle),
                Quat::IDENTITY,
                Quat::IDENTITY,
                Quat::IDENTITY,
            ]);
        }
        Clip {
            name: "step".into(),
            label: None,
            idle: false,
            on_request: false,
            fps: MOTION_FPS,
            skeleton: Skeleton { joints },
            roots: vec![Vec3::Y * 0.9; 120],
            rotations,
            sliding: Vec::new(),
        }
    }

    #[test]
    fn a_lifted_foot_has_a_contact_before_and_after() {
        for names in [["LeftLeg", "RightLeg"], ["fore", "hind"]] {
            let clip = stepping(names, |frame| (40..70).contains(&frame));
            let found = contacts(&clip);
            let of = |joint: u16| {
                found
                    .iter()
                    .filter(|contact| contact.joint == joint)
                    .map(|it| (it.first, it.last))
                    .collect::<Vec<_>>()
            };
            assert_eq!(
                of(4),
                [(0, 119)],
                "the other foot has one contact over all frames"
            );
            let [(0, lift), (land, 119)] = of(2)[..] else {
                panic!("{found:?}")
            };
            assert!(
                (36..=42).contains(&lift) && (75..=81).contains(&land),
                "{found:?}"
            );
        }
    }

    #[test]
    fn sliding_and_hanging_feet_have_no_contact() {
        let mut sliding = stepping(["LeftLeg", "RightLeg"], |_| false);
        (0..120).for_each(|frame| sliding.roots[frame].x = frame as f32 * 0.02);
        assert_eq!(contacts(&sliding), []);
        let mut one = stepping(["LeftLeg", "RightLeg"], |_| false);
        one.roots.truncate(1);
        one.rotations.truncate(5);
        assert_eq!(contacts(&one), []);
    }
}
