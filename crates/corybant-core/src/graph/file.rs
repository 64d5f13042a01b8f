//! The file format of motion graphs.
//!
//! In: a graph, or the bytes of any reader.
//! Out: bytes, or a graph that can be danced in a show.
//! Thread: any except show and audio; pure.
//! Allocates: freely; memory for reading is limited by the length of the file.
//!
//! | bytes | content, numbers little-endian |
//! |---|---|
//! | 0..8 | `CORYGRPH` |
//! | 8..12 | version |
//! | 12..16 | CRC-32 of the section table |
//! | 16..144 | section table; for each of 8 sections: length (8 bytes), CRC-32 (4), zeros (4) |
//! | 144.. | the sections in the order of [`Section`], without gaps |
//!
//! Opening a file reads and checks everything except the poses, so that even a large graph opens at
//! once. Loading also reads and checks the poses, before the first tick of a show. The poses are
//! read into memory; the file is not mapped, because the show would crash if a mapped file became
//! shorter or its disk were removed.

use std::io::{self, Read, Seek, SeekFrom, Write};

use bytemuck::{cast_slice, cast_slice_mut};
use crc32fast::Hasher;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::check::GraphFault;
use super::{ClipInfo, Edge, Graph, LabelId, Node, Transition};
use crate::motion::{Mirror, Skeleton};

/// The format version of graph files that this program writes; it reads no other version.
pub const VERSION: u32 = 5;

/// The first bytes of a graph file.
pub const MAGIC: &[u8; 8] = b"CORYGRPH";
/// The number of sections in a graph file. A section is one table of the graph, such as its nodes.
pub const SECTIONS: usize = 8;
/// Size in bytes of the section table of a graph file, which has the length and the checksum of
/// each section.
const TABLE: usize = 16 * SECTIONS;
/// Size in bytes of the header of a graph file, which is everything before the first section.
const HEADER: u64 = 16 + TABLE as u64;

// Numbers are written in the byte order of memory.
#[cfg(target_endian = "big")]
compile_error!("graph files are little-endian");

/// The sections of a graph file, in the order of the file. A section is one table of the graph,
/// such as its nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// The section with skeleton, labels, clips, left-right mapping of the joints, and the repairs
    /// that were made when the graph was built. It is encoded with postcard (a binary format).
    Head,
    /// The section with the nodes: clip index and frame, 8 bytes per node.
    Nodes,
    /// The section with the edges: duration, energy, regularity, three numbers for how well
    /// standstills coincide with beats, and how far the motion turns away. It has 28 bytes per edge.
    Edges,
    /// The section with the index of each node's first transition. The last number is the number of
    /// all transitions. It has 4 bytes per number.
    Starts,
    /// The section with the transitions: the node at which the dance continues, and the weight
    /// (difference of the poses). It has 8 bytes per transition.
    Transitions,
    /// The section with the beat curves (the curves in which the beats were found), 4 bytes per
    /// frame.
    Curves,
    /// The section with the positions of the root, 12 bytes per frame.
    Roots,
    /// The section with the rotations of the joints, 16 bytes per frame and joint.
    Rotations,
}

impl Section {
    /// All sections of a graph file, in the order in which they stand in the file.
    pub const ALL: [Section; SECTIONS] = [
        Section::Head,
        Section::Nodes,
        Section::Edges,
        Section::Starts,
        Section::Transitions,
        Section::Curves,
        Section::Roots,
        Section::Rotations,
    ];

    /// Returns the name of the section's content for error messages, such as "nodes".
    pub fn name(self) -> &'static str {
        match self {
            Section::Head => "head",
            Section::Nodes => "nodes",
            Section::Edges => "edges",
            Section::Starts => "rows of transitions",
            Section::Transitions => "transitions",
            Section::Curves => "curves",
            Section::Roots => "root positions",
            Section::Rotations => "rotations",
        }
    }
}

