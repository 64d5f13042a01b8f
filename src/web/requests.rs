//! Does what clients request, by WebSocket and by HTTP. In: a message and the right of its client.
//! Out: cues, changed settings, or the reason for a refusal. Thread: the page's.

use thiserror::Error;

use super::client_message::{ClientMessageError, ClientRequest};
use super::right::Right;
use super::server::Shared;
use crate::rt::takes::NO_TAKES;
use crate::web::calibration::Setting;
use corybant_core::cue::{Cue, OutputCommand};
use corybant_core::time::Seconds;

/// The reasons why a request of a client is not done.
#[derive(Debug, Error)]
pub(super) enum PerformError {
    /// The message is malformed, or names something that the show does not have.
    #[error(transparent)]
    Message(#[from] ClientMessageError),
    /// The client may not do this.
    #[error("this client may only send cues; settings, MIDI learn and takes need the page's token")]
    Right,
    /// The show cannot do this now.
    #[error("{0}")]
    Show(String),
}

/// Does what the message `text` of a client with the right `right` requests. Returns a text to show
/// to the user, or `None` if there is nothing to tell.
///
/// # Errors
/// [`PerformError`] if nothing was done. A malformed message is counted as a fault.
pub(super) async fn perform(
    text: &str,
    right: Right,
    shared: &Shared,
) -> Result<Option<String>, PerformError> {
    let request = shared.about.borrow().messages.resolve(text);
    let request = request.inspect_err(|error| shared.context.faults.count(error.fault()))?;
    if right < Right::Configure && !matches!(request, ClientRequest::Cue(_)) {
        return Err(PerformError::Right);
    }
    match request {
        ClientRequest::Cue(cue) => {
            tracing::debug!("the page sent {cue:?}");
            shared.context.cues.push(cue);
        }
        ClientRequest::Learn(entry) => match (&shared.context.learn, entry) {
            (Some(midi), Some(entry)) => midi.learn(entry),
            (Some(midi), None) => midi.cancel_learn(),
            (None, _) => {}
        },
        ClientRequest::Take(request) => match &shared.context.takes {
            Some(takes) => takes.request(request),
            None => return Err(PerformError::Show(NO_TAKES.into())),
        },
        ClientRequest::Setting(setting) => {
            return apply_setting(setting, shared)
                .await
                .map_err(PerformError::Show);
        }
    }
    Ok(None)
}

/// Applies a change of the calibration. Returns a text to show to the user, or `None` if there is
/// nothing to tell. An error says why the change was refused.
async fn apply_setting(setting: Setting, shared: &Shared) -> Result<Option<String>, String> {
    let calibration = shared.context.calibration.clone();
    if matches!(setting, Setting::Keep | Setting::Colour { .. }) {
        // A slow disk must not delay the other clients.
        let written = tokio::task::spawn_blocking(move || calibration.apply(setting))
            .await
            .map_err(|error| error.to_string())?;
        return written.map(|_| Some("kept in the show file".to_owned()));
    }
    if calibration.apply(setting)? {
        shared
            .context
            .cues
            .push(Cue::Output(OutputCommand::LookAhead(Seconds(
                calibration.offset_s_max(),
            ))));
    }
    Ok(None)
}
