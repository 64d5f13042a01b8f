//! A page of a simulated show, and a client of it.

#![allow(clippy::unwrap_used)]

use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

use corybant::rt::cue_queue::CueQueue;
use corybant::web::{About, Page, Settings, Snapshot, WebContext, serve};
use corybant_core::cue::Cue;
use corybant_core::fault::Faults;
use serde_json::Value;
use tungstenite::client::IntoClientRequest;
use tungstenite::handshake::HandshakeError;
use tungstenite::{Message, WebSocket};

use crate::common::puppet;

/// The longest wait for an event. It is enough for a busy machine; only a failing test waits this
/// long.
pub const WAIT_MAX: Duration = Duration::from_secs(20);

/// A page whose show is simulated.
pub struct Rig {
    pub page: Page,
    pub input: triple_buffer::Input<Snapshot>,
    pub puppet: puppet::Puppet,
    pub cues: CueQueue,
    pub faults: Arc<Faults>,
}

impl Rig {
    pub fn new() -> Self {
        Self::with_joints(puppet::JOINT_COUNT)
    }

    pub fn with_joints(joints: usize) -> Self {
        Self::serving(&any_port(), joints)
    }

    pub fn serving(settings: &Settings, joints: usize) -> Self {
        let faults = Arc::new(Faults::default());
        let cues = CueQueue::new(8, Arc::clone(&faults));
        let (input, output) = Snapshot::channel(&[joints]);
        let page = serve(
            settings,
            About {
                scenes: vec!["SCENE".into()],
                ..puppet::about()
            },
            output,
            WebContext::minimal(cues.clone(), Arc::clone(&faults)),
        )
        .unwrap();
        Self {
            page,
            input,
            puppet: puppet::Puppet::default(),
            cues,
            faults,
        }
    }

    /// Moves the simulated show to the time `time` (seconds) without a cue.
    pub fn tick(&mut self, time: f64) {
        let quiet = CueQueue::new(1, Arc::default());
        self.puppet
            .tick(time, &quiet, self.input.input_buffer_mut());
        self.input.publish();
    }

    pub fn client(&self) -> Client {
        Client::new(self.page.local_addr())
    }

    /// Waits for the next cue in the queue and returns it.
    pub fn cue(&self) -> Cue {
        let start = Instant::now();
        loop {
            if let Some(cue) = self.cues.pop() {
                return cue;
            }
            assert!(start.elapsed() < WAIT_MAX, "no cue came");
            std::thread::yield_now();
        }
    }
}

/// Settings of a page on any free port of this machine.
pub fn any_port() -> Settings {
    Settings {
        listen: "127.0.0.1:0".into(),
        ..Settings::default()
    }
}

/// A client of the page.
pub struct Client(pub WebSocket<TcpStream>);

impl Client {
    pub fn new(addr: SocketAddr) -> Self {
        Self(connect(addr, &[]).unwrap())
    }

    pub fn send(&mut self, text: &str) {
        self.0.send(Message::text(text)).unwrap();
    }

    /// Returns the next message of the type `kind`; ignores others.
    pub fn receive(&mut self, kind: &str) -> Value {
        loop {
            let Message::Text(text) = self.0.read().unwrap() else {
                continue;
            };
            let json: Value = serde_json::from_str(&text).unwrap();
            if json["type"] == kind {
                return json;
            }
        }
    }

    /// Returns the state at the show time `t` (seconds); ignores earlier states.
    pub fn state_at(&mut self, t: f64) -> Value {
        loop {
            let state = self.receive("state");
            if state["t"] == t {
                return state;
            }
        }
    }
}

/// Opens the page's WebSocket with the HTTP headers `headers`. Returns the HTTP status code as the
/// error if the server refuses it.
pub fn connect(
    addr: SocketAddr,
    headers: &[(&'static str, &str)],
) -> Result<WebSocket<TcpStream>, u16> {
    let mut request = format!("ws://{addr}/live").into_client_request().unwrap();
    for (name, value) in headers {
        request.headers_mut().insert(*name, value.parse().unwrap());
    }
    let stream = TcpStream::connect(addr).unwrap();
    stream.set_read_timeout(Some(WAIT_MAX)).unwrap();
    match tungstenite::client(request, stream) {
        Ok((socket, _)) => Ok(socket),
        Err(HandshakeError::Failure(tungstenite::Error::Http(response))) => {
            Err(response.status().as_u16())
        }
        Err(error) => panic!("{error}"),
    }
}
