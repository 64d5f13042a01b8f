//! Tests of the commands that make files for packages: manual pages and completions.

use std::process::Command;

use crate::common::program;

use program::{corybant, ran};

#[test]
fn manual_pages_are_written_to_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let done = corybant().arg("man").arg(folder.path()).output().unwrap();
    assert!(done.status.success(), "{done:?}");
    for page in ["corybant", "corybant-run", "corybant-bench-tick"] {
        let text = std::fs::read_to_string(folder.path().join(format!("{page}.1"))).unwrap();
        let title = format!(".TH {page} 1 ");
        assert!(text.contains(&title), "{page}:\n{text}");
    }
    let printed = ran(["man"]).stdout;
    let written = std::fs::read(folder.path().join("corybant.1")).unwrap();
    assert_eq!(printed, written);
}

#[test]
fn manual_pages_need_a_folder_that_exists() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("man");
    let done = corybant().arg("man").arg(&missing).output().unwrap();
    assert_eq!(done.status.code(), Some(1));
    let said = String::from_utf8(done.stderr).unwrap();
    assert!(said.contains("its folder does not exist"), "{said}");
}

#[test]
#[cfg(unix)]
fn bash_completes_commands_and_options() {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("corybant");
    std::fs::write(&script, ran(["completions", "bash"]).stdout).unwrap();
    let completed = |words: &str| {
        let ask = format!(
            "source \"$0\"; COMP_WORDS=(corybant {words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); \
             _corybant corybant \"${{COMP_WORDS[COMP_CWORD]}}\" \"${{COMP_WORDS[COMP_CWORD - 1]}}\"; \
             echo \"${{COMPREPLY[@]}}\""
        );
        let done = Command::new("bash")
            .args(["--norc", "-c", &ask])
            .arg(&script)
            .output()
            .unwrap();
        assert!(done.stderr.is_empty(), "{done:?}");
        String::from_utf8(done.stdout).unwrap().trim().to_owned()
    };
    assert_eq!(completed("rep"), "replay");
    assert_eq!(completed("run --rec"), "--record-cues --record");
}
