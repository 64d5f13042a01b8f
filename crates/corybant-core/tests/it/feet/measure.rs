//! Slides of feet as a viewer sees them.
//!
//! A point of a foot is its ankle (*heel*), or its toe joint or, without one, the tip of the foot
//! (*toe*). A point is in contact while the source motion, before its feet were planted, has it
//! near the floor and almost still. A *slide* is the largest distance along the floor of the sent
//! point from its place at the start of a time in which it is in contact and not lifted. Such a
//! time may reach across a transition.

use corybant_core::graph::Graph;
use corybant_core::motion::humanoid::{Bone, Humanoid};
use corybant_core::motion::{MOTION_FPS, Pose, Skeleton};
use glam::{Quat, Vec3};

use super::dances::{Dance, Motions};

/// Largest height of a point in contact above its lowest height in the clip, in metres.
const NEAR_M: f32 = 0.03;
/// Largest speed along the floor of a point in contact, in metres per second.
const STILL_M_S: f32 = 0.25;
/// Shortest contact, in frames.
const FRAMES_MIN: usize = 6;
/// A sent point that is higher than in the source by more than this is lifted, in metres.
const LIFTED_M: f32 = 0.02;

/// A point of a foot: the joint with which it moves, and its position in the joint's space.
pub type Point = (usize, Vec3);

/// Returns the points of the feet of `skeleton`: left heel, left toe, right heel, right toe.
pub fn points(skeleton: &Skeleton) -> Vec<Point> {
    let humanoid = Humanoid::new(skeleton);
    let joint = |bone| Some(humanoid.bones[humanoid.find(bone)?].joint);
    let sides = [
        (Bone::LeftFoot, Bone::LeftToes),
        (Bone::RightFoot, Bone::RightToes),
    ];
    let mut points = Vec::new();
    for (foot, toes) in sides {
        let Some(ankle) = joint(foot) else { continue };
        points.push((ankle, Vec3::ZERO));
        let tip = skeleton.joints[ankle]
            .ends
            .iter()
            .copied()
            .max_by(|a, b| a.length().total_cmp(&b.length()));
        points.extend(
            joint(toes)
                .map(|toe| (toe, Vec3::ZERO))
                .or(tip.map(|tip| (ankle, tip))),
        );
    }
    points
}

/// Returns the places of all joints of a pose, and of `points`.
fn places(skeleton: &Skeleton, pose: &Pose, points: &[Point]) -> (Vec<Vec3>, Vec<Vec3>) {
    let mut joints = vec![Vec3::ZERO; skeleton.len()];
    let mut turns = vec![Quat::IDENTITY; skeleton.len()];
    pose.forward(skeleton, &mut joints, &mut turns);
    let of = |&(joint, at): &Point| joints[joint] + turns[joint] * at;
    let points = points.iter().map(of).collect();
    (joints, points)
}

fn flat(place: Vec3) -> Vec3 {
    Vec3::new(place.x, 0.0, place.z)
}

/// The points of the feet in one clip of the source: `[point][frame]`.
struct SourceClip {
    places: Vec<Vec<Vec3>>,
    contact: Vec<Vec<bool>>,
}

fn source_clip(graph: &Graph, clip: u32, points: &[Point]) -> SourceClip {
    let frames = graph.clips[clip as usize].frames as usize;
    let mut pose = Pose::rest(graph.skeleton.len());
    let mut all = vec![Vec::with_capacity(frames); points.len()];
    for frame in 0..frames {
        graph.sample(clip, frame as f64, &mut pose);
        let at = places(&graph.skeleton, &pose, points).1;
        all.iter_mut().zip(at).for_each(|(all, at)| all.push(at));
    }
    let contact = all.iter().map(|places| contact_of(places)).collect();
    SourceClip {
        places: all,
        contact,
    }
}

/// Returns for each frame whether a point with the path `places` is in contact with the floor.
fn contact_of(places: &[Vec3]) -> Vec<bool> {
    let mut heights: Vec<f32> = places.iter().map(|place| place.y).collect();
    heights.sort_by(f32::total_cmp);
    let near = heights[heights.len() / 20] + NEAR_M;
    let still = |frame: usize| {
        let (a, b) = (frame.saturating_sub(1), (frame + 1).min(places.len() - 1));
        let way = flat(places[b] - places[a]).length();
        places[frame].y <= near && way * MOTION_FPS as f32 <= STILL_M_S * (b - a).max(1) as f32
    };
    let mut contact: Vec<bool> = (0..places.len()).map(still).collect();
    let mut from = 0;
    for run in contact.clone().chunk_by(|a, b| a == b) {
        if run.len() < FRAMES_MIN {
            contact[from..from + run.len()].fill(false);
        }
        from += run.len();
    }
    contact
}

