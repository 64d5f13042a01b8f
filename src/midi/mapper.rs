//! Converts the MIDI messages of one device to cues, by a map that can be replaced during the show.
//!
//! In: messages of one port; new maps. Out: cues, into the show's queue, each with the time of its
//! arrival; requests for takes; during a learn session the moved controls instead. Thread: a backend's own. Real-time:
//! yes, after `new`.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crossbeam::queue::ArrayQueue;

use super::CueQueue;
use crate::rt::waker::Waker;
use corybant_core::cue::CueNames;
use corybant_core::cue::midi::{ControlChange, MapEntry, MapError, MidiMap, MidiRequest, message};
use corybant_core::cue::take::TakeRequest;
use corybant_core::fault::{Fault, Faults};

/// Capacity of the queue of controls that are moved during a learn session.
const MOVED_MAX: usize = 64;
/// Capacity of the queue of requests for takes.
const TAKES_MAX: usize = 16;

/// Queues through which a mapper's map from controls to actions is replaced. New maps go through
/// `fresh` to the thread that receives MIDI messages. Replaced maps return through `old` to the
/// thread that sets new maps, which frees them.
#[derive(Debug)]
struct Swap {
    fresh: ArrayQueue<MidiMap>,
    old: ArrayQueue<MidiMap>,
}

/// Queue of the requests for takes that the controls of all MIDI mappers send. Clones share it.
#[derive(Clone, Debug)]
pub(super) struct TakeButtons {
    requests: Arc<ArrayQueue<Arc<TakeRequest>>>,
    waker: Waker,
}

impl TakeButtons {
    /// Creates an empty queue. A request wakes the thread of `waker`, which calls
    /// [`TakeButtons::pop`].
    pub(super) fn new(waker: Waker) -> Self {
        Self {
            requests: Arc::new(ArrayQueue::new(TAKES_MAX)),
            waker,
        }
    }

    /// Removes and returns the request that has waited longest; `None` if there is none.
    pub(super) fn pop(&self) -> Option<Arc<TakeRequest>> {
        self.requests.pop()
    }

    /// Adds `request`. The map of the mapper has the same request, so that dropping `request` frees
    /// no memory here.
    fn push(&self, request: Arc<TakeRequest>) {
        // If the queue is full, nobody has read it for so long that a further request has no use.
        let _ = self.requests.push(request);
        self.waker.wake();
    }
}

/// A control that the user moved during a learn session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Moved {
    /// Index of the controller to which the moved control belongs.
    pub(super) controller: usize,
    pub(super) change: ControlChange,
}

/// The state of learning that MIDI mappers share: whether a learn session is in progress, and the
/// queue of the controls that were moved during it.
#[derive(Debug)]
pub(super) struct LearnSession {
    on: AtomicBool,
    moved: ArrayQueue<Moved>,
    waker: Waker,
}

impl LearnSession {
    /// Creates the state without a learn session in progress. When a control is moved, `waker`
    /// wakes the thread that calls [`LearnSession::moved`].
    pub(super) fn new(waker: Waker) -> Self {
        Self {
            on: AtomicBool::new(false),
            moved: ArrayQueue::new(MOVED_MAX),
            waker,
        }
    }

    /// Begins the learn session if `on` is true, otherwise ends it. The queue of moved controls is
    /// emptied.
    pub(super) fn set(&self, on: bool) {
        while self.moved.pop().is_some() {}
        self.on.store(on, Ordering::Release);
    }

    /// Removes and returns the moved control that has waited longest in the queue; `None` if the
    /// queue is empty.
    pub(super) fn moved(&self) -> Option<Moved> {
        self.moved.pop()
    }
}

/// Converts the MIDI messages of one controller to cues, by a map from controls (pads, keys, knobs)
/// to actions. Of a mapper and its clones, only one may process messages at a time. It also gets a
/// map that is set on one of the others.
#[derive(Clone)]
pub struct MidiMapper {
    map: MidiMap,
    swap: Arc<Swap>,
    queue: CueQueue,
    faults: Arc<Faults>,
    /// Index of this mapper's controller, and the learn session that gets the moved controls.
    /// `None` if the controls of this mapper cannot be learnt.
    learning: Option<(usize, Arc<LearnSession>)>,
    /// Queue of requests for takes; `None` if the controls of this mapper send none.
    takes: Option<TakeButtons>,
}

