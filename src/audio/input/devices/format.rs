//! Chooses the sample format of a device. In: a device and the channels that the show needs. Out:
//! sample rate, channels, sample format and block size.

use cpal::traits::DeviceTrait;
use cpal::{
    BufferSize, Device, SupportedBufferSize, SupportedStreamConfig, SupportedStreamConfigRange,
};

use super::{DeviceError, DeviceName};
use crate::audio::callback::can_use;

/// Number of samples per channel that the program requests for each block of an input device. Some
/// devices use larger blocks.
const BLOCK_FRAMES: u32 = 256;
/// Least sample rate, in Hz, that is preferred. Headsets offer a lower rate for calls, which lacks
/// the treble.
const RATE_HZ_MIN: u32 = 44_100;
/// Largest number of formats of one device that are tried.
const FORMATS_MAX: usize = 6;

/// Returns the stream formats (sample rate, channels, sample format) of `device` that contain the
/// channel number `channel_max`, counted from 1, the preferred one first; at least one, at most
/// six. For 0, any number of channels is enough. Prefers the default format of the
/// device, and a rate below 44.1 kHz only if there is no other. A device without inputs delivers
/// what it plays, in its output format.
///
/// # Errors
/// [`DeviceError::TooFewChannels`] or [`DeviceError::NoChannels`] if no format has this channel,
/// [`DeviceError::Refused`] if the device cannot be used.
pub fn input_configs(
    device: &Device,
    channel_max: u16,
) -> Result<Vec<SupportedStreamConfig>, DeviceError> {
    let name = DeviceName::of(device).name;
    let refused = |error: cpal::Error| DeviceError::refused(&name, &error);
    let (preferred, all): (_, Result<Vec<_>, _>) = if device.supports_input() {
        let all = device.supported_input_configs().map(Iterator::collect);
        (device.default_input_config(), all)
    } else {
        let all = device.supported_output_configs().map(Iterator::collect);
        (device.default_output_config(), all)
    };
    let (preferred, all) = (preferred.map_err(refused)?, all.map_err(refused)?);
    let first = choose(preferred, all.clone(), channel_max).map_err(|most| match most {
        0 => DeviceError::NoChannels {
            device: name.clone(),
        },
        most => DeviceError::TooFewChannels {
            device: name.clone(),
            wanted: channel_max,
            most,
        },
    })?;
    let mut configs = vec![first];
    for other in others(preferred, all, channel_max) {
        if configs.len() < FORMATS_MAX && !configs.contains(&other) {
            configs.push(other);
        }
    }
    Ok(configs)
}

/// Returns the formats to try after the chosen one, because some devices list formats that they then
/// refuse: the default format `preferred`, then those in `all`, the best one first.
fn others(
    preferred: SupportedStreamConfig,
    mut all: Vec<SupportedStreamConfigRange>,
    channel_max: u16,
) -> impl Iterator<Item = SupportedStreamConfig> {
    let rate_hz = preferred.sample_rate();
    all.sort_by(|a, b| b.cmp_default_heuristics(a));
    std::iter::once(preferred)
        .chain(all.into_iter().map(move |range| with_rate(range, rate_hz)))
        .filter(move |config| {
            config.channels() >= channel_max.max(1) && can_use(config.sample_format())
        })
}

