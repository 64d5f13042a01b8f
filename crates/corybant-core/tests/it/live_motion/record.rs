//! Recordings of live motion: a constant frame rate, and a file that the import accepts.

use corybant_core::encode::vmc::{Avatar, Motion, Vmc};
use corybant_core::motion::export::bvh;
use corybant_core::motion::humanoid::{Bone, Humanoid};
use corybant_core::motion::live::take::{DROPOUT_MIN, Take};
use corybant_core::motion::live::{LivePose, Transform};
use corybant_core::motion::{Clip, ImportOptions, Pose, Skeleton, analyse};
use corybant_core::time::Seconds;
use glam::{Quat, Vec3};

use super::{Rig, degrees_between};

/// Returns, for each bone of the pose except the hips, the rotation relative to the parent bone, as
/// a difference from the T-pose.
fn bone_rotations(skeleton: &Skeleton, humanoid: &Humanoid, pose: &Pose) -> Vec<(Bone, Quat)> {
    let mut positions = vec![Vec3::ZERO; skeleton.len()];
    let mut rotations = vec![Quat::IDENTITY; skeleton.len()];
    pose.forward(skeleton, &mut positions, &mut rotations);
    let turned = |i: usize| rotations[humanoid.bones[i].joint] * humanoid.bones[i].rebase;
    let bones = humanoid.bones.iter().enumerate();
    bones
        .filter_map(|(i, mapped)| Some((mapped.bone, turned(mapped.parent?).inverse() * turned(i))))
        .collect()
}

/// Returns the BVH text of the clip.
fn bvh_of(clip: &Clip) -> Vec<u8> {
    let mut text = Vec::new();
    bvh::write(clip, &mut text).unwrap();
    text
}

#[test]
fn a_recorded_dance_is_imported_with_the_same_joint_angles() {
    let graph = corybant_repertoire::graph().unwrap();
    let humanoid = Humanoid::new(&graph.skeleton);
    let mut vmc = Vmc::new(&graph.skeleton, Motion::Root, &Avatar::default()).unwrap();
    for clip in 0..graph.clips.len() as u32 {
        let frames = f64::from(graph.clips[clip as usize].frames.min(240));
        let (mut rig, mut take) = (Rig::default(), Take::new(Seconds(60.0)));
        let mut pose = Pose::rest(graph.skeleton.len());
        // 100 poses per second, with up to 2 ms of delay on the way.
        for i in 0..(frames / 0.6) as usize {
            let sent = i as f64 / 100.0;
            graph.sample(clip, sent * 60.0, &mut pose);
            for datagram in vmc.encode(&pose, Seconds(sent), None).iter() {
                let delay = if i == 0 {
                    0.0
                } else {
                    0.002 * ((i * 7) % 10) as f64 / 10.0
                };
                rig.receive_bytes(sent + delay, 1, datagram);
            }
        }
        rig.poses.iter().for_each(|pose| take.push(pose));
        let recorded = take.clip("take").unwrap();
        assert_eq!((recorded.fps, take.dropout_count()), (60.0, 0));
        let (imported, warnings) =
            analyse("take.bvh", &bvh_of(&recorded), &ImportOptions::default()).unwrap();
        let imported = imported.clip;
        assert_eq!(imported.frames(), recorded.frames(), "{warnings:?}");
        let own = Humanoid::new(&imported.skeleton);
        for frame in 0..imported.frames() {
            graph.sample(clip, frame as f64, &mut pose);
            let danced = bone_rotations(&graph.skeleton, &humanoid, &pose);
            let got = bone_rotations(&imported.skeleton, &own, &imported.pose(frame));
            assert_eq!(danced.len(), got.len());
            for ((bone, one), (other_bone, other)) in danced.iter().zip(&got) {
                let angle = degrees_between(*one, *other);
                // Import plants feet that creep.
                let most = if bone.is_leg() { 6.0 } else { 2.0 };
                assert!(
                    bone == other_bone && angle < most,
                    "clip {clip}, frame {frame}: {bone:?} differs by {angle} degrees"
                );
            }
        }
    }
}

/// Returns a pose with hips at this height and turned head.
fn pose(time: f64, height: f32, degrees: f32) -> LivePose {
    let mut pose = LivePose {
        time: Seconds(time),
        ..LivePose::default()
    };
    let position = Vec3::new(0.0, height, 0.0);
    pose.bones[Bone::Hips as usize] = Some(Transform {
        position,
        rotation: Quat::IDENTITY,
    });
    let rotation = Quat::from_rotation_y(degrees.to_radians());
    pose.bones[Bone::Head as usize] = Some(Transform {
        position: Vec3::ZERO,
        rotation,
    });
    pose
}

