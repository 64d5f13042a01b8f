//! One song of a set list. In: settings. Out: plain values. Thread: any. Allocates: only in `new`.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::TitleKey;
use crate::cue::launch::{Quantise, UnknownWord};
use crate::cue::list::CueList;
use crate::cue::list::lead::SongBeats;
use crate::cue::scene::SceneId;
use crate::time::Bpm;
use crate::timecode::settings::Offset;

/// What starts a song by itself. A performer can start every song.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Start {
    /// Go: nothing; a performer starts the song.
    #[default]
    Go,
    /// Music: music that begins after at least two seconds of silence, if the song is the next one.
    Music,
    /// Timecode: timecode that reaches the place of the song.
    Timecode,
}

impl FromStr for Start {
    type Err = UnknownWord;

    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        match word {
            "go" => Ok(Self::Go),
            "music" => Ok(Self::Music),
            "timecode" => Ok(Self::Timecode),
            _ => Err(UnknownWord {
                word: word.into(),
                allowed: "go, music and timecode",
            }),
        }
    }
}

/// The place of a song in the time of a timecode source.
#[derive(Clone, Debug, PartialEq)]
pub struct LedPlace {
    /// The timecode at which the song begins.
    pub offset: Offset,
    /// The beats of the song: steady, from its beginning on. Empty if its tempo is not known.
    pub beats: SongBeats,
}

/// One song of a set list.
#[derive(Clone, Debug)]
pub struct Song {
    /// The cue list; empty for a song without cues.
    pub cues: CueList,
    /// The tempo that the music probably has.
    pub bpm: Option<Bpm>,
    /// The scene that the song recalls when it starts.
    pub scene: Option<SceneId>,
    /// The beats on which a performer's command starts the song.
    pub quantise: Quantise,
    /// What starts the song by itself.
    pub start: Start,
    /// The place in timecode, if timecode starts the song.
    pub timecode: Option<LedPlace>,
    /// Number of the motion graph that the song needs; 0 is that of the show.
    pub graph: usize,
    /// The key of the title.
    pub key: TitleKey,
}

impl Song {
    /// Creates a song with the title `title` that a performer starts on the next bar.
    pub fn new(title: &str, cues: CueList) -> Self {
        Self {
            cues,
            bpm: None,
            scene: None,
            quantise: Quantise::Bar,
            start: Start::Go,
            timecode: None,
            graph: 0,
            key: TitleKey::of(title),
        }
    }

    /// Returns this song with the tempo `bpm`.
    #[must_use]
    pub fn with_tempo(self, bpm: Bpm) -> Self {
        Self {
            bpm: Some(bpm),
            ..self
        }
    }

    /// Returns this song, which begins at the timecode `offset` and is started by it. Its cues at
    /// beats count steady beats of its tempo from there on.
    #[must_use]
    pub fn at_timecode(self, offset: Offset) -> Self {
        let period = self.bpm.map(|bpm| bpm.period().0);
        let times: Vec<f64> = period.map_or(Vec::new(), |period| vec![0.0, period]);
        Self {
            start: Start::Timecode,
            cues: self.cues.timed(&times).in_order_of_time(),
            timecode: Some(LedPlace {
                offset,
                beats: SongBeats::new(times),
            }),
            ..self
        }
    }
}
