//! One entry `[[midi.map]]` of a show file: a control of a MIDI device and the cue that it sends.
//! In: the entry as read by serde. Out: checked values. Thread: any.

use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::cue::control_text::{self, ControlAction, ControlTextError, MARK};
use crate::cue::launch::{Launch, Mode, Quantise};
use crate::cue::take::{TakeRefusal, TakeRequest};
use crate::cue::{CueNames, DEFAULT_BEATS, find_label};
use crate::text::did_you_mean;

/// The greatest number of beats of a cue that a MIDI map may set.
pub const BEATS_MAX: u32 = 1024;
/// The highest number of a MIDI control change that can stand for a knob, a fader or a button. The
/// numbers 120 to 127 are channel mode messages.
pub const CC_MAX: u8 = 119;

/// The reasons why an entry of a MIDI map, which assigns a cue to a control, cannot be used.
#[derive(Debug, Error, PartialEq)]
pub enum MapError {
    /// The graph does not have the label to which the entry refers.
    #[error(
        "midi.map: {control} asks for the label {label:?}, which the graph does not have; there is {}{}",
        listed(labels),
        did_you_mean(label, labels.iter().map(String::as_str))
    )]
    Label {
        /// The control, in words such as "note 36".
        control: String,
        /// The label that the entry names.
        label: String,
        /// The names of all labels of the motion graph.
        labels: Vec<String>,
    },
    /// The command in the entry, such as `!panic`, is unknown or has a wrong argument.
    #[error("midi.map: {control} asks for {label:?}: {source}")]
    Command {
        /// The control, in words such as "note 36".
        control: String,
        /// The text of the command in the entry, such as `!panic`.
        label: String,
        /// The reason why the text in the entry is not a valid command.
        source: ControlTextError,
    },
    /// The entry records takes, and its label or its number of beats is not allowed for a take.
    #[error("midi.map: {control} records: {source}")]
    Take {
        /// The control, in words such as "note 36".
        control: String,
        /// The reason.
        source: TakeRefusal,
    },
}

/// Returns the names in quotation marks, separated by commas, for an error message; the word `none`
/// if `names` is empty.
fn listed(names: &[String]) -> String {
    if names.is_empty() {
        return "none".into();
    }
    let quoted: Vec<String> = names.iter().map(|name| format!("{name:?}")).collect();
    quoted.join(", ")
}

/// A control (pad, key, knob or fader) of a MIDI device, identified by the kind and the number of
/// its messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Control {
    /// Note: a pad or a key, with its note number, 0 to 127.
    Note(u8),
    /// Control change: a knob, a fader or a button, with its control number, 0 to 127.
    Cc(u8),
    /// Program change: a button that selects a program, with its program number, 0 to 127.
    Program(u8),
}

impl fmt::Display for Control {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Note(number) => write!(f, "note {number}"),
            Self::Cc(number) => write!(f, "cc {number}"),
            Self::Program(number) => write!(f, "program {number}"),
        }
    }
}

/// One entry `[[midi.map]]` of a show file, which assigns a cue to a control of a MIDI device.
/// Exactly one of `note`, `cc` and `program` is set and identifies the control.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapEntry {
    /// The MIDI note number of the control, 0 to 127; `None` if the control sends no notes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<u8>,
    /// The control change number of the control, 0 to [`CC_MAX`]; `None` if the control sends no
    /// control changes. As a button, the control is pressed when its value rises to 64 or more, and
    /// released when its value falls below 64.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cc: Option<u8>,
    /// The program number of the control as transmitted by MIDI, 0 to 127; `None` if the control
    /// sends no program changes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub program: Option<u8>,
    /// The MIDI channel on which the control sends, 1 to 16; `None` for every channel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channel: Option<u8>,
    /// The label to dance, spelled as in the motion graph or as in its OSC address, or a command
    /// such as `!panic`, `!tap` or `!intensity` (see [`control_text`]).
    pub label: String,
    /// The number of beats of the cue, 1 to [`BEATS_MAX`]; `None` for [`DEFAULT_BEATS`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beats: Option<u32>,
    /// What ends the cue: its number of beats, the release of the control, or a second press.
    #[serde(default, skip_serializing_if = "is_default")]
    pub mode: Mode,
    /// The beats on which the cue may start, such as the first beat of a bar.
    #[serde(default, skip_serializing_if = "is_default")]
    pub quantise: Quantise,
    /// True if the velocity with which the control is pressed also sets the intensity of the dance.
    #[serde(default, skip_serializing_if = "is_default")]
    pub velocity_as_intensity: bool,
    /// True if the label must not be danced during the cue; false if the label is danced.
    #[serde(default, skip_serializing_if = "is_default")]
    pub avoid: bool,
    /// True if the cue is queued: it waits until the cues of the dancer that are not queued have
    /// ended, and until the cues queued before it have ended.
    #[serde(default, skip_serializing_if = "is_default")]
    pub queue: bool,
    /// True if the control records takes of the live performer with the label instead of launching
    /// it: a press starts a take, and the next press stops it, unless `beats` stops it before. The
    /// graph need not have the label yet.
    #[serde(default, skip_serializing_if = "is_default")]
    pub record: bool,
}

