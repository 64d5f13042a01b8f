//! Tests of MIDI over a real JACK server, with pads as another client: notes arrive as cues, LEDs
//! follow the show, a controller that was disconnected is connected again, and a control is learnt.
//!
//! Each test starts its own server, with a dummy sound card and a private name, and ends it.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::common::jack as common;
use serial_test::serial;

use std::sync::Arc;
use std::time::Instant;

use common::{JackServer, Pads, in_child, wait_for};
use corybant::midi::learn::{LearnReport, LearnState};
use corybant::midi::{
    self, Backend, DeviceManager, LedProtocol, LedPublisher, MidiContext, Settings,
};
use corybant::rt::cue_queue::CueQueue;
use corybant::rt::warnings::Warnings;
use corybant_core::beat::tracker::BeatSource;
use corybant_core::cue::midi::{Control, MapEntry};
use corybant_core::cue::{Cue, DanceCommand, Launch};
use corybant_core::fault::{Fault, Faults};
use corybant_core::show::{self, Show};
use corybant_core::time::Seconds;
use corybant_files::show_file::ShowFile;

/// The note of the first label, on MIDI channel 10. The next labels have the next notes.
const FIRST_NOTE: u8 = 36;

/// A show with its MIDI controllers, its LEDs and its cue queue.
struct Stage {
    devices: DeviceManager,
    leds: LedPublisher,
    show: Show,
    queue: CueQueue,
    faults: Arc<Faults>,
    warnings: Warnings,
    now: f64,
}

impl Stage {
    fn new(settings: &[Settings], file: Option<Arc<ShowFile>>) -> Self {
        let graph = Arc::new(corybant_repertoire::graph().unwrap());
        let faults = Arc::new(Faults::default());
        let (queue, warnings) = (CueQueue::new(64, faults.clone()), Warnings::default());
        let labels = graph.labels.clone();
        let beats = (0..400).map(|n| 0.5 * f64::from(n)).collect();
        let show = Show::new(
            graph,
            &show::Settings::default(),
            BeatSource::Annotated(beats),
            faults.clone(),
        )
        .unwrap();
        let context = MidiContext {
            scenes: Vec::new(),
            labels,
            cues: queue.clone(),
            faults: faults.clone(),
            warnings: warnings.clone(),
            show_file: file,
            takes: None,
            raise_priority: || {},
        };
        let (devices, leds) = DeviceManager::start(settings, context).unwrap();
        Self {
            devices,
            leds,
            show,
            queue,
            faults,
            warnings,
            now: 0.0,
        }
    }

    /// Ticks the show with all cues that wait in the queue. Returns true if there was a cue.
    fn tick(&mut self) -> bool {
        let cues_with_times: Vec<_> = std::iter::from_fn(|| self.queue.pop_timed()).collect();
        let cues: Vec<Cue> = cues_with_times.iter().map(|timed| timed.cue).collect();
        self.show.tick(Seconds(self.now), &[], &cues);
        self.now += 1.0 / 120.0;
        self.leds.publish(&self.show, &cues_with_times);
        !cues_with_times.is_empty()
    }

    /// Ticks the show until `ready` returns true. `what` describes the event in a failure.
    fn until(&mut self, what: &str, mut ready: impl FnMut(&Self) -> bool) {
        wait_for(what, || {
            self.tick();
            ready(self)
        });
    }

    fn labels(&self) -> Vec<String> {
        self.show.graph(0).labels.clone()
    }
}

fn on_jack(port: &str, leds: LedProtocol, map: Vec<MapEntry>) -> Settings {
    Settings {
        backend: Backend::Jack,
        port: port.into(),
        leds,
        map,
        ..Settings::default()
    }
}

fn pad(note: u8, label: &str) -> MapEntry {
    MapEntry {
        label: label.into(),
        ..MapEntry::default()
    }
    .of(Control::Note(note), Some(10))
}

/// Waits for the next cue in `queue` and returns it.
fn next_cue(queue: &CueQueue) -> Cue {
    let mut cue = None;
    wait_for("a cue", || {
        cue = queue.pop();
        cue.is_some()
    });
    cue.unwrap()
}

