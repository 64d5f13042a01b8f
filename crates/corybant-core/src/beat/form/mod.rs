//! The form of the music: sections (intro, groove, build-up, drop, breakdown, outro) and phrases,
//! found while the music plays, and announced where it announces them.
//!
//! ```text
//! samples ─▶ sound of each beat ─▶ history ─▶ network ─▶ decision ─▶ Form
//! ```
//! In: samples (`sound`), the timeline of the beats. Out: [`Form`]. Thread: show. Allocates: never
//! after `new`.
//!
//! The unit of all decisions is the beat: a beat is processed once its sound is complete. A section
//! begins when the network foresees it for the next beat, or hears that it has begun in the last
//! beats. Dance music announces its sections by risers, drum rolls and fills, and by phrases of 4, 8
//! and 16 bars; the network knows both. K. Ullrich, J. Schlüter and T. Grill, "Boundary detection in
//! music structure analysis using convolutional neural networks" (ISMIR 2014), for the task; here
//! the network is recurrent and causal.

mod history;
mod network;
pub mod section;
mod sound;

use crate::time::{Bars, Beats, Seconds, Timeline};

use super::activation::net::error::NetError;
use history::{History, INPUTS};
use network::{Estimate, FormNetwork};
use section::{Form, SECTIONS, Section, SectionStart};
pub(crate) use sound::{BeatSound, FormSound};

/// Number of beats over which the network foresees the next section.
const BEATS_AHEAD: usize = 16;
/// Number of beats after its first one within which the network finds that a section has begun.
const BEATS_BACK: usize = 4;
/// Probability above which a section begins that was foreseen for the next beat, and above which
/// one has begun in the last beats.
const FORESEEN_MIN: f32 = 0.4;
const BEGUN_MIN: f32 = 0.5;
/// Probability above which the next section is announced.
const ANNOUNCED_MIN: f32 = 0.3;
/// Probability above which the present section is another one than it was taken for.
const OTHER_MIN: f32 = 0.7;
/// Level of all bands, in dBFS, below which a beat is silent.
const SILENT_DB: f32 = -75.0;
/// Number of silent beats after which the music counts as a new piece.
const SILENT_BEATS: u32 = 8;
/// Greatest number of beats between two updates that are processed one by one; after more, the
/// music counts as a new piece.
const CAUGHT_UP_MAX: i64 = 4;

/// Finds the form of the music, beat by beat.
pub struct FormTracker {
    history: History,
    network: FormNetwork,
    inputs: [f32; INPUTS],
    /// Number of the first beat whose sound is not complete; `None` without music.
    current: Option<i64>,
    /// Number of silent beats until now.
    silent: u32,
    /// True if the section that plays was foreseen for its first beat.
    is_foreseen: bool,
    form: Form,
}

impl FormTracker {
    /// Creates a tracker that has heard no music.
    ///
    /// # Errors
    /// [`NetError`] if the built-in weights are damaged.
    pub fn new() -> Result<Self, NetError> {
        Ok(Self {
            history: History::new(),
            network: FormNetwork::built_in()?,
            inputs: [0.0; INPUTS],
            current: None,
            silent: 0,
            is_foreseen: false,
            form: Form::default(),
        })
    }

    /// Returns the form of the music.
    pub fn form(&self) -> &Form {
        &self.form
    }

    /// Processes the beats of `timeline` that have ended at the time `now`. `music` is false while
    /// there is no music. `sound_of` returns the sound between two times of the timeline; `None` if
    /// it is not known.
    pub(crate) fn update(
        &mut self,
        timeline: &Timeline,
        now: Seconds,
        music: bool,
        sound_of: impl Fn(Seconds, Seconds) -> Option<BeatSound>,
    ) {
        if !music {
            self.clear();
            return;
        }
        let next = timeline.beat_at(now).0.floor() as i64;
        let from = *self.current.get_or_insert(next);
        if next - from > CAUGHT_UP_MAX || from - next > CAUGHT_UP_MAX {
            self.clear();
            self.current = Some(next);
            return;
        }
        for beat in from..next {
            let times = [beat, beat + 1].map(|beat| timeline.time_of(Beats(beat as f64)));
            if let Some(sound) = sound_of(times[0], times[1]) {
                self.process(&sound, beat + 1, timeline.bars());
            }
            self.current = Some(beat + 1);
        }
    }