/// Where a slide happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    Clip,
    Transition,
    Correction,
}

/// One time in which a point of a foot stands.
#[derive(Clone, Copy, Debug)]
pub struct Slide {
    pub metres: f32,
    pub cause: Cause,
    /// Index of the point, and of the first and the last pose.
    pub at: (usize, usize, usize),
}

/// The figures of one dance.
pub struct Figures {
    pub slides: Vec<Slide>,
    /// The slides of the source motions themselves, without transitions.
    pub source: Vec<f32>,
    /// Largest speed of a joint, in metres per second, and the same in the source.
    pub speeds: [f32; 2],
    /// Largest change of the bend of a knee in one pose, in radians, and the same in the source.
    pub knees: [f32; 2],
    pub transitions: usize,
}

/// Returns the largest distance along the floor from the first of `places`.
fn slide(places: impl IntoIterator<Item = Vec3>) -> f32 {
    let mut places = places.into_iter().map(flat);
    let first = places.next().unwrap_or_default();
    places.fold(0.0, |most, place| most.max(place.distance(first)))
}

/// Returns the angle at each knee of `places`, the places of all joints.
fn knees(legs: &[[usize; 3]], places: &[Vec3]) -> Vec<f32> {
    let angle = |&[hip, knee, ankle]: &[usize; 3]| {
        (places[hip] - places[knee]).angle_between(places[ankle] - places[knee])
    };
    legs.iter().map(angle).collect()
}

fn legs(skeleton: &Skeleton) -> Vec<[usize; 3]> {
    use Bone::{LeftFoot, LeftLowerLeg, LeftUpperLeg, RightFoot, RightLowerLeg, RightUpperLeg};
    let humanoid = Humanoid::new(skeleton);
    let joint = |bone| Some(humanoid.bones[humanoid.find(bone)?].joint);
    [
        [LeftUpperLeg, LeftLowerLeg, LeftFoot],
        [RightUpperLeg, RightLowerLeg, RightFoot],
    ]
    .into_iter()
    .filter_map(|leg| Some([joint(leg[0])?, joint(leg[1])?, joint(leg[2])?]))
    .collect()
}

