//! The calibration of a live show: the latency and channels of the audio input, and the offset of
//! each output. In: settings from the web page's clients. Out: atomic values that the show reads;
//! the show file. Thread: any except show and audio.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table};

use super::colours::{self, PadColours};
use crate::audio::channels::Channels;
use crate::audio::input::diagnosis::InputSound;
use crate::rt::atomic_ms::AtomicMs;
use corybant_files::show_file::{ShowFile, put};
use corybant_files::toml_place::tables;

/// A change of the calibration that a client requests.
#[derive(Clone, Debug, PartialEq)]
pub enum Setting {
    /// Mix these channels of the audio input, counted from 1; an empty list means all channels.
    Channels(Vec<u16>),
    /// Set the latency of the audio input, milliseconds.
    InputLatency(f64),
    /// Set the offset of one output.
    Offset {
        /// Index of the output, from 0, in the order of the show file.
        output: usize,
        /// Offset of the output, in milliseconds: the time by which its poses are ahead of the
        /// sound. Negative values delay the poses.
        ms: i32,
    },
    /// Write the current calibration to the show file.
    Keep,
    /// Set the colour of a group of pads, and write it to the show file.
    Colour {
        /// Group of pads; see [`group_of`](super::colours::group_of).
        group: String,
        /// Colour, `#rrggbb`.
        colour: String,
    },
}

/// Latency and channels of an audio input device; clones share the values.
#[derive(Clone)]
pub struct InputCalibration {
    /// The configured latency of the audio input; it can change during the show.
    pub latency: AtomicMs,
    /// Channels of the device: which of them are mixed into the mono sound, and their levels.
    pub channels: Channels,
    /// True if the device delivers what an output plays (loopback); it can change during the show.
    pub is_loopback: Arc<AtomicBool>,
}

/// Calibration of a live show: latency and channels of the audio input, and the offset of each
/// output. Clones share the values.
#[derive(Clone, Default)]
pub struct LiveCalibration {
    /// Calibration of the audio input; `None` if the sound comes from a file.
    input: Option<InputCalibration>,
    /// Offset of each output, in the order of the show file.
    offsets: Arc<Mutex<Vec<AtomicMs>>>,
    /// Show file in which the calibration is saved; `None` if the show has none.
    file: Option<Arc<ShowFile>>,
    /// Colours of the groups of pads.
    colours: PadColours,
}

impl LiveCalibration {
    /// Creates the calibration of a show. `input` is `None` if the sound comes from a file.
    /// `offsets` has the offset of each output. `file` is the show file in which the calibration is
    /// saved; `None` if there is none.
    pub fn new(
        input: Option<InputCalibration>,
        offsets: Vec<AtomicMs>,
        file: Option<Arc<ShowFile>>,
    ) -> Self {
        Self {
            input,
            offsets: Arc::new(Mutex::new(offsets)),
            file,
            colours: PadColours::default(),
        }
    }

    /// Returns the latency of the audio input, milliseconds; `None` if the sound comes from a file.
    pub fn input_latency_ms(&self) -> Option<f64> {
        self.input.as_ref().map(|input| input.latency.ms())
    }

    /// Returns true if the audio input is what the computer plays (loopback).
    pub fn is_loopback(&self) -> bool {
        self.input
            .as_ref()
            .is_some_and(|input| input.is_loopback.load(Ordering::Relaxed))
    }

    /// Measures the sound of the audio input since the last call of this method. The list of
    /// channels is empty if no device is open.
    pub fn take_sound(&self) -> InputSound {
        let Some(InputCalibration { channels, .. }) = &self.input else {
            return InputSound::default();
        };
        InputSound {
            is_loopback: self.is_loopback(),
            channels: channels.take_levels(),
            rate_hz: channels.rate_hz(),
            frames: channels.frames(),
        }
    }

    /// Returns the offset of the output with index `output` (from 0), in milliseconds; 0 if there
    /// is no such output.
    pub fn offset_ms(&self, output: usize) -> f64 {
        self.offsets().get(output).map_or(0.0, AtomicMs::ms)
    }

    /// Returns the show file in which the calibration is saved; `None` if the show has none.
    pub fn file(&self) -> Option<&Arc<ShowFile>> {
        self.file.as_ref()
    }

    /// Returns the colours of the groups of pads.
    pub fn colours(&self) -> &PadColours {
        &self.colours
    }

    /// Returns the greatest of the offsets of all outputs, in seconds, but at least 0.
    pub fn offset_s_max(&self) -> f64 {
        self.offsets().iter().map(AtomicMs::ms).fold(0.0, f64::max) / 1000.0
    }

