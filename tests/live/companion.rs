//! Test of the Bitfocus Companion module (`integrations/companion`) against a running show: node
//! plays the part of Companion.
#![allow(clippy::unwrap_used)]

use std::process::Command;

use serial_test::serial;

use crate::common::browser;
use crate::common::program::{FAREWELL, Program};

const MODULE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/integrations/companion");

#[test]
#[serial]
fn companion_controls_a_show_and_shows_its_state() {
    let test = "companion_controls_a_show_and_shows_its_state";
    if browser::lacks_node_in(test, MODULE) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let show = folder.path().join("show.toml");
    let sections = [
        "[osc]\nlisten = \"127.0.0.1:0\"",
        "[page]\nlisten = \"127.0.0.1:0\"",
        "[tempo]\nsource = \"fixed\"",
        "[[output]]\nto = \"127.0.0.1:9\"",
        "[[scene]]\nname = \"calm\"\nintensity = 0.3",
        "[[song]]\ntitle = \"Opening\"\n[[song]]\ntitle = \"Ballad\"",
    ];
    std::fs::write(&show, sections.join("\n")).unwrap();
    let mut program = Program::start(["run".as_ref(), show.as_os_str()]);
    let page = program.listening("page").to_string();
    let tested = Command::new("npm")
        .args(["test", "--silent"])
        .env("CORYBANT_PAGE", page)
        .current_dir(MODULE)
        .output()
        .unwrap();
    println!(
        "{}{}",
        String::from_utf8_lossy(&tested.stdout),
        String::from_utf8_lossy(&tested.stderr)
    );
    assert!(tested.status.success());
    program.signal("INT");
    assert!(program.ends_well() < FAREWELL);
}
