//! Tests of `corybant` without a command: it opens its page in the browser, the page sets up the show
//! (`tests/browser/start.mjs`), and the saved show gives the same show.
//!
//! The browser is a program `xdg-open` in `PATH` that writes down the link. Sound comes from a real
//! PipeWire server.

use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use serial_test::serial;
use tempfile::TempDir;

use crate::ROOT;
use crate::common::browser::{self, SCRIPTS};
use crate::common::http::{ask, get};
use crate::common::jack::in_child;
use crate::common::pipewire::{PipewireServer, folder};
use crate::common::program::{FAREWELL, Program, corybant, patiently};

/// A user's desktop: a home folder, a browser that writes down links, a free port for the page.
struct Desktop {
    home: TempDir,
    page: SocketAddr,
}

impl Desktop {
    fn new() -> Self {
        let home = tempfile::tempdir().unwrap();
        let browser = home.path().join("xdg-open");
        let opened = home.path().join("opened");
        let script = format!("#!/bin/sh\necho \"$1\" >> '{}'\n", opened.display());
        std::fs::write(&browser, script).unwrap();
        std::fs::set_permissions(&browser, std::fs::Permissions::from_mode(0o755)).unwrap();
        let page = TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap();
        Self { home, page }
    }

    /// Returns a command that runs the program on this desktop.
    fn corybant(&self) -> Command {
        let mut command = corybant();
        let path = std::env::var("PATH").unwrap();
        command
            .env("PATH", format!("{}:{path}", self.home.path().display()))
            .env("HOME", self.home.path())
            .env("DISPLAY", ":99")
            .env_remove("BROWSER")
            .env("CORYBANT_PAGE", self.page.to_string());
        command
    }

    /// Waits until the browser was opened `count` times, and returns the last link.
    fn opened(&self, count: usize) -> String {
        patiently("the browser", || {
            let text = std::fs::read_to_string(self.home.path().join("opened")).ok()?;
            text.lines().nth(count - 1).map(String::from)
        })
    }
}

/// Receives datagrams until `seconds` have passed without one, or `count` have arrived. Returns the
/// number of those that are poses of VMC.
fn poses(receiver: &UdpSocket, count: usize, seconds: u64) -> usize {
    receiver
        .set_read_timeout(Some(Duration::from_secs(seconds)))
        .unwrap();
    let mut datagram = [0; 65_536];
    let mut poses = 0;
    while poses < count
        && let Ok(n) = receiver.recv(&mut datagram)
    {
        let is_pose = datagram[..n]
            .windows(17)
            .any(|part| part == b"/VMC/Ext/Bone/Pos");
        poses += usize::from(is_pose);
    }
    poses
}

/// Empties the queue of `receiver`.
fn drain(receiver: &UdpSocket) {
    receiver.set_nonblocking(true).unwrap();
    while receiver.recv(&mut [0; 65_536]).is_ok() {}
    receiver.set_nonblocking(false).unwrap();
}

#[test]
#[serial]
fn a_show_is_set_up_on_the_page_and_saved() {
    const NAME: &str = "a_show_is_set_up_on_the_page_and_saved";
    if browser::is_missing(NAME) {
        return;
    }
    let sockets = folder(NAME);
    let variables = [("XDG_RUNTIME_DIR", sockets.to_str().unwrap())];
    in_child(NAME, &variables, || {
        let server = PipewireServer::start("room");
        server.add_sink("hall");
        let _playing = server.play(&Path::new(ROOT).join("tests/data/music/track.ogg"));
        set_up_and_run(&Desktop::new());
    });
    let _ = std::fs::remove_dir_all(sockets);
}

