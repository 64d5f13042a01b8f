//! Finds the line of the show file that a problem is about. In: the text of the show file, the
//! problem. Out: a line number. Pure.

use serde::Deserialize;
use toml::{Spanned, Value};

/// Returns the number (from 1) of the line of the show file `text` that the problem `sentence` is
/// about: a receiver in `osc.feedback`, or a part of a `[[dmx_in]]`. `None` for other problems.
pub fn line_of(text: &str, sentence: &str) -> Option<usize> {
    let at = feedback(text, sentence).or_else(|| dmx_in(text, sentence))?;
    Some(text.get(..at)?.matches('\n').count() + 1)
}

/// Returns the position in `text` of the receiver in `osc.feedback` that `sentence` quotes.
fn feedback(text: &str, sentence: &str) -> Option<usize> {
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
    Some(show.osc.feedback.iter().find(is_meant)?.span().start)
}

/// Returns the position in `text` of the setting with which `sentence` begins, such as `dmx_in
/// 1.universe` or `dmx_in 1.patch 2`.
fn dmx_in(text: &str, sentence: &str) -> Option<usize> {
    #[derive(Deserialize)]
    struct Show {
        dmx_in: Vec<Spanned<Input>>,
    }
    #[derive(Deserialize)]
    struct Input {
        universe: Option<Spanned<Value>>,
        listen: Option<Spanned<Value>>,
        interface: Option<Spanned<Value>>,
        #[serde(default)]
        patch: Vec<Spanned<Value>>,
    }
    let (number, rest) = number(sentence.strip_prefix("dmx_in ")?)?;
    let show: Show = toml::from_str(text).ok()?;
    let input = show.dmx_in.get(number.checked_sub(1)?)?;
    let start = |value: &Option<Spanned<Value>>| Some(value.as_ref()?.span().start);
    let settings = input.get_ref();
    if let Some(rest) = rest.strip_prefix(".patch ") {
        let (entry, _) = self::number(rest)?;
        return Some(settings.patch.get(entry.checked_sub(1)?)?.span().start);
    }
    let key = rest.split([' ', '.']).nth(1).unwrap_or_default();
    let at = match key {
        "universe" => start(&settings.universe),
        "listen" => start(&settings.listen),
        "interface" => start(&settings.interface),
        _ => None,
    };
    at.or(Some(input.span().start))
}

/// Splits `text` after the number at its beginning.
fn number(text: &str) -> Option<(usize, &str)> {
    let end = text
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(text.len());
    Some((text[..end].parse().ok()?, &text[end..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_of_dmx_inputs_are_found() {
        let text = "[osc]\nfeedback = [\n  \"127.0.0.1:1\",\n]\n\n[[dmx_in]]\nuniverse = 0\n\n[[dmx_in.patch]]\nchannel = 1\n\n[[dmx_in.patch]]\n\
                    channel = 2\n\n[[dmx_in]]\nprotocol = \"art-net\"\npatch = [\n  { channel = 1 },\n  { channel = 2 },\n]\n";
        for (sentence, line) in [
            ("osc.feedback holds \"127.0.0.1:1\" again", Some(3)),
            ("dmx_in 1.universe is 0; it must", Some(7)),
            ("dmx_in 1.patch 1.channel is 0", Some(9)),
            ("dmx_in 1.patch 2 has the levels", Some(12)),
            ("dmx_in 2.patch 2 asks for the label", Some(19)),
            ("dmx_in 2.universe is 1 again", Some(15)),
            ("dmx_in 3.universe is 1", None),
            ("dmx_in 99999999999999999999.universe", None),
            ("output 1.to is wrong", None),
        ] {
            assert_eq!(line_of(text, sentence), line, "{sentence}");
        }
    }
}
