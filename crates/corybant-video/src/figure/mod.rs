//! Creates a visible body for any skeleton.
//!
//! In: a skeleton, then joint positions.
//! Out: the numbers with which the shader draws each limb.
//! Thread: any except show and audio.
//! Allocates: in `new` only.
//!
//! A body consists of limbs with an elliptic cross-section and round ends. If the joint names are
//! known, limbs are as thick as those of a human; otherwise the thickness follows from the length
//! of the bone.

mod human;

use glam::Vec3;

use crate::pose_track::Joints;
use corybant_core::motion::Skeleton;
use corybant_core::motion::humanoid::Humanoid;

/// Radius of the thicker end of a limb whose bone has no known name, as a fraction of the length of
/// the bone.
const THICKNESS: f32 = 0.14;
/// Smallest radius of the thicker end of a limb whose bone has no known name, as a fraction of the
/// body's height.
const THICKNESS_MIN: f32 = 0.006;
/// Greatest radius of the thicker end of a limb whose bone has no known name, as a fraction of the
/// body's height.
const THICKNESS_MAX: f32 = 0.05;

/// A point that moves with the body: a point on the straight line between two joints, plus an
/// offset in the space of the first joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub from: usize,
    pub to: usize,
    /// Position on the straight line between two joints: 0 at the joint `from`, 1 at the joint
    /// `to`.
    pub part: f32,
    /// Offset of the point from the straight line between the joints, in the space of the joint
    /// `from`, in metres.
    pub offset: Vec3,
}

impl Place {
    pub fn at(joint: usize) -> Self {
        Self {
            from: joint,
            to: joint,
            part: 0.0,
            offset: Vec3::ZERO,
        }
    }

    pub fn moved(self, offset: Vec3) -> Self {
        Self {
            offset: self.offset + offset,
            ..self
        }
    }

    fn place(&self, joints: &Joints) -> Vec3 {
        let (from, to) = (joints.positions[self.from], joints.positions[self.to]);
        from.lerp(to, self.part) + joints.rotations[self.from] * self.offset
    }
}

/// Half width and half depth of the elliptic cross-section of a limb, in metres.
pub(super) type Girth = [f32; 2];

/// One of a dancer's three colours: of the body (trunk, arms and legs), of the trim (neck, head,
/// hands and shoes) and of the visor in front of the face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tint {
    Body,
    Trim,
    Dark,
}

/// A limb with round ends, drawn through two or more stations. A station is a point on the body
/// with the half width and half depth of the limb there.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Limb {
    pub stations: Vec<(Place, Girth)>,
    /// Direction in which the width of the limb's cross-sections is measured, as a unit vector in
    /// the space of a joint: at each cross-section, the joint `from` of the [`Place`] there.
    pub side: Vec3,
    pub tint: Tint,
}

/// The visible body of a dancer: its limbs and its height.
pub struct Figure {
    limbs: Vec<Limb>,
    /// Indices of the joints that darken the floor near them (ambient occlusion), the most
    /// important joint first.
    grounded: Vec<usize>,
    /// Height of the body in the rest pose, in metres.
    pub height: f32,
}

/// A dancer's three colours: of the body (trunk, arms and legs), of the trim (neck, head, hands and
/// shoes) and of the visor in front of the face. Each is linear red, green and blue, 0..1.
pub type Palette = [[f32; 3]; 3];

/// Number of floats that the shader reads for one segment of a limb: 12 for each end, and 4 for the
/// colour. Each end has a position, half width, direction of the limb, half depth, direction in
/// which the width is measured, and slope of the surface.
pub const FLOATS_PER_LIMB: usize = 2 * FLOATS_PER_END + 4;
/// Number of floats for one end of a limb segment.
const FLOATS_PER_END: usize = 12;

impl Figure {
    /// Creates the visible body for `skeleton`.
    pub fn new(skeleton: &Skeleton) -> Self {
        let height = skeleton.rest_height().max(0.01);
        let humanoid = Humanoid::new(skeleton);
        let known = human::limbs(skeleton, &humanoid, height);
        let (limbs, grounded) = known.unwrap_or_else(|| {
            (
                bones(skeleton, height),
                (0..skeleton.len().min(4)).rev().collect(),
            )
        });
        Self {
            limbs,
            grounded,
            height,
        }
    }

    /// Appends the shader's numbers for this body to `into`: [`FLOATS_PER_LIMB`] floats for each
    /// segment of a limb. `joints` are the positions and rotations of the dancer's joints,
    /// `palette` the dancer's colours.
    pub fn draw(&self, joints: &Joints, palette: &Palette, into: &mut Vec<f32>) {
        for limb in &self.limbs {
            let tint = palette[limb.tint as usize];
            for n in 1..limb.stations.len() {
                into.extend(limb.end(n - 1, n, joints));
                into.extend(limb.end(n, n - 1, joints));
                into.extend([tint[0], tint[1], tint[2], 0.0]);
            }
        }
    }

    /// Returns the centres (in stage space) and radii, in metres, of up to `most` balls that
    /// approximate the body. They are used to darken the floor near the body (ambient occlusion).
    pub fn shades<'a>(
        &'a self,
        joints: &'a Joints,
        most: usize,
    ) -> impl Iterator<Item = (Vec3, f32)> + 'a {
        let radius = |n: usize| if n < 2 { 0.055 } else { 0.11 };
        self.grounded
            .iter()
            .take(most)
            .enumerate()
            .map(move |(n, &joint)| (joints.positions[joint], radius(n) * self.height))
    }
}

