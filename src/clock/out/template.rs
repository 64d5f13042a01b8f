//! The beat in the OSC messages of other programs, which the show file or a preset describes. In:
//! clock events. Out: datagrams, one for each message, because some programs read no bundles.
//! Thread: "clock". Allocates: for each message.

use rosc::{OscMessage, OscPacket, OscType, encoder};
use serde::{Deserialize, Serialize};

use super::metronome::ClockEvent;
use corybant_core::show::status::TempoState;
use corybant_core::time::Seconds;

/// Greatest number of messages of one clock output.
pub(super) const MESSAGES_MAX: usize = 32;
/// Greatest number of arguments of one message.
const ARGUMENTS_MAX: usize = 16;
/// Greatest length of an address or of a text, in bytes.
const TEXT_MAX: usize = 200;
/// Greatest number of events from one message to the next.
const EVERY_MAX: u32 = 64;
/// Number of steps of the sent tempo in one beat per minute. A smaller change of the tempo is not sent.
const TENTHS: f64 = 10.0;
/// Characters that an OSC address must not contain.
const NOT_IN_ADDRESS: &str = " #*,?[]{}";

/// The event on which a message is sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum When {
    /// Each beat.
    #[default]
    Beat,
    /// The first beat of each bar.
    Bar,
    /// A beat on which the tempo has changed by a tenth of a beat per minute, and the first beat of
    /// each bar.
    Tempo,
    /// The music starts, at the first beat of a bar.
    Start,
    /// The music stops.
    Stop,
}

/// One argument of a message, as written in a show file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Argument {
    /// An integer, which is sent as it is.
    Int(i32),
    /// A number, which is sent as a float.
    Number(f32),
    /// `bpm`, `bpm:MIN:MAX`, `beat`, or `=` and a text.
    Text(String),
}

/// One `[[clock_out.message]]` of a show file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MessageTemplate {
    /// OSC address.
    pub address: String,
    /// The event on which the message is sent.
    #[serde(default)]
    pub when: When,
    /// The message is sent on the first of this many events, 1 to 64.
    #[serde(default = "one")]
    pub every: u32,
    /// The arguments.
    #[serde(default)]
    pub args: Vec<Argument>,
}

fn one() -> u32 {
    1
}

impl MessageTemplate {
    /// Returns a message to `address` on each event `when`.
    pub(super) fn new(address: &str, when: When, args: Vec<Argument>) -> Self {
        Self {
            address: address.into(),
            when,
            every: 1,
            args,
        }
    }

    /// Adds a sentence to `problems` for each invalid value of this message. `key` is the path of
    /// the message in the show file.
    pub(super) fn check(&self, key: &str, problems: &mut Vec<String>) {
        let address = &self.address;
        let is_allowed = |c: char| c.is_ascii_graphic() && !NOT_IN_ADDRESS.contains(c);
        if !address.starts_with('/') || !address.chars().all(is_allowed) || address.len() > TEXT_MAX
        {
            problems.push(format!(
                "{key}.address is {address:?}; it must begin with / and have at most {TEXT_MAX} letters, digits and signs, without spaces and {NOT_IN_ADDRESS:?}."
            ));
        }
        if !(1..=EVERY_MAX).contains(&self.every) {
            problems.push(format!(
                "{key}.every is {}; it must be from 1 to {EVERY_MAX}.",
                self.every
            ));
        }
        if self.args.len() > ARGUMENTS_MAX {
            problems.push(format!(
                "{key}.args has {} arguments; at most {ARGUMENTS_MAX} are allowed.",
                self.args.len()
            ));
        }
        for argument in &self.args {
            if let Argument::Text(text) = argument
                && Value::parse(text).is_none()
            {
                problems.push(format!(
                    "{key}.args has {text:?}; allowed are \"bpm\", \"bpm:MIN:MAX\" (0 at MIN to 1 at MAX), \"beat\", \"=TEXT\" of at most {TEXT_MAX} bytes, and numbers."
                ));
            }
        }
    }
}

/// One argument of a message, ready to be sent.
#[derive(Clone, Debug, PartialEq)]
enum Value {
    Fixed(OscType),
    Bpm,
    /// The tempo as a share of this range, 0 to 1.
    BpmShare {
        min: f64,
        max: f64,
    },
    /// Place in the bar, from 1.
    Beat,
    /// A text in which `{bpm}` and `{beat}` stand for their values.
    Text(String),
}

impl Value {
    fn of(argument: &Argument) -> Option<Self> {
        match argument {
            Argument::Int(value) => Some(Self::Fixed(OscType::Int(*value))),
            Argument::Number(value) => Some(Self::Fixed(OscType::Float(*value))),
            Argument::Text(text) => Self::parse(text),
        }
    }

