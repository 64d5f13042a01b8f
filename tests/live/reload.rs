//! Tests of edits of the show file during a show: valid edits are applied without a gap in the
//! poses, invalid edits give a warning and change nothing, and settings that need a restart are
//! named.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use crate::common::program;
use serial_test::serial;

use std::io::Write;
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use corybant::offline::bench::synthetic;
use corybant_core::graph::file;
use program::{FAREWELL, Program, patiently};
use serde_json::Value;
use tungstenite::{Message, WebSocket};

/// Number of nodes of a graph that is searched by A*.
const LARGE_NODES: usize = 20_000;

/// A WebSocket client of the page.
pub struct Page(WebSocket<TcpStream>);

impl Page {
    pub fn open(addr: SocketAddr) -> Self {
        let stream = TcpStream::connect(addr).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(30)))
            .unwrap();
        Self(
            tungstenite::client(format!("ws://{addr}/live"), stream)
                .unwrap()
                .0,
        )
    }

    /// Sends a message to the show.
    pub fn send(&mut self, message: &Value) {
        self.0.send(Message::text(message.to_string())).unwrap();
    }

    /// Returns the next message of the type `kind` for which `matches` returns true.
    pub fn next(&mut self, kind: &str, matches: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        loop {
            let Message::Text(text) = self.0.read().unwrap() else {
                continue;
            };
            let message: Value = serde_json::from_str(&text).unwrap();
            if message["type"] == kind && matches(&message) {
                return message;
            }
            assert!(
                start.elapsed() < Duration::from_secs(30),
                "no such {kind} arrived; the last message is {message}"
            );
        }
    }

    /// Waits for a warning about the show file that contains `words`. If `words` is empty, waits
    /// until there is no warning about the show file.
    pub fn warns(&mut self, words: &str) {
        self.next("warnings", |message| {
            let of_file = |warning: &&Value| warning.as_str().unwrap().starts_with("show file: ");
            let warning = message["warnings"]
                .as_array()
                .unwrap()
                .iter()
                .find(of_file)
                .map(|warning| warning.as_str().unwrap());
            if words.is_empty() {
                warning.is_none()
            } else {
                warning.is_some_and(|warning| warning.contains(words))
            }
        });
    }
}

/// A receiver of poses in the plain format, which reads without pauses on its own thread.
#[derive(Clone)]
pub struct Receiver {
    pub addr: SocketAddr,
    /// The number and the sender of each received pose.
    poses: Arc<Mutex<Vec<(i32, SocketAddr)>>>,
}

impl Receiver {
    pub fn new() -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let receiver = Self {
            addr: socket.local_addr().unwrap(),
            poses: Arc::default(),
        };
        let poses = receiver.poses.clone();
        std::thread::spawn(move || {
            let mut datagram = [0; 2048];
            while let Ok((n, from)) = socket.recv_from(&mut datagram) {
                poses
                    .lock()
                    .unwrap()
                    .extend(number(&datagram[..n]).map(|number| (number, from)));
            }
        });
        receiver
    }

    fn poses(&self) -> Vec<(i32, SocketAddr)> {
        self.poses.lock().unwrap().clone()
    }

    /// Waits for `count` more poses and returns them.
    pub fn more(&self, count: usize) -> Vec<(i32, SocketAddr)> {
        let before = self.poses().len();
        patiently("poses", || {
            (self.poses().len() >= before + count).then(|| self.poses()[before..].to_vec())
        })
    }

    /// Asserts that no pose is missing and that all poses have the same sender. Returns the sender.
    pub fn unbroken(&self) -> SocketAddr {
        let poses = self.poses();
        for pair in poses.windows(2) {
            assert!(
                pair[1].0 == pair[0].0 + 1 && pair[1].1 == pair[0].1,
                "{pair:?}"
            );
        }
        poses[0].1
    }
}

/// Returns the number of the pose in a datagram in the plain format; `None` if there is no number.
fn number(datagram: &[u8]) -> Option<i32> {
    let (_, rosc::OscPacket::Bundle(bundle)) = rosc::decoder::decode_udp(datagram).unwrap() else {
        return None;
    };
    bundle.content.iter().find_map(|packet| match packet {
        rosc::OscPacket::Message(message) if message.addr.ends_with("/frame") => {
            message.args[0].clone().int()
        }
        _ => None,
    })
}

/// Replaces the file `path` as an editor does: writes a new file and renames it.
pub fn put(path: &Path, text: &str) {
    let beside = path.with_extension("swp");
    std::fs::write(&beside, text).unwrap();
    std::fs::rename(&beside, path).unwrap();
}

const SHOW: &str = "[audio]\ninput = \"file:silence.wav\"\n[osc]\nlisten = \"127.0.0.1:0\"\n[page]\nlisten = \"127.0.0.1:0\"\n";