    /// Forgets the music.
    fn clear(&mut self) {
        if self.current.take().is_some() {
            self.history.clear();
            self.network.clear();
            self.silent = 0;
            self.form = Form::default();
        }
    }

    /// Processes the sound of the beat before the beat `next`.
    fn process(&mut self, sound: &BeatSound, next: i64, bars: Bars) {
        if sound.levels_db.iter().all(|&level| level < SILENT_DB) {
            self.silent += 1;
            if self.silent == SILENT_BEATS {
                self.clear();
            }
            return;
        }
        self.silent = 0;
        self.history.push(sound, next, bars, &mut self.inputs);
        let estimate = self.network.step(&self.inputs);
        self.decide(&estimate, next, bars);
    }

    /// Updates the form by the network's `estimate` after the beat before `next`.
    fn decide(&mut self, estimate: &Estimate, next: i64, bars: Bars) {
        match (self.beginning(estimate, next, bars), &mut self.form.now) {
            (Some(start), now) => {
                self.is_foreseen = start.beat == next;
                *now = Some(start);
            }
            (None, Some(now)) => {
                let (section, confidence) = most_likely(&estimate.now);
                // The first beats of a section still sound much like the one before.
                let is_settled = !self.is_foreseen || next - now.beat > BEATS_BACK as i64;
                if confidence > OTHER_MIN && is_settled {
                    now.section = section;
                }
                now.confidence = estimate.now[now.section as usize];
            }
            (None, now) => {
                let (section, confidence) = most_likely(&estimate.now);
                *now = Some(SectionStart {
                    section,
                    beat: next - 1,
                    confidence,
                });
            }
        }
        self.form.next = announced(estimate, next, bars);
    }

    /// Returns the section that begins at the beat `next`, or has begun shortly before it; `None`
    /// if none does.
    fn beginning(&self, estimate: &Estimate, next: i64, bars: Bars) -> Option<SectionStart> {
        let begun: f32 = estimate.since[..BEATS_BACK].iter().sum();
        let start = if estimate.until[0] > FORESEEN_MIN {
            let (section, _) = most_likely(&estimate.next);
            SectionStart {
                section,
                beat: next,
                confidence: estimate.until[0],
            }
        } else if begun > BEGUN_MIN {
            let (section, _) = most_likely(&estimate.now);
            SectionStart {
                section,
                beat: next - 1 - peak(&estimate.since[..BEATS_BACK]) as i64,
                confidence: begun,
            }
        } else {
            return None;
        };
        let beat = on_bar(start.beat, bars).min(next);
        let is_new = self
            .form
            .now
            .is_none_or(|now| beat - now.beat > i64::from(bars.beats));
        is_new.then_some(SectionStart { beat, ..start })
    }
}

/// Returns the next section if the network foresees it after the beat `next`, which begins now.
fn announced(estimate: &Estimate, next: i64, bars: Bars) -> Option<SectionStart> {
    let ahead = peak(&estimate.until[..BEATS_AHEAD]);
    let around = ahead.saturating_sub(1)..(ahead + 2).min(BEATS_AHEAD);
    let confidence: f32 = estimate.until[around].iter().sum();
    let beat = on_bar(next + ahead as i64, bars);
    let (section, _) = most_likely(&estimate.next);
    (confidence > ANNOUNCED_MIN && beat > next).then_some(SectionStart {
        section,
        beat,
        confidence,
    })
}

/// Returns the first beat of a bar that is at most one beat from `beat`, otherwise `beat`.
fn on_bar(beat: i64, bars: Bars) -> i64 {
    match bars.position(beat) {
        1 => beat - 1,
        place if place + 1 == bars.beats => beat + 1,
        _ => beat,
    }
}

/// Returns the section with the greatest probability, and this probability.
fn most_likely(probabilities: &[f32; SECTIONS]) -> (Section, f32) {
    let at = peak(probabilities);
    (Section::ALL[at], probabilities[at])
}

/// Returns the index of the greatest of `values`, the first of equal ones; 0 if there are none.
fn peak(values: &[f32]) -> usize {
    let better = |best: usize, at: usize| if values[at] > values[best] { at } else { best };
    (1..values.len()).fold(0, better)
}
