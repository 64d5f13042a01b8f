//! Converts between requests of the API and messages of the page's WebSocket. Each command has one
//! meaning, whichever way it comes in.
//!
//! In: the name and the body of a request. Out: a message, or the reason for the refusal. Pure.
//!
//! | message | request |
//! |---|---|
//! | `{"cue":"salsa","beats":16}` | `POST /api/cue` with `{"label":"salsa","beats":16}` |
//! | `{"panic":true}` | `POST /api/panic` without a body |
//! | `{"intensity":0.7}` | `POST /api/intensity` with `{"value":0.7}` |
//! | `{"record":{"label":"mine"}}` | `POST /api/record` with `{"label":"mine"}` |

use axum::http::StatusCode;
use serde_json::{Map, Value, json};
use thiserror::Error;

use crate::web::right::Right;
use corybant_core::cue::verbs::VERBS;

/// Commands whose message has a label as the value of their name.
const BY_LABEL: [&str; 4] = ["cue", "lift", "cancel", "record_rename"];
/// Messages that are not in the table of verbs, with the help for their requests.
const OTHERS: [(&str, &str); 10] = [
    (
        r#"{"record":{"label":"mine","beats":16}}"#,
        "record a take of the live performer",
    ),
    (r#"{"record_stop":true}"#, "stop the take"),
    (
        r#"{"record_undo":true}"#,
        "remove the last take from the show",
    ),
    (
        r#"{"record_rename":"yours"}"#,
        "give the last take another label",
    ),
    (
        r#"{"learn":{"label":"salsa"}}"#,
        "give the next MIDI control that is moved this entry of a [[midi.map]]",
    ),
    (
        r#"{"input_latency":29}"#,
        "latency of the audio input, milliseconds",
    ),
    (
        r#"{"channels":[1,2]}"#,
        "channels of the audio input; an empty list for all",
    ),
    (
        r#"{"offset":{"output":0,"ms":40}}"#,
        "offset of one output, counted from 0",
    ),
    (
        r#"{"keep":true}"#,
        "write latency, channels and offsets into the show file",
    ),
    (
        r##"{"colour":{"group":"pads","colour":"#ffb52e"}}"##,
        "colour of a group of pads",
    ),
];

/// The reasons why a request is not a message.
#[derive(Debug, Error, PartialEq)]
pub(super) enum RequestError {
    /// There is no command of this name.
    #[error("there is no POST /api/{name}; GET /api lists all requests")]
    Name {
        /// The unknown name, shortened if it is long.
        name: String,
    },
    /// The body is not a JSON object.
    #[error("the body of POST /api/{name} is not a JSON object: {why}")]
    Body {
        /// Name of the command.
        name: String,
        /// The error of the JSON parser.
        why: String,
    },
    /// The body of a command for a label has no label.
    #[error("the body of POST /api/{name} has no \"label\"; send {{\"label\":\"salsa\"}}")]
    Label {
        /// Name of the command.
        name: String,
    },
}

impl RequestError {
    /// Returns the status of the response.
    pub(super) fn status(&self) -> StatusCode {
        match self {
            Self::Name { .. } => StatusCode::NOT_FOUND,
            Self::Body { .. } => StatusCode::BAD_REQUEST,
            Self::Label { .. } => StatusCode::UNPROCESSABLE_ENTITY,
        }
    }
}

/// A request of the API, with an example of its body.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Request {
    /// Path, such as `/api/cue`.
    pub path: String,
    /// Body; `null` if the request needs none.
    pub body: Value,
    /// The right that the request needs.
    pub right: Right,
    /// What it does, one phrase.
    pub help: &'static str,
}

/// Returns all requests that send a command.
pub(super) fn requests() -> impl Iterator<Item = Request> {
    let verbs = VERBS
        .iter()
        .map(|verb| (verb.message, verb.help, Right::Play));
    let others = OTHERS
        .iter()
        .map(|&(message, help)| (message, help, Right::Configure));
    verbs
        .chain(others)
        .filter_map(|(message, help, right)| of_message(message, help, right))
}

/// Returns the request that sends the message `message`; `None` for a verb without a message.
fn of_message(message: &str, help: &'static str, right: Right) -> Option<Request> {
    let mut keys: Map<String, Value> = serde_json::from_str(message).ok()?;
    let name = match keys.len() {
        1 => keys.keys().next()?.clone(),
        _ => "cue".to_owned(),
    };
    let value = keys.remove(&name)?;
    let body = match value {
        label if BY_LABEL.contains(&name.as_str()) => {
            let mut body = Map::from_iter([("label".to_owned(), label)]);
            body.append(&mut keys);
            Value::Object(body)
        }
        Value::Bool(true) if !["hold", "set_hold"].contains(&name.as_str()) => Value::Null,
        object @ Value::Object(_) => object,
        value => json!({ "value": value }),
    };
    Some(Request {
        path: format!("/api/{name}"),
        body,
        right,
        help,
    })
}

