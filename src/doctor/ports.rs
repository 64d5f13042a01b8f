//! Network ports for `corybant doctor`. In: the programs that listen on this computer. Out: lines of
//! the page. Nothing is sent; a free port is opened and closed again at once.

use std::collections::HashSet;
use std::net::{SocketAddr, TcpListener};

use listeners::{Listener, Protocol, SocketState};

use super::page::Line;
use super::privacy::Privacy;
use crate::config::Config;
use crate::dmx;
use crate::rt::system::udp;
use crate::web::DEFAULT_LISTEN;

/// Port on which receivers of VMC listen by default.
const VMC_PORT: u16 = 39539;
/// Name of VRChat's process, in lower case.
const VRCHAT: &str = "vrchat";

/// The programs that listen on this computer; `None` if the system does not say.
type Programs = Option<HashSet<Listener>>;

/// Returns the state of the ports of a show without a show file.
pub(super) fn lines(privacy: &Privacy) -> Vec<Line> {
    let programs = listeners::get_all().ok();
    let mut lines = own_ports(&Config::default(), &programs, privacy);
    let receivers = names(&programs, VMC_PORT, Protocol::UDP);
    lines.push(Line::fact(
        "VMC",
        if receivers.is_empty() {
            format!("no program on this computer receives it on UDP port {VMC_PORT}")
        } else {
            format!(
                "UDP port {VMC_PORT}: received by {}",
                privacy.clean(&receivers)
            )
        },
    ));
    lines
}

/// Returns the state of the ports of the show with the settings `config`.
pub(super) fn of_show(config: &Config, privacy: &Privacy) -> Vec<Line> {
    let programs = listeners::get_all().ok();
    let mut lines = own_ports(config, &programs, privacy);
    lines.extend(
        config
            .dmx_in
            .iter()
            .flat_map(|input| dmx(input, &programs, privacy)),
    );
    lines
}

/// Returns the universe of a DMX input and where it arrives. Programs share the port of sACN, so only
/// that of Art-Net can be taken.
fn dmx(input: &dmx::Settings, programs: &Programs, privacy: &Privacy) -> Vec<Line> {
    let (protocol, universe) = (input.protocol, input.universe);
    let places = privacy.clean(&input.places());
    let universe = Line::fact("DMX", format!("{protocol} universe {universe} at {places}"));
    let port = input
        .listen_addr()
        .filter(|_| protocol == dmx::Protocol::ArtNet)
        .map(|address| Port {
            name: "DMX",
            key: "dmx_in.listen",
            address,
            protocol: Protocol::UDP,
        });
    let port = port.map(|port| port.line(programs, privacy));
    std::iter::once(universe).chain(port).collect()
}

fn own_ports(config: &Config, programs: &Programs, privacy: &Privacy) -> Vec<Line> {
    let page = match config.page.listen.as_str() {
        "" => DEFAULT_LISTEN,
        listen => listen,
    };
    [
        (
            "OSC",
            "osc.listen",
            config.osc.listen.as_str(),
            Protocol::UDP,
        ),
        ("page", "page.listen", page, Protocol::TCP),
    ]
    .into_iter()
    .filter_map(|(name, key, listen, protocol)| {
        let address: SocketAddr = listen.parse().ok()?;
        let port = Port {
            name,
            key,
            address,
            protocol,
        };
        Some(port.line(programs, privacy))
    })
    .collect()
}

/// A port on which a show listens.
struct Port {
    name: &'static str,
    /// Key of the show file that sets the port.
    key: &'static str,
    address: SocketAddr,
    protocol: Protocol,
}

impl Port {
    fn line(&self, programs: &Programs, privacy: &Privacy) -> Line {
        let (number, protocol) = (self.address.port(), self.protocol);
        let place = format!("{protocol} port {number}");
        let users = names(programs, number, protocol);
        if protocol == Protocol::UDP && users.to_lowercase().contains(VRCHAT) {
            return Line::problem(format!(
                "{}: VRChat listens on {place} and takes the cues: set {} to another port, such as \"127.0.0.1:9010\", or start VRChat with \
                 --osc=9100:127.0.0.1:9101",
                self.name, self.key
            ));
        }
        match self.open() {
            Ok(()) if users.is_empty() => Line::fact(self.name, format!("{place} is free")),
            Ok(()) => Line::fact(
                self.name,
                format!("{place} is shared with {}", privacy.clean(&users)),
            ),
            Err(_) if users.to_lowercase().contains("corybant") => {
                Line::fact(self.name, format!("{place} is used by a running Corybant"))
            }
            Err(error) => {
                let user = if users.is_empty() {
                    privacy.clean(&error.to_string())
                } else {
                    format!("{} uses it", privacy.clean(&users))
                };
                Line::problem(format!(
                    "{}: cannot listen on {place} ({user}): close that program, or set {} to another port",
                    self.name, self.key
                ))
            }
        }
    }

