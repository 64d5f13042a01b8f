//! The devices of one audio service whose sound a show can use. In: an audio service. Out: its input
//! devices, and its output devices whose played sound can be captured (loopback).
//!
//! The services offer loopback in different ways. WASAPI and CoreAudio open an input stream on an
//! output device. PipeWire does the same, and lists its output devices as input devices too.
//! PulseAudio has an input device "NAME.monitor" for each output device. ALSA and JACK have none.

use cpal::Device;
use cpal::traits::{DeviceTrait, HostTrait};

use super::DeviceName;
use super::services::Service;

/// End of the id of a PulseAudio input device that delivers the sound of an output device.
const MONITOR: &str = ".monitor";
/// End of the ids of the devices with which PipeWire follows the default device of the system. They
/// are no devices of their own, so they are not listed.
pub(super) const FOLLOWERS: &str = "_default";
/// Id of the streams of this program. PipeWire lists them as input devices too.
const OWN_STREAM: &str = "corybant";

/// A device whose sound a show can use.
pub(super) struct Candidate {
    pub(super) device: Device,
    pub(super) name: DeviceName,
    /// True if the sound is what an output device plays; false for the sound of an input device.
    pub(super) is_loopback: bool,
}

/// Returns the devices of `service` whose sound a show can use.
///
/// # Errors
/// The service does not answer, or does not list its devices.
pub(super) fn candidates(service: &Service) -> Result<Vec<Candidate>, cpal::Error> {
    let is_pipewire = service.is("PipeWire");
    let devices = service
        .host()?
        .devices()?
        .map(|device| (DeviceName::of(&device), device));
    let candidates = devices
        .filter(|(name, _)| {
            !(is_pipewire && (name.id.ends_with(FOLLOWERS) || name.id == OWN_STREAM))
        })
        .map(|(name, device)| Candidate {
            is_loopback: is_loopback(service, &device, &name),
            device,
            name,
        })
        .filter(|candidate| candidate.is_loopback || candidate.device.supports_input());
    Ok(candidates.collect())
}

fn is_loopback(service: &Service, device: &Device, name: &DeviceName) -> bool {
    match service.name.to_lowercase().as_str() {
        "pipewire" | "wasapi" => device.supports_output(),
        // A stream on a device that also has inputs records these inputs.
        "coreaudio" => device.supports_output() && !device.supports_input(),
        "pulseaudio" => name.id.ends_with(MONITOR),
        _ => false,
    }
}

/// Returns the device from which `service` delivers the sound of the default output device; `None`
/// if the service does not answer, or has no loopback or no output device.
pub(super) fn default_loopback(service: &Service) -> Option<Device> {
    let output = service.host().ok()?.default_output_device()?;
    match service.name.to_lowercase().as_str() {
        "pipewire" | "wasapi" | "coreaudio" => Some(output),
        "pulseaudio" => {
            let monitor = DeviceName::of(&output).id + MONITOR;
            let found = candidates(service).ok()?.into_iter();
            found
                .filter(|candidate| candidate.name.id == monitor)
                .map(|candidate| candidate.device)
                .next()
        }
        _ => None,
    }
}