/// Returns the message for the request `POST /api/NAME` with `body`, as a client of the WebSocket
/// would send it. The values in it are not checked.
///
/// # Errors
/// [`RequestError`] for an unknown name, a body that is no JSON object, and a missing label.
pub(super) fn of_request(name: &str, body: &[u8]) -> Result<String, RequestError> {
    let path = format!("/api/{name}");
    if !requests().any(|request| request.path == path) {
        return Err(RequestError::Name {
            name: name.chars().take(40).collect(),
        });
    }
    let name = name.to_owned();
    if body.trim_ascii().is_empty() {
        return match BY_LABEL.contains(&name.as_str()) {
            true => Err(RequestError::Label { name }),
            false => Ok(json!({ name: true }).to_string()),
        };
    }
    let parsed: Result<Map<String, Value>, _> = serde_json::from_slice(body);
    let mut keys = parsed.map_err(|error| RequestError::Body {
        name: name.clone(),
        why: error.to_string(),
    })?;
    let message = if BY_LABEL.contains(&name.as_str()) {
        let Some(label) = keys.remove("label") else {
            return Err(RequestError::Label { name });
        };
        keys.insert(name, label);
        Value::Object(keys)
    } else if keys.len() == 1 && keys.contains_key("value") {
        json!({ name: keys["value"] })
    } else {
        json!({ name: keys })
    };
    Ok(message.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::web::client_message::{ClientMessages, ClientRequest};

    fn sent(name: &str, body: &str) -> Value {
        let text = of_request(name, body.as_bytes()).unwrap();
        serde_json::from_str(&text).unwrap()
    }

    #[test]
    fn every_request_of_the_list_is_the_message_it_comes_from() {
        let messages = VERBS.iter().map(|verb| verb.message);
        let others = OTHERS.iter().map(|(message, _)| *message);
        let all: Vec<&str> = messages.chain(others).filter(|it| !it.is_empty()).collect();
        assert_eq!(requests().count(), all.len());
        let labels = ["salsa", "mine"].map(String::from);
        for (message, request) in all.iter().zip(requests()) {
            let expected: Value = serde_json::from_str(message).unwrap();
            let body = match &request.body {
                Value::Null => String::new(),
                body => body.to_string(),
            };
            let name = request.path.strip_prefix("/api/").unwrap();
            assert_eq!(sent(name, &body), expected, "{message}");
            let text = expected.to_string().replace("LABEL", "salsa");
            let resolved = ClientMessages::new(&labels).resolve(&text);
            if let Ok(resolved) = resolved {
                let may_play = matches!(resolved, ClientRequest::Cue(_));
                assert_eq!(request.right == Right::Play, may_play, "{message}");
            }
        }
    }

    #[test]
    fn a_body_of_its_own_is_converted() {
        let cue = r#"{"label":"salsa","beats":16,"mode":"gate"}"#;
        assert_eq!(
            sent("cue", cue),
            json!({ "cue": "salsa", "beats": 16, "mode": "gate" })
        );
        assert_eq!(sent("hold", r#"{"value":false}"#), json!({ "hold": false }));
        assert_eq!(sent("hold", ""), json!({ "hold": true }));
        assert_eq!(
            sent("intensity", r#"{"value":null}"#),
            json!({ "intensity": null })
        );
    }

    #[test]
    fn a_wrong_request_is_explained() {
        for (name, body, status, text) in [
            ("dance", "", 404, "there is no POST /api/dance"),
            ("state", "{}", 404, "there is no POST /api/state"),
            ("cue", "", 422, "has no \"label\""),
            ("cue", r#"{"labels":"salsa"}"#, 422, "has no \"label\""),
            ("panic", "true", 400, "not a JSON object"),
            ("panic", "{", 400, "not a JSON object"),
            ("panic", "\u{0}", 400, "not a JSON object"),
        ] {
            let error = of_request(name, body.as_bytes()).unwrap_err();
            assert_eq!(error.status().as_u16(), status, "{name} {body}");
            assert!(error.to_string().contains(text), "{error}");
        }
    }
}
