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
type Point = (usize, Vec3);

/// Returns the points of the feet of `skeleton`: left heel, left toe, right heel, right toe.
fn points(skeleton: &Skeleton) -> Vec<Point> {
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

/// Returns `[point][frame]`: true if the point is in contact in a clip.
fn contacts(graph: &Graph, clip: u32, points: &[Point]) -> Vec<Vec<bool>> {
    let frames = graph.clips[clip as usize].frames as usize;
    let mut pose = Pose::rest(graph.skeleton.len());
    let mut all = vec![Vec::with_capacity(frames); points.len()];
    for frame in 0..frames {
        graph.sample(clip, frame as f64, &mut pose);
        let at = places(&graph.skeleton, &pose, points).1;
        all.iter_mut().zip(at).for_each(|(all, at)| all.push(at));
    }
    all.iter().map(|places| contact_of(places)).collect()
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

/// The points of the feet in each pose of a dance.
#[derive(Default)]
struct Tracks {
    /// `[pose][point]`: place in the sent pose, and in the source in its own coordinates.
    sent: Vec<Vec<Vec3>>,
    source: Vec<Vec<Vec3>>,
    /// `[pose][point]`: true if the point is in contact in the source.
    contact: Vec<Vec<bool>>,
}

impl Tracks {
    /// Returns true if the sent point is in contact, and not lifted.
    fn stands(&self, pose: usize, point: usize) -> bool {
        let lift = self.sent[pose][point].y - self.source[pose][point].y;
        self.contact[pose][point] && lift <= LIFTED_M
    }

    /// Returns the slides of `point` in the source motions.
    fn source_slides(&self, dance: &Dance, point: usize) -> Vec<f32> {
        let goes_on = |pose: usize| !changes(dance, pose);
        let runs = runs(self.sent.len(), |pose| self.contact[pose][point], goes_on);
        runs.map(|(from, to)| slide(self.source[from..=to].iter().map(|at| at[point])))
            .collect()
    }

    /// Returns the slides of `point` in the dance.
    fn slides(&self, dance: &Dance, point: usize) -> Vec<Slide> {
        let runs = runs(self.sent.len(), |pose| self.stands(pose, point), |_| true);
        runs.map(|(from, to)| Slide {
            metres: slide(self.sent[from..=to].iter().map(|at| at[point])),
            cause: cause(dance, from, to),
        })
        .collect()
    }
}

/// Returns the first and the last pose of each time in which `stands` is true. A new time begins
/// where `goes_on` is false.
fn runs(
    poses: usize,
    stands: impl Fn(usize) -> bool,
    goes_on: impl Fn(usize) -> bool,
) -> impl Iterator<Item = (usize, usize)> {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for pose in (0..poses).filter(|&pose| stands(pose)) {
        match runs.last_mut() {
            Some(last) if last.1 + 1 == pose && goes_on(pose) => last.1 = pose,
            _ => runs.push((pose, pose)),
        }
    }
    let long = |it: &(usize, usize)| it.1 + 1 - it.0 >= FRAMES_MIN;
    runs.into_iter().filter(long)
}

/// The largest speeds of joints and knees, each in the dance and in the source.
#[derive(Default)]
struct Extremes {
    speeds: [f32; 2],
    knees: [f32; 2],
    /// The places of the joints in the pose before.
    before: [Vec<Vec3>; 2],
}

impl Extremes {
    /// Adds a pose. `changed` is true if the motion has changed since the pose before.
    fn add(&mut self, legs: &[[usize; 3]], now: [Vec<Vec3>; 2], changed: bool) {
        for (n, (now, before)) in now.iter().zip(&self.before).enumerate() {
            if before.is_empty() || n == 1 && changed {
                continue;
            }
            let far = now.iter().zip(before).map(|(a, b)| a.distance(*b));
            let speeds = far.map(|far| far * MOTION_FPS as f32);
            self.speeds[n] = speeds.fold(self.speeds[n], f32::max);
            let bends = knees(legs, now).into_iter().zip(knees(legs, before));
            let bends = bends.map(|(a, b)| (a - b).abs());
            self.knees[n] = bends.fold(self.knees[n], f32::max);
        }
        self.before = now;
    }
}

/// Measures `dance`, a dance on `motions`.
pub fn measure(motions: &Motions, dance: &Dance) -> Figures {
    let skeleton = &motions.graph.skeleton;
    let (points, legs) = (points(skeleton), legs(skeleton));
    let clips: Vec<Vec<Vec<bool>>> = (0..motions.source.clips.len())
        .map(|clip| contacts(&motions.source, clip as u32, &points))
        .collect();
    let mut raw = Pose::rest(skeleton.len());
    let (mut tracks, mut extremes) = (Tracks::default(), Extremes::default());
    for (i, tick) in dance.ticks.iter().enumerate() {
        let line = &dance.lines[tick.line];
        let frame = line.frame_at(tick.beat);
        motions.source.sample(line.clip, frame, &mut raw);
        let (joints, sent) = places(skeleton, &tick.pose, &points);
        let (raw_joints, source) = places(skeleton, &raw, &points);
        let changed = i > 0 && changes(dance, i);
        extremes.add(&legs, [joints, raw_joints], changed);
        let clip = &clips[line.clip as usize];
        let contact = clip
            .iter()
            .map(|contact| contact[(frame.round() as usize).min(contact.len() - 1)]);
        tracks.contact.push(contact.collect());
        tracks.sent.push(sent);
        tracks.source.push(source);
    }
    let all = 0..points.len();
    Figures {
        slides: all
            .clone()
            .flat_map(|it| tracks.slides(dance, it))
            .collect(),
        source: all.flat_map(|it| tracks.source_slides(dance, it)).collect(),
        speeds: extremes.speeds,
        knees: extremes.knees,
        transitions: dance.lines.iter().filter(|it| it.is_transition).count(),
    }
}

/// Returns true if the motion changes between the pose `tick` and the pose before it.
fn changes(dance: &Dance, tick: usize) -> bool {
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
