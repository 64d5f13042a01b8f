//! What is wrong with the sound of an input device, and what to do about it. In: each second, the
//! levels of all channels of the device and the sound check of their mix. Out: problems as text for
//! the user. Thread: main. Pure; all wording about the sound of the input is here.

use std::time::Duration;

use serde::Serialize;

use crate::audio::channels::ChannelLevel;
use corybant_core::dsp::sound_check::SoundCheck;

/// Duration of silence, of music on another channel and of channels that cancel each other before
/// they are problems.
const PROBLEM_S: f64 = 4.0;
/// Duration of silence before it is a problem of an input that delivers what the computer plays,
/// because songs have pauses.
const PAUSE_S: f64 = 10.0;
/// Duration of a very low level before it is a problem.
const QUIET_S: f64 = 10.0;
/// Peak below which the input is very quiet: -50 dBFS.
const QUIET_PEAK: f32 = 0.003_16;
/// Peak above which a channel carries a sound: -40 dBFS.
const SOUND_PEAK: f32 = 0.01;
/// Ratio of the peak of the mix to the peak of its channels below which the channels cancel each
/// other: -40 dB.
const CANCELLED_RATIO: f32 = 0.01;
/// Sample rate below which an input has no treble; headsets use such rates for calls.
const RATE_HZ_MIN: u32 = 32_000;
/// Duration over which the sample rate is measured.
const RATE_WINDOW_S: f64 = 10.0;
/// Least deviation of the measured sample rate that is a problem: 2 %. The clocks of sound cards
/// deviate by less than 0.1 %, and blocks of samples arrive with a jitter of up to 0.1 s.
const RATE_DEVIATION: f64 = 0.02;
/// A step between two measurements that is longer than this starts new measurements, because the
/// system had suspended the program.
const STEP_S_MAX: f64 = 3.0;

/// A problem of the sound of the input, for the page and the terminal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct InputProblem {
    /// Name of the problem; at most one problem of a name exists at a time.
    pub kind: &'static str,
    /// The problem and what to do about it, while it exists.
    pub text: String,
    /// The problem after it has ended.
    pub past: &'static str,
}

/// Measurements of an input device since the last ones.
#[derive(Clone, Debug, Default)]
pub struct InputSound {
    /// True if the input is what the computer plays.
    pub is_loopback: bool,
    /// Level of each channel; empty if no device is open.
    pub channels: Vec<ChannelLevel>,
    /// Sample rate that the device reports, in Hz.
    pub rate_hz: u32,
    /// Number of samples per channel that the input has delivered so far.
    pub frames: u64,
}

/// Finds the problems of the sound of an input device.
#[derive(Clone, Debug, Default)]
pub struct InputDiagnosis {
    /// True if the input is what the computer plays.
    is_loopback: bool,
    /// For how long the chosen channels have delivered exact zeros, in seconds.
    zero_s: f64,
    /// For how long the chosen channels have been very quiet, in seconds.
    quiet_s: f64,
    /// For how long only other channels have carried a sound, in seconds.
    other_s: f64,
    /// For how long the chosen channels have cancelled each other, in seconds.
    cancelled_s: f64,
    rate: RateMeter,
}

impl InputDiagnosis {
    /// Returns the problems after the next `elapsed` of sound, with the measurements `sound` of the
    /// device and the sound check `mix` of the mixed sound.
    pub fn update(
        &mut self,
        elapsed: Duration,
        sound: &InputSound,
        mix: SoundCheck,
    ) -> Vec<InputProblem> {
        if sound.channels.is_empty() || sound.is_loopback != self.is_loopback {
            *self = Self {
                is_loopback: sound.is_loopback,
                ..Self::default()
            };
        }
        if sound.channels.is_empty() {
            return Vec::new();
        }
        let levels = Levels::of(&sound.channels);
        self.count(elapsed.as_secs_f64(), &levels, mix);
        let silence_s = if self.is_loopback { PAUSE_S } else { PROBLEM_S };
        let mut problems = Vec::new();
        if self.other_s >= PROBLEM_S {
            problems.push(other_channel(&levels));
        } else if self.cancelled_s >= PROBLEM_S {
            problems.push(cancelled(&levels));
        } else if self.zero_s >= silence_s {
            problems.push(zeros(self.is_loopback));
        } else if self.quiet_s >= QUIET_S {
            problems.push(quiet(self.is_loopback, levels.chosen_peak));
        }
        if !levels.clipped.is_empty() {
            problems.push(clipping(&levels));
        }
        if mix.hum_hz > 0 {
            problems.push(hum(mix.hum_hz));
        }
        if sound.rate_hz < RATE_HZ_MIN {
            problems.push(low_rate(sound.rate_hz));
        }
        let measured = self.rate.update(elapsed.as_secs_f64(), sound);
        // An output delivers nothing while nothing plays, so a low rate is no sign there.
        let is_pause = |hz: u32| self.is_loopback && hz < sound.rate_hz;
        if let Some(measured_hz) = measured.filter(|&hz| !is_pause(hz)) {
            problems.push(rate(sound.rate_hz, measured_hz));
        }
        problems
    }

