//! Audio services and devices, MIDI ports and permissions for `corybant doctor`. In: the system.
//! Out: lines of the page. No device is opened. Ids of devices are left out, because they contain
//! serial numbers and network addresses.

use std::time::Duration;

use super::page::Line;
use super::privacy::Privacy;
use super::probe::Probe;
use crate::audio::input::devices::{
    DEFAULT, DeviceName, HostDevices, InputDevice, OUTPUT, defaults_of, devices_of, find_input,
    input_configs, service_ids, silence_libraries,
};
use crate::midi::{self, Backend};

/// Largest number of devices of one audio service that are listed.
const DEVICES_MAX: usize = 12;

/// Starts the checks of audio and MIDI: one for each audio service, because each can hang.
pub(super) fn probes(limit: Duration, privacy: &Privacy) -> Vec<Probe> {
    let services = service_ids().map(|id| {
        let work = move |privacy: &Privacy| {
            let mut lines = service(&devices_of(id), privacy);
            lines.extend(defaults(defaults_of(id), privacy));
            lines
        };
        Probe::start(format!("Audio: {}", id.name()), limit, privacy, work)
    });
    let inputs = Probe::start("Audio inputs of a show", limit, privacy, inputs);
    let mut probes: Vec<Probe> = services.collect();
    probes.extend([
        inputs,
        Probe::start("MIDI ports", limit, privacy, ports),
        Probe::start("Permissions", limit, privacy, permissions),
    ]);
    probes
}

/// Returns the devices of the audio service `found`.
fn service(found: &HostDevices, privacy: &Privacy) -> Vec<Line> {
    if let Some(problem) = &found.problem {
        return vec![Line::fact("devices", privacy.clean(problem))];
    }
    // ALSA has several ids for one device.
    let mut devices: Vec<&InputDevice> = Vec::new();
    for input in &found.inputs {
        let same = |other: &&mut &InputDevice| {
            other.name == input.name && other.is_loopback == input.is_loopback
        };
        match devices.iter_mut().find(same) {
            Some(other) if other.channels < input.channels => *other = input,
            Some(_) => {}
            None => devices.push(input),
        }
    }
    if devices.is_empty() {
        return vec![Line::fact("devices", "none")];
    }
    let (usable, unusable): (Vec<_>, Vec<_>) =
        devices.into_iter().partition(|device| device.channels > 0);
    let items = usable.iter().map(|device| device_text(device, privacy));
    let mut lines = limited(items);
    if !unusable.is_empty() {
        let names = unusable.iter().map(|device| privacy.clean(&device.name));
        let names: Vec<String> = names.collect();
        lines.push(Line::fact("in use or not available", names.join("; ")));
    }
    lines
}

/// Returns the first [`DEVICES_MAX`] of `items` as lines, and the number of the others.
fn limited(items: impl ExactSizeIterator<Item = String>) -> Vec<Line> {
    let more = items.len().saturating_sub(DEVICES_MAX);
    let mut lines: Vec<Line> = items.take(DEVICES_MAX).map(Line::Item).collect();
    if more > 0 {
        lines.push(Line::Item(format!("and {more} more")));
    }
    lines
}

/// Returns the names of the default input and the default output of an audio service.
fn defaults(devices: [Option<DeviceName>; 2], privacy: &Privacy) -> impl Iterator<Item = Line> {
    let names = ["its default", "its output"].into_iter().zip(devices);
    names.filter_map(|(name, device)| Some(Line::fact(name, privacy.clean(&device?.name))))
}

fn device_text(device: &InputDevice, privacy: &Privacy) -> String {
    let kind = if device.is_loopback {
        " (what this output plays)"
    } else {
        ""
    };
    let name = privacy.clean(&device.name);
    let (low, high) = device.rates_hz;
    match device.channels {
        n if low == high => format!("{name}{kind}: up to {n} channels, {low} Hz"),
        n => format!("{name}{kind}: up to {n} channels, {low} to {high} Hz"),
    }
}

