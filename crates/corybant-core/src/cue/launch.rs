//! The launch of a label: when its dance starts and how it ends.
//!
//! In: words of a cue list, a MIDI map or an OSC address. Out: plain values. Thread: any. Modes and
//! quantisation are those of clip launchers such as Ableton Live.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::DEFAULT_BEATS;
use crate::beat::form::section::PhraseGrid;
use crate::graph::LabelId;
use crate::time::Bars;

/// The launch mode of a cue: what ends the cue that a pad (button of a label) has started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Trigger: the cue ends after its number of beats, counted from the first beat on which its
    /// label is danced. If the cue avoids its label, the count begins on the first beat on which
    /// the cue may start.
    #[default]
    Trigger,
    /// Gate: the cue lasts while its pad is held, and ends when the pad is released.
    Gate,
    /// Toggle: the cue ends when its pad is pressed a second time.
    Toggle,
    /// Repeat: the cue lasts while its pad is held, and its motion is repeated in a loop. The cue's
    /// number of beats is the length of the loop.
    Repeat,
}

/// The quantisation of a cue: the beats of the music on which the cue may start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Quantise {
    /// Now: the cue starts at once. The dancer jumps to the most similar pose among the motions of
    /// the label.
    #[serde(rename = "now")]
    Now,
    /// Beat: the cue starts on the next beat whose motion the planner has not yet committed
    /// (fixed).
    #[default]
    #[serde(rename = "beat")]
    Beat,
    /// Bar: the cue starts at the start of the next bar.
    #[serde(rename = "bar")]
    Bar,
    /// Two bars: the cue starts at the start of the next group of two bars.
    #[serde(rename = "2bars")]
    Bars2,
    /// Four bars: the cue starts at the start of the next group of four bars.
    #[serde(rename = "4bars")]
    Bars4,
    /// Eight bars: the cue starts at the start of the next group of eight bars.
    #[serde(rename = "8bars")]
    Bars8,
    /// Phrase: the cue starts at the start of the next phrase: 8 bars after the last one, or at the
    /// next section that the music announces.
    #[serde(rename = "phrase")]
    Phrase,
}

/// The bars and phrases of the music: on which beats a cue may start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Metre {
    /// The beats that start a bar, and the length of a bar.
    pub bars: Bars,
    /// The beats that start a phrase.
    pub phrases: PhraseGrid,
}

/// The error for an unknown word in the place of a launch mode or of a quantisation.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{word}`: {allowed} are allowed")]
pub struct UnknownWord {
    /// The unknown word.
    pub word: String,
    /// The words that are allowed in place of the unknown word, for the error message.
    pub allowed: &'static str,
}

impl Mode {
    /// All launch modes, each with its name in cue lists, MIDI maps and OSC addresses.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::Trigger, "trigger"),
        (Self::Gate, "gate"),
        (Self::Toggle, "toggle"),
        (Self::Repeat, "repeat"),
    ];

    /// Returns true if a cue with this mode lasts while its pad is held, and ends when the pad is
    /// released.
    pub fn is_held(self) -> bool {
        matches!(self, Self::Gate | Self::Repeat)
    }
}

impl FromStr for Mode {
    type Err = UnknownWord;

    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        let found = Self::ALL.iter().find(|(_, name)| *name == word);
        found.map(|(mode, _)| *mode).ok_or(UnknownWord {
            word: word.into(),
            allowed: "trigger, gate, toggle and repeat",
        })
    }
}

impl Quantise {
    /// All quantisations, each with its name in cue lists, MIDI maps and OSC addresses.
    pub const ALL: [(Self, &'static str); 7] = [
        (Self::Now, "now"),
        (Self::Beat, "beat"),
        (Self::Bar, "bar"),
        (Self::Bars2, "2bars"),
        (Self::Bars4, "4bars"),
        (Self::Bars8, "8bars"),
        (Self::Phrase, "phrase"),
    ];

    /// Returns the number of bars from one possible start of a cue to the next; 0 if the cue may
    /// start on any beat, or at the start of a phrase.
    fn bars(self) -> i64 {
        match self {
            Self::Now | Self::Beat | Self::Phrase => 0,
            Self::Bar => 1,
            Self::Bars2 => 2,
            Self::Bars4 => 4,
            Self::Bars8 => 8,
        }
    }

    /// Returns the number of the first beat, at or after `beat`, on which a cue with this
    /// quantisation may start. `metre` tells which beats start a bar and which start a phrase.
    pub fn from(self, beat: i64, metre: &Metre) -> i64 {
        if self == Self::Phrase {
            return metre.phrases.next_start(beat);
        }
        let bars = metre.bars;
        match self.bars() * i64::from(bars.beats) {
            0 => beat,
            every => beat + (bars.first - beat).rem_euclid(every),
        }
    }
}

impl FromStr for Quantise {
    type Err = UnknownWord;

    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        let found = Self::ALL.iter().find(|(_, name)| *name == word);
        found.map(|(quantise, _)| *quantise).ok_or(UnknownWord {
            word: word.into(),
            allowed: "now, beat, bar, 2bars, 4bars, 8bars and phrase",
        })
    }
}