fn set_up_and_run(desktop: &Desktop) {
    let receiver = UdpSocket::bind("127.0.0.1:0").unwrap();
    let to = receiver.local_addr().unwrap();
    let begin = Instant::now();
    let program = Program::start_with(&mut desktop.corybant());
    let link = desktop.opened(1);
    println!(
        "the browser opens after {:.1} s",
        begin.elapsed().as_secs_f64()
    );
    assert!(
        program.out.text().contains("/?setup="),
        "the link for other browsers is printed"
    );
    assert!(
        !program.out.text().contains(&link),
        "the code is only for the opened browser"
    );
    let shows = desktop.home.path().join("shows");
    std::fs::create_dir(&shows).unwrap();
    let mut command = Command::new("node");
    command
        .arg("start.mjs")
        .arg(&link)
        .arg(Path::new(ROOT).join("tests/data/motion"));
    command
        .arg(to.port().to_string())
        .arg(&shows)
        .current_dir(SCRIPTS);
    if let Some(shots) = std::env::var_os("CORYBANT_SHOTS") {
        command.arg(shots);
    }
    let driven = command.output().unwrap();
    let said = String::from_utf8_lossy(&driven.stdout);
    println!("{said}{}", String::from_utf8_lossy(&driven.stderr));
    println!("{}", program.log.text());
    assert!(driven.status.success() && said.contains("all promises kept"));
    // The page has ended the program; a renderer has received poses until then.
    assert_eq!(poses(&receiver, 20, 1), 20);
    assert!(program.ends_well() < FAREWELL);
    drain(&receiver);

    let show = shows.join("club.toml");
    println!("{}", std::fs::read_to_string(&show).unwrap());
    let mut program = Program::start_with(desktop.corybant().arg("run").arg(&show));
    let labels = program.until("labels", |program| program.out.after("labels: "));
    assert_eq!(labels, "my twist, slow salsa");
    assert_eq!(poses(&receiver, 100, 10), 100, "{}", program.log.text());
    assert!(
        program
            .log
            .text()
            .contains("audio input: what this output plays: room")
    );
    program.signal("INT");
    assert!(program.ends_well() < FAREWELL);
}

#[test]
#[serial]
fn a_second_start_opens_the_page_of_the_first() {
    let desktop = Desktop::new();
    let mut first = Program::start_with(&mut desktop.corybant());
    let page = first.listening("page");
    let link = desktop.opened(1);
    let second = desktop.corybant().output().unwrap();
    let said = String::from_utf8_lossy(&second.stdout);
    assert!(
        second.status.success() && said.contains("runs already"),
        "{said}"
    );
    assert_eq!(desktop.opened(2), format!("http://{page}/"));
    assert!(first.runs());

    // Only the opened browser may set up the show, and its code works once.
    let path = link.strip_prefix(&format!("http://{page}")).unwrap();
    assert_eq!(get(page, "/setup/state").status, 403);
    let admitted = get(page, path);
    let cookie = admitted
        .header("set-cookie")
        .unwrap()
        .split(';')
        .next()
        .unwrap();
    assert_eq!(admitted.status, 303);
    assert!(get(page, path).header("set-cookie").is_none());
    let with = |headers: &str| format!("Cookie: {cookie}\r\n{headers}");
    let state = |headers: &str| ask(page, "GET /setup/state", headers, "");
    assert_eq!(state(&with("")).status, 200);
    assert_eq!(state(&with("Origin: http://evil.example\r\n")).status, 403);
    assert_eq!(state("Cookie: corybant-setup=x\r\n").status, 403);
    for (path, status) in [
        ("POST /setup/motions/..%2Fx/a.bvh", 422),
        ("POST /setup/motions/salsa/a.exe", 422),
        ("POST /setup/save", 422),
        ("POST /setup/nothing", 404),
    ] {
        let answer = ask(page, path, &with(""), r#"{"folder":"../x","name":"a"}"#);
        assert_eq!(answer.status, status, "{path}: {}", answer.text());
        assert_eq!(ask(page, path, "", "{}").status, 403, "{path}");
    }
    let large = ask(page, "POST /setup/input", &with(""), &" ".repeat(1 << 17));
    assert_eq!(large.status, 413);
    first.signal("INT");
    assert!(first.ends_well() < FAREWELL);
}

#[test]
#[serial]
fn a_port_of_another_program_and_a_missing_display_are_explained() {
    let desktop = Desktop::new();
    let other = TcpListener::bind(desktop.page).unwrap();
    let refused = desktop.corybant().output().unwrap();
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(
        said.contains("another program uses") && said.contains("CORYBANT_PAGE"),
        "{said}"
    );
    assert_eq!(refused.status.code(), Some(1));
    drop(other);
    let headless = desktop
        .corybant()
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&headless.stderr);
    assert!(
        said.contains("Usage: corybant") && said.contains("`corybant run`"),
        "{said}"
    );
    assert_eq!(
        (headless.status.code(), headless.stdout.len()),
        (Some(2), 0)
    );
    let opened: PathBuf = desktop.home.path().join("opened");
    assert!(!opened.exists());
}
