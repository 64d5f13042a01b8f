//! Live audio input: from an audio device to mono samples at
//! [`SAMPLE_RATE`](corybant_core::dsp::SAMPLE_RATE).
//!
//! In: the device that the show file names. Out: [`AudioIn`], from which the show thread reads
//! samples. Threads: the callback of the device fills a ring buffer (see `callback`); the
//! supervisor thread "audio-watch" opens the device, monitors it, opens it again after a loss and
//! replaces it on request; the show thread only empties the ring buffer and never waits for either.

pub mod devices;
pub mod diagnosis;
mod monitor;
mod settings;
mod source;
mod supervisor;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

pub use self::devices::{DeviceError, DeviceList, devices};
use self::devices::{Service, services};
pub use self::settings::{FILE_PREFIX, Settings};
pub use self::source::Source;
use self::supervisor::{Exchange, FirstResult, Request, Supervisor};
use crate::audio::channels::Channels;
use crate::rt::atomic_ms::AtomicMs;
use crate::rt::warnings::Warnings;
use corybant_core::fault::Faults;
use corybant_core::time::Seconds;
use corybant_core::timecode::Reading;

/// Subject under which the warnings about the audio input are listed.
const WARNING_TOPIC: &str = "audio input";
/// Longest time for which the start of a show waits for an audio system that does not answer. After
/// this time the show starts without sound.
const START_TIMEOUT: Duration = Duration::from_secs(5);
/// Longest time for which a request for another device waits for the audio system.
const REPLACE_TIMEOUT: Duration = Duration::from_secs(15);
/// Longest time for which the end of a show waits until the input device is closed.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(2);
/// Largest allowed input latency in the settings, in milliseconds; a larger value is refused.
pub const INPUT_LATENCY_MS_MAX: f64 = 500.0;

/// The live audio input of a show. A lost device is opened again.
///
/// Thread: created on any thread, then used by the show thread only. Allocates: never in
/// [`AudioIn::read`].
pub struct AudioIn {
    /// Reader of the open device's samples; `None` until a device was opened.
    source: Option<Source>,
    exchange: Arc<Exchange>,
    /// Number of times that the show has begun to read the samples of a newly opened device.
    open_count: u64,
    latency_setting: AtomicMs,
    channels: Channels,
    /// Text for the user about the device that was opened at the start of the show; `None` if none
    /// was opened.
    description: Option<String>,
    /// True if the device delivers what an output plays; the supervisor thread sets it.
    is_loopback: Arc<AtomicBool>,
    requests: Sender<Request>,
    /// Handle of the thread that opens and monitors the device; `None` once the thread has been
    /// joined.
    supervisor: Option<JoinHandle<()>>,
}

/// Handle that replaces the device of an [`AudioIn`] during the show.
#[derive(Clone)]
pub struct InputControl(Sender<Request>);

impl InputControl {
    /// Opens the device that `settings` name, and uses it and the channels in `settings` instead of
    /// the current device. The settings of the latency are not used.
    ///
    /// # Errors
    /// [`DeviceError`] if the device cannot be opened, or if the audio system does not answer. The
    /// current device and channels then stay in use.
    pub fn replace(&self, settings: &Settings) -> Result<(), DeviceError> {
        let (reply, result) = channel();
        let request = Request::Replace {
            settings: Box::new(settings.clone()),
            reply,
        };
        let refused = |reason: &str| DeviceError::Refused {
            device: settings.input.clone(),
            reason: reason.into(),
            remedy: "start the show again, or choose another device",
        };
        self.0
            .send(request)
            .map_err(|_| refused("the audio thread has ended"))?;
        result
            .recv_timeout(REPLACE_TIMEOUT)
            .unwrap_or_else(|error| {
                Err(refused(match error {
                    RecvTimeoutError::Timeout => "the audio system does not answer",
                    RecvTimeoutError::Disconnected => "the audio thread has ended",
                }))
            })
    }
}

impl AudioIn {
    /// Copies the samples that have arrived since the last call to the start of `mono` and returns
    /// their number.
    ///
    /// The samples are mono at [`SAMPLE_RATE`](corybant_core::dsp::SAMPLE_RATE). Up to two seconds
    /// of samples that do not fit into `mono` are kept for the next call. Returns 0 if no device is
    /// open.
    pub fn read(&mut self, mono: &mut [f32]) -> usize {
        if !self.exchange.old.is_full()
            && let Some(new) = self.exchange.new.pop()
        {
            self.open_count += 1;
            if let Some(old) = self.source.replace(new) {
                // The queue `old` has room, because only this thread pushes into it.
                let _ = self.exchange.old.push(old);
            }
        }
        self.source.as_mut().map_or(0, |source| source.read(mono))
    }

    /// Calls `each` for each frame of timecode in the samples that the last call of
    /// [`AudioIn::read`] has read. `now` is the show time.
    pub fn read_timecode(&mut self, now: Seconds, each: &mut dyn FnMut(Reading)) {
        let latency = self.latency_setting.get();
        if let Some(source) = &mut self.source {
            source.read_timecode(now, &mut |reading| each(reading.later(-latency)));
        }
    }

    /// Returns true while an input device is open and has delivered sound.
    pub fn is_live(&self) -> bool {
        self.exchange.is_live.load(Ordering::Relaxed)
    }

