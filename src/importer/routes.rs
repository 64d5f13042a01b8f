//! The requests of the import page. In: requests with access to the setup. Out: JSON, the files of
//! the page.
//!
//! | request | body | response |
//! |---|---|---|
//! | `GET /setup/import/state` | | the folder, the motion files and the build |
//! | `GET /setup/import/thumbs` | | the thumbnail of each motion file |
//! | `POST /setup/import/files/LABEL/NAME` | the file, or a ZIP | the state with `refused` |
//! | `DELETE /setup/import/files/LABEL/NAME` | | the state |
//! | `PUT /setup/import/clip` | the settings of a file | the state |
//! | `POST /setup/import/build` | | the state |
//! | `GET /setup/import/dance` | | a dance of the graph, packed as in `editor/dance.rs` |
//! | `POST /setup/import/save` | `{"folder":…,"name":…}` | the state |
//! | `POST /setup/import/quit` | | |
//!
//! A refused request gets `{"message":text}`. Thread: "import-page"; work that waits runs on tokio's
//! threads for such work.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{DefaultBodyLimit, Path, Request, State};
use axum::http::StatusCode;
use axum::http::header::{CONTENT_TYPE, HeaderName};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post, put};
use serde::Deserialize;
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::sync::oneshot;

use super::folder::Change;
use super::{Importer, Progress};
use crate::daemon::setup;
use crate::offline::motion_dir::uploads::FILE_BYTES_MAX;
use crate::web::assets::{self, IMPORT_ASSETS};
use crate::web::auth::Access;
use crate::web::http;
use crate::web::http::replies::{self, BODY_BYTES_MAX, Uploads, parse, unprocessable};

const BYTES: (HeaderName, &str) = (CONTENT_TYPE, "application/octet-stream");

/// The data that all requests share.
#[derive(Clone)]
struct Shared {
    importer: Arc<Importer>,
    uploads: Uploads,
}

/// Serves the page for `importer` on `listener` until `stopped` is signalled; `access` checks the
/// requests.
pub(super) async fn run(
    listener: TcpListener,
    access: Access,
    importer: Arc<Importer>,
    stopped: oneshot::Receiver<()>,
) {
    let router = assets::router(assets::with_shared(IMPORT_ASSETS)).merge(router(importer));
    tokio::select! {
        _ = stopped => {}
        () = http::Server::new("the page").serve(listener, access.protect(router)) => {}
    }
}

fn router(importer: Arc<Importer>) -> Router {
    let file = post(add_file)
        .delete(remove_file)
        .layer(DefaultBodyLimit::max(FILE_BYTES_MAX));
    Router::new()
        .route(
            "/setup/import/state",
            get(async |State(shared): State<Shared>| answer(shared, |_| Ok(())).await),
        )
        .route("/setup/import/thumbs", get(thumbs))
        .route("/setup/import/clip", put(change))
        .route(
            "/setup/import/build",
            post(async |State(shared): State<Shared>| answer(shared, Importer::start_build).await),
        )
        .route("/setup/import/dance", get(dance))
        .route("/setup/import/save", post(save))
        .route("/setup/import/quit", post(quit))
        .layer(DefaultBodyLimit::max(BODY_BYTES_MAX))
        .route("/setup/import/files/{label}/{name}", file)
        .with_state(Shared {
            importer,
            uploads: Uploads::new(FILE_BYTES_MAX),
        })
}

/// Runs `work` on a thread that may wait, and returns its result as a response.
async fn respond(
    shared: Shared,
    work: impl FnOnce(&Arc<Importer>) -> Result<Value, String> + Send + 'static,
) -> Response {
    replies::respond(move || work(&shared.importer).map_err(unprocessable)).await
}

/// Runs `work` on a thread that may wait, and returns the state of the page afterwards.
async fn answer(
    shared: Shared,
    work: impl FnOnce(&Arc<Importer>) -> Result<(), String> + Send + 'static,
) -> Response {
    respond(shared, |importer| {
        work(importer)?;
        Ok(importer.to_json())
    })
    .await
}

async fn thumbs(State(shared): State<Shared>) -> Response {
    respond(shared, |importer| {
        let report = importer.state().report.clone();
        Ok(report.thumbs())
    })
    .await
}

async fn add_file(
    State(shared): State<Shared>,
    Path((label, name)): Path<(String, String)>,
    request: Request,
) -> Response {
    let upload = match shared.uploads.receive(&name, request).await {
        Ok(upload) => upload,
        Err(refused) => return refused,
    };
    respond(shared, move |importer| {
        let refused = importer.add_with_label(&label, &name, &upload.bytes)?;
        let mut state = importer.to_json();
        state["refused"] = json!(refused);
        Ok(state)
    })
    .await
}

async fn remove_file(
    State(shared): State<Shared>,
    Path((label, name)): Path<(String, String)>,
) -> Response {
    answer(shared, move |importer| {
        importer.folder().remove(&format!("{label}/{name}"))?;
        importer.state().is_stale = true;
        importer.start_reading()
    })
    .await
}

async fn change(State(shared): State<Shared>, body: String) -> Response {
    answer(shared, move |importer| {
        let change: Change = parse(&body)?;
        let must_read = importer.folder().change(change)?;
        importer.state().is_stale = true;
        if must_read {
            importer.start_reading()?;
        }
        Ok(())
    })
    .await
}

async fn dance(State(shared): State<Shared>) -> Response {
    match shared.importer.state().dance.clone() {
        Some(bytes) => ([BYTES], Body::from(Bytes::from_owner(bytes))).into_response(),
        None => StatusCode::NO_CONTENT.into_response(),
    }
}

#[derive(Deserialize)]
struct SaveRequest {
    folder: String,
    name: String,
}

async fn save(State(shared): State<Shared>, body: String) -> Response {
    answer(shared, move |importer| {
        let request: SaveRequest = parse(&body)?;
        let to = setup::new_folder(&request.folder, &request.name)?;
        if matches!(importer.state().build, Progress::Running { .. }) {
            return Err("the graph is being built; save afterwards".into());
        }
        importer.folder().save(&to)?;
        // The report on the files holds for the copies too.
        Ok(())
    })
    .await
}

async fn quit(State(shared): State<Shared>) -> Response {
    shared.importer.end.store(true, Ordering::Relaxed);
    respond(shared, |_| Ok(json!({}))).await
}
