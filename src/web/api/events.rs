//! The events of a show as server-sent events: `state` at a chosen rate, `beat` at each beat, and
//! `names` when labels or clips have changed. In: the latest status. Out: a response that ends with the show. Thread: the page's, a task for each
//! client.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::Extension;
use axum::extract::State;
use axum::http::{StatusCode, Uri};
use axum::response::sse::{Event, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use serde_json::json;
use tokio::sync::watch;
use tokio::time::{Instant, Interval, MissedTickBehavior, interval};

use super::{Api, refusal};
use crate::web::about::Served;
use crate::web::http::ClientAddress;
use crate::web::http::websockets::WebSocketPermit;

/// Time between two looks at the status: an event is at most this late.
const LOOK: Duration = Duration::from_millis(20);
/// Default number of states per second.
const HZ: f64 = 5.0;
/// Smallest and largest number of states per second.
const HZ_ALLOWED: std::ops::RangeInclusive<f64> = 0.5..=30.0;

/// A client of the events.
struct Listener {
    api: Arc<Api>,
    /// Receiver of changed names.
    about: watch::Receiver<Served>,
    looks: Interval,
    /// Time between two states, and the time of the next one.
    every: Duration,
    due: Instant,
    /// Number of the last beat that was told.
    beat: Option<i64>,
    _permit: WebSocketPermit,
}

/// Responds with the events of the show until it ends.
pub(super) async fn events(
    State(api): State<Arc<Api>>,
    Extension(ClientAddress(address)): Extension<ClientAddress>,
    uri: Uri,
) -> Response {
    let mut query = uri.query().unwrap_or("").split('&');
    let text = query.find_map(|pair| pair.strip_prefix("hz="));
    let hz = text.map_or(Some(HZ), |text| text.parse().ok());
    let Some(hz) = hz.filter(|hz| HZ_ALLOWED.contains(hz)) else {
        let why = "hz is not a number from 0.5 to 30";
        return refusal(StatusCode::UNPROCESSABLE_ENTITY, why);
    };
    let permit = match api.shared.clients.acquire(address) {
        Ok(permit) => permit,
        Err(error) => return refusal(StatusCode::SERVICE_UNAVAILABLE, &error.to_string()),
    };
    let mut looks = interval(LOOK);
    looks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let listener = Listener {
        about: api.shared.about.clone(),
        api,
        looks,
        every: Duration::from_secs_f64(1.0 / hz),
        due: Instant::now(),
        beat: None,
        _permit: permit,
    };
    let events = stream::unfold(listener, |mut listener| async {
        let event = listener.next().await?;
        Some((Ok::<_, Infallible>(event), listener))
    });
    Sse::new(events).into_response()
}

impl Listener {
    /// Waits for the next event; `None` when the show has ended.
    async fn next(&mut self) -> Option<Event> {
        loop {
            self.looks.tick().await;
            // The show has ended when the sender of its status is gone.
            self.api.status.has_changed().ok()?;
            if self
                .about
                .has_changed()
                .is_ok_and(|has_changed| has_changed)
            {
                let names = Arc::clone(&self.about.borrow_and_update().names);
                let names = json!({ "labels": names.labels, "clips": names.clips });
                return Some(Event::default().event("names").data(names.to_string()));
            }
            let status = *self.api.status.borrow();
            let beat = status.beat.floor() as i64;
            if status.music && self.beat.replace(beat).is_some_and(|last| last != beat) {
                let beat = json!({
                    "beat": beat, "bar": status.bar_position,
                    "beats_per_bar": status.beats_per_bar, "bpm": status.bpm,
                });
                return Some(Event::default().event("beat").data(beat.to_string()));
            }
            let now = Instant::now();
            if now >= self.due {
                self.due = (self.due + self.every).max(now);
                let state = self.api.state(&status).to_string();
                return Some(Event::default().event("state").data(state));
            }
        }
    }
}
