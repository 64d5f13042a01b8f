//! Tests of retargeting: on the skeleton of another humanoid every limb keeps its direction, for
//! any joint names and any rest pose.

#![allow(clippy::unwrap_used, missing_docs)]

use crate::common::body;
use crate::common::shared;

use body::{Build, Names, dance, figure};
use corybant::offline::motion_dir::{self, Options};
use corybant_core::motion::humanoid::{Bone, Humanoid};
use corybant_core::motion::import::bvh;
use corybant_core::motion::import::clean::{self, Cleaned, Settings};
use corybant_core::motion::import::retarget::{self, Fitted};
use corybant_core::motion::{Clip, Joint, Skeleton, contact, export};
use glam::{Quat, Vec3};
use proptest::prelude::*;

/// The limbs whose direction is kept exactly by retargeting, each as its first and its last bone.
const LIMBS: [(Bone, Bone); 8] = [
    (Bone::LeftUpperArm, Bone::LeftLowerArm),
    (Bone::RightUpperArm, Bone::RightLowerArm),
    (Bone::LeftLowerArm, Bone::LeftHand),
    (Bone::RightLowerArm, Bone::RightHand),
    (Bone::LeftUpperLeg, Bone::LeftLowerLeg),
    (Bone::RightUpperLeg, Bone::RightLowerLeg),
    (Bone::LeftLowerLeg, Bone::LeftFoot),
    (Bone::RightLowerLeg, Bone::RightFoot),
];

fn settled(clips: Vec<Clip>) -> Vec<Cleaned> {
    let mut all: Vec<Cleaned> = clips
        .into_iter()
        .flat_map(|clip| clean::clean_single(clip, &Settings::default()).unwrap())
        .collect();
    clean::harmonise(&mut all);
    all
}

/// Retargets `clip` onto the skeleton of `target`, which is in the majority. Returns the clip
/// before and after it, and the report.
fn onto(clip: Clip, target: &Clip) -> (Clip, Clip, Fitted) {
    let mut all = settled(vec![target.clone(), target.clone(), clip]);
    let before = all[2].clip.clone();
    let fitted = retarget::onto_one(&mut all);
    assert!(fitted.left_out.is_empty(), "{:?}", fitted.left_out);
    assert_eq!(all[2].clip.skeleton, all[0].clip.skeleton);
    (before, all.remove(2).clip, fitted)
}

fn joint(humanoid: &Humanoid, bone: Bone) -> Option<usize> {
    humanoid.find(bone).map(|i| humanoid.bones[i].joint)
}

/// Returns the largest angle between the directions of the same limb in the clips `a` and `b`, in
/// degrees. Limbs that a clip lacks are ignored.
fn off_deg(a: &Clip, b: &Clip, limbs: &[(Bone, Bone)]) -> f32 {
    let (of_a, of_b) = (Humanoid::new(&a.skeleton), Humanoid::new(&b.skeleton));
    let (at_a, at_b) = (a.joint_positions(), b.joint_positions());
    let mut most: f32 = 0.0;
    for &(from, to) in limbs {
        let found = (
            joint(&of_a, from),
            joint(&of_a, to),
            joint(&of_b, from),
            joint(&of_b, to),
        );
        let (Some(a_from), Some(a_to), Some(b_from), Some(b_to)) = found else {
            continue;
        };
        for frame in 0..a.frames() {
            let (row_a, row_b) = (frame * a.skeleton.len(), frame * b.skeleton.len());
            let (one, other) = (
                at_a[row_a + a_to] - at_a[row_a + a_from],
                at_b[row_b + b_to] - at_b[row_b + b_from],
            );
            most = most.max(one.angle_between(other).to_degrees());
        }
    }
    most
}

/// Returns the largest angle between the rotations of the bone `bone` in the clips `a` and `b`, in
/// model space, in degrees.
fn turned_deg(a: &Clip, b: &Clip, bone: Bone) -> f32 {
    let of = |clip: &Clip| {
        let at = joint(&Humanoid::new(&clip.skeleton), bone).unwrap();
        let joints = clip.skeleton.len();
        let (mut places, mut turned) = (vec![Vec3::ZERO; joints], vec![Quat::IDENTITY; joints]);
        let turn = |frame: usize| {
            clip.pose(frame)
                .forward(&clip.skeleton, &mut places, &mut turned);
            turned[at]
        };
        (0..clip.frames()).map(turn).collect::<Vec<Quat>>()
    };
    of(a)
        .iter()
        .zip(of(b))
        .map(|(a, b)| a.angle_between(b).to_degrees())
        .fold(0.0, f32::max)
}

