//! The setting of the bar length: fixed, or found by the tracker.
//!
//! In: the value of a show file. Out: the allowed bar lengths.
//! Thread: any.
//! Allocates: never, except in errors.

use std::fmt;
use std::str::FromStr;

use serde::de::{Error, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The number of beats per bar of music whose bar length is not known yet.
const USUAL: u32 = 4;
/// The allowed numbers of beats per bar.
const ALLOWED: std::ops::RangeInclusive<u32> = 2..=4;

/// The number of beats per bar: a fixed number, or bars of three or four beats, as the tracker
/// finds them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BarLength {
    /// The tracker decides between bars of three and of four beats while it runs.
    #[default]
    Auto,
    /// Every bar has this number of beats, 2 to 4.
    Beats(u32),
}

impl BarLength {
    /// The allowed values as the user writes them, for error messages.
    pub const ALLOWED: &'static str = "\"auto\", 2, 3 or 4";

    /// Returns the number of beats per bar before the tracker has found it: four if it is not
    /// fixed.
    pub fn initial(self) -> u32 {
        match self {
            Self::Auto => USUAL,
            Self::Beats(beats) => beats,
        }
    }

    /// Returns true if the number of beats per bar is one that the tracker supports.
    pub fn is_allowed(self) -> bool {
        match self {
            Self::Auto => true,
            Self::Beats(beats) => ALLOWED.contains(&beats),
        }
    }
}

impl fmt::Display for BarLength {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Beats(beats) => beats.fmt(f),
        }
    }
}

impl FromStr for BarLength {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let length = match text {
            "auto" => Some(Self::Auto),
            _ => text.parse().ok().map(Self::Beats),
        };
        length
            .filter(|length| length.is_allowed())
            .ok_or_else(|| "use auto, 2, 3 or 4".to_owned())
    }
}

impl Serialize for BarLength {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Beats(beats) => serializer.serialize_u32(*beats),
        }
    }
}

impl<'de> Deserialize<'de> for BarLength {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Value;

        impl Visitor<'_> for Value {
            type Value = BarLength;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(BarLength::ALLOWED)
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<BarLength, E> {
                if text == "auto" {
                    return Ok(BarLength::Auto);
                }
                Err(E::invalid_value(Unexpected::Str(text), &self))
            }

            fn visit_u64<E: Error>(self, beats: u64) -> Result<BarLength, E> {
                u32::try_from(beats)
                    .map(BarLength::Beats)
                    .map_err(|_| E::invalid_value(Unexpected::Unsigned(beats), &self))
            }

            fn visit_i64<E: Error>(self, beats: i64) -> Result<BarLength, E> {
                u32::try_from(beats)
                    .map(BarLength::Beats)
                    .map_err(|_| E::invalid_value(Unexpected::Signed(beats), &self))
            }
        }

        deserializer.deserialize_any(Value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize, Deserialize, PartialEq, Debug)]
    struct Table {
        beats_per_bar: BarLength,
    }

    #[test]
    fn show_files_hold_auto_or_a_number() {
        for (text, length) in [
            ("beats_per_bar = \"auto\"\n", BarLength::Auto),
            ("beats_per_bar = 3\n", BarLength::Beats(3)),
        ] {
            let table: Table = toml::from_str(text).unwrap();
            assert_eq!(table.beats_per_bar, length);
            assert_eq!(toml::to_string(&table).unwrap(), text);
        }
        for wrong in ["\"six\"", "-3", "3.5", "true", "5000000000"] {
            let error = toml::from_str::<Table>(&format!("beats_per_bar = {wrong}")).unwrap_err();
            assert!(
                error.message().contains("expected \"auto\", 2, 3 or 4"),
                "{wrong}: {error}"
            );
        }
    }

    #[test]
    fn arguments_name_auto_or_an_allowed_number() {
        assert_eq!("auto".parse(), Ok(BarLength::Auto));
        assert_eq!("2".parse(), Ok(BarLength::Beats(2)));
        for wrong in ["0", "5", "3.5", "", "waltz"] {
            assert!(wrong.parse::<BarLength>().is_err(), "{wrong}");
        }
    }
}
