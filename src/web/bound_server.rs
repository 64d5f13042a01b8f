//! A web server whose port is open but that does not serve yet. In: settings. Out: a listener, its
//! runtime, its link and its access control. Thread: main, before the server starts.

use std::net::SocketAddr;

use tokio::net::{TcpListener, TcpSocket};
use tokio::runtime::Runtime;

use super::auth::{self, Access};
use super::token::{self, Token};
use super::{PageError, Settings};

/// Size of the operating system's send buffer for one connection, in bytes. The buffer has room for
/// only about a tenth of a second of snapshots, so that a slow browser does not show old ones.
const SEND_BUFFER_BYTES: u32 = 16 * 1024;

/// An open port, with everything that a server needs to serve on it.
pub(crate) struct BoundServer {
    /// Asynchronous runtime on which the server's tasks run.
    pub runtime: Runtime,
    /// Listener that accepts connections.
    pub listener: TcpListener,
    /// Network address of the listener; the port is never 0.
    pub local_addr: SocketAddr,
    /// Link to the page, with its token.
    pub link: String,
    /// Link to the page that only shows the stage, with the view token.
    pub view_link: String,
    /// Access rules that every request must pass.
    pub access: Access,
}

impl BoundServer {
    /// Opens the port at the network address in `settings`, before anything is served on it.
    ///
    /// # Errors
    /// [`PageError`] if `settings.listen` is not an IP address with a port (for example `off`), or
    /// the system refuses to open the port.
    pub(crate) fn bind(settings: &Settings) -> Result<Self, PageError> {
        let addr: SocketAddr = settings.listen.parse().map_err(|_| PageError::Address {
            listen: settings.listen.clone(),
        })?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(|source| PageError::Thread { source })?;
        let listener = {
            let _inside = runtime.enter();
            listen(addr)?
        };
        let local_addr = listener
            .local_addr()
            .map_err(|source| PageError::Bind { addr, source })?;
        let token = Token::new(&settings.token, addr.ip())?;
        let view = match (&token, settings.view_token.as_str()) {
            (None, _) => None,
            (Some(_), "") => Some(Token::generated()?),
            (Some(_), chosen) => Token::new(chosen, addr.ip())?,
        };
        let play = match (&token, settings.play_token.as_str()) {
            (None, _) | (Some(_), "") => None,
            (Some(_), chosen) => Token::new(chosen, addr.ip())?,
        };
        let link = token::link(local_addr, "/", token.as_ref());
        Ok(Self {
            runtime,
            listener,
            local_addr,
            link,
            view_link: token::link(local_addr, auth::STAGE, view.as_ref()),
            access: Access {
                listen: local_addr,
                token,
                play,
                view,
                setup: None,
            },
        })
    }
}

fn listen(addr: SocketAddr) -> Result<TcpListener, PageError> {
    let refused = |source: std::io::Error| match source.kind() {
        std::io::ErrorKind::AddrInUse => PageError::InUse { addr },
        _ => PageError::Bind { addr, source },
    };
    let socket = if addr.is_ipv4() {
        TcpSocket::new_v4()
    } else {
        TcpSocket::new_v6()
    }
    .map_err(refused)?;
    // On Unix, this lets a restarted program reuse the port at once. On other systems it would let
    // two programs share the port.
    #[cfg(unix)]
    socket.set_reuseaddr(true).map_err(refused)?;
    socket
        .set_send_buffer_size(SEND_BUFFER_BYTES)
        .map_err(refused)?;
    socket.bind(addr).map_err(refused)?;
    socket.listen(64).map_err(refused)
}
