//! Limits of a performer's tempo commands. In: a command from any sender. Out: the command within
//! the limits of the show. Thread: any.

use std::ops::RangeInclusive;

use crate::tempo::command::TempoCommand;
use crate::time::{Bpm, Seconds};

/// The greatest size of one nudge (shift of all beats, earlier or later), in milliseconds; a larger
/// nudge is set to this limit.
pub const NUDGE_MS_MAX: f64 = 500.0;
/// The tempi that a performer's command may set, in beats per minute; a command with another tempo
/// is ignored. A show doubles or halves the tempo until it is in the range of the show.
pub const BPM_ALLOWED: RangeInclusive<f64> = 20.0..=400.0;

/// Returns `command` within the limits of a show; `None` for a number that is not finite, and for a
/// tempo outside of [`BPM_ALLOWED`]. A nudge over ±[`NUDGE_MS_MAX`] is set to this limit. A tempo
/// is doubled or halved until it is in `bpm_range`, whose end must be at least twice its start.
pub fn limited(command: TempoCommand, bpm_range: &RangeInclusive<f64>) -> Option<TempoCommand> {
    let nudge_s_max = NUDGE_MS_MAX / 1000.0;
    match command {
        TempoCommand::Nudge(shift) => shift
            .0
            .is_finite()
            .then(|| TempoCommand::Nudge(Seconds(shift.0.clamp(-nudge_s_max, nudge_s_max)))),
        TempoCommand::Tempo(bpm) => Some(TempoCommand::Tempo(in_range(bpm, bpm_range)?)),
        TempoCommand::Hint(Some(bpm)) => Some(TempoCommand::Hint(Some(in_range(bpm, bpm_range)?))),
        TempoCommand::Tap
        | TempoCommand::Half
        | TempoCommand::Double
        | TempoCommand::Downbeat
        | TempoCommand::Source(_)
        | TempoCommand::Freeze(_)
        | TempoCommand::Engage(_)
        | TempoCommand::Hint(None) => Some(command),
    }
}

/// Returns `bpm`, doubled or halved until it is in `bpm_range`; `None` if it is outside of
/// [`BPM_ALLOWED`].
fn in_range(Bpm(mut bpm): Bpm, bpm_range: &RangeInclusive<f64>) -> Option<Bpm> {
    if !BPM_ALLOWED.contains(&bpm) {
        return None;
    }
    while bpm < *bpm_range.start() {
        bpm *= 2.0;
    }
    while bpm > *bpm_range.end() {
        bpm /= 2.0;
    }
    Some(Bpm(bpm))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_stays_within_the_limits() {
        let limited = |command| limited(command, &(60.0..=180.0));
        assert_eq!(
            limited(TempoCommand::Nudge(Seconds(-3.0))),
            Some(TempoCommand::Nudge(Seconds(-0.5)))
        );
        assert_eq!(limited(TempoCommand::Nudge(Seconds(f64::NAN))), None);
        for (bpm, used) in [
            (20.0, 80.0),
            (59.0, 118.0),
            (60.0, 60.0),
            (179.5, 179.5),
            (181.0, 90.5),
            (400.0, 100.0),
        ] {
            assert_eq!(
                limited(TempoCommand::Tempo(Bpm(bpm))),
                Some(TempoCommand::Tempo(Bpm(used)))
            );
        }
        for bpm in [f64::NAN, f64::INFINITY, 0.0, -120.0, 1e-300] {
            assert_eq!(limited(TempoCommand::Tempo(Bpm(bpm))), None);
        }
        assert_eq!(limited(TempoCommand::Tap), Some(TempoCommand::Tap));
    }
}
