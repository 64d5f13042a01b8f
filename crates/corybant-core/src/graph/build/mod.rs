//! Builds a motion graph.
//!
//! In: cleaned and analysed clips.
//! Out: a packed graph without dead ends.
//! Thread: any, offline; pure; uses all processors.
//! Allocates: freely.
//! Source: JP5778523, "motion graph".
//!
//! As in the patent, the nodes are all motion beats of all clips; a one-way edge leads from a beat
//! to the next beat of the same clip; and a two-way edge (two transitions) joins two similar poses.
//! There are three additions: similar poses are found as nearest neighbours instead of by one
//! threshold, bridges (transitions between poses that are not similar) are added before nodes are
//! pruned, and an idle clip is generated if no clip is idle.

use std::collections::BTreeSet;

use thiserror::Error;

mod bridge;
mod connect;
mod edges;
mod extend;
mod features;
pub mod idle;
mod labels;
pub mod metric;
pub mod neighbours;
mod projection;
mod reach_repair;
mod search;
pub mod settings;

pub use extend::extend;
pub use settings::{Distance, Rule, Settings};

use super::check::GraphFault;
use super::{Attribute, ClipInfo, Graph, LabelId, Node};
use crate::motion::{Analysed, Clip, Contact, MOTION_FPS, Mirror, MotionBeats, Skeleton};
use connect::connect;
use labels::{label_of, on_request};
use metric::PoseMetric;
use neighbours::similar_pairs;

/// The suffix that is added to the name of a mirrored clip.
pub const MIRRORED_ENDING: &str = " (mirrored)";

/// The progress of a graph build, 0 to 1, that is reported when all poses have been compared. The
/// steps after the comparison make up the rest.
const COMPARISON_SHARE: f32 = 0.9;
/// The largest allowed difference between a bone of a clip and the same bone of the first clip, as
/// a fraction of the height of the first clip's rest pose. A bone is the vector from a joint to its
/// child joint; the difference is the length of the difference of the two vectors.
const BONES_DIFFER_MAX: f32 = 0.01;

/// The reasons why a graph cannot be built.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum BuildError {
    /// At least one setting is out of range.
    #[error("the graph's settings are not allowed: {}", problems.join(" "))]
    Settings {
        /// One sentence for each setting that is out of range.
        problems: Vec<String>,
    },
    /// None of the clips has two beats or more.
    #[error(
        "there is no motion to build a graph from: none of {clips} clips has two beats; give at least one that moves rhythmically"
    )]
    NothingToDance {
        /// Number of clips that were given to the graph builder.
        clips: usize,
    },
    /// A clip is inconsistent, for example it has beats outside of its frames.
    #[error("clip \"{clip}\" {problem}")]
    Clip {
        /// The name of the inconsistent clip.
        clip: String,
        /// The defect of the clip, as the end of a sentence that begins with the name of the clip.
        problem: String,
    },
    /// A clip has other joints than the first clip, whose skeleton the graph uses.
    #[error(
        "clip \"{clip}\" has other joints than \"{first}\"; a graph has one skeleton: leave one of them out"
    )]
    OtherSkeleton {
        /// Name of the clip whose joints differ.
        clip: String,
        /// Name of the first clip, whose skeleton the graph uses.
        first: String,
    },
    /// A clip has the same joints as the first clip, but the length or direction of a bone differs
    /// too much.
    #[error(
        "clip \"{clip}\" has bones that differ from those of \"{first}\" by up to {differ_m:.3} m; a graph has one skeleton: retarget it first"
    )]
    OtherBones {
        /// Name of the clip whose bones differ.
        clip: String,
        /// Name of the first clip, whose skeleton the graph uses.
        first: String,
        /// Largest difference of a bone (vector from joint to child joint), in metres.
        differ_m: f32,
    },
    /// The setting `joint_weights` contains the name of a joint that the skeleton does not have.
    #[error(
        "joint_weights names \"{joint}\", which the skeleton does not have; its joints are {joints}"
    )]
    UnknownJoint {
        /// The name in the setting `joint_weights` that no joint has.
        joint: String,
        /// The names of the skeleton's joints, separated by commas.
        joints: String,
    },
    /// The clips together have more labels, frames or beats than a graph can have, because it
    /// numbers them with integers of limited size.
    #[error(
        "there are too many {what}: {found}, and a graph can number {allowed}; give fewer or shorter clips"
    )]
    TooMany {
        /// The elements that were counted: "labels", "frames" or "beats".
        what: &'static str,
        /// Number of labels, frames or beats that the clips have.
        found: u64,
        /// Greatest number of labels, frames or beats that a graph can have.
        allowed: u64,
    },
    /// The finished graph does not pass [`Graph::check`], which is a bug in the builder.
    #[error(
        "the graph that was built is not fit to be danced: {0}; this is an error in the program"
    )]
    Unfit(#[from] GraphFault),
}

