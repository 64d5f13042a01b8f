//! Tests of the faults of audio devices: each gives a message and another attempt, never a panic and
//! never the wrong device.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use cpal::{ErrorKind, SampleFormat};

use super::simulated::{Format, SimulatedDevice, input, service};
use super::*;

const CD: Format = (48_000, 2, SampleFormat::F32);

/// Attempts to open the input `name` among `devices` of the audio service `host`. Returns the
/// description of the open device or the message, and the warnings that the user sees.
fn open_in(
    host: &'static str,
    name: &str,
    devices: &[SimulatedDevice],
) -> (Result<Option<String>, String>, Vec<String>) {
    let (devices, warnings) = (devices.to_vec(), Warnings::default());
    let settings = Settings {
        input: name.into(),
        ..Settings::default()
    };
    let find = Box::new(move || vec![service(host, &devices)]);
    let opened = open_among(find, &settings, &Arc::default(), &warnings);
    let description = opened.map(|input| input.description().map(String::from));
    let list = warnings.list();
    (description.map_err(|error| error.to_string()), list)
}

/// Returns the warning of an input that does not open now and is tried again.
fn warning(name: &str, devices: &[SimulatedDevice]) -> String {
    let (opened, warnings) = open_in("ALSA", name, devices);
    assert_eq!(opened, Ok(None));
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0].ends_with("opens the input when it is available"),
        "{warnings:?}"
    );
    warnings[0].clone()
}

#[test]
fn a_device_that_vanishes_while_it_is_opened_is_named() {
    let device =
        input("USB Mixer", "hw:1", &[CD]).refusing(|_| Some(ErrorKind::DeviceNotAvailable));
    let other = input("Webcam", "hw:2", &[CD]);
    let text = warning("USB Mixer", &[device.clone(), other.clone()]);
    assert!(text.contains("cannot open USB Mixer"), "{text}");
    assert!(
        text.contains("disconnected; connect it and switch it on"),
        "{text}"
    );
    assert_eq!(device.attempts.lock().unwrap().len(), 1, "no other format");
    assert!(other.attempts.lock().unwrap().is_empty(), "no other device");
}

#[test]
fn a_device_that_another_program_uses_alone_is_opened_when_it_is_free() {
    let (is_free, warnings) = (Arc::new(AtomicBool::new(false)), Warnings::default());
    let free = is_free.clone();
    let refusal = move |_| (!free.load(Ordering::Relaxed)).then_some(ErrorKind::DeviceBusy);
    let device = input("Line", "hw:1", &[CD]).refusing(refusal);
    let find = Box::new(move || vec![service("ALSA", std::slice::from_ref(&device))]);
    let settings = Settings {
        input: "Line".into(),
        ..Settings::default()
    };
    let opened = open_among(find, &settings, &Arc::default(), &warnings).unwrap();
    assert_eq!(opened.description(), None);
    let text = warnings.list().concat();
    assert!(text.contains("another program uses it alone"), "{text}");
    is_free.store(true, Ordering::Relaxed);
    let start = Instant::now();
    while !warnings.list().is_empty() {
        assert!(start.elapsed() < Duration::from_secs(60), "{warnings:?}");
        std::thread::park_timeout(Duration::from_millis(5));
    }
}

#[test]
fn the_sound_of_an_output_in_exclusive_use_is_awaited() {
    let busy = |_| Some(ErrorKind::DeviceBusy);
    let output = input("Speakers", "{1}", &[CD]).into_output().refusing(busy);
    let microphone = input("Microphone", "{2}", &[CD]);
    let devices = [output, microphone.clone()];
    for name in ["output", "output:Speakers"] {
        let (opened, warnings) = open_in("WASAPI", name, &devices);
        assert_eq!(opened, Ok(None), "{name}");
        let text = warnings.concat();
        assert!(text.contains("cannot open Speakers"), "{text}");
        assert!(text.contains("another program uses it alone"), "{text}");
    }
    assert!(microphone.attempts.lock().unwrap().is_empty());
}

