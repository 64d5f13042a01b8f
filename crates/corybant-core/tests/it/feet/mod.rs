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

/// Dances on `motions` with and without cues, and checks that 95 of 100 slides are within 30 mm,
/// that no joint is much faster than 15 m/s or than in the motions, and that no knee jumps.
fn check(name: &str, motions: &Motions) {
    for cued in [false, true] {
        let dance = danced(&motions.graph, 300.0, cued);
        let figures = measure(motions, &dance);
        let name = format!("{name}, {}", if cued { "cued" } else { "free" });
        print(&name, &figures);
        let slides: Vec<f32> = figures.slides.iter().map(|it| it.metres).collect();
        assert!(slides.len() > 300, "{name}: {} slides", slides.len());
        assert!(percentile(&slides, 0.95) <= 0.03, "{name}");
        assert!(percentile(&slides, 0.5) <= 0.01, "{name}");
        let [sent, source] = figures.speeds;
        assert!(sent <= 1.3 * source.max(15.0), "{name}: {sent} m/s");
        let [sent, source] = figures.knees;
        assert!(sent <= 1.6 * source.max(0.5), "{name}: {sent} rad");
    }
}

#[test]
fn feet_of_real_motions_stand() {
    let Some(path) = shared::shared("motion/dev") else {
        shared::skip("feet_of_real_motions_stand", "../shared is absent");
        return;
    };
    check("real motions", &folder(&path));
}

#[test]
fn feet_of_built_in_motions_stand() {
    let graph: Graph = corybant_repertoire::graph().unwrap();
    let motions = Motions {
        source: corybant_repertoire::graph().unwrap(),
        graph: Arc::new(graph),
    };
    check("built-in motions", &motions);
}
