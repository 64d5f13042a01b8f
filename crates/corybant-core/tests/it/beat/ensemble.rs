//! Tests of several dancers in one show: unison, canon, mirroring, call and response, and pads of
//! single dancers.
#![allow(clippy::unwrap_used, missing_docs)]

use crate::common::rig;

use std::sync::Arc;

use corybant_core::beat::tracker::BeatSource;
use corybant_core::cue::launch::Quantise;
use corybant_core::cue::{Cue, DanceCommand, Launch};
use corybant_core::dance::{self, Cues, Turns};
use corybant_core::graph::Attribute;
use corybant_core::motion::Pose;
use corybant_core::show::{Cast, Show};
use corybant_core::time::Seconds;
use glam::Vec3;

use rig::{Rig, beats, embedded};

fn dancer(name: &str, change: impl Fn(&mut dance::Settings)) -> dance::Settings {
    let mut dancer = dance::Settings {
        name: name.into(),
        ..dance::Settings::default()
    };
    change(&mut dancer);
    dancer
}

fn cast(dancers: Vec<dance::Settings>) -> Cast {
    let graph = embedded();
    Cast::new(
        dancers
            .into_iter()
            .map(|dancer| (dancer, graph.clone()))
            .collect(),
    )
    .unwrap()
}

fn rig(cast: Cast) -> Rig {
    Rig::new(
        cast,
        &rig::on_cue(),
        BeatSource::Annotated(beats(120.0, 60.0)),
    )
}

fn pose(show: &Show, dancer: usize, time: f64) -> Pose {
    let mut pose = Pose::rest(show.graph(dancer).skeleton.len());
    show.pose_at(dancer, Seconds(time), &mut pose);
    pose
}

/// Returns the largest angle between corresponding joint rotations of two poses, in radians,
/// without the root.
fn apart(a: &Pose, b: &Pose) -> f32 {
    apart_where(a, b, |_| true)
}

/// Returns the largest angle as [`apart`] does, of the joints for whose index `is_compared` is true.
fn apart_where(a: &Pose, b: &Pose, is_compared: impl Fn(usize) -> bool) -> f32 {
    (0..)
        .zip(a.rotations.iter().zip(&b.rotations))
        .skip(1)
        .filter(|&(joint, _)| is_compared(joint))
        .map(|(_, (a, b))| a.angle_between(*b))
        .fold(0.0, f32::max)
}

/// Returns true for the joints of the legs of the skeleton of `show`.
fn is_leg(show: &Show, joint: usize) -> bool {
    let name = &show.graph(0).skeleton.joints[joint].name;
    ["Leg", "Foot", "Toe"]
        .iter()
        .any(|part| name.contains(part))
}

/// Returns the cues of a tick: label 0 at 8 s with quantisation "now", panic at 20 s, label 1 at 24
/// s.
fn cues(tick: u64) -> Option<Cue> {
    match tick {
        960 => Some(Cue::Dance(DanceCommand::Launch(Launch {
            quantise: Quantise::Now,
            ..Launch::new(0, 8)
        }))),
        2400 => Some(Cue::Dance(DanceCommand::Panic)),
        2880 => Some(Cue::Dance(DanceCommand::Launch(Launch::new(1, 8)))),
        _ => None,
    }
}

/// Returns the poses `[dancer][frame]` of 40 s of a show, at 60 poses per second.
fn danced(rig: &mut Rig) -> Vec<Vec<Pose>> {
    let mut poses = vec![Vec::new(); rig.show.dancers()];
    for tick in 0..40 * 120 {
        let now = rig.now().0;
        rig.tick(cues(tick).as_slice());
        if tick % 2 == 0 {
            (0..poses.len()).for_each(|dancer| poses[dancer].push(pose(&rig.show, dancer, now)));
        }
    }
    poses
}

