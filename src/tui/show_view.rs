//! The state of a show as the terminal view knows it. In: events of the link, keys. Out: data for
//! drawing; messages to the show. Pure.

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Value, json};

use super::link::LinkEvent;
use super::message::{Hello, InputProblem, Message, State, Vitals};
use super::target::Target;

/// Time for which a notice is shown on the screen.
const NOTICE_DURATION: Duration = Duration::from_secs(5);
/// Greatest normal age of the latest snapshot of a connected show. If the snapshot is older, the
/// view says that the show sends no messages.
const STATE_AGE_MAX: Duration = Duration::from_secs(2);

/// State of the connection to a show.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Connection {
    /// The first attempt to connect has not ended yet.
    Connecting,
    /// The connection is open.
    Connected,
    /// The connection was lost or could not be opened, for this reason. The link tries again.
    Lost(String),
}

/// Launch settings: how a label that the user starts from the terminal is danced. Each setting is
/// an index into a list of choices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LaunchSettings {
    /// Index into [`MODES`]: the launch mode, which decides what a press of a pad does.
    pub mode: usize,
    /// Index into [`LENGTHS`]: for how many beats the label is danced.
    pub length: usize,
    /// Index into [`STARTS`]: when the label starts.
    pub start: usize,
}

/// Launch modes that the user can choose, which decide what a press of a pad does. For each: the
/// text on the screen, and the name in messages to the show.
pub const MODES: [(&str, &str); 5] = [
    ("once", "trigger"),
    ("gate, until pressed again", "gate"),
    ("until pressed again", "toggle"),
    ("repeat until pressed again", "repeat"),
    ("avoid", "avoid"),
];
/// Numbers of beats for which a label is danced, among which the user can choose.
pub const LENGTHS: [u32; 4] = [4, 8, 16, 32];
/// Times at which a label can start, among which the user can choose. For each: the text on the
/// screen, and the name in messages to the show.
pub const STARTS: [(&str, &str); 8] = [
    ("next beat", "beat"),
    ("at once", "now"),
    ("next bar", "bar"),
    ("2 bars", "2bars"),
    ("4 bars", "4bars"),
    ("8 bars", "8bars"),
    ("phrase", "phrase"),
    ("after all cues", "queue"),
];

/// The state of the pad (button of a label) on the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pad {
    /// No cue for the label is waiting, and the label is not danced.
    Idle,
    /// A cue for the label is waiting. The number of beats until the label starts; `None` if it is
    /// unknown.
    Armed(Option<usize>),
    /// The label is being danced. The number of beats until its cue ends; `None` if it is unknown.
    Dancing(Option<u32>),
}

/// Everything that the terminal view knows about a show.
#[derive(Clone, Debug)]
pub struct ShowView {
    /// Network address and token of the show.
    pub target: Target,
    /// State of the connection to the show.
    pub connection: Connection,
    /// Static data of the show: labels, clips, beats per bar and tempo sources.
    pub hello: Hello,
    /// Latest snapshot of the show, and the time of its arrival; `None` before the first one.
    pub state: Option<(State, Duration)>,
    /// Latest vitals of the show: lateness, state of the outputs, last OSC and MIDI messages.
    pub vitals: Vitals,
    /// Current warnings of the show.
    pub warnings: Vec<String>,
    /// Problems of the sound of the audio input, by their names. Each value is a flag (true while
    /// the problem exists) and the problem. It stays until it has ended and the user dismisses it.
    pub input_problems: BTreeMap<String, (bool, InputProblem)>,
    /// Launch settings for the next pad that the user presses: mode, number of beats and start.
    pub launch: LaunchSettings,
    /// True in learn mode: the next pressed key sends no command; it selects the label or command
    /// that is assigned to a MIDI control.
    pub is_learning: bool,
    /// Indices of the labels whose pads the terminal holds: pads pressed in the mode gate or repeat
    /// and not yet pressed again.
    held_pads: Vec<usize>,
    /// Text of the last notice (short message to the user), and the time at which it appeared;
    /// `None` if there was no notice yet.
    notice: Option<(String, Duration)>,
}

impl ShowView {
    /// Creates the view of the show at `target`, before its first message.
    pub fn new(target: &Target) -> Self {
        Self {
            target: target.clone(),
            connection: Connection::Connecting,
            hello: Hello::default(),
            state: None,
            vitals: Vitals::default(),
            warnings: Vec::new(),
            input_problems: BTreeMap::new(),
            launch: LaunchSettings {
                mode: 0,
                length: 1,
                start: 0,
            },
            is_learning: false,
            held_pads: Vec::new(),
            notice: None,
        }
    }

