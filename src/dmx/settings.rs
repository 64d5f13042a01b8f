//! A `[[dmx_in]]` section of a show file. In: TOML text. Out: checked settings. Thread: any.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use corybant_core::cue::CueNames;
use corybant_core::cue::dmx::{PatchEntry, art_net, sacn};
use corybant_core::timecode;

/// Greatest number of inputs.
const INPUTS_MAX: usize = 32;
/// Greatest number of entries in the patch of an input.
const PATCH_MAX: usize = 1024;

/// The protocol of a DMX input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Protocol {
    /// Streaming ACN (ANSI E1.31).
    #[default]
    Sacn,
    /// Art-Net 4.
    ArtNet,
}

impl Protocol {
    /// Returns the UDP port of the protocol.
    pub fn port(self) -> u16 {
        match self {
            Self::Sacn => sacn::PORT,
            Self::ArtNet => timecode::art_net::PORT,
        }
    }

    /// Returns the universes of the protocol.
    pub fn universes(self) -> RangeInclusive<u16> {
        match self {
            Self::Sacn => sacn::UNIVERSES,
            Self::ArtNet => art_net::UNIVERSES,
        }
    }

    /// Returns the longest time between two packets of a source, in seconds.
    pub(super) fn lost_after_s(self) -> f64 {
        match self {
            Self::Sacn => sacn::LOST_AFTER_S,
            Self::ArtNet => art_net::LOST_AFTER_S,
        }
    }
}

impl fmt::Display for Protocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Sacn => "sacn",
            Self::ArtNet => "art-net",
        })
    }
}

/// One `[[dmx_in]]` section of a show file: a universe of a lighting desk, and what its channels
/// send. All keys take effect at the next start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Protocol in which the levels arrive.
    pub protocol: Protocol,
    /// The universe: 1 to 63999 for sACN; 0 to 32767 for Art-Net, which is net × 256 + sub-net × 16 +
    /// universe.
    pub universe: u16,
    /// Address of this machine at which unicast arrives, `IP` or `IP:PORT`; empty for this machine
    /// alone.
    pub listen: String,
    /// IPv4 address of the network interface on which the multicast group of sACN is joined; empty
    /// for this machine alone.
    pub interface: String,
    /// What the channels send.
    pub patch: Vec<PatchEntry>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            protocol: Protocol::default(),
            universe: 1,
            listen: String::new(),
            interface: String::new(),
            patch: Vec::new(),
        }
    }
}

impl Settings {
    /// Returns the network address at which unicast arrives; `None` if `listen` is not allowed.
    pub fn listen_addr(&self) -> Option<SocketAddr> {
        let port = self.protocol.port();
        if self.listen.is_empty() {
            return Some((Ipv4Addr::LOCALHOST, port).into());
        }
        let ip = self.listen.parse::<IpAddr>();
        ip.map(|ip| SocketAddr::new(ip, port))
            .or_else(|_| self.listen.parse())
            .ok()
    }

    /// Returns the address of the interface for multicast; `None` if `interface` is not allowed.
    pub fn interface_addr(&self) -> Option<Ipv4Addr> {
        match self.interface.as_str() {
            "" => Some(Ipv4Addr::LOCALHOST),
            text => text.parse().ok(),
        }
    }

    /// Returns the addresses at which levels arrive, in words.
    pub(crate) fn places(&self) -> String {
        let listen = self.listen_addr();
        let listen = listen.map_or_else(|| self.listen.clone(), |listen| listen.to_string());
        match self.protocol {
            Protocol::ArtNet => listen,
            Protocol::Sacn => {
                let group = Ipv4Addr::from(sacn::group(self.universe));
                let on = self.interface_addr().unwrap_or(Ipv4Addr::LOCALHOST);
                format!("{listen}, multicast {group} on {on}")
            }
        }
    }

    /// Adds a sentence to `problems` for each invalid value of these settings. `key` is the path of
    /// the settings in the show file, such as `dmx_in 1`.
    pub fn check(&self, key: &str, problems: &mut Vec<String>) {
        let universes = self.protocol.universes();
        if !universes.contains(&self.universe) {
            problems.push(format!(
                "{key}.universe is {}; for \"{}\" it must be from {} to {}.",
                self.universe,
                self.protocol,
                universes.start(),
                universes.end()
            ));
        }
        if self.listen_addr().is_none() {
            problems.push(format!(
                "{key}.listen is {:?}; it must be an IP address of this computer or IP:PORT, such as \"0.0.0.0\" for all networks, or \"\" for this computer only.",
                self.listen
            ));
        }
        if self.interface_addr().is_none() {
            problems.push(format!(
                "{key}.interface is {:?}; it must be an IPv4 address of this computer, \"0.0.0.0\" for the system's choice, or \"\" for this computer only.",
                self.interface
            ));
        } else if self.protocol == Protocol::ArtNet && !self.interface.is_empty() {
            problems.push(format!(
                "{key}.interface is {:?}, but Art-Net has no multicast: write the address in {key}.listen.",
                self.interface
            ));
        }
        self.check_patch(key, problems);
    }

    fn check_patch(&self, key: &str, problems: &mut Vec<String>) {
        if self.patch.len() > PATCH_MAX {
            problems.push(format!(
                "{key}.patch has {} entries; at most {PATCH_MAX} are allowed: leave some out.",
                self.patch.len()
            ));
            return;
        }
        for (number, entry) in (1..).zip(&self.patch) {
            let key_of = |number| format!("{key}.patch {number}");
            entry.check(&key_of(number), problems);
            let before = (1..number).zip(&self.patch);
            let overlap = before
                .into_iter()
                .find_map(|(other, before)| Some((other, entry.overlap(before)?)));
            if let Some((other, (band, before))) = overlap {
                problems.push(format!(
                    "{} has the levels {band} of channel {}, which overlap {before} of {}: give each label levels of its own.",
                    key_of(number),
                    entry.channel,
                    key_of(other)
                ));
            }
        }
    }

    /// Adds a sentence to `problems` for each label of the patch that is not in `names`, the
    /// labels and scenes of the show. `key` is the path of the settings in the show file.
    pub fn check_labels(&self, key: &str, names: CueNames, problems: &mut Vec<String>) {
        for (number, entry) in (1..).zip(&self.patch) {
            if let Err(error) = entry.actions(names) {
                problems.push(format!("{key}.patch {number} {error}"));
            }
        }
    }
}

/// Adds a sentence to `problems` for each invalid value of all sections `[[dmx_in]]` of a show file.
pub fn check_all(inputs: &[Settings], problems: &mut Vec<String>) {
    if inputs.len() > INPUTS_MAX {
        problems.push(format!(
            "there are {} sections [[dmx_in]]; at most {INPUTS_MAX} are allowed: leave some out.",
            inputs.len()
        ));
        return;
    }
    for (i, input) in inputs.iter().enumerate() {
        let key = format!("dmx_in {}", i + 1);
        input.check(&key, problems);
        let is_same =
            |other: &Settings| (other.protocol, other.universe) == (input.protocol, input.universe);
        if let Some(other) = inputs[..i].iter().position(is_same) {
            problems.push(format!(
                "{key}.universe is {} of {} again: move its patch to dmx_in {}.",
                input.universe,
                input.protocol,
                other + 1
            ));
        }
    }
}
