//! Frame rates: their names in a show file, and their detection where the source does not report
//! the rate (LTC, OSC). In: labels of frames. Out: a frame rate. Thread: any. Allocates: never.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use smpte_timecode::{Fields, FrameRate};

use crate::time::Seconds;

/// The frame rate in a show file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Rate {
    /// The rate is detected.
    #[default]
    Auto,
    /// The source has this rate.
    Fixed(FrameRate),
}

/// The frame rates that a show file can name.
const NAMES: [(&str, FrameRate); 6] = [
    ("23.976", FrameRate::FPS_23_976),
    ("24", FrameRate::FPS_24),
    ("25", FrameRate::FPS_25),
    ("29.97", FrameRate::FPS_29_97),
    ("29.97df", FrameRate::FPS_29_97_DF),
    ("30", FrameRate::FPS_30),
];

impl Rate {
    /// Returns the frame rate; `None` if it is detected.
    pub fn fixed(self) -> Option<FrameRate> {
        match self {
            Self::Auto => None,
            Self::Fixed(rate) => Some(rate),
        }
    }
}

/// Returns the name of a frame rate, such as `29.97df`; `?` if timecode sources do not have it.
pub fn name(rate: FrameRate) -> &'static str {
    let found = NAMES.iter().find(|(_, named)| *named == rate);
    found.map_or("?", |(name, _)| name)
}

impl FromStr for Rate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let found = NAMES.iter().find(|(name, _)| *name == text);
        found.map(|(_, rate)| Self::Fixed(*rate)).ok_or_else(|| {
            format!(
                "the frame rate is {text:?}; allowed are auto, 23.976, 24, 25, 29.97, 29.97df and 30"
            )
        })
    }
}

impl TryFrom<String> for Rate {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Rate> for String {
    fn from(rate: Rate) -> Self {
        rate.to_string()
    }
}

impl fmt::Display for Rate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Fixed(rate) => name(*rate),
        })
    }
}

/// Detects the frame rate from labels of successive frames.
///
/// A label with the flag of drop frame, a frame number of 25 or more, and the last frame of a second
/// prove the rate. Before such a proof, at most one second, the measured duration of a frame decides:
/// this is right while the source runs within 2 % of its nominal speed.
#[derive(Clone, Copy, Debug, Default)]
pub struct RateDetector {
    fixed: Option<FrameRate>,
    proven: Option<FrameRate>,
    guessed: Option<FrameRate>,
    /// The last label: its second of the day and its frame.
    last: Option<(u32, u8)>,
}

impl RateDetector {
    /// Creates a detector; a fixed `rate` is returned always.
    pub fn new(rate: Rate) -> Self {
        Self {
            fixed: rate.fixed(),
            ..Self::default()
        }
    }

    /// Returns the frame rate of the source that sends the frame `fields`. `drops` is true if the
    /// source says that frames are dropped, and `frame` the measured duration of a frame.
    pub fn observe(&mut self, fields: Fields, drops: bool, frame: Option<Seconds>) -> FrameRate {
        if let Some(fixed) = self.fixed {
            return fixed;
        }
        let (hours, minutes) = (u32::from(fields.hours), u32::from(fields.minutes));
        let second = (hours * 60 + minutes) * 60 + u32::from(fields.seconds);
        let before = self.last.replace((second, fields.frames));
        let of = |count: u8| match count {
            24 => Some(FrameRate::FPS_24),
            25 => Some(FrameRate::FPS_25),
            30 => Some(FrameRate::FPS_30),
            _ => None,
        };
        let ended =
            before.and_then(
                |(last, frames)| match (second.wrapping_sub(last), fields.frames) {
                    (1, 0) => of(frames + 1),
                    (u32::MAX, shown) if frames == 0 => of(shown + 1),
                    _ => None,
                },
            );
        if drops {
            self.proven = Some(FrameRate::FPS_29_97_DF);
        } else if fields.frames >= 25 {
            self.proven = Some(FrameRate::FPS_30);
        } else if ended.is_some() {
            self.proven = ended;
        }
        self.proven
            .unwrap_or_else(|| self.guess(fields.frames, frame))
    }

    fn guess(&mut self, frames: u8, frame: Option<Seconds>) -> FrameRate {
        let guessed = self.guessed.unwrap_or_else(|| match frame {
            Some(frame) if frame.0 > 1.0 / 24.5 => FrameRate::FPS_24,
            Some(frame) if frame.0 > 1.0 / 27.5 => FrameRate::FPS_25,
            _ => FrameRate::FPS_30,
        });
        let guessed = match frames {
            24 if guessed == FrameRate::FPS_24 => FrameRate::FPS_25,
            _ => guessed,
        };
        self.guessed = Some(guessed);
        guessed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(seconds: u8, frames: u8) -> Fields {
        Fields {
            hours: 1,
            minutes: 0,
            seconds,
            frames,
        }
    }

    #[test]
    fn names_are_read_and_written() {
        for (name, rate) in NAMES {
            assert_eq!(name.parse(), Ok(Rate::Fixed(rate)));
            assert_eq!(Rate::Fixed(rate).to_string(), name);
        }
        assert_eq!("auto".parse(), Ok(Rate::Auto));
        assert!("60".parse::<Rate>().unwrap_err().contains("29.97df"));
    }

    #[test]
    fn the_end_of_a_second_proves_the_rate_against_the_measured_speed() {
        for (count, rate) in [(24, FrameRate::FPS_24), (25, FrameRate::FPS_25)] {
            // The source runs 10 % fast or slow, so its frames have the duration of another rate.
            for speed in [0.9, 1.1] {
                let frame = Some(Seconds(1.0 / (f64::from(count) * speed)));
                let mut detector = RateDetector::default();
                for n in 12..count {
                    detector.observe(fields(0, n), false, frame);
                }
                assert_eq!(detector.observe(fields(1, 0), false, frame), rate);
                let mut reverse = RateDetector::default();
                reverse.observe(fields(1, 0), false, frame);
                assert_eq!(reverse.observe(fields(0, count - 1), false, frame), rate);
            }
        }
        let mut detector = RateDetector::default();
        assert_eq!(
            detector.observe(fields(0, 3), false, None),
            FrameRate::FPS_30
        );
        let drop = detector.observe(fields(0, 4), true, None);
        assert_eq!(drop, FrameRate::FPS_29_97_DF);
    }
}