    /// Counts for how long each condition has lasted.
    fn count(&mut self, elapsed_s: f64, levels: &Levels, mix: SoundCheck) {
        let is_quiet = levels.chosen_peak < QUIET_PEAK;
        let is_cancelled = levels.chosen.len() > 1
            && levels.chosen_peak > SOUND_PEAK
            && mix.peak < levels.chosen_peak * CANCELLED_RATIO;
        for (seconds, is_so) in [
            (&mut self.zero_s, levels.chosen_peak == 0.0),
            (&mut self.quiet_s, is_quiet),
            (&mut self.other_s, is_quiet && !levels.others.is_empty()),
            (&mut self.cancelled_s, is_cancelled),
        ] {
            *seconds = if is_so { *seconds + elapsed_s } else { 0.0 };
        }
    }
}

/// The levels of the channels of an input. Channels are numbered from 1.
struct Levels {
    chosen: Vec<usize>,
    /// Largest peak of the chosen channels.
    chosen_peak: f32,
    /// The channels that are not chosen and carry a sound.
    others: Vec<usize>,
    /// The chosen channels that clipped.
    clipped: Vec<usize>,
    count: usize,
}

impl Levels {
    fn of(channels: &[ChannelLevel]) -> Self {
        let numbers = |is_meant: fn(&ChannelLevel) -> bool| -> Vec<usize> {
            let meant = (1..).zip(channels).filter(|(_, level)| is_meant(level));
            meant.map(|(number, _)| number).collect()
        };
        let chosen = channels.iter().filter(|level| level.chosen);
        Self {
            chosen: numbers(|level| level.chosen),
            chosen_peak: chosen.fold(0.0, |most, level| most.max(level.peak)),
            others: numbers(|level| !level.chosen && level.peak > SOUND_PEAK),
            clipped: numbers(|level| level.chosen && level.clipped),
            count: channels.len(),
        }
    }
}

/// Measures the sample rate of a device by the clock.
#[derive(Clone, Debug, Default)]
struct RateMeter {
    /// Sample rate that the device reports; a change starts a new measurement.
    rate_hz: u32,
    /// Number of delivered frames at the start of the measurement.
    first_frame: u64,
    /// Duration of the measurement so far; `None` before the first one.
    seconds: Option<f64>,
    /// The last measured rate, if it deviates; two deviating measurements in a row are a problem.
    deviating_hz: Option<u32>,
    /// The rate to report.
    reported_hz: Option<u32>,
}

impl RateMeter {
    /// Returns the measured sample rate in Hz if it has deviated in the last two measurements.
    fn update(&mut self, elapsed_s: f64, sound: &InputSound) -> Option<u32> {
        let is_new = self.rate_hz != sound.rate_hz || sound.frames < self.first_frame;
        let Some(seconds) = self.seconds.filter(|_| !is_new && elapsed_s <= STEP_S_MAX) else {
            *self = Self {
                rate_hz: sound.rate_hz,
                first_frame: sound.frames,
                seconds: Some(0.0),
                ..Self::default()
            };
            return None;
        };
        let seconds = seconds + elapsed_s;
        self.seconds = Some(seconds);
        if seconds >= RATE_WINDOW_S {
            let measured = (sound.frames - self.first_frame) as f64 / seconds;
            let said = f64::from(sound.rate_hz);
            let deviating = ((measured - said).abs() > RATE_DEVIATION * said)
                .then_some(measured.round() as u32);
            self.reported_hz = deviating.filter(|_| self.deviating_hz.is_some());
            (self.deviating_hz, self.first_frame) = (deviating, sound.frames);
            self.seconds = Some(0.0);
        }
        self.reported_hz
    }
}

