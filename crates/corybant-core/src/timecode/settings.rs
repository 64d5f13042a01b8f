//! The section `[timecode]` of a show file. In: values of the show file. Out: checked settings.
//! Thread: any. Allocates: yes.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use smpte_timecode::{Fields, FrameRate, Timecode};

use super::{DAY_S, Rate, art_net, parse_label};

/// Greatest number of frames for which the clock runs on without timecode: 30 s at 30 frames.
const FREEWHEEL_FRAMES_MAX: u32 = 900;
/// The highest channel of an audio input.
const CHANNEL_MAX: u16 = 256;

/// Where timecode comes from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Source {
    /// The show follows no timecode.
    #[default]
    Off,
    /// Linear timecode on this channel of the audio input, counted from 1.
    Ltc(u16),
    /// MIDI timecode on this port, `system:PORT` or `jack:PORT`; empty for the port of the MIDI
    /// clock.
    Mtc(String),
    /// Art-Net timecode at this network address, `HOST:PORT`.
    ArtNet(String),
    /// OSC messages `/timecode`.
    Osc,
}

impl Source {
    /// Returns the name of the protocol in the user interface; empty if the source is off.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Off => "",
            Self::Ltc(_) => "ltc",
            Self::Mtc(_) => "mtc",
            Self::ArtNet(_) => "art-net",
            Self::Osc => "osc",
        }
    }
}

impl FromStr for Source {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, rest) = match text.split_once(':') {
            Some((kind, rest)) => (kind, Some(rest)),
            None => (text, None),
        };
        let channel = |rest: &str| rest.parse().ok().filter(|n| (1..=CHANNEL_MAX).contains(n));
        let source = match (kind, rest) {
            ("", None) => Some(Self::Off),
            ("osc", None) => Some(Self::Osc),
            ("ltc", Some(rest)) => channel(rest).map(Self::Ltc),
            ("mtc", rest) => Some(Self::Mtc(rest.unwrap_or_default().into())),
            ("art-net", None) => Some(Self::ArtNet(format!("0.0.0.0:{}", art_net::PORT))),
            ("art-net", Some(rest)) => address(rest).map(Self::ArtNet),
            _ => None,
        };
        source.ok_or_else(|| {
            format!(
                "the source is {text:?}; allowed are \"ltc:CHANNEL\" (1 to {CHANNEL_MAX}), \"mtc\", \"mtc:system:PORT\", \"mtc:jack:PORT\", \"art-net\", \"art-net:ADDRESS\", \"osc\" and \"\" (no timecode)"
            )
        })
    }
}

/// Returns the address `HOST:PORT` of the text `HOST` or `HOST:PORT`.
fn address(text: &str) -> Option<String> {
    let (host, port) = match text.rsplit_once(':') {
        Some((host, port)) => (host, port.parse().ok()?),
        None => (text, art_net::PORT),
    };
    (!host.is_empty()).then(|| format!("{host}:{port}"))
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Off => Ok(()),
            Self::Ltc(channel) => write!(f, "ltc:{channel}"),
            Self::Mtc(port) if port.is_empty() => f.write_str("mtc"),
            Self::Mtc(port) => write!(f, "mtc:{port}"),
            Self::ArtNet(address) => write!(f, "art-net:{address}"),
            Self::Osc => f.write_str("osc"),
        }
    }
}

/// The timecode at which the song begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Offset {
    /// A frame.
    Label(Fields),
    /// A time of the day in seconds.
    Seconds(f64),
}

impl Offset {
    /// Returns the time of the day in seconds, at the frame rate `rate` of the source. A frame that
    /// does not exist at this rate counts as the next one that exists.
    pub fn seconds(self, rate: Option<FrameRate>) -> f64 {
        let (mut fields, rate) = match (self, rate) {
            (Self::Seconds(seconds), _) => return seconds,
            (Self::Label(fields), rate) => (fields, rate.unwrap_or(FrameRate::FPS_30)),
        };
        fields.frames = fields.frames.min(rate.nominal() - 1);
        for frames in fields.frames..fields.frames.saturating_add(3) {
            if let Ok(timecode) = Timecode::from_fields(Fields { frames, ..fields }, rate) {
                return timecode.to_seconds().to_f64();
            }
        }
        0.0
    }
}

impl FromStr for Offset {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some((fields, _)) = parse_label(text) {
            return Ok(Self::Label(fields));
        }
        let seconds = text.parse().ok().filter(|s| (0.0..DAY_S).contains(s));
        seconds.map(Self::Seconds).ok_or_else(|| {
            format!(
                "the offset is {text:?}; allowed are a timecode such as \"01:00:00:00\" and a time of the day in seconds, 0 to less than 86400"
            )
        })
    }
}

