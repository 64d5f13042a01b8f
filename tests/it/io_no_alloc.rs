//! Tests that sending poses and processing MIDI notes allocates no memory: both run under an
//! allocator that ends the process otherwise.
#![allow(clippy::unwrap_used)]

use std::net::UdpSocket;
use std::process::Command;
use std::sync::Arc;

use assert_no_alloc::assert_no_alloc;
use corybant::midi::MidiMapper;
use corybant::osc::output::{Kind, Output, Settings};
use corybant::rt::cue_queue::CueQueue;
use corybant_core::cue::midi::{Control, MapEntry};
use corybant_core::encode::Moment;
use corybant_core::encode::template::Layout;
use corybant_core::fault::{Fault, Faults};
use corybant_core::motion::humanoid::Bone;
use corybant_core::motion::{Joint, Pose, Skeleton};
use corybant_core::time::Seconds;
use glam::{Quat, Vec3};

const TRIP: &str = "CORYBANT_TEST_TRIP_THE_ALLOCATOR";

#[test]
fn the_allocator_really_ends_the_process() {
    if std::env::var_os(TRIP).is_some() {
        let bytes = assert_no_alloc(|| vec![0_u8; 100]);
        println!("still here with {} bytes", bytes.len());
        return;
    }
    let me = std::env::current_exe().unwrap();
    let tripped = Command::new(me)
        .args(["the_allocator_really_ends_the_process"])
        .env(TRIP, "1")
        .output()
        .unwrap();
    assert!(
        !tripped.status.success(),
        "an allocation went unnoticed: {}",
        String::from_utf8_lossy(&tripped.stdout)
    );
}

#[test]
fn sending_poses_allocates_nothing() {
    let joint = |(i, bone): (usize, &Bone)| Joint {
        name: bone.name().into(),
        parent: i.checked_sub(1),
        offset: Vec3::Y * 0.1,
        ends: Vec::new(),
    };
    let skeleton = Skeleton {
        joints: Bone::ALL.iter().enumerate().map(joint).collect(),
    };
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let to = socket.local_addr().unwrap().to_string();
    let faults = Arc::new(Faults::default());
    let mut pose = Pose::rest(skeleton.len());
    let layout: Layout = toml::from_str(
        "names = 'vrm'\neuler = 'xyz'\n[[message]]\naddress = '/{joint}'\nargs = ['joint', 'px', 'qw', 'ex']\n\
         [[message]]\naddress = '/beat'\nargs = ['number', 'beat', 'bpm']\n",
    )
    .unwrap();
    let both = || [to.clone(), to.clone()].into_iter().collect();
    for (kind, to) in [
        (Kind::Vmc, both()),
        (Kind::Plain, both()),
        (Kind::Vrchat, both()),
        (Kind::Template, both()),
        (Kind::Vmc, "127.0.0.1:0".into()),
    ] {
        let layout = if kind == Kind::Template {
            layout.clone()
        } else {
            Layout::default()
        };
        let settings = Settings {
            kind,
            to,
            layout,
            ..Settings::default()
        };
        let mut output = Output::open(&settings, 1, &skeleton, faults.clone()).unwrap();
        assert_no_alloc(|| {
            for number in 0..500 {
                pose.rotations[3] = Quat::from_rotation_x(number as f32 * 0.01);
                output.send(
                    &pose,
                    &Moment {
                        time: Seconds(number as f64 / 60.0),
                        number,
                        ..Moment::default()
                    },
                );
            }
        });
    }
    // Four datagrams a pose for the output that is refused; that path must not allocate either.
    assert_eq!(faults.of(Fault::SendFailed), 2000);
}

#[test]
fn processing_notes_allocates_nothing() {
    let faults = Arc::new(Faults::default());
    let queue = CueQueue::new(8, faults.clone());
    let salsa = || MapEntry {
        label: "salsa".into(),
        ..MapEntry::default()
    };
    let map = [
        salsa().of(Control::Note(36), None),
        salsa().of(Control::Cc(20), None),
        salsa().of(Control::Program(3), None),
        MapEntry {
            record: true,
            ..salsa()
        }
        .of(Control::Note(37), None),
    ];
    let mut mapper =
        MidiMapper::new(&map, &["salsa".into()], queue.clone(), faults.clone()).unwrap();
    assert_no_alloc(|| {
        for bytes in [
            &[0x90, 36, 100][..],
            &[0x90, 36, 0],
            &[0x90],
            &[],
            &[0xf0, 1, 2, 3],
            &[0xb0, 20, 127],
            &[0xb0, 20, 0],
            &[0xc0, 3],
            &[0x90, 37, 100],
        ] {
            for _ in 0..20 {
                mapper.process(bytes);
            }
        }
    });
    assert_eq!(
        (faults.of(Fault::CueDropped), faults.of(Fault::BadMidi)),
        (33, 40)
    );
    assert!(queue.pop().is_some());
}
