//! The motion graph: all clips as nodes, edges and transitions, in packed tables that do not
//! change.
//!
//! In: analysed clips ([`build`]) or a file ([`mod@file`]).
//! Out: nodes, edges, transitions and poses for the planner and the dancer.
//! Thread: any; shared in an `Arc`, and never changed after it was built or read.
//! Allocates: not during a show.
//! Source: JP5778523, "motion graph"; the meaning of its two-way edges is our interpretation.
//!
//! A node is a motion beat of a clip. The own edge of a node leads to the next beat of the same
//! clip. A transition `i -> j` means: after the dance has arrived at node `i`, it may go on along
//! the edge of node `j` instead of the edge of node `i`; the motion is blended at the start of that
//! edge. So every step of a dance goes along the edge of some node and ends at the end of that
//! edge, which is again a motion beat.

use std::ops::Range;

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::motion::pose::heading;
use crate::motion::{Contact, MOTION_FPS, Mirror, Pose, Skeleton};
use crate::time::Seconds;

pub mod build;
pub mod check;
mod connectivity;
mod fault;
pub mod file;
pub mod reach;
pub mod report;

pub use check::GraphFault;
pub use reach::Reach;

/// Index of a node in [`Graph::nodes`].
pub type NodeId = u32;
/// Index of a label in [`Graph::labels`].
pub type LabelId = u16;

/// The kind of motion of a clip, which decides when the clip is danced. JP5778523 calls it an
/// attribute value.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize,
)]
pub enum Attribute {
    /// The clip has no label: it is danced to music while no label is cued. JP5778523 gives it the
    /// attribute value 0.
    #[default]
    None,
    /// The clip has this label: it is danced while the label is cued.
    Label(LabelId),
    /// The clip is an idle clip: it is danced while there is no music.
    Idle,
}

/// The description of one clip of the graph.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClipInfo {
    /// The name of the clip.
    pub name: String,
    /// The kind of motion of the clip: unlabelled, idle, or with a label.
    pub attribute: Attribute,
    /// Index in [`Graph::roots`] of the clip's first frame. A mirrored clip has the same frames as
    /// its source clip.
    pub first_frame: u32,
    /// The number of frames in the clip.
    pub frames: u32,
    /// Index in [`Graph::nodes`] of the clip's first node.
    pub first_node: NodeId,
    /// The number of nodes (motion beats) in the clip.
    pub nodes: u32,
    /// Beat period of the motion (time from one motion beat to the next), in seconds; one value for
    /// the whole clip.
    pub interval: Seconds,
    /// Regularity of the beats of the motion, from 0 to 1. It is the resultant length R of the
    /// phases of the beat curve's extrema relative to the beats; 1 means that all phases are equal.
    pub quality: f32,
    /// True if the clip is a left-right mirror image; the clip before it is the original and has
    /// the same frames.
    pub mirrored: bool,
    /// The number of frames that were cut off, at the start and the end of the clip in total,
    /// because they showed a calibration pose of the motion capture. The unit is frames of the
    /// motion file.
    pub trimmed: u32,
    /// The number of spikes, flips and other faults of the motion capture that were repaired in
    /// this clip.
    pub spikes: u32,
    /// Descriptions of the cleaning steps that were applied to the clip, one sentence each.
    pub steps: Vec<String>,
    /// The foot contacts (times in which a part of a foot stands on the floor), sorted by joint,
    /// then by part of the foot and then by time.
    pub contacts: Vec<Contact>,
    /// The times at which the beat curve (the curve in which the beats were found) has its extrema,
    /// in frames from the start of the clip. A time may lie between two frames.
    pub extrema: Vec<f32>,
}

/// One motion beat of a clip, which is a node of the graph.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// Index in [`Graph::clips`] of the clip that contains this motion beat.
    pub clip: u32,
    /// Time of the motion beat, in frames from the start of its clip. It may lie between two
    /// frames.
    pub frame: f32,
}

/// The properties of the motion from a node to the next node of its clip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Edge {
    /// The duration of the motion at its original speed, in seconds.
    pub interval_s: f32,
    /// The energy of the motion: the mean speed of the joints in model space, in m/s.
    pub energy: f32,
    /// How regular the motion around the edge is, from 0 (no rhythm) to 1 (the extrema of the beat
    /// curve repeat exactly with the duration of the edge). The beats of the clip were found in the
    /// beat curve. The value is the mean resultant length of circular statistics.
    pub quality: f32,
    /// How well the moments at which the body stands still coincide with the beats of the music,
    /// from 0 to 1. `[0]`: if the edge is danced in one beat; `[1]`: if it is danced in two beats;
    /// `[2]`: if this edge and the next one are danced together in one beat.
    pub hits: [f32; 3],
    /// How far the motion turns away from the direction in which the body faces before and after
    /// it, from 0 (not at all) to 1 (the opposite direction).
    pub away: f32,
}

