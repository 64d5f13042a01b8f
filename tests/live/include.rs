//! Test of a running show whose show file includes another file: an edit of the included file is
//! applied, a wrong one is reported with its file and line, and the page saves into it.
#![allow(clippy::unwrap_used)]

use serde_json::json;
use serial_test::serial;

use crate::common::program::{FAREWELL, Program};
use crate::reload::Page;

#[test]
#[serial]
fn edits_of_an_included_file_are_applied() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let write = |name: &str, text: &str| std::fs::write(at(name), text).unwrap();
    write(
        "show.toml",
        "include = [\"outputs.toml\"]\n[osc]\nlisten = \"127.0.0.1:0\"\n[page]\nlisten = \"127.0.0.1:0\"\n[tempo]\nsource = \"fixed\"\n",
    );
    write(
        "outputs.toml",
        "# the outputs\n[[output]]\nto = \"127.0.0.1:9\"\nrate_hz = 60\n",
    );
    let mut program = Program::start(["run".as_ref(), at("show.toml").as_os_str()]);
    let mut page = Page::open(program.listening("page"));
    page.next("vitals", |it| it["outputs"][0]["kind"] == "vmc");
    write(
        "outputs.toml",
        "# the outputs\n[[output]]\nto = \"127.0.0.1:9\"\nrate_hz = 0\n",
    );
    page.warns("outputs.toml:4: output 1.rate_hz is 0");
    write(
        "outputs.toml",
        "# the outputs\n[[output]]\nto = \"127.0.0.1:9\"\nkind = \"plain\"\n",
    );
    program.until("the edit", |program| {
        program
            .log
            .text()
            .contains("taken over: output")
            .then_some(())
    });
    page.next("vitals", |it| it["outputs"][0]["kind"] == "plain");
    page.send(&json!({ "offset": { "output": 0, "ms": 40 } }));
    page.send(&json!({ "keep": true }));
    page.next("kept", |_| true);
    let saved = std::fs::read_to_string(at("outputs.toml")).unwrap();
    assert!(
        saved.starts_with("# the outputs\n") && saved.contains("offset_ms = 40"),
        "{saved}"
    );
    let main = std::fs::read_to_string(at("show.toml")).unwrap();
    assert!(!main.contains("offset_ms"), "{main}");
    program.signal("INT");
    assert!(program.ends_well() < FAREWELL);
}