/// The request to dance a label (kind of motion, such as `salsa`), or to avoid it. A pad sends the
/// request in a cue.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Launch {
    /// The label to dance or, if `avoid` is true, to avoid.
    pub label: LabelId,
    /// Number of beats, at least 1. In the mode trigger, it is the length of the cue; in the mode
    /// repeat, the length of the motion that is repeated.
    pub beats: u32,
    /// What ends the cue: its number of beats, the release of its pad, or a second press.
    pub mode: Mode,
    /// The beats on which the cue may start, such as the first beat of a bar.
    pub quantise: Quantise,
    /// For a held pad: the pad counts as released this many beats after the first beat on which the
    /// cue may start. `None` if a person releases the pad. Cue lists set this number, because
    /// nobody releases a pad there.
    pub held_beats: Option<u32>,
    /// Intensity of the dance (how much the body moves) during the cue, 0 to 1; `None` if the cue
    /// does not set the intensity.
    pub intensity: Option<f32>,
    /// True if the label must not be danced during the cue; false if the label is danced.
    pub avoid: bool,
    /// True if the cue is queued: it waits until the cues of the dancer that are not queued have
    /// ended, and until the cues queued before it have ended.
    pub queued: bool,
}

impl Launch {
    /// Returns the request to dance `label` in the mode trigger, from the next beat on, for `beats`
    /// beats (0 counts as 1).
    pub const fn new(label: LabelId, beats: u32) -> Self {
        Self {
            label,
            beats: if beats == 0 { 1 } else { beats },
            mode: Mode::Trigger,
            quantise: Quantise::Beat,
            held_beats: None,
            intensity: None,
            avoid: false,
            queued: false,
        }
    }

    /// Returns the request to dance `label` with default settings: for 8 beats in the mode trigger,
    /// from the next beat on.
    pub const fn plain(label: LabelId) -> Self {
        Self::new(label, DEFAULT_BEATS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_launch_waits_for_bars_but_not_for_beats() {
        let metre = Metre {
            bars: Bars { first: 2, beats: 4 },
            phrases: PhraseGrid {
                first: 2,
                beats: 32,
                end: Some(18),
            },
        };
        let from = |quantise: Quantise| [1, 2, 3, 7].map(|beat| quantise.from(beat, &metre));
        assert_eq!(from(Quantise::Beat), [1, 2, 3, 7]);
        assert_eq!(from(Quantise::Now), [1, 2, 3, 7]);
        assert_eq!(from(Quantise::Bar), [2, 2, 6, 10]);
        assert_eq!(from(Quantise::Bars2), [2, 2, 10, 10]);
        assert_eq!(from(Quantise::Bars4), [2, 2, 18, 18]);
        assert_eq!(from(Quantise::Phrase), [2, 2, 18, 18]);
    }

    #[test]
    fn every_word_is_parsed_and_serialised_as_itself() {
        for (mode, name) in Mode::ALL {
            assert_eq!(name.parse(), Ok(mode));
            assert_eq!(serde_json::to_value(mode).ok(), Some(name.into()));
        }
        for (quantise, name) in Quantise::ALL {
            assert_eq!(name.parse(), Ok(quantise));
            assert_eq!(serde_json::to_value(quantise).ok(), Some(name.into()));
        }
        assert_eq!(
            "gated".parse::<Mode>().map_err(|error| error.to_string()),
            Err("`gated`: trigger, gate, toggle and repeat are allowed".into())
        );
    }
}