/// Builds the motion graph of `clips`. Calls `progress` with the completed fraction of the work, 0
/// to 1.
///
/// Clips with fewer than two beats are left out. [`Graph::repaired`] lists what was left out,
/// bridged (joined by a transition between poses that are not similar) or pruned. The same clips in
/// the same order always give the same graph.
///
/// # Errors
/// [`BuildError`] if a setting is wrong, if no clip can be danced, if a clip is inconsistent or has
/// other joints or bones than the first clip, or if there are too many labels, frames or beats.
pub fn build(
    clips: Vec<Analysed>,
    settings: &Settings,
    progress: &mut dyn FnMut(f32),
) -> Result<Graph, BuildError> {
    let mut problems = Vec::new();
    settings.check("graph", &mut problems);
    if !problems.is_empty() {
        return Err(BuildError::Settings { problems });
    }
    progress(0.0);
    let mut notes = Vec::new();
    let clips = danceable(clips, &mut notes)?;
    let mirror_asked = clips.iter().any(|analysed| analysed.mirror);
    let mut graph = lay_out(clips)?;
    if mirror_asked && graph.mirror.is_none() {
        notes.push(
            "no clip is mirrored: the skeleton's joints do not pair up left and right".into(),
        );
    }
    graph.repaired = notes;
    check_weights(&graph.skeleton, settings)?;

    let metric = PoseMetric::new(&graph, settings);
    let pairs = similar_pairs(&graph, &metric, settings, &mut |done| {
        progress(done * COMPARISON_SHARE)
    });
    progress(COMPARISON_SHARE);
    let mut graph = connect(graph, &metric, pairs, settings);
    graph.edges = edges::edges(&graph);
    graph.check()?;
    progress(1.0);
    Ok(graph)
}

/// Returns the clips that have at least two beats, all with the skeleton of the first of them. Adds
/// a generated idle clip (motion without music) if none of them is idle. Adds a sentence to `notes`
/// for everything that is left out, changed or added.
fn danceable(clips: Vec<Analysed>, notes: &mut Vec<String>) -> Result<Vec<Analysed>, BuildError> {
    let (given, idle_given) = (clips.len(), clips.iter().any(|analysed| analysed.clip.idle));
    let asked: BTreeSet<String> = clips
        .iter()
        .filter_map(|analysed| label_of(&analysed.clip))
        .collect();
    let mut kept: Vec<Analysed> = Vec::with_capacity(given + 1);
    for mut analysed in clips {
        if analysed.clip.idle && analysed.beats.is_none() {
            analysed.beats = idle::still_beats(analysed.clip.frames());
        }
        let beats = analysed
            .beats
            .as_ref()
            .map_or(0, |beats| beats.frames.len());
        if beats < 2 {
            notes.push(format!(
                "left out \"{}\": it has {beats} beats, and a dance needs two",
                analysed.clip.name
            ));
            continue;
        }
        check_clip(&analysed)?;
        if let Some(first) = kept.first() {
            adopt_bones(&mut analysed.clip, &first.clip.skeleton, &first.clip.name)?;
        }
        if !analysed.clip.sliding.is_empty() {
            let clip = &analysed.clip;
            let joints: Vec<&str> = clip
                .sliding
                .iter()
                .filter_map(|it| Some(clip.skeleton.joints.get(it.joint)?.name.as_str()))
                .collect();
            notes.push(format!(
                "\"{}\": joints that slide within their parents stay in place: {}",
                clip.name,
                joints.join(", ")
            ));
        }
        kept.push(analysed);
    }
    if kept.is_empty() {
        return Err(BuildError::NothingToDance { clips: given });
    }
    let danced: BTreeSet<String> = kept
        .iter()
        .filter_map(|analysed| label_of(&analysed.clip))
        .collect();
    notes.extend(
        asked
            .difference(&danced)
            .map(|label| format!("the label \"{label}\" is lost: none of its clips can be danced")),
    );
    if !kept.iter().any(|analysed| analysed.clip.idle) {
        kept.extend(idle::generate(&kept));
        let why = if idle_given {
            "no clip marked idle can be danced"
        } else {
            "no clip is marked idle"
        };
        notes.push(format!(
            "{why}: added \"{}\", a sway on the calmest standing pose",
            idle::IDLE_NAME
        ));
    }
    Ok(kept)
}

