//! The requests of the page that set up the show. In: requests with access to the setup. Out: JSON.
//!
//! | request | body | response |
//! |---|---|---|
//! | `GET /setup/state` | | the state of the setup |
//! | `GET /setup/inputs` | | the audio inputs of this machine |
//! | `POST /setup/input` | `{"input":…}` | |
//! | `POST /setup/renderer` | `{"id":…,"to":"HOST:PORT"}` | |
//! | `POST /setup/motions/LABEL/NAME` | the file, or a ZIP | |
//! | `DELETE /setup/motions` | | |
//! | `POST /setup/build` | | |
//! | `POST /setup/import` | | a link to the import page of the motions, which works once |
//! | `POST /setup/shows` | `{"folder":…}` | the names of the shows in the folder |
//! | `POST /setup/open` | `{"folder":…,"name":…}` | |
//! | `POST /setup/save` | `{"folder":…,"name":…,"replace":bool}` | the path; 409 if a file exists |
//! | `POST /setup/quit` | | |
//!
//! A request without a listed response gets the state of the setup. A refused request gets
//! `{"message":text}`. Thread: "page"; work that waits runs on tokio's threads for such work.

use std::sync::Arc;

use axum::Router;
use axum::extract::{DefaultBodyLimit, Path, Request, State};
use axum::http::StatusCode;
use axum::response::Response;
use axum::routing::{get, post};
use serde::Deserialize;
use serde_json::{Value, json};

use super::save::{self, SaveError};
use super::{Setup, choices};
use crate::audio::input;
use crate::offline::motion_dir::uploads::FILE_BYTES_MAX;
use crate::web::http::replies::{
    self, BODY_BYTES_MAX, RequestError, Uploads, parse, unprocessable,
};
use corybant_files::shown;

/// The data that all requests share.
#[derive(Clone)]
struct Shared {
    setup: Arc<Setup>,
    uploads: Uploads,
}

/// Returns the router of the requests that change `setup`.
pub(super) fn router(setup: Arc<Setup>) -> Router {
    let motion = post(add_motion).layer(DefaultBodyLimit::max(FILE_BYTES_MAX));
    Router::new()
        .route(
            "/setup/state",
            get(async |State(shared): State<Shared>| answer(shared, |_| Ok(())).await),
        )
        .route("/setup/inputs", get(inputs))
        .route("/setup/input", post(choose_input))
        .route("/setup/renderer", post(choose_renderer))
        .route("/setup/motions", axum::routing::delete(remove_motions))
        .route("/setup/build", post(build))
        .route("/setup/import", post(import))
        .route("/setup/shows", post(shows))
        .route("/setup/open", post(open))
        .route("/setup/save", post(save_show))
        .route("/setup/quit", post(quit))
        .layer(DefaultBodyLimit::max(BODY_BYTES_MAX))
        .route("/setup/motions/{label}/{name}", motion)
        .with_state(Shared {
            setup,
            uploads: Uploads::new(FILE_BYTES_MAX),
        })
}

/// Runs `work` on a thread that may wait, and returns its result as a response.
async fn respond(
    shared: Shared,
    work: impl FnOnce(&Arc<Setup>) -> Result<Value, RequestError> + Send + 'static,
) -> Response {
    replies::respond(move || work(&shared.setup)).await
}

/// Runs `work` on a thread that may wait, and returns the state of the setup afterwards.
async fn answer(
    shared: Shared,
    work: impl FnOnce(&Arc<Setup>) -> Result<(), String> + Send + 'static,
) -> Response {
    respond(shared, |setup| {
        work(setup).map_err(unprocessable)?;
        Ok(setup.to_json())
    })
    .await
}

async fn inputs(State(shared): State<Shared>) -> Response {
    respond(shared, |_| Ok(choices::inputs(&input::devices()))).await
}

#[derive(Deserialize)]
struct InputRequest {
    input: String,
}

async fn choose_input(State(shared): State<Shared>, body: String) -> Response {
    answer(shared, move |setup| {
        let request: InputRequest = parse(&body)?;
        setup.choose_input(&request.input)
    })
    .await
}

#[derive(Deserialize)]
struct RendererRequest {
    id: String,
    to: String,
}

async fn choose_renderer(State(shared): State<Shared>, body: String) -> Response {
    answer(shared, move |setup| {
        let request: RendererRequest = parse(&body)?;
        setup.choose_renderer(&request.id, &request.to)
    })
    .await
}

async fn add_motion(
    State(shared): State<Shared>,
    Path((label, name)): Path<(String, String)>,
    request: Request,
) -> Response {
    let upload = match shared.uploads.receive(&name, request).await {
        Ok(upload) => upload,
        Err(refused) => return refused,
    };
    answer(shared, move |setup| {
        setup.add_motion(&label, &name, &upload.bytes)
    })
    .await
}

async fn remove_motions(State(shared): State<Shared>) -> Response {
    answer(shared, |setup| setup.remove_motions()).await
}

async fn build(State(shared): State<Shared>) -> Response {
    answer(shared, |setup| setup.start_build()).await
}

async fn import(State(shared): State<Shared>) -> Response {
    respond(shared, |setup| {
        let link = setup.open_import().map_err(unprocessable)?;
        Ok(json!({ "link": link }))
    })
    .await
}

#[derive(Deserialize)]
struct FolderRequest {
    folder: String,
}

async fn shows(State(shared): State<Shared>, body: String) -> Response {
    respond(shared, move |_| {
        let request: FolderRequest = parse(&body).map_err(unprocessable)?;
        save::shows(&request.folder)
            .map(Value::from)
            .map_err(unprocessable)
    })
    .await
}

#[derive(Deserialize)]
struct ShowRequest {
    folder: String,
    name: String,
    #[serde(default)]
    replace: bool,
}

async fn open(State(shared): State<Shared>, body: String) -> Response {
    answer(shared, move |setup| {
        let request: ShowRequest = parse(&body)?;
        setup.open(&request.folder, &request.name)
    })
    .await
}

async fn save_show(State(shared): State<Shared>, body: String) -> Response {
    respond(shared, move |setup| {
        let request: ShowRequest = parse(&body).map_err(unprocessable)?;
        match setup.save(&request.folder, &request.name, request.replace) {
            Ok(path) => Ok(json!({ "path": shown(&path) })),
            Err(SaveError::Exists(why)) => Err((StatusCode::CONFLICT, why)),
            Err(SaveError::Refused(why)) => Err(unprocessable(why)),
        }
    })
    .await
}

async fn quit(State(shared): State<Shared>) -> Response {
    answer(shared, |setup| {
        setup.quit();
        Ok(())
    })
    .await
}
