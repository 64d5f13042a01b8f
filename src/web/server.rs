//! The page's server: HTTP for the files, a WebSocket for snapshots and cues. In: requests,
//! snapshots. Out: responses, cues.
//!
//! Thread: the page's. Each snapshot is encoded once, and all clients share the text. Each client
//! gets the latest snapshot and skips older ones.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{Utf8Bytes, WebSocketUpgrade};
use axum::http::StatusCode;
use axum::http::header::{CONTENT_TYPE, HeaderName};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Extension, Router};
use tokio::net::TcpListener;
use tokio::sync::{oneshot, watch};
use tokio::time::{MissedTickBehavior, interval, timeout};

use super::about::{AboutSender, Served};
use super::assets::{self, ASSETS, SET_ASSETS, STAGE_ASSETS};
use super::auth::Access;
use super::avatar::Avatar;
use super::right::Right;
use super::{CLIENTS_MAX, MESSAGE_BYTES_MAX, Snapshot, WebContext, api, avatar, client};
use crate::rt::takes::{TakeDesk, TakeState};
use crate::web::http::websockets::WebSocketLimit;
use crate::web::http::{self, ClientAddress, Timeouts};
use corybant_core::show::status::Status;

/// Header of a response with JSON.
const JSON: (HeaderName, &str) = (CONTENT_TYPE, "application/json");
/// Least time between two snapshots that are sent to the clients: at most 60 snapshots per second.
const SNAPSHOT_INTERVAL: Duration = Duration::from_micros(16_667);
/// Longest time to wait until all clients have closed their connections when the show ends.
const CLOSE_MAX: Duration = Duration::from_millis(250);

/// Values that the tasks of all clients share.
pub(super) struct Shared {
    /// Receiver of the static data of the show, which a new motion graph changes.
    pub about: watch::Receiver<Served>,
    /// Cue queue, fault counters, warnings and calibration of the show.
    pub context: WebContext,
    /// Receiver of the latest vitals, as a message for clients.
    pub vitals: watch::Receiver<Utf8Bytes>,
    /// Interval of the pings to a client, and the times after which a silent client's connection is
    /// closed.
    pub timeouts: Timeouts,
    /// Limit of the number of clients that stay connected.
    pub clients: WebSocketLimit,
    avatars: Vec<Option<Avatar>>,
}

/// The page's server before it accepts connections.
pub(super) struct Server {
    shared: Arc<Shared>,
    access: Access,
    http: http::Server,
}

impl Server {
    /// Creates the page's server. `http` accepts the connections and `access` checks the requests.
    /// `about` is sent to each client first, and again after a change; `vitals` has the latest
    /// vitals as a message.
    pub fn new(
        http: http::Server,
        access: Access,
        about: &AboutSender,
        vitals: watch::Receiver<Utf8Bytes>,
        context: WebContext,
    ) -> Self {
        Self {
            shared: Arc::new(Shared {
                about: about.subscribe(),
                context,
                vitals,
                timeouts: http.timeouts,
                avatars: about.avatars(),
                clients: WebSocketLimit::new(http.limits.websockets(CLIENTS_MAX)),
            }),
            access,
            http,
        }
    }

    /// Serves clients that connect to `listener` until `stopped` is signalled, then closes all
    /// connections. The states of the show are read from `snapshots`.
    pub async fn run(
        self,
        listener: TcpListener,
        snapshots: triple_buffer::Output<Snapshot>,
        stopped: oneshot::Receiver<()>,
    ) {
        let shared = self.shared;
        let (state_sender, state) = watch::channel(Utf8Bytes::default());
        let (status_sender, status) = watch::channel(Status::default());
        let (warnings_sender, warnings) = watch::channel(Utf8Bytes::default());
        let api = api::router(&shared, status);
        let router = router(
            &shared,
            LatestMessages {
                about: shared.about.clone(),
                takes: shared.context.takes.as_ref().map(TakeDesk::state),
                state,
                vitals: shared.vitals.clone(),
                warnings,
            },
        );
        let router = self.access.protect(router.merge(api));
        tokio::select! {
            _ = stopped => {}
            () = publish(snapshots, (&state_sender, &status_sender, &warnings_sender), &shared) => {}
            () = self.http.serve(listener, router) => {}
        }
        drop((state_sender, status_sender));
        if timeout(CLOSE_MAX, shared.clients.all_closed())
            .await
            .is_err()
        {
            tracing::debug!("a browser did not answer the page's goodbye");
        }
    }
}

