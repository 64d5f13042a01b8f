//! Tests of graph files: a file is read completely or rejected if it is truncated, lengthened,
//! changed or forged, or if its graph would break a show.
#![allow(clippy::unwrap_used, missing_docs)]

use crate::common::clips;

use std::io::Cursor;
use std::ops::Range;
use std::sync::OnceLock;

use clips::{Plan, clip, holds, plan, several};
use corybant_core::graph::build::{Settings, build};
use corybant_core::graph::file::{
    GraphFileError, Opened, SECTIONS, Section, VERSION, from_bytes, to_bytes, write_sections,
};
use corybant_core::graph::report::summary::report;
use corybant_core::graph::{Attribute, Graph, GraphFault, NodeId};
use corybant_core::motion::{Contact, FootPart};
use corybant_core::time::Seconds;
use glam::Quat;
use proptest::prelude::*;

#[test]
fn a_graph_is_read_back_unchanged() {
    assert_eq!(&from_bytes(&to_bytes(several())).unwrap(), several());
    assert_eq!(&from_bytes(small_file()).unwrap(), small());
    assert!(small().clips.iter().any(|clip| clip.mirrored) && small().mirror.is_some());
}

#[test]
fn opening_reads_the_tables_without_the_poses() {
    let opened = Opened::open(Cursor::new(small_file())).unwrap();
    assert!(
        opened.tables.rotations.is_empty()
            && opened.tables.roots.is_empty()
            && opened.tables.curves.is_empty()
    );
    assert_eq!(report(&opened.tables), report(small()));
    // A fault in the poses is found when they are loaded, not when the file is opened.
    let mut bytes = small_file().to_vec();
    let last = bytes.len() - 3;
    bytes[last] ^= 1;
    let opened = Opened::open(Cursor::new(bytes)).unwrap();
    assert!(matches!(
        opened.load(),
        Err(GraphFileError::Damaged {
            part: "rotations",
            ..
        })
    ));
}

#[test]
fn every_truncation_and_every_added_byte_is_refused() {
    let bytes = small_file();
    let mut ends: Vec<usize> = sections()
        .iter()
        .flat_map(|section| [section.start, section.start + 1, section.end - 1])
        .collect();
    ends.extend(0..1000);
    for length in ends {
        let error = from_bytes(&bytes[..length]).unwrap_err();
        let expected = if length == 0 {
            matches!(error, GraphFileError::NotAGraph)
        } else {
            matches!(error, GraphFileError::Truncated { .. })
        };
        assert!(expected, "{length} bytes: {error}");
    }
    let longer: Vec<u8> = bytes.iter().copied().chain([0, 0]).collect();
    assert!(matches!(
        from_bytes(&longer),
        Err(GraphFileError::Trailing { extra: 2 })
    ));
}

#[test]
fn ten_thousand_bit_flips_are_rejected_with_their_section() {
    let mut bytes = small_file().to_vec();
    let sections = sections();
    // Test each byte of the header, and bytes from all sections, from small sections as often as
    // from large ones.
    let mut random = fastrand::Rng::with_seed(20);
    let mut draw = |below: usize| random.usize(..below);
    let mut places: Vec<usize> = (0..sections[0].start).collect();
    while places.len() < 10_000 {
        let section = &sections[draw(SECTIONS)];
        places.push(section.start + draw(section.len()));
    }
    for at in places {
        let bit = 1 << draw(8);
        bytes[at] ^= bit;
        let error = from_bytes(&bytes).unwrap_err();
        let name = sections
            .iter()
            .position(|section| section.contains(&at))
            .map(|part| Section::ALL[part].name());
        let expected = match (at, &error) {
            (0..8, GraphFileError::NotAGraph) | (8..12, GraphFileError::OtherVersion { .. }) => {
                true
            }
            (12..144, GraphFileError::Damaged { part, .. }) => part.contains("table"),
            (_, GraphFileError::Damaged { part, .. }) => Some(*part) == name,
            _ => false,
        };
        assert!(expected, "byte {at} ({name:?}) flipped by {bit}: {error}");
        bytes[at] ^= bit;
    }
}

#[test]
fn older_and_newer_versions_are_refused_by_number() {
    for version in [0, 1, VERSION + 1, u32::MAX] {
        let mut bytes = small_file().to_vec();
        bytes[8..12].copy_from_slice(&version.to_le_bytes());
        let message = from_bytes(&bytes).unwrap_err().to_string();
        assert!(
            message.contains(&format!("version {version}")) && message.contains("corybant build"),
            "{message}"
        );
    }
}