fn lowest(clip: &Clip) -> f32 {
    let mut all: Vec<f32> = clip
        .joint_positions()
        .chunks(clip.skeleton.len())
        .map(|row| row.iter().map(|p| p.y).fold(9.0, f32::min))
        .collect();
    all.sort_unstable_by(f32::total_cmp);
    all[all.len() / 20]
}

fn builds() -> impl Strategy<Value = Build> {
    let names = prop_oneof![
        Just(Names::Plain),
        Just(Names::Mixamo),
        Just(Names::Unreal),
        Just(Names::Biovision)
    ];
    let lengths = (0.8f32..1.2, 0.7f32..1.4, 0.7f32..1.4);
    let pose = (
        prop_oneof![Just(0.0f32), Just(0.8), Just(1.5), 0.0f32..1.5],
        0.0f32..0.4,
    );
    (
        lengths,
        pose,
        1usize..=4,
        1usize..=2,
        any::<bool>(),
        any::<bool>(),
        names,
    )
        .prop_map(
            |((size, arms, legs), (arms_down, legs_apart), spine, neck, details, twists, names)| {
                Build {
                    size,
                    arms,
                    legs,
                    arms_down,
                    legs_apart,
                    spine,
                    neck,
                    details,
                    twists,
                    names,
                }
            },
        )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn limbs_keep_their_directions(from in builds(), to in builds()) {
        let (source, target) = (dance(&figure(&from), 40), dance(&figure(&to), 40));
        let (before, after, _) = onto(source, &target);
        let off = off_deg(&before, &after, &LIMBS);
        // For the same tree of joints, nearly equal rest poses count as equal.
        let allowed = if before.skeleton.same_tree(&after.skeleton) { 2.2 } else { 0.2 };
        prop_assert!(off < allowed, "{off}° off");
        for bone in [Bone::Hips, Bone::Head] {
            let off = turned_deg(&before, &after, bone);
            prop_assert!(off < 0.2, "{bone:?} turned by {off}°");
        }
        // The arms are children of the topmost joint of the spine, so its rotation is kept for any
        // number of joints below.
        let chest = |build: &Build| if build.spine > 2 { Bone::UpperChest } else if build.spine == 2 { Bone::Chest } else { Bone::Spine };
        if chest(&from) == chest(&to) {
            prop_assert!(turned_deg(&before, &after, chest(&from)) < 0.2);
        }
        // The ends of the toes are lower than their joints.
        prop_assert!((-0.02..0.2).contains(&lowest(&after)), "lowest at {}", lowest(&after));
        prop_assert!(after.rotations.iter().all(|rotation| (rotation.length() - 1.0).abs() < 1e-3));
    }

    /// A motion that is retargeted to another body and back is the original motion, hands and feet
    /// included.
    #[test]
    fn retargeting_there_and_back_restores_the_motion(build in builds(), size in 0.8f32..1.2) {
        let ours = Build { spine: build.spine, neck: build.neck, details: build.details, twists: false, ..Build::default() };
        let names = if build.names == Names::Plain { Names::Mixamo } else { build.names };
        let theirs = Build { size, names, twists: false, ..build };
        let source = dance(&figure(&ours), 40);
        let (before, there, _) = onto(source, &dance(&figure(&theirs), 40));
        let (_, back, _) = onto(there, &before);
        // The twist of a hanging arm is distributed differently over its joints, so positions are
        // compared, not rotations.
        let (of_a, of_b) = (before.joint_positions(), back.joint_positions());
        let joints = before.skeleton.len();
        let apart = (0..of_a.len()).map(|i| (of_a[i] - of_a[i / joints * joints]).distance(of_b[i] - of_b[i / joints * joints])).fold(0.0, f32::max);
        prop_assert!(apart < 5e-3, "{apart} m");
    }
}

