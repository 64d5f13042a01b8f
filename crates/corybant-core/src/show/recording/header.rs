//! The header of a recording: the settings and graphs that a replay needs in addition to the
//! entries. In: the settings of a show file, a cast. Out: a plain value. Thread: main.

use serde::{Deserialize, Serialize};

use crate::graph::{Graph, file};
use crate::show::Cast;

/// The first part of a recording: the settings of the show and the identity of its motion graphs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The version of the program that made the recording.
    pub program: String,
    /// The architecture and operating system of the machine that made the recording, such as
    /// `x86_64-linux`. A replay on another architecture may round floats differently.
    pub machine: String,
    /// Start of the recording, in seconds since 1970-01-01 UTC.
    pub began_unix_s: u64,
    /// The settings of tempo, planner, dancers and outputs as TOML text, including the default
    /// values that the show file leaves out.
    pub settings: String,
    /// The file, size and checksum of each dancer's motion graph, in the order of the dancers.
    pub graphs: Vec<Danced>,
    /// The name of each pad at the start, to which the numbers in the recorded cues refer. Empty in
    /// recordings of earlier versions: the pads are then those of the graphs.
    #[serde(skip)]
    pub pads: Vec<String>,
}

/// The file, size and checksum of a motion graph, by which a replay recognises the graph.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Danced {
    /// The path of the graph file; `None` for the built-in repertoire (the clips that are part of
    /// the program).
    pub file: Option<String>,
    /// The size of the graph in bytes when it is encoded as a graph file.
    pub bytes: u64,
    /// The CRC-32 of the graph when it is encoded as a graph file.
    pub checksum: u32,
}

impl Danced {
    /// Creates the identity of `graph`: its size and its checksum. `file` is the path of the graph
    /// file, or `None` for the built-in repertoire.
    pub fn of(graph: &Graph, file: Option<String>) -> Self {
        let (bytes, checksum) = file::identity(graph);
        Self {
            file,
            bytes,
            checksum,
        }
    }

    /// Returns true if `graph` has the size and checksum that are stored here; the path is not
    /// compared.
    pub fn is(&self, graph: &Graph) -> bool {
        file::identity(graph) == (self.bytes, self.checksum)
    }
}

impl Header {
    /// Creates the header of a recording that starts at `began_unix_s`, in seconds since 1970-01-01
    /// UTC. `settings` is TOML text. `files` contains the path of the graph file of each dancer, or
    /// `None` for the built-in repertoire.
    pub fn new(settings: String, cast: &Cast, files: &[Option<String>], began_unix_s: u64) -> Self {
        let mut graphs: Vec<Danced> = Vec::with_capacity(cast.members.len());
        for (dancer, member) in cast.members.iter().enumerate() {
            let leader = member.follows.unwrap_or(dancer);
            let file = files.get(leader).cloned().flatten();
            let known = cast.members[..dancer]
                .iter()
                .position(|other| std::sync::Arc::ptr_eq(&other.graph, &member.graph));
            let danced = match known {
                Some(other) => Danced {
                    file,
                    ..graphs[other].clone()
                },
                None => Danced::of(&member.graph, file),
            };
            graphs.push(danced);
        }
        Self {
            program: env!("CARGO_PKG_VERSION").into(),
            machine: Self::this_machine(),
            began_unix_s,
            settings,
            graphs,
            pads: cast.pads().to_vec(),
        }
    }

    /// Returns the architecture and operating system of this machine, such as `x86_64-linux`.
    pub fn this_machine() -> String {
        format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS)
    }
}
