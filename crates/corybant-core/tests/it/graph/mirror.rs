//! Tests of mirrored clips: they use the frames and the beats of their source, and every pose is
//! the mirror image of the source's pose.
#![allow(clippy::unwrap_used, missing_docs)]

use crate::common::clips;

use clips::{clip, holds, plan};
use corybant_core::graph::Graph;
use corybant_core::graph::build::{Settings, build};
use corybant_core::graph::file::{from_bytes, to_bytes};
use corybant_core::motion::{Contact, FootPart, Pose};
use glam::{Quat, Vec3};

fn mirrored(names: [&str; 2]) -> Graph {
    let mut source = clip(&plan("a", None, 20, 3));
    source.mirror = true;
    source.contacts = vec![Contact {
        joint: 5,
        part: FootPart::Heel,
        first: 10,
        last: 20,
    }];
    source.clip.skeleton.joints[3].name = names[0].into();
    source.clip.skeleton.joints[4].name = names[1].into();
    let mut plain = clip(&plan("b", Some("b"), 12, 4));
    plain.clip.skeleton = source.clip.skeleton.clone();
    build(vec![source, plain], &Settings::default(), &mut |_| ()).unwrap()
}

#[test]
fn a_mirrored_clip_shares_its_frames_and_shows_their_mirror_image() {
    let graph = mirrored(["LeftArm", "RightArm"]);
    holds(&graph);
    let names: Vec<&str> = graph.clips.iter().map(|clip| clip.name.as_str()).collect();
    assert_eq!(names, ["a", "a (mirrored)", "b", "idle (generated)"]);
    let (source, image) = (&graph.clips[0], &graph.clips[1]);
    assert_eq!(
        (image.first_frame, image.frames, image.nodes),
        (source.first_frame, source.frames, source.nodes)
    );
    assert_eq!(
        graph.frames(),
        graph.roots.len(),
        "a mirrored clip has no frames of its own"
    );
    assert_eq!(
        image.contacts,
        [Contact {
            joint: 6,
            part: FootPart::Heel,
            first: 10,
            last: 20
        }]
    );

    let joints = graph.skeleton.len();
    let places = |clip: u32, frame: f64| {
        let (mut pose, mut places, mut turned) = (
            Pose::default(),
            vec![Vec3::ZERO; joints],
            vec![Quat::IDENTITY; joints],
        );
        graph.sample(clip, frame, &mut pose);
        pose.forward(&graph.skeleton, &mut places, &mut turned);
        places
    };
    for frame in [0.0, 7.3, 100.5, 400.0] {
        let (own, seen) = (places(0, frame), places(1, frame));
        for (joint, partner) in [(0, 0), (1, 1), (2, 2), (3, 4), (4, 3), (5, 6), (6, 5)] {
            let image = own[partner] * Vec3::new(-1.0, 1.0, 1.0);
            assert!(
                seen[joint].abs_diff_eq(image, 1e-4),
                "joint {joint} at frame {frame}: {} instead of {image}",
                seen[joint]
            );
        }
    }
    let nodes = (
        source.first_node as usize,
        image.first_node as usize,
        source.nodes as usize,
    );
    assert!(
        (0..nodes.2).all(|i| graph.edges[nodes.0 + i] == graph.edges[nodes.1 + i]),
        "a mirrored edge equals its source edge"
    );
    assert_eq!(from_bytes(&to_bytes(&graph)).unwrap(), graph);
}

#[test]
fn an_asymmetric_skeleton_is_not_mirrored_and_reported() {
    let mut lame = clip(&plan("a", None, 20, 3));
    lame.mirror = true;
    lame.clip.skeleton.joints[4].offset.x = -0.7;
    lame.clip.skeleton.joints[4].name = "Hook".into();
    let graph = build(vec![lame], &Settings::default(), &mut |_| ()).unwrap();
    assert!(graph.mirror.is_none() && graph.clips.iter().all(|clip| !clip.mirrored));
    assert!(
        graph
            .repaired
            .iter()
            .any(|line| line.starts_with("no clip is mirrored")),
        "{:#?}",
        graph.repaired
    );
}