    /// Updates the view with `event`, which the link reported at `now`, the time since the start of
    /// the terminal view.
    pub fn process(&mut self, event: LinkEvent, now: Duration) {
        match event {
            LinkEvent::Connected => self.connection = Connection::Connected,
            LinkEvent::Disconnected(why) => {
                self.connection = Connection::Lost(why);
                self.is_learning = false;
            }
            LinkEvent::Message(Message::Hello(hello)) => {
                self.state = None;
                self.held_pads.clear();
                self.hello = hello;
            }
            LinkEvent::Message(Message::State(state)) => {
                self.state = Some((*state, now));
            }
            LinkEvent::Message(Message::Vitals(vitals)) => {
                let before = std::mem::replace(&mut self.vitals, vitals);
                self.vitals.osc = self.vitals.osc.take().or(before.osc);
                self.vitals.midi = self.vitals.midi.take().or(before.midi);
                self.update_input_problems();
            }
            LinkEvent::Message(Message::Warnings { warnings }) => self.warnings = warnings,
            LinkEvent::Message(Message::Error { message } | Message::Learn { message }) => {
                self.set_notice(message, now)
            }
            LinkEvent::Message(Message::Other) => {}
        }
    }

    /// Shows `text` as a notice for 5 seconds. `now` is the time since the start of the terminal
    /// view.
    pub fn set_notice(&mut self, text: impl Into<String>, now: Duration) {
        self.notice = Some((text.into(), now));
    }

    /// Returns the notice that the screen shows at the time `now`; `None` if there is none.
    pub fn notice(&self, now: Duration) -> Option<&str> {
        self.notice
            .as_ref()
            .filter(|(_, since)| now.saturating_sub(*since) < NOTICE_DURATION)
            .map(|(text, _)| text.as_str())
    }

    /// Returns true if the show is connected but its last snapshot is older than 2 seconds at the
    /// time `now`.
    pub fn is_stalled(&self, now: Duration) -> bool {
        self.connection == Connection::Connected
            && self
                .state
                .as_ref()
                .is_some_and(|(_, at)| now.saturating_sub(*at) > STATE_AGE_MAX)
    }

    /// Removes the problems of the audio input that no longer exist.
    pub fn dismiss_past_warnings(&mut self) {
        self.input_problems.retain(|_, (is_current, _)| *is_current);
    }

    fn update_input_problems(&mut self) {
        for (is_current, _) in self.input_problems.values_mut() {
            *is_current = false;
        }
        for problem in &self.vitals.input {
            let value = (true, problem.clone());
            self.input_problems.insert(problem.kind.clone(), value);
        }
    }

    /// Returns the state of the pad of each label (no cue, waiting or danced), indexed by label
    /// number.
    pub fn pads(&self) -> Vec<Pad> {
        let mut pads = vec![Pad::Idle; self.hello.labels.len()];
        let Some((state, _)) = &self.state else {
            return pads;
        };
        for &(pad, dancing, beats) in &state.queue {
            let Some(state_of_pad) = pads.get_mut(pad) else {
                continue;
            };
            let start = state
                .ahead
                .iter()
                .position(|&ahead| ahead.is_some_and(|ahead| usize::try_from(ahead) == Ok(pad)));
            match state_of_pad {
                Pad::Dancing(_) => {}
                _ if dancing => *state_of_pad = Pad::Dancing(Some(beats)),
                Pad::Idle => *state_of_pad = Pad::Armed(start.map(|beats| beats + 1)),
                Pad::Armed(_) => {}
            }
        }
        if let Some(pad @ Pad::Idle) = state.label.and_then(|label| pads.get_mut(label)) {
            *pad = Pad::Dancing(None);
        }
        pads
    }

    /// Returns the position in the music at the time `now`, in beats. It is the position in the
    /// latest snapshot plus the beats since then, computed from the snapshot's tempo. At most 0.25
    /// beats are added.
    pub fn beat(&self, now: Duration) -> f64 {
        let Some((state, at)) = &self.state else {
            return 0.0;
        };
        let elapsed_beats = now.saturating_sub(*at).as_secs_f64() / 60.0 * state.bpm.unwrap_or(0.0);
        state.beat.unwrap_or(0.0) + elapsed_beats.min(0.25)
    }

