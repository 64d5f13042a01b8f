//! The section `[tempo]` of a show file: the initial tempo source, and the settings of the beat
//! tracker.
//!
//! In: values of the show file. Out: checked settings.
//! Thread: any.
//! Allocates: yes.

use serde::{Deserialize, Serialize};

use super::source::{Sources, TempoSource};
use crate::beat::bar_length::BarLength;
use crate::beat::tracker::{TrackerKind, TrackerSettings};

/// The allowed tempi of the tempo source "fixed", in beats per minute.
const FIXED_BPM_ALLOWED: std::ops::RangeInclusive<f64> = 20.0..=400.0;

/// The role of a show in an Ableton Link session (a tempo that programs on a network share).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LinkRole {
    /// Off: the show does not join a Link session, unless Link is the tempo source of the settings.
    #[default]
    Off,
    /// Follow: the show joins the session but never changes its tempo. If Link is the tempo source,
    /// the beats have the tempo of the session.
    Follow,
    /// Lead: the session follows the tempo of the show. If Link is the tempo source, tempo commands
    /// of a performer change the tempo of the session.
    Lead,
}

/// The settings in the section `[tempo]` of a show file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The tempo source at the start of the show.
    pub source: TempoSource,
    /// The tempo of the tempo source "fixed", in beats per minute, 20 to 400. It is doubled or
    /// halved until it is between `bpm_min` and `bpm_max`. It is also the first tempo of a show
    /// that starts with Link, MIDI clock, OSC or taps.
    pub bpm: f64,
    /// The show's role in an Ableton Link session.
    pub link: LinkRole,
    /// The port from which MIDI clock is received: `system:PORT` or `jack:PORT` with the name of
    /// the port or a part of it. With `jack:` alone, the show waits until a user connects its JACK
    /// port. If the text is empty, no MIDI clock is received.
    pub midi_clock: String,
    /// The kind of beat tracker for the audio input.
    pub tracker: TrackerKind,
    /// The slowest tempo that the beat tracker can find, in beats per minute, 50 to 400. Slower
    /// music is tracked at twice its tempo.
    pub bpm_min: f64,
    /// The fastest tempo that the beat tracker can find, in beats per minute: up to 400 and at
    /// least twice `bpm_min`. Faster music is tracked at half its tempo.
    pub bpm_max: f64,
    /// Number of beats in a bar. [`BarLength::Auto`] has effect on beats that the tracker finds; the
    /// bars of other sources then have four beats.
    pub beats_per_bar: BarLength,
}

impl Default for Settings {
    fn default() -> Self {
        let TrackerSettings {
            tracker,
            bpm_min,
            bpm_max,
            beats_per_bar,
        } = TrackerSettings::default();
        Self {
            source: TempoSource::Audio,
            bpm: 120.0,
            link: LinkRole::Off,
            midi_clock: String::new(),
            tracker,
            bpm_min,
            bpm_max,
            beats_per_bar,
        }
    }
}

impl Settings {
    /// Returns the part of the settings that concerns the beat tracker.
    pub fn tracker(&self) -> TrackerSettings {
        TrackerSettings {
            tracker: self.tracker,
            bpm_min: self.bpm_min,
            bpm_max: self.bpm_max,
            beats_per_bar: self.beats_per_bar,
        }
    }

    /// Returns true if the show joins an Ableton Link session.
    pub fn joins_link(&self) -> bool {
        self.link != LinkRole::Off || self.source == TempoSource::Link
    }

    /// Returns the set of tempo sources that a performer can select in this show.
    pub fn sources(&self) -> Sources {
        let opened = [
            (TempoSource::Link, self.joins_link()),
            (TempoSource::Midi, !self.midi_clock.is_empty()),
            (TempoSource::Timecode, self.source == TempoSource::Timecode),
        ];
        opened
            .into_iter()
            .filter(|(_, opened)| *opened)
            .fold(Sources::default(), |sources, (source, _)| {
                sources.with(source)
            })
    }

    /// Adds a sentence to `problems` for each setting that has a value that is not allowed. `key`
    /// is the name of the section in the show file, such as `tempo`.
    pub fn check(&self, key: &str, problems: &mut Vec<String>) {
        self.tracker().check_tempi(key, problems);
        if !FIXED_BPM_ALLOWED.contains(&self.bpm) {
            let (least, most) = (FIXED_BPM_ALLOWED.start(), FIXED_BPM_ALLOWED.end());
            problems.push(format!(
                "{key}.bpm is {}; it must be {least} to {most} beats a minute.",
                self.bpm
            ));
        }
        if self.source == TempoSource::Midi && self.midi_clock.is_empty() {
            problems.push(format!(
                "{key}.source is \"midi\", but {key}.midi_clock is empty; it must say where the clock comes from, such as \"system:PORT\"."
            ));
        }
        self.tracker().check_bar(key, problems);
    }
}
