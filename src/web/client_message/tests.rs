use super::*;
use corybant_core::cue::verbs::{Command, VERBS, Value};
use corybant_core::fault::Fault;
use corybant_core::tempo::command::TempoCommand;
use corybant_core::tempo::source::TempoSource;
use corybant_core::time::Seconds;

fn request(text: &str) -> Result<ClientRequest, ClientMessageError> {
    ClientMessages::new(&["salsa".into(), "Hip Hop".into()]).resolve(text)
}

fn read(text: &str) -> Result<Cue, ClientMessageError> {
    request(text).map(|request| match request {
        ClientRequest::Cue(cue) => cue,
        other => panic!("{other:?} is no cue"),
    })
}

#[test]
fn learn_messages_are_resolved() {
    let entry = MapEntry {
        label: "salsa".into(),
        mode: Mode::Gate,
        quantise: Quantise::Bar,
        ..MapEntry::default()
    };
    assert_eq!(
        request(r#"{"learn":{"label":"salsa","mode":"gate","quantise":"bar"}}"#),
        Ok(ClientRequest::Learn(Some(entry)))
    );
    let tap = MapEntry {
        label: "!tap".into(),
        ..MapEntry::default()
    };
    assert_eq!(
        request(r#"{"learn":{"label":"!tap"}}"#),
        Ok(ClientRequest::Learn(Some(tap)))
    );
    assert_eq!(request(r#"{"learn":null}"#), Ok(ClientRequest::Learn(None)));
    for (text, reason) in [
        (
            r#"{"learn":{"label":"tango"}}"#,
            "asks for the label \"tango\", which the graph does not have",
        ),
        (
            r#"{"learn":{"label":"!triple"}}"#,
            "unknown command `triple`",
        ),
        (
            r#"{"learn":{"label":"salsa","beats":0}}"#,
            "learn.beats is 0; it must be from 1 to 1024",
        ),
        (
            r#"{"learn":{"label":"salsa","speed":2}}"#,
            "not understood: unknown field `speed`",
        ),
        (
            r#"{"learn":null,"panic":true}"#,
            "not understood: invalid value: map, expected map with a single key",
        ),
    ] {
        let error = request(text).unwrap_err().to_string();
        assert!(error.contains(reason), "{text}: {error}");
    }
}

#[test]
fn settings_are_resolved() {
    assert_eq!(
        request(r#"{"input_latency":29.5}"#),
        Ok(ClientRequest::Setting(Setting::InputLatency(29.5)))
    );
    assert_eq!(
        request(r#"{"offset":{"output":1,"ms":-40}}"#),
        Ok(ClientRequest::Setting(Setting::Offset {
            output: 1,
            ms: -40
        }))
    );
    assert_eq!(
        request(r#"{"channels":[3,4]}"#),
        Ok(ClientRequest::Setting(Setting::Channels(vec![3, 4])))
    );
    assert_eq!(
        request(r##"{"colour":{"group":"pads","colour":"#12ab34"}}"##),
        Ok(ClientRequest::Setting(Setting::Colour {
            group: "pads".into(),
            colour: "#12ab34".into()
        }))
    );
    assert_eq!(
        request(r#"{"keep":true}"#),
        Ok(ClientRequest::Setting(Setting::Keep))
    );
    for (text, reason) in [
        (
            r##"{"colour":{"group":"nobody","colour":"#12ab34"}}"##,
            "there is no group of pads `nobody`; there are: pads",
        ),
        (
            r#"{"colour":{"group":"pads","colour":"red"}}"#,
            "`colour` is `red`; allowed is #rrggbb",
        ),
        (
            r#"{"input_latency":-1}"#,
            "`input_latency` is -1; allowed is 0 to 500",
        ),
        (r#"{"input_latency":501}"#, "`input_latency` is 501"),
        (
            r#"{"offset":{"output":0,"ms":501}}"#,
            "`offset.ms` is 501; allowed is -500 to 500",
        ),
        (
            r#"{"offset":{"output":-1,"ms":0}}"#,
            "not understood: invalid value: integer `-1`, expected usize",
        ),
        (
            r#"{"channels":[0]}"#,
            "`channels` is 0; allowed is 1 to 256",
        ),
        (
            r#"{"offset":40}"#,
            "not understood: invalid type: integer `40`, expected struct OutputOffset",
        ),
        (r#"{"keep":true,"panic":true}"#, "map with a single key"),
    ] {
        let error = request(text).unwrap_err().to_string();
        assert!(error.contains(reason), "{text}: {error}");
    }
}

#[test]
fn every_launch_is_resolved() {
    assert_eq!(
        read(r#"{"cue":"Hip Hop"}"#),
        Ok(Cue::Dance(DanceCommand::Launch(Launch::plain(1))))
    );
    let harder = Launch {
        intensity: Some(0.5),
        ..Launch::new(1, 16)
    };
    assert_eq!(
        read(r#"{"cue":"hip_hop","velocity":0.5,"beats":16}"#),
        Ok(Cue::Dance(DanceCommand::Launch(harder)))
    );
    let gate = Launch {
        mode: Mode::Gate,
        quantise: Quantise::Bars2,
        ..Launch::plain(0)
    };
    assert_eq!(
        read(r#"{"cue":"salsa","mode":"gate","quantise":"2bars"}"#),
        Ok(Cue::Dance(DanceCommand::Launch(gate)))
    );
    assert_eq!(
        read(r#"{"cue":"salsa","queue":true}"#),
        Ok(Cue::Dance(DanceCommand::Launch(Launch {
            queued: true,
            ..Launch::plain(0)
        })))
    );
    assert_eq!(
        read(r#"{"cue":"salsa","avoid":true}"#),
        Ok(Cue::Dance(DanceCommand::Launch(Launch {
            avoid: true,
            ..Launch::plain(0)
        })))
    );
}

#[test]
fn every_other_command_is_resolved() {
    assert_eq!(
        read(r#"{"lift":"salsa"}"#),
        Ok(Cue::Dance(DanceCommand::Lift { label: 0 }))
    );
    assert_eq!(
        read(r#"{"hold":false}"#),
        Ok(Cue::Dance(DanceCommand::Hold(false)))
    );
    assert_eq!(
        read(r#"{"release":true}"#),
        Ok(Cue::Dance(DanceCommand::Release))
    );
    assert_eq!(
        read(r#"{"cancel":"salsa"}"#),
        Ok(Cue::Dance(DanceCommand::Cancel { label: 0 }))
    );
    assert_eq!(
        read(r#"{"panic":true}"#),
        Ok(Cue::Dance(DanceCommand::Panic))
    );
    assert_eq!(
        read(r#"{"intensity":0.5}"#),
        Ok(Cue::Dance(DanceCommand::Intensity(Some(0.5))))
    );
    assert_eq!(
        read(r#"{"intensity":null}"#),
        Ok(Cue::Dance(DanceCommand::Intensity(None)))
    );
    assert_eq!(
        read(r#"{"tempo":"tap"}"#),
        Ok(Cue::Tempo(TempoCommand::Tap))
    );
    assert_eq!(
        read(r#"{"tempo":"nudge -10"}"#),
        Ok(Cue::Tempo(TempoCommand::Nudge(Seconds(-0.01))))
    );
}

#[test]
fn every_other_message_is_refused_with_a_reason() {
    for (text, reason) in [
        ("", "not understood: EOF"),
        ("[1,2", "not understood: "),
        (
            r#"{"dance":"salsa"}"#,
            "not understood: unknown variant `dance`",
        ),
        (
            r#"{"cue":7}"#,
            "not understood: invalid type: integer `7`, expected a string",
        ),
        (
            r#"{"cue":"salsa","beats":-1}"#,
            "not understood: invalid value: integer `-1`, expected u32",
        ),
        (
            r#"{"cue":"salsa","beats":0}"#,
            "`beats` is 0; allowed is 1 to 1024",
        ),
        (
            r#"{"cue":"salsa","velocity":1.5}"#,
            "`velocity` is 1.5; allowed is more than 0, at most 1",
        ),
        (r#"{"cue":"salsa","velocity":0}"#, "`velocity` is 0"),
        (
            r#"{"cue":"salsa","panic":true}"#,
            "not understood: unknown field `panic`",
        ),
        (
            r#"{"cue":"salsa","mode":"gated"}"#,
            "not understood: unknown variant `gated`",
        ),
        (
            r#"{"lift":"salsa","quantise":"bar"}"#,
            "map with a single key",
        ),
        (
            r#"{"intensity":1.5}"#,
            "`intensity` is 1.5; allowed is 0 to 1, or null",
        ),
        (
            r#"{"intensity":null,"panic":true}"#,
            "map with a single key",
        ),
        (
            r#"{"panic":false}"#,
            "not understood: the value is false; allowed is true",
        ),
        (r#"{"panic":true,"tempo":"tap"}"#, "map with a single key"),
        (
            r#"{"tempo":"triple"}"#,
            "`tempo`: unknown command `triple`; allowed are tap",
        ),
        (
            r#"{"tempo":"bpm 1e9"}"#,
            "`tempo`: `bpm` takes a number from 20 to 400",
        ),
        (r#"{"cancel":"salsa","beats":4}"#, "map with a single key"),
        (
            r#"{"cue":"tango"}"#,
            "there is no label `tango`; there are: salsa, Hip Hop",
        ),
    ] {
        let error = read(text).unwrap_err();
        assert!(error.to_string().contains(reason), "{text}: {error}");
    }
}

#[test]
fn refused_messages_are_counted_by_their_fault() {
    assert_eq!(
        read(r#"{"cue":"tango"}"#).unwrap_err().fault(),
        Fault::UnknownLabel
    );
    assert_eq!(read("x").unwrap_err().fault(), Fault::BadPage);
}

/// Each message in the core's table of verbs sends the command in the same row.
#[test]
fn every_message_of_the_verb_table_sends_its_command() {
    let messages = ClientMessages::of(CueNames {
        labels: &["LABEL".into()],
        scenes: &["SCENE".into()],
    });
    for verb in VERBS.iter().filter(|verb| !verb.message.is_empty()) {
        let value = match verb.command {
            Command::Nudge => Value::Number(-10.0),
            Command::Bpm => Value::Number(128.0),
            Command::Source => Value::Source(TempoSource::Link),
            Command::Freeze | Command::Engage | Command::SetHold => Value::Number(1.0),
            Command::Jump => Value::Number(2.0),
            Command::Intensity => Value::Number(0.7),
            Command::Performer => Value::Number(0.5),
            Command::Button(_)
            | Command::Offset
            | Command::Beat
            | Command::Timecode
            | Command::Sync => Value::Absent,
        };
        let cue = verb.command.cue(value).map(ClientRequest::Cue);
        assert_eq!(messages.resolve(verb.message).ok(), cue, "{}", verb.message);
    }
}

#[test]
fn messages_survive_a_round_trip() {
    for text in [
        r#"{"cue":"salsa","beats":16,"mode":"gate","quantise":"2bars","avoid":true}"#,
        r#"{"panic":true}"#,
        r#"{"intensity":null}"#,
        r#"{"learn":{"label":"!tap"}}"#,
        r#"{"offset":{"output":1,"ms":-40}}"#,
        r#"{"jump":2}"#,
        r#"{"jump":"The last song"}"#,
        r#"{"set_hold":null}"#,
    ] {
        let message = ClientMessage::parse(text).unwrap();
        assert_eq!(serde_json::to_string(&message).unwrap(), text);
    }
}
