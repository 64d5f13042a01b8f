//! Changes the show file during a show: learnt MIDI controls and calibrated values are saved in it;
//! the rest of the text stays as it is. In: a change of the text. Out: the changed file. Thread:
//! any except show and audio.
//!
//! While a file is being saved, it may be empty or truncated for a moment, and a full disk leaves
//! it like that. The program then neither applies nor changes the text; [`Flaw`] defines how such a
//! text is recognised.

use crate::shown;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use thiserror::Error;

use toml_edit::{Item, Table, Value};

/// The greatest size of a show file that the program changes, in MiB.
const MIB_MAX: u64 = 16;

/// A function that checks the text of a show file. Its error is a sentence that says what is wrong.
pub type Check = Box<dyn Fn(&str) -> Result<(), String> + Send + Sync>;

/// The reasons why the text of a show file looks incomplete.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Flaw {
    /// The text is empty.
    #[error("the file is empty")]
    Empty,
    /// The text contains no settings, only comments and blank lines.
    #[error("the file holds only comments and blank lines")]
    NoSettings,
    /// The text is only the beginning of the last good text, i.e. of the last text that was
    /// complete and valid.
    #[error("the file ends after the first {bytes} of its {of} bytes, as if it was cut short")]
    Cut {
        /// The length of the incomplete text, in bytes.
        bytes: usize,
        /// The length of the complete text (the last good text), in bytes.
        of: usize,
    },
}

impl Flaw {
    /// Returns the reason why the show file's text `text` looks incomplete. `good` is the last text
    /// that was complete and valid. Returns `None` if `text` looks complete or if `good` has no
    /// settings.
    pub fn of(text: &str, good: &str) -> Option<Self> {
        let is_blank = |text: &str| {
            text.trim_start_matches('\u{feff}')
                .lines()
                .map(str::trim)
                .all(|line| line.is_empty() || line.starts_with('#'))
        };
        if is_blank(good) {
            None
        } else if text.trim().is_empty() {
            Some(Self::Empty)
        } else if is_blank(text) {
            Some(Self::NoSettings)
        } else {
            let rest = good.strip_prefix(text)?;
            (!rest.trim().is_empty()).then_some(Self::Cut {
                bytes: text.len(),
                of: good.len(),
            })
        }
    }
}

/// The show file of a running show. Several threads may change it.
pub struct ShowFile {
    path: PathBuf,
    check: Check,
    /// The last good text of the show file, and the text that the program wrote last. The lock is
    /// held during each change of the file, so that two threads do not overwrite each other's
    /// changes.
    texts: Mutex<Texts>,
}

#[derive(Default)]
struct Texts {
    /// The last good text: the last text of the show file that was complete and valid. The show
    /// uses its settings.
    good: String,
    /// The text that this program wrote last. `None` if it wrote nothing yet, or after
    /// `ShowFile::wrote` has returned true for this text.
    written: Option<String>,
    /// The files that the show file includes, in the order in which they are read.
    included: Vec<PathBuf>,
}

impl ShowFile {
    /// Creates a `ShowFile` for the show file at `path`. A changed text is written only if `check`
    /// accepts it.
    pub fn new(path: PathBuf, check: Check) -> Self {
        Self {
            path,
            check,
            texts: Mutex::default(),
        }
    }

    /// Returns the last good text, i.e. the last text of the show file that was complete and valid.
    /// Returns an empty text if there was none yet.
    pub fn good(&self) -> String {
        self.texts().good.clone()
    }

    /// Stores `text` as the last good text. From then on, a text that is only the beginning of
    /// `text` is treated as incomplete.
    pub fn accept(&self, text: String) {
        self.texts().good = text;
    }

    fn texts(&self) -> MutexGuard<'_, Texts> {
        self.texts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the path of the show file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns true if `text` is the text that this program wrote last, and not an edit by the
    /// user. Returns true only once for each written text.
    pub fn wrote(&self, text: &str) -> bool {
        self.texts().written.take_if(|own| own == text).is_some()
    }

    /// Takes `files` as the files that the show file includes, in the order in which they are read.
    pub fn set_included(&self, files: Vec<PathBuf>) {
        self.texts().included = files;
    }