/// Checks the properties of a clip that its types do not guarantee, such as unit rotations.
fn check_clip(analysed: &Analysed) -> Result<(), BuildError> {
    let clip = &analysed.clip;
    let fault = |problem: String| {
        Err(BuildError::Clip {
            clip: clip.name.clone(),
            problem,
        })
    };
    let (frames, joints) = (clip.frames(), clip.skeleton.len());
    let parents = clip.skeleton.joints.iter().enumerate();
    if joints == 0
        || !parents
            .clone()
            .all(|(i, joint)| joint.parent.map_or(i == 0, |parent| parent < i))
    {
        return fault("has no skeleton with parents before children".into());
    }
    if clip.rotations.len() != frames * joints {
        return fault(format!(
            "has {} rotations for {frames} frames of {joints} joints",
            clip.rotations.len()
        ));
    }
    if clip.fps != MOTION_FPS {
        return fault(format!(
            "has {} frames a second; resample it to {MOTION_FPS} first",
            clip.fps
        ));
    }
    let offsets_finite = clip
        .skeleton
        .joints
        .iter()
        .all(|joint| joint.offset.is_finite() && joint.ends.iter().all(|end| end.is_finite()));
    let finite = offsets_finite && clip.roots.iter().all(|root| root.is_finite());
    if !finite
        || !clip
            .rotations
            .iter()
            .all(|rotation| (rotation.length() - 1.0).abs() < 1e-3)
    {
        return fault(
            "has a position that is not finite or a rotation that is not of length 1".into(),
        );
    }
    match &analysed.beats {
        Some(beats) => check_beats(beats, frames).or_else(fault),
        None => Ok(()),
    }
}

/// Checks the motion beats `found` of a clip of `frames` frames. The beats must lie within the clip
/// in ascending order, with a positive interval and a regularity from 0 to 1. The beat curve must
/// be empty or have one value per frame. The error is the defect, as the end of a sentence that
/// begins with the name of the clip.
fn check_beats(found: &MotionBeats, frames: usize) -> Result<(), String> {
    let beats = &found.frames;
    let rising = beats.windows(2).all(|pair| pair[0] < pair[1]);
    let within = beats
        .iter()
        .all(|&beat| beat >= 0.0 && f64::from(beat) <= frames as f64 - 1.0);
    if !(rising && within) {
        return Err("has beats that do not rise or lie outside of it".into());
    }
    let (interval, quality) = (found.interval, found.quality);
    if !(interval.0.is_finite() && interval.0 > 0.0 && (0.0..=1.0).contains(&quality)) {
        return Err(format!(
            "has a beat interval of {} s and a quality of {quality}",
            interval.0
        ));
    }
    if !found.curve.is_empty() && found.curve.len() != frames {
        return Err(format!(
            "has a curve of {} values for {frames} frames",
            found.curve.len()
        ));
    }
    Ok(())
}

/// Replaces the skeleton of `clip` by `skeleton`, that of the clip `first`. Returns an error if the
/// joints of both differ, or if a bone (vector from joint to child joint) differs by more than
/// [`BONES_DIFFER_MAX`].
fn adopt_bones(clip: &mut Clip, skeleton: &Skeleton, first: &str) -> Result<(), BuildError> {
    let (name, like) = (clip.name.clone(), first.to_owned());
    if !clip.skeleton.same_tree(skeleton) {
        return Err(BuildError::OtherSkeleton {
            clip: name,
            first: like,
        });
    }
    let pairs = clip.skeleton.joints.iter().zip(&skeleton.joints).skip(1);
    let differ_m = pairs
        .map(|(a, b)| a.offset.distance(b.offset))
        .fold(0.0, f32::max);
    if differ_m > BONES_DIFFER_MAX * skeleton.rest_height() {
        return Err(BuildError::OtherBones {
            clip: name,
            first: like,
            differ_m,
        });
    }
    clip.skeleton = skeleton.clone();
    Ok(())
}

/// Returns an error if the number `found` of `what` is more than `allowed`.
fn allowed(what: &'static str, found: usize, allowed: u64) -> Result<(), BuildError> {
    if found as u64 > allowed {
        Err(BuildError::TooMany {
            what,
            found: found as u64,
            allowed,
        })
    } else {
        Ok(())
    }
}

