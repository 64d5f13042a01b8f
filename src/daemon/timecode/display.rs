//! The state of timecode on displays. In: the state from the show thread. Out: vitals, a warning while
//! timecode is missing. Thread: main.

use crate::rt::warnings::Warnings;
use crate::web::vitals::TimecodeVitals;
use corybant_core::cue::list::lead::LeadStatus;
use corybant_core::timecode::settings::Source;
use corybant_core::timecode::{State, rate_name};

/// Subject under which the warning about timecode is listed.
const WARNING_TOPIC: &str = "timecode";

/// Returns the vitals of the timecode of `source` with the state `status`.
pub(in crate::daemon) fn vitals(source: &Source, status: &LeadStatus) -> TimecodeVitals {
    let position = &status.position;
    TimecodeVitals {
        source: source.to_string(),
        state: position.state.name(),
        frame: position.timecode().map(|frame| frame.to_string()),
        rate: position.rate.map(rate_name),
        speed: position.speed,
        song: status.song,
        engaged: status.is_engaged,
    }
}

/// Sets or clears the warning that timecode of `source` is missing.
pub(in crate::daemon) fn warn(warnings: &Warnings, source: &Source, status: &LeadStatus) {
    let what = match status.position.state {
        _ if !status.is_engaged => return warnings.clear(WARNING_TOPIC),
        State::Locked | State::Standing | State::Freewheel => {
            return warnings.clear(WARNING_TOPIC);
        }
        State::Waiting => "no timecode has arrived yet",
        State::Lost => "timecode is lost",
    };
    let text = format!(
        "{what} ({source}): the cue list waits, the dance goes on; check the sender and its connection"
    );
    warnings.set(WARNING_TOPIC, &text);
}