/// Chooses between the default format `preferred` and the formats in `all`, as [`input_configs`]
/// describes for the first one.
///
/// # Errors
/// The largest number of channels, if no format has the channel `channel_max`.
fn choose(
    preferred: SupportedStreamConfig,
    mut all: Vec<SupportedStreamConfigRange>,
    channel_max: u16,
) -> Result<SupportedStreamConfig, u16> {
    let channel_max = channel_max.max(1);
    let fits = preferred.channels() >= channel_max && can_use(preferred.sample_format());
    if fits && preferred.sample_rate() >= RATE_HZ_MIN {
        return Ok(preferred);
    }
    all.retain(|config| can_use(config.sample_format()));
    let most = all
        .iter()
        .map(SupportedStreamConfigRange::channels)
        .max()
        .unwrap_or(0);
    if all
        .iter()
        .any(|config| config.max_sample_rate() >= RATE_HZ_MIN)
    {
        all.retain(|config| config.max_sample_rate() >= RATE_HZ_MIN);
    }
    let fewest = |least: u16| {
        let counts = all.iter().map(SupportedStreamConfigRange::channels);
        counts.filter(|&n| n >= least).min()
    };
    let count = fewest(channel_max.max(preferred.channels())).or(fewest(channel_max));
    let best = all
        .iter()
        .filter(|config| Some(config.channels()) == count)
        .max_by(|a, b| a.cmp_default_heuristics(b));
    match best {
        Some(best) => Ok(with_rate(*best, preferred.sample_rate())),
        None if fits => Ok(preferred),
        None => Err(most),
    }
}

/// Returns the format `config` with the sample rate `wanted_hz` if this rate is possible and not too
/// low, otherwise with 48 or 44.1 kHz, otherwise with its highest rate.
fn with_rate(config: SupportedStreamConfigRange, wanted_hz: u32) -> SupportedStreamConfig {
    [wanted_hz.max(RATE_HZ_MIN), 48_000, 44_100]
        .into_iter()
        .find_map(|rate_hz| config.try_with_sample_rate(rate_hz))
        .unwrap_or_else(|| config.with_max_sample_rate())
}

/// Returns the two block sizes to request from a device, the preferred one first: a fixed size that
/// `config` permits, and the default of the device.
pub fn block_sizes(config: &SupportedStreamConfig) -> [BufferSize; 2] {
    let block = match *config.buffer_size() {
        SupportedBufferSize::Range { min, max } if min <= max => BLOCK_FRAMES.clamp(min, max),
        _ => BLOCK_FRAMES,
    };
    [BufferSize::Fixed(block), BufferSize::Default]
}

#[cfg(test)]
mod tests {
    use cpal::SampleFormat;

    use super::*;

    fn range(channels: u16, low: u32, high: u32) -> SupportedStreamConfigRange {
        let size = SupportedBufferSize::Unknown;
        SupportedStreamConfigRange::new(channels, low, high, size, SampleFormat::F32)
    }

    fn preferred(channels: u16, rate_hz: u32) -> SupportedStreamConfig {
        range(channels, rate_hz, rate_hz).with_max_sample_rate()
    }

    #[test]
    fn a_rate_for_calls_is_taken_only_if_there_is_no_other() {
        for (all, rate_hz, channels) in [
            (
                vec![range(1, 16_000, 16_000), range(2, 44_100, 44_100)],
                44_100,
                2,
            ),
            (vec![range(1, 48_000, 96_000)], 48_000, 1),
            (vec![range(1, 96_000, 96_000)], 96_000, 1),
            (vec![range(1, 16_000, 16_000)], 16_000, 1),
            (vec![], 16_000, 1),
        ] {
            let chosen = choose(preferred(1, 16_000), all, 0).unwrap();
            assert_eq!(
                (chosen.sample_rate(), chosen.channels()),
                (rate_hz, channels)
            );
        }
        let all = vec![range(2, 8_000, 192_000)];
        let chosen = choose(preferred(2, 96_000), all, 0).unwrap();
        assert_eq!(chosen.sample_rate(), 96_000, "the default of the device");
    }

    #[test]
    fn a_format_with_the_highest_channel_is_chosen() {
        let all = vec![
            range(2, 48_000, 48_000),
            range(8, 48_000, 48_000),
            range(16, 48_000, 48_000),
        ];
        assert_eq!(
            choose(preferred(2, 48_000), all.clone(), 5)
                .unwrap()
                .channels(),
            8
        );
        assert_eq!(choose(preferred(2, 48_000), all, 17), Err(16));
    }
}
