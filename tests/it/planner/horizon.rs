//! Tests that a short horizon with the terminal cost costs about as little as a long horizon.
#![allow(clippy::unwrap_used, missing_docs)]

use crate::graphs::graphs;

use std::sync::Arc;

use corybant_core::fault::Faults;
use corybant_core::graph::{Attribute, Graph};
use corybant_core::plan::cost::{Costs, Span, Stretch};
use corybant_core::plan::{MusicBeat, Planner, Settings, TerminalCost};

const BEATS: u32 = 500;

/// Returns the mean cost of a beat over [`BEATS`] beats at the tempo `bpm` without a cue, in
/// thousandths of a cost unit. `beyond` is the terminal cost.
fn mean_cost(graph: &Arc<Graph>, settings: &Settings, beyond: &Arc<TerminalCost>, bpm: f32) -> f64 {
    let start = graph
        .clips
        .iter()
        .find(|clip| clip.attribute == Attribute::None)
        .unwrap()
        .first_node;
    let mut planner = Planner::new(
        graph.clone(),
        settings,
        beyond.clone(),
        start,
        Arc::new(Faults::default()),
    );
    let mut costs = Costs::new(graph, settings);
    let wanted = vec![Attribute::None; planner.horizon() + 1];
    let (mut beat, mut total) = (0, 0);
    while beat < BEATS {
        let ahead = |n| MusicBeat {
            seconds: 60.0 / bpm,
            energy: 0.6,
            bar_position: (beat + n) % 4,
            beats_per_bar: 4,
        };
        let music: Vec<MusicBeat> = (0..planner.horizon() as u32).map(ahead).collect();
        let step = planner.commit(&wanted, &music);
        let fits = |span: &Span| {
            span.beats() as u32 == step.beats && costs.end(step.via, *span) == Some(step.to)
        };
        let span = Span::ALL.into_iter().find(fits).unwrap();
        let ways = graph
            .transitions_from(step.from)
            .iter()
            .filter(|transition| transition.via == step.via);
        let weight = (step.via != step.from).then(|| {
            ways.map(|transition| transition.weight)
                .fold(f32::INFINITY, f32::min)
        });
        total += costs
            .step(step.via, step.to, &Stretch::new(span, &music), weight)
            .unwrap();
        total += costs.mismatch(&wanted[..step.beats as usize], step.attribute);
        costs.record(step.via + 1, step.to, step.beats);
        beat += step.beats;
    }
    total as f64 / f64::from(beat)
}

#[test]
fn eight_beats_with_the_terminal_cost_plan_like_sixty_four() {
    let mut worse = Vec::new();
    for (name, graph) in graphs("eight_beats_with_the_terminal_cost_plan_like_sixty_four") {
        // The cost of repetition depends on the danced path, so two dances soon differ completely. The
        // test therefore averages over seeds.
        for (repetition, seeds, most) in [(0.0, 0..1, 1.01), (2.0, 0..8, 1.05)] {
            let settings = |horizon_beats, seed| Settings {
                horizon_beats,
                repetition,
                seed,
                ..Settings::default()
            };
            let (full, none) = (
                Arc::new(TerminalCost::new(&graph, &settings(8, 0), 4)),
                Arc::new(TerminalCost::reach_only(&graph, 4)),
            );
            for bpm in [100.0, 120.0, 140.0] {
                let mean = |horizon, beyond: &Arc<TerminalCost>| -> f64 {
                    let costs = seeds
                        .clone()
                        .map(|seed| mean_cost(&graph, &settings(horizon, seed), beyond, bpm));
                    costs.sum::<f64>() / seeds.clone().count() as f64
                };
                let (long, short, blind) = (mean(64, &none), mean(8, &full), mean(8, &none));
                println!(
                    "{name}, repetition {repetition}, {bpm} bpm: {long:.1} a beat with 64 beats; {:.3} of it with 8, {:.3} without a terminal cost",
                    short / long,
                    blind / long
                );
                worse.extend((short / long > most).then_some((
                    name,
                    repetition,
                    bpm,
                    short / long,
                )));
            }
        }
    }
    assert!(worse.is_empty(), "{worse:?}");
}
