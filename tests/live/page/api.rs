//! Tests of the HTTP API as a client sees it: commands, rights, state, events, and the refused
//! requests.

#![allow(clippy::unwrap_used)]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Instant;

use corybant::web::{MESSAGE_BYTES_MAX, MESSAGES_HZ_MAX, Settings};
use corybant_core::cue::{Cue, DanceCommand, Launch};
use corybant_core::fault::Fault;
use corybant_core::tempo::command::TempoCommand;
use serde_json::{Value, json};
use serial_test::serial;

use super::rig::{Rig, WAIT_MAX, any_port};
use crate::common::http::{Answer, ask, get};
use crate::common::puppet;

fn post(addr: SocketAddr, name: &str, headers: &str, body: &str) -> Answer {
    ask(addr, &format!("POST /api/{name}"), headers, body)
}

#[test]
#[serial]
fn commands_are_cues_and_the_state_has_names() {
    let mut rig = Rig::new();
    let addr = rig.page.local_addr();
    let about = get(addr, "/api").json();
    assert_eq!(
        (&about["api"], &about["right"]),
        (&1.into(), &"configure".into())
    );
    let labels = about["labels"].as_array().unwrap();
    let label = labels[1].as_str().unwrap();

    let body = json!({ "label": label, "beats": 16, "queue": true }).to_string();
    assert_eq!(post(addr, "cue", "", &body).status, 200);
    let launch = Launch {
        queued: true,
        ..Launch::new(1, 16)
    };
    assert_eq!(rig.cue(), launch.into());
    assert_eq!(
        post(addr, "panic", "", "").json(),
        json!({ "message": null })
    );
    assert_eq!(rig.cue(), DanceCommand::Panic.into());
    assert_eq!(post(addr, "tempo", "", r#"{"value":"tap"}"#).status, 200);
    assert_eq!(rig.cue(), Cue::Tempo(TempoCommand::Tap));

    // Each listed request that anybody may send without further parts of the show is accepted.
    for request in about["requests"].as_array().unwrap() {
        if request["right"] == "configure" {
            continue;
        }
        let path = request["post"].as_str().unwrap();
        let body = match &request["body"] {
            Value::Null => String::new(),
            body => body.to_string().replace("LABEL", label),
        };
        let answer = ask(addr, &format!("POST {path}"), "", &body);
        assert_eq!(answer.status, 200, "{request}: {}", answer.text());
        rig.cue();
    }

    rig.tick(2.0);
    let start = Instant::now();
    let state = loop {
        let state = get(addr, "/api/state").json();
        if state["time"] == 2.0 {
            break state;
        }
        assert!(start.elapsed() < WAIT_MAX, "{state}");
    };
    assert!(state["bpm"].as_f64().unwrap() > 0.0 && state["warnings"] == json!([]));
    assert!(
        state["clip"].is_string() && state.get("poses").is_none(),
        "{state}"
    );
}

#[test]
#[serial]
fn a_token_gives_its_right_and_no_more() {
    let settings = Settings {
        token: "configure-token".into(),
        play_token: "play-token".into(),
        view_token: "view-token".into(),
        ..any_port()
    };
    let rig = Rig::serving(&settings, puppet::JOINT_COUNT);
    let addr = rig.page.local_addr();
    assert_eq!(get(addr, "/api/state").status, 401);
    assert_eq!(post(addr, "panic", "", "").status, 401);
    // For each token: the statuses of a cue and of a setting. This show has no sound device, so the
    // setting itself is refused (422) after the right was granted.
    for (right, cue, setting) in [
        ("view", 403, 403),
        ("play", 200, 403),
        ("configure", 200, 422),
    ] {
        let bearer = format!("Authorization: Bearer {right}-token\r\n");
        let about = get(addr, &format!("/api?token={right}-token")).json();
        assert_eq!(about["right"], right);
        assert_eq!(ask(addr, "GET /api/state", &bearer, "").status, 200);
        assert_eq!(post(addr, "panic", &bearer, "").status, cue, "{right}");
        let latency = post(addr, "input_latency", &bearer, r#"{"value":29}"#);
        assert_eq!(latency.status, setting, "{right}: {}", latency.text());
    }
    assert_eq!(
        (rig.cue(), rig.cue()),
        (DanceCommand::Panic.into(), DanceCommand::Panic.into())
    );
    // Pages of other sites are refused with any token.
    let evil = "Authorization: Bearer configure-token\r\nOrigin: http://evil.example\r\n";
    assert_eq!(post(addr, "panic", evil, "").status, 403);
    assert_eq!(rig.cues.pop(), None);
}

#[test]
#[serial]
fn refused_requests_say_why_and_send_nothing() {
    let rig = Rig::new();
    let addr = rig.page.local_addr();
    let long = format!(r#"{{"label":"{}"}}"#, "x".repeat(MESSAGE_BYTES_MAX));
    for (name, body, status, text) in [
        (
            "cue",
            r#"{"label":"no such"}"#,
            422,
            "there is no label `no such`",
        ),
        ("cue", r#"{"label":"pop","beats":0}"#, 422, "1 to 1024"),
        ("cue", r#"{"label":"pop","bars":1}"#, 422, "unknown field"),
        ("cue", "{}", 422, r#"has no "label""#),
        ("intensity", r#"{"value":7}"#, 422, "0 to 1"),
        ("tempo", r#"{"value":"faster"}"#, 422, "faster"),
        ("record", r#"{"label":"mine"}"#, 422, "take"),
        ("panic", "[]", 400, "not a JSON object"),
        ("nothing", "", 404, "GET /api lists all requests"),
        ("cue", &long, 413, ""),
    ] {
        let answer = post(addr, name, "", body);
        assert_eq!(answer.status, status, "{name} {body}: {}", answer.text());
        let message = if status == 413 {
            answer.text()
        } else {
            answer.json()["message"].to_string()
        };
        assert!(message.replace('\\', "").contains(text), "{message}");
    }
    assert_eq!(get(addr, "/api/panic").status, 405);
    assert_eq!(get(addr, "/api/events?hz=1000").status, 422);
    assert_eq!(rig.cues.pop(), None);
    assert!(rig.faults.of(Fault::BadPage) >= 4 && rig.faults.of(Fault::UnknownLabel) == 1);
}

#[test]
#[serial]
fn a_flood_of_requests_is_slowed() {
    let rig = Rig::new();
    let addr = rig.page.local_addr();
    let stream = TcpStream::connect(addr).unwrap();
    stream.set_read_timeout(Some(WAIT_MAX)).unwrap();
    let start = Instant::now();
    let requests = 4 * MESSAGES_HZ_MAX as usize;
    let request =
        format!("POST /api/release HTTP/1.1\r\nHost: {addr}\r\nContent-Length: 0\r\n\r\n");
    let mut writer = stream.try_clone().unwrap();
    let sender = std::thread::spawn(move || {
        writer
            .write_all(request.repeat(requests).as_bytes())
            .unwrap();
    });
    let mut reader = BufReader::new(&stream);
    let (mut done, mut slowed) = (0, 0);
    let mut line = String::new();
    while done + slowed < requests {
        line.clear();
        assert!(
            reader.read_line(&mut line).unwrap() > 0,
            "{done} + {slowed}"
        );
        done += usize::from(line.contains("HTTP/1.1 200"));
        slowed += usize::from(line.contains("HTTP/1.1 429"));
    }
    sender.join().unwrap();
    let allowed = f64::from(MESSAGES_HZ_MAX) * (1.0 + start.elapsed().as_secs_f64()) + 1.0;
    assert!(
        done as f64 <= allowed,
        "{done} of {requests}, {allowed} allowed"
    );
    assert!(done >= MESSAGES_HZ_MAX as usize, "{done}");
}

#[test]
#[serial]
fn events_tell_states_and_beats_until_the_show_ends() {
    let mut rig = Rig::new();
    let addr = rig.page.local_addr();
    let mut stream = TcpStream::connect(addr).unwrap();
    stream.set_read_timeout(Some(WAIT_MAX)).unwrap();
    write!(
        stream,
        "GET /api/events?hz=30 HTTP/1.1\r\nHost: {addr}\r\n\r\n"
    )
    .unwrap();
    let mut reader = BufReader::new(stream);
    let mut time = 0.0;
    let mut next = |rig: &mut Rig, kind: &str| loop {
        // The simulated show goes on while the client waits.
        time += 0.02;
        rig.tick(time);
        let mut line = String::new();
        assert!(reader.read_line(&mut line).unwrap() > 0);
        if line.trim_end() == format!("event: {kind}") {
            line.clear();
            reader.read_line(&mut line).unwrap();
            let data = line.strip_prefix("data: ").unwrap();
            return serde_json::from_str::<Value>(data).unwrap();
        }
    };
    let first = next(&mut rig, "state");
    let beat = next(&mut rig, "beat");
    let later = next(&mut rig, "beat");
    assert_eq!(
        later["beat"].as_i64(),
        beat["beat"].as_i64().map(|beat| beat + 1)
    );
    assert!(next(&mut rig, "state")["time"].as_f64() > first["time"].as_f64());
    drop(rig);
    let mut rest = Vec::new();
    // The end of the show ends the response, or the connection.
    let _ = reader.read_to_end(&mut rest);
}
