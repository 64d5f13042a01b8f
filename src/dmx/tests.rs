//! Tests of DMX inputs with the senders of other projects: the crates `sacn` and `artnet_protocol`.

use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::time::{Duration, Instant};

use ::sacn::source::SacnSource;
use artnet_protocol::{ArtCommand, Output};

use super::*;
use crate::clock::art_net::{self, ArtNetInput};
use corybant_core::cue::{Cue, DanceCommand, Launch};
use corybant_core::fault::Fault;
use corybant_core::timecode;

/// Longest time until a datagram on this machine has arrived.
const PATIENCE: Duration = Duration::from_secs(60);

struct Opened {
    context: DmxContext,
    inputs: DmxInputs,
    art_net: Vec<ArtNetInput>,
}

/// Opens the inputs of the show file `text`, and of timecode on `timecode` if it is given.
fn open(text: &str, timecode: Option<&str>) -> Opened {
    #[derive(serde::Deserialize)]
    struct Show {
        dmx_in: Vec<Settings>,
    }
    let show: Show = toml::from_str(text).unwrap();
    let mut problems = Vec::new();
    check_all(&show.dmx_in, &mut problems);
    assert!(problems.is_empty(), "{problems:?}");
    let faults = Arc::new(Faults::default());
    let context = DmxContext {
        cues: CueQueue::new(64, faults.clone()),
        faults,
        warnings: Warnings::default(),
    };
    context.cues.clock().start();
    let labels = ["salsa", "pop"].map(String::from);
    let (inputs, mut listening) =
        DmxInputs::open(&show.dmx_in, (&labels).into(), &context).unwrap();
    if let Some(listen) = timecode {
        let (cues, faults) = (context.cues.clone(), context.faults.clone());
        listening.push(art_net::timecode(listen, cues, faults).unwrap());
    }
    let art_net = art_net::open(listening).unwrap();
    Opened {
        context,
        inputs,
        art_net,
    }
}

impl Opened {
    /// Waits for the next cue.
    fn cue(&self) -> Cue {
        self.wait(|desk| desk.context.cues.pop())
    }

    fn counts(&self) -> Counts {
        self.inputs.counts().next().unwrap().1
    }

    fn wait<T>(&self, mut ready: impl FnMut(&Self) -> Option<T>) -> T {
        let end = Instant::now() + PATIENCE;
        loop {
            if let Some(found) = ready(self) {
                return found;
            }
            assert!(Instant::now() < end, "{:?}", self.counts());
            std::thread::yield_now();
        }
    }
}

fn intensity(value: f32) -> Cue {
    DanceCommand::Intensity(Some(value)).into()
}

/// Returns a source of sACN on this machine that sends `universe`.
fn source(name: &str, universe: u16) -> SacnSource {
    let mut source = SacnSource::with_ip(name, "127.0.0.1:0".parse().unwrap()).unwrap();
    source.set_is_sending_discovery(false);
    source.register_universe(universe).unwrap();
    source
}

/// Returns the levels of channels 1 and 2, after the start code.
fn levels(first: u8, second: u8) -> [u8; 3] {
    [0, first, second]
}

const PATCH: &str = "[[dmx_in.patch]]\nchannel = 1\nlabels = ['salsa', 'pop']\n[[dmx_in.patch]]\nchannel = 2\nlabel = '!intensity'\n";

#[test]
fn a_sacn_sender_launches_labels_by_multicast_on_loopback() {
    const UNIVERSE: u16 = 40_001;
    let desk = open(
        &format!("[[dmx_in]]\nuniverse = {UNIVERSE}\nlisten = '127.0.0.1:0'\n{PATCH}"),
        None,
    );
    assert_eq!(desk.counts().state, SourceState::Waiting);
    assert!(desk.context.warnings.list()[0].contains("no DMX arrives"));
    let mut low = source("low desk", UNIVERSE);
    let send = |source: &mut SacnSource, levels: [u8; 3], priority| {
        source
            .send(&[UNIVERSE], &levels, Some(priority), None, None)
            .unwrap();
    };
    send(&mut low, levels(15, 0), 100);
    assert_eq!(desk.cue(), Cue::from(Launch::plain(0)));
    assert_eq!(desk.counts().source.as_deref(), Some("low desk"));
    assert!(desk.context.warnings.list().is_empty());
    // Levels that stay send nothing, so the next cue is the fader's.
    send(&mut low, levels(15, 0), 100);
    send(&mut low, levels(19, 255), 100);
    assert_eq!(desk.cue(), intensity(1.0));
    // A source of higher priority counts alone.
    let mut high = source("high desk", UNIVERSE);
    send(&mut high, levels(20, 255), 150);
    assert_eq!(desk.cue(), Cue::from(Launch::plain(1)));
    send(&mut low, levels(10, 51), 100);
    send(&mut high, levels(20, 0), 150);
    assert_eq!(desk.cue(), intensity(0.0));
    // When it ends its stream, the other one counts again.
    high.terminate_stream(UNIVERSE, 0).unwrap();
    assert_eq!(desk.cue(), Cue::from(Launch::plain(0)));
    assert_eq!(desk.cue(), intensity(0.2));
    low.terminate_stream(UNIVERSE, 0).unwrap();
    desk.wait(|desk| (desk.counts().state == SourceState::Lost).then_some(()));
    assert_eq!((desk.counts().lost, desk.context.cues.pop()), (0, None));
    assert!(desk.context.warnings.list()[0].contains("ended its stream"));
}