impl MidiMapper {
    /// Creates a mapper with the map entries `map`. `names` are the labels and scenes of the show.
    /// Cues go to `queue`.
    ///
    /// # Errors
    /// `MapError` if an entry of the map is invalid.
    pub fn new<'a>(
        map: &[MapEntry],
        names: impl Into<CueNames<'a>>,
        queue: CueQueue,
        faults: Arc<Faults>,
    ) -> Result<Self, MapError> {
        let swap = Arc::new(Swap {
            fresh: ArrayQueue::new(1),
            old: ArrayQueue::new(4),
        });
        Ok(Self {
            map: MidiMap::new(map, names)?,
            swap,
            queue,
            faults,
            learning: None,
            takes: None,
        })
    }

    /// Returns this mapper, changed so that its requests for takes go to `takes`.
    pub(super) fn with_takes(self, takes: &TakeButtons) -> Self {
        Self {
            takes: Some(takes.clone()),
            ..self
        }
    }

    /// Returns this mapper, changed so that its moved controls are reported to the learn session
    /// `session`. `controller` is the index of the mapper's controller.
    pub(super) fn learning(self, controller: usize, session: &Arc<LearnSession>) -> Self {
        Self {
            learning: Some((controller, session.clone())),
            ..self
        }
    }

    /// Replaces the map from controls to actions in this mapper, and also in the clone of this
    /// mapper that processes messages.
    pub(super) fn set_map(&mut self, map: MidiMap) {
        while self.swap.old.pop().is_some() {}
        self.swap.fresh.force_push(map.clone());
        self.map = map;
    }

    fn take_fresh_map(&mut self) {
        if let Some(fresh) = self.swap.fresh.pop() {
            let old = std::mem::replace(&mut self.map, fresh);
            // `set_map` empties this queue before each change, so that it has room.
            let _ = self.swap.old.push(old);
        }
    }

    /// Converts one MIDI message to cues and sends them to the show. During a learn session,
    /// reports the moved control instead. The message must begin with its status byte (no running
    /// status); an invalid message counts as [`Fault::BadMidi`].
    pub fn process(&mut self, bytes: &[u8]) {
        let arrived = Instant::now();
        self.take_fresh_map();
        self.queue.last_messages().midi(bytes);
        let change = match message::parse(bytes).map(ControlChange::of) {
            Ok(Some(change)) => change,
            Ok(None) => return,
            Err(_) => return self.faults.count(Fault::BadMidi),
        };
        if let Some((controller, session)) = self
            .learning
            .as_ref()
            .filter(|(_, session)| session.on.load(Ordering::Acquire))
        {
            let moved = Moved {
                controller: *controller,
                change,
            };
            // If the queue is full, it already holds more controls than a learn session needs.
            let _ = session.moved.push(moved);
            return session.waker.wake();
        }
        let Self {
            map, queue, takes, ..
        } = self;
        map.apply(change, &mut |request| match request {
            MidiRequest::Cue(cue) => queue.push_received(cue, arrived),
            MidiRequest::Take(request) => {
                if let Some(takes) = takes {
                    takes.push(request);
                }
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use corybant_core::cue::midi::Control;
    use corybant_core::cue::{Cue, Launch};

    fn entry(note: u8, label: &str) -> MapEntry {
        MapEntry {
            label: label.into(),
            ..MapEntry::default()
        }
        .of(Control::Note(note), None)
    }

    fn labels() -> [String; 3] {
        ["Salsa", "Hip Hop", "hip/hop"].map(String::from)
    }

    fn mapper(map: &[MapEntry]) -> (MidiMapper, CueQueue, Arc<Faults>) {
        let faults = Arc::new(Faults::default());
        let queue = CueQueue::new(16, faults.clone());
        let mapper = MidiMapper::new(map, &labels(), queue.clone(), faults.clone()).unwrap();
        (mapper, queue, faults)
    }

    fn cues(queue: &CueQueue) -> Vec<Cue> {
        std::iter::from_fn(|| queue.pop()).collect()
    }

    #[test]
    fn cues_are_sent_and_damaged_messages_are_counted() {
        let (mut mapper, queue, faults) = mapper(&[entry(36, "Salsa")]);
        mapper.process(&[0x90, 36, 127]);
        mapper.process(&[0xf8]);
        assert_eq!(cues(&queue), [Cue::from(Launch::plain(0))]);
        assert_eq!(faults.of(Fault::BadMidi), 0);
        mapper.process(&[36, 127]);
        mapper.process(&[]);
        assert_eq!((faults.of(Fault::BadMidi), cues(&queue).len()), (2, 0));
    }

    #[test]
    fn a_control_that_records_sends_requests_for_takes() {
        let record = MapEntry {
            record: true,
            ..entry(36, "mine")
        };
        let (mapper, queue, _) = mapper(&[record]);
        let takes = TakeButtons::new(Waker::default());
        let mut mapper = mapper.with_takes(&takes);
        for _ in 0..TAKES_MAX + 1 {
            mapper.process(&[0x90, 36, 127]);
            mapper.process(&[0x80, 36, 0]);
        }
        let requests: Vec<_> = std::iter::from_fn(|| takes.pop()).collect();
        assert_eq!(requests.len(), TAKES_MAX);
        let toggle = TakeRequest::toggle("mine", None).unwrap();
        assert!(requests.iter().all(|request| **request == toggle));
        assert!(cues(&queue).is_empty());
    }

    #[test]
    fn every_clone_uses_a_new_map_and_a_learn_session_receives_controls_instead() {
        let (mut mapper, queue, _) = mapper(&[entry(36, "Salsa")]);
        let session = Arc::new(LearnSession::new(Waker::default()));
        mapper = mapper.learning(3, &session);
        let mut playing = mapper.clone();
        for label in [1, 2, 1] {
            mapper.set_map(MidiMap::new(&[entry(36, &labels()[label])], &labels()).unwrap());
            playing.process(&[0x90, 36, 1]);
            assert_eq!(cues(&queue), [Cue::from(Launch::plain(label as u16))]);
        }
        session.set(true);
        playing.process(&[0x91, 40, 7]);
        playing.process(&[0xf8]);
        assert_eq!(
            session.moved(),
            Some(Moved {
                controller: 3,
                change: ControlChange {
                    control: Control::Note(40),
                    channel: 2,
                    value: 7
                }
            })
        );
        assert_eq!((session.moved(), cues(&queue)), (None, vec![]));
        session.set(false);
        playing.process(&[0x90, 36, 1]);
        assert_eq!((session.moved(), cues(&queue).len()), (None, 1));
    }
}
