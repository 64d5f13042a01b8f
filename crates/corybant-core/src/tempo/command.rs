//! Tempo commands of a performer, and the edits of the beat grid that they cause.
//!
//! In: commands with their times. Out: grid edits.
//! Thread: any for commands, which are plain values; show for [`CommandResolver`].
//! Allocates: never.

use serde::{Deserialize, Serialize};

use super::source::TempoSource;
use super::tap::TapTempo;
use crate::beat::edit::GridEdit;
use crate::beat::tempo::period_range::PeriodRange;
use crate::time::{Bpm, Seconds};

/// A performer's command about the tempo or the beats, which takes effect at once.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum TempoCommand {
    /// Tap: a beat falls at the time of the command. Several taps in a row also set the tempo.
    Tap,
    /// Nudge: moves all beats later by this time; a negative time moves them earlier.
    Nudge(Seconds),
    /// Half: halves the current tempo.
    Half,
    /// Double: doubles the current tempo.
    Double,
    /// Downbeat: makes the beat nearest to the time of the command the first beat of its bar.
    Downbeat,
    /// Tempo: sets the tempo to this value; the last beat before the command keeps its time.
    Tempo(Bpm),
    /// Source: selects this tempo source, which the beats then follow.
    Source(TempoSource),
    /// Freeze: `Some(true)` keeps the current tempo and ignores the tempo source; `Some(false)`
    /// follows the source again; `None` switches between the two.
    Freeze(Option<bool>),
    /// Engage: `Some(true)` lets timecode lead the cue list, `Some(false)` ends that; `None`
    /// switches between the two. The program that has the cue list applies it.
    Engage(Option<bool>),
    /// Hint: the song that comes has this tempo. The beat tracker finds beats of this tempo sooner,
    /// but also finds another tempo; nothing else changes. `None` ends this.
    Hint(Option<Bpm>),
}

/// A converter from a performer's tempo commands to edits of the beat grid. It is the only
/// implementation of tap, nudge, half, double, tempo and downbeat.
pub struct CommandResolver {
    /// The latest taps of a performer, from which the beat period is measured.
    taps: TapTempo,
    /// The allowed beat periods, in seconds. A tempo with another beat period is doubled or halved
    /// until its beat period is allowed.
    range: PeriodRange,
}

impl CommandResolver {
    /// Creates a converter that produces beat periods within `range` (seconds).
    pub fn new(range: PeriodRange) -> Self {
        Self {
            taps: TapTempo::new(),
            range,
        }
    }

    /// Returns the edit of the beat grid for `command` at time `at` (seconds). A tempo outside the
    /// allowed range is doubled or halved until it is inside. `None` if a number of the command is
    /// not usable, or if the command edits no beat grid, such as the choice of the tempo source.
    pub fn resolve(&mut self, command: TempoCommand, at: f64) -> Option<GridEdit> {
        match command {
            TempoCommand::Tap => Some(GridEdit::Tap {
                period: self.taps.tap(at).and_then(|period| self.range.fold(period)),
            }),
            TempoCommand::Nudge(by) => by.0.is_finite().then_some(GridEdit::Shift(by.0)),
            TempoCommand::Half => Some(GridEdit::ScalePeriod(2.0)),
            TempoCommand::Double => Some(GridEdit::ScalePeriod(0.5)),
            TempoCommand::Downbeat => Some(GridEdit::Downbeat),
            TempoCommand::Tempo(bpm) => self.range.fold(bpm.period().0).map(GridEdit::SetPeriod),
            TempoCommand::Source(_)
            | TempoCommand::Freeze(_)
            | TempoCommand::Engage(_)
            | TempoCommand::Hint(_) => None,
        }
    }
}
