//! Gives the frames in datagrams to the universes. In: datagrams of one socket. Out: calls of
//! universes; malformed packets are counted and, at most once a second, logged. Thread: "sacn" or
//! "art-net".

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tracing::warn;

use super::universe::SharedUniverse;
use super::{Protocol, Settings};
use crate::clock::datagrams::{DatagramInput, Listening};
use corybant_core::cue::dmx::{Frame, art_net, sacn};
use corybant_core::fault::{Fault, Faults};

/// Shortest time between two log lines about malformed packets.
const LOG_EVERY: Duration = Duration::from_secs(1);

/// The universes whose levels arrive at one network address.
pub(super) struct DmxInput {
    protocol: Protocol,
    universes: Vec<(u16, SharedUniverse)>,
    faults: Arc<Faults>,
    /// Time of the last log line about a malformed packet.
    logged: Option<Instant>,
}

/// Returns the inputs of Art-Net, one for each network address.
pub(super) fn art_net(
    inputs: &[(Settings, SharedUniverse)],
    faults: &Arc<Faults>,
) -> Vec<Listening> {
    by_address(inputs, Protocol::ArtNet, faults)
}

/// Returns an input for each network address at which universes of `protocol` arrive by unicast.
pub(super) fn by_address(
    inputs: &[(Settings, SharedUniverse)],
    protocol: Protocol,
    faults: &Arc<Faults>,
) -> Vec<Listening> {
    let mut addresses: Vec<(SocketAddr, Vec<(u16, SharedUniverse)>)> = Vec::new();
    for (settings, universe) in inputs {
        // `Settings::check` has refused other addresses.
        let Some(listen) = settings.listen_addr() else {
            continue;
        };
        if settings.protocol != protocol {
            continue;
        }
        let universe = (settings.universe, universe.clone());
        match addresses.iter_mut().find(|(address, _)| *address == listen) {
            Some((_, universes)) => universes.push(universe),
            None => addresses.push((listen, vec![universe])),
        }
    }
    let listening = |(listen, universes)| Listening {
        listen,
        input: Box::new(DmxInput::new(protocol, universes, faults)),
    };
    addresses.into_iter().map(listening).collect()
}

impl DmxInput {
    /// Creates an input for these `universes`, with their numbers.
    pub(super) fn new(
        protocol: Protocol,
        universes: Vec<(u16, SharedUniverse)>,
        faults: &Arc<Faults>,
    ) -> Self {
        Self {
            protocol,
            universes,
            faults: faults.clone(),
            logged: None,
        }
    }

    fn give(&self, universe: u16, frame: &Frame, from: SocketAddr, arrived: Instant) {
        let mut universes = self.universes.iter();
        if let Some((_, universe)) = universes.find(|(number, _)| *number == universe) {
            let address = || from.ip().to_string();
            universe.lock().receive(frame, arrived, address);
        }
    }

    fn refuse(&mut self, from: SocketAddr, arrived: Instant, error: &str) {
        self.process_lost();
        if self
            .logged
            .is_none_or(|logged| arrived - logged >= LOG_EVERY)
        {
            self.logged = Some(arrived);
            warn!("ignored a datagram from {from}, which has no DMX: {error}");
        }
    }
}

impl DatagramInput for DmxInput {
    fn process(&mut self, datagram: &[u8], from: SocketAddr, arrived: Instant) {
        let parsed = match self.protocol {
            Protocol::Sacn => sacn::parse(datagram).map_err(|error| error.to_string()),
            Protocol::ArtNet => {
                art_net::parse(datagram, identifier(from.ip())).map_err(|error| error.to_string())
            }
        };
        match parsed {
            Ok(Some((universe, frame))) => self.give(universe, &frame, from, arrived),
            Ok(None) => {}
            Err(error) => self.refuse(from, arrived, &error),
        }
    }

    fn process_lost(&mut self) {
        self.faults.count(Fault::BadDmx);
        for (_, universe) in &self.universes {
            universe.lock().count_ignored();
        }
    }

    fn update(&mut self, now: Instant) {
        for (_, universe) in &self.universes {
            universe.lock().update(now);
        }
    }
}

/// Returns the network address of a sender as 16 bytes.
fn identifier(from: IpAddr) -> [u8; 16] {
    match from {
        IpAddr::V4(address) => address.to_ipv6_mapped().octets(),
        IpAddr::V6(address) => address.octets(),
    }
}
