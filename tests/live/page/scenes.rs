//! Test of the scenes on the page, in headless Chromium (`tests/browser/scenes.mjs`).

use serial_test::serial;

use super::browser::drive;
use crate::common::program::FAREWELL;
use crate::scenes::start;

#[test]
#[serial]
fn a_performer_recalls_scenes_on_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let mut programs = Vec::new();
    let url = || {
        let mut program = start(folder.path());
        let page = program.listening("page");
        programs.push(program);
        format!("http://{page}/")
    };
    drive("a_performer_recalls_scenes_on_the_page", "scenes.mjs", url);
    for program in programs {
        program.signal("INT");
        assert!(program.ends_well() < FAREWELL);
    }
}