#[test]
fn unsteady_poses_become_steady_frames() {
    let mut take = Take::new(Seconds(100.0));
    let mut time = 10.0;
    while time < 12.001 {
        // Between 20 and 120 poses per second; the height says the time.
        take.push(&pose(time, time as f32, 20.0 * (time - 10.0) as f32));
        time += [0.05, 0.0083, 0.0167, 0.031][(time * 1000.0) as usize % 4];
    }
    let clip = take.clip("take").unwrap();
    assert!((118..=121).contains(&clip.frames()), "{}", clip.frames());
    let head = clip.skeleton.find("Head").unwrap();
    for (i, root) in clip.roots.iter().enumerate() {
        let passed = i as f32 / 60.0;
        assert!((root.y - 10.0 - passed).abs() < 1e-3, "frame {i}: {root}");
        let wanted = Quat::from_rotation_y((20.0 * passed).to_radians());
        assert!(
            degrees_between(clip.rotations_at(i)[head], wanted) < 0.05,
            "frame {i}"
        );
    }
}

#[test]
fn dropouts_are_interpolated_and_named() {
    let mut take = Take::new(Seconds(100.0));
    for time in [0.0, 0.1, 0.2, 0.7, 0.8] {
        take.push(&pose(time, time as f32, 0.0));
    }
    assert_eq!(take.dropout_count(), 1);
    let dropout = take.dropouts()[0];
    assert!((dropout.start.0 - 0.2).abs() < 1e-9 && (dropout.duration.0 - 0.5).abs() < 1e-9);
    assert!(dropout.duration.0 > DROPOUT_MIN.0);
    let clip = take.clip("take").unwrap();
    assert!((clip.roots[27].y - 0.45).abs() < 1e-4, "{}", clip.roots[27]);
}

#[test]
fn a_recording_ends_at_its_limit_and_ignores_times_that_go_back() {
    let mut take = Take::new(Seconds(1.0));
    assert!(take.clip("empty").is_none());
    for time in [0.0, 0.5, 0.3, 0.5, f64::NAN, 1e9, 1e9 + 1.0] {
        take.push(&pose(time, 1.0, 0.0));
    }
    assert!(take.is_full());
    assert_eq!(take.clip("take").unwrap().frames(), 60);
}

#[test]
fn a_sender_without_positions_gets_the_body_of_an_adult() {
    let mut take = Take::new(Seconds(10.0));
    for i in 0..120 {
        let mut pose = LivePose {
            time: Seconds(f64::from(i) / 60.0),
            ..LivePose::default()
        };
        pose.bones = [Some(Transform::IDENTITY); corybant_core::motion::live::BONES];
        let swing = Quat::from_rotation_x((i as f32 / 10.0).sin());
        for bone in [Bone::LeftUpperArm, Bone::RightUpperLeg] {
            pose.bones[bone as usize] = Some(Transform {
                position: Vec3::ZERO,
                rotation: swing,
            });
        }
        pose.root.position.y = 0.95;
        take.push(&pose);
    }
    let clip = take.clip("take").unwrap();
    assert_eq!(clip.skeleton.len(), 55);
    assert!(
        (1.5..2.0).contains(&clip.skeleton.rest_height()),
        "{}",
        clip.skeleton.rest_height()
    );
    let humanoid = Humanoid::new(&clip.skeleton);
    assert!(humanoid.unmapped.is_empty());
    assert!(humanoid.far_from_t_pose().is_empty());
    let (imported, _) = analyse("take.bvh", &bvh_of(&clip), &ImportOptions::default()).unwrap();
    assert_eq!(imported.clip.frames(), 120);
}

#[test]
fn an_upper_body_is_recorded_above_its_root() {
    let mut take = Take::new(Seconds(10.0));
    for i in 0..60 {
        let mut pose = LivePose {
            time: Seconds(f64::from(i) / 60.0),
            ..LivePose::default()
        };
        let rotation = Quat::from_rotation_y(i as f32 / 60.0);
        pose.bones[Bone::Head as usize] = Some(Transform {
            position: Vec3::Y * 0.6,
            rotation,
        });
        take.push(&pose);
    }
    let clip = take.clip("take").unwrap();
    let names: Vec<&str> = clip
        .skeleton
        .joints
        .iter()
        .map(|joint| joint.name.as_str())
        .collect();
    assert_eq!(names, ["Hips", "Head"]);
    assert_eq!(clip.skeleton.joints[1].offset, Vec3::Y * 0.6);
    assert!(clip.roots.iter().all(|root| root.y > 0.5));
}
