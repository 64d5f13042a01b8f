//! The queue through which every listener sends cues to the show. In: cues and tempo messages. Out:
//! the same, with the time of arrival if the delay is measured. Thread: listeners push, the show
//! thread pops. Real-time: neither side waits. Allocates: only in `new`.

use std::sync::Arc;
use std::time::Instant;

use crossbeam::queue::ArrayQueue;

use super::last_messages::LastMessages;
use super::show_clock::ShowClock;
use super::waker::Waker;
use corybant_core::cue::Cue;
use corybant_core::fault::{Fault, Faults};
use corybant_core::tempo::source::{TempoMessage, TimestampedMessage};
use corybant_core::timecode::Reading;

/// Capacity of the queue of timecode: more than arrives between two ticks.
const TIMECODE_MAX: usize = 64;

/// A cue in the cue queue, with its arrival time if the program measures how long the show takes to
/// process it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedCue {
    /// The cue or tempo message that the show must process.
    pub cue: Cue,
    /// Time at which the listener received the cue; `None` if the time from the arrival until the
    /// cue is processed is not measured.
    pub received: Option<Instant>,
}

/// A bounded queue of cues and tempo messages for the show. A new cue wakes the show thread; a
/// tempo message waits for the next tick. If the queue is full, a new entry is dropped and counted
/// as [`Fault::CueDropped`]. Clones share the queue.
#[derive(Clone)]
pub struct CueQueue {
    queue: Arc<ArrayQueue<TimedCue>>,
    /// Readings of timecode, which a new one replaces if the queue is full.
    timecode: Arc<ArrayQueue<Reading>>,
    clock: ShowClock,
    faults: Arc<Faults>,
    last_messages: Arc<LastMessages>,
    show_thread: Waker,
}

impl CueQueue {
    /// Creates an empty queue for at most `capacity` cues; dropped cues are counted in `faults`.
    pub fn new(capacity: usize, faults: Arc<Faults>) -> Self {
        let queue = Arc::new(ArrayQueue::new(capacity));
        Self {
            queue,
            timecode: Arc::new(ArrayQueue::new(TIMECODE_MAX)),
            clock: ShowClock::default(),
            faults,
            last_messages: Arc::default(),
            show_thread: Waker::default(),
        }
    }

    /// Sends `cue` to the show and wakes the show thread.
    pub fn push(&self, cue: Cue) {
        self.push_and_wake(TimedCue {
            cue,
            received: None,
        });
    }

    /// Sends `cue` to the show and wakes the show thread. `received` is the arrival time of the
    /// cue, from which the show measures the time until the cue is processed.
    pub fn push_received(&self, cue: Cue, received: Instant) {
        self.push_and_wake(TimedCue {
            cue,
            received: Some(received),
        });
    }

    fn push_and_wake(&self, cue: TimedCue) {
        self.push_quietly(cue);
        self.show_thread.wake();
    }

    fn push_quietly(&self, cue: TimedCue) {
        if self.queue.push(cue).is_err() {
            self.faults.count(Fault::CueDropped);
        }
    }

    /// Sends a message of a tempo source to the show, with the current time as its time. Before the
    /// start of the show, the message is dropped.
    pub fn send_tempo(&self, message: TempoMessage) {
        self.send_tempo_at(Instant::now(), message);
    }

    /// Sends a message of a tempo source to the show, with the time `moment`. Before the start of
    /// the show, the message is dropped.
    pub fn send_tempo_at(&self, moment: Instant, message: TempoMessage) {
        if let Some(at) = self.clock.at(moment) {
            // The tempo message carries its own time, so it can wait for the next regular tick.
            self.push_quietly(TimedCue {
                cue: Cue::TempoMessage(TimestampedMessage { at, message }),
                received: None,
            });
        }
    }

    /// Sends a reading of timecode to the show. If too many wait, the oldest one is dropped.
    pub fn send_timecode(&self, reading: Reading) {
        self.timecode.force_push(reading);
    }

    /// Removes and returns the oldest reading of timecode; `None` if none waits.
    pub fn pop_timecode(&self) -> Option<Reading> {
        self.timecode.pop()
    }

    /// Returns the clock of the show, which runs from the start of the show on.
    pub fn clock(&self) -> &ShowClock {
        &self.clock
    }

    /// Returns the storage of the OSC and MIDI messages that the listeners received last, including
    /// messages that are not cues.
    pub fn last_messages(&self) -> &Arc<LastMessages> {
        &self.last_messages
    }

    /// Removes and returns the oldest cue; `None` if no cue waits.
    pub fn pop(&self) -> Option<Cue> {
        self.pop_timed().map(|timed| timed.cue)
    }

    /// Removes and returns the oldest cue with its arrival time; `None` if no cue waits.
    pub fn pop_timed(&self) -> Option<TimedCue> {
        self.queue.pop()
    }

    /// Returns true if no cue waits in the queue.
    pub fn is_empty(&self) -> bool {
        self.queue.is_empty()
    }

    /// Registers the current thread as the show thread; from now on, each new cue wakes this
    /// thread.
    pub fn wake_me(&self) {
        self.show_thread.wake_me();
    }
}
