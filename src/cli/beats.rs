//! `corybant beats`: prints the beats of a music file.

use std::path::PathBuf;

use crate::audio::file;
use corybant_core::beat::bar_length::BarLength;
use corybant_core::beat::offline;
use corybant_core::beat::tracker::{BeatSource, BeatTracker, TrackerSettings};
use corybant_core::beat::tsv::{write_beats, write_sections, write_whole};

use super::{Outcome, ignore_closed_pipe};

/// Arguments of `corybant beats`.
#[derive(clap::Args, Debug)]
pub(super) struct BeatsArgs {
    /// Music file: wav, flac, ogg or mp3
    audio: PathBuf,
    /// Beat tracker: net, flux or aubio [default: net]
    #[arg(long, value_name = "NAME")]
    tracker: Option<String>,
    /// Also print each beat's place in its bar, from 1, and the number of beats in the bar
    #[arg(long)]
    bars: bool,
    /// Beats per bar: auto, 2, 3 or 4 [default: auto]
    #[arg(long, value_name = "N")]
    beats_per_bar: Option<BarLength>,
    /// Print the sections of the music instead: time of the first beat, time of the decision, name,
    /// confidence, announced or begun
    #[arg(long, conflicts_with_all = ["bars", "whole"])]
    sections: bool,
    /// Analyse the whole file, instead of predicting beats as in a live show
    #[arg(long)]
    whole: bool,
}

/// `corybant beats`: prints the beats of a music file: the beats that the live tracker predicts,
/// the sections of the music, or, with `--whole`, the beats that an analysis of the whole file finds. The analysis finds no
/// beats where the music pauses.
///
/// # Errors
/// The file cannot be decoded, the tracker is unknown, or it cannot analyse a whole file.
pub(super) fn beats(args: &BeatsArgs) -> Outcome {
    let mut settings = TrackerSettings::default();
    if let Some(name) = &args.tracker {
        settings.tracker = name.parse()?;
    }
    if let Some(length) = args.beats_per_bar {
        settings.beats_per_bar = length;
    }
    let sound = file::decode(&args.audio)?;
    let mut out = std::io::stdout().lock();
    if args.whole {
        let beats = offline::beats(&settings, &sound.samples, &mut |_| ())?;
        return ignore_closed_pipe(write_whole(&beats, sound.duration.0, args.bars, &mut out));
    }
    let mut tracker = BeatTracker::new(&settings, BeatSource::Audio)?;
    if args.sections {
        return ignore_closed_pipe(write_sections(&mut tracker, &sound.samples, &mut out));
    }
    let written = write_beats(&mut tracker, &sound.samples, args.bars, &mut out);
    ignore_closed_pipe(written.map(|_| ()))
}
