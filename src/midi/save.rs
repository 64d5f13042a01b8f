//! Saves a learnt control: inserts a map entry into a `[[midi]]` section of a show file and leaves
//! every other byte unchanged. In: the text of the file, the entry. Out: the new text. Thread: any.
//! Pure.

use thiserror::Error;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, Value, value};

use super::settings::{Backend, Settings};
use corybant_core::cue::midi::{Control, MapEntry};
use corybant_files::show_file::put;

/// The reasons why a map entry cannot be inserted into a show file.
#[derive(Debug, Error)]
pub enum SaveError {
    /// The text of the show file is not TOML.
    #[error("the show file cannot be read: {0}")]
    Toml(#[from] toml_edit::TomlError),
    /// A key of the show file is not written as an array of tables, so no entry can be added.
    #[error("`{key}` in the show file is not written as [[{key}]]; write it so, and learn again")]
    Shape {
        /// The key that is no array of tables, such as `midi`.
        key: &'static str,
    },
}

/// Returns the show file `text` with the map entry `entry` inserted in the section of the
/// controller with `settings`. An existing entry for the same control is replaced. A missing
/// section is added.
///
/// # Errors
/// [`SaveError::Toml`] if `text` is not TOML, [`SaveError::Shape`] if the key `midi` or `map` in
/// `text` is not an array of tables.
pub fn with(text: &str, settings: &Settings, entry: &MapEntry) -> Result<String, SaveError> {
    let mut document: DocumentMut = text.parse()?;
    let controllers = tables(document.as_table_mut(), "midi", "midi")?;
    let number = controllers
        .iter()
        .position(|table| is_controller(table, settings));
    if number.is_none() {
        controllers.push(new_controller(settings));
    }
    let number = number.unwrap_or(controllers.len() - 1);
    let Some(controller) = controllers.get_mut(number) else {
        return Err(SaveError::Shape { key: "midi" });
    };
    let map = tables(controller, "map", "midi.map")?;
    let existing = map.iter().position(|table| is_for(table, entry));
    match existing.and_then(|number| map.get_mut(number)) {
        Some(table) => update(table, entry),
        None => map.push(new_entry(entry)),
    }
    Ok(document.to_string())
}

/// Returns true if the show file `text` has the section of the controller with `settings`.
pub fn has_controller(text: &str, settings: &Settings) -> bool {
    let document = text.parse::<DocumentMut>();
    document.is_ok_and(|document| {
        let controllers = document.get("midi").and_then(Item::as_array_of_tables);
        controllers.is_some_and(|all| all.iter().any(|table| is_controller(table, settings)))
    })
}

/// Creates the TOML table of the map entry `entry`; the key of the control comes first.
fn new_entry(entry: &MapEntry) -> Table {
    let mut table = Table::new();
    if let Some((key, number)) = entry.control().map(key_and_number) {
        table.insert(key, value(i64::from(number)));
    }
    if let Some(channel) = entry.channel {
        table.insert("channel", value(i64::from(channel)));
    }
    update(&mut table, entry);
    table
}

fn tables<'a>(
    table: &'a mut Table,
    key: &str,
    name: &'static str,
) -> Result<&'a mut ArrayOfTables, SaveError> {
    let item = table
        .entry(key)
        .or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()));
    item.as_array_of_tables_mut()
        .ok_or(SaveError::Shape { key: name })
}

fn text_of<'a>(table: &'a Table, key: &str) -> &'a str {
    table.get(key).and_then(Item::as_str).unwrap_or_default()
}

fn backend_name(backend: Backend) -> &'static str {
    match backend {
        Backend::System => "system",
        Backend::Jack => "jack",
    }
}

/// Returns true if `table` is the `[[midi]]` section of the controller with `settings`, that is,
/// has the same backend and port.
fn is_controller(table: &Table, settings: &Settings) -> bool {
    let table_backend = Some(text_of(table, "backend"))
        .filter(|word| !word.is_empty())
        .unwrap_or("system");
    table_backend == backend_name(settings.backend) && text_of(table, "port") == settings.port
}

fn new_controller(settings: &Settings) -> Table {
    let mut table = Table::new();
    if settings.backend != Backend::default() {
        table.insert("backend", value(backend_name(settings.backend)));
    }
    table.insert("port", value(&settings.port));
    if let Some(leds) = toml_word(&settings.leds) {
        table.insert("leds", value(leds));
    }
    table
}

/// Returns the text that stands for the enum value `word` in a show file. Returns `None` for the
/// default value, because it is not written.
fn toml_word<T: serde::Serialize + Default + PartialEq>(word: &T) -> Option<String> {
    if *word == T::default() {
        return None;
    }
    toml::Value::try_from(word)
        .ok()
        .and_then(|word| word.as_str().map(String::from))
}

fn key_and_number(control: Control) -> (&'static str, u8) {
    match control {
        Control::Note(number) => ("note", number),
        Control::Cc(number) => ("cc", number),
        Control::Program(number) => ("program", number),
    }
}

/// Returns true if `table` is a map entry for the same control as `entry`. If `table` has a MIDI
/// channel, `entry` must have the same one; without a channel, `table` is for all channels.
fn is_for(table: &Table, entry: &MapEntry) -> bool {
    let number = |key: &str| table.get(key).and_then(Item::as_integer);
    let same = entry
        .control()
        .map(key_and_number)
        .is_some_and(|(key, own)| number(key) == Some(own.into()));
    same && number("channel").is_none_or(|channel| Some(channel) == entry.channel.map(i64::from))
}

