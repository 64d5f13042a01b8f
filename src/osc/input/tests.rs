use std::sync::Arc;
use std::time::Instant;

use super::*;
use crate::osc::feedback::ShowState;
use crate::rt::cue_queue::CueQueue;
use corybant_core::cue::{Cue, DanceCommand, Launch};
use corybant_core::fault::Faults;
use corybant_core::tempo::command::TempoCommand;
use corybant_core::time::{Bpm, Seconds};
use corybant_core::timecode::Place;

const NEVER: Duration = Duration::from_secs(10);

struct Rig {
    listener: Listener,
    queue: CueQueue,
    faults: Arc<Faults>,
    sender: UdpSocket,
}

fn start(
    settings: &Settings,
    labels: &[String],
    queue: CueQueue,
    faults: Arc<Faults>,
) -> Result<Listener, OscInError> {
    let (_, state) = ShowState::channel(labels.len());
    let publisher = StatePublisher::new(state, faults.clone(), labels, &[]);
    listen(
        settings,
        OscDispatcher::new(labels, false, queue, faults),
        publisher,
    )
}

fn rig() -> Rig {
    let faults = Arc::new(Faults::default());
    let queue = CueQueue::new(64, faults.clone());
    let settings = Settings {
        listen: "127.0.0.1:0".into(),
        ..Settings::default()
    };
    let listener = start(
        &settings,
        &["Salsa".into(), "Tango".into()],
        queue.clone(),
        faults.clone(),
    )
    .unwrap();
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    sender.connect(listener.local_addr()).unwrap();
    Rig {
        listener,
        queue,
        faults,
        sender,
    }
}

impl Rig {
    /// Sends `/panic` and returns all cues up to it. Datagrams between two sockets of one
    /// machine arrive in order.
    fn cues_until_panic(&self) -> Vec<Cue> {
        self.sender.send(b"/panic\0\0,\0\0\0").unwrap();
        let (start, mut cues) = (Instant::now(), Vec::new());
        while cues.last() != Some(&Cue::Dance(DanceCommand::Panic)) {
            assert!(start.elapsed() < NEVER, "only {cues:?} arrived");
            cues.extend(self.queue.pop());
            std::thread::yield_now();
        }
        cues
    }
}

#[test]
fn cues_arrive_in_order() {
    let rig = rig();
    rig.sender.send(b"/cue/salsa\0\0,f\0\0\x3f\0\0\0").unwrap();
    rig.sender.send(b"/cue/salsa\0\0,f\0\0\0\0\0\0").unwrap();
    rig.sender.send(b"#bundle\0\0\0\0\0\0\0\0\x01\0\0\0\x14/cue/t*/cancel\0\0,\0\0\0\0\0\0\x10/cue/tango\0\0,T\0\0").unwrap();
    let expected = [
        Cue::Dance(DanceCommand::Launch(Launch::plain(0))),
        Cue::Dance(DanceCommand::Cancel { label: 1 }),
        Cue::Dance(DanceCommand::Launch(Launch::plain(1))),
        Cue::Dance(DanceCommand::Panic),
    ];
    assert_eq!(rig.cues_until_panic(), expected);
    assert_eq!(
        (
            rig.faults.of(Fault::BadOsc),
            rig.faults.of(Fault::UnknownLabel)
        ),
        (0, 0)
    );
}

#[test]
fn tempo_commands_arrive_and_bad_ones_are_counted() {
    let rig = rig();
    rig.sender.send(b"/tempo/tap\0\0,\0\0\0").unwrap();
    rig.sender.send(b"/tempo/tap\0\0,F\0\0").unwrap();
    rig.sender.send(b"/tempo/half\0,T\0\0").unwrap();
    rig.sender
        .send(b"/tempo/nudge\0\0\0\0,f\0\0\xc1\x20\0\0")
        .unwrap();
    rig.sender
        .send(b"/tempo/nudge\0\0\0\0,f\0\0\x7f\xc0\0\0")
        .unwrap();
    rig.sender.send(b"/tempo/bpm\0\0,i\0\0\0\0\0\x7d").unwrap();
    rig.sender.send(b"/tempo/bpm\0\0,i\0\0\0\0\0\x01").unwrap();
    let expected = [
        TempoCommand::Tap,
        TempoCommand::Half,
        TempoCommand::Nudge(Seconds(-0.01)),
        TempoCommand::Tempo(Bpm(125.0)),
    ]
    .map(Cue::Tempo);
    assert_eq!(
        rig.cues_until_panic(),
        [&expected[..], &[Cue::Dance(DanceCommand::Panic)]].concat()
    );
    assert_eq!(rig.faults.of(Fault::BadOsc), 2);
}

