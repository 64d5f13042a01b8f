//! The verbs: a verb is one command that a performer's tool can send. `table` is the list of all
//! verbs; this file has its types.
//!
//! The OSC addresses ([`namespace`](super::namespace)), the texts of MIDI maps and cue lists
//! ([`control_text`](super::control_text)), the ranges and help texts of OSCQuery, and
//! `docs/osc.md` ([`verb_docs`](super::verb_docs)) are all derived from [`VERBS`] and [`READOUTS`].
//! A test of the web page reads every page message in the table.
//!
//! In: nothing. Out: the table. Thread: any.

mod table;

use std::fmt;

use super::launch::Launch;
use super::scene::SceneId;
use super::set::{SONGS_MAX, SetCommand, SongRef, TitleKey};
use super::tempo_limits::{BPM_ALLOWED, NUDGE_MS_MAX};
use super::{Cue, DanceCommand, OFFSET_MS_MAX, OutputCommand};
use crate::graph::LabelId;
use crate::tempo::command::TempoCommand;
use crate::tempo::source::TempoSource;
use crate::time::{Bpm, Seconds};

pub use table::{READOUTS, VERBS};

/// The arguments of a report of timecode, in words.
pub const TIMECODE_TAKES: &str =
    "\"01:00:00:00\", or hours, minutes, seconds and frame, or seconds";

/// The placeholder for the name of a label in the OSC addresses and texts of the command table.
pub const LABEL: &str = "LABEL";

/// The placeholder for the name of a scene in the OSC addresses and texts of the command table.
pub const SCENE: &str = "SCENE";

/// One command that a performer can send, with its form in OSC, in MIDI maps and cue lists, and on
/// the web page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verb {
    /// The OSC address of the command, in which [`LABEL`] stands for the name of a label; `None` if
    /// the command cannot be sent by OSC.
    pub address: Option<&'static str>,
    /// The effect of the command, such as a cue that it sends.
    pub command: Command,
    /// The value that the OSC address reports to control surfaces; `None` if it reports none.
    pub readout: Option<Readout>,
    /// The command as text in a MIDI map or a cue list, such as `!panic`; empty if the command has
    /// no such text.
    pub text: &'static str,
    /// The command as a JSON message of the web page; empty if the page cannot send the command.
    pub message: &'static str,
    /// Help text, one phrase, in which [`LABEL`] stands for the name of a label.
    pub help: &'static str,
}

/// The effect of a command that a performer sends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Button: sends this cue when the button is pressed.
    Button(Cue),
    /// Intensity: sets the intensity of the dance (how much the body moves), 0 to 1.
    Intensity,
    /// Performer: sets how much live performers move the parts of dancers that `pass` names, 0 to 1.
    Performer,
    /// Offset: sets the common offset of all outputs, in milliseconds. It is the time by which they
    /// send their poses earlier.
    Offset,
    /// Nudge: moves the beats later (positive) or earlier (negative), in milliseconds.
    Nudge,
    /// Tempo: sets the tempo, in beats per minute.
    Bpm,
    /// Source: selects the tempo source whose name is the argument.
    Source,
    /// Freeze: keeps the current tempo and ignores the tempo source, or ends this.
    Freeze,
    /// Engage: lets timecode lead the cue list, or ends this.
    Engage,
    /// Timecode: reports the position of the timecode source "osc"; see
    /// `osc::timecode`.
    Timecode,
    /// Beat: reports one beat of the tempo source "osc"; see [`beat`](super::osc::beat).
    Beat,
    /// Jump: starts the song of the set list that the argument names.
    Jump,
    /// Holds the cue list of the song, or ends this.
    SetHold,
    /// Sync: requests that the values of all OSC addresses are sent again.
    Sync,
}

