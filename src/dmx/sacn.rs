//! The sockets of sACN: one for each unicast address, and one for each universe that joins its
//! multicast group. In: settings. Out: running threads. Thread: main.
//!
//! Other programs on this computer can receive the same universes: all sockets of sACN share their
//! port, as E1.31 receivers do.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::Arc;

use socket2::{Domain, Socket, Type};

use super::input::{DmxInput, by_address};
use super::universe::SharedUniverse;
use super::{DmxError, Protocol, Settings};
use crate::clock::datagrams::{self, Listening};
use crate::rt::worker::Worker;
use corybant_core::cue::dmx::sacn;
use corybant_core::fault::Faults;

/// Name of the threads.
const THREAD: &str = "sacn";

/// Starts to receive the universes of sACN in `inputs`.
///
/// # Errors
/// [`DmxError::Socket`] if the system refuses a network address, a group or a thread.
pub(super) fn open(
    inputs: &[(Settings, SharedUniverse)],
    faults: &Arc<Faults>,
) -> Result<Vec<Worker>, DmxError> {
    let mut workers = Vec::new();
    let unicast = by_address(inputs, Protocol::Sacn, faults);
    for (listen, inputs) in datagrams::by_socket(unicast) {
        let socket = bind(listen);
        let worker = socket.and_then(|socket| datagrams::receive(THREAD, socket, inputs));
        workers.push(worker.map_err(refused("dmx_in", &listen.to_string()))?);
    }
    for (number, (settings, universe)) in (1..).zip(inputs) {
        // `Settings::check` has refused other interfaces.
        let Some(interface) = settings.interface_addr() else {
            continue;
        };
        if settings.protocol != Protocol::Sacn {
            continue;
        }
        let group = Ipv4Addr::from(sacn::group(settings.universe));
        let universes = vec![(settings.universe, universe.clone())];
        let inputs = vec![Listening {
            listen: (group, sacn::PORT).into(),
            input: Box::new(DmxInput::new(Protocol::Sacn, universes, faults)),
        }];
        let socket = join(group, interface);
        let worker = socket.and_then(|socket| datagrams::receive(THREAD, socket, inputs));
        let place = format!("{group}:{} on {interface}", sacn::PORT);
        workers.push(worker.map_err(refused(&format!("dmx_in {number}"), &place))?);
    }
    Ok(workers)
}

/// Returns a function that adds the key of the settings and the address to an error.
fn refused(key: &str, address: &str) -> impl FnOnce(io::Error) -> DmxError {
    let (key, address) = (key.to_owned(), address.to_owned());
    |source| DmxError::Socket {
        key,
        address,
        source,
    }
}

/// Opens a socket at `listen` whose port other programs can share.
fn bind(listen: SocketAddr) -> io::Result<UdpSocket> {
    let socket = Socket::new(Domain::for_address(listen), Type::DGRAM, None)?;
    socket.set_reuse_address(true)?;
    socket.bind(&listen.into())?;
    Ok(socket.into())
}

/// Opens a socket that receives the datagrams to `group` which arrive at `interface`, and no others.
/// On Windows, where no socket can have the address of a group, it also receives those to the
/// interface.
fn join(group: Ipv4Addr, interface: Ipv4Addr) -> io::Result<UdpSocket> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, None)?;
    socket.set_reuse_address(true)?;
    // On macOS, a shared port needs this option too.
    #[cfg(target_vendor = "apple")]
    socket.set_reuse_port(true)?;
    let address = if cfg!(windows) { interface } else { group };
    socket.bind(&SocketAddr::from((address, sacn::PORT)).into())?;
    // Otherwise a group that another program has joined on another interface arrives too.
    #[cfg(target_os = "linux")]
    socket.set_multicast_all_v4(false)?;
    socket.join_multicast_v4(&group, &interface)?;
    Ok(socket.into())
}