#[test]
fn bad_datagrams_are_counted_and_do_not_end_the_listener() {
    let rig = rig();
    rig.sender.send(b"/cue/rumba\0\0,\0\0\0").unwrap();
    rig.sender.send(b"nonsense").unwrap();
    rig.sender.send(b"/elsewhere\0\0,\0\0\0").unwrap();
    rig.sender.send(b"").unwrap();
    rig.sender.send(&[b'/'; DATAGRAM_MAX + 4]).unwrap();
    rig.sender
        .send(&b"#bundle\0\0\0\0\0\0\0\0\x01\0\0\x1f\0".repeat(400))
        .unwrap();
    assert_eq!(rig.cues_until_panic(), [Cue::Dance(DanceCommand::Panic)]);
    assert_eq!(
        (
            rig.faults.of(Fault::BadOsc),
            rig.faults.of(Fault::UnknownLabel)
        ),
        (5, 1)
    );
}

/// A UDP port that is free on this machine.
fn free_port() -> u16 {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.local_addr().unwrap().port()
}

/// Receives one datagram; true if it is a feedback bundle with this value at the OSC address
/// `path`.
fn receives_value(socket: &UdpSocket, path: &str, value: f32) -> bool {
    let mut datagram = [0; 2048];
    let length = socket.recv(&mut datagram).unwrap();
    let (_, packet) = rosc::decoder::decode_udp(&datagram[..length]).unwrap();
    let rosc::OscPacket::Bundle(bundle) = packet else {
        return false;
    };
    bundle.content.iter().any(|packet| {
        matches!(packet, rosc::OscPacket::Message(message)
                if message.addr == path && message.args == [rosc::OscType::Float(value)])
    })
}

#[test]
fn feedback_from_one_show_to_another_is_no_cue() {
    let watcher = UdpSocket::bind("127.0.0.1:0").unwrap();
    watcher.set_read_timeout(Some(NEVER)).unwrap();
    let ports = [free_port(), free_port()];
    let at = |port: u16| format!("127.0.0.1:{port}");
    let labels = ["Salsa".to_owned()];
    let show = |own: usize| {
        let feedback = vec![
            at(ports[1 - own]),
            watcher.local_addr().unwrap().to_string(),
        ];
        let settings = Settings {
            listen: at(ports[own]),
            feedback,
            ..Settings::default()
        };
        let faults = Arc::new(Faults::default());
        let queue = CueQueue::new(64, faults.clone());
        let (input, state) = ShowState::channel(1);
        let publisher = StatePublisher::new(state, faults.clone(), &labels, &[]);
        let dispatcher = OscDispatcher::new(&labels, false, queue.clone(), faults.clone());
        let listener = listen(&settings, dispatcher, publisher).unwrap();
        let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
        sender.connect(listener.local_addr()).unwrap();
        let rig = Rig {
            listener,
            queue,
            faults,
            sender,
        };
        (rig, input)
    };
    let (first, mut state) = show(0);
    let (second, _state) = show(1);
    // If feedback counted as cues, each show would dance because the other one does.
    state
        .input_buffer_mut()
        .lamps
        .fill(corybant_core::show::Lamp::Dancing);
    state.publish();
    while !receives_value(&watcher, "/cue/salsa", 1.0) {}
    for rig in [&first, &second] {
        assert_eq!(rig.cues_until_panic(), [Cue::Dance(DanceCommand::Panic)]);
        assert_eq!(rig.faults.of(Fault::BadOsc), 0);
    }
}

#[test]
fn a_show_cannot_send_feedback_to_itself() {
    let port = free_port();
    let settings = Settings {
        listen: format!("0.0.0.0:{port}"),
        feedback: vec![format!("127.0.0.1:{port}")],
        ..Settings::default()
    };
    let faults = Arc::new(Faults::default());
    let error = start(&settings, &[], CueQueue::new(1, faults.clone()), faults).unwrap_err();
    assert!(matches!(error, OscInError::Own { .. }), "{error}");
}