/// Returns a small graph: two clips, the mirror image of one of them, and the generated idle clip.
fn small() -> &'static Graph {
    static GRAPH: OnceLock<Graph> = OnceLock::new();
    GRAPH.get_or_init(|| {
        let mut clips = [
            plan("a", None, 6, 1),
            Plan {
                interval: 8,
                ..plan("b", Some("b"), 5, 2)
            },
        ]
        .map(|plan| clip(&plan));
        clips[0].mirror = true;
        clips[0].contacts = vec![Contact {
            joint: 6,
            part: FootPart::Heel,
            first: 3,
            last: 20,
        }];
        let beats = clips[0].beats.as_mut().unwrap();
        (beats.extrema, beats.curve) = (beats.frames.clone(), vec![0.5; clips[0].clip.roots.len()]);
        build(clips.into(), &Settings::default(), &mut |_| ()).unwrap()
    })
}

fn small_file() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| to_bytes(small()))
}

/// Returns the byte range of each section of the small file.
fn sections() -> [Range<usize>; SECTIONS] {
    let mut end = 16 + 16 * SECTIONS;
    std::array::from_fn(|part| {
        let row = 16 + 16 * part;
        let length = u64::from_le_bytes(small_file()[row..row + 8].try_into().unwrap()) as usize;
        end += length;
        end - length..end
    })
}

/// Returns the small file with other bytes in one section and correct checksums.
fn resealed(part: Section, bytes: &[u8]) -> Vec<u8> {
    let mut parts = sections().map(|section| &small_file()[section]);
    parts[part as usize] = bytes;
    let mut file = Vec::new();
    write_sections(parts, &mut file).unwrap();
    file
}

#[test]
fn graphs_that_would_break_a_show_are_refused() {
    type Harm = fn(&mut Graph);
    let harms: [(&str, Harm); 34] = [
        ("no joints", |g| g.skeleton.joints.clear()),
        ("no clips", |g| g.clips.clear()),
        ("no nodes", |g| g.nodes.clear()),
        ("parent after child", |g| {
            g.skeleton.joints[1].parent = Some(5)
        }),
        ("second root", |g| g.skeleton.joints[1].parent = None),
        ("two joints of one name", |g| {
            g.skeleton.joints[1].name = "Head".into()
        }),
        ("offset", |g| g.skeleton.joints[1].offset.x = f32::INFINITY),
        ("end site", |g| g.skeleton.joints[2].ends[0].x = f32::NAN),
        ("clip start", |g| g.clips[1].first_frame += 1),
        ("clip nodes", |g| g.clips[1].nodes -= 1),
        ("clip of one node", |g| g.clips[0].nodes = 1),
        ("clip frames", |g| g.clips[0].frames = 0),
        ("label index", |g| {
            g.clips[2].attribute = Attribute::Label(9)
        }),
        ("interval", |g| g.clips[0].interval = Seconds(f64::NAN)),
        ("quality", |g| g.clips[0].quality = 1.5),
        ("labels out of order", |g| g.labels.swap(0, 1)),
        ("unused label", |g| g.labels.push("zumba".into())),
        ("node of another clip", |g| g.nodes[0].clip = 1),
        ("unsorted nodes", |g| g.nodes.swap(1, 2)),
        ("node outside its clip", |g| g.nodes[39].frame = 1e9),
        ("root", |g| g.roots[5].z = f32::NAN),
        ("rotation", |g| {
            g.rotations[5] = Quat::from_xyzw(0.0, 0.0, 0.0, 0.5)
        }),
        ("rotation count", |g| g.rotations.truncate(5)),
        ("transition out of range", |g| {
            g.transitions[0].via = 1_000_000
        }),
        ("transition weight", |g| g.transitions[0].weight = -1.0),
        ("transition rows", |g| g.transition_starts[3] = u32::MAX),
        ("edge count", |g| g.edges.truncate(3)),
        ("edge energy", |g| g.edges[2].energy = f32::NAN),
        ("curve count", |g| g.curves.truncate(3)),
        ("curve", |g| g.curves[3] = f32::INFINITY),
        ("contact on no joint", |g| {
            g.clips[0].contacts.push(Contact {
                joint: 99,
                part: FootPart::Heel,
                first: 0,
                last: 1,
            })
        }),
        ("contact beyond its clip", |g| {
            g.clips[0].contacts.push(Contact {
                joint: 1,
                part: FootPart::Heel,
                first: 0,
                last: 1_000_000,
            })
        }),
        ("extremum beyond its clip", |g| g.clips[0].extrema.push(1e9)),
        ("mirrored without a mirror", |g| g.clips[1].mirrored = true),
    ];
    for (what, harm) in harms {
        let mut graph = several().clone();
        harm(&mut graph);
        assert!(graph.check().is_err(), "{what}");
        assert!(
            matches!(from_bytes(&to_bytes(&graph)), Err(GraphFileError::Unfit(_))),
            "{what}"
        );
    }
}