#[test]
fn neither_of_two_devices_of_one_name_is_taken_silently() {
    let ids = ["alsa_input.usb-1", "alsa_input.usb-2"];
    let twins = ids.map(|id| input("USB Audio CODEC", id, &[CD]));
    let (opened, _) = open_in("PipeWire", "USB Audio CODEC", &twins);
    let message = opened.unwrap_err();
    for id in ids {
        assert!(
            message.contains(&format!("USB Audio CODEC [{id}]")),
            "{message}"
        );
    }
    assert!(message.contains("the whole id"), "{message}");
    assert!(
        twins
            .iter()
            .all(|twin| twin.attempts.lock().unwrap().is_empty())
    );
    let (opened, _) = open_in("PipeWire", ids[1], &twins);
    assert!(opened.unwrap().unwrap().contains("[alsa_input.usb-2]"));
    // ALSA has several ids for one device, and the same ids for each of two sound cards.
    let alsa = |card: &str| {
        ["hw", "plughw"].map(|kind| input("Mixer", &format!("{kind}:CARD={card},DEV=0"), &[CD]))
    };
    assert!(open_in("ALSA", "Mixer", &alsa("A")).0.is_ok());
    let both = [alsa("A"), alsa("B")].concat();
    let message = open_in("ALSA", "Mixer", &both).0.unwrap_err();
    assert!(message.contains("plughw:CARD=B,DEV=0"), "{message}");
}

#[test]
fn a_device_without_channels_is_refused() {
    for formats in [vec![(48_000, 0, SampleFormat::F32)], vec![]] {
        let device = input("Dead", "hw:1", &formats);
        let (opened, warnings) = open_in("ALSA", "default", &[device]);
        assert_eq!(opened, Ok(None));
        assert!(
            warnings.concat().contains("cannot open Dead"),
            "{warnings:?}"
        );
    }
    let device = input("Dead", "hw:1", &[(48_000, 0, SampleFormat::F32)]);
    let text = warning("default", &[device]);
    assert!(
        text.contains("it has no channels; choose another device"),
        "{text}"
    );
}

#[test]
fn the_next_format_is_tried_if_a_device_refuses_one_that_it_lists() {
    let formats = [
        CD,
        (48_000, 2, SampleFormat::I16),
        (44_100, 2, SampleFormat::I16),
    ];
    let refusal = |(rate_hz, _, format)| {
        (format == SampleFormat::F32 || rate_hz == 48_000).then_some(ErrorKind::UnsupportedConfig)
    };
    let device = input("Liar", "hw:1", &formats).refusing(refusal);
    let (opened, warnings) = open_in("ALSA", "Liar", std::slice::from_ref(&device));
    assert_eq!(warnings, [""; 0]);
    assert!(
        opened
            .unwrap()
            .unwrap()
            .ends_with("44100 Hz, 2 channels, i16")
    );
    let all = device.refusing(|_| Some(ErrorKind::UnsupportedConfig));
    let text = warning("Liar", std::slice::from_ref(&all));
    assert!(
        text.contains("choose another format in the sound settings"),
        "{text}"
    );
    assert!(
        all.attempts.lock().unwrap().contains(&formats[2]),
        "all formats are tried"
    );
}

#[test]
fn a_communications_device_opens_with_its_low_rate() {
    let device = input("Headset", "{3}", &[(16_000, 1, SampleFormat::I16)]);
    let (opened, warnings) = open_in("WASAPI", "Headset", &[device]);
    assert!(
        opened
            .unwrap()
            .unwrap()
            .ends_with("16000 Hz, 1 channels, i16")
    );
    assert_eq!(warnings, [""; 0]);
}

#[test]
fn names_of_any_script_and_length_select_their_device() {
    let long = "🎛️".repeat(100);
    for name in ["🎤 Mic 👩‍🎤", "מיקרופון", "\u{202e}cim", &long] {
        let devices = [input("Webcam", "hw:0", &[CD]), input(name, "hw:1", &[CD])];
        let (opened, _) = open_in("ALSA", name, &devices);
        let description = opened.unwrap().unwrap();
        assert!(
            description.starts_with(&format!("{name} [hw:1]")),
            "{description}"
        );
        let text = open_in("ALSA", "Focusrite", &devices).1.concat();
        let shown = corybant_core::text::one_line(name);
        assert!(text.contains(&*shown), "{text}");
    }
}