/// The first argument of a command that was received.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// Absent: the command was received without an argument.
    Absent,
    /// Number: any number; true is converted to 1 and false to 0.
    Number(f64),
    /// Source: a text that is the name of a tempo source.
    Source(TempoSource),
    /// Title: any other text, which may be the title of a song.
    Title(TitleKey),
    /// Other: any other argument, such as a blob or an array.
    Other,
}

/// The kind of argument that a command accepts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Argument {
    /// Button: a number above 0 or no argument presses the button; any other number releases it.
    Button,
    /// Switch: a number above 0 turns the switch on, 0 or a number below 0 turns it off, and no
    /// argument reverses its state.
    Switch,
    /// Number: a number from `min` to `max`.
    Number {
        /// The smallest allowed number.
        min: f64,
        /// The largest allowed number.
        max: f64,
        /// Unit of the number, in words; empty if the number has no unit.
        unit: &'static str,
    },
    /// Source: the name of a tempo source, such as `midi`.
    Source,
    /// Song: the number of a song, counted from 1, or its title.
    Song,
    /// Timecode: a frame or a time in seconds.
    Timecode,
}

/// The type and range of the value at an OSC address.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Unit: a float from 0 to 1, for example the value of a button or a fader.
    Unit,
    /// Number: a float from the first number (minimum) to the second number (maximum).
    Number(f64, f64),
    /// Count: an integer from 0 to this maximum.
    Count(i32),
    /// Text: a string.
    Text,
    /// Section: the name of the section of the music (a string), the number of beats until the next
    /// one (an integer, -1 if it is not announced), and the confidence (a float, 0 to 1).
    Section,
    /// Place: the place in a phrase from 1, and its number of beats (two integers).
    Place,
}

/// A value that the show reports to control surfaces at an OSC address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Readout {
    /// State of the pad (button) of this label: 1 while the label is danced because of a cue, 0.5
    /// while a cue for the label exists but is not danced, otherwise 0.
    Pad(LabelId),
    /// State of this scene: 1 while it is on, 0.5 while it waits for its beat, otherwise 0.
    Scene(SceneId),
    /// State of the pad (button) of this label as an integer for lamps: 2 while the label is danced
    /// because of a cue, 1 while a cue for the label exists but is not danced, otherwise 0.
    Lamp(LabelId),
    /// Hold: 1 while a performer repeats the current motion in a loop, otherwise 0.
    Hold,
    /// Frozen: 1 while the tempo is frozen (the tempo source is ignored), otherwise 0.
    Frozen,
    /// From: 1 while this tempo source is selected, otherwise 0.
    From(TempoSource),
    /// Time by which all outputs send their poses earlier, in milliseconds.
    Offset,
    /// The current tempo, in beats per minute.
    Bpm,
    /// Position of the dance between the latest beat (0) and the next beat (1).
    Phase,
    /// Confidence in the beats: the probability that the next beat is right, 0 to 1.
    Confidence,
    /// Name of the clip that is danced now.
    Clip,
    /// Name of the clip on the last committed beat (the last beat whose motion is already fixed).
    Next,
    /// Label of the newest waiting or running cue that is not queued. If there is no such cue, it
    /// is the label of the first queued cue (queued cues start after all others).
    Cue,
    /// Labels of the waiting and running cues, at most 8, separated by commas. The cues that are
    /// not queued come first, the newest first; then come the queued cues in order of their start.
    Queue,
    /// Name of the selected tempo source.
    Source,
    /// The section of the music.
    Section,
    /// The section that the music announces.
    NextSection,
    /// The place of the beat in its phrase.
    PhraseBeat,
    /// 1 while a song of the set list waits for its bar or beat, otherwise 0.
    SetGo,
    /// 1 while the cue list of the song is held, otherwise 0.
    SetHold,
    /// Title of the song that is played.
    Song,
    /// Title of the song that GO starts.
    NextSong,
    /// Number of whole beats since the first beat of the song.
    SongBeat,
    /// Level of the audio input, 0 (-60 dBFS or less) to 1 (full scale).
    Level,
    /// Lateness of the poses, in milliseconds: 99 of 100 recent poses were sent at most this long
    /// after their deadlines.
    Late,
    /// Number of times since the start that audio input was lost because the show was late.
    Overruns,
    /// A counter that increases every two seconds while the program is running.
    Heartbeat,
}

