//! The state of a set list for clients. In: a status. Out: JSON. Pure.

use serde::Serialize;

use corybant_core::cue::set::{Position, SetStatus};

/// The state of a set list: `{"current":index|null,"next":index|null,"beats_left":x|null,
/// "follows":"none|music|beat|timecode","beat":x|null,"seconds":x|null,"held":bool,
/// "graph":"ready|loading","next_graph":"ready|loading"}`.
///
/// An index is that of a song, from 0. The next song waits for its bar, `beats_left` beats from now,
/// if that is not null. The song that is played is at `beat`, or at `seconds` of timecode; with
/// `"follows":"music"` it waits for the music.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct SetState {
    pub(super) current: Option<u16>,
    pub(super) next: Option<u16>,
    beats_left: Option<f64>,
    follows: &'static str,
    beat: Option<f64>,
    seconds: Option<f64>,
    held: bool,
    graph: &'static str,
    next_graph: &'static str,
}

impl SetState {
    /// Returns the state of the set list with the status `status`.
    pub(super) fn of(status: &SetStatus) -> Self {
        let rounded = |x: f64| (x * 100.0).round() / 100.0;
        let seconds = match status.position {
            Position::Timecode(_, seconds) => seconds,
            Position::None | Position::Music | Position::Beat(_) => None,
        };
        Self {
            current: status.current,
            next: status.next,
            beats_left: status.beats_left.map(|beats| rounded(beats.into())),
            follows: status.position.name(),
            beat: status.position.beat().map(rounded),
            seconds: seconds.map(rounded),
            held: status.is_held,
            graph: status.graph.name(),
            next_graph: status.next_graph.name(),
        }
    }
}