#[test]
fn followers_copy_their_leader_at_once_or_later() {
    let unison = dancer("b", |it| (it.follows, it.home) = ("a".into(), [2.0, 0.0]));
    let canon = dancer("c", |it| {
        (it.follows, it.delay_beats, it.home) = ("a".into(), 4, [-2.0, 1.0])
    });
    let mut rig = rig(cast(vec![dancer("a", |_| ()), unison, canon]));
    let poses = danced(&mut rig);
    let frames = poses[0].len();
    // Compare after one second, when followers no longer wait. The feet are planted alike, because
    // the homes of the dancers only differ by a shift.
    for (frame, (a, b)) in poses[0].iter().zip(&poses[1]).enumerate().skip(60) {
        assert!(
            apart(a, b) < 0.02,
            "unison at frame {frame}: {}",
            apart(a, b)
        );
        assert!(
            (b.root - a.root - Vec3::X * 2.0).length() < 0.02,
            "frame {frame}: {} and {}",
            a.root,
            b.root
        );
    }
    // Four beats at 120 bpm are 2 s. The feet may be planted differently, because one dancer waited
    // for the other: in a move without steps they stay where they were.
    let without_legs = |a: &Pose, b: &Pose| apart_where(a, b, |joint| !is_leg(&rig.show, joint));
    let late: Vec<f32> = (600..frames)
        .map(|frame| without_legs(&poses[0][frame - 120], &poses[2][frame]))
        .collect();
    let alike = late.iter().filter(|&&apart| apart < 0.05).count();
    assert!(
        alike * 20 > late.len() * 19,
        "only {alike} of {} frames of the canon are the same",
        late.len()
    );
    let moved = (60..frames)
        .map(|frame| apart(&poses[0][frame], &poses[0][frame - 30]))
        .fold(0.0, f32::max);
    assert!(moved > 0.5, "the dancer moved by only {moved} m");
    for (dancer, home) in [Vec3::ZERO, Vec3::X * 2.0, Vec3::new(-2.0, 0.0, 1.0)]
        .into_iter()
        .enumerate()
    {
        let far = poses[dancer]
            .iter()
            .map(|pose| ((pose.root - home) * Vec3::new(1.0, 0.0, 1.0)).length())
            .fold(0.0, f32::max);
        assert!(far <= 3.0, "dancer {dancer} gets {far} m from home");
    }
}

#[test]
fn nobody_jumps_when_following() {
    let canon = dancer("c", |it| (it.follows, it.delay_beats) = ("a".into(), 4));
    let mirrored = dancer("m", |it| (it.follows, it.mirror) = ("a".into(), true));
    let mut rig = rig(cast(vec![dancer("a", |_| ()), canon, mirrored]));
    let skeleton = rig.show.graph(0).skeleton.clone();
    let places = |pose: &Pose| {
        let (mut places, mut turns) = (
            vec![Vec3::ZERO; skeleton.len()],
            vec![glam::Quat::IDENTITY; skeleton.len()],
        );
        pose.forward(&skeleton, &mut places, &mut turns);
        places
    };
    for (dancer, poses) in danced(&mut rig).into_iter().enumerate() {
        let all: Vec<Vec<Vec3>> = poses.iter().map(places).collect();
        let fastest = all.windows(2).flat_map(|pair| {
            pair[0]
                .iter()
                .zip(&pair[1])
                .map(|(a, b)| a.distance(*b) * 60.0)
                .collect::<Vec<_>>()
        });
        let fastest = fastest.fold(0.0, f32::max);
        assert!(fastest < 15.0, "dancer {dancer}: {fastest} m/s");
    }
}

#[test]
fn a_mirrored_dancer_is_the_mirror_image_of_its_leader() {
    let mirrored = dancer("m", |it| {
        (it.follows, it.mirror, it.home) = ("a".into(), true, [0.0, 2.0])
    });
    let poses = danced(&mut rig(cast(vec![dancer("a", |_| ()), mirrored])));
    let graph = embedded();
    let (left, right) = (
        graph
            .skeleton
            .find("LeftFoot")
            .or(graph.skeleton.find("leftFoot")),
        graph.skeleton.find("RightFoot"),
    );
    let (left, right) = (
        left.expect("a left foot"),
        right
            .or(graph.skeleton.find("rightFoot"))
            .expect("a right foot"),
    );
    for (a, m) in poses[0].iter().zip(&poses[1]).skip(60).step_by(7) {
        assert!(
            (m.root - Vec3::new(-a.root.x, a.root.y, a.root.z + 2.0)).length() < 0.02,
            "{} and {}",
            a.root,
            m.root
        );
        let joints = graph.skeleton.len();
        let [mut of_a, mut of_m] = [vec![Vec3::ZERO; joints], vec![Vec3::ZERO; joints]];
        let mut turns = vec![glam::Quat::IDENTITY; joints];
        a.forward(&graph.skeleton, &mut of_a, &mut turns);
        m.forward(&graph.skeleton, &mut of_m, &mut turns);
        for (one, other) in [(left, right), (right, left)] {
            let image = Vec3::new(-of_a[one].x, of_a[one].y, of_a[one].z + 2.0);
            assert!(
                of_m[other].distance(image) < 0.05,
                "{} is not the image of {}",
                of_m[other],
                of_a[one]
            );
        }
    }
}

