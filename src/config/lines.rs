//! Finds the line of a show file that a problem is about. In: the text of the show file, a sentence.
//! Out: the sentence with the file and, if it is known, the line. Thread: any.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::{Spanned, Value};

/// Returns the problem `sentence` with the name of the show file and, if it is known, the number of
/// the line in `text`, the text of the show file.
pub(crate) fn located(name: &str, text: &str, sentence: &str) -> String {
    match feedback_line(text, sentence).or_else(|| song_line(text, sentence)) {
        Some(line) => format!("{name}:{line}: {sentence}"),
        None => format!("{name}: {sentence}"),
    }
}

/// Returns the number, from 1, of the line with the byte `at` of `text`.
fn line_at(text: &str, at: usize) -> Option<usize> {
    Some(text.get(..at)?.matches('\n').count() + 1)
}

/// If the problem `sentence` quotes a receiver in `osc.feedback`, returns the number (from 1) of
/// the line of the show file `text` that contains this receiver. Returns `None` for other problems.
fn feedback_line(text: &str, sentence: &str) -> Option<usize> {
    #[derive(Deserialize)]
    struct Show {
        osc: Osc,
    }
    #[derive(Deserialize)]
    struct Osc {
        feedback: Vec<Spanned<String>>,
    }
    let about = sentence.strip_prefix("osc.feedback holds ")?;
    let show: Show = toml::from_str(text).ok()?;
    let is_meant = |to: &&Spanned<String>| about.starts_with(&format!("{:?}", to.get_ref()));
    let at = show.osc.feedback.iter().find(is_meant)?.span().start;
    line_at(text, at)
}

/// If the problem `sentence` begins with the key of a song, such as `song 2.cues`, returns the number
/// (from 1) of its line in the show file `text`: that of the key, or of the song if the key is
/// missing. Returns `None` for other problems.
fn song_line(text: &str, sentence: &str) -> Option<usize> {
    #[derive(Deserialize)]
    struct Show {
        song: Vec<Spanned<BTreeMap<String, Spanned<Value>>>>,
    }
    let (number, about) = sentence.strip_prefix("song ")?.split_once('.')?;
    let number: usize = number.parse().ok()?;
    let key: String = about
        .chars()
        .take_while(|c| c.is_ascii_lowercase() || *c == '_')
        .collect();
    let show: Show = toml::from_str(text).ok()?;
    let song = show.song.get(number.checked_sub(1)?)?;
    let at = song.get_ref().get(&key);
    line_at(
        text,
        at.map_or(song.span().start, |value| value.span().start),
    )
}
