//! Requests to record a live performer's motion as a new take, and the times of a take.
//!
//! In: OSC packets, texts, the timeline of the music. Out: requests; the beats at which a take
//! starts and ends. Thread: any. Allocates.

use rosc::{OscPacket, OscType};
use thiserror::Error;

use crate::cue::osc::packet;
use crate::time::{Beats, Seconds, Timeline};

/// The start of the OSC address of each request.
pub const PREFIX: &str = "/record/";
/// The greatest number of beats of a take.
pub const BEATS_MAX: u32 = 256;
/// The greatest length of a label, in characters.
pub const LABEL_MAX: usize = 64;
/// Least time before the first beat of a take, in beats, for the count-in.
const COUNT_IN_BEATS: f64 = 4.0;
/// Largest number of beats that are searched for the start of a bar.
const BAR_SEARCH_BEATS: i64 = 64;

/// What a performer requests of the recording of takes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TakeRequest {
    /// Record a take with this label from a start of a bar on.
    Start {
        /// The label of the take.
        label: String,
        /// Number of beats after which the take stops; `None`: it stops on request.
        beats: Option<u32>,
    },
    /// Stop the take that is counted in or recorded; if there is none, record one as
    /// [`TakeRequest::Start`] does.
    Toggle {
        /// The label of the take.
        label: String,
        /// Number of beats after which the take stops; `None`: it stops on request.
        beats: Option<u32>,
    },
    /// Stop the take that is recorded; before its first beat, drop it.
    Stop,
    /// Remove the last take from the show. Its motion file stays.
    Undo,
    /// Give the last take another label.
    Rename(String),
}

/// The reasons why a request is refused.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum TakeRefusal {
    /// The label is empty, too long, or has control characters.
    #[error(
        "{0:?} is no label; allowed are 1 to {LABEL_MAX} characters without control characters"
    )]
    Label(String),
    /// The number of beats is out of range.
    #[error("a take of {0} beats is not possible; allowed are 1 to {BEATS_MAX} beats")]
    Beats(i64),
    /// The OSC address is not one of the requests.
    #[error(
        "{0:?} is unknown; there are /record/start LABEL [BEATS], /record/stop, /record/undo and /record/rename LABEL"
    )]
    Address(String),
}

impl TakeRequest {
    /// Returns the request for a take with this label and number of beats; see
    /// [`TakeRequest::Start`].
    ///
    /// # Errors
    /// [`TakeRefusal`] if a value is not allowed.
    pub fn start(label: &str, beats: Option<i64>) -> Result<Self, TakeRefusal> {
        let (label, beats) = checked(label, beats)?;
        Ok(Self::Start { label, beats })
    }

    /// Returns the request of a button that starts and stops takes; see [`TakeRequest::Toggle`].
    ///
    /// # Errors
    /// [`TakeRefusal`] if a value is not allowed.
    pub fn toggle(label: &str, beats: Option<i64>) -> Result<Self, TakeRefusal> {
        let (label, beats) = checked(label, beats)?;
        Ok(Self::Toggle { label, beats })
    }

    /// Returns the request to give the last take the label `label`.
    ///
    /// # Errors
    /// [`TakeRefusal`] if the label is not allowed.
    pub fn rename(label: &str) -> Result<Self, TakeRefusal> {
        checked_label(label).map(Self::Rename)
    }
}

/// Calls `each` for each message in an OSC packet whose address begins with [`PREFIX`]: with the
/// request, or with the reason why it is refused. Nothing is called for bytes that are not OSC.
pub fn requests(datagram: &[u8], each: &mut dyn FnMut(Result<TakeRequest, TakeRefusal>)) {
    if datagram
        .windows(PREFIX.len())
        .any(|part| part == PREFIX.as_bytes())
        && let Ok(packet) = packet::parse(datagram)
    {
        visit(&packet, each);
    }
}

fn visit(packet: &OscPacket, each: &mut dyn FnMut(Result<TakeRequest, TakeRefusal>)) {
    match packet {
        OscPacket::Bundle(bundle) => bundle.content.iter().for_each(|it| visit(it, each)),
        OscPacket::Message(message) if message.addr.starts_with(PREFIX) => {
            // A button sends 0 when it is released.
            let is_release = message.args.len() == 1 && number(message.args.first()) == Some(0);
            let text = match message.args.first() {
                Some(OscType::String(text)) => text.as_str(),
                _ => "",
            };
            match &message.addr[PREFIX.len()..] {
                "start" => each(TakeRequest::start(text, number(message.args.get(1)))),
                "rename" => each(TakeRequest::rename(text)),
                "stop" | "undo" if is_release => {}
                "stop" => each(Ok(TakeRequest::Stop)),
                "undo" => each(Ok(TakeRequest::Undo)),
                _ => each(Err(TakeRefusal::Address(
                    message.addr.chars().take(LABEL_MAX).collect(),
                ))),
            }
        }
        OscPacket::Message(_) => {}
    }
}