/// Two dancers may choose the same motions by chance.
#[test]
fn most_dancers_with_one_graph_choose_different_motions() {
    let names = ["a", "b", "c", "d"];
    let poses = danced(&mut rig(cast(
        names.map(|name| dancer(name, |_| ())).to_vec(),
    )));
    let differ = |one: &[Pose], other: &[Pose]| {
        let pairs = one.iter().zip(other).skip(240);
        pairs.filter(|(a, b)| apart(a, b) > 0.2).count()
    };
    let counts: Vec<usize> = (1..4)
        .flat_map(|n| (0..n).map(move |other| (n, other)))
        .map(|(n, other)| differ(&poses[n], &poses[other]))
        .collect();
    let different = counts.iter().filter(|&&count| count > 500).count();
    assert!(
        different >= 3,
        "the pairs of dancers differ in {counts:?} of 2160 frames"
    );
}

#[test]
fn pads_are_shared_or_belong_to_one_dancer() {
    let cast = cast(vec![
        dancer("a", |_| ()),
        dancer("b", |it| it.cues = Cues::Own),
        dancer("c", |it| it.cues = Cues::Both),
    ]);
    let labels = embedded().labels.clone();
    let own = |name: &str| {
        labels
            .iter()
            .map(|label| format!("{name}/{label}"))
            .collect::<Vec<_>>()
    };
    assert_eq!(cast.pads(), [labels.clone(), own("b"), own("c")].concat());
    let pad = |name: String| cast.pads().iter().position(|pad| *pad == name).unwrap() as u16;
    let (shared, of_b) = (pad(labels[0].clone()), pad(format!("b/{}", labels[0])));
    for (hit, answers) in [(shared, [true, false, true]), (of_b, [false, true, false])] {
        let mut rig = rig(cast.clone());
        rig.run_until(8.0, |_, _, _| ());
        rig.tick(&[Cue::Dance(DanceCommand::Launch(Launch::new(hit, 16)))]);
        let mut heard = [false; 3];
        rig.run_until(15.0, |show, _, _| {
            for (dancer, heard) in heard.iter_mut().enumerate() {
                *heard |= matches!(show.status(dancer).attribute, Attribute::Label(_));
            }
        });
        assert_eq!(heard, answers, "pad {}", cast.pads()[usize::from(hit)]);
    }
}

#[test]
fn dancers_that_take_turns_idle_between_their_turns() {
    let turn = |mine| {
        Some(Turns {
            beats: 8,
            of: 2,
            mine,
        })
    };
    let mut rig = rig(cast(vec![
        dancer("call", |it| it.turns = turn(1)),
        dancer("response", |it| it.turns = turn(2)),
    ]));
    let mut counts = [[0; 2]; 2];
    rig.run_until(48.0, |show, now, _| {
        let turn = show.song_beat().map(|beat| beat.div_euclid(8.0) as i64);
        let Some(turn) = turn.filter(|_| now.0 > 8.0) else {
            return;
        };
        // In the first beats of a turn, the dancer moves to or from idle.
        if show.song_beat().unwrap().rem_euclid(8.0) > 4.0 {
            for dancer in 0..2 {
                counts[dancer][usize::from(
                    (turn.rem_euclid(2) == dancer as i64)
                        == (show.status(dancer).attribute != Attribute::Idle),
                )] += 1;
            }
        }
    });
    for (dancer, [wrong, right]) in counts.into_iter().enumerate() {
        assert!(
            right > 9 * wrong,
            "dancer {dancer} danced or idled at the wrong time in {wrong} checks, at the right time in {right}"
        );
    }
}

#[test]
fn an_impossible_cast_is_rejected() {
    let graph = embedded();
    let refused = |dancers: Vec<dance::Settings>| {
        Cast::new(
            dancers
                .into_iter()
                .map(|dancer| (dancer, Arc::clone(&graph)))
                .collect(),
        )
        .err()
        .map(|error| error.to_string())
    };
    let follows = |name: &str, whom: &str| dancer(name, |it| it.follows = whom.into());
    assert!(
        refused(vec![follows("a", "b")])
            .unwrap()
            .contains("\"a\" follows \"b\"")
    );
    assert!(
        refused(vec![
            dancer("a", |_| ()),
            follows("b", "a"),
            follows("c", "b")
        ])
        .unwrap()
        .contains("that follows nobody")
    );
    assert!(
        refused(vec![dancer("a", |it| it.start = "nowhere".into())])
            .unwrap()
            .contains("no such clip")
    );
    assert!(refused(Vec::new()).is_some());
    let last = graph
        .clips
        .iter()
        .rposition(|clip| clip.attribute == Attribute::None && clip.nodes > 1)
        .unwrap();
    let started = rig(cast(vec![dancer("a", |it| {
        it.start = graph.clips[last].name.clone()
    })]));
    assert_eq!(started.show.status(0).clip as usize, last);
}