    /// Returns the number of times that the show has begun to read the samples of a newly opened
    /// device. Each increase after the first one means that the sound was interrupted.
    pub fn open_count(&self) -> u64 {
        self.open_count
    }

    /// Returns the input latency: the time from a sound in the room until its samples are read. It
    /// is the latency in the settings plus the latency of resampling.
    pub fn latency(&self) -> Seconds {
        self.latency_setting.get()
            + Seconds(
                self.source
                    .as_ref()
                    .map_or(0.0, |source| source.latency_s()),
            )
    }

    /// Returns the setting `audio.input_latency_ms`, which can change during the show.
    pub fn latency_setting(&self) -> &AtomicMs {
        &self.latency_setting
    }

    /// Returns the channels of the input device with their peak levels. The choice of the channels
    /// that are mixed can change during the show.
    pub fn channels(&self) -> &Channels {
        &self.channels
    }

    /// Returns a handle that replaces the device during the show.
    pub fn control(&self) -> InputControl {
        InputControl(self.requests.clone())
    }

    /// Returns a shared flag: true if the device delivers what an output plays (loopback).
    pub fn is_loopback(&self) -> &Arc<AtomicBool> {
        &self.is_loopback
    }

    /// Returns a text for the user about the device that was opened at the start of the show and
    /// about its format; `None` if none was opened.
    pub fn description(&self) -> Option<&str> {
        self.description.as_deref()
    }
}

impl Drop for AudioIn {
    fn drop(&mut self) {
        // If the thread has ended already, there is nothing to stop.
        let _ = self.requests.send(Request::Stop);
        let Some(supervisor) = self.supervisor.take() else {
            return;
        };
        // An audio server that hangs must not block the end of the show.
        let end = Instant::now() + CLOSE_TIMEOUT;
        while !supervisor.is_finished() && Instant::now() < end {
            std::thread::park_timeout(Duration::from_millis(5));
        }
        if supervisor.is_finished() {
            let _ = supervisor.join();
        }
    }
}

/// Opens the input device that `settings` name, and opens it again after a loss.
///
/// A missing device is no error: the input sets a warning and opens the device when it appears.
/// Returns after 5 s at most. `faults` counts lost samples and lost devices.
///
/// # Errors
/// [`DeviceError::Ambiguous`] if the name means several devices, [`DeviceError::TooFewChannels`] if
/// the device lacks a channel, [`DeviceError::Thread`] if the system cannot start a thread.
pub fn open(
    settings: &Settings,
    faults: &Arc<Faults>,
    warnings: &Warnings,
) -> Result<AudioIn, DeviceError> {
    open_among(Box::new(services), settings, faults, warnings)
}

/// Returns the audio services that are available now.
type FindServices = Box<dyn Fn() -> Vec<Service> + Send>;

/// Opens an input device of one of the audio services that `find_services` returns; the other
/// parameters and the errors are those of [`open()`].
fn open_among(
    find_services: FindServices,
    settings: &Settings,
    faults: &Arc<Faults>,
    warnings: &Warnings,
) -> Result<AudioIn, DeviceError> {
    let exchange = Arc::<Exchange>::default();
    let (requests, received_requests) = channel();
    let (sender, receiver) = channel();
    let channels = Channels::new(&settings.channels);
    let is_loopback = Arc::new(AtomicBool::new(devices::is_loopback(&settings.input)));
    let supervisor = Supervisor {
        find_services,
        input: settings.input.clone(),
        channels: channels.clone(),
        faults: faults.clone(),
        warnings: warnings.clone(),
        exchange: exchange.clone(),
        requests: received_requests,
        last_device: None,
        is_loopback: is_loopback.clone(),
    };
    let thread = std::thread::Builder::new().name("audio-watch".into());
    let supervisor = thread
        .spawn(move || supervisor.run(&sender))
        .map_err(|source| DeviceError::Thread { source })?;
    let description = wait_for_device(&receiver, settings, warnings, START_TIMEOUT)?;
    Ok(AudioIn {
        source: None,
        exchange,
        open_count: 0,
        latency_setting: AtomicMs::new(settings.input_latency_ms),
        channels,
        description,
        is_loopback,
        requests,
        supervisor: Some(supervisor),
    })
}

/// Waits up to `timeout` for the result of the supervisor thread's first attempt to open the
/// device. Without a result the show starts without sound.
fn wait_for_device(
    receiver: &Receiver<FirstResult>,
    settings: &Settings,
    warnings: &Warnings,
    timeout: Duration,
) -> FirstResult {
    match receiver.recv_timeout(timeout) {
        Ok(result) => result,
        Err(RecvTimeoutError::Timeout) => {
            let text = format!(
                "the audio system has not answered for {} s; the show goes on without sound until it answers",
                timeout.as_secs()
            );
            warnings.set(WARNING_TOPIC, &text);
            Ok(None)
        }
        Err(RecvTimeoutError::Disconnected) => Err(DeviceError::Refused {
            device: settings.input.clone(),
            reason: "the audio thread has ended".into(),
            remedy: "please report this",
        }),
    }
}

#[cfg(test)]
mod device_faults;
#[cfg(test)]
mod simulated;
#[cfg(test)]
mod tests;
