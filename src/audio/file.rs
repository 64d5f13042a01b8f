//! Audio files: WAV, FLAC, Ogg Vorbis and MP3, recognised by their content, not by their names.
//!
//! In: a path. Out: a [`Sound`], mono at [`SAMPLE_RATE`]. Thread: any except show and audio.

use std::cell::Cell;
use std::fs::File;
use std::panic::{UnwindSafe, catch_unwind, set_hook, take_hook};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Once};

use symphonia::core::codecs::audio::{AudioDecoder, AudioDecoderOptions};
use symphonia::core::errors::Error as SymphoniaError;
use symphonia::core::formats::probe::Hint;
use symphonia::core::formats::{FormatOptions, FormatReader, TrackType};
use symphonia::core::io::MediaSourceStream;
use symphonia::core::meta::MetadataOptions;
use symphonia::core::packet::Packet;
use thiserror::Error;
use tracing::warn;

use crate::audio::resample::{Mix, Resampler};
use corybant_core::dsp::SAMPLE_RATE;
use corybant_core::time::Seconds;
use corybant_files::shown;

/// Longest sound that [`decode`] reads, in hours; a longer one is refused.
pub const HOURS_MAX: u64 = 4;
/// Endings of the names of music files, also of formats that [`decode`] cannot read.
const MUSIC_ENDINGS: [&str; 11] = [
    "wav", "flac", "ogg", "oga", "mp3", "m4a", "aac", "opus", "aif", "aiff", "wma",
];
/// Longest gap between two packets of an audio file, in seconds, that is filled with silence. A
/// longer gap is treated as a damaged time stamp and not filled.
const GAP_S_MAX: i64 = 10;

/// Returns true if the name of the file at `path` ends like the name of a music file.
pub fn has_music_ending(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str());
    ending.is_some_and(|ending| {
        MUSIC_ENDINGS
            .iter()
            .any(|music| music.eq_ignore_ascii_case(ending))
    })
}

/// The reasons why an audio file cannot be read.
#[derive(Debug, Error)]
pub enum AudioFileError {
    /// The operating system cannot read the audio file.
    #[error(
        "cannot read {}: {}",
        shown(path),
        corybant_files::describe_io_error("read", source)
    )]
    System {
        /// Path of the audio file.
        path: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// The path names a folder, a device or a pipe instead of a plain file.
    #[error("cannot read {}: it is not a plain file", shown(path))]
    NotPlain {
        /// Path of the folder, device or pipe.
        path: PathBuf,
    },
    /// The file has no known audio format, or at least half of it cannot be decoded.
    #[error(
        "cannot read {}: it is damaged or not an audio file of a known format ({reason}); give a WAV, FLAC, Ogg Vorbis or MP3 file",
        shown(path)
    )]
    NotSound {
        /// Path of the audio file.
        path: PathBuf,
        /// Reason why the content of the file cannot be decoded.
        reason: String,
    },
    /// The file is an audio file, but it contains no samples.
    #[error("cannot use {}: it has no samples", shown(path))]
    Empty {
        /// Path of the audio file.
        path: PathBuf,
    },
    /// The sound is longer than the longest accepted sound.
    #[error(
        "cannot use {}: it is longer than {minutes} minutes, the longest sound that can be read; cut it",
        shown(path)
    )]
    TooLong {
        /// Path of the audio file.
        path: PathBuf,
        /// Longest duration of a sound that is accepted, in minutes.
        minutes: u64,
    },
}

/// A decoded sound, mono at [`SAMPLE_RATE`].
#[derive(Clone, Debug, PartialEq)]
pub struct Sound {
    /// Decoded samples of the sound, mixed to mono, at [`SAMPLE_RATE`]; full scale is 1.
    pub samples: Arc<[f32]>,
    /// Sample rate of the audio file, Hz, before the samples were converted to [`SAMPLE_RATE`].
    pub rate_hz: u32,
    /// Number of channels of the audio file, before they were mixed to mono.
    pub channels: u16,
    /// Length of the sound.
    pub duration: Seconds,
    /// Number of packets that could not be decoded, plus the number of gaps of up to 10 s between
    /// packets. These gaps are filled with silence; longer gaps are not counted.
    pub damaged: u64,
    /// True if the audio file ends before its sound is complete, for example after an interrupted
    /// download.
    pub cut_short: bool,
}