/// Returns another skeleton for the shared dancers. It has Mixamo's names, an A-pose, other bone
/// lengths and one more joint in the spine.
fn a_posed(skeleton: &Skeleton) -> Skeleton {
    let humanoid = Humanoid::new(skeleton);
    let mut other = skeleton.clone();
    let name = |bone: Bone| {
        let name = bone.name();
        let (side, part) = if let Some(part) = name.strip_prefix("Left") {
            ("Left", part)
        } else if let Some(part) = name.strip_prefix("Right") {
            ("Right", part)
        } else {
            ("", name)
        };
        let part = match part {
            "UpperLeg" => "UpLeg",
            "LowerLeg" => "Leg",
            "Toes" => "ToeBase",
            "UpperArm" => "Arm",
            "LowerArm" => "ForeArm",
            "Chest" => "Spine1",
            part => part,
        };
        format!("mixamorig:{side}{part}")
    };
    for mapped in &humanoid.bones {
        other.joints[mapped.joint].name = name(mapped.bone);
    }
    for (i, joint) in other.joints.iter_mut().enumerate() {
        let above = humanoid
            .bones
            .iter()
            .find(|mapped| Some(mapped.joint) == joint.parent);
        let turn = match above.map(|mapped| mapped.bone.name()) {
            Some("LeftUpperArm" | "LeftLowerArm") => Quat::from_rotation_z(-0.8),
            Some("RightUpperArm" | "RightLowerArm") => Quat::from_rotation_z(0.8),
            Some(name) if name.ends_with("Hand") => {
                Quat::from_rotation_z(if name.starts_with("Left") { -0.8 } else { 0.8 })
            }
            _ => Quat::IDENTITY,
        };
        joint.offset = turn * joint.offset * if i % 2 == 0 { 1.2 } else { 0.9 };
    }
    other
}

#[test]
fn shared_dancers_keep_their_directions_there_and_back() {
    let Some(folder) = shared::shared("motion/dev") else {
        return shared::skip(
            "shared_dancers_keep_their_directions_there_and_back",
            "../shared is absent",
        );
    };
    for file in [
        "salsa_01.bvh",
        "indian_13.bvh",
        "martial_07.bvh",
        "pop_danceshort.bvh",
    ] {
        let mut clip = bvh::parse(file, &std::fs::read(folder.join(file)).unwrap())
            .unwrap()
            .clip;
        clip.roots.truncate(900);
        clip.rotations.truncate(900 * clip.skeleton.len());
        let body = Clip {
            skeleton: a_posed(&clip.skeleton),
            ..clip.clone()
        };
        let (before, there, fitted) = onto(clip, &body);
        let (_, back, _) = onto(there.clone(), &before);
        let limbs = |to: &Clip| off_deg(&before, to, &LIMBS);
        let spine = [
            (Bone::Hips, Bone::Neck),
            (Bone::Spine, Bone::Chest),
            (Bone::Neck, Bone::Head),
            (Bone::LeftFoot, Bone::LeftToes),
        ];
        println!(
            "{file}: limbs {:.2}° there, {:.2}° back; spine, neck and foot {:.2}° back; head turned by {:.2}°; {:?}",
            limbs(&there),
            limbs(&back),
            off_deg(&before, &back, &spine),
            turned_deg(&before, &there, Bone::Head),
            fitted.warnings
        );
        assert!(limbs(&there) < 0.5 && limbs(&back) < 0.5, "{file}");
        assert!(off_deg(&before, &back, &spine) < 0.5, "{file}");
        assert!(turned_deg(&before, &there, Bone::Head) < 0.5, "{file}");
        assert!(lowest(&there).abs() < 0.1, "{file}: {}", lowest(&there));
    }
}