#[test]
fn a_dropped_listener_frees_the_port() {
    let rig = rig();
    let address = rig.listener.local_addr();
    assert_ne!(address.port(), 0);
    let settings = Settings {
        listen: address.to_string(),
        ..Settings::default()
    };
    let error = start(&settings, &[], rig.queue.clone(), rig.faults.clone()).unwrap_err();
    assert!(
        error.to_string().contains(&address.to_string())
            && error.to_string().contains("osc.listen"),
        "{error}"
    );
    drop(rig.listener);
    assert!(start(&settings, &[], rig.queue, rig.faults).is_ok());
}

#[test]
fn settings_report_every_problem() {
    let problems = |listen: &str| {
        let mut problems = Vec::new();
        Settings {
            listen: listen.into(),
            ..Settings::default()
        }
        .check("osc", &mut problems);
        problems
    };
    assert!(
        ["127.0.0.1:9000", "0.0.0.0:0", "localhost:9", "[::1]:9000"]
            .iter()
            .all(|listen| problems(listen).is_empty())
    );
    assert!(
        ["", "9000", ":9000", "localhost", "a:65536"]
            .iter()
            .all(|listen| problems(listen).len() == 1)
    );
    assert!(problems("9000")[0].starts_with("osc.listen is \"9000\"; it must be"));
    let feedback = |to: &str| {
        let mut problems = Vec::new();
        Settings {
            feedback: vec![to.into()],
            ..Settings::default()
        }
        .check("osc", &mut problems);
        problems
    };
    assert!(feedback("phone.local:9001").is_empty());
    assert!(
        ["9001", "phone", "phone:0", "127.0.0.1:9000"]
            .iter()
            .all(|to| feedback(to).len() == 1)
    );
    let query = |query: &str, name: &str| {
        let mut problems = Vec::new();
        Settings {
            query: query.into(),
            name: name.into(),
            ..Settings::default()
        }
        .check("osc", &mut problems);
        problems.len()
    };
    assert_eq!(
        [
            query("off", "Ça va"),
            query("0.0.0.0:9010", "x"),
            query("localhost:9010", "x"),
            query("off", "")
        ],
        [0, 0, 1, 1]
    );
    assert_eq!(query("off", &"long".repeat(16)), 1);
}

/// Windows reports a datagram that is longer than the buffer as an error instead of cutting it.
#[test]
fn long_datagrams_are_counted_on_every_system() {
    let faults = Arc::new(Faults::default());
    let queue = CueQueue::new(1, faults.clone());
    let dispatcher = OscDispatcher::new(&[], false, queue, faults.clone());
    let local = "127.0.0.1:9000".parse().unwrap();
    let feedback = Feedback::new(dispatcher.namespace(), local, &[], None);
    let mut receiver = OscReceiver {
        dispatcher,
        feedback: SharedFeedback::new(feedback),
        socket: Arc::new(UdpSocket::bind("127.0.0.1:0").unwrap()),
    };
    receiver.process_error(&Error::from_raw_os_error(10040));
    receiver.process_error(&std::io::ErrorKind::TimedOut.into());
    assert_eq!(faults.of(Fault::BadOsc), 1);
}

#[test]
fn timecode_leads_only_a_show_with_this_source_and_malformed_timecode_is_counted() {
    let faults = Arc::new(Faults::default());
    let queue = CueQueue::new(64, faults.clone());
    queue.clock().start();
    let dispatcher = || OscDispatcher::new(&[], false, queue.clone(), faults.clone());
    let mut count = 0;
    let mut send = |dispatcher: &mut OscDispatcher, bytes: &[u8]| {
        dispatcher.process(bytes, &"a test", &mut |_| {
            count += 1;
            true
        });
    };
    let (mut on, mut off) = (dispatcher().with_timecode(true), dispatcher());
    let good = b"/timecode\0\0\0,s\0\x0001:00:00:05\0";
    send(&mut on, good);
    let reading = queue.pop_timecode().unwrap();
    assert!(matches!(reading.place, Place::Frame { fields, .. } if fields.frames == 5));
    send(&mut off, good);
    send(&mut on, b"/timecode\0\0\0,s\0\x0001:00:00:30\0");
    send(&mut on, b"/timecode\0\0\0,\0\0\0");
    assert!(queue.pop_timecode().is_none());
    assert_eq!(
        (faults.of(Fault::BadOsc), faults.of(Fault::BadTimecode)),
        (1, 2)
    );
    send(&mut on, b"/timecode/engage\0\0\0\0,i\0\0\0\0\0\0");
    let engage = TempoCommand::Engage(Some(false));
    assert_eq!(queue.pop(), Some(Cue::Tempo(engage)));
    assert_eq!(count, 1, "only the switch is a message of the table");
}