/// Returns a graph with the nodes and frames of `clips`, still without edges and transitions. There
/// must be at least one clip, and all clips must have the same skeleton and at least two beats.
fn lay_out(clips: Vec<Analysed>) -> Result<Graph, BuildError> {
    let mut labels: Vec<String> = clips
        .iter()
        .filter_map(|analysed| label_of(&analysed.clip))
        .collect();
    labels.sort();
    labels.dedup();
    allowed("labels", labels.len(), LabelId::MAX.into())?;
    let frames = clips.iter().map(|analysed| analysed.clip.frames()).sum();
    allowed("frames", frames, u32::MAX.into())?;
    let joints = clips
        .first()
        .map_or(0, |analysed| analysed.clip.skeleton.len());
    let mut graph = Graph {
        on_request: on_request(&clips, &labels),
        labels,
        ..Graph::default()
    };
    // The exact size is reserved, because a vector that grows needs twice its size for a moment.
    graph.roots.reserve_exact(frames);
    graph.rotations.reserve_exact(frames * joints);
    graph.mirror = clips
        .first()
        .filter(|_| clips.iter().any(|analysed| analysed.mirror))
        .and_then(|it| Mirror::of(&it.clip.skeleton));
    for analysed in clips {
        append_clip(&mut graph, analysed);
    }
    if !graph.clips.iter().any(|clip| clip.mirrored) {
        graph.mirror = None;
    }
    allowed("beats", graph.nodes.len(), u64::from(u32::MAX) - 1)?;
    Ok(graph)
}

/// Appends one clip with its nodes and frames to `graph`. If the clip should also be danced
/// mirrored (left for right) and `graph` has a mirror mapping, appends its mirror image, too.
fn append_clip(graph: &mut Graph, analysed: Analysed) {
    let Analysed {
        clip,
        beats,
        trimmed,
        spikes,
        steps,
        contacts,
        mirror,
    } = analysed;
    let Some(beats) = beats else { return };
    let label = label_of(&clip).and_then(|label| graph.label_named(&label));
    let info = ClipInfo {
        attribute: if clip.idle {
            Attribute::Idle
        } else {
            label.map_or(Attribute::None, Attribute::Label)
        },
        first_frame: graph.roots.len() as u32,
        frames: clip.frames() as u32,
        first_node: graph.nodes.len() as u32,
        nodes: beats.frames.len() as u32,
        interval: beats.interval,
        quality: beats.quality,
        mirrored: false,
        trimmed,
        spikes,
        steps,
        contacts,
        extrema: beats.extrema,
        name: clip.name.clone(),
    };
    let image = graph
        .mirror
        .as_ref()
        .filter(|_| mirror)
        .map(|mirror| mirrored(&info, mirror));
    for info in std::iter::once(info).chain(image) {
        let index = graph.clips.len() as u32;
        let first_node = graph.nodes.len() as u32;
        graph.nodes.extend(
            beats
                .frames
                .iter()
                .map(|&frame| Node { clip: index, frame }),
        );
        graph.clips.push(ClipInfo { first_node, ..info });
    }
    let curve = beats.curve.into_iter().chain(std::iter::repeat(0.0));
    graph.curves.extend(curve.take(clip.frames()));
    graph.roots.extend(clip.roots);
    graph.rotations.extend(clip.rotations);
    graph.skeleton = clip.skeleton;
}

/// Returns the description of the left-right mirror image of `clip`. Both clips share the same
/// frames.
fn mirrored(clip: &ClipInfo, mirror: &Mirror) -> ClipInfo {
    let other_foot = |contact: &Contact| Contact {
        joint: mirror.partner(contact.joint.into()) as u16,
        ..*contact
    };
    let mut contacts: Vec<Contact> = clip.contacts.iter().map(other_foot).collect();
    contacts.sort_by_key(|contact| (contact.joint, contact.part, contact.first));
    ClipInfo {
        name: format!("{}{MIRRORED_ENDING}", clip.name),
        mirrored: true,
        contacts,
        steps: Vec::new(),
        ..clip.clone()
    }
}

/// Checks that every joint in the setting `joint_weights` exists in the skeleton.
fn check_weights(skeleton: &Skeleton, settings: &Settings) -> Result<(), BuildError> {
    let names = || skeleton.joints.iter().map(|joint| joint.name.as_str());
    match settings
        .joint_weights
        .keys()
        .find(|&joint| !names().any(|name| name == joint))
    {
        None => Ok(()),
        Some(joint) => Err(BuildError::UnknownJoint {
            joint: joint.clone(),
            joints: names().collect::<Vec<_>>().join(", "),
        }),
    }
}
