//! Test of takes on the page, in headless Chromium (`tests/browser/takes.mjs`): a performer who sends
//! VMC is recorded, danced, renamed and undone, also after the page was loaded again.
#![allow(clippy::unwrap_used)]

use std::net::UdpSocket;

use rosc::OscType;
use serial_test::serial;

use super::browser::drive;
use crate::common::program::FAREWELL;
use crate::takes::{send, show};

#[test]
#[serial]
fn a_performer_records_takes_on_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let mut programs = Vec::new();
    let url = || {
        // Two ports that were just free.
        let sockets = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
        let [input, nobody] = sockets.map(|socket| socket.local_addr().unwrap().to_string());
        let motion_in = format!("[[motion_in]]\nlisten = \"{input}\"\n");
        let mut second = show(folder.path(), "second.toml", &[nobody], &motion_in);
        let page = second.listening("page");
        let mut first = show(folder.path(), "first.toml", &[input], "");
        let gate = vec![OscType::Float(1.0)];
        send(first.listening("osc"), "/cue/salsa/gate", gate);
        programs.extend([first, second]);
        format!("http://{page}/")
    };
    drive("a_performer_records_takes_on_the_page", "takes.mjs", url);
    for program in programs {
        program.signal("INT");
        assert!(program.ends_well() < FAREWELL);
    }
}