    fn parse(text: &str) -> Option<Self> {
        if let Some(text) = text.strip_prefix('=') {
            return (text.len() <= TEXT_MAX).then(|| Self::Text(text.into()));
        }
        match text {
            "bpm" => return Some(Self::Bpm),
            "beat" => return Some(Self::Beat),
            _ => {}
        }
        let (min, max) = text.strip_prefix("bpm:")?.split_once(':')?;
        let (min, max): (f64, f64) = (min.parse().ok()?, max.parse().ok()?);
        (min.is_finite() && max.is_finite() && min < max).then_some(Self::BpmShare { min, max })
    }

    fn argument(&self, beat: &Beat) -> OscType {
        match self {
            Self::Fixed(value) => value.clone(),
            Self::Bpm => OscType::Float(beat.bpm as f32),
            Self::BpmShare { min, max } => {
                OscType::Float(((beat.bpm - min) / (max - min)).clamp(0.0, 1.0) as f32)
            }
            Self::Beat => OscType::Int(beat.place),
            Self::Text(text) => OscType::String(
                text.replace("{bpm}", &format!("{:.1}", beat.bpm))
                    .replace("{beat}", &beat.place.to_string()),
            ),
        }
    }
}

/// The beat on which messages are sent.
struct Beat {
    bpm: f64,
    /// Place in the bar, from 1.
    place: i32,
}

/// One message, with the number of its events so far.
struct Prepared {
    address: String,
    when: When,
    every: u32,
    args: Vec<Value>,
    events: u32,
}

/// The messages of one clock output.
pub(super) struct TemplateMessages {
    messages: Vec<Prepared>,
    /// Tempo of the last message about the tempo, in tenths of a beat per minute.
    sent_tenths: Option<i64>,
}

impl TemplateMessages {
    /// Prepares `messages`; leaves out arguments that are not allowed.
    pub(super) fn new(messages: &[MessageTemplate]) -> Self {
        let prepare = |message: &MessageTemplate| Prepared {
            address: message.address.clone(),
            when: message.when,
            every: message.every.max(1),
            args: message.args.iter().filter_map(Value::of).collect(),
            events: 0,
        };
        Self {
            messages: messages.iter().map(prepare).collect(),
            sent_tenths: None,
        }
    }

    /// Calls `send` with the datagram of each message that belongs to the clock event `event` at the
    /// show time `time`, with the tempo in `tempo_state`.
    pub(super) fn encode(
        &mut self,
        event: ClockEvent,
        tempo_state: &TempoState,
        time: Seconds,
        send: &mut dyn FnMut(&[u8]),
    ) {
        let timeline = &tempo_state.timeline;
        let bpm = timeline.bpm_at(time).0;
        let (place, is_beat) = match event {
            ClockEvent::Pulse(0, beat) => (timeline.bar_position(beat) as i32 + 1, true),
            ClockEvent::Pulse(..) => return,
            ClockEvent::Start | ClockEvent::Stop => (1, false),
        };
        let tenths = (bpm * TENTHS).round() as i64;
        let is_bar = is_beat && place == 1;
        let is_tempo = is_beat && (is_bar || self.sent_tenths != Some(tenths));
        if is_tempo {
            self.sent_tenths = Some(tenths);
        }
        for message in &mut self.messages {
            if event == ClockEvent::Start {
                message.events = 0;
            }
            let is_due = match message.when {
                When::Beat => is_beat,
                When::Bar => is_bar,
                When::Tempo => is_tempo,
                When::Start => event == ClockEvent::Start,
                When::Stop => event == ClockEvent::Stop,
            };
            if is_due {
                message.send(&Beat { bpm, place }, send);
            }
        }
    }
}

