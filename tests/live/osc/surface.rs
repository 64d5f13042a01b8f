//! Tests of control surfaces of python-osc with a real show: two that send messages, and one that
//! the show file names. Each gets all changes, with constant types, at the port from which it
//! sends, but no value that it has just changed itself.
#![allow(clippy::unwrap_used)]

use serial_test::serial;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::process::{Child, ChildStdin, Command, Stdio};

use corybant::osc::feedback::surfaces::DATAGRAMS_PER_SECOND_MAX;
use corybant_core::cue::namespace::Namespace;
use serde_json::Value;

use crate::common::program;
use crate::common::wav;

use crate::common::shared::skip;
use program::{FAREWELL, Lines, Program, patiently, python};

/// The largest payload of a UDP datagram in one Ethernet packet, in bytes.
const DATAGRAM_BYTES_MAX: u64 = 1472;

/// The running script `tests/live/surface.py`, which simulates several control surfaces.
struct Surfaces {
    process: Child,
    commands: Option<ChildStdin>,
    output: Lines,
    show: u16,
}

/// A received value: the surface that received it, the time in seconds, the OSC address, the type
/// tags and the value.
#[derive(Clone, Debug, PartialEq)]
struct Received {
    who: String,
    t: f64,
    path: String,
    tags: String,
    value: Value,
}

impl Surfaces {
    fn start(python: &std::path::Path, names: &[&str]) -> Self {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/live/surface.py");
        let mut process = Command::new(python)
            .arg(script)
            .args(names)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (output, _) = Lines::follow(process.stdout.take().unwrap());
        Self {
            commands: process.stdin.take(),
            process,
            output,
            show: 0,
        }
    }

    fn port(&self, name: &str) -> String {
        patiently(name, || self.output.after(&format!("listening {name} ")))
    }

    /// Makes the surface `who` send `message`, an OSC address and an optional number. Returns the
    /// time at which it was sent, in seconds.
    fn send(&mut self, who: &str, message: &str) -> f64 {
        let (address, number) = message.split_once(' ').unwrap_or((message, ""));
        let said = |all: Vec<Value>| {
            all.into_iter()
                .filter(|line| line["who"] == who && line["said"] == address)
                .collect::<Vec<_>>()
        };
        let before = said(self.all()).len();
        writeln!(
            self.commands.as_mut().unwrap(),
            "say {who} {} {address} {number}",
            self.show
        )
        .unwrap();
        patiently("a message on its way", || {
            said(self.all()).get(before).cloned()
        })["t"]
            .as_f64()
            .unwrap()
    }

    fn close(&mut self, who: &str) {
        writeln!(self.commands.as_mut().unwrap(), "close {who}").unwrap();
    }

    /// Returns all messages that the surfaces have sent and received so far.
    fn all(&self) -> Vec<Value> {
        self.output
            .text()
            .lines()
            .filter(|line| line.starts_with('{'))
            .map(|line| serde_json::from_str(line).unwrap())
            .collect()
    }

    /// Returns all values that the surfaces have received so far.
    fn received(&self) -> Vec<Received> {
        let mut came = Vec::new();
        for line in self.all() {
            for message in line["heard"].as_array().into_iter().flatten() {
                let word = |value: &Value| value.as_str().unwrap().to_owned();
                let (who, t, value) = (
                    word(&line["who"]),
                    line["t"].as_f64().unwrap(),
                    message[2][0].clone(),
                );
                came.push(Received {
                    who,
                    t,
                    path: word(&message[0]),
                    tags: word(&message[1]),
                    value,
                });
            }
        }
        came
    }

    /// Waits for a value for the surface `who` at the OSC address `path`, at or after the time
    /// `start`, for which `is_expected` returns true. Returns the first such value.
    fn first(
        &self,
        who: &str,
        path: &str,
        start: f64,
        is_expected: impl Fn(&Value) -> bool,
    ) -> Received {
        let find = || {
            self.received().into_iter().find(|came| {
                came.who == who && came.path == path && came.t >= start && is_expected(&came.value)
            })
        };
        patiently(&format!("{path} at {who}"), find)
    }
}

impl Drop for Surfaces {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn is(number: f64) -> impl Fn(&Value) -> bool {
    move |value| value.as_f64() == Some(number)
}

#[test]
#[serial]
fn surfaces_get_all_changes() {
    let Some(python) = python() else {
        return skip(
            "surfaces_get_all_changes",
            "target/live-venv is absent; run scripts/run-tests",
        );
    };
    let mut surfaces = Surfaces::start(&python, &["desk", "phone", "wall"]);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("track.wav"),
        wav::wav(&corybant_repertoire::track::render().samples),
    )
    .unwrap();
    let file = folder.path().join("show.toml");
    let text = format!(
        "[audio]\ninput = \"file:{}\"\n[osc]\nlisten = \"127.0.0.1:0\"\nfeedback = [\"127.0.0.1:{}\"]\n[page]\nlisten = \"off\"\n",
        folder.path().join("track.wav").display(),
        surfaces.port("wall")
    );
    std::fs::write(&file, text).unwrap();
    let mut show = Program::start(["run".as_ref(), file.as_os_str()]);
    surfaces.show = show.listening("osc").port();
    let labels = show.until("the labels", |show| show.out.after("labels: "));
    let labels: Vec<String> = labels.split(", ").map(String::from).collect();

