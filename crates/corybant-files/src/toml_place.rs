//! Finds the line of a TOML text that a sentence about a setting means. In: text, a sentence that
//! begins with a key. Out: the number of the line. Thread: any.
//!
//! A sentence begins with the key of a setting: `output 2.rate_hz is 0: ...`. A number after a space
//! counts the tables of an array from 1, a number in brackets from 0.

use std::ops::Range;

use toml_edit::{Document, Item, TableLike, Value};

/// One part of a key: a name, and the index (from 0) of an element of its array.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Part<'a> {
    name: &'a str,
    index: Option<usize>,
}

/// Returns the number (from 1) of the line of `text` that contains the setting with whose key
/// `sentence` begins. If `sentence` quotes an element of a list, it is the line of this element; if
/// the setting is not in the text, the line of the table in which it would stand. Returns `None` if
/// the text is not valid TOML or has no such table.
///
/// ```
/// use corybant_files::toml_place::line_of;
///
/// let text = "[[output]]\nrate_hz = 60\n[[output]]\nrate_hz = 0\n";
/// assert_eq!(line_of(text, "output 2.rate_hz is 0: at least 1"), Some(4));
/// ```
pub fn line_of(text: &str, sentence: &str) -> Option<usize> {
    place_of(text, sentence, 0).map(|place| place.line)
}

/// The place of a setting in a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The number of the line, from 1.
    pub line: usize,
    /// True if the text has the setting itself; false if it has only the table in which the setting
    /// would stand.
    pub is_exact: bool,
}

/// Returns the place of the setting with whose key `sentence` begins, like [`line_of`]. If the
/// sentence counts the tables of an array, the first table of `text` has the number `first` + 1.
pub fn place_of(text: &str, sentence: &str, first: usize) -> Option<Place> {
    let text = text.trim_start_matches('\u{feff}');
    let document = Document::parse(text).ok()?;
    let mut parts = parts(sentence);
    if let Some(index) = parts.first_mut().and_then(|part| part.index.as_mut()) {
        *index = index.checked_sub(first)?;
    }
    let (span, is_exact) = place(document.as_table(), parts, sentence)?;
    let line = text.get(..span.start)?.matches('\n').count() + 1;
    Some(Place { line, is_exact })
}

/// Returns the number of tables in `text` of the array that `sentence` counts at its start; 0 if it
/// counts none.
pub fn counted_tables(text: &str, sentence: &str) -> usize {
    let parts = parts(sentence);
    let counted = parts.first().filter(|part| part.index.is_some());
    counted.map_or(0, |part| tables(text, part.name))
}

/// Returns the number of tables `[[key]]` in `text`; 0 if the text is not valid TOML.
pub fn tables(text: &str, key: &str) -> usize {
    let document = Document::parse(text.trim_start_matches('\u{feff}')).ok();
    let tables = document.and_then(|document| Some(document.get(key)?.as_array_of_tables()?.len()));
    tables.unwrap_or(0)
}

/// Returns the parts of the key with which `sentence` begins.
fn parts(sentence: &str) -> Vec<Part<'_>> {
    let mut parts = Vec::new();
    let mut rest = sentence;
    loop {
        let is_name = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
        let (name, after) = rest.split_at(rest.find(|c| !is_name(c)).unwrap_or(rest.len()));
        if name.is_empty() {
            return parts;
        }
        let (index, after) = index(after);
        parts.push(Part { name, index });
        match after.strip_prefix('.') {
            Some(after) => rest = after,
            None => return parts,
        }
    }
}

/// Reads the index of an element at the start of `text`: ` 2` (from 1) or `[2]` (from 0). Returns it
/// and the rest of the text.
fn index(text: &str) -> (Option<usize>, &str) {
    let number = |text: &str| {
        let end = text
            .find(|c: char| !c.is_ascii_digit())
            .unwrap_or(text.len());
        text[..end]
            .parse::<usize>()
            .ok()
            .map(|number| (number, end))
    };
    if let Some((counted, end)) = text.strip_prefix(' ').and_then(number) {
        return (counted.checked_sub(1), &text[end + 1..]);
    }
    if let Some((index, end)) = text.strip_prefix('[').and_then(number) {
        return (Some(index), text[end + 1..].strip_prefix(']').unwrap_or(""));
    }
    (None, text)
}

/// Returns the span of the setting `parts` in `table` and true, or that of the innermost table on
/// the way to it and false.
fn place(
    mut table: &dyn TableLike,
    parts: Vec<Part>,
    sentence: &str,
) -> Option<(Range<usize>, bool)> {
    let mut found: Option<Range<usize>> = None;
    let count = parts.len();
    for (n, part) in (1..).zip(parts) {
        let Some((key, item)) = table.get_key_value(part.name) else {
            break;
        };
        found = key.span().or(item.span()).or(found);
        let element = match item {
            Item::ArrayOfTables(tables) => {
                let only = (tables.len() == 1).then_some(0);
                let index = part.index.or(only)?;
                let table = tables.get(index)?;
                Some((table as &dyn TableLike, table.span()))
            }
            Item::Value(Value::Array(values)) => {
                let quoted = |value: &&Value| {
                    let text = value.as_str();
                    text.is_some_and(|text| sentence.contains(&format!("{text:?}")))
                };
                found = values.iter().find(quoted).and_then(Value::span).or(found);
                let element = part.index.and_then(|index| values.get(index));
                element.and_then(|it| Some((it.as_inline_table()? as &dyn TableLike, it.span())))
            }
            item => item.as_table_like().map(|it| (it, None)),
        };
        if let Some((_, Some(span))) = &element {
            found = Some(span.clone());
        }
        if n == count {
            return Some((found?, true));
        }
        let Some((inner, _)) = element else { break };
        table = inner;
    }
    Some((found?, false))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHOW: &str = "[audio]\nchannels = [1]\n\n[[scene]]\nname = \"calm\"\nlabels = [\n  \"salsa\",\n  \"x\",\n]\n[[scene]]\n\
                        intensity = 2\n[[midi]]\nmap = [\n  { note = 1 },\n  { note = 200 },\n]\n[[dancer]]\nhome = [1, 2]\n";

    #[test]
    fn a_sentence_is_placed_at_its_setting() {
        for (sentence, line) in [
            ("audio.channels has 1", Some(2)),
            ("audio.input is x", Some(1)),
            ("scene 1.labels names \"x\": no", Some(8)),
            ("scene 1.labels names nothing", Some(6)),
            ("scene 2.intensity is 2", Some(11)),
            ("scene 2.name is empty", Some(10)),
            ("scene 3.name is empty", None),
            ("midi 1.map[1].note is 200", Some(15)),
            ("dancer.home is far", Some(18)),
            ("scene.name is empty", None),
            ("there is no dancer", None),
            ("", None),
            ("scene 99999999999999999999.name", None),
            ("scene 0.name", None),
        ] {
            assert_eq!(line_of(SHOW, sentence), line, "{sentence}");
        }
        assert_eq!(line_of("[", "audio.input is x"), None);
        assert_eq!(
            line_of(&format!("\u{feff}{SHOW}"), "audio.channels"),
            Some(2)
        );
    }
}
