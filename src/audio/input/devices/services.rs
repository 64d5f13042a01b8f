//! The audio services of this system: PipeWire, PulseAudio, ALSA and JACK; WASAPI; CoreAudio. In:
//! nothing. Out: the services, each open or with the reason why it does not answer.

use cpal::traits::HostTrait;
use cpal::{Device, Host, HostId};

use super::candidates::FOLLOWERS;
use super::{DeviceName, JACK, silence_libraries};

/// An audio service of this system.
pub struct Service {
    /// Name of the service, such as ALSA. The variants of [`HostId`] differ from system to system;
    /// their names do not.
    pub(super) name: &'static str,
    /// The open service, or the reason why it does not answer.
    pub(super) host: Result<Host, cpal::Error>,
}

impl Service {
    /// Opens the audio service `id`. A service that hangs blocks the caller.
    pub(super) fn open(id: HostId) -> Self {
        Self {
            name: id.name(),
            host: cpal::host_from_id(id),
        }
    }

    /// Returns a service called `name` with the simulated devices of `host`.
    #[cfg(test)]
    pub(crate) fn simulated(name: &'static str, host: Host) -> Self {
        Self {
            name,
            host: Ok(host),
        }
    }

    /// Returns true if the name of this service is `name`.
    pub(super) fn is(&self, name: &str) -> bool {
        self.name.eq_ignore_ascii_case(name)
    }

    /// Returns the open service.
    ///
    /// # Errors
    /// The reason why the service does not answer.
    pub(super) fn host(&self) -> Result<&Host, cpal::Error> {
        self.host.as_ref().map_err(Clone::clone)
    }
}

/// Returns the audio services that this build supports, the preferred one first.
pub fn service_ids() -> impl Iterator<Item = HostId> {
    // The tests add a service with simulated devices to cpal's list.
    let simulated = "custom";
    cpal::ALL_HOSTS
        .iter()
        .copied()
        .filter(move |id| !id.name().eq_ignore_ascii_case(simulated))
}

/// Opens the audio services of this system, the preferred one first. Leaves out PulseAudio where
/// PipeWire answers, because both then list the same devices.
pub fn services() -> Vec<Service> {
    let mut services: Vec<_> = service_ids().map(Service::open).collect();
    let has_pipewire = |service: &Service| service.is("PipeWire") && service.host.is_ok();
    if services.iter().any(has_pipewire) {
        services.retain(|service| !service.is("PulseAudio"));
    }
    services
}

/// Returns the preferred service among `services` that answers; never JACK.
///
/// # Errors
/// No service is available.
pub(super) fn preferred(services: &[Service]) -> Result<&Host, cpal::Error> {
    let mut result = Err(cpal::Error::new(cpal::ErrorKind::HostUnavailable));
    for service in services.iter().filter(|service| !service.is(JACK)) {
        result = service.host();
        if result.is_ok() {
            break;
        }
    }
    result
}

/// Returns the default output device of the preferred audio service.
///
/// # Errors
/// The reason why there is none, as text for the user.
pub fn default_output() -> Result<Device, String> {
    let services = services();
    preferred(&services)
        .map_err(|error| error.to_string())?
        .default_output_device()
        .ok_or_else(|| "the system has none".into())
}

/// Returns the default input device and the default output device of the audio service `id`; `None`
/// for each that the service does not have or does not name.
pub fn defaults_of(id: HostId) -> [Option<DeviceName>; 2] {
    silence_libraries();
    let service = Service::open(id);
    let Ok(host) = service.host() else {
        return [None, None];
    };
    [host.default_input_device(), host.default_output_device()].map(|device| {
        let name = DeviceName::of(&device?);
        Some(name).filter(|name| !name.id.ends_with(FOLLOWERS))
    })
}

/// Returns the audio service JACK; `None` if this build or system has no JACK.
pub fn jack_host() -> Option<Host> {
    let id = service_ids().find(|id| id.name().eq_ignore_ascii_case(JACK))?;
    Service::open(id).host.ok()
}
