//! Starts of music after silence. In: whether there is sound, and whether there are beats to dance
//! to. Out: the time at which the sound began. Thread: show. Allocates: never.

use crate::dsp::level::RECENT_S;
use crate::time::Seconds;

/// Least silence before a start, in seconds.
const SILENCE_S: f64 = 2.0;
/// Longest time from the start of the sound to the first tracked beats, in seconds. A sound that had
/// no beats for longer was not the start of this music: somebody has spoken, for example.
const FOUND_WITHIN_S: f64 = 8.0;

/// Watches for music that starts after silence.
#[derive(Clone, Debug)]
pub(super) struct OnsetWatch {
    /// Time at which the sound ended; `None` while there is sound. Before the show there was silence
    /// for ever.
    quiet_since: Option<f64>,
    /// Time at which the present sound began, if there was silence before and no beats were found
    /// yet.
    began: Option<f64>,
    was_heard: bool,
}

impl Default for OnsetWatch {
    fn default() -> Self {
        Self {
            quiet_since: Some(f64::NEG_INFINITY),
            began: None,
            was_heard: false,
        }
    }
}

impl OnsetWatch {
    /// Advances to the show time `now`. `is_sounding` is true while there is sound, and about one
    /// second after it; `is_heard` is true while there are beats to dance to. Returns the time at
    /// which the music began if its beats have just been found, and there was silence before it.
    pub(super) fn tick(
        &mut self,
        now: Seconds,
        is_sounding: bool,
        is_heard: bool,
    ) -> Option<Seconds> {
        match (self.quiet_since, is_sounding) {
            (Some(since), true) => {
                if now.0 - since >= SILENCE_S - RECENT_S {
                    self.began = Some(now.0);
                }
                self.quiet_since = None;
            }
            (None, false) => self.quiet_since = Some(now.0),
            (Some(_), false) | (None, true) => {}
        }
        let is_found = is_heard && !std::mem::replace(&mut self.was_heard, is_heard);
        // Beats of the music before may go on for some seconds into the silence.
        let is_new = is_found || is_heard && self.quiet_since.is_none();
        if !is_new {
            return None;
        }
        let began = self.began.take()?;
        let is_old = now.0 - began > FOUND_WITHIN_S;
        Some(Seconds(if is_old { now.0 } else { began }))
    }

    /// Returns true while it has been silent for so long that the next sound starts a song.
    pub(super) fn is_silent(&self, now: Seconds) -> bool {
        self.quiet_since
            .is_some_and(|since| now.0 - since >= SILENCE_S - RECENT_S)
    }
}
