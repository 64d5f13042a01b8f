//! Scratch.
use corybant::audio::file;
use corybant_core::beat::tracker::{BeatSource, BeatTracker, TrackerSettings};
use corybant_core::dsp::SAMPLE_RATE;
use corybant_core::time::Bpm;

use crate::common::shared;

/// Greatest error of a right beat, in seconds.
const RIGHT_S: f64 = 0.07;

fn trace(samples: &[f32], first: f64, period: f64, hint: Option<f64>) -> String {
    let mut tracker = BeatTracker::new(&TrackerSettings::default(), BeatSource::Audio).unwrap();
    tracker.feed(&vec![0.0; 2 * SAMPLE_RATE as usize]);
    tracker.hint(hint.map(Bpm));
    let mut text = String::new();
    let mut n = 0;
    for piece in samples.chunks(441) {
        tracker.feed(piece);
        while let Some(beat) = tracker.next_predicted() {
            n += 1;
            if n <= 14 { text += &format!("{:.2} ", (beat.time.0 - 2.0 - first) / period); }
        }
    }
    text
}

fn lock(samples: &[f32], truth: &[f64], hint: Option<f64>) -> Option<f64> {
    let mut tracker = BeatTracker::new(&TrackerSettings::default(), BeatSource::Audio).unwrap();
    tracker.feed(&vec![0.0; 2 * SAMPLE_RATE as usize]);
    tracker.hint(hint.map(Bpm));
    let mut run: Vec<f64> = Vec::new();
    for piece in samples.chunks(441) {
        tracker.feed(piece);
        while let Some(beat) = tracker.next_predicted() {
            let time = beat.time.0 - 2.0;
            let near = truth.iter().any(|t| (t - time).abs() < RIGHT_S);
            let period = truth.windows(2).find(|w| w[1] > time).map_or(0.5, |w| w[1] - w[0]);
            let is_next = run.last().is_none_or(|last| (time - last - period).abs() < 2.0 * RIGHT_S);
            if !near { run.clear(); } else { if !is_next { run.clear(); } run.push(time); }
            if run.len() == 4 { return Some(run[0]); }
        }
    }
    None
}

#[test]
fn eval_hint() {
    for set in ["dev"] {
    let folder = shared::shared(&format!("beats/{set}")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(folder.join("manifest.json")).unwrap()).unwrap();
    let mut all: Vec<Vec<f64>> = vec![Vec::new(); 6];
    for row in manifest.as_array().unwrap() {
        if row["stress"].as_bool() == Some(true) { continue; }
        let name = row["file"].as_str().unwrap();
        let sound = folder.join(name);
        let truth: Vec<f64> = std::fs::read_to_string(sound.with_extension("beats")).unwrap().lines().filter_map(|l| l.split_whitespace().next()?.parse().ok()).collect();
        let samples = file::decode(&sound).unwrap().samples;
        let samples = &samples[..samples.len().min(25 * SAMPLE_RATE as usize)];
        let mut periods: Vec<f64> = truth.windows(2).map(|w| w[1]-w[0]).collect(); periods.sort_by(f64::total_cmp);
        let period = periods[periods.len()/2]; let bpm = 60.0/period;
        // Sound begins?
        let start = samples.iter().position(|x| x.abs() > 0.01).unwrap_or(0) as f64 / f64::from(SAMPLE_RATE);
        let first = truth.iter().copied().find(|t| *t >= start - 0.03).unwrap_or(0.0);
        let mut line = format!("{name:60} {bpm:6.1} ");
        for (i, hint) in [None, Some(bpm), Some(bpm*1.1), Some(bpm*0.9), Some(bpm*1.5), Some(bpm/1.5)].into_iter().enumerate() {
            let at = lock(samples, &truth, hint);
            let beats = at.map_or(99.0, |at| (at - first)/period);
            all[i].push(beats);
            line += &format!("{beats:6.1} ");
        }
        println!("{line}"); if set == "dev" { println!("   no:  {}", trace(&samples[..samples.len().min(10*44100)], first, period, None)); println!("   hint: {}", trace(&samples[..samples.len().min(10*44100)], first, period, Some(bpm))); }
    }
    for (i, list) in all.iter_mut().enumerate() { list.sort_by(f64::total_cmp); let n = list.len(); println!("{set} hint {i}: median {:.1} within4 {:.2} p75 {:.1} p90 {:.1} never {}", list[n/2], list.iter().filter(|b| **b <= 4.2).count() as f64 / n as f64, list[n*3/4], list[n*9/10], list.iter().filter(|b| **b > 98.0).count()); }
    }
}