/// Writes all values of `entry` except its control into `table`. Values that do not change keep
/// their spelling.
fn update(table: &mut Table, entry: &MapEntry) {
    let if_true = |value: bool| value.then(|| Value::from(true));
    let wanted = [
        ("label", Some(Value::from(&entry.label))),
        ("beats", entry.beats.map(|beats| i64::from(beats).into())),
        ("mode", toml_word(&entry.mode).map(Value::from)),
        ("quantise", toml_word(&entry.quantise).map(Value::from)),
        (
            "velocity_as_intensity",
            if_true(entry.velocity_as_intensity),
        ),
        ("avoid", if_true(entry.avoid)),
        ("queue", if_true(entry.queue)),
        ("record", if_true(entry.record)),
    ];
    for (key, item) in wanted {
        match item {
            None => drop(table.remove(key)),
            Some(value) => put(table, key, value),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::midi::LedProtocol;
    use corybant_core::cue::launch::{Mode, Quantise};

    const SHOW: &str = "# My show.\n[audio]  # the room\ninput = 'default'\n\n[[midi]]\t# on the left\nport = \"Launchpad\"\n\n  [[midi.map]]   # top left\n  \
                        note=36 # C\n  label = 'salsa' # the favourite\n# between\n\n[[midi]]\nbackend=\"jack\"\nport = \"\"\n\n# the page\n[page]\nlisten = \
                        'off' # not today\n# the end\n";

    fn pads() -> Settings {
        Settings {
            port: "Launchpad".into(),
            ..Settings::default()
        }
    }

    fn salsa(control: Control) -> MapEntry {
        MapEntry {
            label: "salsa".into(),
            ..MapEntry::default()
        }
        .of(control, Some(10))
    }

    /// Returns the text that `after` has in addition to `before`; panics if anything else has
    /// changed.
    fn added(before: &str, after: &str) -> String {
        let at = before
            .bytes()
            .zip(after.bytes())
            .take_while(|(a, b)| a == b)
            .count();
        let rest = before.len()
            - before
                .bytes()
                .rev()
                .zip(after.bytes().rev())
                .take(before.len() - at)
                .take_while(|(a, b)| a == b)
                .count();
        assert_eq!(rest, at, "something else was changed:\n{after}");
        after[at..at + after.len() - before.len()].to_owned()
    }

    #[test]
    fn an_entry_is_added_and_nothing_else_changes() {
        let entry = MapEntry {
            mode: Mode::Gate,
            quantise: Quantise::Bars2,
            beats: Some(16),
            ..salsa(Control::Cc(20))
        };
        let after = with(SHOW, &pads(), &entry).unwrap();
        let new = added(SHOW, &after);
        assert!(
            new.contains("[[midi.map]]\ncc = 20\nchannel = 10\nlabel = \"salsa\"\nbeats = 16\nmode = \"gate\"\nquantise = \"2bars\"\n"),
            "{new}"
        );
        let read: crate::config::Config = toml::from_str(&after).unwrap();
        assert_eq!((&read.midi[0].map[1], read.midi[1].map.len()), (&entry, 0));
        let jack = Settings {
            backend: Backend::Jack,
            ..Settings::default()
        };
        let after = with(SHOW, &jack, &entry).unwrap();
        added(SHOW, &after);
        let read: crate::config::Config = toml::from_str(&after).unwrap();
        assert_eq!((read.midi[0].map.len(), &read.midi[1].map[0]), (1, &entry));
    }

    #[test]
    fn an_entry_for_the_same_control_is_replaced_in_place() {
        let entry = MapEntry {
            mode: Mode::Toggle,
            ..salsa(Control::Note(36))
        };
        let after = with(
            SHOW,
            &pads(),
            &MapEntry {
                label: "pop".into(),
                ..entry.clone()
            },
        )
        .unwrap();
        let expected = SHOW.replace(
            "label = 'salsa' # the favourite\n",
            "label = \"pop\" # the favourite\nmode = \"toggle\"\n",
        );
        assert_eq!(after, expected);
        assert_eq!(
            with(
                &after,
                &pads(),
                &MapEntry {
                    mode: Mode::Trigger,
                    label: "pop".into(),
                    ..entry.clone()
                }
            )
            .unwrap(),
            expected.replace("mode = \"toggle\"\n", "")
        );
        // An equal entry changes nothing.
        assert_eq!(
            with(SHOW, &pads(), &salsa(Control::Note(36))).unwrap(),
            SHOW
        );
    }

    #[test]
    fn a_new_controller_gets_a_section() {
        let settings = Settings {
            port: "APC mini".into(),
            leds: LedProtocol::ApcMini,
            ..Settings::default()
        };
        for before in [SHOW, "", "# only words\n", "[audio]\ninput = 'default'"] {
            let after = with(before, &settings, &salsa(Control::Program(3))).unwrap();
            added(before, &after);
            let read: crate::config::Config = toml::from_str(&after).unwrap();
            let last = read.midi.last().unwrap();
            assert_eq!(
                (&*last.port, last.leds, &last.map[..]),
                (
                    "APC mini",
                    LedProtocol::ApcMini,
                    &[salsa(Control::Program(3))][..]
                ),
                "{after}"
            );
        }
    }

    #[test]
    fn a_text_without_arrays_of_tables_is_refused() {
        let refused = |text: &str| {
            with(text, &pads(), &salsa(Control::Note(36)))
                .unwrap_err()
                .to_string()
        };
        assert!(refused("[midi").contains("cannot be read"));
        assert!(refused("midi = [{ port = 'Launchpad' }]\n").contains("not written as [[midi]]"));
        assert!(
            refused("[[midi]]\nport = 'Launchpad'\nmap = []\n")
                .contains("not written as [[midi.map]]")
        );
    }
}
