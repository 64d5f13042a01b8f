//! One entry `[[dmx_in.patch]]` of a show file: a channel and the cues that its levels send. In: the
//! entry as read by serde. Out: checked values. Thread: any.

use std::fmt;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::CHANNELS;
use crate::cue::control_text::{self, ControlAction, ControlTextError, MARK};
use crate::cue::launch::{Launch, Mode, Quantise};
use crate::cue::midi::BEATS_MAX;
use crate::cue::{CueNames, DEFAULT_BEATS, find_label};
use crate::text::did_you_mean;

/// Number of levels in each band of an entry with `labels`. The first band begins at this level.
const BAND_WIDTH: usize = 10;
/// Greatest number of labels in one entry.
const LABELS_MAX: usize = 24;
/// The band of an entry with one label and no levels of its own.
const BUTTON: Band = Band { from: 128, to: 255 };
/// The band of an entry whose level is a value.
const WHOLE: Band = Band { from: 0, to: 255 };

/// The levels of a channel that send one cue, both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Band {
    /// Lowest level.
    pub from: u8,
    /// Highest level.
    pub to: u8,
}

impl Band {
    /// Returns true if `level` is in the band.
    pub fn has(self, level: u8) -> bool {
        (self.from..=self.to).contains(&level)
    }

    fn overlaps(self, other: Self) -> bool {
        self.from <= other.to && other.from <= self.to
    }
}

impl fmt::Display for Band {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}", self.from, self.to)
    }
}

/// The reasons why an entry of a patch cannot be used.
#[derive(Debug, Error, PartialEq)]
pub enum PatchError {
    /// The graph does not have the label to which the entry refers.
    #[error(
        "asks for the label {label:?}, which the graph does not have; there are: {}{}",
        labels.join(", "),
        did_you_mean(label, labels.iter().map(String::as_str))
    )]
    Label {
        /// The label that the entry names.
        label: String,
        /// The names of all labels of the motion graph.
        labels: Vec<String>,
    },
    /// The command in the entry, such as `!panic`, is unknown or has a wrong argument.
    #[error("asks for {label:?}: {source}")]
    Command {
        /// The text of the command in the entry.
        label: String,
        /// The reason why the text in the entry is not a valid command.
        source: ControlTextError,
    },
    /// The command records takes, which DMX cannot do.
    #[error("asks for {label:?}, which works only in [[midi.map]]")]
    Take {
        /// The text of the command in the entry.
        label: String,
    },
}