    /// Returns the files that the show file includes.
    pub fn included(&self) -> Vec<PathBuf> {
        self.texts().included.clone()
    }

    /// Changes the show file as [`ShowFile::change`] does, or else the first included file for whose
    /// text `holds` returns true, if it returns false for the text of the show file.
    ///
    /// # Errors
    /// A sentence with the reason, as of [`ShowFile::change`].
    pub fn change_where<E: std::fmt::Display>(
        &self,
        holds: impl Fn(&str) -> bool,
        change: impl FnOnce(&str) -> Result<String, E>,
    ) -> Result<(), String> {
        let is_in = |path: &Path| read_text(path).is_ok_and(|text| holds(&text));
        let included = self.included();
        match included.iter().find(|path| is_in(path)) {
            Some(path) if !is_in(&self.path) => self.change_included(path, change),
            _ => self.change(change),
        }
    }

    /// Reads the included file at `path`, passes its text to `change` and writes the text that
    /// `change` returns.
    ///
    /// # Errors
    /// A sentence with the reason: the file cannot be read or written, or `change` fails.
    pub fn change_included<E: std::fmt::Display>(
        &self,
        path: &Path,
        change: impl FnOnce(&str) -> Result<String, E>,
    ) -> Result<(), String> {
        let _texts = self.texts();
        let text = read_text(path)?;
        let new = change(&text).map_err(|error| format!("{}: {error}", shown(path)))?;
        if new == text {
            return Ok(());
        }
        crate::write(path, new.as_bytes()).map_err(|error| error.to_string())
    }

    /// Reads the show file, passes its text to `change` and writes the text that `change` returns.
    ///
    /// # Errors
    /// A sentence with the reason: the file cannot be read or written, the file looks incomplete,
    /// `change` fails, or the new text is not valid. The file is then unchanged.
    pub fn change<E: std::fmt::Display>(
        &self,
        change: impl FnOnce(&str) -> Result<String, E>,
    ) -> Result<(), String> {
        let mut texts = self.texts();
        let path = &self.path;
        let text = read_text(path)?;
        if let Some(flaw) = Flaw::of(&text, &texts.good) {
            return Err(format!(
                "nothing is saved in {}: {flaw}; save the whole show file first",
                shown(path)
            ));
        }
        let new = change(&text).map_err(|error| format!("{}: {error}", shown(path)))?;
        if new == text {
            return Ok(());
        }
        (self.check)(&new)?;
        texts.written = Some(new.clone());
        crate::write(path, new.as_bytes()).map_err(|error| error.to_string())?;
        texts.good = new;
        Ok(())
    }
}

/// Returns the text of the file at `path`. The error is a sentence.
fn read_text(path: &Path) -> Result<String, String> {
    let bytes = crate::read(path, MIB_MAX).map_err(|error| error.to_string())?;
    crate::text(bytes).map_err(|error| format!("cannot read {}: {error}", shown(path)))
}

/// Sets the key `key` of the TOML table `table` to `new`. A value that already equals `new` keeps
/// its notation. A comment after the old value is kept.
pub fn put(table: &mut Table, key: &str, new: impl Into<Value>) {
    let new = new.into();
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(old) if says_the_same(old, &new) => {}
        Some(old) => {
            let decor = old.decor().clone();
            *old = new;
            *old.decor_mut() = decor;
        }
        None => drop(table.insert(key, Item::Value(new))),
    }
}