#[test]
#[serial]
fn an_edited_show_file_is_applied_without_a_gap_in_the_poses() {
    let (one, two) = (Receiver::new(), Receiver::new());
    let (to_one, to_two) = (one.addr, two.addr);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("show.toml");
    let output = |to: SocketAddr, rate_hz: u32| {
        format!("[[output]]\nkind = \"plain\"\nto = \"{to}\"\nrate_hz = {rate_hz}\n")
    };
    let show = SHOW.replace("file:silence.wav", "default");
    std::fs::write(&path, format!("{show}{}", output(to_one, 60))).unwrap();
    let mut program = Program::start_with(
        program::corybant()
            .arg("run")
            .arg(&path)
            .env("ALSA_CONFIG_PATH", "/dev/null"),
    );
    let mut page = Page::open(program.listening("page"));
    page.next("hello", |_| true);
    one.more(60);

    // A second output, added by an editor that writes a new file and renames it.
    put(
        &path,
        &format!("{show}{}{}", output(to_one, 60), output(to_two, 60)),
    );
    assert_eq!(two.more(60)[0].0, 0, "the new one begins at its first pose");
    // The first output has missed no pose and has kept its port.
    one.unbroken();
    page.next("vitals", |vitals| {
        vitals["outputs"].as_array().unwrap().len() == 2
            && vitals["outputs"][1]["sent"].as_u64() > Some(30)
    });

    // A new rate of the first output, written in place.
    std::fs::write(&path, format!("{show}{}", output(to_one, 20))).unwrap();
    page.next("vitals", |vitals| {
        vitals["outputs"].as_array().unwrap().len() == 1
            && (15..=25).contains(&vitals["outputs"][0]["sent"].as_u64().unwrap())
    });
    one.unbroken();

    // An invalid edit gives a warning and changes nothing, also if only one of two edits is
    // invalid.
    std::fs::write(
        &path,
        format!("{show}{}[plan]\nbar = 1000\n", output(to_two, 60)),
    )
    .unwrap();
    page.warns("plan.bar is 1000");
    std::fs::write(&path, "[audio\n").unwrap();
    page.warns("show.toml:1");
    std::fs::remove_file(&path).unwrap();
    page.warns("no such file");
    one.more(5);
    one.unbroken();

    // A corrected edit is applied, and settings that need a restart are named.
    put(
        &path,
        &format!(
            "{show}{}[tempo]\nsource = \"fixed\"\nbpm = 97\n[plan]\nbar = 3\nhorizon_beats = 12\nseed = 7\n[[dancer]]\nhome = [1, 0]\n",
            output(to_one, 30)
        ),
    );
    page.warns("takes effect at the next start: dancer 1.home");
    page.next("state", |state| {
        state["source"] == "fixed" && state["bpm"] == 97.0
    });
    // Removed tables at the end are applied only when the file is saved a second time.
    let less = format!("{show}{}", output(to_one, 30));
    put(&path, &less);
    page.warns("save it once more as it is to remove the rest");
    page.next("state", |state| state["source"] == "fixed");
    put(&path, &less);
    page.warns("");
    page.next("state", |state| state["source"] == "audio");
    one.more(30);
    one.unbroken();
    let log = program.log.text();
    assert!(
        log.contains("taken over: output, plan, tempo.source, tempo.bpm"),
        "{log}"
    );
    program.signal("INT");
    assert!(program.ends_well() < FAREWELL);
}

#[test]
#[serial]
fn a_large_graph_takes_new_plan_settings() {
    let receivers = [Receiver::new(), Receiver::new()];
    let folder = tempfile::tempdir().unwrap();
    let graph = synthetic::moving(LARGE_NODES, 1);
    std::fs::write(folder.path().join("large.graph"), file::to_bytes(&graph)).unwrap();
    let dancer = |name: &str, start: &str, to: SocketAddr| {
        format!(
            "[[dancer]]\nname = \"{name}\"\nstart = \"{start}\"\n\
             [[output]]\ndancer = \"{name}\"\nkind = \"plain\"\nto = \"{to}\"\n"
        )
    };
    let show = format!(
        "[audio]\ninput = \"default\"\n[tempo]\nsource = \"fixed\"\nbpm = 150\n\
         [osc]\nlisten = \"127.0.0.1:0\"\n[page]\nlisten = \"127.0.0.1:0\"\n\
         [graph]\nfile = \"large.graph\"\n{}{}",
        dancer("one", "clip 1", receivers[0].addr),
        dancer("two", "clip 2", receivers[1].addr),
    );
    let path = folder.path().join("show.toml");
    std::fs::write(&path, &show).unwrap();
    let mut program = Program::start_with(
        program::corybant()
            .arg("run")
            .arg(&path)
            .env("ALSA_CONFIG_PATH", "/dev/null"),
    );
    let mut page = Page::open(program.listening("page"));
    page.next("hello", |_| true);
    let receive = |count| {
        for receiver in &receivers {
            receiver.more(count);
            receiver.unbroken();
        }
    };
    receive(30);

    let edits = [
        "[plan]\nseed = 7\n",
        "[plan]\nseed = 7\nbar = 3\nhorizon_beats = 24\n",
    ];
    for (applied, edit) in (1..).zip(edits) {
        put(&path, &format!("{show}{edit}"));
        patiently("the plan settings are applied", || {
            let taken = program.log.text().matches("taken over: plan").count();
            (taken == applied).then_some(())
        });
        receive(60);
    }
    assert!(!program.log.text().contains("at the next start"));
    program.signal("INT");
    assert!(program.ends_well() < FAREWELL);
}

