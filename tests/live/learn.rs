//! Tests of MIDI learn with the whole program: pads over a real JACK server, learn sessions over
//! the page's WebSocket, a real show file, LEDs; and the delay of a note.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::common::jack as jack_server;
use crate::common::program;
use serial_test::serial;

use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use jack_server::{JackServer, Pads, in_child, wait_for};
use program::{Program, ran};
use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

/// Number of messages or notes whose delay is measured.
const HITS: usize = 100;

const SHOW: &str = "# The show at the harbour.\n[audio]\ninput = 'default'   # the desk's\n\n[osc]\nlisten = '127.0.0.1:0'\n[page]   # for the \
                    tablet\nlisten = \"127.0.0.1:0\"\n\n# left of the mixer\n[[midi]]\nbackend = 'jack'\nport = 'pads'\nleds = \"notes\"\n\n# the \
                    first row\n[[midi.map]]\nnote = 36   # low C\nlabel = 'LABEL'\n\n# outputs\n[[output]]\nto = '127.0.0.1:39539'\n# end\n";

/// A client of the page's WebSocket.
struct Page(WebSocket<TcpStream>);

impl Page {
    fn open(addr: SocketAddr) -> Self {
        let stream = TcpStream::connect(addr).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(20)))
            .unwrap();
        Self(
            tungstenite::client(format!("ws://{addr}/live"), stream)
                .unwrap()
                .0,
        )
    }

    fn send(&mut self, message: &Value) {
        self.0.send(Message::text(message.to_string())).unwrap();
    }

    /// Measures and prints the delay from a message of the page to the state that contains its
    /// effect.
    fn measure_delay(&mut self) {
        let mut took: Vec<Duration> = (1..=HITS)
            .map(|hit| {
                let (value, start) = (hit as f64 / HITS as f64, Instant::now());
                self.send(&json!({ "intensity": value }));
                self.receive("state", |state| {
                    state["intensity"]
                        .as_f64()
                        .is_some_and(|x| (x - value).abs() < 1e-3)
                });
                start.elapsed()
            })
            .collect();
        took.sort_unstable();
        println!(
            "from the page to its next state: {HITS}, p50 {:?}, p99 {:?}",
            took[HITS / 2],
            took[HITS * 99 / 100]
        );
    }

    /// Returns the next message of the type `kind` for which `matches` returns true.
    fn receive(&mut self, kind: &str, matches: impl Fn(&Value) -> bool) -> Value {
        loop {
            let Message::Text(text) = self.0.read().unwrap() else {
                continue;
            };
            let message: Value = serde_json::from_str(&text).unwrap();
            assert_ne!(message["type"], "error", "{message}");
            if message["type"] == kind && matches(&message) {
                return message;
            }
        }
    }
}

#[test]
#[serial]
fn learnt_pads_are_saved_and_work_at_once() {
    in_child("learnt_pads_are_saved_and_work_at_once", &[], || {
        let _server = JackServer::start(48_000, 64);
        let labels = corybant_repertoire::graph().unwrap().labels;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("show.toml");
        let text = SHOW.replace("LABEL", &labels[0]);
        std::fs::write(&path, &text).unwrap();

        // Without the controller: `check` prints a note, the show starts, and a warning stays.
        let checked = ran([std::ffi::OsStr::new("check"), path.as_os_str()]);
        let said = String::from_utf8_lossy(&checked.stdout);
        assert!(
            checked.status.success()
                && said
                    .contains(": OK\nmidi 1 is not here now: midi.port: no MIDI port has \"pads\""),
            "{said}"
        );
        let mut program = Program::start([std::ffi::OsStr::new("run"), path.as_os_str()]);
        let mut page = Page::open(program.listening("page"));
        let is_missing = |message: &Value| {
            message["warnings"]
                .as_array()
                .unwrap()
                .iter()
                .any(|text| text.as_str().unwrap().starts_with("midi 1: "))
        };
        page.receive("warnings", is_missing);
        let pads = Pads::default();
        page.receive("warnings", |message| !is_missing(message));
        wait_for("the connection", || pads.connected());

        let led =
            |note: u8, value: u8| pads.last_led_message(note) == Some(vec![0x90, note, value]);
        wait_for("an idle LED", || led(36, 0));
        pads.press(36);
        wait_for("a lit LED", || {
            pads.received().contains(&vec![0x90, 36, 127])
        });

        // A gate on a control change, learnt from the page.
        page.send(&json!({ "learn": { "label": labels[1], "mode": "gate", "quantise": "now" } }));
        page.receive("learn", |message| message["state"] == "waiting");
        pads.send(&[0xb2, 0, 127]);
        let refused = page.receive("learn", |message| message["state"] != "waiting");
        assert!(
            refused["state"] == "refused"
                && refused["message"]
                    .as_str()
                    .unwrap()
                    .contains("cc 0 on channel 3"),
            "{refused}"
        );
        pads.send(&[0xb2, 21, 127]);
        let learnt = page.receive("learn", |message| message["state"] == "learnt");
        assert_eq!(
            (&learnt["control"], &learnt["channel"], &learnt["kept"]),
            (&json!("cc 21"), &json!(3), &json!(true)),
            "{learnt}"
        );
        let new = format!(
            "\n[[midi.map]]\ncc = 21\nchannel = 3\nlabel = \"{}\"\nmode = \"gate\"\nquantise = \"now\"\n",
            labels[1]
        );
        let after = std::fs::read_to_string(&path).unwrap();
        let (before, rest) = text.split_once("\n# outputs").unwrap();
        assert_eq!(after, format!("{before}{new}\n# outputs{rest}"));

        // The control works at once, and so does its LED.
        pads.send(&[0xb2, 21, 0]);
        pads.send(&[0xb2, 21, 127]);
        page.receive("state", |state| state["label"] == 1);
        wait_for("the LED of the learnt control", || {
            pads.last_led_message(21) == Some(vec![0xb2, 21, 127])
        });
        pads.send(&[0xb2, 21, 0]);

        // The delay of a note: to the plan, and to the LED, which the second press switches off.
        page.send(&json!({ "learn": { "label": "!intensity" } }));
        page.receive("learn", |message| message["state"] == "waiting");
        pads.send(&[0xb0, 7, 1]);
        page.receive("learn", |message| message["state"] == "learnt");
        for hit in 0..HITS {
            let value = (hit % 128) as u8;
            pads.send(&[0xb0, 7, value]);
            page.receive("state", |state| {
                state["intensity"]
                    .as_f64()
                    .is_some_and(|x| (x * 127.0).round() as u8 == value)
            });
            pads.press(36);
        }
        page.measure_delay();
        program.signal("INT");
        let log = program.log.clone();
        program.ends_well();
        let figure = |beginning: &str| {
            log.text()
                .lines()
                .find_map(|line| Some(line.split_once(beginning)?.1.to_owned()))
        };
        for beginning in [
            "MIDI and DMX cues taken into the plan: ",
            "MIDI cues shown by lamps: ",
        ] {
            let said =
                figure(beginning).unwrap_or_else(|| panic!("no {beginning:?} in\n{}", log.text()));
            println!("{beginning}{said}");
            let count: usize = said.split(',').next().unwrap().parse().unwrap();
            assert!(
                count
                    >= if beginning.contains("plan") {
                        2 * HITS
                    } else {
                        2
                    }
                    && said.contains("p99 "),
                "{said}"
            );
        }
        // The saved text is a valid show file.
        assert!(
            ran([std::ffi::OsStr::new("check"), path.as_os_str()])
                .status
                .success()
        );
    });
}
