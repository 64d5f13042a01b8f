//! Converts MIDI messages to cues by the map of a device. In: messages of one device. Out: the cues
//! that they send. Thread: any. Real-time: yes, after `new`.

use std::sync::Arc;

use super::entry::{Control, MapEntry, MapError};
use super::message::Message;
use crate::cue::control_text::ControlAction;
use crate::cue::take::TakeRequest;
use crate::cue::verbs::Value;
use crate::cue::{Cue, CueNames, DanceCommand, Launch};

/// The least value of a MIDI control change at which its button is pressed. At a smaller value, the
/// button is released.
pub const PRESSED_MIN: u8 = 64;
/// The largest value in MIDI messages. A velocity or a control value is divided by this number,
/// which scales it to the range 0 to 1.
const VALUE_MAX: f32 = 127.0;

/// The new value of one MIDI control (pad, key, knob or fader), as one MIDI message reports it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ControlChange {
    /// The control (pad, knob or fader) whose value changes.
    pub control: Control,
    /// The MIDI channel of the control, 1 to 16.
    pub channel: u8,
    /// The new value, 0 to 127. For a note, it is the velocity, or 0 at the release; for a program
    /// change, it is always 127.
    pub value: u8,
}

impl ControlChange {
    /// Returns the control whose value `message` changes, with its new value; `None` if the message
    /// belongs to no control.
    pub fn of(message: Message) -> Option<Self> {
        let (control, channel, value) = match message {
            Message::NoteOn {
                channel,
                note,
                velocity,
            } => (Control::Note(note), channel, velocity),
            Message::NoteOff { channel, note } => (Control::Note(note), channel, 0),
            Message::ControlChange {
                channel,
                number,
                value,
            } => (Control::Cc(number), channel, value),
            Message::ProgramChange { channel, program } => {
                (Control::Program(program), channel, 127)
            }
            Message::Other => return None,
        };
        Some(Self {
            control,
            channel,
            value,
        })
    }
}

/// What a control sends.
#[derive(Clone, Debug, PartialEq)]
pub enum MidiRequest {
    /// A cue for the show.
    Cue(Cue),
    /// A request for the recorder of takes.
    Take(Arc<TakeRequest>),
}

/// One entry of a MIDI map: a control and its action.
#[derive(Clone, Debug)]
struct Mapping {
    /// The control (pad, knob or fader) to which this entry applies.
    control: Control,
    /// The MIDI channel of the control, 1 to 16; `None` for every channel.
    channel: Option<u8>,
    /// The action of the control: it sends a cue, or sets the intensity.
    action: ControlAction,
    /// The state of a button that sends control changes, for each MIDI channel: bit `channel - 1`
    /// is set while the button is pressed on that channel.
    pressed: u16,
}

/// The MIDI map of a device: its controls with their actions.
///
/// ```
/// use corybant_core::cue::midi::{
///     Control, ControlChange, MapEntry, MidiMap, MidiRequest, message,
/// };
/// use corybant_core::cue::{Cue, Launch};
///
/// let entry = MapEntry {
///     label: "salsa".into(),
///     ..MapEntry::default()
/// };
/// let labels = ["salsa".to_owned()];
/// let mut map = MidiMap::new(&[entry.of(Control::Note(36), None)], &labels).unwrap();
/// let change = ControlChange::of(message::parse(&[0x90, 36, 100]).unwrap()).unwrap();
/// let launch = MidiRequest::Cue(Cue::from(Launch::plain(0)));
/// map.apply(change, &mut |request| assert_eq!(request, launch));
/// ```
#[derive(Clone, Debug, Default)]
pub struct MidiMap {
    /// The entries, in the order of the show file.
    mappings: Vec<Mapping>,
}

