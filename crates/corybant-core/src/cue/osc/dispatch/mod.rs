//! Converts OSC messages to cues. In: an OSC address, which may be a pattern, and the first
//! argument. Out: the cues that the message sends. Thread: any. Allocates.

use super::beat::BEAT_TAKES;
use super::pattern::{Pattern, is_pattern};
use crate::cue::launch::Launch;
use crate::cue::namespace::{CUE_PREFIX, Namespace};
use crate::cue::verbs::{Argument, Command, Value};
use crate::cue::{Cue, CueNames, DanceCommand};

/// The greatest length of an OSC address in bytes; a message with a longer one is rejected.
pub const ADDRESS_MAX: usize = 256;

/// The reasons why an OSC message is rejected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejected {
    /// Address: the show does not have the OSC address of the message.
    Address,
    /// Read-only: the OSC address of the message only reports a value and accepts no messages.
    ReadOnly,
    /// Label: the OSC address of the message names a label that the motion graph does not have.
    Label,
    /// Ambiguous: the OSC address of the message is a pattern that matches commands of different
    /// kinds.
    Ambiguous,
    /// Argument: the argument of the message has a wrong type or is out of its range.
    Argument {
        /// The kind of argument that the OSC address accepts.
        takes: Argument,
    },
    /// The first argument of `/beat` is not a finite number.
    BeatArgument,
}

impl Rejected {
    /// Returns the arguments that the OSC address accepts, in words. `None` if the message was not
    /// rejected because of its argument.
    pub fn takes(&self) -> Option<String> {
        match self {
            Self::Argument { takes } => Some(takes.to_string()),
            Self::BeatArgument => Some(BEAT_TAKES.into()),
            Self::Address | Self::ReadOnly | Self::Label | Self::Ambiguous => None,
        }
    }
}

/// The effect of an OSC message: the OSC addresses that match it, and the cues that it sends.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Resolved {
    /// The OSC addresses of the show that match the message, as indices in [`Namespace::all`].
    pub addresses: Vec<usize>,
    /// The cues that the message sends.
    pub cues: Vec<Cue>,
    /// True if the message requests that the values of all OSC addresses are sent again.
    pub sync: bool,
}

/// A converter from the OSC messages that a show receives to cues.
#[derive(Clone, Debug)]
pub struct OscMap {
    /// All OSC addresses of the show.
    namespace: Namespace,
    /// True if the strength of a press on a label's button also sets the intensity of the dance.
    velocity_as_intensity: bool,
}

impl OscMap {
    /// Creates a converter with the OSC addresses for `labels`; `labels[i]` is the name of label
    /// `i` of the motion graph.
    pub fn new(labels: &[String]) -> Self {
        Self::of(labels.into())
    }

    /// Creates a converter with the OSC addresses for the labels and scenes in `names`.
    pub fn of(names: CueNames) -> Self {
        Self {
            namespace: Namespace::of(names),
            velocity_as_intensity: false,
        }
    }

    /// Sets whether the strength of a press on a label's button (the message's argument, 0 to 1)
    /// also sets the intensity of the dance (how much the body moves).
    pub fn set_velocity_as_intensity(&mut self, on: bool) {
        self.velocity_as_intensity = on;
    }

    /// Returns all OSC addresses of the show.
    pub fn namespace(&self) -> &Namespace {
        &self.namespace
    }

    /// Returns the effect of an OSC message to `address` whose first argument is `argument`. The
    /// argument 0 releases a button. `address` may be a pattern that matches many labels, but only
    /// one kind of command.
    ///
    /// # Errors
    /// [`Rejected`] if the show cannot use the message.
    pub fn resolve(&self, address: &str, argument: Value) -> Result<Resolved, Rejected> {
        if address.len() > ADDRESS_MAX {
            return Err(Rejected::Address);
        }
        let mut resolved = Resolved {
            addresses: self.matching(address)?,
            ..Resolved::default()
        };
        for &number in &resolved.addresses {
            let Some(command) = self.namespace.all()[number].command else {
                continue;
            };
            if command == Command::Sync {
                resolved.sync = pressure(argument)?.is_some();
                continue;
            }
            let cue = self.cue(command, argument)?;
            resolved
                .cues
                .extend(cue.filter(|cue| !resolved.cues.contains(cue)));
        }
        Ok(resolved)
    }