#[test]
#[serial]
fn a_truncated_show_file_changes_nothing() {
    let (one, two) = (Receiver::new(), Receiver::new());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("show.toml");
    let output = |to: SocketAddr, rate_hz: u32| {
        format!("[[output]]\nkind = \"plain\"\nto = \"{to}\"\nrate_hz = {rate_hz}\n")
    };
    let outputs =
        |rate_hz: u32| format!("{}{}", output(one.addr, rate_hz), output(two.addr, rate_hz));
    let show = SHOW.replace("file:silence.wav", "default");
    let whole = format!("{show}{}", outputs(60));
    std::fs::write(&path, &whole).unwrap();
    let mut program = Program::start_with(
        program::corybant()
            .arg("run")
            .arg(&path)
            .env("ALSA_CONFIG_PATH", "/dev/null"),
    );
    let mut page = Page::open(program.listening("page"));
    page.next("hello", |_| true);
    one.more(30);
    let both_go_on = || {
        one.more(10);
        two.more(10);
        one.unbroken();
        two.unbroken();
    };

    std::fs::write(&path, "").unwrap();
    page.warns("show.toml: the file is empty. The show continues with its last good settings");
    both_go_on();
    std::fs::write(&path, "# Tonight's show.\n\n").unwrap();
    page.warns("the file holds only comments and blank lines");
    both_go_on();
    // Truncated before the second output, within its rate, and within its address.
    for ending in [output(two.addr, 60).as_str(), "0\n", "\"\nrate_hz = 60\n"] {
        let half = whole.strip_suffix(ending).unwrap();
        std::fs::write(&path, half).unwrap();
        let (bytes, of) = (half.len(), whole.len());
        page.warns(&format!("ends after the first {bytes} of its {of} bytes"));
        both_go_on();
    }
    // Removed, and written again in two steps.
    std::fs::remove_file(&path).unwrap();
    page.warns("no such file");
    std::fs::write(&path, &whole[..show.len()]).unwrap();
    page.warns("as if it was cut short");
    put(&path, &whole);
    page.warns("");
    both_go_on();

    // An editor that empties the file and writes a new text in two pieces.
    let other = format!("{show}{}", outputs(20));
    let (start, rest) = other.split_at(show.len() + output(one.addr, 20).len());
    let mut file = std::fs::File::create(&path).unwrap();
    page.warns("the file is empty");
    file.write_all(start.as_bytes()).unwrap();
    file.flush().unwrap();
    one.more(120);
    both_go_on();
    file.write_all(rest.as_bytes()).unwrap();
    drop(file);
    page.warns("");
    page.next("vitals", |vitals| {
        let outputs = vitals["outputs"].as_array().unwrap();
        outputs.len() == 2
            && outputs
                .iter()
                .all(|output| (15..=25).contains(&output["sent"].as_u64().unwrap()))
    });
    both_go_on();
    let log = program.log.text();
    for warning in ["the file is empty", "only comments", "cut short"] {
        assert!(log.contains(warning), "{warning} is missing:\n{log}");
    }
    program.signal("INT");
    assert!(program.ends_well() < FAREWELL);
}

#[test]
#[serial]
fn a_word_more_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("show.toml");
    let show = SHOW.replace("file:silence.wav", "default");
    std::fs::write(&path, &show).unwrap();
    let mut program = Program::start_with(
        program::corybant()
            .arg("run")
            .arg(&path)
            .env("ALSA_CONFIG_PATH", "/dev/null"),
    );
    program.listening("page");
    put(&path, &format!("# a word\n{show}"));
    patiently("the change", || {
        program
            .log
            .text()
            .contains("taken over: nothing")
            .then_some(())
    });
    program.signal("INT");
    assert!(program.ends_well() < FAREWELL);
}