    /// Replaces the offsets after the outputs of the show have changed. `offsets` has the offset of
    /// each new output, in the order of the show file.
    pub fn set_outputs(&self, offsets: Vec<AtomicMs>) {
        *self.offsets() = offsets;
    }

    fn offsets(&self) -> MutexGuard<'_, Vec<AtomicMs>> {
        self.offsets.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Applies `setting`: changes a value, or writes the whole calibration to the show file.
    /// Returns true if the offset of an output was changed, otherwise false.
    ///
    /// # Errors
    /// A sentence with the reason: there is no such output, the sound comes from a file, or the
    /// show file is missing or cannot be written.
    pub fn apply(&self, setting: Setting) -> Result<bool, String> {
        match setting {
            Setting::InputLatency(ms) => self.input()?.latency.set_ms(ms),
            Setting::Channels(chosen) => self.input()?.channels.choose(&chosen),
            Setting::Offset { output, ms } => {
                let offsets = self.offsets();
                let count = offsets.len();
                let offset = offsets.get(output).ok_or_else(|| {
                    format!("there is no output {output}; the show has {count}, numbered from 0")
                })?;
                offset.set_ms(ms.into());
                return Ok(true);
            }
            Setting::Keep => self.keep(self.show_file()?)?,
            Setting::Colour { group, colour } => {
                self.colours.set(group.clone(), colour.clone());
                self.show_file()?
                    .change(|text| colours::write_into(text, &group, &colour))?;
            }
        }
        Ok(false)
    }

    fn show_file(&self) -> Result<&ShowFile, &'static str> {
        self.file
            .as_deref()
            .ok_or("there is no show file to write to; start with `corybant run SHOW.toml`")
    }

    fn input(&self) -> Result<&InputCalibration, String> {
        self.input.as_ref().ok_or_else(|| {
            "the sound comes from a file: its latency and channels cannot be set".into()
        })
    }

    /// Writes the current calibration into the show file, and the offsets of outputs into the files
    /// that have the outputs.
    fn keep(&self, file: &ShowFile) -> Result<(), String> {
        let mut first = 0;
        for path in file.included() {
            file.change_included(&path, |text| {
                let count = tables(text, "output");
                let mut document: DocumentMut = parse(text)?;
                let offsets = self.offsets();
                let last = (first + count).min(offsets.len());
                if count > 0 {
                    write_offsets(document.as_table_mut(), &offsets[first.min(last)..last])?;
                }
                first += count;
                Ok::<_, String>(document.to_string())
            })?;
        }
        file.change(|text| self.write_into(text, first))
    }

    /// Returns `text`, the text of a show file, with the current calibration written into it.
    /// Everything else in the text stays the same. The first `first` outputs are in included files.
    fn write_into(&self, text: &str, first: usize) -> Result<String, String> {
        let mut document = parse(text)?;
        let root = document.as_table_mut();
        if let Some(input) = &self.input {
            input.write_into(root)?;
        }
        let offsets = self.offsets();
        write_offsets(root, offsets.get(first..).unwrap_or_default())?;
        Ok(document.to_string())
    }
}

fn parse(text: &str) -> Result<DocumentMut, String> {
    text.parse()
        .map_err(|error| format!("the text cannot be parsed: {error}"))
}

/// Writes `offsets` into the tables `[[output]]` of `root`, a parsed show file.
fn write_offsets(root: &mut Table, offsets: &[AtomicMs]) -> Result<(), String> {
    if offsets.iter().all(|offset| offset.ms() == 0.0) && root.get("output").is_none() {
        return Ok(());
    }
    let outputs = root
        .get_mut("output")
        .and_then(Item::as_array_of_tables_mut)
        .filter(|tables| tables.len() == offsets.len());
    let outputs: &mut ArrayOfTables = outputs.ok_or_else(|| {
        format!(
            "a section [[output]] is needed for each of the {} outputs, to store their offsets",
            offsets.len()
        )
    })?;
    for (table, offset) in outputs.iter_mut().zip(offsets) {
        if offset.ms() != 0.0 || table.contains_key("offset_ms") {
            put(table, "offset_ms", offset.ms().round() as i64);
        }
    }
    Ok(())
}