/// Kills the JACK server `server` and waits until it is gone. A killed server occupies one of
/// JACK's eight server slots until another server of the same name ends normally.
fn crash(server: JackServer) {
    server.kill();
    wait_for("the server's end", || midi::ports(Backend::Jack).is_err());
}

#[test]
#[serial]
fn notes_over_jack_become_cues() {
    in_child("notes_over_jack_become_cues", &[], || {
        let server = JackServer::start(48_000, 256);
        let pads = Pads::default();
        assert!(
            midi::ports(Backend::Jack)
                .unwrap()
                .iter()
                .any(|port| port.name == "pads:out")
        );
        let salsa = MapEntry {
            velocity_as_intensity: true,
            ..pad(36, "salsa")
        };
        let map = vec![
            salsa.clone(),
            salsa.clone().of(Control::Cc(20), None),
            salsa.clone().of(Control::Program(3), None),
        ];
        let knob = MapEntry {
            label: "!intensity".into(),
            ..MapEntry::default()
        }
        .of(Control::Cc(7), None);
        let settings = [
            on_jack("PADS:", LedProtocol::None, [map, vec![knob]].concat()),
            on_jack("", LedProtocol::None, vec![]),
        ];
        let stage = Stage::new(&settings, None);
        assert_eq!(
            stage.devices.connected_ports(),
            ["corybant:midi_in from pads:out", "corybant-01:midi_in"]
        );
        // The server connects the ports between two cycles; it drops notes from before.
        wait_for("the connection", || pads.connected());
        let played = Instant::now();
        for bytes in [
            [0x99, 36, 127],
            [0x99, 36, 0],
            [0x90, 36, 127],
            [0x99, 35, 127],
            [0x99, 36, 64],
        ] {
            pads.play(bytes);
        }
        let label = corybant_core::cue::find_label(&stage.labels(), "salsa").unwrap_or(0);
        let cue = |velocity: f32| {
            Cue::Dance(DanceCommand::Launch(Launch {
                intensity: Some(velocity),
                ..Launch::plain(label)
            }))
        };
        let first = next_cue(&stage.queue);
        println!("a cue came after {:?}", played.elapsed());
        assert_eq!(
            (first, next_cue(&stage.queue)),
            (cue(1.0), cue(64.0 / 127.0))
        );
        for bytes in [
            &[0xb0, 20, 10][..],
            &[0xb0, 20, 90],
            &[0xb0, 20, 127],
            &[0xb0, 20, 0],
            &[0xc4, 3],
            &[0xb0, 7, 127],
        ] {
            pads.send(bytes);
        }
        let cues: Vec<Cue> = (0..3).map(|_| next_cue(&stage.queue)).collect();
        assert_eq!(
            cues,
            [
                cue(90.0 / 127.0),
                cue(1.0),
                Cue::Dance(DanceCommand::Intensity(Some(1.0)))
            ]
        );
        assert_eq!(
            (stage.queue.pop(), stage.faults.of(Fault::BadMidi)),
            (None, 0)
        );
        // The program survives the end of the server.
        crash(server);
        wait_for("a warning", || {
            stage.warnings.list().iter().any(|warning| {
                warning.contains("midi 1: cannot receive MIDI from JACK: the server has ended")
            })
        });
        drop(stage);
        // JACK's library crashes when a client of a crashed server is closed; the program does not
        // close it.
        std::mem::forget(pads);
        drop(JackServer::start(48_000, 256));
    });
}

