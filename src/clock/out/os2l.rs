//! The beat for lighting programs by Open Sound to Light (OS2L). In: beats. Out: one JSON message for
//! each beat, over TCP. Thread: "clock"; a connection attempt waits at most 300 ms, a message 20 ms.
//! Allocates: for each message. Source: os2l.org.
//!
//! The lighting program is the server and announces the service `_os2l._tcp` by multicast DNS; the
//! program with the sound connects to it, as VirtualDJ does. What the lighting program sends back is
//! read and ignored.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use mdns_sd::{Receiver, ServiceDaemon, ServiceEvent};
use serde::Serialize;
use tracing::info;

/// Multicast DNS service type of OS2L.
const SERVICE: &str = "_os2l._tcp.local.";
/// Longest time for a connection attempt.
const CONNECT_MAX: Duration = Duration::from_millis(300);
/// Longest time for a message. A lighting program that reads nothing for so long is disconnected.
const WRITE_MAX: Duration = Duration::from_millis(20);
/// Time from one connection attempt to the next.
const RETRY: Duration = Duration::from_secs(3);
/// Greatest number of bytes that are read and ignored after each beat.
const READ_MAX: usize = 4096;

/// A message about a beat.
#[derive(Serialize)]
struct BeatMessage {
    evt: &'static str,
    /// True on the first beat after a start or a jump of the beats.
    change: bool,
    /// Number of the beat since the start of the show.
    pos: i64,
    bpm: f64,
    /// 1 on the first beat of a bar, otherwise 0.5.
    strength: f64,
}

/// A beat that a lighting program gets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Os2lBeat {
    /// Number of the beat.
    pub(super) number: i64,
    /// Tempo, in beats per minute.
    pub(super) bpm: f64,
    /// True on the first beat of a bar.
    pub(super) is_bar: bool,
}

/// The search for a lighting program on the network; it ends when the value is dropped.
struct Search {
    daemon: ServiceDaemon,
    events: Receiver<ServiceEvent>,
}

impl Drop for Search {
    fn drop(&mut self) {
        // The daemon ends with the program if it does not end now.
        let _ = self.daemon.shutdown();
    }
}

/// A connection to a lighting program, which is opened again if it is lost.
pub(super) struct Os2lClient {
    /// Network address of the lighting program; `None` until the search has found one.
    server: Option<SocketAddr>,
    search: Option<Search>,
    stream: Option<TcpStream>,
    /// Time of the next connection attempt.
    next_attempt: Instant,
    /// Number of the last beat that was sent on this connection.
    last: Option<i64>,
}

impl Os2lClient {
    /// Creates a client of the lighting program at `server`; `None` looks for one by multicast DNS.
    /// The program may start later.
    ///
    /// # Errors
    /// The search cannot be started.
    pub(super) fn new(server: Option<SocketAddr>) -> io::Result<Self> {
        let search = match server {
            Some(_) => None,
            None => Some(search().map_err(io::Error::other)?),
        };
        Ok(Self {
            server,
            search,
            stream: None,
            next_attempt: Instant::now(),
            last: None,
        })
    }

    /// Sends a beat. Returns false if it could not be sent on an open connection; without a
    /// connection nothing is sent and the result is true.
    pub(super) fn send(&mut self, beat: Os2lBeat) -> bool {
        self.connect();
        let Some(stream) = &mut self.stream else {
            return true;
        };
        let message = BeatMessage {
            evt: "beat",
            change: self.last != Some(beat.number - 1),
            pos: beat.number,
            bpm: (beat.bpm * 100.0).round() / 100.0,
            strength: if beat.is_bar { 1.0 } else { 0.5 },
        };
        let mut text = serde_json::to_string(&message).unwrap_or_default();
        text.push('\n');
        let is_sent = stream.write_all(text.as_bytes()).is_ok() && is_open(stream);
        if is_sent {
            self.last = Some(beat.number);
        } else {
            info!("clock_out: the OS2L program has closed the connection");
            self.stream = None;
        }
        is_sent
    }

