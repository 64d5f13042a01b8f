//! Events of a show for the log. In: the show. Out: plain `Copy` values, and their texts. Thread:
//! any.

use std::collections::VecDeque;

use smpte_timecode::Timecode;

use crate::cue::CueNames;
use crate::cue::scene::SceneId;
use crate::cue::set::SetEvent;
use crate::graph::{Attribute, LabelId};
use crate::tempo::source::TempoSource;
use crate::timecode::{TimecodeEvent, rate_name};

/// The greatest number of unread events that are stored. A further event replaces the oldest one.
const WAITING_MAX: usize = 64;

/// A change or problem during a show, for the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Music to which the dancers can dance has started.
    MusicFound,
    /// The music has ended; the dancers change to idle.
    MusicLost,
    /// The performer has selected the given tempo source, and the show uses that source now.
    Source(TempoSource),
    /// The performer has requested the given tempo source, but the show file does not enable that
    /// source. The show keeps its previous source.
    SourceMissing(TempoSource),
    /// The selected tempo source, which is given here, has started to send messages, or sends
    /// messages again.
    SourceAlive(TempoSource),
    /// The selected tempo source, which is given here, has stopped its playback (MIDI stop
    /// message).
    SourceStopped(TempoSource),
    /// The selected tempo source, which is given here, no longer sends messages. The beats continue
    /// at the last tempo.
    SourceLost(TempoSource),
    /// The tempo was frozen (true: the show ignores the tempo source) or released (false: the tempo
    /// follows the source again).
    Frozen(bool),
    /// The timecode that a show follows was found, has gone elsewhere or was lost.
    Timecode(TimecodeEvent),
    /// The scene with this number has begun.
    Scene(SceneId),
    /// The set list has changed its song or its state.
    Set(SetEvent),
    /// A dancer changes to motion with another attribute (a label, idle or unlabelled).
    Dancing {
        /// Number of the dancer, counted from 0.
        dancer: usize,
        /// Number of the first beat of the new motion.
        beat: i64,
        /// The new attribute; a label in it is given as a pad number.
        attribute: Attribute,
    },
    /// A dancer changes to a new motion graph.
    NewGraph {
        /// Number of the dancer, counted from 0.
        dancer: usize,
        /// Number of the first beat that is danced on the new graph.
        beat: i64,
    },
    /// A cue was dropped because the dancer could not reach its label in time, because too many
    /// cues were stored, or because the new motion graph of the dancer lacks the label.
    CueDropped {
        /// Number of the dancer, counted from 0.
        dancer: usize,
        /// The number of the pad (button of a label) whose cue was dropped.
        label: LabelId,
    },
}

impl Event {
    /// Returns true if the event is a problem: the performer requested a tempo source that is not
    /// enabled, or the selected source or timecode was lost.
    pub fn is_warning(&self) -> bool {
        let timecode_lost = |event: &TimecodeEvent| matches!(event, TimecodeEvent::Lost(_));
        match self {
            Event::SourceMissing(_) | Event::SourceLost(_) => true,
            Event::Timecode(event) => timecode_lost(event),
            _ => false,
        }
    }

    /// Returns a sentence about the event for the log. `names` are the pads and the scenes,
    /// `dancers` the names of all dancers. The name of the dancer is included only if there are
    /// several dancers.
    pub fn describe<'a>(&self, names: impl Into<CueNames<'a>>, dancers: &[String]) -> String {
        let names = names.into();
        let in_list = |list: &'a [String], number: u16| {
            list.get(usize::from(number)).map_or("", String::as_str)
        };
        let name = |label: LabelId| in_list(names.labels, label);
        let who = |dancer: usize| {
            dancers
                .get(dancer)
                .filter(|_| dancers.len() > 1)
                .map_or(String::new(), |name| format!("{name}: "))
        };
        match *self {
            Event::MusicFound => "music found".into(),
            Event::MusicLost => "no music: settling into idle".into(),
            Event::Source(source) => format!("tempo source: {}", source.name()),
            Event::SourceMissing(source) => {
                format!(
                    "tempo source {} asked for, but the show file does not open it: see [tempo] link and midi_clock",
                    source.name()
                )
            }
            Event::SourceAlive(source) => format!("tempo source {} leads", source.name()),
            Event::SourceStopped(source) => format!("tempo source {} has stopped", source.name()),
            Event::SourceLost(source) => format!(
                "tempo source {} lost: the last tempo goes on",
                source.name()
            ),
            Event::Frozen(true) => "tempo frozen: the beat goes on as it is".into(),
            Event::Frozen(false) => "tempo follows its source again".into(),
            Event::Timecode(event) => timecode(event),
            Event::Scene(scene) => format!("scene {} begins", in_list(names.scenes, scene)),
            Event::Set(event) => set(event),
            Event::Dancing {
                dancer,
                beat,
                attribute,
            } => {
                let what = match attribute {
                    Attribute::Label(label) => name(label),
                    Attribute::None => "groove",
                    Attribute::Idle => "idle",
                };
                format!("{}from beat {beat}: {what}", who(dancer))
            }
            Event::NewGraph { dancer, beat } => {
                format!("{}from beat {beat}: on the new motion graph", who(dancer))
            }
            Event::CueDropped { dancer, label } => {
                format!(
                    "{}cue {} dropped: out of reach within 8 beats, or too many cues",
                    who(dancer),
                    name(label)
                )
            }
        }
    }
}

/// Returns a sentence about a change of the timecode source.
fn timecode(event: TimecodeEvent) -> String {
    let at = |frame: Option<Timecode>| {
        frame.map_or(String::new(), |frame| {
            format!(" at {frame}, {} frames a second", rate_name(frame.rate()))
        })
    };
    match event {
        TimecodeEvent::Locked(frame) => format!("timecode found{}", at(frame)),
        TimecodeEvent::Located(frame) => format!("timecode jumped: now{}", at(frame)),
        TimecodeEvent::Lost(frame) => {
            format!(
                "timecode lost{}: the cue list waits, the dance goes on",
                at(frame)
            )
        }
        TimecodeEvent::Engaged(true) => "timecode leads the cue list".into(),
        TimecodeEvent::Engaged(false) => "timecode disengaged: the cue list waits".into(),
    }
}

/// Returns a sentence about a change of the set list.
fn set(event: SetEvent) -> String {
    match event {
        SetEvent::Started(song) => format!("song {song} begins"),
        SetEvent::Waiting(song) => format!("song {song} waits for its bar"),
        SetEvent::Dropped(song) => format!("song {song} no longer waits"),
        SetEvent::AtEnd(song) => format!("GO without a next song: song {song} is the last"),
        SetEvent::NoSong => "a command names a song that is not in the set list".into(),
        SetEvent::Held(true) => "the cue list of the song is held; the dance goes on".into(),
        SetEvent::Held(false) => "the cue list of the song goes on".into(),
    }
}

/// The unread events of a show, the oldest first.
pub(super) struct Events {
    waiting: VecDeque<Event>,
}

impl Events {
    /// Creates an empty list of events with memory for `WAITING_MAX` events.
    pub(super) fn new() -> Self {
        Self {
            waiting: VecDeque::with_capacity(WAITING_MAX),
        }
    }

    /// Adds an event; if `WAITING_MAX` events are unread, removes the oldest one first.
    pub(super) fn push(&mut self, event: Event) {
        if self.waiting.len() == WAITING_MAX {
            self.waiting.pop_front();
        }
        self.waiting.push_back(event);
    }

    /// Removes and returns the oldest unread event; `None` if there is no unread event.
    pub(super) fn next(&mut self) -> Option<Event> {
        self.waiting.pop_front()
    }
}