    /// Opens the port and closes it again.
    fn open(&self) -> std::io::Result<()> {
        match self.protocol {
            Protocol::UDP => udp::bind(&self.address.to_string()).map(drop),
            Protocol::TCP => TcpListener::bind(self.address).map(drop),
        }
    }
}

/// Returns the names of the programs that listen on the port `number`, separated by commas.
fn names(programs: &Programs, number: u16, protocol: Protocol) -> String {
    let is_listening = |listener: &&Listener| {
        listener.protocol == protocol
            && listener.socket.port() == number
            && (protocol == Protocol::UDP || listener.state == SocketState::Listen)
    };
    let found = programs.iter().flatten().filter(is_listening);
    let mut names: Vec<&str> = found.map(|found| found.process.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn port(address: SocketAddr, protocol: Protocol) -> Port {
        Port {
            name: "OSC",
            key: "osc.listen",
            address,
            protocol,
        }
    }

    fn listener(name: &str, address: SocketAddr) -> Programs {
        let process = listeners::Process {
            pid: 1,
            name: name.into(),
            path: String::new(),
        };
        Some(HashSet::from([Listener {
            process,
            socket: address,
            protocol: Protocol::UDP,
            state: SocketState::Unknown,
        }]))
    }

    #[test]
    fn a_taken_port_names_the_program_and_the_key() {
        let taken = udp::bind("127.0.0.1:0").unwrap();
        let address = taken.local_addr().unwrap();
        let line =
            |programs| match port(address, Protocol::UDP).line(&programs, &Privacy::default()) {
                Line::Problem(text) | Line::Fact(_, text) => text,
                Line::Item(text) => panic!("{text}"),
            };
        let number = address.port();
        let mixer = line(listener("mixer", address));
        assert!(
            mixer.contains(&format!("UDP port {number} (mixer uses it)")),
            "{mixer}"
        );
        assert!(mixer.contains("set osc.listen to another port"), "{mixer}");
        assert!(line(None).contains("cannot listen"));
        assert!(line(listener("corybant", address)).contains("a running Corybant"));
        let vrchat = line(listener("VRChat.exe", address));
        assert!(vrchat.contains("--osc=9100:127.0.0.1:9101"), "{vrchat}");
        drop(taken);
        assert_eq!(line(None), format!("UDP port {number} is free"));
    }

    #[test]
    fn universes_are_listed_and_a_taken_port_of_art_net_names_its_key() {
        let taken = udp::bind("127.0.0.1:0").unwrap();
        let address = taken.local_addr().unwrap();
        let input = |protocol| dmx::Settings {
            protocol,
            universe: 20,
            listen: address.to_string(),
            ..dmx::Settings::default()
        };
        let lines = |protocol| dmx(&input(protocol), &None, &Privacy::default());
        let sacn = lines(dmx::Protocol::Sacn);
        assert!(
            matches!(&sacn[..], [Line::Fact("DMX", text)] if text.starts_with("sacn universe 20 at")),
            "{sacn:?}"
        );
        let art_net = lines(dmx::Protocol::ArtNet);
        assert!(
            matches!(&art_net[1], Line::Problem(text) if text.contains("set dmx_in.listen")),
            "{art_net:?}"
        );
    }

    #[test]
    fn the_system_names_this_program_as_a_listener() {
        let socket = udp::bind("127.0.0.1:0").unwrap();
        let number = socket.local_addr().unwrap().port();
        let found = names(&listeners::get_all().ok(), number, Protocol::UDP);
        assert!(found.starts_with("corybant"), "{found:?}");
        assert_eq!(names(&None, number, Protocol::UDP), "");
    }
}