/// Returns an OSC argument as a whole number; `None` if it is no number.
fn number(argument: Option<&OscType>) -> Option<i64> {
    match *argument? {
        OscType::Int(x) => Some(x.into()),
        OscType::Long(x) => Some(x),
        OscType::Float(x) => Some(x.round() as i64),
        OscType::Double(x) => Some(x.round() as i64),
        _ => None,
    }
}

/// Returns the label and the number of beats of a take if both are allowed.
fn checked(label: &str, beats: Option<i64>) -> Result<(String, Option<u32>), TakeRefusal> {
    let allowed = |beats: i64| {
        let found = u32::try_from(beats).ok();
        found
            .filter(|beats| (1..=BEATS_MAX).contains(beats))
            .ok_or(TakeRefusal::Beats(beats))
    };
    Ok((checked_label(label)?, beats.map(allowed).transpose()?))
}

fn checked_label(label: &str) -> Result<String, TakeRefusal> {
    let label = label.trim();
    let count = label.chars().count();
    if (1..=LABEL_MAX).contains(&count) && !label.chars().any(char::is_control) {
        Ok(label.to_owned())
    } else {
        Err(TakeRefusal::Label(label.chars().take(LABEL_MAX).collect()))
    }
}

/// Returns the first beat of a take that is requested at the show time `now`: the first start of a
/// bar that leaves four beats for the count-in.
pub fn first_beat(timeline: &Timeline, now: Seconds) -> Beats {
    let earliest = (timeline.beat_at(now).0 + COUNT_IN_BEATS).ceil() as i64;
    let mut beats = earliest..earliest + BAR_SEARCH_BEATS;
    let bar = beats.find(|&beat| timeline.bar_position(beat) == 0);
    Beats(bar.unwrap_or(earliest) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rosc::{OscMessage, encoder};

    fn of(addr: &str, args: Vec<OscType>) -> Vec<Result<TakeRequest, TakeRefusal>> {
        let message = OscMessage {
            addr: addr.into(),
            args,
        };
        let datagram = encoder::encode(&OscPacket::Message(message)).unwrap();
        let mut found = Vec::new();
        requests(&datagram, &mut |request| found.push(request));
        found
    }

    #[test]
    fn osc_messages_are_requests_or_refused() {
        let text = |text: &str| OscType::String(text.into());
        let start = |beats| TakeRequest::Start {
            label: "my move".into(),
            beats,
        };
        assert_eq!(
            of("/record/start", vec![text(" my move ")]),
            [Ok(start(None))]
        );
        let with_beats = vec![text("my move"), OscType::Float(16.0)];
        assert_eq!(of("/record/start", with_beats), [Ok(start(Some(16)))]);
        assert_eq!(of("/record/stop", vec![]), [Ok(TakeRequest::Stop)]);
        assert_eq!(of("/record/stop", vec![OscType::Float(0.0)]), []);
        assert_eq!(
            of("/record/undo", vec![OscType::Float(1.0)]),
            [Ok(TakeRequest::Undo)]
        );
        assert_eq!(
            of("/record/rename", vec![text("b")]),
            [Ok(TakeRequest::Rename("b".into()))]
        );
        assert_eq!(of("/panic", vec![]), []);
        let refused = [
            of("/record/start", vec![]),
            of("/record/start", vec![text("a\nb")]),
            of("/record/start", vec![text(&"x".repeat(65))]),
            of("/record/start", vec![text("a"), OscType::Int(0)]),
            of("/record/start", vec![text("a"), OscType::Int(257)]),
            of("/record/pause", vec![]),
        ];
        for found in refused {
            assert!(matches!(&found[..], [Err(_)]), "{found:?}");
        }
        let mut count = 0;
        requests(b"/record/stop\0\0\0\0", &mut |_| count += 1);
        requests(&[0xff; 40], &mut |_| count += 1);
        assert_eq!(count, 1, "a message without type tags");
    }

    #[test]
    fn a_take_starts_with_a_bar_after_four_beats() {
        let timeline = Timeline::steady(0, Seconds(0.0), Seconds(0.5));
        let first = |now: f64| first_beat(&timeline, Seconds(now)).0;
        for beat in 0..16 {
            let at = f64::from(beat) + 0.25;
            let first = first(at * 0.5);
            assert_eq!(timeline.bar_position(first as i64), 0);
            assert!((at + 4.0..at + 8.0).contains(&first), "{at}: {first}");
        }
    }
}
