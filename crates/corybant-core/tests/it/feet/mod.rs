//! Tests of the feet of a dancer: they stand, roll and step as those of a person.
#![allow(clippy::unwrap_used, missing_docs)]

mod dances;
mod measure;

use std::sync::Arc;

use corybant_core::graph::Graph;

use crate::common::shared;
use dances::{Motions, danced, folder};
use measure::{Cause, Figures, measure, percentile};

/// Prints the figures of a dance.
fn print(name: &str, figures: &Figures) {
    let of = |wanted: Option<Cause>| -> Vec<f32> {
        let slides = figures.slides.iter();
        slides
            .filter(|it| wanted.is_none_or(|wanted| it.cause == wanted))
            .map(|it| 1000.0 * it.metres)
            .collect()
    };
    println!(
        "{name}: {} transitions; joints at most {:.1} m/s (source {:.1}); knees at most {:.2} rad a pose (source {:.2})",
        figures.transitions,
        figures.speeds[0],
        figures.speeds[1],
        figures.knees[0],
        figures.knees[1]
    );
    let line = |what: &str, slides: Vec<f32>| {
        println!(
            "  {what}: {} slides, median {:.1} mm, 95 of 100 within {:.1}, most {:.1}",
            slides.len(),
            percentile(&slides, 0.5),
            percentile(&slides, 0.95),
            percentile(&slides, 1.0)
        );
    };
    line("all", of(None));
    line("in clips", of(Some(Cause::Clip)));
    line("at transitions", of(Some(Cause::Transition)));
    line("at corrections", of(Some(Cause::Correction)));
    line(
        "source",
        figures.source.iter().map(|it| 1000.0 * it).collect(),
    );
}

/// Dances on `motions` with and without cues; returns the figures of both dances.
fn dance(name: &str, motions: &Motions, seconds: f64) -> [Figures; 2] {
    [false, true].map(|cued| {
        let dance = danced(&motions.graph, seconds, cued);
        let figures = measure(motions, &dance);
        print(
            &format!("{name}, {}", if cued { "cued" } else { "free" }),
            &figures,
        );
        if std::env::var_os("WORST").is_some() {
            let mut worst: Vec<_> = figures.slides.iter().collect();
            worst.sort_by(|a, b| b.metres.total_cmp(&a.metres));
            for it in worst.iter().take(14) {
                let ticks = [it.at.1, it.at.2].map(|i| &dance.ticks[i]);
                let line = &dance.lines[ticks[0].line];
                let splices: Vec<usize> = (it.at.1.saturating_sub(40)..it.at.2)
                    .filter(|&i| i > 0 && measure::changes(&dance, i))
                    .collect();
                println!(
                    "    {:.0} mm {:?} {:?} {} frame {:.0}..{:.0} splices {:?}",
                    1000.0 * it.metres,
                    it.cause,
                    it.at,
                    motions.graph.clips[line.clip as usize].name,
                    line.frame_at(ticks[0].beat),
                    dance.lines[ticks[1].line].frame_at(ticks[1].beat),
                    splices
                );
            }
        }
        if std::env::var_os("WORST").is_some() {
            let mut worst: Vec<_> = figures.slides.iter().collect();
            worst.sort_by(|a, b| b.metres.total_cmp(&a.metres));
            for it in worst.iter().take(7) {
                measure::trace(motions, &dance, it.at.0, it.at.1.saturating_sub(16)..it.at.1 + 14);
            }
        }
        figures
    })
}

#[test]
fn feet_of_real_motions_stand() {
    let Some(path) = shared::shared("motion/dev") else {
        shared::skip("feet_of_real_motions_stand", "../shared is absent");
        return;
    };
    let motions = folder(&path, &|_| true);
    let figures = dance("dev", &motions, 300.0);
    for figures in figures {
        let slides: Vec<f32> = figures.slides.iter().map(|it| it.metres).collect();
        assert!(percentile(&slides, 0.95) <= 0.03);
    }
}

#[test]
fn feet_of_built_in_motions_stand() {
    let graph: Graph = corybant_repertoire::graph().unwrap();
    let motions = Motions {
        source: corybant_repertoire::graph().unwrap(),
        graph: Arc::new(graph),
    };
    dance("built-in", &motions, 300.0);
}