impl Edge {
    /// Returns all numbers of the edge, in the order in which a graph file has them.
    pub(crate) fn numbers(&self) -> [f32; 7] {
        let [one, two, half] = self.hits;
        [
            self.interval_s,
            self.energy,
            self.quality,
            one,
            two,
            half,
            self.away,
        ]
    }
}

/// A transition from one node to another node, in the same clip or in another one. After it, the
/// dance continues along the edge (motion to the next beat) that begins at the other node.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Transition {
    /// The node at which the dance continues after the transition, along the edge that begins
    /// there.
    pub via: NodeId,
    /// The difference of the poses at the two nodes: 0 for equal poses, 1 at the limit of
    /// similarity, above 1 for a bridge (transition between poses that are not similar). JP5778523
    /// eq. (20).
    pub weight: f32,
}

/// A motion graph in packed tables.
///
/// ```
/// use corybant_core::graph::{Graph, Node, Transition};
///
/// // One clip with three beats; the dancer may repeat its first edge from the last beat.
/// let graph = Graph {
///     nodes: vec![
///         Node { clip: 0, frame: 0.0 },
///         Node { clip: 0, frame: 30.0 },
///         Node { clip: 0, frame: 60.0 },
///     ],
///     transition_starts: vec![0, 0, 0, 1],
///     transitions: vec![Transition { via: 0, weight: 0.2 }],
///     ..Graph::default()
/// };
/// assert_eq!(graph.next(0), Some(1));
/// assert_eq!(graph.next(2), None); // the clip's last beat
/// assert_eq!(graph.transitions_from(2)[0].via, 0);
/// assert_eq!(graph.motion_time(0, 1).0, 0.5); // 30 frames at 60 frames per second
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Graph {
    /// The skeleton that all clips share.
    pub skeleton: Skeleton,
    /// The label names; `Attribute::Label(i)` refers to `labels[i]`.
    pub labels: Vec<String>,
    /// The labels that are danced only while a cue asks for them, in ascending order. All other
    /// labels may be danced without a cue, too.
    pub on_request: Vec<LabelId>,
    /// The clips; nodes and frames are stored in the order of the clips.
    pub clips: Vec<ClipInfo>,
    /// All nodes (motion beats): those of the first clip in time order, then those of the next
    /// clip.
    pub nodes: Vec<Node>,
    /// `[node]`: the properties of the edge that begins at the node; all 0 at the last beat of a
    /// clip.
    pub edges: Vec<Edge>,
    /// `[node]`: index in [`Graph::transitions`] of the node's first transition. One more entry at
    /// the end is the number of all transitions.
    pub transition_starts: Vec<u32>,
    /// All transitions, sorted by the node that they leave.
    pub transitions: Vec<Transition>,
    /// For mirrored clips, the mapping between left and right joints; `None` if no clip is
    /// mirrored.
    pub mirror: Option<Mirror>,
    /// `[frame]`: the value of the beat curve, in which the beats of the clip were found; 0 for
    /// clips without such a curve.
    pub curves: Vec<f32>,
    /// `[frame]`: the position of the root in metres, in the model space of the clip. The frames of
    /// all clips that are not mirrored follow one another.
    pub roots: Vec<Vec3>,
    /// `[frame][joint]`, row-major: the rotation of the joint relative to its parent joint. The
    /// signs of the quaternions are such that consecutive frames follow the shorter arc.
    pub rotations: Vec<Quat>,
    /// The repairs that were made when the graph was built, one sentence each.
    pub repaired: Vec<String>,
}

impl Graph {
    /// Returns the number of stored frames of all clips. Frames that a mirrored clip shares with
    /// its original are counted once.
    pub fn frames(&self) -> usize {
        self.clips
            .iter()
            .filter(|clip| !clip.mirrored)
            .map(|clip| clip.frames as usize)
            .sum()
    }

    /// Returns the next node of the same clip, to which the edge that begins at `node` leads;
    /// `None` if `node` is the last beat of its clip.
    pub fn next(&self, node: NodeId) -> Option<NodeId> {
        let next = node as usize + 1;
        let same_clip =
            next < self.nodes.len() && self.nodes[next].clip == self.nodes[node as usize].clip;
        same_clip.then_some(next as NodeId)
    }

    /// Returns the clip that contains `node`.
    pub fn clip_of(&self, node: NodeId) -> &ClipInfo {
        &self.clips[self.nodes[node as usize].clip as usize]
    }

    /// Returns the attribute (kind of motion) of the clip that contains `node`. The edge that
    /// begins at `node` has the same attribute.
    pub fn attribute(&self, node: NodeId) -> Attribute {
        self.clip_of(node).attribute
    }

