//! The reasons why a message of a client of the page is refused, as sentences for its user. In: the
//! wrong value. Out: the sentence, the kind of fault. Thread: the page's.

use thiserror::Error;

use crate::web::colours::COLOUR_FORM;
use corybant_core::cue::control_text::ControlTextError;
use corybant_core::cue::take::TakeRefusal;
use corybant_core::fault::Fault;

/// The reasons why a client's message is refused.
#[derive(Debug, Error, PartialEq)]
pub enum ClientMessageError {
    /// The message is not JSON, or does not have the form of any known message.
    #[error(
        "not understood: {why}; send one command a message: {{\"cue\":\"label\"}}, {{\"lift\":\"label\"}}, {{\"cancel\":\"label\"}}, {{\"panic\":true}}, {{\"hold\":true}}, \
         {{\"release\":true}}, {{\"intensity\":0.7}}, {{\"scene\":\"calm\"}}, {{\"tempo\":\"tap\"}}, {{\"go\":true}}, {{\"back\":true}}, {{\"jump\":2}}, {{\"set_hold\":true}}, {{\"learn\":{{\"label\":\"salsa\"}}}}, \
         {{\"input_latency\":29}}, {{\"channels\":[1,2]}}, {{\"offset\":{{\"output\":0,\"ms\":40}}}}, {{\"keep\":true}}, {{\"record\":{{\"label\":\"mine\"}}}}, {{\"record_stop\":true}} or {{\"colour\":{{\"group\":\"pads\",\"colour\":\"#ffb52e\"}}}}"
    )]
    Shape {
        /// The error of the JSON parser.
        why: String,
    },
    /// The message names a label that the graph does not have.
    #[error("there is no label `{label}`; there are: {known}")]
    UnknownLabel {
        /// The unknown label, shortened if it is long.
        label: String,
        /// The labels of the graph, separated by commas.
        known: String,
    },
    /// The message names a scene that the show does not have.
    #[error("there is no scene `{scene}`; there are: {known}")]
    UnknownScene {
        /// The unknown scene, shortened if it is long.
        scene: String,
        /// The scenes of the show, separated by commas.
        known: String,
    },
    /// A number in the message is outside its range.
    #[error("`{key}` is {value}; allowed is {allowed}")]
    Range {
        /// Key in the message, whose value is the number.
        key: &'static str,
        /// The number in the message.
        value: f64,
        /// The allowed range, in words.
        allowed: &'static str,
    },
    /// The message names a group of pads that the show does not have.
    #[error("there is no group of pads `{group}`; there are: {known}")]
    UnknownGroup {
        /// The unknown group, shortened if it is long.
        group: String,
        /// The groups of the show, separated by commas.
        known: String,
    },
    /// The colour is not of the form `#rrggbb`.
    #[error("`colour` is `{colour}`; allowed is {COLOUR_FORM}")]
    Colour {
        /// The text in the message, shortened if it is long.
        colour: String,
    },
    /// The tempo command is unknown or has a wrong argument.
    #[error("`tempo`: {0}")]
    Tempo(#[from] ControlTextError),
    /// The request to record a take has a wrong value.
    #[error("`record`: {0}")]
    Take(#[from] TakeRefusal),
    /// The map entry (action for a MIDI control) in a `learn` message is invalid.
    #[error("`learn`: {why}")]
    Learn {
        /// The reason why the map entry is invalid, in words.
        why: String,
    },
}

impl ClientMessageError {
    /// Returns the kind of fault that is counted for this error.
    pub fn fault(&self) -> Fault {
        match self {
            Self::UnknownLabel { .. } => Fault::UnknownLabel,
            Self::Shape { .. }
            | Self::UnknownScene { .. }
            | Self::Range { .. }
            | Self::UnknownGroup { .. }
            | Self::Colour { .. }
            | Self::Tempo(_)
            | Self::Take(_)
            | Self::Learn { .. } => Fault::BadPage,
        }
    }
}