/// The reasons why a file cannot be used as a graph file.
#[derive(Debug, Error)]
pub enum GraphFileError {
    /// The file does not begin with the first bytes of a graph file ([`MAGIC`]).
    #[error("this is not a graph file; make one with `corybant build`")]
    NotAGraph,
    /// The file has a format version that this program cannot read.
    #[error(
        "this graph file has version {found}, this program reads version {VERSION}; build the graph again with `corybant build`"
    )]
    OtherVersion {
        /// The format version that the file states.
        found: u32,
    },
    /// The file ends before the end of its last section.
    #[error("this graph file is cut short: {found} bytes of {expected}; copy or build it again")]
    Truncated {
        /// The length that the file has, in bytes.
        found: u64,
        /// The length that the file should have according to its header, in bytes.
        expected: u64,
    },
    /// The file continues after the end of its last section, or its section [`Section::Head`]
    /// continues after the end of the content.
    #[error("this graph file has {extra} bytes too many after its end; copy or build it again")]
    Trailing {
        /// Number of bytes after the end of the last section, or after the content of the section
        /// [`Section::Head`].
        extra: u64,
    },
    /// The checksum of a section, or of the table of sections, differs from the checksum that is
    /// written in the file, so the file is damaged.
    #[error(
        "this graph file is damaged: its {part} have the checksum {found:08x} where {expected:08x} is written; copy or build it again"
    )]
    Damaged {
        /// The name of the damaged part of the file for the message, such as "nodes".
        part: &'static str,
        /// The checksum that was computed from the bytes of the damaged part.
        found: u32,
        /// The checksum that is written in the file for the damaged part.
        expected: u32,
    },
    /// A section has a wrong length, or the section [`Section::Head`] cannot be decoded.
    #[error(
        "this graph file cannot be decoded ({reason}); build the graph again with `corybant build`"
    )]
    Undecodable {
        /// The reason why the section cannot be decoded, as text for the message.
        reason: String,
    },
    /// The graph in the file does not pass [`Graph::check`].
    #[error(
        "this graph file holds no graph fit to be danced: {0}; build it again with `corybant build`"
    )]
    Unfit(#[from] GraphFault),
    /// The operating system cannot read the file.
    #[error("this graph file cannot be read: {0}")]
    System(#[from] io::Error),
}

/// The content of the section [`Section::Head`]: skeleton, labels, clips, left-right mapping of the
/// joints, and the repairs that were made when the graph was built.
#[derive(Serialize, Deserialize)]
struct HeadContent {
    skeleton: Skeleton,
    labels: Vec<String>,
    on_request: Vec<LabelId>,
    clips: Vec<ClipInfo>,
    mirror: Option<Mirror>,
    repaired: Vec<String>,
}

/// Writes `graph` as a graph file to `out`.
///
/// # Errors
/// The error of `out` if the file cannot be written.
pub fn write(graph: &Graph, out: &mut dyn Write) -> io::Result<()> {
    let head = HeadContent {
        skeleton: graph.skeleton.clone(),
        labels: graph.labels.clone(),
        on_request: graph.on_request.clone(),
        clips: graph.clips.clone(),
        mirror: graph.mirror.clone(),
        repaired: graph.repaired.clone(),
    };
    let head = postcard::to_stdvec(&head).map_err(io::Error::other)?;
    let nodes: Vec<[u32; 2]> = graph
        .nodes
        .iter()
        .map(|node| [node.clip, node.frame.to_bits()])
        .collect();
    let edges: Vec<[f32; 7]> = graph.edges.iter().map(Edge::numbers).collect();
    let transitions: Vec<[u32; 2]> = graph
        .transitions
        .iter()
        .map(|it| [it.via, it.weight.to_bits()])
        .collect();
    let parts: [&[u8]; SECTIONS] = [
        &head,
        cast_slice(&nodes),
        cast_slice(&edges),
        cast_slice(&graph.transition_starts),
        cast_slice(&transitions),
        cast_slice(&graph.curves),
        cast_slice(&graph.roots),
        cast_slice(&graph.rotations),
    ];
    write_sections(parts, out)
}

/// Writes a graph file to `out` from the bytes of all its sections, in the order of [`Section`].
/// The content of the sections is not checked.
///
/// # Errors
/// The error of `out` if the file cannot be written.
pub fn write_sections(parts: [&[u8]; SECTIONS], out: &mut dyn Write) -> io::Result<()> {
    let mut table = Vec::with_capacity(TABLE);
    for part in parts {
        table.extend((part.len() as u64).to_le_bytes());
        table.extend(crc32fast::hash(part).to_le_bytes());
        table.extend([0; 4]);
    }
    out.write_all(MAGIC)?;
    out.write_all(&VERSION.to_le_bytes())?;
    out.write_all(&crc32fast::hash(&table).to_le_bytes())?;
    out.write_all(&table)?;
    parts.iter().try_for_each(|part| out.write_all(part))
}

/// Returns the content of the graph file for `graph`.
pub fn to_bytes(graph: &Graph) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Writing to memory cannot fail, and postcard can encode every graph.
    let _ = write(graph, &mut bytes);
    bytes
}