#[test]
fn the_most_common_humanoid_is_the_target_and_left_out_joints_are_named() {
    let clip = |build: &Build, frames: usize, name: &str| Clip {
        name: name.into(),
        ..dance(&figure(build), frames)
    };
    let plain = Build::default();
    let poor = Build {
        details: false,
        names: Names::Mixamo,
        ..Build::default()
    };
    let mut snake = clip(&plain, 90, "snake");
    snake
        .skeleton
        .joints
        .iter_mut()
        .enumerate()
        .for_each(|(i, joint)| joint.name = format!("segment{i}"));
    let snakes = vec![snake; 5];
    let mut all = settled(
        [
            snakes.clone(),
            vec![clip(&poor, 60, "short"), clip(&plain, 300, "long")],
        ]
        .concat(),
    );
    let fitted = retarget::onto_one(&mut all);
    assert_eq!(
        fitted.left_out.keys().copied().collect::<Vec<_>>(),
        [0, 1, 2, 3, 4]
    );
    assert!(
        fitted.left_out[&0].contains("it has no Hips")
            && fitted.left_out[&0].contains("not that of long"),
        "{:?}",
        fitted.left_out[&0]
    );
    assert_eq!(
        all[5].clip.skeleton.joints[0].name, "Hips",
        "of equally many clips the longer decide"
    );
    let [said] = &fitted.warnings[..] else {
        panic!("{:?}", fitted.warnings)
    };
    assert!(
        said.starts_with(
            "short, on another skeleton, retargeted to that of long; at rest there: LeftHand, LeftToeBase, RightHand, RightToeBase"
        ),
        "{said}"
    );
    let mut all = settled(vec![
        clip(&poor, 60, "a"),
        clip(&plain, 300, "b"),
        clip(&poor, 60, "c"),
    ]);
    let fitted = retarget::onto_one(&mut all);
    assert_eq!(
        all[1].clip.skeleton.joints[0].name, "mixamorig:Hips",
        "but the number of clips comes first"
    );
    assert!(
        fitted.warnings[0]
            .contains("not shown there: LeftHand, LeftToeBase, RightHand, RightToeBase"),
        "{:?}",
        fitted.warnings
    );
    let mut all = settled(snakes);
    assert_eq!(retarget::onto_one(&mut all), Fitted::default());
}

#[test]
fn one_tree_with_another_rest_pose_is_retargeted_too() {
    let (t_pose, i_pose) = (
        figure(&Build::default()),
        figure(&Build {
            arms_down: 1.4,
            ..Build::default()
        }),
    );
    let (before, after, fitted) = onto(dance(&i_pose, 60), &dance(&t_pose, 60));
    assert!(off_deg(&before, &after, &LIMBS) < 0.2);
    assert!(fitted.warnings.is_empty(), "{:?}", fitted.warnings);
}

#[test]
fn feet_and_spine_of_another_rest_pose_keep_their_directions() {
    let plain = figure(&Build::default());
    let mut bent = plain.clone();
    let humanoid = Humanoid::new(&plain);
    for (bone, by) in [
        (Bone::LeftToes, 0.5),
        (Bone::RightToes, 0.5),
        (Bone::Chest, 0.3),
        (Bone::Head, 0.4),
    ] {
        let joint = &mut bent.joints[joint(&humanoid, bone).unwrap()];
        joint.offset = Quat::from_rotation_x(by) * joint.offset;
    }
    let shapes = [
        (Bone::LeftFoot, Bone::LeftToes),
        (Bone::RightFoot, Bone::RightToes),
        (Bone::Spine, Bone::Chest),
        (Bone::Neck, Bone::Head),
    ];
    let (before, after, _) = onto(dance(&bent, 60), &dance(&plain, 60));
    assert!(
        off_deg(&before, &after, &shapes) < 0.2,
        "{}",
        off_deg(&before, &after, &shapes)
    );
    assert!(off_deg(&before, &after, &LIMBS) < 0.2);
    // A different foot direction in the same rest pose must not become a rotation.
    let mut flat = plain.clone();
    let toes = joint(&humanoid, Bone::LeftToes).unwrap();
    flat.joints[toes].offset = Quat::from_rotation_x(-0.12) * flat.joints[toes].offset;
    let (before, after, _) = onto(dance(&flat, 60), &dance(&plain, 60));
    let turned = before
        .rotations
        .iter()
        .zip(&after.rotations)
        .map(|(a, b)| a.angle_between(*b))
        .fold(0.0, f32::max);
    assert!(turned < 1e-3, "{turned} rad");
}

#[test]
fn joints_that_are_no_bones_keep_their_motion_on_the_same_tree() {
    let tailed = |arms_down: f32| {
        let mut skeleton = figure(&Build {
            arms_down,
            ..Build::default()
        });
        let head = skeleton.find("Head");
        skeleton.joints.push(Joint {
            name: "pony".into(),
            parent: head,
            offset: Vec3::new(0.0, 0.1, -0.1),
            ends: vec![Vec3::NEG_Y * 0.2],
        });
        skeleton
    };
    let (before, after, _) = onto(dance(&tailed(1.4), 60), &dance(&tailed(0.0), 60));
    assert!(off_deg(&before, &after, &LIMBS) < 0.2);
    let pony = before.skeleton.len() - 1;
    for frame in 0..60 {
        let apart = before.rotations_at(frame)[pony].angle_between(after.rotations_at(frame)[pony]);
        assert!(apart < 5e-3, "{apart} rad");
    }
}