/// An OSC address that only reports a value and receives no commands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadoutAddress {
    /// The OSC address that reports the value; [`LABEL`] in it stands for the name of a label.
    pub address: &'static str,
    /// Type and range of the value that is reported.
    pub shape: Shape,
    /// The value that is reported at the address.
    pub readout: Readout,
    /// Help text, one phrase, in which [`LABEL`] stands for the name of a label.
    pub help: &'static str,
}

impl Command {
    /// Returns the kind of argument that this command accepts.
    pub fn argument(self) -> Argument {
        let number = |min, max, unit| Argument::Number { min, max, unit };
        match self {
            Self::Button(_) | Self::Beat | Self::Sync => Argument::Button,
            Self::Intensity | Self::Performer => number(0.0, 1.0, ""),
            Self::Offset => number(-OFFSET_MS_MAX, OFFSET_MS_MAX, "milliseconds"),
            Self::Nudge => number(-NUDGE_MS_MAX, NUDGE_MS_MAX, "milliseconds"),
            Self::Bpm => number(*BPM_ALLOWED.start(), *BPM_ALLOWED.end(), "beats per minute"),
            Self::Source => Argument::Source,
            Self::Freeze | Self::Engage | Self::SetHold => Argument::Switch,
            Self::Jump => Argument::Song,
            Self::Timecode => Argument::Timecode,
        }
    }

    /// Returns the cue that the command sends with the argument `value`; `None` if the command does
    /// not accept the argument or sends no cue. A nudge over its limit is accepted here; the show
    /// sets it to the limit.
    pub fn cue(self, value: Value) -> Option<Cue> {
        Some(match (self, value) {
            (Self::Button(cue), Value::Absent) => cue,
            (Self::Intensity, Value::Number(x)) if (0.0..=1.0).contains(&x) => {
                DanceCommand::Intensity(Some(x as f32)).into()
            }
            (Self::Performer, Value::Number(x)) if (0.0..=1.0).contains(&x) => {
                OutputCommand::Performer(x as f32).into()
            }
            (Self::Offset, Value::Number(ms)) if ms.abs() <= OFFSET_MS_MAX => {
                OutputCommand::Offset(Seconds(ms / 1000.0)).into()
            }
            (Self::Nudge, Value::Number(ms)) if ms.is_finite() => {
                TempoCommand::Nudge(Seconds(ms / 1000.0)).into()
            }
            (Self::Bpm, Value::Number(bpm)) if BPM_ALLOWED.contains(&bpm) => {
                TempoCommand::Tempo(Bpm(bpm)).into()
            }
            (Self::Source, Value::Source(source)) => TempoCommand::Source(source).into(),
            (Self::Freeze, Value::Absent) => TempoCommand::Freeze(None).into(),
            (Self::Freeze, Value::Number(on)) if on.is_finite() => {
                TempoCommand::Freeze(Some(on > 0.0)).into()
            }
            (Self::Engage, Value::Absent) => TempoCommand::Engage(None).into(),
            (Self::Engage, Value::Number(on)) if on.is_finite() => {
                TempoCommand::Engage(Some(on > 0.0)).into()
            }
            (Self::Jump, value) => SetCommand::Jump(song(value)?).into(),
            (Self::SetHold, Value::Absent) => SetCommand::Hold(None).into(),
            (Self::SetHold, Value::Number(on)) if on.is_finite() => {
                SetCommand::Hold(Some(on > 0.0)).into()
            }
            _ => return None,
        })
    }

