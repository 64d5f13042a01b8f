//! Responses of requests whose work waits for the disk: what the setup and the import page share. In:
//! the work. Out: JSON. Thread: the server's; the work runs on tokio's threads for such work.

use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::{FromRequest, Request};
use axum::http::StatusCode;
use axum::http::header::{CONTENT_TYPE, HeaderName};
use axum::response::{IntoResponse, Response};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::spawn_blocking;

/// Longest accepted body of a request that is not a file, in bytes.
pub(crate) const BODY_BYTES_MAX: usize = 64 << 10;
/// Largest number of files that are received at the same time.
const UPLOADS_MAX: usize = 2;
/// Header of a response in JSON.
const JSON: (HeaderName, &str) = (CONTENT_TYPE, "application/json");

/// Reason for a refused request: status and sentence.
pub(crate) type RequestError = (StatusCode, String);

/// Runs `work` on a thread that may wait, and returns its result as a response.
pub(crate) async fn respond(
    work: impl FnOnce() -> Result<Value, RequestError> + Send + 'static,
) -> Response {
    match spawn_blocking(work).await {
        Ok(Ok(value)) => ([JSON], value.to_string()).into_response(),
        Ok(Err(error)) => refusal(error),
        Err(error) => (StatusCode::INTERNAL_SERVER_ERROR, error.to_string()).into_response(),
    }
}

/// Returns the response to a refused request: `{"message":text}`.
fn refusal((status, message): RequestError) -> Response {
    (status, [JSON], json!({ "message": message }).to_string()).into_response()
}

/// Returns the reason `message` for a request that is understood but cannot be done.
pub(crate) fn unprocessable(message: String) -> RequestError {
    (StatusCode::UNPROCESSABLE_ENTITY, message)
}

/// Reads the body of a request.
///
/// # Errors
/// A sentence that says what is not understood.
pub(crate) fn parse<T: DeserializeOwned>(body: &str) -> Result<T, String> {
    serde_json::from_str(body).map_err(|error| format!("the request is not understood: {error}"))
}

/// The files that are being received. Clones share the limits.
#[derive(Clone)]
pub(crate) struct Uploads {
    permits: Arc<Semaphore>,
    /// Largest accepted file, in bytes.
    pub(crate) bytes_max: usize,
}

/// A received file. While the value lives, it counts as one of the files that are being received.
pub(crate) struct Upload {
    pub(crate) bytes: Bytes,
    _permit: OwnedSemaphorePermit,
}

impl Uploads {
    /// Creates the limits for files of at most `bytes_max` bytes.
    pub(crate) fn new(bytes_max: usize) -> Self {
        Self {
            permits: Arc::new(Semaphore::new(UPLOADS_MAX)),
            bytes_max,
        }
    }

    /// Receives the file `name` from the body of `request`, whose limit is that of the route.
    ///
    /// # Errors
    /// The response to a file that is too large or not received completely.
    pub(crate) async fn receive(&self, name: &str, request: Request) -> Result<Upload, Response> {
        let Ok(permit) = self.permits.clone().acquire_owned().await else {
            return Err(StatusCode::SERVICE_UNAVAILABLE.into_response());
        };
        let Ok(bytes) = Bytes::from_request(request, &()).await else {
            let limit = self.bytes_max >> 20;
            let message = format!("{name} is not received completely: a file may have {limit} MiB");
            return Err(refusal((StatusCode::PAYLOAD_TOO_LARGE, message)));
        };
        Ok(Upload {
            bytes,
            _permit: permit,
        })
    }
}