fn problem(kind: &'static str, text: impl Into<String>, past: &'static str) -> InputProblem {
    InputProblem {
        kind,
        text: text.into(),
        past,
    }
}

/// Returns the channels `numbers` as text: `channel 3`, `channels 1 and 2`, `channels 1 to 8`.
fn channels(numbers: &[usize]) -> String {
    match numbers {
        [one] => format!("channel {one}"),
        [one, two] => format!("channels {one} and {two}"),
        [first, .., last] if last - first + 1 == numbers.len() => {
            format!("channels {first} to {last}")
        }
        numbers => {
            let numbers: Vec<String> = numbers.iter().map(usize::to_string).collect();
            format!("channels {}", numbers.join(", "))
        }
    }
}

fn zeros(is_loopback: bool) -> InputProblem {
    let text = match (is_loopback, cfg!(target_os = "macos")) {
        (true, false) => {
            "the computer plays nothing: start the music, or choose a microphone as the audio input"
        }
        (true, true) => {
            "the computer plays nothing, or Corybant may not record it: start the music; allow Corybant, or the terminal in which it \
             runs, under System Settings > Privacy & Security > Screen & System Audio Recording"
        }
        (false, false) => {
            "the input delivers nothing but zeros: it is muted, switched off or unplugged; check cable, mute switch and the input level \
             in the sound settings"
        }
        (false, true) => {
            "the input delivers nothing but zeros: allow Corybant, or the terminal in which it runs, under System Settings > Privacy & \
             Security > Microphone; check also that the input is not muted"
        }
    };
    problem("silence", text, "the input was silent for a while")
}

fn quiet(is_loopback: bool, peak: f32) -> InputProblem {
    let db = (20.0 * peak.max(1e-6).log10()).round();
    let remedy = if is_loopback {
        "raise the volume in the program that plays"
    } else {
        "raise the input level, or check that the music is on this input"
    };
    let text = format!("the input is very quiet (peak {db} dBFS): {remedy}");
    problem("quiet", text, "the input was very quiet for a while")
}

fn other_channel(levels: &Levels) -> InputProblem {
    let (others, chosen) = (channels(&levels.others), channels(&levels.chosen));
    let text = format!(
        "the music is on {others}, but the show listens to {chosen}: choose {others} under machine > calibrate, or set audio.channels = {:?}",
        levels.others
    );
    problem("channel", text, "the music was on another channel")
}

fn cancelled(levels: &Levels) -> InputProblem {
    let text = format!(
        "{} cancel each other, as a balanced cable in a stereo input makes them do: choose only one of them under machine > calibrate",
        channels(&levels.chosen)
    );
    problem("phase", text, "the channels cancelled each other")
}

fn clipping(levels: &Levels) -> InputProblem {
    let place = if levels.count > 1 {
        format!(" on {}", channels(&levels.clipped))
    } else {
        String::new()
    };
    let text = format!("the input clips{place}: lower the input level, or the level of the mixer");
    problem("clipping", text, "the input clipped")
}

fn hum(hz: u8) -> InputProblem {
    let text =
        format!("the input has a {hz} Hz hum: look for a ground loop or an unbalanced cable");
    problem("hum", text, "the input had a mains hum")
}

fn low_rate(rate_hz: u32) -> InputProblem {
    let text = format!(
        "the input has only {rate_hz} samples per second, as a headset has in a call: end the call, or choose another audio input"
    );
    problem("low rate", text, "the input had a low sample rate")
}

fn rate(said_hz: u32, measured_hz: u32) -> InputProblem {
    let text = format!(
        "the input delivers {measured_hz} samples per second instead of {said_hz}: set the same sample rate on the device and in the \
         sound settings, or choose another audio input"
    );
    problem("rate", text, "the input delivered samples at a wrong rate")
}

#[cfg(test)]
mod tests;