    /// Returns the position of the current beat in its bar at the time `now`; 0 for the first beat.
    pub fn bar_position(&self, now: Duration) -> u32 {
        let Some((state, _)) = &self.state else {
            return 0;
        };
        let elapsed_beats = self.beat(now).floor() - state.beat.unwrap_or(0.0).floor();
        (state.bar + elapsed_beats as u32) % state.beats_per_bar.max(1)
    }

    /// Returns the message to the show for a press of the pad with the index `pad`; `None` if there
    /// is no such label. The message releases the pad if it is held (in the mode gate or repeat),
    /// cancels the pad's cue if it waits, and otherwise sends a new cue. In learn mode, the message
    /// assigns the label to the MIDI control that is moved next.
    pub fn press_pad(&mut self, pad: usize) -> Option<Value> {
        let label = self.hello.labels.get(pad)?.clone();
        if std::mem::take(&mut self.is_learning) {
            return Some(json!({ "learn": { "label": label } }));
        }
        if let Some(index) = self.held_pads.iter().position(|&held| held == pad) {
            self.held_pads.remove(index);
            return Some(json!({ "lift": label }));
        }
        if matches!(self.pads().get(pad), Some(Pad::Armed(_))) {
            return Some(json!({ "cancel": label }));
        }
        let mut message = json!({ "cue": label });
        let (mode, length, start) = (
            MODES[self.launch.mode].1,
            LENGTHS[self.launch.length],
            STARTS[self.launch.start].1,
        );
        if length != 8 {
            message["beats"] = length.into();
        }
        match mode {
            "trigger" => {}
            "avoid" => message["avoid"] = true.into(),
            _ => message["mode"] = mode.into(),
        }
        match start {
            "beat" => {}
            "queue" => message["queue"] = true.into(),
            _ => message["quantise"] = start.into(),
        }
        if ["gate", "repeat"].contains(&mode) {
            self.held_pads.push(pad);
        }
        Some(message)
    }

    /// Returns the message to the show for the tempo command `command`. In learn mode, the message
    /// assigns the command to the MIDI control that is moved next.
    pub fn tempo_command(&mut self, command: &str) -> Value {
        if std::mem::take(&mut self.is_learning) {
            json!({ "learn": { "label": format!("!{command}") } })
        } else {
            json!({ "tempo": command })
        }
    }

    /// Returns the message to the show that starts or ends the loop of the current motion. In learn
    /// mode, the message assigns this command to the MIDI control that is moved next.
    pub fn hold(&mut self) -> Value {
        if std::mem::take(&mut self.is_learning) {
            return json!({ "learn": { "label": "!hold" } });
        }
        json!({ "hold": !self.state.as_ref().is_some_and(|(state, _)| state.held) })
    }

    /// Returns the message to the show that drops all cues and blends to idle. In learn mode, the
    /// message assigns this command to the MIDI control that is moved next.
    pub fn panic(&mut self) -> Value {
        if std::mem::take(&mut self.is_learning) {
            return json!({ "learn": { "label": "!panic" } });
        }
        self.held_pads.clear();
        json!({ "panic": true })
    }

    /// Switches learn mode on or off, and shows a notice about it from the time `now` on. In learn
    /// mode, the next pressed key selects the label or command for a MIDI control. Returns the
    /// message that ends the learn session, or `None` if learn mode was switched on.
    pub fn toggle_learn(&mut self, now: Duration) -> Option<Value> {
        self.is_learning = !self.is_learning;
        self.set_notice(
            if self.is_learning {
                "learn: press the key of the pad or command for the MIDI control"
            } else {
                "learning is cancelled"
            },
            now,
        );
        (!self.is_learning).then(|| json!({ "learn": null }))
    }

    /// Returns the message to the show that selects the next tempo source in `Hello::sources`; the
    /// last source is followed by the first one. Returns `None` before the first snapshot or if
    /// there are no sources.
    pub fn next_source(&self) -> Option<Value> {
        let (state, _) = self.state.as_ref()?;
        let sources = &self.hello.sources;
        let current = sources
            .iter()
            .position(|source| *source == state.source)
            .unwrap_or(0);
        Some(
            json!({ "tempo": format!("source {}", sources.get((current + 1) % sources.len().max(1))?) }),
        )
    }

    /// Returns the messages to the show that release all held pads (pressed in the mode gate or
    /// repeat), and forgets these pads.
    pub fn release_pads(&mut self) -> Vec<Value> {
        let lift = |pad: usize| Some(json!({ "lift": self.hello.labels.get(pad)? }));
        self.held_pads.drain(..).filter_map(lift).collect()
    }
}
