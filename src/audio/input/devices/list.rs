//! Lists the devices of all audio services. In: nothing. Out: names, ids, channels and sample rates.

use std::fmt;

use cpal::traits::DeviceTrait;
use cpal::{HostId, SupportedStreamConfigRange};

use super::candidates::{Candidate, candidates};
use super::services::{Service, services};
use super::{DeviceName, JACK, OUTPUT_PREFIX, silence_libraries};

/// A device of an audio service whose sound a show can use.
#[derive(Clone, Debug, PartialEq)]
pub struct InputDevice {
    /// Name of the device for the user.
    pub name: String,
    /// Id of the device in its audio service; `audio.input` accepts the name or the id.
    pub id: String,
    /// True if the sound is what an output device plays (loopback); `audio.input` then needs
    /// `output:` before the name or the id.
    pub is_loopback: bool,
    /// Largest number of channels of the device; 0 if the device is in use or not available.
    pub channels: u16,
    /// Lowest and highest sample rate of the device, in Hz; both are 0 if the device is in use or
    /// not available.
    pub rates_hz: (u32, u32),
}

/// The input devices of one audio service of the system, such as ALSA or JACK.
#[derive(Clone, Debug, PartialEq)]
pub struct HostDevices {
    /// Name of the audio service (driver system), such as ALSA or JACK.
    pub host: String,
    /// Input devices of the audio service.
    pub inputs: Vec<InputDevice>,
    /// Reason why the audio service lists no devices; `None` if it lists devices or if the reason
    /// is unknown.
    pub problem: Option<String>,
}

/// The input devices of all audio services; `Display` prints one device per line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DeviceList {
    /// Audio services of this machine, each with its input devices.
    pub hosts: Vec<HostDevices>,
}

impl fmt::Display for DeviceList {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for host in &self.hosts {
            match (&host.problem, host.inputs.is_empty()) {
                (Some(problem), _) => writeln!(f, "{}: {problem}", host.host)?,
                (None, true) => writeln!(f, "{}: no audio inputs", host.host)?,
                (None, false) => writeln!(f, "{}:", host.host)?,
            }
            for input in &host.inputs {
                let prefix = if input.is_loopback { OUTPUT_PREFIX } else { "" };
                write!(f, "  {}  [{prefix}{}]  ", input.name, input.id)?;
                if input.is_loopback {
                    write!(f, "what this output plays, ")?;
                }
                let (low, high) = input.rates_hz;
                match input.channels {
                    0 => writeln!(f, "in use or not available")?,
                    n if low == high => writeln!(f, "up to {n} channels, {low} Hz")?,
                    n => writeln!(f, "up to {n} channels, {low} to {high} Hz")?,
                }
            }
        }
        Ok(())
    }
}

/// Returns the devices of all audio services whose sound a show can use. On a system without audio,
/// the list is empty.
pub fn devices() -> DeviceList {
    silence_libraries();
    DeviceList {
        hosts: services().iter().map(list).collect(),
    }
}

/// Returns the devices of the audio service `id` whose sound a show can use.
pub fn devices_of(id: HostId) -> HostDevices {
    silence_libraries();
    list(&Service::open(id))
}

fn list(service: &Service) -> HostDevices {
    let (inputs, problem) = match candidates(service) {
        Ok(found) if found.is_empty() && service.is(JACK) => {
            (found, Some("no server answers".into()))
        }
        Ok(found) => (found, None),
        Err(error) => (Vec::new(), Some(error.to_string())),
    };
    HostDevices {
        host: service.name.into(),
        inputs: inputs.iter().map(describe).collect(),
        problem,
    }
}

fn describe(candidate: &Candidate) -> InputDevice {
    let device = &candidate.device;
    let configs: Vec<SupportedStreamConfigRange> = if device.supports_input() {
        device.supported_input_configs().map(Iterator::collect)
    } else {
        device.supported_output_configs().map(Iterator::collect)
    }
    .unwrap_or_default();
    let low = configs
        .iter()
        .map(SupportedStreamConfigRange::min_sample_rate)
        .min()
        .unwrap_or(0);
    let high = configs
        .iter()
        .map(SupportedStreamConfigRange::max_sample_rate)
        .max()
        .unwrap_or(0);
    let channels = configs
        .iter()
        .map(SupportedStreamConfigRange::channels)
        .max()
        .unwrap_or(0);
    let DeviceName { name, id } = candidate.name.clone();
    InputDevice {
        name,
        id,
        is_loopback: candidate.is_loopback,
        channels,
        rates_hz: (low, high),
    }
}
