//! Finds the browser for the tests that need one, and Node.
#![allow(dead_code, reason = "each test file uses its part")]

use std::path::Path;
use std::process::Command;

/// The folder of the browser scripts.
pub const SCRIPTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/browser");

/// Returns a description of what is missing to run a browser; `None` if nothing is missing.
fn missing() -> Option<String> {
    let chromium = std::env::var("CHROMIUM").unwrap_or_else(|_| "/usr/bin/chromium".into());
    if !Path::new(&chromium).exists() {
        return Some(format!("{chromium} is absent"));
    }
    missing_node()
}

/// Returns a description of what is missing to run the scripts in Node without a browser; `None` if
/// nothing is missing.
fn missing_node() -> Option<String> {
    missing_node_in(SCRIPTS)
}

/// Returns a description of what is missing to run Node in `folder`, a folder of this repository with a
/// `package.json`; `None` if nothing is missing.
fn missing_node_in(folder: &str) -> Option<String> {
    if !Path::new(folder).join("node_modules").exists() {
        return Some(format!(
            "{folder}/node_modules is absent; run `npm ci` there"
        ));
    }
    Command::new("node")
        .arg("--version")
        .output()
        .err()
        .map(|error| format!("node does not run: {error}"))
}

/// Writes a small VRM 1.0 avatar to `path`, with the writer of the browser tests.
pub fn write_avatar(path: &Path) {
    let script = "import { writeVrm } from './vrm_writer.mjs'; import { writeFileSync } from 'node:fs'; \
        writeFileSync(process.argv[1], writeVrm(1));";
    let mut node = Command::new("node");
    node.args(["--input-type=module", "-e", script]).arg(path);
    let status = node.current_dir(SCRIPTS).status().unwrap();
    assert!(status.success(), "{status}");
}

/// Returns true and prints a message if the test named `test` cannot run a browser. Panics instead
/// if `CORYBANT_REQUIRE_BROWSER` is set.
pub fn is_missing(test: &str) -> bool {
    said(test, missing())
}

/// Returns true and prints a message if the test named `test` cannot run scripts in Node. Panics
/// instead if `CORYBANT_REQUIRE_BROWSER` is set.
pub fn lacks_node(test: &str) -> bool {
    said(test, missing_node())
}

/// Like [`lacks_node`], for the Node packages of `folder`.
pub fn lacks_node_in(test: &str, folder: &str) -> bool {
    said(test, missing_node_in(folder))
}

fn said(test: &str, missing: Option<String>) -> bool {
    if let Some(what) = &missing {
        assert!(
            std::env::var_os("CORYBANT_REQUIRE_BROWSER").is_none(),
            "{what}"
        );
        super::shared::log_skip(test, what);
    }
    missing.is_some()
}