/// Returns a clip of knee bends with both feet planted; the right foot is lifted for a while.
fn knee_bends(skeleton: &Skeleton) -> Clip {
    let humanoid = Humanoid::new(skeleton);
    let at = |bone: Bone| joint(&humanoid, bone).unwrap();
    let mut clip = dance(skeleton, 240);
    clip.rotations.fill(Quat::IDENTITY);
    clip.roots.fill(Vec3::ZERO);
    for frame in 0..240 {
        let bend = 0.4 - 0.4 * (frame as f32 * 0.1).cos();
        let lifted = if (100..150).contains(&frame) {
            0.8 * ((frame - 100) as f32 / 50.0 * std::f32::consts::PI).sin()
        } else {
            0.0
        };
        let row = &mut clip.rotations[frame * skeleton.len()..][..skeleton.len()];
        for (thigh, shin, foot, more) in [
            (Bone::LeftUpperLeg, Bone::LeftLowerLeg, Bone::LeftFoot, 0.0),
            (
                Bone::RightUpperLeg,
                Bone::RightLowerLeg,
                Bone::RightFoot,
                lifted,
            ),
        ] {
            row[at(thigh)] = Quat::from_rotation_x(-bend - more);
            row[at(shin)] = Quat::from_rotation_x(2.0 * bend + more);
            row[at(foot)] = Quat::from_rotation_x(-bend);
        }
    }
    let foot = at(Bone::LeftFoot);
    let places = clip.joint_positions();
    (0..240).for_each(|frame| {
        clip.roots[frame] = Vec3::Y * 0.14 - places[frame * skeleton.len() + foot]
    });
    clip
}

#[test]
fn dancers_of_other_proportions_keep_their_feet_on_the_floor() {
    let legs = |length_m: f32| {
        figure(&Build {
            legs: length_m / 0.41,
            ..Build::default()
        })
    };
    for (given, target) in [(0.3, 0.5), (0.5, 0.3), (0.42, 0.45)] {
        let (before, after, _) = onto(knee_bends(&legs(given)), &knee_bends(&legs(target)));
        assert_eq!(before.rotations, after.rotations, "turns stay");
        let (was, is) = (contact::contacts(&before), contact::contacts(&after));
        // The left foot stands all the time, the right one twice, each with heel and toe.
        assert_eq!(was.len(), 6, "{was:?}");
        let alike = was.iter().zip(&is).all(|(a, b)| {
            (a.joint, a.part) == (b.joint, b.part)
                && a.first.abs_diff(b.first) <= 4
                && a.last.abs_diff(b.last) <= 4
        });
        assert!(alike && was.len() == is.len(), "{was:?} {is:?}");
        let (places, joints) = (&after.joint_positions(), after.skeleton.len());
        let ankles = is.iter().flat_map(|it| {
            (it.first..=it.last)
                .map(move |frame| places[frame as usize * joints + it.joint as usize].y)
        });
        let off = ankles
            .map(|height| (height - 0.14).abs())
            .fold(0.0, f32::max);
        println!("legs of 2 x {given} m on 2 x {target} m: ankles off by {off:.4} m");
        assert!(off < 0.015, "{given} on {target}: {off} m");
    }
}

#[test]
fn animals_of_another_size_stand_on_the_floor() {
    let names = ["tail", "middle", "head end"];
    let (small, large) = (
        flat(&names, Vec3::new(0.0, 0.1, 0.4)),
        flat(&names, Vec3::new(0.0, 0.2, 0.8)),
    );
    let clip = |skeleton: &Skeleton| Clip {
        roots: (0..90)
            .map(|frame| Vec3::new(0.0, 2.0, frame as f32 * 0.01))
            .collect(),
        ..dance(skeleton, 90)
    };
    let mut all = settled(vec![clip(&large), clip(&small)]);
    assert_eq!(retarget::onto_one(&mut all), Fitted::default());
    assert_eq!(all[0].clip.skeleton, all[1].clip.skeleton);
    assert!(
        all[1].clip.roots[89].z > all[0].clip.roots[89].z,
        "it goes farther"
    );
    let heights = |i: usize| {
        all[i]
            .clip
            .roots
            .iter()
            .map(|root| root.y)
            .fold(9.0, f32::min)
    };
    assert!(
        (heights(0) - heights(1)).abs() < 1e-3,
        "the same turns on the same body, on the same floor"
    );
}