impl InputCalibration {
    /// Writes the latency and the selected channels of the audio input into `root`, the parsed show
    /// file. A default value is written only if the show file already contains this setting.
    fn write_into(&self, root: &mut Table) -> Result<(), String> {
        let (ms, chosen) = (self.latency.ms(), self.channels.chosen());
        let is_present = |key: &str| {
            root.get("audio")
                .is_some_and(|audio| audio.get(key).is_some())
        };
        let (writes_latency, writes_channels) = (
            ms != 0.0 || is_present("input_latency_ms"),
            !chosen.is_empty() || is_present("channels"),
        );
        if !writes_latency && !writes_channels {
            return Ok(());
        }
        let audio = root
            .entry("audio")
            .or_insert(Item::Table(Table::new()))
            .as_table_mut();
        let audio = audio
            .ok_or("`audio` is not written as a section [audio]; change that and try again")?;
        if writes_latency {
            put(audio, "input_latency_ms", ms);
        }
        if writes_channels {
            put(
                audio,
                "channels",
                chosen.into_iter().map(i64::from).collect::<Array>(),
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calibration(latency: f64, offsets: &[f64]) -> LiveCalibration {
        LiveCalibration::new(
            Some(InputCalibration {
                latency: AtomicMs::new(latency),
                channels: Channels::new(&[]),
                is_loopback: Arc::default(),
            }),
            offsets.iter().map(|&ms| AtomicMs::new(ms)).collect(),
            None,
        )
    }

    #[test]
    fn only_changed_settings_change_in_the_text() {
        let before = "# My show.\n[audio] # the room\ninput_latency_ms = 29 # ten metres\n\n[[output]]\nkind = 'vmc'\noffset_ms=10 # beamer\n\n[[output]]\nkind = 'plain' # wall\n";
        assert_eq!(
            calibration(29.0, &[10.0, 0.0])
                .write_into(before, 0)
                .unwrap(),
            before
        );
        let expected = before
            .replace("= 29 #", "= 12.5 #")
            .replace("offset_ms=10", "offset_ms=-20")
            .replace("# wall\n", "# wall\noffset_ms = 80\n");
        assert_eq!(
            calibration(12.5, &[-20.0, 80.0])
                .write_into(before, 0)
                .unwrap(),
            expected
        );
        assert_eq!(
            calibration(0.0, &[0.0])
                .write_into("# nothing\n", 0)
                .unwrap(),
            "# nothing\n"
        );
        let third = calibration(0.0, &[0.0]);
        third.apply(Setting::Channels(vec![3])).unwrap();
        assert!(
            third
                .write_into("# nothing\n", 0)
                .unwrap()
                .contains("[audio]\nchannels = [3]\n")
        );
        third.apply(Setting::Channels(vec![])).unwrap();
        assert_eq!(
            third
                .write_into("[audio]\nchannels = [ 3 ] # desk\n", 0)
                .unwrap(),
            "[audio]\nchannels = [] # desk\n"
        );
        assert!(
            calibration(7.0, &[0.0])
                .write_into("# nothing\n", 0)
                .unwrap()
                .contains("[audio]\ninput_latency_ms = 7.0\n")
        );
    }

    #[test]
    fn offsets_go_to_the_files_that_have_the_outputs() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("a.toml"), "[[output]]\n[[output]]\nkind = \"plain\"\n").unwrap();
        std::fs::write(at("show.toml"), "include = [\"a.toml\"]\n[[output]]\n").unwrap();
        let file = ShowFile::new(at("show.toml"), Box::new(|_| Ok(())));
        file.set_included(vec![at("a.toml")]);
        let calibration = calibration(20.0, &[10.0, 0.0, -30.0]);
        calibration.keep(&file).unwrap();
        let text = |name: &str| std::fs::read_to_string(at(name)).unwrap();
        assert_eq!(
            text("a.toml"),
            "[[output]]\noffset_ms = 10\n[[output]]\nkind = \"plain\"\n"
        );
        let main = text("show.toml");
        assert!(main.contains("[[output]]\noffset_ms = -30\n"), "{main}");
        assert!(main.contains("input_latency_ms = 20"), "{main}");
    }

    #[test]
    fn settings_without_a_place_in_the_file_are_refused() {
        let refused =
            |calibration: LiveCalibration, text: &str| calibration.write_into(text, 0).unwrap_err();
        assert!(
            refused(calibration(0.0, &[5.0]), "")
                .contains("a section [[output]] is needed for each of the 1 outputs")
        );
        assert!(
            refused(calibration(0.0, &[5.0, 6.0]), "[[output]]\n")
                .contains("a section [[output]] is needed for each of the 2 outputs")
        );
        assert!(
            refused(calibration(3.0, &[0.0]), "audio = 'mic'\n")
                .contains("`audio` is not written as a section [audio]")
        );
        assert!(refused(calibration(3.0, &[0.0]), "[").contains("the text cannot be parsed"));
        assert!(
            calibration(3.0, &[])
                .apply(Setting::Keep)
                .unwrap_err()
                .contains("no show file")
        );
        assert!(
            calibration(3.0, &[0.0])
                .apply(Setting::Offset { output: 1, ms: 3 })
                .unwrap_err()
                .contains("there is no output 1; the show has 1, numbered from 0")
        );
    }
}