/// Sends each new snapshot and each change of the warnings to all clients. Encodes no snapshot
/// while no client is connected. The senders are those of the snapshot, of the status in it, and of
/// the warnings.
async fn publish(
    mut snapshots: triple_buffer::Output<Snapshot>,
    (state_sender, status_sender, warnings_sender): (
        &watch::Sender<Utf8Bytes>,
        &watch::Sender<Status>,
        &watch::Sender<Utf8Bytes>,
    ),
    shared: &Shared,
) {
    let mut ticks = interval(SNAPSHOT_INTERVAL);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut has_update = false;
    let mut sent_warnings = Vec::new();
    loop {
        ticks.tick().await;
        if snapshots.update() {
            status_sender.send_replace(snapshots.output_buffer().status);
            has_update = true;
        }
        if has_update && shared.clients.has_clients() {
            state_sender.send_replace(
                snapshots
                    .output_buffer()
                    .to_json(&shared.context.faults)
                    .into(),
            );
            has_update = false;
        }
        let warnings = shared.context.warnings.list();
        if warnings != sent_warnings {
            warnings_sender.send_replace(
                serde_json::json!({ "type": "warnings", "warnings": warnings })
                    .to_string()
                    .into(),
            );
            sent_warnings = warnings;
        }
    }
}

/// Receivers of the latest static data, snapshot, vitals and warnings as messages; each client gets
/// clones.
#[derive(Clone)]
pub(super) struct LatestMessages {
    /// Static data of the show.
    pub about: watch::Receiver<Served>,
    /// Latest snapshot, as JSON.
    pub state: watch::Receiver<Utf8Bytes>,
    /// Latest vitals, as JSON.
    pub vitals: watch::Receiver<Utf8Bytes>,
    /// Current warnings, as JSON.
    pub warnings: watch::Receiver<Utf8Bytes>,
    /// State of the take of a live performer; `None` if the show records none.
    pub takes: Option<watch::Receiver<TakeState>>,
}

fn router(shared: &Arc<Shared>, latest: LatestMessages) -> Router {
    let setup = shared.context.setup.as_ref();
    let setup = setup.map_or_else(Router::new, |setup| setup.router.clone());
    let socket = |most: Right| {
        let (shared, latest) = (Arc::clone(shared), latest.clone());
        get(
            async move |Extension(address): Extension<ClientAddress>,
                        Extension(right): Extension<Right>,
                        upgrade: WebSocketUpgrade| {
                upgrade_client(upgrade, address, right.min(most), shared, latest)
            },
        )
    };
    let about = shared.about.clone();
    assets::router(ASSETS.iter().chain(STAGE_ASSETS).chain(SET_ASSETS))
        .merge(setup)
        .merge(avatar::router(shared.avatars.clone()))
        .route(
            "/thumbs",
            get(async move || ([JSON], about.borrow().thumbs.clone())),
        )
        .route("/live", socket(Right::Configure))
        .route("/stage/live", socket(Right::View))
}

fn upgrade_client(
    upgrade: WebSocketUpgrade,
    address: ClientAddress,
    right: Right,
    shared: Arc<Shared>,
    latest: LatestMessages,
) -> Response {
    let permit = match shared.clients.acquire(address.0) {
        Ok(permit) => permit,
        Err(error) => return (StatusCode::SERVICE_UNAVAILABLE, error.to_string()).into_response(),
    };
    // Without a write buffer: a slow client must skip snapshots instead of getting old ones later.
    let upgrade = upgrade
        .max_message_size(MESSAGE_BYTES_MAX)
        .max_frame_size(MESSAGE_BYTES_MAX)
        .write_buffer_size(0);
    upgrade.on_upgrade(async move |socket| {
        match right {
            Right::View => client::serve_viewer(socket, &shared, latest).await,
            Right::Play | Right::Configure => {
                client::serve_client(socket, right, &shared, latest).await;
            }
        }
        drop(permit);
    })
}
