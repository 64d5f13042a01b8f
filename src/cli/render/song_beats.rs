//! The beats of a whole song, for `corybant render` and `corybant score`. In: samples, or beat
//! times from a file. Out: beats from the start to beyond the end of the song. Thread: main.

use std::error::Error;

use super::stages::{Stage, Stages};
use crate::cli::inputs::{BeatTimes, locate_beat_error};
use crate::config::Config;
use corybant_core::beat::offline::{self, Beat, sections};
use corybant_core::beat::tracker::{BeatSource, BeatTracker};

/// Smallest mean confidence of the beats of a song, 0 to 1. With a lower confidence, the song is
/// treated as having no beats.
const CONFIDENCE_MIN: f32 = 0.1;

/// Beats of a whole song. They cover the time from its start to beyond its end.
pub(in crate::cli) struct SongBeats {
    pub(in crate::cli) beats: Vec<Beat>,
    /// Number of the first beat in `beats` on the show's timeline: 0, or -1 if that beat is before
    /// the start of the song.
    pub(in crate::cli) first: i64,
    /// Index in `beats` of the beat that is beat 0 in cue lists.
    pub(in crate::cli) counted_from: usize,
}

/// Finds the beats and sections of the song with the samples `samples`. If `beat_times` (`--beats`) is given,
/// uses these times instead.
///
/// # Errors
/// There are fewer than two beats, their mean confidence is too low, or `beat_times` is invalid.
pub(in crate::cli) fn find_beats(
    config: &Config,
    samples: &[f32],
    beat_times: Option<&BeatTimes>,
    stages: &Stages,
) -> Result<Vec<Beat>, Box<dyn Error>> {
    let mut beats = find_times(config, samples, beat_times, stages)?;
    sections::find(samples, &mut beats)?;
    Ok(beats)
}

/// Finds the beats as [`find_beats`] does, without the sections of the music.
fn find_times(
    config: &Config,
    samples: &[f32],
    beat_times: Option<&BeatTimes>,
    stages: &Stages,
) -> Result<Vec<Beat>, Box<dyn Error>> {
    if let Some(beat_times) = beat_times {
        BeatTracker::new(
            &config.tempo.tracker(),
            BeatSource::Annotated(beat_times.times.clone()),
        )
        .map_err(|error| locate_beat_error(error.into(), Some(beat_times)))?;
        return Ok(offline::annotated(
            &beat_times.times,
            samples,
            config.tempo.beats_per_bar.initial(),
        ));
    }
    stages.update(Stage::Beats, 0.0);
    let beats = offline::beats(&config.tempo.tracker(), samples, &mut |done| {
        stages.update(Stage::Beats, done)
    })?;
    let music = || beats.iter().filter(|beat| beat.music);
    let confidence =
        music().map(|beat| beat.confidence).sum::<f32>() / music().count().max(1) as f32;
    if music().count() < 2 {
        return Err(
            "it holds only silence or steady noise; give beat times with --beats FILE".into(),
        );
    }
    if confidence < CONFIDENCE_MIN {
        return Err(format!(
            "no beats are found in it (beat confidence {:.0} %); give beat times with --beats FILE",
            100.0 * confidence
        )
        .into());
    }
    Ok(beats)
}

/// Returns the beats `found` of a song, with further beats before and after them, so that the beats
/// cover the time from the start of the song to beyond its end. `seconds` is the length of the
/// song.
pub(in crate::cli) fn extend_beats(found: Vec<Beat>, seconds: f64) -> SongBeats {
    let first = found.iter().position(|beat| beat.music).unwrap_or(0);
    let (beats, before) = offline::through(found, seconds);
    SongBeats {
        first: if beats[0].time < 0.0 { -1 } else { 0 },
        beats,
        counted_from: before + first,
    }
}

/// Returns a line of text for the terminal with the number of beats and the median tempo.
pub(in crate::cli) fn describe_beats(beats: &[Beat]) -> String {
    let mut periods: Vec<f64> = beats
        .windows(2)
        .filter(|pair| pair[0].music)
        .map(|pair| pair[1].time - pair[0].time)
        .collect();
    periods.sort_by(f64::total_cmp);
    let bpm = periods
        .get(periods.len() / 2)
        .map_or(0.0, |period| 60.0 / period);
    format!("{} beats at about {bpm:.1} beats a minute\n", periods.len())
}
