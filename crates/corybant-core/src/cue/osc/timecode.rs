//! `/timecode`: the OSC message by which another program reports its timecode.
//!
//! In: OSC packets. Out: places in timecode. Thread: any. Allocates. The arguments are a text such as
//! `01:00:00:00` (with `;` before the frame for drop frame), the four numbers of a frame, or a time
//! of the day in seconds; after a frame, the frame rate may follow.

use rosc::{OscPacket, OscType};
use smpte_timecode::{Fields, FrameRate};
use thiserror::Error;

use super::packet;
use crate::cue::verbs::TIMECODE_TAKES;
use crate::timecode::{Place, Rate, parse_label};

/// The OSC address of the messages that report timecode.
pub const TIMECODE: &str = "/timecode";

/// A message `/timecode` has wrong arguments.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the arguments of {TIMECODE} are wrong; allowed are {TIMECODE_TAKES}")]
pub struct TimecodeArguments;

/// Calls `each` for each message `/timecode` in an OSC packet: with its place, or with an error.
/// Nothing is called for bytes that are not OSC.
pub fn places(datagram: &[u8], each: &mut dyn FnMut(Result<Place, TimecodeArguments>)) {
    let is_here = |part: &[u8]| part == TIMECODE.as_bytes();
    if datagram.windows(TIMECODE.len()).any(is_here)
        && let Ok(packet) = packet::parse(datagram)
    {
        visit(&packet, each);
    }
}

fn visit(packet: &OscPacket, each: &mut dyn FnMut(Result<Place, TimecodeArguments>)) {
    match packet {
        OscPacket::Bundle(bundle) => bundle.content.iter().for_each(|it| visit(it, each)),
        OscPacket::Message(message) if message.addr == TIMECODE => {
            each(place(&message.args).ok_or(TimecodeArguments));
        }
        OscPacket::Message(_) => {}
    }
}

fn place(args: &[OscType]) -> Option<Place> {
    let (fields, drops, rest) = match args {
        [OscType::String(text), rest @ ..] => {
            let (fields, drops) = parse_label(text)?;
            (fields, drops, rest)
        }
        [hours, minutes, seconds, frames, rest @ ..] => {
            let fields = Fields {
                hours: whole(hours, 23)?,
                minutes: whole(minutes, 59)?,
                seconds: whole(seconds, 59)?,
                frames: whole(frames, 29)?,
            };
            (fields, false, rest)
        }
        [seconds] => return number(seconds).map(Place::Seconds),
        _ => return None,
    };
    let rate = match rest {
        [] => None,
        [rate] => Some(frame_rate(rate, drops)?),
        _ => return None,
    };
    Some(Place::Frame {
        fields,
        rate,
        drops: drops || rate.is_some_and(FrameRate::is_drop_frame),
        after_frames: 0.0,
    })
}

fn number(arg: &OscType) -> Option<f64> {
    let number = match *arg {
        OscType::Int(x) => f64::from(x),
        OscType::Float(x) => f64::from(x),
        OscType::Long(x) => x as f64,
        OscType::Double(x) => x,
        _ => return None,
    };
    number.is_finite().then_some(number)
}

fn whole(arg: &OscType, max: u8) -> Option<u8> {
    let x = number(arg)?;
    (x.fract() == 0.0 && (0.0..=f64::from(max)).contains(&x)).then_some(x as u8)
}

fn frame_rate(arg: &OscType, drops: bool) -> Option<FrameRate> {
    if let OscType::String(text) = arg {
        return text.parse::<Rate>().ok()?.fixed();
    }
    match (number(arg)? * 100.0).round() as i64 {
        2_397 | 2_398 => Some(FrameRate::FPS_23_976),
        2_400 => Some(FrameRate::FPS_24),
        2_500 => Some(FrameRate::FPS_25),
        2_997 if drops => Some(FrameRate::FPS_29_97_DF),
        2_997 => Some(FrameRate::FPS_29_97),
        3_000 => Some(FrameRate::FPS_30),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rosc::{OscMessage, encoder};

    use super::*;

    fn read(args: Vec<OscType>) -> Result<Place, TimecodeArguments> {
        let addr = TIMECODE.into();
        let bytes = encoder::encode(&OscPacket::Message(OscMessage { addr, args })).unwrap();
        let mut found = Vec::new();
        places(&bytes, &mut |place| found.push(place));
        assert_eq!(found.len(), 1);
        found[0]
    }

    #[test]
    fn all_forms_are_read_and_others_are_errors() {
        use OscType::{Double, Float, Int};
        let text = |text: &str| OscType::String(text.into());
        let frame = |rate, drops| {
            let fields = Fields {
                hours: 1,
                minutes: 2,
                seconds: 3,
                frames: 4,
            };
            Ok(Place::Frame {
                fields,
                rate,
                drops,
                after_frames: 0.0,
            })
        };
        assert_eq!(read(vec![text("01:02:03:04")]), frame(None, false));
        assert_eq!(read(vec![text("01:02:03;04")]), frame(None, true));
        let numbers = || vec![Int(1), Int(2), Float(3.0), Int(4)];
        assert_eq!(read(numbers()), frame(None, false));
        for (rate, expected) in [
            (Int(25), FrameRate::FPS_25),
            (Float(29.97), FrameRate::FPS_29_97),
            (text("24"), FrameRate::FPS_24),
        ] {
            assert_eq!(
                read([numbers(), vec![rate]].concat()),
                frame(Some(expected), false)
            );
        }
        let drop = vec![text("01:02:03;04"), Float(29.97)];
        assert_eq!(read(drop), frame(Some(FrameRate::FPS_29_97_DF), true));
        assert_eq!(read(vec![Double(12.5)]), Ok(Place::Seconds(12.5)));
        for wrong in [
            vec![],
            vec![text("now")],
            vec![Int(24), Int(0), Int(0), Int(0)],
            vec![Int(1), Int(2)],
            vec![Float(f32::NAN)],
            vec![text("01:02:03:04"), Int(60)],
            vec![OscType::Nil],
        ] {
            assert_eq!(read(wrong), Err(TimecodeArguments));
        }
        places(b"/timecode", &mut |_| panic!("it is not OSC"));
        places(b"/timecode/engage\0\0\0\0,\0\0\0", &mut |_| {
            panic!("another address")
        });
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(tail in proptest::collection::vec(any::<u8>(), 0..80)) {
            places(&[&b"/timecode\0\0\0,"[..], &tail].concat(), &mut |_| ());
        }
    }
}