impl MidiMap {
    /// Creates the MIDI map of a device from its `entries`; `names` are the labels of the motion
    /// graph and the scenes of the show. Skips an entry that has no valid control.
    ///
    /// # Errors
    /// The errors of [`MapEntry::action`].
    pub fn new<'a>(entries: &[MapEntry], names: impl Into<CueNames<'a>>) -> Result<Self, MapError> {
        let names = names.into();
        let mapping = |(entry, control): (&MapEntry, Control)| {
            Ok(Mapping {
                control,
                channel: entry.channel,
                action: entry.action(names)?,
                pressed: 0,
            })
        };
        let mappings = entries
            .iter()
            .filter_map(|entry| Some((entry, entry.control()?)))
            .map(mapping);
        Ok(Self {
            mappings: mappings.collect::<Result<_, _>>()?,
        })
    }

    /// Applies the new value of a control: calls `each` with everything that this change sends.
    pub fn apply(&mut self, change: ControlChange, each: &mut dyn FnMut(MidiRequest)) {
        for mapping in &mut self.mappings {
            if mapping.control == change.control
                && mapping.channel.is_none_or(|only| only == change.channel)
            {
                mapping.request(change).into_iter().for_each(&mut *each);
            }
        }
    }
}

impl Mapping {
    /// Returns what is sent when the control of this entry changes to a new value; `None` if
    /// nothing is sent.
    fn request(&mut self, change: ControlChange) -> Option<MidiRequest> {
        let ControlChange {
            control,
            channel,
            value,
        } = change;
        let cue = match &self.action {
            // The release of a note must not set the value to 0.
            ControlAction::Fader(_) if value == 0 && matches!(control, Control::Note(_)) => None,
            ControlAction::Fader(command) => {
                command.cue(Value::Number(f64::from(value) / f64::from(VALUE_MAX)))
            }
            &ControlAction::Button(cue) => {
                let velocity = self.pressed(channel, value)?;
                button(cue, velocity)
            }
            ControlAction::Take(request) => {
                let request = request.clone();
                let is_pressed = self.pressed(channel, value)? > 0;
                return is_pressed.then_some(MidiRequest::Take(request));
            }
        };
        cue.map(MidiRequest::Cue)
    }

    /// Returns the velocity (1 to 127) if `value` presses the button, or 0 if `value` releases it.
    /// Returns `None` for a control change with which the button stays pressed or stays released.
    fn pressed(&mut self, channel: u8, value: u8) -> Option<u8> {
        let Control::Cc(_) = self.control else {
            return Some(value);
        };
        let bit = 1 << (channel - 1);
        let (was_pressed, is_pressed) = (self.pressed & bit != 0, value >= PRESSED_MIN);
        self.pressed = if is_pressed {
            self.pressed | bit
        } else {
            self.pressed & !bit
        };
        (was_pressed != is_pressed).then_some(if is_pressed { value } else { 0 })
    }
}

