//! The skeleton of the built-in repertoire: 22 joints, 1.70 m tall, in a T-pose on the floor,
//! facing +Z.
//!
//! In: nothing.
//! Out: constants.
//! Thread: any.
//! Allocates: never.

use glam::Vec3;

/// Number of joints of the built-in skeleton.
pub(super) const JOINTS: usize = 22;

pub(super) const HIPS: usize = 0;
pub(super) const SPINE: usize = 1;
pub(super) const CHEST: usize = 2;
pub(super) const UPPER_CHEST: usize = 3;
pub(super) const NECK: usize = 4;
pub(super) const HEAD: usize = 5;
/// Indices of the left and the right shoulder among the joints. Upper arm, lower arm and hand of
/// the same side have the next three indices.
pub(super) const ARMS: [usize; 2] = [6, 10];
/// Indices of the left and the right upper leg among the joints. Lower leg, foot and toes of the
/// same side have the next three indices.
pub(super) const LEGS: [usize; 2] = [14, 18];

/// Length of the clavicle, from the joint at the chest to the shoulder joint, in metres.
pub(super) const CLAVICLE: f32 = 0.13;
/// Length of the upper arm, shoulder to elbow, in metres.
pub(super) const UPPER_ARM: f32 = 0.27;
/// Length of the lower arm, elbow to wrist, in metres.
pub(super) const LOWER_ARM: f32 = 0.25;
/// Length of the thigh (from hip joint to knee), in metres.
pub(super) const THIGH: f32 = 0.42;
/// Length of the shank (lower leg, from knee to ankle), in metres.
pub(super) const SHANK: f32 = 0.41;
/// Vector from the ankle to the ball of a flat foot (the joint of the toes), in metres.
pub(super) const BALL_FROM_ANKLE: Vec3 = Vec3::new(0.0, -0.06, 0.13);
/// Height of the ball of a flat foot above the floor, in metres.
pub(super) const BALL_HEIGHT: f32 = 0.02;
/// Vector from the heel, on the floor, to the ball of a flat foot, in metres.
pub(super) const BALL_FROM_HEEL: Vec3 = Vec3::new(0.0, 0.02, 0.18);
/// Vector from the hips to the left hip joint, in metres; the right hip joint is its mirror image.
pub(super) const HIP_JOINT: Vec3 = Vec3::new(0.09, -0.04, 0.0);
/// Height of the hips in the rest pose, in metres.
pub(super) const HIPS_HEIGHT: f32 = 0.95;

/// A joint of the built-in skeleton.
pub(super) struct Bone {
    pub name: &'static str,
    pub parent: Option<usize>,
    /// Position of the joint relative to its parent joint, in the parent's space, in metres.
    pub offset: Vec3,
    /// Position of the end of the bone (End Site in BVH) in the space of this joint, in metres;
    /// `None` if the joint has no end site.
    pub end: Option<Vec3>,
}

const fn bone(name: &'static str, parent: usize, offset: [f32; 3]) -> Bone {
    Bone {
        name,
        parent: Some(parent),
        offset: Vec3::from_array(offset),
        end: None,
    }
}

const fn tip(name: &'static str, parent: usize, offset: [f32; 3], end: [f32; 3]) -> Bone {
    Bone {
        name,
        parent: Some(parent),
        offset: Vec3::from_array(offset),
        end: Some(Vec3::from_array(end)),
    }
}

/// The joints of the built-in skeleton, parents before children.
pub(super) const BONES: [Bone; JOINTS] = [
    Bone {
        name: "Hips",
        parent: None,
        offset: Vec3::new(0.0, HIPS_HEIGHT, 0.0),
        end: None,
    },
    bone("Spine", HIPS, [0.0, 0.10, 0.0]),
    bone("Chest", SPINE, [0.0, 0.12, 0.0]),
    bone("UpperChest", CHEST, [0.0, 0.12, 0.0]),
    bone("Neck", UPPER_CHEST, [0.0, 0.15, 0.0]),
    tip("Head", NECK, [0.0, 0.09, 0.01], [0.0, 0.17, 0.0]),
    bone("LeftShoulder", UPPER_CHEST, [0.03, 0.10, 0.0]),
    bone("LeftUpperArm", 6, [CLAVICLE, 0.0, 0.0]),
    bone("LeftLowerArm", 7, [UPPER_ARM, 0.0, 0.0]),
    tip("LeftHand", 8, [LOWER_ARM, 0.0, 0.0], [0.17, 0.0, 0.0]),
    bone("RightShoulder", UPPER_CHEST, [-0.03, 0.10, 0.0]),
    bone("RightUpperArm", 10, [-CLAVICLE, 0.0, 0.0]),
    bone("RightLowerArm", 11, [-UPPER_ARM, 0.0, 0.0]),
    tip("RightHand", 12, [-LOWER_ARM, 0.0, 0.0], [-0.17, 0.0, 0.0]),
    bone(
        "LeftUpperLeg",
        HIPS,
        [HIP_JOINT.x, HIP_JOINT.y, HIP_JOINT.z],
    ),
    bone("LeftLowerLeg", 14, [0.0, -THIGH, 0.0]),
    bone("LeftFoot", 15, [0.0, -SHANK, 0.0]),
    tip(
        "LeftToes",
        16,
        [BALL_FROM_ANKLE.x, BALL_FROM_ANKLE.y, BALL_FROM_ANKLE.z],
        [0.0, -BALL_HEIGHT, 0.07],
    ),
    bone(
        "RightUpperLeg",
        HIPS,
        [-HIP_JOINT.x, HIP_JOINT.y, HIP_JOINT.z],
    ),
    bone("RightLowerLeg", 18, [0.0, -THIGH, 0.0]),
    bone("RightFoot", 19, [0.0, -SHANK, 0.0]),
    tip(
        "RightToes",
        20,
        [BALL_FROM_ANKLE.x, BALL_FROM_ANKLE.y, BALL_FROM_ANKLE.z],
        [0.0, -BALL_HEIGHT, 0.07],
    ),
];