    /// Returns the transitions that leave `node`.
    pub fn transitions_from(&self, node: NodeId) -> &[Transition] {
        let range = self.transition_starts[node as usize] as usize
            ..self.transition_starts[node as usize + 1] as usize;
        &self.transitions[range]
    }

    /// Returns the time in seconds from the node `from` to the node `to` of the same clip, at the
    /// original speed of the motion.
    pub fn motion_time(&self, from: NodeId, to: NodeId) -> Seconds {
        Seconds(
            f64::from(self.nodes[to as usize].frame - self.nodes[from as usize].frame) / MOTION_FPS,
        )
    }

    /// Returns the index of the label with the name `name`; `None` if there is no such label. Upper
    /// and lower case must match.
    pub fn label_named(&self, name: &str) -> Option<LabelId> {
        self.labels
            .iter()
            .position(|label| label == name)
            .map(|i| i as LabelId)
    }

    /// Returns the position and rotation of the root at the motion beat `node`, in the model space
    /// of its clip.
    pub fn root_at(&self, node: NodeId) -> (Vec3, Quat) {
        let node = &self.nodes[node as usize];
        let blend = self.frame_blend(node.clip, f64::from(node.frame));
        (self.root(&blend), self.rotation(&blend, 0))
    }

    /// Returns the mean horizontal direction in which the body faces at the motion beats around
    /// `node` in its clip, in the model space of the clip, with a length from 0 (all directions
    /// alike) to 1 (one direction). `beats` are the first beat and the beat after the last one,
    /// counted from `node`.
    pub fn faces(&self, node: NodeId, beats: Range<i32>) -> Vec3 {
        let clip = self.clip_of(node);
        let end = clip.first_node + clip.nodes;
        let first = node.saturating_add_signed(beats.start).max(clip.first_node);
        let last = node.saturating_add_signed(beats.end).clamp(first + 1, end);
        let sum: Vec3 = (first..last)
            .map(|node| heading(self.root_at(node).1) * Vec3::Z)
            .sum();
        sum / (last - first) as f32
    }

    /// Sets `pose` to the pose of the clip with the index `clip` at `frame`, in the model space of
    /// the clip. Between two frames, the pose is interpolated; before the first and after the last
    /// frame, the pose of that frame is used. Does not allocate if `pose` has the right number of
    /// joints.
    pub fn sample(&self, clip: u32, frame: f64, pose: &mut Pose) {
        let blend = self.frame_blend(clip, frame);
        pose.root = self.root(&blend);
        pose.rotations.resize(self.skeleton.len(), Quat::IDENTITY);
        for (joint, rotation) in pose.rotations.iter_mut().enumerate() {
            *rotation = self.rotation(&blend, joint);
        }
    }

    /// Returns the two stored frames around `frame` of the clip with the index `clip`, and how to
    /// interpolate between them.
    fn frame_blend(&self, clip: u32, frame: f64) -> FrameBlend<'_> {
        let info = &self.clips[clip as usize];
        let frame = frame.clamp(0.0, f64::from(info.frames - 1));
        let before = frame as usize;
        let after = (before + 1).min(info.frames as usize - 1);
        let first = info.first_frame as usize;
        let mirror = self.mirror.as_ref().filter(|_| info.mirrored);
        FrameBlend {
            before: first + before,
            after: first + after,
            mix: (frame - before as f64) as f32,
            mirror,
        }
    }

    /// Returns the root position interpolated between the two frames of `at`, and mirrored if the
    /// clip is mirrored.
    fn root(&self, at: &FrameBlend) -> Vec3 {
        let root = self.roots[at.before].lerp(self.roots[at.after], at.mix);
        at.mirror.map_or(root, |mirror| mirror.root(root))
    }

    /// Returns the rotation of the joint with the index `joint` relative to its parent joint,
    /// interpolated between the two frames of `at`, and mirrored if the clip is mirrored.
    fn rotation(&self, at: &FrameBlend, joint: usize) -> Quat {
        let joints = self.skeleton.len();
        let stored = |joint: usize| {
            let (before, after) = (
                self.rotations[at.before * joints + joint],
                self.rotations[at.after * joints + joint],
            );
            before.lerp(after, at.mix).normalize()
        };
        at.mirror.map_or_else(
            || stored(joint),
            |mirror| mirror.turn(joint, stored(mirror.partner(joint))),
        )
    }
}

/// A point in time between two stored frames of a clip, at which poses are interpolated.
struct FrameBlend<'a> {
    /// Index in [`Graph::roots`] of the last stored frame at or before this point in time.
    before: usize,
    /// Index in [`Graph::roots`] of the next stored frame after `before`; equal to `before` at the
    /// end of the clip.
    after: usize,
    /// The weight of the frame `after` in the interpolation, 0 to 1; the frame `before` has the
    /// remaining weight.
    mix: f32,
    /// The mapping between left and right joints; `None` if the clip is not mirrored.
    mirror: Option<&'a Mirror>,
}