impl fmt::Display for Offset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Label(Fields {
                hours,
                minutes,
                seconds,
                frames,
            }) => write!(f, "{hours:02}:{minutes:02}:{seconds:02}:{frames:02}"),
            Self::Seconds(seconds) => write!(f, "{seconds}"),
        }
    }
}

impl Default for Offset {
    fn default() -> Self {
        Self::Seconds(0.0)
    }
}

macro_rules! as_text {
    ($($name:ident),*) => {$(
        impl Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.collect_str(self)
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                String::deserialize(deserializer)?
                    .parse()
                    .map_err(serde::de::Error::custom)
            }
        }
    )*};
}
as_text!(Source, Offset);

/// The settings in the section `[timecode]` of a show file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Where timecode comes from.
    pub source: Source,
    /// The frame rate of the source.
    pub rate: Rate,
    /// The timecode at which the song begins.
    pub offset: Offset,
    /// Number of frames for which the show runs on when timecode is missing, 0 to 900.
    pub freewheel_frames: u32,
    /// True if timecode leads the cue list at the start of the show.
    pub engage: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            source: Source::Off,
            rate: Rate::Auto,
            offset: Offset::default(),
            freewheel_frames: 25,
            engage: true,
        }
    }
}

impl Settings {
    /// Returns true if the show has a source of timecode.
    pub fn is_on(&self) -> bool {
        self.source != Source::Off
    }

    /// Adds a sentence to `problems` for each value that is not allowed. `key` is the name of the
    /// section in the show file, such as `timecode`.
    pub fn check(&self, key: &str, problems: &mut Vec<String>) {
        if self.freewheel_frames > FREEWHEEL_FRAMES_MAX {
            problems.push(format!(
                "{key}.freewheel_frames is {}; it must be 0 to {FREEWHEEL_FRAMES_MAX}.",
                self.freewheel_frames
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_are_read_and_written() {
        for (text, source) in [
            ("", Source::Off),
            ("ltc:2", Source::Ltc(2)),
            ("mtc", Source::Mtc(String::new())),
            ("mtc:system:Desk", Source::Mtc("system:Desk".into())),
            (
                "art-net:10.0.0.1:7000",
                Source::ArtNet("10.0.0.1:7000".into()),
            ),
            ("osc", Source::Osc),
        ] {
            assert_eq!(text.parse(), Ok(source.clone()));
            assert_eq!(source.to_string(), text);
        }
        assert_eq!("art-net".parse(), Ok(Source::ArtNet("0.0.0.0:6454".into())));
        assert_eq!(
            "art-net:10.0.0.1".parse(),
            Ok(Source::ArtNet("10.0.0.1:6454".into()))
        );
        for wrong in [
            "ltc",
            "ltc:0",
            "ltc:257",
            "ltc:x",
            "midi",
            "art-net::1",
            "art-net:a:x",
            "osc:1",
        ] {
            assert!(wrong.parse::<Source>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn offsets_are_frames_or_seconds() {
        let of = |text: &str, rate| text.parse::<Offset>().unwrap().seconds(Some(rate));
        assert_eq!(of("01:00:00:00", FrameRate::FPS_25), 3_600.0);
        assert_eq!(of("01:00:00:12", FrameRate::FPS_24), 3_600.5);
        assert_eq!(of("12.5", FrameRate::FPS_24), 12.5);
        // 1,800 frames; the labels 00 and 01 do not exist here.
        let dropped = of("00:01:00:00", FrameRate::FPS_29_97_DF);
        assert!((dropped - 60.06).abs() < 1e-9, "{dropped}");
        assert_eq!(
            "01:00:00:00".parse::<Offset>().unwrap().to_string(),
            "01:00:00:00"
        );
        for wrong in ["86400", "-1", "nan", "1:00:00", ""] {
            assert!(wrong.parse::<Offset>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_section_is_read_and_written() {
        let text = "source = \"ltc:2\"\nrate = \"29.97df\"\noffset = \"01:00:00:00\"\nfreewheel_frames = 10\nengage = false\n";
        let settings: Settings = toml::from_str(text).unwrap();
        assert_eq!(toml::to_string(&settings).unwrap(), text);
        assert!(toml::from_str::<Settings>("source = \"sun\"").is_err());
        let mut problems = Vec::new();
        let far = Settings {
            freewheel_frames: 901,
            ..settings
        };
        far.check("timecode", &mut problems);
        assert_eq!(problems.len(), 1);
    }
}