/// Returns the graph with only those transitions for which `keep` returns true.
fn keep_transitions(graph: &Graph, keep: impl Fn(NodeId, NodeId) -> bool) -> Graph {
    let mut kept = graph.clone();
    kept.transitions.clear();
    for node in 0..graph.nodes.len() as NodeId {
        kept.transition_starts[node as usize] = kept.transitions.len() as u32;
        kept.transitions.extend(
            graph
                .transitions_from(node)
                .iter()
                .filter(|transition| keep(node, transition.via)),
        );
    }
    kept.transition_starts[graph.nodes.len()] = kept.transitions.len() as u32;
    kept
}

#[test]
fn dead_ends_and_disconnected_parts_have_different_errors() {
    let graph = several();
    let dead = keep_transitions(graph, |from, _| from != 39);
    if graph.next(39).is_none() {
        assert_eq!(
            dead.check(),
            Err(GraphFault::DeadEnd {
                node: 39,
                clip: "walk".into()
            })
        );
    }
    let salsa = Attribute::Label(graph.label_named("salsa").unwrap());
    let severed = keep_transitions(graph, |from, via| {
        (graph.attribute(from) == salsa) == (graph.attribute(via) == salsa)
    });
    assert!(
        matches!(severed.check(), Err(GraphFault::CutOff { part, .. }) if part == "the graph"),
        "{:?}",
        severed.check()
    );
    let unheld = keep_transitions(graph, |from, via| {
        graph.attribute(from) != salsa || graph.attribute(via) != salsa
    });
    assert!(
        matches!(unheld.check(), Err(GraphFault::CutOff { part, .. } | GraphFault::DeadEnd { clip: part, .. }) if part.contains("salsa"))
    );
    let mut restless = graph.clone();
    restless
        .clips
        .iter_mut()
        .filter(|clip| clip.attribute == Attribute::Idle)
        .for_each(|clip| clip.attribute = Attribute::None);
    assert_eq!(
        restless.check(),
        Err(GraphFault::Empty { what: "idle clip" })
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..600), part in 0..SECTIONS) {
        prop_assert!(from_bytes(&bytes).is_err());
        prop_assert!(from_bytes(&resealed(Section::ALL[part], &bytes)).is_err());
    }

    #[test]
    fn a_changed_section_with_a_valid_checksum_is_rejected_or_still_valid(
        part in 0..SECTIONS, at in any::<prop::sample::Index>(), to: u8, shorter in 0usize..2,
    ) {
        let mut bytes = small_file()[sections()[part].clone()].to_vec();
        let at = at.index(bytes.len());
        bytes[at] = to;
        bytes.truncate(bytes.len() - shorter);
        if let Ok(graph) = from_bytes(&resealed(Section::ALL[part], &bytes)) {
            holds(&graph);
        }
    }

    #[test]
    fn invalid_graphs_are_never_accepted(changes in prop::collection::vec((0usize..9, any::<prop::sample::Index>(), any::<u32>()), 1..4)) {
        let mut graph = small().clone();
        for (what, at, value) in changes {
            let small = value % 12;
            match what {
                0 => { let i = at.index(graph.transitions.len()); graph.transitions[i].via = small }
                1 => { let i = at.index(graph.transition_starts.len()); graph.transition_starts[i] = small }
                2 => { let i = at.index(graph.nodes.len()); graph.nodes[i].clip = small }
                3 => { let i = at.index(graph.nodes.len()); graph.nodes[i].frame = f32::from_bits(value) }
                4 => graph.clips[0].nodes = small,
                5 => graph.clips[0].first_node = small,
                6 => graph.clips[0].frames = small,
                7 => { let i = at.index(graph.transitions.len()); graph.transitions[i].weight = f32::from_bits(value) }
                _ => { let i = at.index(graph.rotations.len()); graph.rotations[i].x = f32::from_bits(value) }
            }
        }
        if let Ok(graph) = from_bytes(&to_bytes(&graph)) {
            holds(&graph);
        }
    }
}