/// Returns the cue to send when a button is pressed or released; `None` if no cue is to be sent.
/// `cue` is the cue of the button, and `velocity` is 1 to 127 for a press and 0 for a release.
pub(in crate::cue) fn button(cue: Cue, velocity: u8) -> Option<Cue> {
    match cue {
        Cue::Dance(command) if velocity == 0 => command.on_release().map(Cue::Dance),
        Cue::Dance(DanceCommand::Launch(launch)) => {
            let intensity = launch.intensity.map(|_| f32::from(velocity) / VALUE_MAX);
            Some(Cue::from(Launch {
                intensity,
                ..launch
            }))
        }
        Cue::Dance(_)
        | Cue::Tempo(_)
        | Cue::TempoMessage(_)
        | Cue::Output(_)
        | Cue::Scene(_)
        | Cue::Set(_) => (velocity > 0).then_some(cue),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cue::launch::{Mode, Quantise};
    use crate::cue::midi::message;
    use crate::tempo::command::TempoCommand;
    use crate::time::{Bpm, Seconds};

    fn entry(note: u8, channel: Option<u8>, label: &str) -> MapEntry {
        MapEntry {
            label: label.into(),
            ..MapEntry::default()
        }
        .of(Control::Note(note), channel)
    }

    fn of(control: Control, label: &str) -> MapEntry {
        entry(0, None, label).of(control, None)
    }

    /// A simulated MIDI device with its MIDI map, and the cues that its messages have sent.
    struct Device {
        map: MidiMap,
        sent: Vec<Cue>,
        takes: Vec<TakeRequest>,
    }

    impl Device {
        fn new(entries: &[MapEntry]) -> Self {
            let labels = ["Salsa", "Hip Hop", "hip/hop"].map(String::from);
            Self {
                map: MidiMap::new(entries, &labels).unwrap(),
                sent: Vec::new(),
                takes: Vec::new(),
            }
        }

        fn send(&mut self, bytes: &[u8]) {
            if let Some(change) = ControlChange::of(message::parse(bytes).unwrap()) {
                self.map.apply(change, &mut |request| match request {
                    MidiRequest::Cue(cue) => self.sent.push(cue),
                    MidiRequest::Take(request) => self.takes.push((*request).clone()),
                });
            }
        }

        /// Returns the cues that were sent since the last call of this function.
        fn sent(&mut self) -> Vec<Cue> {
            std::mem::take(&mut self.sent)
        }
    }

    #[test]
    fn a_released_note_ends_a_gate_and_a_hold() {
        let mut device = Device::new(&[
            MapEntry {
                mode: Mode::Gate,
                velocity_as_intensity: true,
                ..entry(36, None, "Salsa")
            },
            MapEntry {
                mode: Mode::Toggle,
                quantise: Quantise::Bar,
                ..entry(37, None, "hip_hop")
            },
            entry(38, None, "!hold"),
            entry(39, None, "!release"),
        ]);
        for bytes in [
            [0x90, 36, 127],
            [0x80, 36, 0],
            [0x90, 37, 9],
            [0x90, 37, 0],
            [0x90, 38, 9],
            [0x90, 38, 0],
            [0x90, 39, 9],
            [0x90, 39, 0],
        ] {
            device.send(&bytes);
        }
        let expected = [
            Cue::Dance(DanceCommand::Launch(Launch {
                mode: Mode::Gate,
                intensity: Some(1.0),
                ..Launch::plain(0)
            })),
            Cue::Dance(DanceCommand::Lift { label: 0 }),
            Cue::Dance(DanceCommand::Launch(Launch {
                mode: Mode::Toggle,
                quantise: Quantise::Bar,
                ..Launch::plain(1)
            })),
            Cue::Dance(DanceCommand::Hold(true)),
            Cue::Dance(DanceCommand::Hold(false)),
            Cue::Dance(DanceCommand::Release),
        ];
        assert_eq!(device.sent(), expected);
    }

    #[test]
    fn a_note_sends_its_cue_once_and_its_release_sends_none() {
        let mut device = Device::new(&[
            entry(36, None, "Salsa"),
            MapEntry {
                beats: Some(16),
                ..entry(37, Some(10), "hip_hop")
            },
            entry(38, None, "!panic"),
            entry(40, None, "hip_hop_2"),
        ]);
        device.send(&[0x90, 36, 127]);
        device.send(&[0x90, 36, 0]);
        device.send(&[0x80, 36, 64]);
        device.send(&[0x90, 37, 100]);
        device.send(&[0x99, 37, 100]);
        device.send(&[0x9f, 38, 1]);
        device.send(&[0x90, 39, 1]);
        device.send(&[0xb0, 36, 127]);
        device.send(&[0x90, 40, 127]);
        let expected = [
            Cue::Dance(DanceCommand::Launch(Launch::plain(0))),
            Cue::Dance(DanceCommand::Launch(Launch::new(1, 16))),
            Cue::Dance(DanceCommand::Panic),
            Cue::Dance(DanceCommand::Launch(Launch::plain(2))),
        ];
        assert_eq!(device.sent(), expected);
    }

    #[test]
    fn a_control_change_is_a_button_that_rises_and_falls() {
        let mut device = Device::new(&[
            MapEntry {
                mode: Mode::Gate,
                ..of(Control::Cc(20), "Salsa")
            },
            of(Control::Cc(21), "!panic"),
        ]);
        let gate = Cue::Dance(DanceCommand::Launch(Launch {
            mode: Mode::Gate,
            ..Launch::plain(0)
        }));
        for value in [0, 10, 63, 64, 90, 127, 70, 64] {
            device.send(&[0xb0, 20, value]);
        }
        assert_eq!(device.sent(), [gate]);
        // The same control number on another channel is another button.
        device.send(&[0xb1, 20, 127]);
        assert_eq!(device.sent(), [gate]);
        for value in [63, 0, 127, 0] {
            device.send(&[0xb0, 20, value]);
        }
        let lift = Cue::Dance(DanceCommand::Lift { label: 0 });
        assert_eq!(device.sent(), [lift, gate, lift]);
        for value in [127, 0, 64, 63] {
            device.send(&[0xb0, 21, value]);
        }
        assert_eq!(device.sent(), [Cue::Dance(DanceCommand::Panic); 2]);
        // A note with the same number is another control.
        device.send(&[0x90, 21, 127]);
        assert_eq!(device.sent(), []);
    }

    #[test]
    fn a_program_change_is_a_button_without_a_release() {
        let mut device = Device::new(&[
            of(Control::Program(5), "Salsa"),
            entry(0, None, "!hold").of(Control::Program(6), Some(2)),
        ]);
        device.send(&[0xc0, 5]);
        device.send(&[0xc3, 5]);
        device.send(&[0xc0, 6]);
        device.send(&[0xc1, 6]);
        assert_eq!(
            device.sent(),
            [
                Cue::Dance(DanceCommand::Launch(Launch::plain(0))),
                Cue::Dance(DanceCommand::Launch(Launch::plain(0))),
                Cue::Dance(DanceCommand::Hold(true))
            ]
        );
    }

    #[test]
    fn a_press_sends_the_request_for_a_take_and_a_release_sends_none() {
        let record = |control| MapEntry {
            record: true,
            ..of(control, "mine")
        };
        let mut device = Device::new(&[
            record(Control::Note(36)),
            record(Control::Cc(20)),
            of(Control::Program(1), "!record_undo"),
        ]);
        device.send(&[0x90, 36, 100]);
        device.send(&[0x80, 36, 0]);
        for value in [10, 100, 110, 0] {
            device.send(&[0xb0, 20, value]);
        }
        device.send(&[0xc0, 1]);
        let toggle = TakeRequest::toggle("mine", None).unwrap();
        assert_eq!(device.takes, [toggle.clone(), toggle, TakeRequest::Undo]);
        assert_eq!(device.sent(), []);
    }

    #[test]
    fn a_knob_sets_the_intensity() {
        let mut device = Device::new(&[
            of(Control::Cc(7), "!intensity"),
            entry(36, None, "!intensity"),
            entry(37, None, "!intensity 0.25"),
            entry(38, None, "!intensity release"),
        ]);
        for bytes in [
            [0xb0, 7, 0],
            [0xb0, 7, 127],
            [0x90, 36, 127],
            [0x80, 36, 0],
            [0x90, 37, 9],
            [0x90, 38, 9],
            [0x90, 38, 0],
        ] {
            device.send(&bytes);
        }
        assert_eq!(
            device.sent(),
            [Some(0.0), Some(1.0), Some(1.0), Some(0.25), None]
                .map(|x| Cue::Dance(DanceCommand::Intensity(x)))
        );
    }

    #[test]
    fn a_note_can_send_a_tempo_command() {
        let words = [
            "!tap",
            "!half",
            "!double",
            "!downbeat",
            "!nudge -10",
            "!bpm 128",
        ];
        let map: Vec<MapEntry> = words
            .iter()
            .zip(40..)
            .map(|(word, note)| entry(note, None, word))
            .collect();
        let mut device = Device::new(&map);
        for note in 40..46 {
            device.send(&[0x90, note, 1]);
            device.send(&[0x80, note, 0]);
        }
        let hands = [
            TempoCommand::Tap,
            TempoCommand::Half,
            TempoCommand::Double,
            TempoCommand::Downbeat,
            TempoCommand::Nudge(Seconds(-0.01)),
            TempoCommand::Tempo(Bpm(128.0)),
        ];
        assert_eq!(device.sent(), hands.map(Cue::Tempo));
    }
}
