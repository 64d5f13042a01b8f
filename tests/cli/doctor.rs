//! Tests of `corybant doctor`: it always prints its page, within its time, and without what
//! identifies a person or a computer.

use std::net::UdpSocket;
use std::path::Path;
use std::process::Command;

use crate::common::program::corybant;

/// A user name that is no other word.
const USER: &str = "anneliese-secret";

/// Runs `corybant doctor` with `arguments` for the user [`USER`] with the home folder `home`. Returns
/// its page.
fn page(home: &Path, arguments: &[&str], change: impl FnOnce(&mut Command)) -> String {
    let mut command = corybant();
    command.arg("doctor").args(arguments);
    command.env("HOME", home).env("USERPROFILE", home);
    for name in ["USER", "LOGNAME", "USERNAME"] {
        command.env(name, USER);
    }
    change(&mut command);
    let output = command.output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{}: {text}", output.status);
    text
}

/// Returns true if `text` has `word` as a whole word.
fn has_word(text: &str, word: &str) -> bool {
    text.split(|c: char| !c.is_alphanumeric() && c != '-')
        .any(|found| found.eq_ignore_ascii_case(word))
}

#[test]
fn the_page_has_every_part_and_no_names() {
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path().join(USER);
    std::fs::create_dir(&home).unwrap();
    let show = home.join("show.toml");
    let settings = format!("[osc]\nfeedback = [\"{USER}.local\", \"192.0.2.7\"]\n");
    std::fs::write(&show, settings).unwrap();
    let text = page(&home, &[show.to_str().unwrap()], |_| ());
    for part in [
        "Corybant",
        "Timing",
        "System",
        "Video",
        "Audio: ",
        "Audio inputs of a show",
        "MIDI ports",
        "Permissions",
        "Ports",
        "Show file",
        "version",
        "features",
        "kernel",
        "processor",
        "locale",
        "timers",
        "renderer",
        "ffmpeg",
        "OSC",
        "page",
        "VMC",
    ] {
        assert!(text.contains(part), "no {part}: {text}");
    }
    let version = env!("CARGO_PKG_VERSION");
    assert!(text.contains(version), "{text}");
    assert!(
        text.contains("  ! ~"),
        "the show file has a problem: {text}"
    );
    assert!(text.contains("holds \"[user].local\""), "{text}");
    let host = gethostname::gethostname().into_string().unwrap();
    for secret in [USER, home.to_str().unwrap(), "192.0.2.7"] {
        assert!(!text.contains(secret), "{secret}: {text}");
    }
    assert!(!has_word(&text, &host), "{host}: {text}");
    let last = text.lines().last().unwrap();
    assert!(last.ends_with("marked with \"!\"."), "{last}");
}

#[test]
fn a_missing_show_file_is_a_problem_on_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("nowhere.toml");
    let text = page(folder.path(), &[missing.to_str().unwrap()], |_| ());
    assert!(text.contains("! cannot read ~"), "{text}");
}

#[test]
fn the_program_on_a_port_of_the_show_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let number = taken.local_addr().unwrap().port();
    let show = folder.path().join("show.toml");
    let text =
        format!("[osc]\nlisten = \"127.0.0.1:{number}\"\n[page]\nlisten = \"127.0.0.1:0\"\n");
    std::fs::write(&show, text).unwrap();
    let text = page(folder.path(), &[show.to_str().unwrap()], |_| ());
    let line = text
        .lines()
        .find(|line| line.contains(&number.to_string()))
        .unwrap();
    assert!(line.contains("cannot listen on UDP port"), "{line}");
    assert!(line.contains("set osc.listen to another port"), "{line}");
    // The tests run in the program `cli-…`.
    assert!(line.contains("(cli") && line.contains("uses it)"), "{line}");
}

#[test]
#[cfg(all(target_os = "linux", feature = "pipewire"))]
fn a_sound_server_that_hangs_does_not_stop_the_page() {
    use std::os::unix::net::UnixListener;
    use std::time::{Duration, Instant};
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("pulse")).unwrap();
    // The system accepts the connections, and nobody answers.
    let _servers = ["pipewire-0", "pulse/native"]
        .map(|socket| UnixListener::bind(folder.path().join(socket)).unwrap());
    let start = Instant::now();
    let text = page(folder.path(), &[], |command| {
        command.env("XDG_RUNTIME_DIR", folder.path());
    });
    assert!(
        start.elapsed() < Duration::from_secs(30),
        "{:?}",
        start.elapsed()
    );
    assert!(text.contains("! no answer within"), "{text}");
    for part in ["Audio: PipeWire", "Audio: PulseAudio", "MIDI ports", "VMC"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}