impl Prepared {
    /// Counts an event, and sends the message if it is the first of `every` events.
    fn send(&mut self, beat: &Beat, send: &mut dyn FnMut(&[u8])) {
        let number = self.events;
        self.events = (number + 1) % self.every;
        if number != 0 {
            return;
        }
        let packet = OscPacket::Message(OscMessage {
            addr: self.address.clone(),
            args: self.args.iter().map(|value| value.argument(beat)).collect(),
        });
        // Only a packet that is too long for its buffer cannot be encoded; a vector grows.
        if let Ok(datagram) = encoder::encode(&packet) {
            send(&datagram);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::preset::Preset;
    use super::*;
    use corybant_core::time::Timeline;

    /// Returns the messages that are sent for each beat from `first` on, at 120 beats per minute, with
    /// their arguments. The music starts before the first beat.
    fn sent(
        messages: &[MessageTemplate],
        beats: std::ops::Range<i64>,
    ) -> Vec<(String, Vec<OscType>)> {
        let tempo_state = TempoState {
            timeline: Timeline::steady(0, Seconds(0.0), Seconds(0.5)),
            music: true,
            ..TempoState::default()
        };
        let (mut messages, mut sent) = (TemplateMessages::new(messages), Vec::new());
        let mut encode = |event, time| {
            messages.encode(event, &tempo_state, Seconds(time), &mut |datagram| {
                let (rest, packet) = rosc::decoder::decode_udp(datagram).unwrap();
                let OscPacket::Message(message) = packet else {
                    panic!("a bundle")
                };
                assert!(rest.is_empty());
                sent.push((message.addr, message.args));
            });
        };
        encode(ClockEvent::Start, beats.start as f64 / 2.0);
        for beat in beats.clone() {
            for pulse in 0..24 {
                encode(ClockEvent::Pulse(pulse, beat), beat as f64 / 2.0);
            }
        }
        encode(ClockEvent::Stop, beats.end as f64 / 2.0);
        sent
    }

    fn read(text: &str) -> Vec<MessageTemplate> {
        #[derive(Deserialize)]
        struct Output {
            message: Vec<MessageTemplate>,
        }
        toml::from_str::<Output>(text).unwrap().message
    }

    #[test]
    fn resolume_gets_the_tempo_as_a_share_of_20_to_500() {
        let sent = sent(&Preset::Resolume.messages(), 0..8);
        let tempo = (
            "/composition/tempocontroller/tempo".to_owned(),
            vec![OscType::Float(100.0 / 480.0)],
        );
        let resync = (
            "/composition/tempocontroller/resync".to_owned(),
            vec![OscType::Int(1)],
        );
        assert_eq!(sent, [resync, tempo.clone(), tempo], "once a bar");
    }

    #[test]
    fn grandma3_gets_a_command_without_a_bundle() {
        let sent = sent(&Preset::Grandma3.messages(), 0..4);
        let command = OscType::String("Master 3.1 At BPM 120.0".into());
        assert_eq!(sent, [("/cmd".to_owned(), vec![command])]);
    }

    #[test]
    fn madmapper_gets_the_tempo_and_the_beats() {
        let sent = sent(&Preset::Madmapper.messages(), 0..2);
        let tempo = ("/bpm".to_owned(), vec![OscType::Float(120.0)]);
        let beat = |place| ("/beat".to_owned(), vec![OscType::Int(place)]);
        assert_eq!(sent, [tempo, beat(1), beat(2)]);
    }

    #[test]
    fn messages_of_the_show_file_are_sent_on_their_events() {
        let messages = read(
            "[[message]]\naddress = '/tick'\n[[message]]\naddress = '/phrase'\nwhen = 'bar'\nevery = 2\nargs = ['beat', 7, 0.5, '=at {bpm} {beat}']\n\
             [[message]]\naddress = '/on'\nwhen = 'start'\n[[message]]\naddress = '/off'\nwhen = 'stop'\n",
        );
        let names: Vec<String> = sent(&messages, 0..12)
            .into_iter()
            .map(|(name, _)| name)
            .collect();
        let count = |name: &str| names.iter().filter(|other| *other == name).count();
        assert_eq!(
            (names[0].as_str(), names[names.len() - 1].as_str()),
            ("/on", "/off")
        );
        assert_eq!((count("/tick"), count("/phrase")), (12, 2), "bars 1 and 3");
        let phrase = sent(&messages, 0..1).remove(2).1;
        let text = OscType::String("at 120.0 1".into());
        assert_eq!(
            phrase,
            [OscType::Int(1), OscType::Int(7), OscType::Float(0.5), text]
        );
    }

    #[test]
    fn a_changed_tempo_is_sent_on_the_next_beat() {
        let mut messages = TemplateMessages::new(&Preset::Grandma3.messages());
        let mut count = |beat: i64, period_s: f64| {
            let tempo_state = TempoState {
                timeline: Timeline::steady(0, Seconds(0.0), Seconds(period_s)),
                ..TempoState::default()
            };
            let (event, time) = (ClockEvent::Pulse(0, beat), Seconds(0.0));
            let mut count = 0;
            messages.encode(event, &tempo_state, time, &mut |_| count += 1);
            count
        };
        assert_eq!([count(1, 0.5), count(2, 0.5), count(3, 0.50001)], [1, 0, 0]);
        assert_eq!([count(5, 0.48), count(6, 0.48), count(8, 0.48)], [1, 0, 1]);
    }

    #[test]
    fn every_invalid_value_of_a_message_is_reported() {
        for (text, expected) in [
            ("address = 'bpm'", "address is \"bpm\""),
            ("address = '/a b'", "address is \"/a b\""),
            ("address = '/a'\nevery = 0", "every is 0"),
            ("address = '/a'\nargs = ['tempo']", "args has \"tempo\""),
            ("address = '/a'\nargs = ['bpm:5:5']", "args has \"bpm:5:5\""),
            (
                "address = '/a'\nargs = ['bpm:nan:5']",
                "args has \"bpm:nan:5\"",
            ),
        ] {
            let message = read(&format!("[[message]]\n{text}")).remove(0);
            let mut problems = Vec::new();
            message.check("clock_out 1.message 1", &mut problems);
            assert!(
                problems.len() == 1 && problems[0].contains(expected),
                "{text}: {problems:?}"
            );
        }
        for preset in [Preset::Resolume, Preset::Grandma3, Preset::Madmapper] {
            let mut problems = Vec::new();
            for message in preset.messages() {
                message.check("preset", &mut problems);
            }
            assert!(problems.is_empty(), "{problems:?}");
        }
    }
}