/// Decodes the audio file `path` to mono at [`SAMPLE_RATE`]. A sound longer than [`HOURS_MAX`] is
/// refused. Damaged packets cause a warning in the log.
///
/// # Errors
/// [`AudioFileError`] if the file is missing, not audio, empty or too long.
pub fn decode(path: &Path) -> Result<Sound, AudioFileError> {
    decode_within(path, 60 * HOURS_MAX)
}

/// Decodes the audio file `path` to mono at [`SAMPLE_RATE`]; a sound longer than `minutes` is
/// refused. If the header of the file states a longer duration, the file is refused before it is
/// decoded.
///
/// # Errors
/// [`AudioFileError`] if the file is missing, not audio, empty or too long.
pub fn decode_within(path: &Path, minutes: u64) -> Result<Sound, AudioFileError> {
    decode_channels(path, &[], minutes)
}

/// Decodes the channels `chosen` of an audio file, counted from 1, as [`decode_within`] does; an
/// empty list means all.
///
/// # Errors
/// [`AudioFileError`] if the file is missing, not audio, empty or too long.
pub fn decode_channels(path: &Path, chosen: &[u16], minutes: u64) -> Result<Sound, AudioFileError> {
    // Some damaged headers make the decoders panic; a file must not end the program.
    let panicked = |_| {
        Err(AudioFileError::NotSound {
            path: path.into(),
            reason: "its decoder failed".into(),
        })
    };
    let sound = catch_panic(|| {
        let mut decoder = Decoder::open(path, minutes)?;
        decoder.chosen = chosen.into();
        while decoder.process_packet()? {}
        decoder.finish()
    });
    let sound = sound.unwrap_or_else(panicked)?;
    if sound.damaged > 0 {
        warn!("{}: {} damaged packets", shown(path), sound.damaged);
    }
    if sound.cut_short {
        warn!(
            "{}: the file ends too early, after {:.1} s",
            shown(path),
            sound.duration.0
        );
    }
    Ok(sound)
}

thread_local! {
    /// True on a thread that decodes audio: the message of a panic on that thread is then not
    /// printed.
    static IS_QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Runs `work` and catches its panic without printing the panic's message. Panics on other threads
/// are printed as usual.
fn catch_panic<T>(work: impl FnOnce() -> T + UnwindSafe) -> std::thread::Result<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let previous = take_hook();
        set_hook(Box::new(move |panic| {
            if !IS_QUIET.get() {
                previous(panic);
            }
        }));
    });
    IS_QUIET.set(true);
    let result = catch_unwind(work);
    IS_QUIET.set(false);
    result
}

/// How packets of the file are converted to mono at [`SAMPLE_RATE`]. If a later packet has another
/// sample rate or number of channels, a new value replaces this one.
struct PacketFormat {
    rate_hz: u32,
    channels: u16,
    mix: Mix,
    resampler: Resampler,
}

/// The state of the decoder while a file is decoded.
struct Decoder {
    path: PathBuf,
    minutes_max: u64,
    /// Channels that are mixed, counted from 1; empty for all.
    chosen: Vec<u16>,
    format: Box<dyn FormatReader>,
    track: u32,
    decoder: Box<dyn AudioDecoder>,
    packet_format: Option<PacketFormat>,
    /// Sample rate (Hz) and number of channels of the first decoded packet, for [`Sound`]; `None`
    /// before this packet.
    first_format: Option<(u32, u16)>,
    /// Expected start of the next packet, in samples from the start of the file; `None` if it is
    /// unknown.
    next_start: Option<i64>,
    interleaved: Vec<f32>,
    mono: Vec<f32>,
    samples: Vec<f32>,
    /// Number of packets of the file that were decoded so far.
    decoded: u64,
    damaged: u64,
    cut_short: bool,
}

