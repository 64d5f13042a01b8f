//! The link between those who request a take (a recording of a live performer) and the thread that
//! records it. In: requests; the state of the take. Out: the same on the other threads. Thread: any
//! except show and audio. Allocates.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

use serde::Serialize;
use tokio::sync::watch;

use crate::rt::waker::Waker;
use corybant_core::cue::take::TakeRequest;

/// Why a show records no takes.
pub const NO_TAKES: &str = "this show records no takes: it needs a show file with a [[motion_in]]";

/// How far a take is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TakePhase {
    /// There is no take.
    #[default]
    Idle,
    /// The first beat of the take has not come yet.
    CountIn,
    /// The performer is recorded.
    Recording,
    /// The take becomes a part of the motion graph.
    Building,
    /// The show dances with the take.
    Kept,
    /// The take, or the last request, failed.
    Failed,
}

/// The state of the take that is recorded, or of the last one.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TakeState {
    /// How far the take is.
    pub phase: TakePhase,
    /// Label of the take.
    pub label: String,
    /// First beat of the take, in beats of the music.
    pub first_beat: f64,
    /// Number of beats of the take; `None` if it stops on request.
    pub beats: Option<u32>,
    /// What was done or what went wrong, as a sentence; empty if there is nothing to say.
    pub message: String,
    /// Labels of the takes that can be undone, in the order in which they were recorded; the last
    /// one is undone first.
    pub takes: Vec<String>,
}

impl TakeState {
    /// Returns the state as a message to clients of the page: its fields, and `"type":"take"`.
    pub fn to_json(&self) -> String {
        #[derive(Serialize)]
        struct Message<'a> {
            #[serde(rename = "type")]
            kind: &'static str,
            #[serde(flatten)]
            state: &'a TakeState,
        }
        let kind = "take";
        serde_json::to_string(&Message { kind, state: self }).unwrap_or_default()
    }
}

/// Sender of requests for takes, and reader of the state of the take. Clones use the same recorder.
#[derive(Clone, Debug)]
pub struct TakeDesk {
    requests: Sender<TakeRequest>,
    state: watch::Receiver<TakeState>,
    wakers: Wakers,
}

/// Threads that are woken after a change of the state.
type Wakers = Arc<Mutex<Vec<Waker>>>;

/// The side of the thread that records takes.
#[derive(Debug)]
pub struct TakeInbox {
    /// The requests, in order.
    pub requests: Receiver<TakeRequest>,
    state: watch::Sender<TakeState>,
    wakers: Wakers,
}

/// Creates the link, and returns its two sides.
pub fn take_desk() -> (TakeDesk, TakeInbox) {
    let (sender, requests) = channel();
    let (state, receiver) = watch::channel(TakeState::default());
    let wakers = Wakers::default();
    let desk = TakeDesk {
        requests: sender,
        state: receiver,
        wakers: wakers.clone(),
    };
    let inbox = TakeInbox {
        requests,
        state,
        wakers,
    };
    (desk, inbox)
}

impl TakeInbox {
    /// Changes the state of the take by `change`, for all readers.
    pub fn update(&self, change: impl FnOnce(&mut TakeState)) {
        self.state.send_modify(change);
        let wakers = self.wakers.lock().unwrap_or_else(PoisonError::into_inner);
        wakers.iter().for_each(Waker::wake);
    }
}

impl TakeDesk {
    /// Sends `request` to the recorder.
    pub fn request(&self, request: TakeRequest) {
        // Without a recorder the show ends, and no take is possible.
        let _ = self.requests.send(request);
    }

    /// Wakes the thread of `waker` after each change of the state.
    pub fn wake_on_change(&self, waker: Waker) {
        let mut wakers = self.wakers.lock().unwrap_or_else(PoisonError::into_inner);
        wakers.push(waker);
    }

    /// Returns a receiver of the state of the take.
    pub fn state(&self) -> watch::Receiver<TakeState> {
        self.state.clone()
    }
}
