//! Faults: what can go wrong during a show. Faults are counted instead of returned.
//!
//! | fault | reaction of the show |
//! |---|---|
//! | `AudioOverrun` | drops the newest samples; the beat tracker continues |
//! | `AudioLost` | dances on at the last tempo, warns, and tries to open the device again |
//! | `TempoLost` | continues at the last tempo until the source is back or another is selected |
//! | `BadOsc`, `BadMidi`, `BadPage` | ignores the message |
//! | `BadTimecode` | ignores the packet or the frame; the cue list goes on |
//! | `UnknownLabel` | ignores the cue |
//! | `CueDropped` | dances on without the cue: the queue was full or the label out of reach |
//! | `LateTick` | skips to the next deadline and never catches up by a burst |
//! | `SendFailed` | loses that datagram and sends the next one as usual |
//! | `PlanUnproven` | takes the best path that A* found; a better one may exist |
//! | `PlanFellBack` | takes any motion that can follow, because the search found no path |
//! | `RecordingBroken` | ends the recording with a message and dances on |
//!
//! In: faults of all threads.
//! Out: a count per kind.
//! Thread: any; real-time safe (relaxed atomics only).
//! Allocates: never.

use std::sync::atomic::{AtomicU64, Ordering};

macro_rules! faults {
    ($($(#[$doc:meta])* $fault:ident = $name:literal,)*) => {
        /// A kind of fault that a show counts. A fault is an error after which the show goes on.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Fault { $($(#[$doc])* $fault,)* }

        impl Fault {
            /// All kinds of faults, in the order of their counters in [`Faults`].
            pub const ALL: &[Fault] = &[$(Fault::$fault,)*];

            /// Returns the name of this kind of fault, in the plural, for logs and status displays.
            pub fn name(self) -> &'static str {
                match self { $(Fault::$fault => $name,)* }
            }
        }
    };
}

faults! {
    /// The ring buffer between the audio callback and the show was full, so samples were dropped.
    AudioOverrun = "audio overruns",
    /// The audio device reported an error or delivered no more samples.
    AudioLost = "audio device losses",
    /// The tempo source of the show, such as a MIDI clock, stopped sending messages without a stop
    /// message.
    TempoLost = "tempo sources lost",
    /// An OSC datagram or message was malformed, or its address or argument was not accepted.
    BadOsc = "bad OSC messages",
    /// MIDI bytes were malformed.
    BadMidi = "bad MIDI messages",
    /// A message from a web page was malformed, or had a value outside its range.
    BadPage = "bad page messages",
    /// A packet or frame of timecode was malformed, or a single frame was far from the others.
    BadTimecode = "bad timecode",
    /// A cue named a label that no clip of the motion graph has.
    UnknownLabel = "cues for unknown labels",
    /// A cue was dropped: the cue queue was full, too many cues were waiting, or the label could
    /// not be reached in time.
    CueDropped = "cues dropped",
    /// A tick (one step of the show thread) began after the deadline of the next tick.
    LateTick = "late ticks",
    /// A datagram or a MIDI message could not be sent.
    SendFailed = "failed sends",
    /// The planner chose a path for the dance that is perhaps not the cheapest. The motion graph is
    /// too large for dynamic programming, and the A* search stopped at its limit or used lower
    /// bounds of the cost that were computed for another tempo or energy.
    PlanUnproven = "plans not proven best",
    /// The search for a path of the dance found none, so the planner chose any motion that can
    /// follow the current one.
    PlanFellBack = "plans that fell back",
    /// A recording of the show ended early because its disk was full or too slow.
    RecordingBroken = "recordings broken off",
}

const KINDS: usize = Fault::ALL.len();

/// Counters of faults, one for each kind of fault. Threads share the counters behind an `Arc`.
#[derive(Debug, Default)]
pub struct Faults {
    counts: [AtomicU64; KINDS],
}

impl Faults {
    /// Adds 1 to the count of `fault`.
    pub fn count(&self, fault: Fault) {
        self.add(fault, 1);
    }

    /// Adds `n` to the count of `fault`.
    pub fn add(&self, fault: Fault, n: u64) {
        self.counts[fault as usize].fetch_add(n, Ordering::Relaxed);
    }

    /// Returns how often `fault` was counted since these counters were created.
    pub fn of(&self, fault: Fault) -> u64 {
        self.counts[fault as usize].load(Ordering::Relaxed)
    }
}