impl Decoder {
    fn open(path: &Path, minutes_max: u64) -> Result<Self, AudioFileError> {
        let system = |source| AudioFileError::System {
            path: path.into(),
            source,
        };
        // Opening a pipe would wait for a writer.
        if !std::fs::metadata(path).map_err(system)?.is_file() {
            return Err(AudioFileError::NotPlain { path: path.into() });
        }
        let file = MediaSourceStream::new(
            Box::new(File::open(path).map_err(system)?),
            Default::default(),
        );
        let probed = symphonia::default::get_probe().probe(
            &Hint::new(),
            file,
            FormatOptions::default(),
            MetadataOptions::default(),
        );
        let format = probed.map_err(|error| refuse(path, error))?;
        let (track, decoder) = find_track(path, format.as_ref())?;
        if minutes_in_header(format.as_ref()).is_some_and(|minutes| minutes > minutes_max as f64) {
            return Err(AudioFileError::TooLong {
                path: path.into(),
                minutes: minutes_max,
            });
        }
        Ok(Self {
            path: path.into(),
            minutes_max,
            chosen: Vec::new(),
            format,
            track,
            decoder,
            packet_format: None,
            first_format: None,
            next_start: None,
            interleaved: Vec::new(),
            mono: Vec::new(),
            samples: Vec::new(),
            decoded: 0,
            damaged: 0,
            cut_short: false,
        })
    }

    /// Reads the next packet of the file and decodes it; returns false at the end of the file.
    fn process_packet(&mut self) -> Result<bool, AudioFileError> {
        match self.format.next_packet() {
            Ok(Some(packet)) if packet.track_id == self.track => self.decode_packet(&packet)?,
            Ok(Some(_)) => {}
            Ok(None) => return Ok(false),
            // The file continues with another audio stream, for example a chained Ogg file.
            Err(SymphoniaError::ResetRequired) => {
                (self.track, self.decoder) = find_track(&self.path, self.format.as_ref())?;
                self.next_start = None;
            }
            Err(SymphoniaError::IoError(error))
                if error.kind() != std::io::ErrorKind::UnexpectedEof =>
            {
                return Err(AudioFileError::System {
                    path: self.path.clone(),
                    source: error,
                });
            }
            Err(_) => {
                self.cut_short = true;
                return Ok(false);
            }
        }
        if self.samples.len() as u64 > self.minutes_max * 60 * u64::from(SAMPLE_RATE) {
            return Err(AudioFileError::TooLong {
                path: self.path.clone(),
                minutes: self.minutes_max,
            });
        }
        Ok(true)
    }

    fn decode_packet(&mut self, packet: &Packet) -> Result<(), AudioFileError> {
        let Ok(sound) = self.decoder.decode(packet) else {
            self.damaged += 1;
            return Ok(());
        };
        self.decoded += 1;
        let (rate_hz, channels) = (
            sound.spec().rate(),
            u16::try_from(sound.spec().channels().count()).unwrap_or(0),
        );
        if channels == 0 || sound.frames() == 0 {
            return Ok(());
        }
        self.interleaved.resize(sound.samples_interleaved(), 0.0);
        sound.copy_to_slice_interleaved(&mut self.interleaved);
        self.fill_gap(packet);
        self.set_packet_format(rate_hz, channels)?;
        let Some(format) = &mut self.packet_format else {
            return Ok(());
        };
        self.mono
            .resize(self.interleaved.len() / usize::from(channels), 0.0);
        let n = format.mix.mono(&self.interleaved, &mut self.mono);
        format.resampler.convert(&self.mono[..n], &mut self.samples);
        Ok(())
    }

    /// If the time stamp of `packet` shows a gap before the packet, adds silence of the same
    /// length. The sound after the gap then comes at the right time.
    fn fill_gap(&mut self, packet: &Packet) {
        let at = packet.pts.get();
        let expected = self
            .next_start
            .replace(at.saturating_add(i64::try_from(packet.dur.get()).unwrap_or(0)));
        let (Some(expected), Some(format)) = (expected, &mut self.packet_format) else {
            return;
        };
        let gap = at.saturating_sub(expected);
        if gap > 0 && gap <= GAP_S_MAX * i64::from(format.rate_hz) {
            self.damaged += 1;
            self.mono.clear();
            self.mono.resize(usize::try_from(gap).unwrap_or(0), 0.0);
            format.resampler.convert(&self.mono, &mut self.samples);
        }
    }