#[test]
fn a_lost_sacn_source_keeps_its_levels_and_is_counted() {
    const UNIVERSE: u16 = 40_002;
    let desk = open(
        &format!("[[dmx_in]]\nuniverse = {UNIVERSE}\nlisten = '127.0.0.1:0'\n{PATCH}"),
        None,
    );
    let mut sender = source("desk", UNIVERSE);
    sender
        .send(&[UNIVERSE], &levels(25, 102), None, None, None)
        .unwrap();
    assert_eq!(desk.cue(), Cue::from(Launch::plain(1)));
    assert_eq!(desk.cue(), intensity(0.4));
    desk.wait(|desk| (desk.counts().state == SourceState::Lost).then_some(()));
    assert_eq!(desk.counts().lost, 1);
    assert_eq!(desk.context.faults.of(Fault::DmxLost), 1);
    assert_eq!(desk.context.cues.pop(), None);
    assert!(desk.context.warnings.list()[0].contains("its last levels stay"));
}

#[test]
fn one_socket_receives_art_net_timecode_and_levels() {
    // The port is free after this socket is dropped.
    let port = UdpSocket::bind("127.0.0.1:0")
        .and_then(|socket| socket.local_addr())
        .unwrap()
        .port();
    let desk = open(
        &format!(
            "[[dmx_in]]\nprotocol = 'art-net'\nuniverse = 273\nlisten = '127.0.0.1:{port}'\n{PATCH}"
        ),
        Some(&format!("127.0.0.1:{port}")),
    );
    assert_eq!(desk.art_net.len(), 1, "one socket for both");
    let to: SocketAddr = ([127, 0, 0, 1], port).into();
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    let send = |universe: u16, sequence, levels: &[u8]| {
        let output = Output {
            port_address: universe.try_into().unwrap(),
            data: levels.to_vec().into(),
            sequence,
            ..Output::default()
        };
        let bytes = ArtCommand::Output(output).write_to_buffer().unwrap();
        sender.send_to(&bytes, to).unwrap();
    };
    send(272, 1, &[15, 255]);
    send(273, 1, &[15, 0]);
    assert_eq!(desk.cue(), Cue::from(Launch::plain(0)));
    // An older packet is ignored.
    send(273, 255, &[25, 255]);
    send(273, 2, &[15, 255]);
    assert_eq!(desk.cue(), intensity(1.0));
    for bad in [
        &b"Art-Net\0\x00\x50\x00\x0e\0\0\x11\x01\x02\x01\0"[..],
        b"x",
        &[0; 3_000],
    ] {
        sender.send_to(bad, to).unwrap();
    }
    let frame = smpte_timecode::Timecode::from_frames(90_000, smpte_timecode::FrameRate::FPS_25);
    let packet = timecode::art_net::packet(frame.unwrap());
    sender.send_to(&packet, to).unwrap();
    desk.wait(|desk| desk.context.cues.pop_timecode());
    assert_eq!(desk.context.faults.of(Fault::BadDmx), 3);
    assert_eq!(desk.context.faults.of(Fault::BadTimecode), 2);
    let counts = desk.counts();
    assert_eq!((counts.packets, counts.ignored), (2, 4));
    assert_eq!(counts.source.as_deref(), Some("127.0.0.1"));
    assert_eq!(desk.context.cues.pop(), None);
}

#[test]
fn hostile_sacn_packets_are_counted_and_change_nothing() {
    const UNIVERSE: u16 = 40_003;
    // The port is free after this socket is dropped.
    let to = UdpSocket::bind("127.0.0.1:0")
        .and_then(|socket| socket.local_addr())
        .unwrap();
    let desk = open(
        &format!("[[dmx_in]]\nuniverse = {UNIVERSE}\nlisten = '{to}'\n{PATCH}"),
        None,
    );
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    for length in [0, 1, 16, 126, 638, 1_400, 9_000] {
        sender.send_to(&vec![0x41; length], to).unwrap();
    }
    let mut source = source("desk", UNIVERSE);
    source
        .send(&[UNIVERSE], &levels(15, 0), None, Some(to), None)
        .unwrap();
    assert_eq!(desk.cue(), Cue::from(Launch::plain(0)));
    assert_eq!(desk.context.faults.of(Fault::BadDmx), 7);
    assert_eq!(desk.counts().ignored, 7);
}
