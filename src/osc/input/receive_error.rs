//! The meaning of an error of a UDP socket that receives. In: the error. Out: its meaning. Thread:
//! any. Pure.

use std::io::{Error, ErrorKind};

/// Windows' error number WSAEMSGSIZE: the datagram was longer than the buffer. Other systems cut
/// such a datagram and report no error.
const TOO_LONG: i32 = 10040;

/// The meaning of an error of a UDP socket that receives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ReceiveError {
    /// No datagram arrived: a timeout, a signal, or (on Windows) the reply of a receiver that has
    /// closed its socket. The socket is as before.
    Nothing,
    /// A datagram arrived that was longer than the buffer. It is lost; the socket is as before.
    TooLong,
    /// The socket does not work. The next attempt may fail as well.
    Failed,
}

impl ReceiveError {
    /// Returns the meaning of `error`.
    pub(crate) fn of(error: &Error) -> Self {
        match error.kind() {
            _ if error.raw_os_error() == Some(TOO_LONG) => Self::TooLong,
            ErrorKind::WouldBlock
            | ErrorKind::TimedOut
            | ErrorKind::Interrupted
            | ErrorKind::ConnectionReset => Self::Nothing,
            _ => Self::Failed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_datagram_is_not_a_broken_socket() {
        let of = |code| ReceiveError::of(&Error::from_raw_os_error(code));
        assert_eq!(of(10040), ReceiveError::TooLong);
        for kind in [
            ErrorKind::WouldBlock,
            ErrorKind::TimedOut,
            ErrorKind::Interrupted,
            ErrorKind::ConnectionReset,
        ] {
            assert_eq!(ReceiveError::of(&kind.into()), ReceiveError::Nothing);
        }
        let broken = ErrorKind::PermissionDenied.into();
        assert_eq!(ReceiveError::of(&broken), ReceiveError::Failed);
        #[cfg(windows)]
        for code in [10054, 10060, 10035] {
            assert_eq!(of(code), ReceiveError::Nothing, "{code}");
        }
    }
}
