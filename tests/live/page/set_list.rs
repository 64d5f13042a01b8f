//! Test of the page of the set list, in headless Chromium (`tests/browser/set_list.mjs`): three songs are
//! played through by GO on a phone's size.
#![allow(clippy::unwrap_used)]

use serial_test::serial;

use super::browser::drive;
use crate::common::program::{FAREWELL, Program};
use crate::songs::write_show;

#[test]
#[serial]
fn three_songs_are_played_through_by_go_on_a_phone() {
    let folder = tempfile::tempdir().unwrap();
    write_show(folder.path());
    let mut programs = Vec::new();
    let url = || {
        let mut program = Program::start(["run".into(), folder.path().join("show.toml")]);
        let page = program.listening("page");
        programs.push(program);
        format!("http://{page}/set")
    };
    drive(
        "three_songs_are_played_through_by_go_on_a_phone",
        "set_list.mjs",
        url,
    );
    for program in programs {
        program.signal("INT");
        assert!(program.ends_well() < FAREWELL);
    }
}
