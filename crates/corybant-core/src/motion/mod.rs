//! Motion: skeletons, poses, clips, and their import and export.
//!
//! Space: right-handed, Y up, metres, facing +Z. "Frame" means a motion frame everywhere in this
//! crate.

pub mod clip;
pub mod contact;
pub mod export;
pub mod humanoid;
pub mod import;
pub(crate) mod leg;
pub mod live;
pub mod mirror;
pub mod pose;
pub mod skeleton;

pub use clip::Clip;
pub use contact::{Contact, FootPart};
pub use import::beats::MotionBeats;
pub use import::pipeline::{ImportOptions, MotionError, analyse, analyse_onto};
pub use import::{ReadError, Siblings, Source};
pub use mirror::Mirror;
pub use pose::Pose;
pub use skeleton::{Joint, Skeleton};

/// Frame rate of every cleaned clip and of every motion graph, in frames per second.
pub const MOTION_FPS: f64 = 60.0;

/// A clip that is ready for a motion graph: cleaned, at [`MOTION_FPS`], with its beats and
/// contacts.
#[derive(Clone, Debug, PartialEq)]
pub struct Analysed {
    /// The cleaned motion: in metres, on the floor, at [`MOTION_FPS`].
    pub clip: Clip,
    /// The detected beats of the motion; `None` for a motion without beats (a single frame, or
    /// nothing moves).
    pub beats: Option<MotionBeats>,
    /// Number of calibration frames that were removed at the start and the end of the clip
    /// together. In these frames the performer stands in a T-pose. They are counted at the frame
    /// rate of the file.
    pub trimmed: u32,
    /// Number of errors of the motion capture that were repaired, such as sudden jumps of a joint
    /// in a few frames.
    pub spikes: u32,
    /// Descriptions of the cleaning steps that were applied to the clip, one sentence each.
    pub steps: Vec<String>,
    /// The contacts (times in which a part of a foot stands on the floor), sorted by the joint of
    /// the foot, then by its part and then by time.
    pub contacts: Vec<Contact>,
    /// True if the dancer may also dance the mirror image of the clip.
    pub mirror: bool,
}