    /// Makes the decoder ready for packets with the sample rate `rate_hz` (Hz) and `channels`
    /// channels. Creates a new conversion to mono unless the last packet had the same format.
    fn set_packet_format(&mut self, rate_hz: u32, channels: u16) -> Result<(), AudioFileError> {
        if self
            .packet_format
            .as_ref()
            .is_some_and(|format| (format.rate_hz, format.channels) == (rate_hz, channels))
        {
            return Ok(());
        }
        if let Some(old) = self.packet_format.take() {
            old.resampler.finish(&mut self.samples);
        }
        let unusable = |error| AudioFileError::NotSound {
            path: self.path.clone(),
            reason: format!("{error}"),
        };
        let resampler = Resampler::new(rate_hz, SAMPLE_RATE).map_err(unusable)?;
        self.first_format.get_or_insert((rate_hz, channels));
        self.packet_format = Some(PacketFormat {
            rate_hz,
            channels,
            mix: Mix::new(channels, &self.chosen),
            resampler,
        });
        Ok(())
    }

    fn finish(mut self) -> Result<Sound, AudioFileError> {
        if let Some(format) = self.packet_format.take() {
            format.resampler.finish(&mut self.samples);
        }
        // Any long file contains bytes that look like MP3; most packets of a real MP3 file decode.
        if self.damaged > 0 && self.damaged >= self.decoded {
            let reason = format!(
                "{} of {} packets cannot be decoded",
                self.damaged,
                self.damaged + self.decoded
            );
            return Err(AudioFileError::NotSound {
                path: self.path,
                reason,
            });
        }
        let Some((rate_hz, channels)) = self.first_format.filter(|_| !self.samples.is_empty())
        else {
            return Err(AudioFileError::Empty { path: self.path });
        };
        let duration = Seconds(self.samples.len() as f64 / f64::from(SAMPLE_RATE));
        Ok(Sound {
            samples: self.samples.into(),
            rate_hz,
            channels,
            duration,
            damaged: self.damaged,
            cut_short: self.cut_short,
        })
    }
}

fn refuse(path: &Path, error: SymphoniaError) -> AudioFileError {
    let path = path.to_path_buf();
    match error {
        SymphoniaError::IoError(source) if source.kind() != std::io::ErrorKind::UnexpectedEof => {
            AudioFileError::System { path, source }
        }
        SymphoniaError::IoError(_) => AudioFileError::NotSound {
            path,
            reason: "it ends too early".into(),
        },
        error => AudioFileError::NotSound {
            path,
            reason: error.to_string(),
        },
    }
}

/// Returns the id of the default audio track in the file, and a decoder for this track.
fn find_track(
    path: &Path,
    format: &dyn FormatReader,
) -> Result<(u32, Box<dyn AudioDecoder>), AudioFileError> {
    let none = || AudioFileError::NotSound {
        path: path.into(),
        reason: "it has no audio track".into(),
    };
    let track = format.default_track(TrackType::Audio).ok_or_else(none)?;
    let parameters = track
        .codec_params
        .as_ref()
        .and_then(|parameters| parameters.audio())
        .ok_or_else(none)?;
    let decoder = symphonia::default::get_codecs()
        .make_audio_decoder(parameters, &AudioDecoderOptions::default());
    Ok((track.id, decoder.map_err(|error| refuse(path, error))?))
}

/// Returns the duration of the sound, in minutes, that the header of the file states; `None` if the
/// header states none.
fn minutes_in_header(format: &dyn FormatReader) -> Option<f64> {
    let track = format.default_track(TrackType::Audio)?;
    let rate_hz = track.codec_params.as_ref()?.audio()?.sample_rate?;
    Some(track.num_frames? as f64 / f64::from(rate_hz) / 60.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_panics_of_the_decoder_are_quiet() {
        const CHILD: &str = "CORYBANT_TEST_PANICS";
        if std::env::var_os(CHILD).is_some() {
            assert!(catch_panic(|| panic!("in the decoder")).is_err());
            assert_eq!(catch_panic(|| 3).unwrap(), 3);
            assert!(
                std::thread::spawn(|| panic!("on another thread"))
                    .join()
                    .is_err()
            );
            assert!(catch_unwind(|| panic!("after the decoder")).is_err());
            return;
        }
        let mut child = std::process::Command::new(std::env::current_exe().unwrap());
        child
            .args([
                "--exact",
                "audio::file::tests::only_panics_of_the_decoder_are_quiet",
                "--nocapture",
            ])
            .env(CHILD, "1");
        let output = child.output().unwrap();
        let printed = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.success() && !printed.contains("in the decoder"),
            "{printed}"
        );
        assert!(
            printed.contains("on another thread") && printed.contains("after the decoder"),
            "{printed}"
        );
    }
}