    /// Returns this command with `label` as its label. A command that belongs to no label is
    /// returned unchanged.
    pub fn with_label(self, label: LabelId) -> Self {
        match self {
            Self::Button(Cue::Dance(command)) => Self::Button(Cue::Dance(match command {
                DanceCommand::Launch(launch) => DanceCommand::Launch(Launch { label, ..launch }),
                DanceCommand::Lift { .. } => DanceCommand::Lift { label },
                DanceCommand::Cancel { .. } => DanceCommand::Cancel { label },
                DanceCommand::Panic
                | DanceCommand::Hold(_)
                | DanceCommand::Release
                | DanceCommand::Intensity(_)
                | DanceCommand::Follow(_) => command,
            })),
            other => other,
        }
    }

    /// Returns this command with `scene` as its scene. A command that belongs to no scene is
    /// returned unchanged.
    pub fn with_scene(self, scene: SceneId) -> Self {
        match self {
            Self::Button(Cue::Scene(Some(_))) => Self::Button(Cue::Scene(Some(scene))),
            other => other,
        }
    }
}

/// Returns the song that the argument `value` names: a whole number from 1 to
/// [`SONGS_MAX`], or a title. `None` for any other argument.
fn song(value: Value) -> Option<SongRef> {
    match value {
        Value::Number(x) if x.fract() == 0.0 && (1.0..=SONGS_MAX as f64).contains(&x) => {
            Some(SongRef::Number(x as u32))
        }
        Value::Title(key) => Some(SongRef::Title(key)),
        // A song may have the name of a tempo source.
        Value::Source(source) => Some(SongRef::Title(TitleKey::of(source.name()))),
        Value::Number(_) | Value::Absent | Value::Other => None,
    }
}

impl Readout {
    /// Returns this value with `scene` as its scene. A value that belongs to no scene is returned
    /// unchanged.
    pub fn with_scene(self, scene: SceneId) -> Self {
        match self {
            Self::Scene(_) => Self::Scene(scene),
            other => other,
        }
    }

    /// Returns this value with `label` as its label. A value that belongs to no label is returned
    /// unchanged.
    pub fn with_label(self, label: LabelId) -> Self {
        match self {
            Self::Pad(_) => Self::Pad(label),
            Self::Lamp(_) => Self::Lamp(label),
            other => other,
        }
    }
}

impl Argument {
    /// Returns the type and range of the value of an OSC address that accepts this argument.
    pub fn shape(self) -> Shape {
        match self {
            Self::Button | Self::Switch => Shape::Unit,
            Self::Number { min, max, .. } if (min, max) == (0.0, 1.0) => Shape::Unit,
            Self::Number { min, max, .. } => Shape::Number(min, max),
            Self::Source | Self::Song | Self::Timecode => Shape::Text,
        }
    }
}

impl fmt::Display for Argument {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Button => write!(f, "a number or nothing"),
            Self::Switch => write!(f, "1, 0 or nothing"),
            Self::Number { min, max, unit: "" } => {
                write!(f, "a number from {min} to {max}")
            }
            Self::Number { min, max, unit } => {
                write!(f, "a number from {min} to {max} ({unit})")
            }
            Self::Source => write!(f, "{}", TempoSource::NAMES),
            Self::Song => f.write_str("the number of a song (1 to 1000) or its title"),
            Self::Timecode => f.write_str(TIMECODE_TAKES),
        }
    }
}

impl Shape {
    /// Returns the OSC type tags of the value: `f` (float), `i` (integer) and `s` (string).
    pub fn tags(self) -> &'static str {
        match self {
            Self::Unit | Self::Number(..) => "f",
            Self::Count(_) => "i",
            Self::Text => "s",
            Self::Section => "sif",
            Self::Place => "ii",
        }
    }
}

impl Verb {
    /// Returns the first word of the command's text in MIDI maps, without its `!`, such as `nudge`;
    /// `None` if the text does not begin with `!`.
    pub fn word(&self) -> Option<&'static str> {
        self.text.strip_prefix('!')?.split(' ').next()
    }
}

#[cfg(test)]
mod tests;