    /// Returns the OSC addresses that match `address`, which may be a pattern, and that accept
    /// commands, as indices in [`Namespace::all`]. Returns an error if there is none, or if their
    /// commands are of different kinds.
    fn matching(&self, address: &str) -> Result<Vec<usize>, Rejected> {
        let all = self.namespace.all();
        let found: Vec<usize> = if is_pattern(address) {
            let pattern = Pattern::new(address).ok_or(Rejected::Address)?;
            (0..all.len())
                .filter(|&i| all[i].command.is_some() && pattern.matches(&all[i].path))
                .collect()
        } else {
            match self.namespace.find(address) {
                Some(i) if all[i].command.is_none() => return Err(Rejected::ReadOnly),
                found => found.into_iter().collect(),
            }
        };
        // The same command for several labels is one kind of command.
        let mut kinds = found
            .iter()
            .filter_map(|&i| all[i].command)
            .map(|command| command.with_label(0));
        match kinds.next() {
            None if address.starts_with(CUE_PREFIX) => Err(Rejected::Label),
            None => Err(Rejected::Address),
            Some(first) if kinds.any(|other| other != first) => Err(Rejected::Ambiguous),
            Some(_) => Ok(found),
        }
    }

    /// Returns the cue that `command` sends with the argument `argument`; `None` if no cue is sent,
    /// for example at the release of a button. Returns an error if the command does not accept the
    /// argument.
    fn cue(&self, command: Command, argument: Value) -> Result<Option<Cue>, Rejected> {
        match (command, argument) {
            (Command::Button(cue), _) => Ok(self.button(cue, pressure(argument)?)),
            // A beat or a timecode needs a time, which the receiver adds.
            (Command::Beat | Command::Timecode, _) => Ok(None),
            // Touch surfaces send 0 when the finger leaves a button; this does not change a value.
            (
                Command::Nudge | Command::Bpm | Command::Source | Command::Jump,
                Value::Number(0.0),
            ) => Ok(None),
            _ => command
                .cue(argument)
                .map(Some)
                .ok_or_else(|| Rejected::Argument {
                    takes: command.argument(),
                }),
        }
    }

    /// Returns the cue to send when a button is pressed or released; `None` if no cue is to be
    /// sent. `cue` is the cue of the button, and `pressure` is 0 to 1 for a press and `None` for a
    /// release.
    fn button(&self, cue: Cue, pressure: Option<f32>) -> Option<Cue> {
        match (cue, pressure) {
            (Cue::Dance(DanceCommand::Launch(launch)), Some(_)) if self.velocity_as_intensity => {
                Some(Cue::from(Launch {
                    intensity: pressure,
                    ..launch
                }))
            }
            (_, Some(_)) => Some(cue),
            (Cue::Dance(command), None) => command.on_release().map(Cue::Dance),
            (
                Cue::Tempo(_) | Cue::TempoMessage(_) | Cue::Output(_) | Cue::Scene(_) | Cue::Set(_),
                None,
            ) => None,
        }
    }
}

/// Returns the strength, 0 to 1, with which a message with this argument presses a button; 1 if
/// there is no argument. `None` if the argument releases the button. Returns an error if the
/// argument is not a number.
fn pressure(argument: Value) -> Result<Option<f32>, Rejected> {
    match argument {
        Value::Absent => Ok(Some(1.0)),
        Value::Number(x) if x > 0.0 => Ok(Some(x.min(1.0) as f32)),
        Value::Number(x) if x <= 0.0 => Ok(None),
        Value::Number(_) | Value::Source(_) | Value::Title(_) | Value::Other => {
            Err(Rejected::Argument {
                takes: Argument::Button,
            })
        }
    }
}

#[cfg(test)]
mod tests;