/// Returns the length in bytes and the CRC-32 checksum of the graph file for `graph`. A recording
/// stores these two numbers, so that a replay can check that it uses the same graph.
pub fn identity(graph: &Graph) -> (u64, u32) {
    struct Sum(u64, Hasher);
    impl Write for Sum {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0 += bytes.len() as u64;
            self.1.update(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let mut sum = Sum(0, Hasher::new());
    // The checksum writer never fails, and postcard can encode every graph.
    let _ = write(graph, &mut sum);
    (sum.0, sum.1.finalize())
}

/// Reads a graph from the bytes of a graph file, and checks that it can be danced in a show.
///
/// # Errors
/// The errors of [`Opened::open`] and [`Opened::load`].
pub fn from_bytes(bytes: &[u8]) -> Result<Graph, GraphFileError> {
    Opened::open(io::Cursor::new(bytes))?.load()
}

/// The position, the length and the checksum of one section in a graph file.
#[derive(Clone, Copy, Debug)]
struct SectionSpan {
    /// Position of the section's first byte in the file, in bytes from its start.
    start: u64,
    /// The length of the section in bytes.
    length: u64,
    /// CRC-32 checksum of the section's bytes.
    checksum: u32,
}

/// An opened graph file. Everything except the poses has been read and checked.
pub struct Opened<R> {
    /// The graph without its poses (beat curves, root positions and rotations). All other content
    /// was read and checked.
    pub tables: Graph,
    /// The opened file or other source of the graph's bytes.
    source: R,
    /// `[section]`: position, length and checksum of the section in the file.
    spans: [SectionSpan; SECTIONS],
}

impl<R: Read + Seek> Opened<R> {
    /// Opens a graph file: reads and checks the header and all sections except the poses. Memory
    /// and time are limited by the length of these sections.
    ///
    /// # Errors
    /// [`GraphFileError`] if the file is no graph file, has another version, is too short, too long
    /// or damaged, or if its graph does not pass [`Graph::check_tables`].
    pub fn open(mut source: R) -> Result<Self, GraphFileError> {
        let spans = read_header(&mut source)?;
        let head: Vec<u8> = read_section(&mut source, Section::Head, &spans)?;
        let head = postcard::take_from_bytes::<HeadContent>(&head);
        let (head, rest) = head.map_err(|error| GraphFileError::Undecodable {
            reason: error.to_string(),
        })?;
        if !rest.is_empty() {
            return Err(GraphFileError::Trailing {
                extra: rest.len() as u64,
            });
        }
        let HeadContent {
            skeleton,
            labels,
            on_request,
            clips,
            mirror,
            repaired,
        } = head;
        let nodes: Vec<[u32; 2]> = read_section(&mut source, Section::Nodes, &spans)?;
        let edges: Vec<[f32; 7]> = read_section(&mut source, Section::Edges, &spans)?;
        let transitions: Vec<[u32; 2]> = read_section(&mut source, Section::Transitions, &spans)?;
        let edge = |[interval_s, energy, quality, one, two, half, away]: [f32; 7]| Edge {
            interval_s,
            energy,
            quality,
            hits: [one, two, half],
            away,
        };
        let tables = Graph {
            skeleton,
            labels,
            on_request,
            clips,
            nodes: nodes
                .into_iter()
                .map(|[clip, frame]| Node {
                    clip,
                    frame: f32::from_bits(frame),
                })
                .collect(),
            edges: edges.into_iter().map(edge).collect(),
            transition_starts: read_section(&mut source, Section::Starts, &spans)?,
            transitions: transitions
                .into_iter()
                .map(|[via, weight]| Transition {
                    via,
                    weight: f32::from_bits(weight),
                })
                .collect(),
            mirror,
            repaired,
            ..Graph::default()
        };
        tables.check_tables()?;
        Ok(Self {
            tables,
            source,
            spans,
        })
    }

    /// Reads and checks the poses in the file, and returns the complete graph.
    ///
    /// # Errors
    /// [`GraphFileError`] if the file became shorter after it was opened, is damaged, or if its
    /// poses do not pass [`Graph::check_poses`].
    pub fn load(mut self) -> Result<Graph, GraphFileError> {
        let mut graph = self.tables;
        graph.curves = read_section(&mut self.source, Section::Curves, &self.spans)?;
        graph.roots = read_section(&mut self.source, Section::Roots, &self.spans)?;
        graph.rotations = read_section(&mut self.source, Section::Rotations, &self.spans)?;
        graph.check_poses()?;
        Ok(graph)
    }
}

/// Reads the header of a graph file, and returns the position, length and checksum of each section.
/// Returns an error if the file does not end at the end of the last section.
fn read_header<R: Read + Seek>(source: &mut R) -> Result<[SectionSpan; SECTIONS], GraphFileError> {
    let found = source.seek(SeekFrom::End(0))?;
    source.seek(SeekFrom::Start(0))?;
    let mut header = Vec::new();
    source.take(HEADER).read_to_end(&mut header)?;
    let start = header.len().min(MAGIC.len());
    if header[..start] != MAGIC[..start] || header.is_empty() {
        return Err(GraphFileError::NotAGraph);
    }
    let short = |expected| GraphFileError::Truncated { found, expected };
    let (_, rest) = header.split_first_chunk::<8>().ok_or(short(HEADER))?;
    let (version, rest) = rest.split_first_chunk().ok_or(short(HEADER))?;
    let version = u32::from_le_bytes(*version);
    if version != VERSION {
        return Err(GraphFileError::OtherVersion { found: version });
    }
    let (checksum, rest) = rest.split_first_chunk().ok_or(short(HEADER))?;
    let table = rest.first_chunk::<TABLE>().ok_or(short(HEADER))?;
    verify_checksum(
        "section table's bytes",
        crc32fast::hash(table),
        u32::from_le_bytes(*checksum),
    )?;
    let mut end = HEADER;
    let spans = std::array::from_fn(|part| {
        let row: &[u8; 16] = table.as_chunks().0.get(part).unwrap_or(&[0; 16]);
        let [a, b, c, d, e, f, g, h, i, j, k, l, ..] = *row;
        let length = u64::from_le_bytes([a, b, c, d, e, f, g, h]);
        let start = end;
        end = end.saturating_add(length);
        SectionSpan {
            start,
            length,
            checksum: u32::from_le_bytes([i, j, k, l]),
        }
    });
    match found.checked_sub(end) {
        None => Err(short(end)),
        Some(0) => Ok(spans),
        Some(extra) => Err(GraphFileError::Trailing { extra }),
    }
}

/// Reads the section `part`, and returns its values. `spans` has the position, length and checksum
/// of each section. Returns an error if the length does not fit the type of the values, or if the
/// bytes have another checksum.
fn read_section<R: Read + Seek, T: bytemuck::Pod>(
    source: &mut R,
    part: Section,
    spans: &[SectionSpan; SECTIONS],
) -> Result<Vec<T>, GraphFileError> {
    /// The number of bytes that are read before the checksum is updated with them. This number of
    /// bytes fits into the cache of a processor core.
    const CHUNK: usize = 1 << 18;
    let SectionSpan {
        start,
        length,
        checksum,
    } = spans[part as usize];
    if length % size_of::<T>() as u64 != 0 {
        let reason = format!(
            "its {} have {length} bytes, which is no multiple of {}",
            part.name(),
            size_of::<T>()
        );
        return Err(GraphFileError::Undecodable { reason });
    }
    let mut numbers = vec![T::zeroed(); length as usize / size_of::<T>()];
    source.seek(SeekFrom::Start(start))?;
    let mut hasher = Hasher::new();
    for chunk in cast_slice_mut::<T, u8>(&mut numbers).chunks_mut(CHUNK) {
        source.read_exact(chunk)?;
        hasher.update(chunk);
    }
    verify_checksum(part.name(), hasher.finalize(), checksum)?;
    Ok(numbers)
}

/// Returns an error if the checksums `found` and `expected` differ. `part` is the name of the
/// section in the message.
fn verify_checksum(part: &'static str, found: u32, expected: u32) -> Result<(), GraphFileError> {
    if found == expected {
        Ok(())
    } else {
        Err(GraphFileError::Damaged {
            part,
            found,
            expected,
        })
    }
}