/// Returns true if two TOML values are equal, whatever their notation, such as 1 and 1.0.
fn says_the_same(old: &Value, new: &Value) -> bool {
    let number = |value: &Value| {
        value
            .as_float()
            .or_else(|| value.as_integer().map(|integer| integer as f64))
    };
    if let (Some(old), Some(new)) = (old.as_array(), new.as_array()) {
        return old.len() == new.len()
            && old
                .iter()
                .zip(new)
                .all(|(old, new)| says_the_same(old, new));
    }
    !old.is_array()
        && (old.as_str(), number(old), old.as_bool()) == (new.as_str(), number(new), new.as_bool())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rejected_change_leaves_the_file_unchanged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("show.toml");
        std::fs::write(&path, "a = 1\n").unwrap();
        let check = |text: &str| {
            if text.contains('3') {
                Err("no 3".to_owned())
            } else {
                Ok(())
            }
        };
        let file = ShowFile::new(path.clone(), Box::new(check));
        let to = |new: &'static str| file.change(|_| Ok::<_, String>(new.to_owned()));
        assert_eq!(to("a = 3\n"), Err("no 3".into()));
        let refused = file.change(|_| Err::<String, _>("not so"));
        assert!(refused.unwrap_err().ends_with("show.toml: not so"));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "a = 1\n");
        assert_eq!(to("a = 2\n"), Ok(()));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "a = 2\n");
        assert!(!file.wrote("a = 1\n") && file.wrote("a = 2\n") && !file.wrote("a = 2\n"));
    }
    #[test]
    fn a_change_goes_to_the_file_that_holds_the_table() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("show.toml"), "a = 1\n").unwrap();
        std::fs::write(at("part.toml"), "b = 1\n").unwrap();
        let file = ShowFile::new(at("show.toml"), Box::new(|_| Ok(())));
        let change = |key: &'static str| {
            let to_2 = |text: &str| Ok::<_, String>(text.replace('1', "2"));
            file.change_where(|text| text.contains(key), to_2).unwrap();
            ["show.toml", "part.toml"].map(|name| std::fs::read_to_string(at(name)).unwrap())
        };
        assert_eq!(
            change("b"),
            ["a = 2\n", "b = 1\n"],
            "nothing is included yet"
        );
        file.set_included(vec![at("part.toml")]);
        assert_eq!(change("b"), ["a = 2\n", "b = 2\n"]);
        assert_eq!(change("a"), ["a = 2\n", "b = 2\n"]);
        let missing = file.change_included(&at("no.toml"), |_| Ok::<_, String>(String::new()));
        assert!(missing.unwrap_err().contains("no.toml"));
    }

    #[test]
    fn every_beginning_of_a_good_text_counts_as_incomplete() {
        let good =
            "# A show.\n\n[audio]\ninput = \"jack\"\n\n[[output]]\nrate_hz = 60 # twice 30\n\n";
        for bytes in 0..good.len() {
            let text = &good[..bytes];
            let expected = match text.trim() {
                "" => Some(Flaw::Empty),
                _ if bytes < "# A show.\n\n[".len() => Some(Flaw::NoSettings),
                _ if good[bytes..].trim().is_empty() => None,
                _ => Some(Flaw::Cut {
                    bytes,
                    of: good.len(),
                }),
            };
            assert_eq!(Flaw::of(text, good), expected, "{text:?}");
        }
    }

    #[test]
    fn only_a_part_of_a_good_text_counts_as_incomplete() {
        let good = "[[output]]\nrate_hz = 60\n[[output]]\nrate_hz = 120\n";
        let whole = [
            good,
            "[[output]]\nrate_hz = 60\n[[output]]\nrate_hz = 12\n",
            "[[output]]\nrate_hz = 120\n",
            "[[output]]\nrate_hz = 60\n# one is enough\n",
        ];
        for text in whole {
            assert_eq!(Flaw::of(text, good), None, "{text:?}");
        }
        for (text, good) in [("", ""), ("# nothing yet\n", ""), ("", "# nothing yet\n")] {
            assert_eq!(Flaw::of(text, good), None, "{text:?} after {good:?}");
        }
    }

    #[test]
    fn nothing_is_added_to_an_incomplete_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("show.toml");
        let file = ShowFile::new(path.clone(), Box::new(|_| Ok(())));
        file.accept("a = 1\nb = 2\n".into());
        for half in ["", "# a comment\n", "a = 1\n"] {
            std::fs::write(&path, half).unwrap();
            let refused = file.change(|text| Ok::<_, String>(format!("{text}c = 3\n")));
            let why = refused.unwrap_err();
            assert!(
                why.contains("show.toml: the file ")
                    && why.ends_with("save the whole show file first"),
                "{why}"
            );
            assert_eq!(std::fs::read_to_string(&path).unwrap(), half);
        }
        std::fs::write(&path, "a = 1\nb = 2\n").unwrap();
        assert_eq!(
            file.change(|text| Ok::<_, String>(text.replace("2", "3"))),
            Ok(())
        );
        assert_eq!(file.good(), "a = 1\nb = 3\n");
    }
}