/// Returns true if `value` is the default value of its type. Such a value is not written to a show
/// file.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl MapEntry {
    /// Returns the control to which the entry applies; `None` unless exactly one of `note`, `cc`
    /// and `program` is set.
    pub fn control(&self) -> Option<Control> {
        match (self.note, self.cc, self.program) {
            (Some(note), None, None) => Some(Control::Note(note)),
            (None, Some(cc), None) => Some(Control::Cc(cc)),
            (None, None, Some(program)) => Some(Control::Program(program)),
            _ => None,
        }
    }

    /// Returns this entry with another control: `control` on the MIDI channel `channel`, which is 1
    /// to 16, or `None` for every channel.
    pub fn of(self, control: Control, channel: Option<u8>) -> Self {
        let (mut note, mut cc, mut program) = (None, None, None);
        match control {
            Control::Note(number) => note = Some(number),
            Control::Cc(number) => cc = Some(number),
            Control::Program(number) => program = Some(number),
        }
        Self {
            note,
            cc,
            program,
            channel,
            ..self
        }
    }

    /// Returns the action of the control of this entry: a cue, or setting the intensity. `names` are
    /// the labels of the motion graph and the scenes of the show.
    ///
    /// # Errors
    /// [`MapError::Label`] if the graph does not have the label, [`MapError::Command`] if the text
    /// after `!` is not a command.
    pub fn action<'a>(&self, names: impl Into<CueNames<'a>>) -> Result<ControlAction, MapError> {
        let names = names.into();
        if self.record {
            return self.take();
        }
        let Some(label) = find_label(names.labels, &self.label) else {
            return self.command(names);
        };
        let plain = Launch::new(label, self.beats.unwrap_or(DEFAULT_BEATS));
        let intensity = self.velocity_as_intensity.then_some(1.0);
        let launch = Launch {
            mode: self.mode,
            quantise: self.quantise,
            intensity,
            avoid: self.avoid,
            queued: self.queue,
            ..plain
        };
        Ok(ControlAction::Button(launch.into()))
    }

    /// Returns the action of an entry that records takes.
    fn take(&self) -> Result<ControlAction, MapError> {
        let request = TakeRequest::toggle(&self.label, self.beats.map(i64::from));
        match request {
            Ok(request) => Ok(ControlAction::Take(Arc::new(request))),
            Err(source) => Err(MapError::Take {
                control: self.control_text(),
                source,
            }),
        }
    }

    /// Returns the control in words such as "note 36", for an error message.
    fn control_text(&self) -> String {
        self.control()
            .map_or_else(|| "a control".into(), |control| control.to_string())
    }

    /// Returns the action of an entry whose text `label` is a command such as `!panic`. The labels
    /// in `names` are listed in the error if the text does not begin with `!`.
    fn command(&self, names: CueNames) -> Result<ControlAction, MapError> {
        let missing = || MapError::Label {
            control: self.control_text(),
            label: self.label.clone(),
            labels: names.labels.to_vec(),
        };
        let text = self.label.strip_prefix(MARK).ok_or_else(missing)?;
        control_text::parse_for(text, names.scenes).map_err(|source| MapError::Command {
            control: self.control_text(),
            label: self.label.clone(),
            source,
        })
    }

    /// Adds a sentence to `problems` for each value of the entry that is not allowed. `key` is the
    /// name of the entry in the show file, such as `midi 1.map[0]`.
    pub fn check(&self, key: &str, problems: &mut Vec<String>) {
        match (self.control(), [("note", self.note, 127), ("cc", self.cc, CC_MAX), ("program", self.program, 127)]) {
            (None, _) => problems.push(format!("{key} must have exactly one of note, cc and program, by which the control is known.")),
            (_, numbers) => problems.extend(numbers.into_iter().filter_map(|(name, number, most)| {
                let number = number.filter(|&number| number > most)?;
                Some(format!("{key}.{name} is {number}; it must be from 0 to {most}."))
            })),
        }
        if let Some(channel) = self.channel.filter(|channel| !(1..=16).contains(channel)) {
            problems.push(format!(
                "{key}.channel is {channel}; it must be from 1 to 16, or be left out for any."
            ));
        }
        if let Some(beats) = self.beats.filter(|beats| !(1..=BEATS_MAX).contains(beats)) {
            problems.push(format!(
                "{key}.beats is {beats}; it must be from 1 to {BEATS_MAX}."
            ));
        }
        if self.label.is_empty() {
            problems.push(format!("{key}.label is empty; it must be a label of the graph, or a command such as \"!panic\" or \"!tap\"."));
        }
        let has_launch_keys =
            self.mode != Mode::default() || self.quantise != Quantise::default() || self.avoid;
        let is_command = self.label.starts_with(MARK);
        if self.record
            && (has_launch_keys || self.queue || self.velocity_as_intensity || is_command)
        {
            problems.push(format!(
                "{key}.record is true; it needs a label without {MARK}, and of the other keys only beats and the control are allowed."
            ));
        }
        problems.extend(self.unfit().map(|why| format!("{key}: {why}.")));
    }

    /// Returns the reason why the control cannot send the cue of the entry; `None` if it can. For
    /// example, a program change cannot send a cue that ends with the release of a button.
    pub fn unfit(&self) -> Option<&'static str> {
        if !matches!(self.control(), Some(Control::Program(_))) {
            return None;
        }
        if self.mode.is_held() {
            return Some(
                "a program change is never let go, so its mode must be \"trigger\" or \"toggle\"",
            );
        }
        let text = self.label.strip_prefix(MARK).map(control_text::parse);
        matches!(text, Some(Ok(ControlAction::Fader(_)))).then_some(
            "a program change has no value: write \"!intensity 0.7\", or use a knob or a fader",
        )
    }

    /// Returns true if a MIDI message can match both this entry and `other`: they have the same
    /// control, and the same channel, or one of them accepts every channel.
    pub fn clashes(&self, other: &Self) -> bool {
        let channels =
            self.channel == other.channel || self.channel.is_none() || other.channel.is_none();
        self.control().is_some() && self.control() == other.control() && channels
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cue::verbs::Command;

    #[test]
    fn an_entry_that_records_needs_no_known_label() {
        let record = MapEntry {
            record: true,
            beats: Some(16),
            ..note(36, None, "mine")
        };
        let toggle = TakeRequest::toggle("mine", Some(16)).unwrap();
        assert_eq!(
            record.action(CueNames::default()),
            Ok(ControlAction::Take(Arc::new(toggle)))
        );
        let refused = MapEntry {
            beats: Some(300),
            ..record.clone()
        };
        let why = refused.action(CueNames::default()).unwrap_err().to_string();
        assert!(
            why.starts_with("midi.map: note 36 records: a take of 300"),
            "{why}"
        );
        let count = |entry: &MapEntry| {
            let mut problems = Vec::new();
            entry.check("midi 1.map[0]", &mut problems);
            problems.len()
        };
        assert_eq!(count(&record), 0);
        for wrong in [
            MapEntry {
                mode: Mode::Gate,
                ..record.clone()
            },
            MapEntry {
                avoid: true,
                ..record.clone()
            },
            MapEntry {
                label: "!panic".into(),
                ..record.clone()
            },
        ] {
            assert_eq!(count(&wrong), 1, "{wrong:?}");
        }
    }

    fn note(note: u8, channel: Option<u8>, label: &str) -> MapEntry {
        MapEntry {
            label: label.into(),
            ..MapEntry::default()
        }
        .of(Control::Note(note), channel)
    }

    #[test]
    fn an_entry_needs_a_known_label_or_command() {
        let labels = ["Salsa".to_owned()];
        let wrong = |label: &str| {
            note(36, None, label)
                .action(&labels)
                .unwrap_err()
                .to_string()
        };
        assert_eq!(
            wrong("tango"),
            "midi.map: note 36 asks for the label \"tango\", which the graph does not have; there is \"Salsa\""
        );
        assert_eq!(
            wrong("!bpm"),
            "midi.map: note 36 asks for \"!bpm\": `bpm` takes a number from 20 to 400 (beats per minute)"
        );
        assert!(
            wrong("!triple")
                .contains("unknown command `triple`; allowed are scene SCENE, scene_end, panic")
        );
        assert_eq!(
            note(36, None, "!intensity").action(&labels).unwrap(),
            ControlAction::Fader(Command::Intensity)
        );
    }
}
