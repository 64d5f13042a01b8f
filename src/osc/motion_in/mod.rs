//! Motion input: receives the poses of a motion capture or face tracker over VMC. In: UDP
//! datagrams. Out: live poses, with the times at which they arrived. Thread: the caller's, or
//! "motion-in" during a show; it waits at most 100 ms at a time (on Windows 500 ms). Allocates: while
//! it decodes a datagram.

mod counter;
mod listener;
mod settings;

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use thiserror::Error;

use super::input::receive_error::ReceiveError;
use crate::rt::system::udp;
use corybant_core::decode::vmc::{Counts, DATAGRAM_MAX, Receiver};
use corybant_core::motion::live::LivePose;
use corybant_core::time::Seconds;

pub(crate) use counter::MotionCounter;
pub(crate) use listener::{MotionContext, MotionListener};
pub use settings::{Kind, Settings};

/// Longest time for which [`MotionSocket::receive`] waits for a datagram.
const RECEIVE_MAX: Duration = Duration::from_millis(100);
/// Pause after an error of the socket. A permanent error must not use a whole core.
const ERROR_PAUSE: Duration = Duration::from_millis(33);

/// The operating system refuses to receive motion at a network address.
#[derive(Debug, Error)]
#[error(
    "cannot receive motion on {listen}: {source}; if another program has this port, stop it or give {setting} another port"
)]
pub struct MotionInError {
    /// The network address, `HOST:PORT`, as the user wrote it.
    listen: String,
    /// The setting or option that the user can change.
    setting: String,
    /// The error that the operating system reported.
    source: io::Error,
}

/// A socket that receives poses over VMC.
#[derive(Debug)]
pub struct MotionSocket {
    socket: UdpSocket,
    local: SocketAddr,
    receiver: Receiver<SocketAddr>,
    /// One byte more than the limit, to detect a longer datagram that was cut.
    buffer: [u8; DATAGRAM_MAX + 1],
    start: Instant,
}

impl MotionSocket {
    /// Opens a socket at the network address `listen`, `HOST:PORT`. `setting` is the name of the
    /// setting or option from which the address comes.
    ///
    /// # Errors
    /// [`MotionInError`] if the host is unknown or the system refuses the address.
    pub fn open(listen: &str, setting: &str) -> Result<Self, MotionInError> {
        let error = |source| MotionInError {
            listen: listen.into(),
            setting: setting.into(),
            source,
        };
        let socket = udp::bind(listen).map_err(error)?;
        socket.set_read_timeout(Some(RECEIVE_MAX)).map_err(error)?;
        Ok(Self {
            local: socket.local_addr().map_err(error)?,
            socket,
            receiver: Receiver::default(),
            buffer: [0; DATAGRAM_MAX + 1],
            start: Instant::now(),
        })
    }

    /// Returns the network address at which the socket receives; the port is never 0.
    pub fn local_addr(&self) -> SocketAddr {
        self.local
    }

    /// Waits for a datagram, and calls `each` for each pose that is complete with it.
    pub fn receive(&mut self, each: &mut dyn FnMut(&LivePose)) {
        match self.socket.recv_from(&mut self.buffer) {
            Ok((length, from)) => {
                let now = self.now();
                self.receiver
                    .receive(now, from, &self.buffer[..length], each);
            }
            Err(error) => match ReceiveError::of(&error) {
                ReceiveError::Nothing | ReceiveError::TooLong => {}
                ReceiveError::Failed => std::thread::park_timeout(ERROR_PAUSE),
            },
        }
    }

    /// Returns the time on the clock of the poses, in seconds since the socket was opened.
    pub fn now(&self) -> Seconds {
        Seconds(self.start.elapsed().as_secs_f64())
    }

    /// Returns the program whose poses are received; `None` if none has sent for a second.
    pub fn sender(&self) -> Option<SocketAddr> {
        self.receiver.sender(self.now())
    }

    /// Returns the numbers of poses and of ignored datagrams and messages.
    pub fn counts(&self) -> Counts {
        self.receiver.counts()
    }
}
