//! Footing: what each foot does after a splice. It keeps its place, steps, or lands.
//!
//! In: the dancer's pose and the new motion at a splice. Out: the place of the new motion on the
//! stage, and a path for each foot. Thread: show. Allocates: never.
//!
//! The new motion is shifted so that a foot that stands keeps its place; the body moves over it
//! during the blend. If both feet stand, but their stances differ in width, one foot keeps its place
//! and the other one steps.

use glam::{Quat, Vec3};

use crate::graph::Graph;
use crate::motion::{MOTION_FPS, Pose};

use super::foot_lock::{FEET, Feet, Foot, FootPath, FootPaths, Meeting, Stance};
use super::foot_path::RELEASE_FRAMES;
use super::segment::ClipLine;

/// Largest shift of a new motion that keeps a standing foot in place, in metres.
const SHIFT_MAX: f32 = 0.25;
/// Largest distance along the floor from each foot to its place in a new motion at which both feet
/// keep their places, in metres, after the motion is shifted to the middle of both.
const BOTH_MAX: f32 = 0.06;
/// Shortest and longest duration of the way of a foot to its place in a new motion, in frames.
const WAY_FRAMES: (f64, f64) = (16.0, 0.35 * MOTION_FPS);
/// Additional duration of the way of a foot that lands, in frames for each metre of its length.
const WAY_FRAMES_PER_M: f64 = 50.0;
/// A foot whose stance begins within this number of frames after a splice stands.
const LANDS_FRAMES: f64 = 3.0;
/// Speed along the floor in metres per second above which a foot is in the air.
const STANDING_SPEED_MAX: f32 = 0.5;

/// What the feet do at a splice, in the old and in the new motion.
pub(super) struct Footing {
    /// `[foot]`: stance of the foot in the new motion.
    stances: [Option<Stance>; FEET],
    /// `[foot]`: true if the foot stands in the sent pose.
    stood: [bool; FEET],
    /// `[foot]`: true if the foot stands in the new motion.
    stands: [bool; FEET],
    /// `[foot]`: the point on which the foot stands, in the space of the ankle.
    at: [Vec3; FEET],
    /// `[foot]`: the foot in the sent pose at the splice, and one frame of the new motion later.
    sent: [[Foot; 2]; FEET],
}

/// The two motions at a splice, each with its graph.
pub(super) struct Change<'a> {
    pub old: (&'a Graph, &'a ClipLine),
    pub new: (&'a Graph, &'a ClipLine),
    /// Time between the two poses of the old motion that are compared, in frames of the new one.
    pub step_frames: f64,
}

impl Footing {
    /// Returns what the feet do at a change of motion. `sent` is the sent pose at the splice and
    /// shortly before it; `period` is the time of a beat in seconds.
    pub fn new(feet: &Feet, change: &Change, sent: [&Pose; 2], period: f64) -> Self {
        let ((old_graph, old), (new_graph, new)) = (change.old, change.new);
        let (frame, old_frame) = (new.frame, old.frame_at(new.beat));
        let stances = feet.stances(&new_graph.clips[new.clip as usize], frame);
        let before = feet.stances(&old_graph.clips[old.clip as usize], old_frame);
        let [at, earlier] = sent.map(|pose| feet.of(&new_graph.skeleton, pose));
        let sent: [[Foot; 2]; FEET] =
            std::array::from_fn(|i| continued(&at[i], &earlier[i], change.step_frames));
        let frame_s = (period / new.frames_per_beat.max(1e-6)) as f32;
        let stood = std::array::from_fn(|i| {
            let way = (sent[i][1].place - sent[i][0].place) * Vec3::new(1.0, 0.0, 1.0);
            before[i].is_some_and(|it| it.frames.0 <= old_frame)
                && way.length() <= STANDING_SPEED_MAX * frame_s
        });
        let stands =
            stances.map(|it| it.is_some_and(|it: Stance| it.frames.0 <= frame + LANDS_FRAMES));
        let points = std::array::from_fn(|i| {
            let [old, new] = [before[i], stances[i]].map(|it| it.map_or([false; 2], |it| it.parts));
            let both = [0, 1].map(|part| old[part] && new[part]);
            feet.standing_point(i, if both == [false; 2] { new } else { both })
        });
        Self {
            stances,
            stood,
            stands,
            at: points,
            sent,
        }
    }