/// Returns the balls around the two ends of a limb segment: the middle and the radius of each, in
/// metres. `segment` are the numbers of the segment for the shader, as [`Figure::draw`] appends them.
pub(crate) fn ends(segment: &[f32; FLOATS_PER_LIMB]) -> [(Vec3, f32); 2] {
    [0, FLOATS_PER_END].map(|at| {
        let (width, depth) = (segment[at + 3], segment[at + 7]);
        (Vec3::from_slice(&segment[at..]), width.max(depth.abs()))
    })
}

impl Limb {
    /// Returns the shader's numbers for one end of a limb segment. The segment connects two
    /// stations of the limb: number `n`, which is the end to compute, and number `other`.
    fn end(&self, n: usize, other: usize, joints: &Joints) -> [f32; 12] {
        let last = self.stations.len() - 1;
        let (before, after) = (n.saturating_sub(1), (n + 1).min(last));
        let at = |n: usize| self.stations[n].0.place(joints);
        let thick = |n: usize| 0.5 * (self.stations[n].1[0] + self.stations[n].1[1]);
        let (from, to, here) = (at(before), at(after), at(n));
        let length = from.distance(to).max(1e-5);
        let along = (to - from) / length;
        let slope = ((thick(before) - thick(after)) / length).clamp(-1.0, 1.0);
        let (place, [wide, deep]) = (self.stations[n].0, self.stations[n].1);
        let side = joints.rotations[place.from] * self.side;
        // A flat end, at which the limb continues, is marked by a negative depth.
        let goes_on = if other > n { n > 0 } else { n < last };
        let deep = if goes_on { -deep } else { deep };
        [
            here.x, here.y, here.z, wide, along.x, along.y, along.z, deep, side.x, side.y, side.z,
            slope,
        ]
    }
}

/// Returns one limb for each bone of `skeleton`, for skeletons whose joint names are not known.
/// `height` is the height of the body in metres.
fn bones(skeleton: &Skeleton, height: f32) -> Vec<Limb> {
    let thick =
        |length: f32| (THICKNESS * length).clamp(THICKNESS_MIN * height, THICKNESS_MAX * height);
    let limb = |from: Place, to: Place, along: Vec3| {
        let thick = thick(along.length());
        let side = along
            .try_normalize()
            .unwrap_or(Vec3::Y)
            .any_orthonormal_vector();
        Limb {
            stations: vec![(from, [thick; 2]), (to, [0.7 * thick; 2])],
            side,
            tint: Tint::Body,
        }
    };
    let mut limbs = Vec::new();
    for (i, joint) in skeleton.joints.iter().enumerate() {
        if let Some(parent) = joint.parent {
            limbs.push(limb(Place::at(parent), Place::at(i), joint.offset));
        }
        limbs.extend(
            joint
                .ends
                .iter()
                .map(|&end| limb(Place::at(i), Place::at(i).moved(end), end)),
        );
    }
    limbs
}

#[cfg(test)]
mod tests {
    use super::*;
    use corybant_core::motion::{Joint, Pose};
    use glam::Quat;

    fn at_rest(skeleton: &Skeleton) -> Joints {
        let mut joints = Joints {
            positions: vec![Vec3::ZERO; skeleton.len()],
            rotations: vec![Quat::IDENTITY; skeleton.len()],
        };
        let pose = Pose {
            root: skeleton.joints[0].offset,
            ..Pose::rest(skeleton.len())
        };
        pose.forward(skeleton, &mut joints.positions, &mut joints.rotations);
        joints
    }

    fn drawn(skeleton: &Skeleton) -> Vec<[f32; FLOATS_PER_LIMB]> {
        let mut numbers = Vec::new();
        Figure::new(skeleton).draw(
            &at_rest(skeleton),
            &[[0.1; 3], [0.2; 3], [0.3; 3]],
            &mut numbers,
        );
        numbers.as_chunks().0.to_vec()
    }

    #[test]
    fn a_person_stands_on_its_soles_and_is_thicker_at_the_trunk_than_at_the_arms() {
        let skeleton = &corybant_repertoire::graph().unwrap().skeleton;
        let pieces = drawn(skeleton);
        let lowest = pieces
            .iter()
            .flat_map(|piece| [piece[1] - piece[7].abs(), piece[13] - piece[19].abs()])
            .fold(f32::INFINITY, f32::min);
        assert!(lowest.abs() < 0.02, "{lowest}");
        let widest = |low: f32, high: f32| {
            let within = pieces
                .iter()
                .filter(|piece| (low..high).contains(&piece[0].abs()) && piece[1] > 0.9);
            within.map(|piece| piece[3]).fold(0.0, f32::max)
        };
        assert!(
            widest(0.0, 0.02) > 0.12 && widest(0.3, 0.8) < 0.06,
            "{} {}",
            widest(0.0, 0.02),
            widest(0.3, 0.8)
        );
    }

    #[test]
    fn any_skeleton_has_a_body() {
        let joint = |name: &str, parent, ends| Joint {
            name: name.into(),
            parent,
            offset: Vec3::Y,
            ends,
        };
        let skeleton = Skeleton {
            joints: vec![
                joint("a", None, vec![]),
                joint("b", Some(0), vec![]),
                joint("c", Some(1), vec![Vec3::X]),
            ],
        };
        let pieces = drawn(&skeleton);
        assert_eq!(pieces.len(), 3);
        assert!(
            pieces.iter().flatten().all(|number| number.is_finite())
                && pieces.iter().all(|piece| piece[3] > 0.0)
        );
        assert_eq!(
            drawn(&Skeleton {
                joints: vec![joint("alone", None, vec![])]
            })
            .len(),
            0
        );
    }
}