#[test]
#[serial]
fn leds_follow_the_show_also_after_a_reconnection() {
    in_child(
        "leds_follow_the_show_also_after_a_reconnection",
        &[],
        || {
            let _server = JackServer::start(48_000, 64);
            let labels = corybant_repertoire::graph().unwrap().labels;
            let map = (FIRST_NOTE..)
                .zip(&labels)
                .map(|(note, label)| pad(note, label))
                .chain([pad(99, "!hold")])
                .collect();
            let mut stage = Stage::new(&[on_jack("pads", LedProtocol::Launchpad, map)], None);
            // The show starts without the controller and warns.
            assert!(
                stage.warnings.list()[0]
                    .starts_with("midi 1: midi.port: no MIDI port has \"pads\" in its name"),
                "{:?}",
                stage.warnings.list()
            );
            let pads = Pads::default();
            let idle = |note: u8| vec![0x90, note, 45];
            let notes = || FIRST_NOTE..FIRST_NOTE + labels.len() as u8;
            stage.until("idle LEDs", |_| {
                notes().all(|note| pads.last_led_message(note) == Some(idle(note)))
                    && pads.last_led_message(99) == Some(vec![0x90, 99, 5])
            });
            assert_eq!(stage.warnings.list(), [""; 0]);
            stage.until("the connection", |_| pads.connected());
            pads.play([0x99, FIRST_NOTE, 100]);
            stage.until("an armed LED", |_| {
                pads.received().contains(&vec![0x92, FIRST_NOTE, 21])
            });
            stage.until("a dancing LED", |_| {
                pads.last_led_message(FIRST_NOTE) == Some(vec![0x90, FIRST_NOTE, 21])
            });
            pads.play([0x99, 99, 100]);
            stage.until("a hold", |_| {
                pads.last_led_message(99) == Some(vec![0x90, 99, 21])
            });
            // Messages are sent only when an LED changes.
            let sent = pads.received().len();
            for _ in 0..60 {
                stage.tick();
            }
            assert_eq!(pads.received().len(), sent);

            drop(pads);
            stage.until("a warning", |stage| {
                stage
                    .warnings
                    .list()
                    .iter()
                    .any(|warning| warning.contains("no MIDI port has \"pads:out\""))
            });
            let pads = Pads::default();
            stage.until("lit LEDs after the reconnection", |_| {
                notes().all(|note| pads.last_led_message(note).is_some())
                    && pads.last_led_message(99) == Some(vec![0x90, 99, 21])
            });
            assert_eq!(stage.warnings.list(), [""; 0]);
            stage.until("the connection", |_| pads.connected());
            pads.play([0x89, 99, 0]);
            stage.until("the hold's end", |_| {
                pads.last_led_message(99) == Some(vec![0x90, 99, 5])
            });
            let shown = stage.devices.led_delay();
            println!("LED delay: {shown}");
            assert!(shown.count >= 3);
            drop(stage);
            // The LEDs go out at the end of the show.
            wait_for("dark LEDs", || {
                notes().all(|note| {
                    pads.last_led_message(note)
                        .is_some_and(|message| message[2] == 0)
                })
            });
        },
    );
}

