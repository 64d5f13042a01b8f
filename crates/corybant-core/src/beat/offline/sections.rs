//! The sections of a whole recording. In: all samples and beats. Out: the section of each beat.
//! Thread: any except audio and show. Allocates: yes.
//!
//! The live tracker of sections runs over the recording. It knows some sections a few beats after
//! they have begun; here each section has all of its beats.

use crate::beat::BeatError;
use crate::beat::form::section::{Form, SectionStart};
use crate::beat::form::{FormSound, FormTracker};
use crate::beat::offline::Beat;
use crate::dsp::SAMPLE_RATE;
use crate::time::{Bars, Seconds, Timeline};

/// Number of beats before a section at which it is announced in [`forms`].
const ANNOUNCED_BEATS: i64 = 16;

/// Sets the sections of `beats`, the beats of the recording `samples` (mono, at [`SAMPLE_RATE`]).
///
/// # Errors
/// [`BeatError`] if the built-in weights of the form network are damaged.
pub fn find(samples: &[f32], beats: &mut [Beat]) -> Result<(), BeatError> {
    let mut form = FormTracker::new()?;
    let mut sound = FormSound::new();
    let mut fed = 0;
    let mut starts: Vec<SectionStart> = Vec::new();
    for n in 1..beats.len() {
        let (from, to) = (beats[n - 1].time, beats[n].time);
        let until = ((to * f64::from(SAMPLE_RATE)) as usize + 1).min(samples.len());
        sound.hop(&samples[fed.min(until)..until]);
        fed = fed.max(until);
        let timeline =
            Timeline::known(n as i64 - 1, &[from, to], Seconds(to - from)).with_bars(Bars {
                first: n as i64 - i64::from(beats[n].bar_position),
                beats: beats[n].beats_per_bar,
            });
        let beat_sound = |from: Seconds, to: Seconds| sound.beat(from.0, to.0);
        form.update(&timeline, Seconds(to), beats[n].music, beat_sound);
        if let Some(now) = form.form().now {
            match starts.last_mut() {
                Some(last) if last.beat == now.beat => *last = now,
                _ => starts.push(now),
            }
        }
    }
    for (i, start) in starts.iter().enumerate() {
        let end = starts
            .get(i + 1)
            .map_or(beats.len() as i64, |next| next.beat);
        let span = start.beat.max(0) as usize..(end.max(start.beat) as usize).min(beats.len());
        beats[span.clone()]
            .iter_mut()
            .for_each(|beat| beat.section = Some(start.section));
        if let Some(first) = beats[span].first_mut() {
            first.begins_section = true;
        }
    }
    Ok(())
}

/// Returns the form of the music at each of `beats`, in which the next section is announced
/// 16 beats ahead. The first of `beats` has the number `first`.
pub fn forms(beats: &[Beat], first: i64) -> Vec<Form> {
    let start = |(number, beat): (i64, &Beat)| {
        let section = beat.section.filter(|_| beat.begins_section)?;
        Some(SectionStart {
            section,
            beat: number,
            confidence: 1.0,
        })
    };
    let numbered = || (first..).zip(beats);
    let mut coming = numbered().filter_map(start).peekable();
    let mut now = None;
    let form = |(number, _): (i64, &Beat)| {
        now = coming.next_if(|start| start.beat == number).or(now);
        let next = coming.peek().copied();
        Form {
            now,
            next: next.filter(|next| next.beat - number <= ANNOUNCED_BEATS),
        }
    };
    numbered().map(form).collect()
}