    // A surface that has sent a message gets all values, at the port from which it sent. Others get
    // none.
    surfaces.send("desk", "/sync");
    surfaces.first("desk", "/state/queue", 0.0, |_| true);
    surfaces.first("wall", "/state/queue", 0.0, |_| true);
    assert!(surfaces.received().iter().all(|came| came.who != "phone"));
    surfaces.send("phone", "/tempo/tap 0");
    surfaces.first("phone", "/state/queue", 0.0, |_| true);
    every_address_is_received(&surfaces, &labels);

    pads_light_up(
        &mut surfaces,
        &format!("/cue/{}", corybant_core::cue::osc_name(&labels[0])),
    );
    commands_are_echoed(&mut surfaces);
    patterns_match_one_kind_of_command(&mut surfaces, &show);

    // One surface closes without a message; the other still gets its values.
    surfaces.close("phone");
    let start = surfaces.send("desk", "/offset 0");
    surfaces.first("desk", "/offset", start, is(0.0));
    let beats: Vec<Received> = (0..3)
        .scan(start, |start, _| {
            let beat = surfaces.first("desk", "/hb", *start + 1e-6, |_| true);
            *start = beat.t;
            Some(beat)
        })
        .collect();
    for pair in beats.windows(2) {
        assert_eq!(
            pair[1].value.as_i64(),
            pair[0].value.as_i64().map(|n| n + 1)
        );
        let gap = pair[1].t - pair[0].t;
        assert!((1.0..3.5).contains(&gap), "{gap} s between two heartbeats");
    }
    rates_and_types_hold(&surfaces);
    show.signal("INT");
    assert!(show.ends_well() < FAREWELL);
}

/// Checks that each surface gets a value of every readable address, with the right type.
fn every_address_is_received(surfaces: &Surfaces, labels: &[String]) {
    let namespace = Namespace::new(labels);
    for who in ["desk", "phone", "wall"] {
        for address in namespace
            .all()
            .iter()
            .filter(|address| address.readout.is_some() && !address.when_used)
        {
            let came = surfaces.first(who, &address.path, 0.0, |_| true);
            assert_eq!(came.tags, address.shape.tags(), "{}", address.path);
        }
    }
}

/// Checks that a button press arms the pad `pad` and then lights it, on all surfaces. The surface
/// that sent the press gets no value for a tenth of a second.
fn pads_light_up(surfaces: &mut Surfaces, pad: &str) {
    let hit = surfaces.send("desk", &format!("{pad}/bar 1"));
    surfaces.first("phone", pad, hit, is(0.5));
    surfaces.first("phone", &format!("{pad}/lamp"), hit, is(1.0));
    surfaces.first("phone", pad, hit, is(1.0));
    surfaces.first("phone", &format!("{pad}/lamp"), hit, is(2.0));
    // It gets the address that it used and that of the pad; the other surface gets only the pad.
    let own = surfaces.first("desk", &format!("{pad}/bar"), hit, is(1.0));
    assert!(
        own.t - hit >= 0.1,
        "sent {} s after the surface changed it",
        own.t - hit
    );
    surfaces.first("desk", pad, hit, is(1.0));
    assert!(
        surfaces
            .received()
            .iter()
            .all(|came| came.who != "phone" || !came.path.ends_with("/bar"))
    );
    surfaces.first("wall", pad, hit, is(1.0));
}

fn commands_are_echoed(surfaces: &mut Surfaces) {
    for (message, value) in [("/hold 1", 1.0), ("/offset 40", 40.0), ("/hold 0", 0.0)] {
        let (address, _) = message.split_once(' ').unwrap();
        let start = surfaces.send("phone", message);
        surfaces.first("desk", address, start, is(value));
        let own = surfaces.first("phone", address, start, |_| true);
        assert!(
            own.t - start >= 0.1 && own.value.as_f64() == Some(value),
            "{own:?} after {start}"
        );
    }
}

fn patterns_match_one_kind_of_command(surfaces: &mut Surfaces, show: &Program) {
    surfaces.send("desk", "/cue/*/*");
    patiently("a warning", || {
        show.log
            .text()
            .contains("the pattern matches different kinds of command; a pattern may match many labels of one kind")
            .then_some(())
    });
    let start = surfaces.send("desk", "/cue/*/cancel");
    surfaces.first("phone", "/state/queue", start, |value| value == "");
}

fn rates_and_types_hold(surfaces: &Surfaces) {
    let mut types: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for came in surfaces.received() {
        types.entry(came.path).or_default().insert(came.tags);
    }
    assert!(types.values().all(|tags| tags.len() == 1), "{types:?}");
    let all = surfaces.all();
    let heard = all.iter().filter(|line| line["heard"].is_array());
    let mut arrivals: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for line in heard {
        assert!(
            line["bytes"].as_u64().unwrap() <= DATAGRAM_BYTES_MAX,
            "{line}"
        );
        arrivals
            .entry(line["who"].as_str().unwrap())
            .or_default()
            .push(line["t"].as_f64().unwrap());
    }
    for (who, arrivals) in &arrivals {
        // The rate limiter may have saved up one second.
        let most = 2 * DATAGRAMS_PER_SECOND_MAX as usize;
        let within = |start: f64| {
            arrivals
                .iter()
                .filter(|&&t| (start..start + 1.0).contains(&t))
                .count()
        };
        assert!(
            arrivals.iter().all(|&start| within(start) <= most),
            "{who} was sent more than {most} datagrams in a second"
        );
        let seconds = arrivals[arrivals.len() - 1] - arrivals[0];
        println!("{who}: {} datagrams in {seconds:.1} s", arrivals.len());
    }
}