#[test]
fn a_body_without_legs_is_left_out_alone() {
    let good = dance(&figure(&Build::default()), 90);
    let mut legless = good.clone();
    let humanoid = Humanoid::new(&good.skeleton);
    for bone in [
        Bone::LeftLowerLeg,
        Bone::RightLowerLeg,
        Bone::LeftFoot,
        Bone::RightFoot,
    ] {
        legless.skeleton.joints[joint(&humanoid, bone).unwrap()].offset = Vec3::ZERO;
    }
    let mixamo = dance(
        &figure(&Build {
            names: Names::Mixamo,
            ..Build::default()
        }),
        90,
    );
    let mut tiny = mixamo.clone();
    tiny.name = "tiny legs".into();
    let legs = tiny
        .skeleton
        .joints
        .iter_mut()
        .filter(|joint| joint.name.ends_with("Leg") || joint.name.ends_with("Foot"));
    legs.for_each(|joint| joint.offset *= 1e-4);
    let mut all = settled(vec![legless, good.clone(), good, tiny, mixamo]);
    let fitted = retarget::onto_one(&mut all);
    assert_eq!(fitted.left_out.keys().copied().collect::<Vec<_>>(), [0, 3]);
    assert!(
        fitted.warnings.len() == 1
            && fitted.warnings[0].starts_with("dance, on another skeleton, retargeted"),
        "{:?}",
        fitted.warnings
    );
    assert!(
        fitted.left_out[&0].contains("its bones have other lengths); its legs (LeftUpLeg to LeftFoot) are 0.0000 m long in the rest pose"),
        "{:?}",
        fitted.left_out
    );
    assert_eq!(all[1].clip.skeleton, all[2].clip.skeleton);
}

/// The key `joints` in `clips.toml` contains joint names of the motion file, even if the clip is
/// retargeted.
#[test]
fn beats_are_found_in_the_joints_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let plain = dance(&figure(&Build::default()), 240);
    let other = dance(
        &figure(&Build {
            names: Names::Mixamo,
            ..Build::default()
        }),
        240,
    );
    for (name, clip) in [("a.bvh", &plain), ("b.bvh", &plain), ("c.bvh", &other)] {
        let mut text = Vec::new();
        export::bvh::write(clip, &mut text).unwrap();
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let toml = "[[clip]]\nfile = 'a.bvh'\n[[clip]]\nfile = 'b.bvh'\njoints = ['mixamorig:LeftHand']\n\
                [[clip]]\nfile = 'c.bvh'\njoints = ['mixamorig:LeftHand']\n";
    std::fs::write(folder.path().join("clips.toml"), toml).unwrap();
    let loaded = motion_dir::load(folder.path(), &Options::default(), &mut |_, _, _| {}).unwrap();
    let unknown: Vec<&String> = loaded
        .warnings
        .iter()
        .filter(|warning| warning.contains("mixamorig:LeftHand, which"))
        .collect();
    assert!(
        unknown.len() == 1 && unknown[0].starts_with("b.bvh: its beats"),
        "{:?}",
        loaded.warnings
    );
    assert!(
        loaded.clips[1]
            .steps
            .iter()
            .any(|step| unknown[0].ends_with(step)),
        "warnings are among the steps"
    );
    let curves = [1, 2].map(|i| loaded.clips[i].beats.as_ref().unwrap().curve.clone());
    assert_ne!(
        curves[0], curves[1],
        "the whole body and one hand are not the same"
    );
}