#[test]
#[serial]
fn a_learnt_control_is_saved_and_works_at_once() {
    in_child("a_learnt_control_is_saved_and_works_at_once", &[], || {
        let _server = JackServer::start(48_000, 64);
        let pads = Pads::default();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("show.toml");
        let text = "# mine\n[[midi]] # on the left\nbackend = \"jack\"\nport = \"elsewhere\"\n\n# the rest\n[page]\nlisten = 'off' # not today\n";
        std::fs::write(&path, text).unwrap();
        let file = Arc::new(ShowFile::new(path.clone(), Box::new(|_| Ok(()))));
        let mut stage = Stage::new(
            &[on_jack("elsewhere", LedProtocol::None, vec![])],
            Some(file),
        );
        let midi_control = stage.devices.control();
        let mut answers = midi_control.subscribe();
        let label = stage.labels()[1].clone();
        let mut next = |state: LearnState| -> LearnReport {
            let answer = answers.blocking_recv().unwrap();
            assert_eq!(answer.state, state, "{answer:?}");
            answer
        };
        midi_control.learn(MapEntry {
            label: label.clone(),
            ..MapEntry::default()
        });
        next(LearnState::Waiting);
        wait_for("the connection", || pads.connected());
        pads.play([0xb9, 64, 127]);
        assert!(next(LearnState::Refused).message.contains("sustain pedal"));
        pads.play([0x99, 40, 1]);
        let learnt = next(LearnState::Learnt);
        assert_eq!(
            (
                learnt.control.as_deref(),
                learnt.channel,
                learnt.port.as_deref(),
                learnt.kept
            ),
            (Some("note 40"), Some(10), Some("pads:out"), Some(true))
        );
        let new = format!(
            "[[midi]]\nbackend = \"jack\"\nport = \"pads:out\"\n\n[[midi.map]]\nnote = 40\nchannel = 10\nlabel = \"{label}\"\n"
        );
        let after = std::fs::read_to_string(&path).unwrap();
        assert_eq!(
            after.replace(&new, "").replace("\n\n\n", "\n\n"),
            text,
            "{after}"
        );
        // The learn session received the note, so no cue was sent.
        assert_eq!(stage.queue.pop(), None);
        wait_for("the connection", || pads.connected());
        pads.play([0x99, 40, 1]);
        let cue = next_cue(&stage.queue);
        assert!(
            matches!(cue, Cue::Dance(DanceCommand::Launch(launch)) if stage.labels()[usize::from(launch.label)] == label),
            "{cue:?}"
        );

        // The same control learns another action.
        midi_control.learn(MapEntry {
            label: "!panic".into(),
            ..MapEntry::default()
        });
        next(LearnState::Waiting);
        pads.play([0x99, 40, 1]);
        assert!(
            next(LearnState::Learnt)
                .message
                .contains(&format!("instead of {label:?}"))
        );
        pads.play([0x99, 40, 1]);
        assert_eq!(next_cue(&stage.queue), Cue::Dance(DanceCommand::Panic));
        let read: corybant::config::Config =
            toml::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        assert_eq!(read.midi[1].map, [pad(40, "!panic")]);

        // A control that cannot be saved works all the same, with a message.
        std::fs::write(&path, "midi = 3\n").unwrap();
        midi_control.learn(MapEntry {
            label: "!release".into(),
            ..MapEntry::default()
        });
        next(LearnState::Waiting);
        pads.play([0x99, 41, 1]);
        let learnt = next(LearnState::Learnt);
        assert!(
            learnt.kept == Some(false) && learnt.message.contains("not kept after this run"),
            "{learnt:?}"
        );
        pads.play([0x99, 41, 1]);
        assert_eq!(next_cue(&stage.queue), Cue::Dance(DanceCommand::Release));

        midi_control.learn(MapEntry {
            label: "!tap".into(),
            ..MapEntry::default()
        });
        next(LearnState::Waiting);
        midi_control.cancel_learn();
        next(LearnState::Cancelled);
        stage.tick();
    });
}

#[test]
#[serial]
fn a_changed_show_file_changes_the_actions_of_pads() {
    in_child(
        "a_changed_show_file_changes_the_actions_of_pads",
        &[],
        || {
            let _server = JackServer::start(48_000, 64);
            let pads = Pads::default();
            let stage = Stage::new(
                &[on_jack("pads", LedProtocol::None, vec![pad(36, "!panic")])],
                None,
            );
            let midi_control = stage.devices.control();
            wait_for("the connection", || pads.connected());
            pads.play([0x99, 36, 1]);
            assert_eq!(next_cue(&stage.queue), Cue::Dance(DanceCommand::Panic));
            // Only the map changes: the port stays open.
            midi_control.set_controllers(vec![on_jack(
                "pads",
                LedProtocol::None,
                vec![pad(36, "!release")],
            )]);
            wait_for("the new map", || {
                pads.play([0x99, 36, 1]);
                std::iter::from_fn(|| stage.queue.pop())
                    .any(|cue| cue == Cue::Dance(DanceCommand::Release))
            });
            assert!(pads.connected());
            // Ports that are missing, then the first port again.
            midi_control.set_controllers(vec![
                on_jack("elsewhere", LedProtocol::None, vec![]),
                on_jack("nowhere", LedProtocol::None, vec![]),
            ]);
            wait_for("the warnings", || stage.warnings.list().len() == 2);
            wait_for("the end of the connection", || !pads.connected());
            midi_control.set_controllers(vec![on_jack(
                "pads",
                LedProtocol::None,
                vec![pad(36, "!tap")],
            )]);
            wait_for("no warnings", || stage.warnings.list().is_empty());
            wait_for("the connection", || pads.connected());
        },
    );
}