/// Returns the devices and formats that the inputs "default" and "output" would use.
fn inputs(privacy: &Privacy) -> Vec<Line> {
    [DEFAULT, OUTPUT]
        .into_iter()
        .map(|input| {
            let found = find_input(input, None).and_then(|device| {
                let config = input_configs(&device, 0)?.swap_remove(0);
                let (rate_hz, channels) = (config.sample_rate(), config.channels());
                let name = DeviceName::of(&device).name;
                let format = config.sample_format();
                Ok(format!(
                    "{name}, {rate_hz} Hz, {channels} channels, {format}"
                ))
            });
            match found {
                Ok(text) => Line::fact(input, privacy.clean(&text)),
                Err(error) => {
                    Line::problem(format!("{input}: {}", privacy.clean(&error.to_string())))
                }
            }
        })
        .collect()
}

/// Returns the MIDI ports of the system and of JACK.
fn ports(privacy: &Privacy) -> Vec<Line> {
    silence_libraries();
    let mut lines = match midi::ports(Backend::System) {
        Ok(ports) if ports.is_empty() => vec![Line::fact("system", "none")],
        Ok(ports) => names(&ports, privacy),
        Err(error) => vec![Line::fact("system", privacy.clean(&error.to_string()))],
    };
    if let Ok(ports) = midi::ports(Backend::Jack) {
        lines.push(Line::fact("JACK", format!("{} ports", ports.len())));
        lines.extend(names(&ports, privacy));
    }
    lines
}

fn names(ports: &[midi::PortName], privacy: &Privacy) -> Vec<Line> {
    limited(ports.iter().map(|port| privacy.clean(port.stable_name())))
}

/// Returns whether the user may use sound cards.
#[cfg(target_os = "linux")]
fn permissions(_: &Privacy) -> Vec<Line> {
    use std::io::ErrorKind;
    let cards: Vec<_> = std::fs::read_dir("/dev/snd")
        .map(|files| files.flatten().map(|file| file.path()).collect())
        .unwrap_or_default();
    let is_control = |path: &&std::path::PathBuf| {
        path.file_name()
            .is_some_and(|name| name.to_string_lossy().starts_with("controlC"))
    };
    let control = cards.iter().find(is_control);
    // Opening the control of a sound card does not disturb its streams.
    let opened = control.map(|path| std::fs::File::open(path).map(drop));
    vec![match opened {
        None => Line::fact("sound cards", "none in /dev/snd"),
        Some(Ok(())) => Line::fact("sound cards", "this user may use them"),
        Some(Err(error)) if error.kind() == ErrorKind::PermissionDenied => Line::problem(
            "this user may not use the sound cards directly: `sudo usermod -aG audio USER`, then log in again; PipeWire and PulseAudio may work without",
        ),
        Some(Err(error)) => Line::fact("sound cards", error.to_string()),
    }]
}

/// Returns where the user allows the use of the microphone; programs cannot ask without a request.
#[cfg(not(target_os = "linux"))]
fn permissions(_: &Privacy) -> Vec<Line> {
    let place = if cfg!(target_os = "macos") {
        "if an input delivers only zeros, allow the terminal under System Settings > Privacy & Security > Microphone"
    } else {
        "if no input opens, allow desktop apps under Settings > Privacy & security > Microphone"
    };
    vec![Line::fact("microphone", place)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(name: &str, channels: u16) -> InputDevice {
        InputDevice {
            name: name.into(),
            id: "alsa_input.usb-SERIAL123".into(),
            is_loopback: false,
            channels,
            rates_hz: (44_100, 48_000),
        }
    }

    #[test]
    fn each_device_is_listed_once_without_its_id() {
        let mut inputs = vec![device("Line", 0), device("Line", 2)];
        inputs.push(device("Busy", 0));
        inputs.extend((0..20).map(|i| device(&format!("Mic {i}"), 1)));
        let found = HostDevices {
            host: "ALSA".into(),
            inputs,
            problem: None,
        };
        let lines = service(&found, &Privacy::default());
        let first = "Line: up to 2 channels, 44100 to 48000 Hz";
        assert_eq!(lines[0], Line::Item(first.into()));
        assert_eq!(lines[DEVICES_MAX], Line::Item("and 9 more".into()));
        let unusable = Line::fact("in use or not available", "Busy");
        assert_eq!(lines[DEVICES_MAX + 1..], [unusable]);
        assert!(!format!("{lines:?}").contains("SERIAL123"));
    }
}