    /// Returns true if every foot that stands before and after the splice can keep its heading in
    /// the pose `new` of the new motion.
    pub fn keeps_headings(&self, new: &[Foot; FEET]) -> bool {
        (0..FEET).all(|i| !self.keeps(i) || Feet::may_turn(&self.meeting(i, [new, new])))
    }

    /// Returns the shift of the new motion with which standing feet keep their places; y is 0.
    /// `new` are the feet in the new motion without the shift.
    pub fn shift(&self, new: &[Foot; FEET], root: Vec3) -> Vec3 {
        let away: [Vec3; FEET] =
            std::array::from_fn(|i| self.meeting(i, [new, new]).away(self.at[i]));
        let shift = match [0, 1].map(|i| self.keeps(i)) {
            [true, true] if (away[0] - away[1]).length() <= 2.0 * BOTH_MAX => {
                0.5 * (away[0] + away[1])
            }
            [true, true] => {
                // The foot that carries the body keeps its place.
                let far = self
                    .sent
                    .map(|foot| ((foot[0].place - root) * Vec3::new(1.0, 0.0, 1.0)).length());
                away[usize::from(far[1] < far[0])]
            }
            [true, false] => away[0],
            [false, true] => away[1],
            [false, false] => Vec3::ZERO,
        };
        shift.clamp_length_max(SHIFT_MAX)
    }

    /// Returns the paths of the feet. `new` are the feet in the new motion at the splice and one
    /// frame later, and `frame` is the frame of the splice.
    pub fn paths(&self, new: [&[Foot; FEET]; 2], frame: f64, frames_per_s: f64) -> FootPaths {
        let scale = frames_per_s / MOTION_FPS;
        let (least, most) = (WAY_FRAMES.0 * scale, WAY_FRAMES.1 * scale);
        std::array::from_fn(|i| {
            let (meeting, at) = (self.meeting(i, new), self.at[i]);
            let until = self.stances[i].map_or(f64::INFINITY, |it| it.frames.0 - 2.0 - frame);
            if !self.stood[i] && !self.stands[i] && until > most {
                // The foot is in the air; it blends as the other joints.
                return None;
            }
            let path = match (self.stood[i], self.stands[i], self.stances[i]) {
                (true, true, Some(stance)) if Feet::may_lock(&meeting, at) => {
                    let swing = (stance.next - stance.frames.1).clamp(1.0, RELEASE_FRAMES);
                    FootPath::held(&meeting, at, (frame, most), (stance.frames.1, swing))
                }
                (true, true, _) => FootPath::step(&meeting, at, (frame, most)),
                (true, false, _) => FootPath::step(&meeting, at, (frame, until.clamp(least, most))),
                (false, true, _) => {
                    let way = f64::from(meeting.away(at).length()) * WAY_FRAMES_PER_M;
                    let frames = (frame, (least + way * scale).min(most));
                    FootPath::landing(&meeting, at, frames)
                }
                (false, false, _) => {
                    let frames = (frame, until.clamp(least, most));
                    FootPath::flight(&meeting, at, frames)
                }
            };
            Some(path.at_least_until(frame + most))
        })
    }

    /// Returns true if the foot `i` stands in the sent pose and in the new motion.
    fn keeps(&self, i: usize) -> bool {
        self.stood[i] && self.stands[i]
    }

    fn meeting(&self, i: usize, new: [&[Foot; FEET]; 2]) -> Meeting {
        Meeting {
            sent: self.sent[i],
            clip: new.map(|feet| feet[i]),
        }
    }
}

/// Returns the foot `now`, and where it is one frame later if it goes on as from `before` to `now`,
/// which are `frames` apart.
fn continued(now: &Foot, before: &Foot, frames: f64) -> [Foot; 2] {
    let turned = now.turn * before.turn.inverse();
    let turned = if turned.w < 0.0 { -turned } else { turned };
    let per_frame = 1.0 / frames.max(1e-6) as f32;
    let later = Foot {
        place: now.place + (now.place - before.place) * per_frame,
        turn: Quat::from_scaled_axis(turned.to_scaled_axis() * per_frame) * now.turn,
    };
    [*now, later]
}