    /// Connects if there is no connection and the time for an attempt has come.
    fn connect(&mut self) {
        if let Some(found) = self
            .search
            .as_ref()
            .and_then(|search| found(&search.events))
        {
            self.server = Some(found);
        }
        let now = Instant::now();
        let Some(server) = self.server else { return };
        if self.stream.is_some() || now < self.next_attempt {
            return;
        }
        self.next_attempt = now + RETRY;
        self.stream = TcpStream::connect_timeout(&server, CONNECT_MAX)
            .and_then(|stream| {
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(WRITE_MAX))?;
                Ok(stream)
            })
            .ok();
        if self.stream.is_some() {
            info!("clock_out: connected to the OS2L program at {server}");
            self.last = None;
        }
    }
}

fn search() -> Result<Search, mdns_sd::Error> {
    let daemon = ServiceDaemon::new()?;
    let events = daemon.browse(SERVICE)?;
    Ok(Search { daemon, events })
}

/// Returns the address of the program that was announced last among the waiting events; `None` if
/// there is none. IPv4 comes first.
fn found(events: &Receiver<ServiceEvent>) -> Option<SocketAddr> {
    let mut server = None;
    while let Ok(event) = events.try_recv() {
        if let ServiceEvent::ServiceResolved(service) = event {
            let mut addresses: Vec<_> =
                service.addresses.iter().map(|ip| ip.to_ip_addr()).collect();
            addresses.sort_by_key(|ip| (ip.is_ipv6(), *ip));
            server = addresses
                .first()
                .map(|ip| SocketAddr::new(*ip, service.port))
                .or(server);
        }
    }
    server
}

/// Reads and ignores what the lighting program has sent. Returns false if it has closed the
/// connection.
fn is_open(stream: &mut TcpStream) -> bool {
    let mut buffer = [0; READ_MAX];
    if stream.set_nonblocking(true).is_err() {
        return false;
    }
    let read = stream.read(&mut buffer);
    let is_blocking = stream.set_nonblocking(false).is_ok();
    is_blocking
        && match read {
            Ok(length) => length > 0,
            Err(error) => error.kind() == ErrorKind::WouldBlock,
        }
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead, BufReader};
    use std::net::TcpListener;

    use super::*;

    fn beat(number: i64) -> Os2lBeat {
        Os2lBeat {
            number,
            bpm: 126.204,
            is_bar: number % 4 == 0,
        }
    }

    #[test]
    fn a_lighting_program_reads_one_json_message_for_each_beat() {
        let server = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut client = Os2lClient::new(server.local_addr().ok()).unwrap();
        for number in [8, 9, 11] {
            assert!(client.send(beat(number)));
        }
        let (stream, _) = server.accept().unwrap();
        // What a lighting program sends back does no harm.
        (&stream).write_all(b"{\"evt\":\"feedback\"}").unwrap();
        assert!(client.send(beat(12)));
        let lines = BufReader::new(stream).lines().take(4);
        let read: Vec<serde_json::Value> = lines
            .map(|line| serde_json::from_str(&line.unwrap()).unwrap())
            .collect();
        let expected = |pos: i64, change: bool, strength: f64| serde_json::json!({ "evt": "beat", "change": change, "pos": pos, "bpm": 126.2, "strength": strength });
        assert_eq!(
            read,
            [
                expected(8, true, 1.0),
                expected(9, false, 0.5),
                expected(11, true, 0.5),
                expected(12, false, 1.0)
            ]
        );
    }

    #[test]
    fn a_lost_connection_is_opened_again() {
        let server = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut client = Os2lClient::new(server.local_addr().ok()).unwrap();
        assert!(client.send(beat(1)));
        drop(server.accept().unwrap());
        let mut number = 2;
        while client.send(beat(number)) {
            number += 1;
        }
        assert!(
            client.send(beat(50)),
            "nothing is sent before the next attempt"
        );
        client.next_attempt = Instant::now();
        assert!(client.send(beat(51)));
        let (stream, _) = server.accept().unwrap();
        let mut line = String::new();
        BufReader::new(stream).read_line(&mut line).unwrap();
        assert!(line.contains("\"change\":true,\"pos\":51"), "{line}");
    }

    #[test]
    fn without_a_program_nothing_fails() {
        let port = TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap();
        let mut client = Os2lClient::new(Some(port)).unwrap();
        assert!(client.send(beat(1)) && client.send(beat(2)));
    }
}