/// Motion files of three tools, one of them Z up and in inches, become clips with one skeleton.
#[test]
fn a_directory_of_many_skeletons_is_loaded_onto_one() {
    let folder = tempfile::tempdir().unwrap();
    let save = |name: &str, clip: &Clip| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let mut text = Vec::new();
        export::bvh::write(clip, &mut text).unwrap();
        std::fs::write(path, text).unwrap();
    };
    let plain = dance(&figure(&Build::default()), 240);
    save("salsa/a.bvh", &plain);
    save("salsa/b.bvh", &plain);
    let unreal = Build {
        size: 1.1,
        arms_down: 0.8,
        spine: 2,
        twists: true,
        names: Names::Unreal,
        ..Build::default()
    };
    save("pop/c.bvh", &dance(&figure(&unreal), 240));
    let mut z_up = dance(
        &figure(&Build {
            size: 39.37,
            arms_down: 1.4,
            names: Names::Mixamo,
            ..Build::default()
        }),
        240,
    );
    let turn = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    z_up.roots
        .iter_mut()
        .for_each(|root| *root = turn * Vec3::new(root.x * 39.37, root.y, root.z * 39.37));
    z_up.skeleton
        .joints
        .iter_mut()
        .for_each(|joint| joint.offset = turn * joint.offset);
    // The motion is rotated together with the rest pose: T·q·T⁻¹, also for the root.
    z_up.rotations
        .iter_mut()
        .for_each(|rotation| *rotation = turn * *rotation * turn.inverse());
    save("d.bvh", &z_up);
    let snake = flat(&["tail", "middle", "head end"], Vec3::Y);
    save("snake.bvh", &dance(&snake, 240));
    let loaded = motion_dir::load(folder.path(), &Options::default(), &mut |_, _, _| {}).unwrap();
    assert!(
        loaded.skipped.len() == 1
            && loaded.skipped[0].starts_with("snake.bvh: its skeleton is not that of a"),
        "{:?}",
        loaded.skipped
    );
    let labels: Vec<_> = loaded
        .clips
        .iter()
        .map(|clip| (clip.clip.name.as_str(), clip.clip.label.as_deref()))
        .collect();
    assert_eq!(
        labels,
        [
            ("d", None),
            ("c", Some("pop")),
            ("a", Some("salsa")),
            ("b", Some("salsa"))
        ]
    );
    let target = &loaded.clips[2].clip;
    for clip in &loaded.clips {
        assert_eq!(clip.clip.skeleton, target.skeleton, "{}", clip.clip.name);
        assert!(
            (-0.02..0.2).contains(&lowest(&clip.clip)),
            "{}: {}",
            clip.clip.name,
            lowest(&clip.clip)
        );
    }
    let retargeted = |clip: usize| {
        loaded.clips[clip]
            .steps
            .iter()
            .any(|step| step.starts_with("retargeted bone by bone"))
    };
    assert_eq!([0, 1, 2, 3].map(retargeted), [true, true, false, false]);
    assert!(
        loaded.clips[0]
            .steps
            .iter()
            .any(|step| step.starts_with("turned from +Z up to Y up")),
        "{:?}",
        loaded.clips[0].steps
    );
    assert_eq!(
        loaded
            .warnings
            .iter()
            .filter(|warning| warning.contains("on another skeleton"))
            .count(),
        2,
        "{:?}",
        loaded.warnings
    );
}

#[test]
fn the_path_grows_with_the_legs() {
    let (small, tall) = (
        figure(&Build {
            legs: 0.8,
            names: Names::Mixamo,
            ..Build::default()
        }),
        figure(&Build::default()),
    );
    let (before, after, _) = onto(dance(&small, 120), &dance(&tall, 120));
    let travelled = |clip: &Clip| (clip.roots[119] - clip.roots[0]).z;
    assert!((travelled(&after) / travelled(&before) - 1.25).abs() < 1e-3);
}

/// Returns a skeleton that is a chain of joints with the given names. Each joint is `offset` away
/// from the one before.
fn flat(names: &[&str], offset: Vec3) -> Skeleton {
    let joint = |(i, name): (usize, &&str)| Joint {
        name: (*name).into(),
        parent: i.checked_sub(1),
        offset,
        ends: vec![Vec3::Y],
    };
    Skeleton {
        joints: names.iter().enumerate().map(joint).collect(),
    }
}

#[test]
fn rest_poses_and_rigs_of_any_kind_do_not_panic() {
    let all = [
        "Hips",
        "LeftUpLeg",
        "RightUpLeg",
        "LeftLeg",
        "RightLeg",
        "LeftFoot",
        "RightFoot",
        "LeftArm",
        "RightArm",
        "LeftForeArm",
        "RightForeArm",
    ];
    let skeleton = flat(&all, Vec3::ZERO);
    let clip = Clip {
        roots: vec![Vec3::ZERO; 60],
        rotations: vec![Quat::IDENTITY; 60 * all.len()],
        ..dance(&skeleton, 60)
    };
    let mut both = settled(vec![clip, dance(&figure(&Build::default()), 90)]);
    let fitted = retarget::onto_one(&mut both);
    assert!(
        fitted.left_out[&0].contains("its legs (LeftUpLeg to LeftFoot) are 0.0000 m long"),
        "{:?}",
        fitted.left_out
    );
}