/// One entry `[[dmx_in.patch]]` of a show file, which assigns cues to the levels of a channel.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PatchEntry {
    /// The channel, 1 to [`CHANNELS`].
    pub channel: u16,
    /// Lowest level that sends the cue, 1 to 255; `None` for the default of the entry's kind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<u8>,
    /// Highest level that sends the cue, `from` to 255; `None` for the default of the entry's kind.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<u8>,
    /// The label to dance, or a command such as `!panic` or `!intensity`; empty with `labels`.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub label: String,
    /// The labels of one channel: the first has the levels 10 to 19, the second 20 to 29, and so on.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub labels: Vec<String>,
    /// The number of beats of the cue, 1 to [`BEATS_MAX`]; `None` for [`DEFAULT_BEATS`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beats: Option<u32>,
    /// What ends the cue: its number of beats, another level, or the same level again.
    #[serde(default, skip_serializing_if = "is_default")]
    pub mode: Mode,
    /// The beats on which the cue may start.
    #[serde(default, skip_serializing_if = "is_default")]
    pub quantise: Quantise,
    /// True if the label must not be danced during the cue.
    #[serde(default, skip_serializing_if = "is_default")]
    pub avoid: bool,
    /// True if the cue is queued.
    #[serde(default, skip_serializing_if = "is_default")]
    pub queue: bool,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl PatchEntry {
    /// Returns each band of the entry with its label or command.
    pub fn bands(&self) -> Vec<(Band, &str)> {
        if self.labels.is_empty() {
            let band = match (self.from, self.to) {
                (None, None) if self.is_fader() => WHOLE,
                (None, None) => BUTTON,
                (from, to) => Band {
                    from: from.unwrap_or(1),
                    to: to.unwrap_or(u8::MAX),
                },
            };
            return vec![(band, &self.label)];
        }
        let bands = (1..=LABELS_MAX).map(|number| Band {
            from: (number * BAND_WIDTH) as u8,
            to: (number * BAND_WIDTH + BAND_WIDTH - 1) as u8,
        });
        bands.zip(self.labels.iter().map(String::as_str)).collect()
    }

    /// Returns each band of the entry with its action. `names` are the names of all labels and
    /// scenes of the show.
    ///
    /// # Errors
    /// [`PatchError`] of the first label that cannot be used.
    pub fn actions(&self, names: CueNames) -> Result<Vec<(Band, ControlAction)>, PatchError> {
        let bands = self.bands().into_iter();
        let action = |(band, label)| Ok((band, self.action(label, names)?));
        bands.map(action).collect()
    }

    fn action(&self, label: &str, names: CueNames) -> Result<ControlAction, PatchError> {
        let Some(found) = find_label(names.labels, label) else {
            return self.command(label, names);
        };
        let plain = Launch::new(found, self.beats.unwrap_or(DEFAULT_BEATS));
        let launch = Launch {
            mode: self.mode,
            quantise: self.quantise,
            avoid: self.avoid,
            queued: self.queue,
            ..plain
        };
        Ok(ControlAction::Button(launch.into()))
    }

    /// Returns the action of a label that is a command such as `!panic`.
    fn command(&self, label: &str, names: CueNames) -> Result<ControlAction, PatchError> {
        let text = label.strip_prefix(MARK).ok_or_else(|| PatchError::Label {
            label: label.into(),
            labels: names.labels.to_vec(),
        })?;
        let label = label.to_owned();
        match control_text::parse_for(text, names.scenes) {
            Ok(ControlAction::Take(_)) => Err(PatchError::Take { label }),
            Ok(action) => Ok(action),
            Err(source) => Err(PatchError::Command { label, source }),
        }
    }

    /// Returns true if the level of the channel is the value of a command, such as `!intensity`.
    fn is_fader(&self) -> bool {
        let command = self.label.strip_prefix(MARK).map(control_text::parse);
        matches!(command, Some(Ok(ControlAction::Fader(_))))
    }

    /// Adds a sentence to `problems` for each value of the entry that is not allowed. `key` is the
    /// name of the entry in the show file, such as `dmx_in 1.patch 2`.
    pub fn check(&self, key: &str, problems: &mut Vec<String>) {
        if !(1..=CHANNELS).contains(&usize::from(self.channel)) {
            problems.push(format!(
                "{key}.channel is {}; it must be from 1 to {CHANNELS}.",
                self.channel
            ));
        }
        if self.label.is_empty() == self.labels.is_empty() {
            problems.push(format!(
                "{key} must have exactly one of label and labels: a label of the graph or a command such as \"!panic\", or a list of labels."
            ));
        }
        if self.labels.len() > LABELS_MAX {
            problems.push(format!(
                "{key}.labels has {} labels; one channel has room for {LABELS_MAX}: put the others on another channel.",
                self.labels.len()
            ));
        }
        self.check_levels(key, problems);
        if let Some(beats) = self.beats.filter(|beats| !(1..=BEATS_MAX).contains(beats)) {
            problems.push(format!(
                "{key}.beats is {beats}; it must be from 1 to {BEATS_MAX}."
            ));
        }
    }

    fn check_levels(&self, key: &str, problems: &mut Vec<String>) {
        let has_levels = self.from.is_some() || self.to.is_some();
        if has_levels && !self.labels.is_empty() {
            problems.push(format!(
                "{key} has levels (from, to) and labels; the labels have the levels 10 to 19, 20 to 29 and so on: leave from and to out, or write one entry for each label."
            ));
        }
        if has_levels && self.is_fader() {
            problems.push(format!(
                "{key} has levels (from, to), but its level is the value of {:?}: leave from and to out, or write a value, such as \"!intensity 0.7\".",
                self.label
            ));
        }
        let (from, to) = (self.from.unwrap_or(1), self.to.unwrap_or(u8::MAX));
        if from == 0 {
            problems.push(format!(
                "{key}.from is 0; it must be from 1 to 255, because a channel at 0 sends nothing."
            ));
        }
        if from > to {
            problems.push(format!(
                "{key} has the levels {from} to {to}; from must not be above to."
            ));
        }
    }

    /// Returns the first band of this entry and of `other` that overlap on the same channel.
    pub fn overlap(&self, other: &Self) -> Option<(Band, Band)> {
        if self.channel != other.channel {
            return None;
        }
        let others = other.bands();
        let pairs = self.bands().into_iter().flat_map(|(band, _)| {
            let others = others.iter();
            others.map(move |(other, _)| (band, *other))
        });
        pairs
            .into_iter()
            .find(|(band, other)| band.overlaps(*other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cue::verbs::Command;
    use crate::cue::{Cue, DanceCommand};

    fn entry(text: &str) -> PatchEntry {
        toml::from_str(text).unwrap()
    }

    fn problems(text: &str) -> Vec<String> {
        let mut problems = Vec::new();
        entry(text).check("dmx_in 1.patch 1", &mut problems);
        problems
    }

    #[test]
    fn an_entry_has_bands_for_its_labels() {
        let bands = |text: &str| -> Vec<(u8, u8)> {
            let entry = entry(text);
            let bands = entry.bands();
            bands.iter().map(|(band, _)| (band.from, band.to)).collect()
        };
        assert_eq!(
            bands("channel = 1\nlabels = ['salsa', 'pop', 'tango']"),
            [(10, 19), (20, 29), (30, 39)]
        );
        assert_eq!(bands("channel = 1\nlabel = 'salsa'"), [(128, 255)]);
        assert_eq!(bands("channel = 1\nlabel = '!intensity'"), [(0, 255)]);
        assert_eq!(
            bands("channel = 1\nlabel = '!bpm 99'\nfrom = 250"),
            [(250, 255)]
        );
        let many = format!("channel = 1\nlabels = {:?}", vec!["a"; 24]);
        assert_eq!(bands(&many).last(), Some(&(240, 249)));
        assert!(problems(&many).is_empty());
    }

    #[test]
    fn every_invalid_value_is_reported() {
        for (text, expected) in [
            (
                "channel = 0\nlabel = 'a'",
                "patch 1.channel is 0; it must be from 1 to 512",
            ),
            ("channel = 513\nlabel = 'a'", "channel is 513"),
            ("channel = 1", "exactly one of label and labels"),
            (
                "channel = 1\nlabel = 'a'\nlabels = ['b']",
                "exactly one of label and labels",
            ),
            (
                "channel = 1\nlabels = ['a']\nfrom = 3",
                "leave from and to out",
            ),
            (
                "channel = 1\nlabel = '!intensity'\nto = 3",
                "\"!intensity 0.7\"",
            ),
            ("channel = 1\nlabel = 'a'\nfrom = 0", "from is 0"),
            (
                "channel = 1\nlabel = 'a'\nfrom = 9\nto = 8",
                "levels 9 to 8",
            ),
            ("channel = 1\nlabel = 'a'\nbeats = 0", "beats is 0"),
        ] {
            let found = problems(text);
            assert!(
                found.len() == 1 && found[0].contains(expected),
                "{text}: {found:?}"
            );
        }
        let many = format!("channel = 1\nlabels = {:?}", vec!["a"; 25]);
        assert!(problems(&many)[0].contains("has 25 labels"));
    }

    #[test]
    fn overlapping_bands_of_one_channel_are_found() {
        let overlap = |a: &str, b: &str| entry(a).overlap(&entry(b)).is_some();
        let list = "channel = 1\nlabels = ['a', 'b']";
        assert!(overlap(
            list,
            "channel = 1\nlabel = 'c'\nfrom = 29\nto = 40"
        ));
        assert!(!overlap(
            list,
            "channel = 1\nlabel = 'c'\nfrom = 30\nto = 40"
        ));
        assert!(!overlap(
            list,
            "channel = 2\nlabel = 'c'\nfrom = 10\nto = 40"
        ));
        assert!(overlap(list, "channel = 1\nlabel = '!intensity'"));
        assert!(!overlap(list, "channel = 1\nlabel = '!panic'"));
    }

    #[test]
    fn labels_and_commands_of_the_verb_table_are_known() {
        let labels = ["Salsa".to_owned(), "Hip Hop".to_owned()];
        let action = |label: &str| {
            let entry = PatchEntry {
                channel: 1,
                label: label.into(),
                ..PatchEntry::default()
            };
            entry
                .actions((&labels).into())
                .map(|mut actions| actions.remove(0).1)
        };
        assert_eq!(
            action("hip_hop"),
            Ok(ControlAction::Button(Cue::from(Launch::plain(1))))
        );
        assert_eq!(
            action("!panic"),
            Ok(ControlAction::Button(DanceCommand::Panic.into()))
        );
        assert_eq!(
            action("!intensity"),
            Ok(ControlAction::Fader(Command::Intensity))
        );
        let error = |label: &str| action(label).unwrap_err().to_string();
        assert!(error("salza").ends_with("there are: Salsa, Hip Hop; did you mean \"Salsa\"?"));
        assert!(error("!triple").contains("unknown command `triple`"));
        assert!(error("!record_stop").contains("only in [[midi.map]]"));
    }
}
