//! What a motion input has received so far. In: calls of its thread. Out: copies for the vitals.
//! Thread: "motion-in" and main; the lock is held for a copy only. Allocates: nothing.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// What a motion input has received since its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Received {
    /// Number of poses.
    pub(crate) poses: u64,
    /// Number of datagrams and messages that were ignored.
    pub(crate) faults: u64,
    /// Time of the last pose; `None` before the first one.
    pub(crate) last_pose: Option<Instant>,
    /// Program that sends, or the last one that has sent; `None` if there was none.
    pub(crate) sender: Option<SocketAddr>,
}

/// Counter of what a motion input receives. Clones share the numbers.
#[derive(Clone, Debug, Default)]
pub(crate) struct MotionCounter(Arc<Mutex<Received>>);

impl MotionCounter {
    /// Returns what was received so far.
    pub(crate) fn received(&self) -> Received {
        *self.lock()
    }

    /// Counts a pose that arrived at the time `now`.
    pub(super) fn count_pose(&self, now: Instant) {
        let mut received = self.lock();
        received.poses += 1;
        received.last_pose = Some(now);
    }

    /// Stores the number of faults since the start, and the program that sends.
    pub(super) fn set(&self, faults: u64, sender: Option<SocketAddr>) {
        let mut received = self.lock();
        received.faults = faults;
        received.sender = sender.or(received.sender);
    }

    fn lock(&self) -> MutexGuard<'_, Received> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
