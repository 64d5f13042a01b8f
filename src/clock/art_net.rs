//! Art-Net timecode input. In: UDP datagrams. Out: readings of timecode for the show. Thread: its own,
//! "art-net", which ends when the [`ArtNetInput`] is dropped. Packets without timecode are ignored;
//! malformed ones are counted and, at most once a second, logged.

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::time::{Duration, Instant};

use thiserror::Error;
use tracing::warn;

use crate::osc::input::receive_error::ReceiveError;
use crate::rt::cue_queue::CueQueue;
use crate::rt::system::udp;
use crate::rt::worker::{StopSignal, Worker};
use corybant_core::fault::{Fault, Faults};
use corybant_core::time::Seconds;
use corybant_core::timecode::{Reading, art_net};

/// Longest time for which the thread waits for a datagram before it checks whether it must stop.
const RECEIVE_MAX: Duration = Duration::from_millis(100);
/// Pause after an error of the socket. A permanent error must not use a whole core.
const ERROR_PAUSE: Duration = Duration::from_millis(33);
/// Largest datagram that is read, in bytes; Art-Net has no longer packets.
const DATAGRAM_MAX: usize = 1_500;
/// Shortest time between two log lines about malformed packets.
const LOG_EVERY: Duration = Duration::from_secs(1);
/// Typical error of the arrival times of packets.
const JITTER: Seconds = Seconds(0.005);

/// The operating system refuses to receive Art-Net at a network address.
#[derive(Debug, Error)]
#[error(
    "cannot receive Art-Net timecode on {listen}: {source}; if another program has this port, stop it or give timecode.source another address, such as \"art-net:127.0.0.2\""
)]
pub struct ArtNetInputError {
    /// The network address, `HOST:PORT`.
    listen: String,
    /// The error that the operating system reported.
    source: io::Error,
}

/// A running Art-Net input; dropping the value stops it.
#[derive(Debug)]
pub struct ArtNetInput {
    local: SocketAddr,
    _worker: Worker,
}

impl ArtNetInput {
    /// Returns the network address at which packets are received; the port is never 0.
    pub fn local_addr(&self) -> SocketAddr {
        self.local
    }
}

/// Starts to receive Art-Net timecode at the network address `listen`, `HOST:PORT`. Readings go to
/// `queue`.
///
/// # Errors
/// [`ArtNetInputError`] if the system refuses the network address or the thread.
pub fn open(
    listen: &str,
    queue: CueQueue,
    faults: Arc<Faults>,
) -> Result<ArtNetInput, ArtNetInputError> {
    let error = |source| ArtNetInputError {
        listen: listen.into(),
        source,
    };
    let socket = udp::bind(listen).map_err(error)?;
    socket.set_read_timeout(Some(RECEIVE_MAX)).map_err(error)?;
    let local = socket.local_addr().map_err(error)?;
    let receiver = ArtNetReceiver {
        socket,
        queue,
        faults,
        logged: None,
    };
    let worker = Worker::start("art-net", move |stop| receiver.run(stop)).map_err(error)?;
    Ok(ArtNetInput {
        local,
        _worker: worker,
    })
}

/// The state of the thread that receives packets.
struct ArtNetReceiver {
    socket: UdpSocket,
    queue: CueQueue,
    faults: Arc<Faults>,
    /// Time of the last log line about a malformed packet.
    logged: Option<Instant>,
}

impl ArtNetReceiver {
    fn run(mut self, stop: &StopSignal) {
        // One byte more than the limit, to detect a longer datagram that was cut.
        let mut buffer = [0; DATAGRAM_MAX + 1];
        while !stop.is_set() {
            match self.socket.recv_from(&mut buffer) {
                Ok((length, from)) => self.process(&buffer[..length], from),
                Err(error) => match ReceiveError::of(&error) {
                    ReceiveError::Nothing => {}
                    ReceiveError::TooLong => self.faults.count(Fault::BadTimecode),
                    ReceiveError::Failed => std::thread::park_timeout(ERROR_PAUSE),
                },
            }
        }
    }

    fn process(&mut self, datagram: &[u8], from: SocketAddr) {
        let now = Instant::now();
        let place = match art_net::parse(datagram) {
            Ok(Some(place)) => place,
            Ok(None) => return,
            Err(error) => {
                self.faults.count(Fault::BadTimecode);
                if self.logged.is_none_or(|logged| now - logged >= LOG_EVERY) {
                    self.logged = Some(now);
                    warn!("ignored a datagram from {from}, which is no timecode: {error}");
                }
                return;
            }
        };
        // Before the start of the show there is nothing to lead.
        if let Some(at) = self.queue.clock().at(now) {
            self.queue.send_timecode(Reading {
                at,
                place,
                frame: None,
                jitter: JITTER,
                is_locate: false,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use corybant_core::timecode::Place;

    #[test]
    fn packets_become_readings_and_hostile_ones_are_counted() {
        let faults = Arc::new(Faults::default());
        let queue = CueQueue::new(16, faults.clone());
        queue.clock().start();
        let input = open("127.0.0.1:0", queue.clone(), faults.clone()).unwrap();
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        let send = |bytes: &[u8]| sender.send_to(bytes, input.local_addr()).unwrap();
        let good = *b"Art-Net\0\x00\x97\x00\x0e\0\0\x04\x03\x02\x01\x01";
        for bad in [&b"x"[..], &[0; 3_000], &good[..15]] {
            send(bad);
        }
        // Light levels on the same port are no fault.
        send(b"Art-Net\0\x00\x50\x00\x0e\0\0\0\0\0\x02\0\0");
        send(&good);
        let reading = loop {
            match queue.pop_timecode() {
                Some(reading) => break reading,
                None => std::thread::yield_now(),
            }
        };
        let Place::Frame { fields, .. } = reading.place else {
            panic!("{reading:?}");
        };
        assert_eq!((fields.hours, fields.frames), (1, 4));
        assert!(reading.at.0 >= 0.0 && !reading.is_locate);
        assert_eq!(faults.of(Fault::BadTimecode), 3);
    }
}
