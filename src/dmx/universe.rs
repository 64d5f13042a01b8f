//! One universe of a DMX input. In: frames of its sources, the time. Out: cues into the show's
//! queue, counters, a warning while no source sends. Thread: "sacn" and "art-net"; main reads the
//! counters. The lock is held for one frame. Allocates: when a source appears or is lost.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use tracing::info;

use super::{DmxContext, DmxError, Settings};
use corybant_core::cue::CueNames;
use corybant_core::cue::dmx::{DmxPatch, Frame, Merge, Received};
use corybant_core::fault::Fault;
use corybant_core::text::one_line;
use corybant_core::time::Seconds;

/// Whether a source sends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum SourceState {
    /// No source has sent yet.
    #[default]
    Waiting,
    /// A source sends.
    Live,
    /// Sources have sent, but none sends now; their last levels stay.
    Lost,
}

/// What a universe has received since the start.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Number of packets that were merged.
    pub(crate) packets: u64,
    /// Number of packets that were ignored: malformed, late, or of one source too many.
    pub(crate) ignored: u64,
    /// Number of sources that were lost.
    pub(crate) lost: u64,
    /// Name of the source that appeared last, or its network address; `None` if none has appeared.
    pub(crate) source: Option<String>,
    /// Whether a source sends.
    pub(crate) state: SourceState,
}

/// The state of one universe.
pub(super) struct Universe {
    /// Path of the settings in the show file, the subject of the warning.
    key: String,
    /// The addresses at which levels arrive, in words.
    places: String,
    merge: Merge,
    patch: DmxPatch,
    counts: Counts,
    context: DmxContext,
    /// Time 0 of the sources.
    start: Instant,
}

/// A universe that several threads use. Clones share it.
#[derive(Clone)]
pub(super) struct SharedUniverse(Arc<Mutex<Universe>>);

impl SharedUniverse {
    pub(super) fn new(universe: Universe) -> Self {
        Self(Arc::new(Mutex::new(universe)))
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, Universe> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Universe {
    /// Creates the universe of the input with these `settings`, whose path in the show file is
    /// `key`.
    ///
    /// # Errors
    /// [`DmxError::Patch`] if the patch cannot be used.
    pub(super) fn new(
        key: &str,
        settings: &Settings,
        names: CueNames,
        context: &DmxContext,
    ) -> Result<Self, DmxError> {
        let patch = DmxPatch::new(&settings.patch, names);
        let universe = Self {
            key: key.into(),
            places: settings.places(),
            merge: Merge::new(Seconds(settings.protocol.lost_after_s())),
            patch: patch.map_err(|source| DmxError::Patch {
                key: key.into(),
                source,
            })?,
            counts: Counts::default(),
            context: context.clone(),
            start: Instant::now(),
        };
        universe.warn("no DMX arrives");
        Ok(universe)
    }

    /// Returns what was received so far.
    pub(super) fn counts(&self) -> Counts {
        self.counts.clone()
    }

    /// Counts a packet that was ignored.
    pub(super) fn count_ignored(&mut self) {
        self.counts.ignored += 1;
    }

    /// Merges a frame that arrived at the time `arrived`, and sends the cues of the channels that it
    /// changes. `address` returns the network address of a source without a name.
    pub(super) fn receive(
        &mut self,
        frame: &Frame,
        arrived: Instant,
        address: impl Fn() -> String,
    ) {
        let before = self.merge.sources();
        let now = self.seconds(arrived);
        if self.merge.receive(now, frame) == Received::Ignored {
            return self.count_ignored();
        }
        self.counts.packets += 1;
        match self.merge.sources() {
            after if after > before => self.add_source(frame, address),
            0 => self.end("the source has ended its stream"),
            _ => {}
        }
        let Self { patch, context, .. } = self;
        patch.update(self.merge.levels(), &mut |cue| {
            context.cues.push_received(cue, arrived);
        });
    }

    /// Removes the sources that are lost at the time `now`. Their last levels stay.
    pub(super) fn update(&mut self, now: Instant) {
        let seconds = self.seconds(now);
        let lost = self.merge.expire(seconds) as u64;
        if lost == 0 {
            return;
        }
        self.counts.lost += lost;
        self.context.faults.add(Fault::DmxLost, lost);
        if self.merge.sources() == 0 {
            self.end("the source no longer sends");
        }
        let Self { patch, context, .. } = self;
        patch.update(self.merge.levels(), &mut |cue| {
            context.cues.push_received(cue, now);
        });
    }

    fn add_source(&mut self, frame: &Frame, address: impl Fn() -> String) {
        let name = String::from_utf8_lossy(frame.name);
        let name = match name.trim() {
            "" => address(),
            name => one_line(name).into_owned(),
        };
        info!("{}: {name} sends DMX", self.key);
        self.counts.source = Some(name);
        self.counts.state = SourceState::Live;
        self.context.warnings.clear(&self.key);
    }

    fn end(&mut self, why: &str) {
        self.counts.state = SourceState::Lost;
        self.warn(&format!("{why}, so its last levels stay"));
    }

    fn warn(&self, why: &str) {
        self.context.warnings.set(
            &self.key,
            &format!("{why}; let the desk send its universe to {}", self.places),
        );
    }

    fn seconds(&self, moment: Instant) -> Seconds {
        Seconds(moment.duration_since(self.start).as_secs_f64())
    }
}

impl Drop for Universe {
    fn drop(&mut self) {
        self.context.warnings.clear(&self.key);
    }
}
