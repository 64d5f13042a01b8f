//! A thread that receives datagrams at one socket for one or several inputs. In: UDP datagrams. Out:
//! calls of the inputs. Thread: its own, with the name that the caller gives; it ends when the
//! [`Worker`] is dropped. It waits at most 100 ms at a time.

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use crate::osc::input::receive_error::ReceiveError;
use crate::rt::worker::{StopSignal, Worker};

/// Longest time for which the thread waits for a datagram before it checks whether it must stop.
const RECEIVE_MAX: Duration = Duration::from_millis(100);
/// Pause after an error of the socket. A permanent error must not use a whole core.
const ERROR_PAUSE: Duration = Duration::from_millis(33);
/// Largest datagram that is read, in bytes; the protocols have no longer packets.
const DATAGRAM_MAX: usize = 1_500;

/// An input that gets the datagrams of a socket.
pub(crate) trait DatagramInput: Send {
    /// Processes a datagram that was sent from `from` and arrived at `arrived`. A datagram that is
    /// longer than 1500 bytes is cut to 1501 bytes.
    fn process(&mut self, datagram: &[u8], from: SocketAddr, arrived: Instant);

    /// Processes a datagram that was too long and is lost.
    fn process_lost(&mut self);

    /// Does what depends on the time alone; called at least 10 times a second.
    fn update(&mut self, _now: Instant) {}
}

/// An input, and the network address at which it listens.
pub(crate) struct Listening {
    /// The network address. Port 0 selects any free port.
    pub(crate) listen: SocketAddr,
    /// The input.
    pub(crate) input: Box<dyn DatagramInput>,
}

impl Listening {
    /// Returns true if the input accepts datagrams from `from`. An input on a loopback address that
    /// shares the socket of another input accepts only those of this machine.
    fn accepts(&self, from: SocketAddr) -> bool {
        !self.listen.ip().is_loopback() || from.ip().is_loopback()
    }

    /// Returns true if this input and `other` need one socket for both: one of the addresses
    /// contains the other.
    fn shares(&self, other: SocketAddr) -> bool {
        let (own, port) = (self.listen.ip(), self.listen.port());
        let is_inside = own == other.ip() || own.is_unspecified() || other.ip().is_unspecified();
        port != 0 && port == other.port() && is_inside
    }
}

/// Groups `inputs` by the sockets that they need. Returns, for each socket, its network address and
/// its inputs.
pub(crate) fn by_socket(inputs: Vec<Listening>) -> Vec<(SocketAddr, Vec<Listening>)> {
    let mut sockets: Vec<(SocketAddr, Vec<Listening>)> = Vec::new();
    // An address that contains all others comes first, so that the others find it.
    let (all, single): (Vec<_>, Vec<_>) = inputs
        .into_iter()
        .partition(|input| input.listen.ip().is_unspecified());
    for input in all.into_iter().chain(single) {
        match sockets.iter_mut().find(|(at, _)| input.shares(*at)) {
            Some((_, inputs)) => inputs.push(input),
            None => sockets.push((input.listen, vec![input])),
        }
    }
    sockets
}

/// Starts the thread `name`, which gives the datagrams of `socket` to `inputs`.
///
/// # Errors
/// The error of the system if it refuses the thread or the socket.
pub(crate) fn receive(
    name: &str,
    socket: UdpSocket,
    mut inputs: Vec<Listening>,
) -> io::Result<Worker> {
    socket.set_read_timeout(Some(RECEIVE_MAX))?;
    Worker::start(name, move |stop| run(&socket, &mut inputs, stop))
}

fn run(socket: &UdpSocket, inputs: &mut [Listening], stop: &StopSignal) {
    // One byte more than the limit, to detect a longer datagram that was cut.
    let mut buffer = [0; DATAGRAM_MAX + 1];
    while !stop.is_set() {
        let received = socket.recv_from(&mut buffer);
        let now = Instant::now();
        match received {
            Ok((length, from)) => {
                for listening in inputs.iter_mut().filter(|input| input.accepts(from)) {
                    listening.input.process(&buffer[..length], from, now);
                }
            }
            Err(error) => match ReceiveError::of(&error) {
                ReceiveError::Nothing => {}
                ReceiveError::TooLong => {
                    for listening in inputs.iter_mut() {
                        listening.input.process_lost();
                    }
                }
                ReceiveError::Failed => std::thread::park_timeout(ERROR_PAUSE),
            },
        }
        for listening in inputs.iter_mut() {
            listening.input.update(now);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Nothing;

    impl DatagramInput for Nothing {
        fn process(&mut self, _: &[u8], _: SocketAddr, _: Instant) {}
        fn process_lost(&mut self) {}
    }

    fn listening(listen: &str) -> Listening {
        Listening {
            listen: listen.parse().unwrap(),
            input: Box::new(Nothing),
        }
    }

    #[test]
    fn inputs_of_one_port_share_a_socket_if_their_addresses_meet() {
        let groups = |listens: &[&str]| -> Vec<(String, usize)> {
            let inputs = listens.iter().map(|listen| listening(listen)).collect();
            let sockets = by_socket(inputs).into_iter();
            sockets
                .map(|(at, inputs)| (at.to_string(), inputs.len()))
                .collect()
        };
        let one = |at: &str, count| (at.to_owned(), count);
        assert_eq!(
            groups(&["127.0.0.1:6454", "0.0.0.0:6454", "10.0.0.1:6454"]),
            [one("0.0.0.0:6454", 3)]
        );
        assert_eq!(
            groups(&["127.0.0.1:6454", "127.0.0.2:6454", "127.0.0.1:6454"]),
            [one("127.0.0.1:6454", 2), one("127.0.0.2:6454", 1)]
        );
        assert_eq!(
            groups(&["127.0.0.1:0", "127.0.0.1:0", "0.0.0.0:1"]),
            [
                one("0.0.0.0:1", 1),
                one("127.0.0.1:0", 1),
                one("127.0.0.1:0", 1)
            ]
        );
    }

    #[test]
    fn a_loopback_address_stays_closed_for_other_machines_on_a_shared_socket() {
        let remote = "10.0.0.9:5000".parse().unwrap();
        let local = "127.0.0.1:5000".parse().unwrap();
        let (closed, open) = (listening("127.0.0.1:6454"), listening("0.0.0.0:6454"));
        assert!(closed.accepts(local) && !closed.accepts(remote));
        assert!(open.accepts(local) && open.accepts(remote));
    }
}
