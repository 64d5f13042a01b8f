//! The static data of a show that a client needs to read snapshots. In: the graph. Out: the first
//! message to every client.
//!
//! Thread: created before the show starts, then the page's.

use serde::Serialize;

use corybant_core::graph::Graph;
use corybant_core::motion::Skeleton;
use corybant_core::tempo::settings::Settings;
use corybant_core::tempo::source::{Sources, TempoSource};

/// Static data of a show for its page: the first dancer's skeleton, and the names for the indices
/// in a [`Snapshot`](super::Snapshot).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct About {
    /// Skeleton of the first dancer, offsets in metres.
    pub skeleton: Skeleton,
    /// Name of each label, indexed by label number.
    pub labels: Vec<String>,
    /// Name of each clip, indexed by clip number.
    pub clips: Vec<String>,
    /// Tempo sources that a client of the page can select.
    pub sources: Sources,
    /// True if the page can set up the show.
    pub has_setup: bool,
}

#[derive(Serialize)]
struct Hello<'a> {
    #[serde(rename = "type")]
    kind: &'static str,
    joints: Vec<&'a str>,
    parents: Vec<Option<usize>>,
    offsets: Vec<[f32; 3]>,
    ends: Vec<Vec<[f32; 3]>>,
    labels: &'a [String],
    clips: &'a [String],
    sources: Vec<&'static str>,
    setup: bool,
}

impl About {
    /// Creates the static data of a show. `graph` is the motion graph of the first dancer and
    /// `labels` are the names of the pads. `tempo` gives the tempo sources.
    pub fn new(graph: &Graph, labels: &[String], tempo: &Settings) -> Self {
        Self {
            skeleton: graph.skeleton.clone(),
            labels: labels.to_vec(),
            clips: graph.clips.iter().map(|clip| clip.name.clone()).collect(),
            sources: tempo.sources(),
            has_setup: false,
        }
    }

    /// Returns the first message to every client, as one line of JSON.
    ///
    /// `{"type":"hello","joints":[name,…],"parents":[index|null,…],"offsets":[[x,y,z],…],"ends":
    /// [[[x,y,z],…],…],"labels":[name,…], "clips":[name,…],"sources":["audio",…],"setup":false}`.
    /// Lengths are in metres. `ends` has, for each joint, the end points of its bones that
    /// lead to no other joint (such as a fingertip), relative to this joint.
    pub fn to_json(&self) -> String {
        let joints = &self.skeleton.joints;
        let hello = Hello {
            kind: "hello",
            joints: joints.iter().map(|joint| joint.name.as_str()).collect(),
            parents: joints.iter().map(|joint| joint.parent).collect(),
            offsets: joints.iter().map(|joint| joint.offset.to_array()).collect(),
            ends: joints
                .iter()
                .map(|joint| joint.ends.iter().map(|end| end.to_array()).collect())
                .collect(),
            labels: &self.labels,
            clips: &self.clips,
            sources: self.sources.iter().map(TempoSource::name).collect(),
            setup: self.has_setup,
        };
        serde_json::to_string(&hello).unwrap_or_default()
    }
}
