//! Measures how long a dancer faces away from the audience, and how far its planted feet slide,
//! while a cue wants one label. The figures are printed with `--nocapture`.
#![allow(clippy::unwrap_used, missing_docs)]

use crate::graphs::graphs;

use std::sync::Arc;

use corybant_core::dance::{self, Dancer};
use corybant_core::fault::Faults;
use corybant_core::graph::{Attribute, Graph};
use corybant_core::motion::Pose;
use corybant_core::motion::pose::heading;
use corybant_core::plan::{CommittedStep, MusicBeat, Planner, Settings, TerminalCost};
use glam::Vec3;

const BEATS: u32 = 600;
const PERIOD: f64 = 0.5;
/// Poses in each beat.
const POSES: u32 = 30;
/// The cosine of the angle from which a dancer faces away: 60°.
const AWAY: f32 = 0.5;

/// The measured values of a dance.
struct Figures {
    /// Share of the time in which the hips face more than 60° away from the audience.
    away: f32,
    /// Mean speed at which the body turns about the vertical axis, in degrees per second.
    turning: f32,
    /// Largest such speed but one in a thousand poses, in degrees per second.
    fastest: f32,
}

/// Number of dances that are measured together, with different seeds.
const SEEDS: u64 = 4;

/// Dances `wanted` on `graph` with several seeds and measures the dances. `facing` is the price of
/// facing away, and `turn_deg` the limit of the turn towards the audience.
fn danced(graph: &Arc<Graph>, wanted: Attribute, facing: f32, turn_deg: f32) -> Figures {
    let dances = (0..SEEDS).map(|seed| {
        let settings = Settings {
            facing,
            seed,
            ..Settings::default()
        };
        headings(graph, wanted, &settings, turn_deg)
    });
    let dances: Vec<Vec<Vec3>> = dances.collect();
    let all = || dances.iter().flatten();
    let away = all().filter(|heading| heading.z < AWAY).count();
    let rate = POSES as f32 / PERIOD as f32;
    let turn = |pair: &[Vec3]| pair[0].angle_between(pair[1]).to_degrees() * rate;
    let mut turns: Vec<f32> = dances
        .iter()
        .flat_map(|dance| dance.windows(2).map(turn))
        .collect();
    turns.sort_unstable_by(f32::total_cmp);
    Figures {
        away: away as f32 / all().count() as f32,
        turning: turns.iter().sum::<f32>() / turns.len() as f32,
        fastest: turns[turns.len() * 999 / 1000],
    }
}

/// Dances `wanted` on `graph`. Returns the direction in which the dancer faces, of each pose.
fn headings(
    graph: &Arc<Graph>,
    wanted: Attribute,
    settings: &Settings,
    turn_deg: f32,
) -> Vec<Vec3> {
    let start = graph
        .clips
        .iter()
        .find(|clip| clip.attribute == Attribute::None)
        .unwrap()
        .first_node;
    let beyond = Arc::new(TerminalCost::new(graph, settings, 4));
    let faults = Arc::new(Faults::default());
    let mut planner = Planner::new(graph.clone(), settings, beyond, start, faults);
    let own = dance::Settings {
        facing_turn_deg: turn_deg,
        ..dance::Settings::default()
    };
    let mut dancer = Dancer::new(graph.clone(), &own, start, 0.0..1.0);
    planner.note_step(CommittedStep {
        from: start,
        via: start,
        to: start + 1,
        beats: 1,
        attribute: Attribute::None,
    });
    let wanted = vec![wanted; planner.horizon() + 1];
    let (mut beat, mut pose) = (1, Pose::rest(graph.skeleton.len()));
    let mut headings: Vec<Vec3> = Vec::new();
    while beat < BEATS {
        let ahead = |n| MusicBeat {
            seconds: PERIOD as f32,
            energy: 0.6,
            bar_position: (beat + n) % 4,
            beats_per_bar: 4,
        };
        let music: Vec<MusicBeat> = (0..planner.horizon() as u32).map(ahead).collect();
        let step = planner.commit(&wanted, &music);
        dancer.commit(step, PERIOD);
        for n in 0..step.beats * POSES {
            dancer.pose_at(f64::from(beat) + f64::from(n) / f64::from(POSES), &mut pose);
            headings.push(heading(pose.rotations[0]) * Vec3::Z);
        }
        beat += step.beats;
    }
    headings
}

/// Returns the share of the motion beats of `kind` at which the body faces more than 60° away from
/// its mean direction over the six beats before and after. No placement of the clips on the stage
/// avoids these.
fn own_share(graph: &Graph, kind: Attribute) -> f32 {
    let nodes = 0..graph.nodes.len() as u32;
    let of_kind = nodes.filter(|&node| graph.attribute(node) == kind);
    let away = |&node: &u32| {
        let around = graph.faces(node, -6..7).normalize_or_zero();
        graph.faces(node, 0..1).dot(around) < AWAY
    };
    let (all, away) = (of_kind.clone().count(), of_kind.filter(away).count());
    away as f32 / all.max(1) as f32
}

#[test]
fn dancers_face_the_audience() {
    let defaults = (
        Settings::default().facing,
        dance::Settings::default().facing_turn_deg,
    );
    for (name, graph) in graphs("dancers_face_the_audience") {
        for kind in graph.attributes() {
            if kind == Attribute::Idle {
                continue;
            }
            let label = match kind {
                Attribute::Label(label) => graph.labels[usize::from(label)].as_str(),
                _ => "no label",
            };
            let before = danced(&graph, kind, 0.0, 0.0);
            let now = danced(&graph, kind, defaults.0, defaults.1);
            println!(
                "{name}, {label}: the clips turn away for {:.0} % of their beats; over 60° away {:.0} % of the time, before {:.0} %; turns {:.0}°/s, before {:.0}; 999 of 1000 within {:.0}°/s, before {:.0}",
                100.0 * own_share(&graph, kind),
                100.0 * now.away,
                100.0 * before.away,
                now.turning,
                before.turning,
                now.fastest,
                before.fastest,
            );
            let own = own_share(&graph, kind);
            assert!(now.away <= before.away + 0.02, "{name}, {label}");
            assert!(own > 0.1 || now.away <= 0.2, "{name}, {label}");
        }
    }
}
