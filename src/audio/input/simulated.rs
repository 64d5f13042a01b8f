//! Simulated audio services and devices, for tests of the faults of devices. In: what the devices
//! offer and refuse. Out: audio services in which an input finds these devices.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use cpal::platform::CustomHost;
use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};
use cpal::{
    Data, DeviceDescription, DeviceDescriptionBuilder, DeviceId, Error, ErrorKind, FrameCount,
    Host, HostId, InputCallbackInfo, OutputCallbackInfo, SampleFormat, StreamConfig, StreamInstant,
    SupportedBufferSize, SupportedStreamConfig, SupportedStreamConfigRange,
};

use super::devices::Service;

/// The format of an attempt to open a device: sample rate, channels, sample format.
pub(super) type Format = (u32, u16, SampleFormat);
/// Returns the error with which a device refuses the format of an attempt to open it.
type RefusedWith = Arc<dyn Fn(Format) -> Option<ErrorKind> + Send + Sync>;

/// A simulated device. Clones share the list of attempts.
#[derive(Clone)]
pub(super) struct SimulatedDevice {
    name: String,
    id: String,
    is_output: bool,
    formats: Vec<Format>,
    refusal: RefusedWith,
    /// All attempts to open the device so far.
    pub(super) attempts: Arc<Mutex<Vec<Format>>>,
}

/// Returns an input device with the name `name` and the id `id` that offers `formats`, the default
/// format first, and opens with each of them.
pub(super) fn input(name: &str, id: &str, formats: &[Format]) -> SimulatedDevice {
    SimulatedDevice {
        name: name.into(),
        id: id.into(),
        is_output: false,
        formats: formats.to_vec(),
        refusal: Arc::new(|_| None),
        attempts: Arc::default(),
    }
}

impl SimulatedDevice {
    /// Makes this device an output device.
    pub(super) fn into_output(mut self) -> Self {
        self.is_output = true;
        self
    }

    /// Makes this device refuse the formats for which `refusal` returns an error.
    pub(super) fn refusing(
        mut self,
        refusal: impl Fn(Format) -> Option<ErrorKind> + Send + Sync + 'static,
    ) -> Self {
        self.refusal = Arc::new(refusal);
        self
    }

    fn configs(&self, is_output: bool) -> std::vec::IntoIter<SupportedStreamConfigRange> {
        let range = |&(rate_hz, channels, format): &Format| {
            let size = SupportedBufferSize::Unknown;
            SupportedStreamConfigRange::new(channels, rate_hz, rate_hz, size, format)
        };
        let formats = self.formats.iter().filter(|_| self.is_output == is_output);
        formats.map(range).collect::<Vec<_>>().into_iter()
    }

    fn default_config(&self, is_output: bool) -> Result<SupportedStreamConfig, Error> {
        self.configs(is_output)
            .next()
            .map(SupportedStreamConfigRange::with_max_sample_rate)
            .ok_or(Error::new(ErrorKind::UnsupportedConfig))
    }
}

/// Returns an audio service called `name` with the devices `devices`. The first input and the first
/// output are the default devices.
pub(super) fn service(name: &'static str, devices: &[SimulatedDevice]) -> Service {
    let host = CustomHost::from_host(SimulatedHost(devices.to_vec()));
    Service::simulated(name, Host::from(host))
}

struct SimulatedHost(Vec<SimulatedDevice>);

impl SimulatedHost {
    fn first(&self, is_output: bool) -> Option<SimulatedDevice> {
        let mut devices = self.0.iter();
        devices
            .find(|device| device.is_output == is_output)
            .cloned()
    }
}

impl HostTrait for SimulatedHost {
    type Devices = std::vec::IntoIter<SimulatedDevice>;
    type Device = SimulatedDevice;

    fn is_available() -> bool {
        true
    }

    fn devices(&self) -> Result<Self::Devices, Error> {
        Ok(self.0.clone().into_iter())
    }

    fn default_input_device(&self) -> Option<SimulatedDevice> {
        self.first(false)
    }

    fn default_output_device(&self) -> Option<SimulatedDevice> {
        self.first(true)
    }
}

impl DeviceTrait for SimulatedDevice {
    type SupportedInputConfigs = std::vec::IntoIter<SupportedStreamConfigRange>;
    type SupportedOutputConfigs = std::vec::IntoIter<SupportedStreamConfigRange>;
    type Stream = SimulatedStream;

    fn description(&self) -> Result<DeviceDescription, Error> {
        Ok(DeviceDescriptionBuilder::new(&self.name).build())
    }

    fn id(&self) -> Result<DeviceId, Error> {
        Ok(DeviceId::new(HostId::Custom, &self.id))
    }

    fn supported_input_configs(&self) -> Result<Self::SupportedInputConfigs, Error> {
        Ok(self.configs(false))
    }

    fn supported_output_configs(&self) -> Result<Self::SupportedOutputConfigs, Error> {
        Ok(self.configs(true))
    }

    fn default_input_config(&self) -> Result<SupportedStreamConfig, Error> {
        self.default_config(false)
    }

    fn default_output_config(&self) -> Result<SupportedStreamConfig, Error> {
        self.default_config(true)
    }

    fn build_input_stream_raw<D, E>(
        &self,
        config: StreamConfig,
        format: SampleFormat,
        _: D,
        _: E,
        _: Option<Duration>,
    ) -> Result<SimulatedStream, Error>
    where
        D: FnMut(&Data, &InputCallbackInfo) + Send + 'static,
        E: FnMut(Error) + Send + 'static,
    {
        let attempt = (config.sample_rate, config.channels, format);
        self.attempts.lock().unwrap().push(attempt);
        match (self.refusal)(attempt) {
            Some(kind) => Err(Error::new(kind)),
            None => Ok(SimulatedStream),
        }
    }

    fn build_output_stream_raw<D, E>(
        &self,
        _: StreamConfig,
        _: SampleFormat,
        _: D,
        _: E,
        _: Option<Duration>,
    ) -> Result<SimulatedStream, Error>
    where
        D: FnMut(&mut Data, &OutputCallbackInfo) + Send + 'static,
        E: FnMut(Error) + Send + 'static,
    {
        Err(Error::new(ErrorKind::UnsupportedOperation))
    }
}

/// A stream that delivers no samples.
pub(super) struct SimulatedStream;

impl StreamTrait for SimulatedStream {
    fn play(&self) -> Result<(), Error> {
        Ok(())
    }

    fn pause(&self) -> Result<(), Error> {
        Ok(())
    }

    fn now(&self) -> StreamInstant {
        StreamInstant::new(0, 0)
    }

    fn buffer_size(&self) -> Result<FrameCount, Error> {
        Ok(256)
    }
}

impl PartialEq for SimulatedDevice {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

impl Eq for SimulatedDevice {}

impl Hash for SimulatedDevice {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.id.hash(state);
    }
}

impl fmt::Debug for SimulatedDevice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl fmt::Display for SimulatedDevice {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.name)
    }
}