/// Measures `dance`, a dance on `motions`.
pub fn measure(motions: &Motions, dance: &Dance) -> Figures {
    let skeleton = &motions.graph.skeleton;
    let (points, legs) = (points(skeleton), legs(skeleton));
    let clips: Vec<SourceClip> = (0..motions.source.clips.len())
        .map(|clip| source_clip(&motions.source, clip as u32, &points))
        .collect();
    let mut raw = Pose::rest(skeleton.len());
    let (mut sent, mut stands, mut source) = (Vec::new(), Vec::new(), Vec::new());
    let (mut speeds, mut bends) = ([0.0_f32; 2], [0.0_f32; 2]);
    let mut before: Option<[Vec<Vec3>; 2]> = None;
    for (i, tick) in dance.ticks.iter().enumerate() {
        let line = &dance.lines[tick.line];
        let frame = line.frame_at(tick.beat);
        let clip = &clips[line.clip as usize];
        let whole = (frame.round() as usize).min(clip.places[0].len() - 1);
        let (joints, at) = places(skeleton, &tick.pose, &points);
        motions.source.sample(line.clip, frame, &mut raw);
        let (raw_joints, raw_at) = places(skeleton, &raw, &points);
        let new_line = i > 0 && dance.ticks[i - 1].line != tick.line;
        if let Some(before) = &before {
            for (n, (now, before)) in [&joints, &raw_joints].into_iter().zip(before).enumerate() {
                if n == 1 && new_line {
                    continue;
                }
                let far = now.iter().zip(before).map(|(a, b)| a.distance(*b));
                speeds[n] = far.fold(speeds[n], |a, b| a.max(b * MOTION_FPS as f32));
                let bend = knees(&legs, now).into_iter().zip(knees(&legs, before));
                bends[n] = bend.fold(bends[n], |most, (a, b)| most.max((a - b).abs()));
            }
        }
        let stand = |point: usize| clip.contact[point][whole];
        let low = |point: usize| at[point].y <= raw_at[point].y + LIFTED_M;
        stands.push(
            (0..points.len())
                .map(|point| [stand(point), stand(point) && low(point)])
                .collect::<Vec<_>>(),
        );
        before = Some([joints, raw_joints]);
        sent.push(at);
        source.push(raw_at);
    }
    let mut figures = Figures {
        slides: Vec::new(),
        source: Vec::new(),
        speeds,
        knees: bends,
        transitions: dance.lines.iter().filter(|it| it.is_transition).count(),
    };
    for point in 0..points.len() {
        let mut from = 0;
        while from < sent.len() {
            let runs = |n: usize, same_line: bool| {
                (from..sent.len())
                    .take_while(|&i| stands[i][point][n])
                    .take_while(|&i| !same_line || i == from || !changes(dance, i))
                    .count()
            };
            let run = runs(1, false);
            if run >= FRAMES_MIN {
                figures.slides.push(Slide {
                    metres: slide(sent[from..from + run].iter().map(|at| at[point])),
                    cause: cause(dance, from, from + run - 1),
                    at: (point, from, from + run - 1),
                });
            }
            from += run.max(1);
        }
        from = 0;
        while from < source.len() {
            let run = (from..source.len())
                .take_while(|&i| stands[i][point][0] && (i == from || !changes(dance, i)))
                .count();
            if run >= FRAMES_MIN {
                let slid = slide(source[from..from + run].iter().map(|at| at[point]));
                figures.source.push(slid);
            }
            from += run.max(1);
        }
    }
    figures
}

/// Returns true if the motion changes between the pose `tick` and the pose before it.
pub fn changes(dance: &Dance, tick: usize) -> bool {
    let (line, before) = (dance.ticks[tick].line, dance.ticks[tick - 1].line);
    line != before && (dance.lines[line].is_transition || dance.lines[line].is_correction)
}

/// Returns the cause of a slide between the poses `from` and `to`: what happened in this time or in
/// the 0.6 s before it.
fn cause(dance: &Dance, from: usize, to: usize) -> Cause {
    let lines = (from.saturating_sub(36)..=to)
        .filter(|&i| i > 0 && changes(dance, i))
        .map(|i| &dance.lines[dance.ticks[i].line]);
    let mut cause = Cause::Clip;
    for line in lines {
        if line.is_transition {
            return Cause::Transition;
        }
        cause = Cause::Correction;
    }
    cause
}

/// Returns the value below which `share` of `values` lie.
pub fn percentile(values: &[f32], share: f64) -> f32 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f32::total_cmp);
    sorted
        .get(((sorted.len().max(1) - 1) as f64 * share) as usize)
        .copied()
        .unwrap_or(0.0)
}

pub fn trace(motions: &Motions, dance: &Dance, point: usize, ticks: std::ops::Range<usize>) {
    let skeleton = &motions.graph.skeleton;
    let points = points(skeleton);
    let mut raw = Pose::rest(skeleton.len());
    for i in ticks {
        let tick = &dance.ticks[i];
        let line = &dance.lines[tick.line];
        let clip = source_clip(&motions.source, line.clip, &points);
        let frame = line.frame_at(tick.beat);
        motions.source.sample(line.clip, frame, &mut raw);
        let a = places(skeleton, &tick.pose, &points).1[point];
        let b = places(skeleton, &raw, &points).1[point];
        let c: Vec<_> = motions.graph.clips[line.clip as usize]
            .contacts
            .iter()
            .filter(|c| {
                usize::from(c.joint) == points[point / 2 * 2].0
                    && f64::from(c.first) <= frame
                    && frame <= f64::from(c.last)
            })
            .map(|c| (c.part, c.first, c.last))
            .collect();
        println!(
            "    T {point} {i} {} {frame:.1} sent {:.3} {:.3} {:.3} srcy {:.3} {} {c:?} {}",
            motions.graph.clips[line.clip as usize].name,
            a.x,
            a.y,
            a.z,
            b.y,
            clip.contact[point][frame.round() as usize],
            if changes(dance, i) { "SPLICE" } else { "" }
        );
    }
}
