//! Test of takes with a MIDI controller over a real JACK server: a pad records a take, its LED shows
//! the take, and after the change of the graph old pads keep their labels and a new one is learnt.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used)]

use std::net::UdpSocket;

use rosc::OscType;
use serde_json::json;
use serial_test::serial;

use crate::common::jack::{JackServer, Pads, in_child, wait_for};
use crate::common::program::FAREWELL;
use crate::reload::Page;
use crate::takes::{send, show};

/// Two dancers, of whom the follower has the performer, and a controller.
const SHOW: &str = "[[dancer]]\nname = \"lead\"\n[[dancer]]\nname = \"second\"\nfollows = \"lead\"\n\
    [[midi]]\nbackend = \"jack\"\nport = \"pads\"\nleds = \"notes\"\n\
    [[midi.map]]\nnote = 36\nlabel = \"mine\"\nrecord = true\nbeats = 8\n\
    [[midi.map]]\nnote = 37\nlabel = \"!record_undo\"\n\
    [[midi.map]]\nnote = 38\nlabel = \"salsa\"\n";

#[test]
#[serial]
fn a_midi_pad_records_a_take_of_a_follower_s_performer() {
    in_child(
        "a_midi_pad_records_a_take_of_a_follower_s_performer",
        &[],
        || {
            let _server = JackServer::start(48_000, 64);
            let pads = Pads::default();
            let folder = tempfile::tempdir().unwrap();
            // Ports that were just free.
            let sockets = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
            let [input, nobody] = sockets.map(|socket| socket.local_addr().unwrap().to_string());
            let more = format!("{SHOW}[[motion_in]]\nlisten = \"{input}\"\ndancer = \"second\"\n");
            let mut program = show(folder.path(), "second.toml", &[nobody], &more);
            let mut page = Page::open(program.listening("page"));
            let hello = page.next("hello", |_| true);
            let labels = hello["labels"].as_array().unwrap();
            let (known, salsa) = (
                labels.len(),
                labels.iter().position(|label| label == "salsa").unwrap(),
            );
            let vitals = page.next("vitals", |_| true);
            assert_eq!(vitals["performers"][0]["state"], "waiting");
            let mut performer = show(
                folder.path(),
                "first.toml",
                std::slice::from_ref(&input),
                "",
            );
            send(
                performer.listening("osc"),
                "/cue/salsa/gate",
                vec![OscType::Float(1.0)],
            );
            let live = page.next("vitals", |vitals| {
                vitals["performers"][0]["state"] == "live"
                    && vitals["performers"][0]["poses"].as_u64() > Some(10)
            });
            println!("{}", live["performers"]);
            assert_eq!(live["performers"][0]["dancer"], "second");
            assert_eq!(live["performers"][0]["listen"], input);
            assert!(live["performers"][0]["sender"].is_string());

            wait_for("the connection", || pads.connected());
            let led =
                |note: u8, value: u8| pads.last_led_message(note) == Some(vec![0x90, note, value]);
            wait_for("a dark LED", || led(36, 0));
            // The second press drops the take before its first beat.
            pads.press(36);
            page.next("take", |take| take["phase"] == "count_in");
            wait_for("an LED that pulses", || led(36, 127));
            pads.press(36);
            page.next("take", |take| take["phase"] == "idle");
            wait_for("a dark LED", || led(36, 0));
            pads.press(36);
            let recording = page.next("take", |take| take["phase"] == "recording");
            assert_eq!(
                (&recording["label"], &recording["beats"]),
                (&json!("mine"), &json!(8))
            );
            wait_for("an LED that is lit", || led(36, 127));
            page.next("take", |take| take["takes"] == json!(["mine"]));
            let hello = Page::open(program.listening("page")).next("hello", |_| true);
            assert_eq!(hello["labels"][known], "mine");
            wait_for("a dark LED", || led(36, 0));

            // Pads from before the take keep their labels, and their LEDs work.
            pads.press(38);
            page.next("state", |state| state["label"] == salsa);
            wait_for("the LED of salsa", || led(38, 127));
            // The new label is learnt by a further pad.
            page.send(&json!({ "learn": { "label": "mine" } }));
            page.next("learn", |learn| learn["state"] == "waiting");
            pads.press(40);
            page.next("learn", |learn| learn["state"] == "learnt");
            pads.press(40);
            page.next("state", |state| state["label"] == known);
            wait_for("the LED of the take", || led(40, 127));
            let text = std::fs::read_to_string(folder.path().join("second.toml")).unwrap();
            assert!(text.contains("file = \"takes/graph-1.graph\""), "{text}");

            pads.press(37);
            page.next("take", |take| take["takes"] == json!([]));
            let text = std::fs::read_to_string(folder.path().join("second.toml")).unwrap();
            assert!(text.contains("[graph]\nfile = \"\"\n"), "{text}");
            performer.signal("INT");
            assert!(performer.ends_well() < FAREWELL);
            page.next("vitals", |vitals| {
                vitals["performers"][0]["state"] == "lost"
            });
            program.signal("INT");
            assert!(program.ends_well() < FAREWELL);
        },
    );
}
