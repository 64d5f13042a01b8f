//! The motion files that the page has uploaded. In: names and contents. Out: files in the temporary
//! folder, one folder for each label; a list for the page. Thread: any except show and audio.

use std::path::Path;

use serde_json::{Value, json};

use super::Setup;
use crate::offline::motion_dir;
use crate::offline::motion_dir::uploads::{
    self, ALL_BYTES_MAX, FILE_BYTES_MAX, FILES_MAX, checked_file_name, checked_label, is_zip,
};

/// Folder of the motion files in the temporary folder.
pub(super) const FOLDER: &str = "motions";

/// One uploaded file.
struct MotionFile {
    /// Path below the folder of the motion files: `LABEL/NAME`.
    path: String,
    bytes: usize,
    /// Reason why the last build left the file out.
    problem: Option<String>,
}

/// Progress of the last build of a graph.
#[derive(Default)]
pub(super) enum Progress {
    /// There was no build.
    #[default]
    None,
    /// A build runs; `share` of its work is done, 0 to 1.
    Running { share: f32 },
    /// The last build has succeeded; `text` says what the graph contains.
    Done { text: String },
    /// The last build has failed; `text` says why.
    Failed { text: String },
}

/// The uploaded motion files and the progress of their build.
#[derive(Default)]
pub(super) struct Motions {
    files: Vec<MotionFile>,
    pub(super) progress: Progress,
    /// Warnings of the last build.
    pub(super) warnings: Vec<String>,
    /// A sentence for each file in an uploaded ZIP that was not added.
    refused: Vec<String>,
}

impl Motions {
    pub(super) fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    pub(super) fn is_building(&self) -> bool {
        matches!(self.progress, Progress::Running { .. })
    }

    /// Adds the file `path` with `bytes` bytes, or replaces it.
    ///
    /// # Errors
    /// A sentence that says which limit the files would exceed.
    fn add(&mut self, path: &str, bytes: usize) -> Result<(), String> {
        let others = || self.files.iter().filter(|file| file.path != path);
        let all: usize = others().map(|file| file.bytes).sum();
        if bytes > FILE_BYTES_MAX || all + bytes > ALL_BYTES_MAX || others().count() >= FILES_MAX {
            return Err(format!(
                "{path} is not added: a file may have {} MiB, all files {} MiB, and there may be {FILES_MAX} files; for more, use `corybant build`",
                FILE_BYTES_MAX >> 20,
                ALL_BYTES_MAX >> 20
            ));
        }
        self.files.retain(|file| file.path != path);
        self.files.push(MotionFile {
            path: path.into(),
            bytes,
            problem: None,
        });
        self.files.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(())
    }

    /// Stores the reasons in `skipped` (`FILE: REASON` or `FILE, clip CLIP: REASON`) with the files that a build has left out.
    pub(super) fn set_problems(&mut self, skipped: &[String]) {
        for file in &mut self.files {
            let reason = |sentence: &String| {
                let rest = sentence.strip_prefix(&file.path)?;
                Some(rest.trim_start_matches([':', ',', ' ']).to_owned())
            };
            file.problem = skipped.iter().find_map(reason);
        }
    }

    /// Takes `files`, pairs of a path and a number of bytes, as the present files: the import page may
    /// have added and removed files. Known files keep their problems.
    fn set_files(&mut self, files: Vec<(String, usize)>) {
        let mut before = std::mem::take(&mut self.files);
        let file = |(path, bytes): (String, usize)| {
            let known = before.iter_mut().find(|file| file.path == path);
            MotionFile {
                problem: known.and_then(|file| file.problem.take()),
                path,
                bytes,
            }
        };
        self.files = files.into_iter().map(file).collect();
        self.files.sort_by(|a, b| a.path.cmp(&b.path));
    }

    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    pub(super) fn to_json(&self) -> Value {
        let (state, text, share) = match &self.progress {
            Progress::None => ("none", "", 0.0),
            Progress::Running { share } => ("running", "", *share),
            Progress::Done { text } => ("done", text.as_str(), 1.0),
            Progress::Failed { text } => ("failed", text.as_str(), 1.0),
        };
        let files: Vec<Value> = self
            .files
            .iter()
            .map(|file| json!({ "file": file.path, "problem": file.problem }))
            .collect();
        let warnings: Vec<&String> = self.refused.iter().chain(&self.warnings).collect();
        json!({
            "files": files, "state": state, "text": text, "share": share,
            "warnings": warnings,
        })
    }
}

impl Setup {
    /// Adds the motion file `name` with the label `label`; of a ZIP, its motion files with their
    /// own labels.
    ///
    /// # Errors
    /// A sentence that says why the file is not added.
    pub(super) fn add_motion(&self, label: &str, name: &str, bytes: &[u8]) -> Result<(), String> {
        if !is_zip(name) {
            return self.add_file(label, name, bytes);
        }
        let refused = uploads::unzip(bytes, &mut |file| {
            self.add_file(&file.label, &file.name, &file.bytes)
        });
        let refused = refused.map_err(|why| format!("{name}: {why}"))?;
        let named = refused.into_iter().map(|why| format!("{name}: {why}"));
        self.state().motions.refused.extend(named);
        Ok(())
    }

    /// Adds the motion file `name` with the label `label`.
    ///
    /// # Errors
    /// A sentence that says why the file is not added.
    fn add_file(&self, label: &str, name: &str, bytes: &[u8]) -> Result<(), String> {
        let (label, name) = (checked_label(label)?, checked_file_name(name)?);
        let mut state = self.state();
        if state.motions.is_building() {
            return Err("the motions are being built; add files afterwards".into());
        }
        state.motions.add(&format!("{label}/{name}"), bytes.len())?;
        let folder = self.folder.path().join(FOLDER).join(&label);
        std::fs::create_dir_all(&folder)
            .map_err(|error| format!("cannot create the folder of the label {label}: {error}"))?;
        corybant_files::write(&folder.join(&name), bytes).map_err(|error| error.to_string())
    }

    /// Opens the import page for the motion files, and returns the link to it.
    ///
    /// # Errors
    /// A sentence that says why there is no page.
    pub(super) fn open_import(&self) -> Result<String, String> {
        let import = self.state().import.clone();
        let import = import.ok_or("this program has no import page")?;
        let folder = self.folder.path().join(FOLDER);
        std::fs::create_dir_all(&folder)
            .map_err(|error| format!("cannot create the folder of the motions: {error}"))?;
        let link = import(&folder)?;
        self.state().has_import_page = true;
        Ok(link)
    }

    /// Reads which motion files there are, after changes on the import page.
    ///
    /// # Errors
    /// A sentence if the folder cannot be read.
    pub(super) fn refresh_motions(&self) -> Result<(), String> {
        let folder = self.folder.path().join(FOLDER);
        if !self.state().has_import_page || !folder.exists() {
            return Ok(());
        }
        let listing = motion_dir::listing(&folder).map_err(|error| error.to_string())?;
        let size = |path: &str| {
            let found = std::fs::metadata(folder.join(path));
            found.map_or(0, |found| found.len() as usize)
        };
        let files = listing.entries.into_iter().map(|entry| {
            let bytes = size(&entry.file);
            (entry.file, bytes)
        });
        self.state().motions.set_files(files.collect());
        Ok(())
    }

    /// Removes all motion files, and uses the built-in motions again.
    ///
    /// # Errors
    /// Sentences that say why nothing has changed.
    pub(super) fn remove_motions(&self) -> Result<(), String> {
        if self.state().motions.is_building() {
            return Err("the motions are being built; remove them afterwards".into());
        }
        self.change(Box::new(|text| super::document::with_graph(text, None)))?;
        self.state().motions.clear();
        remove_folder(&self.folder.path().join(FOLDER))
    }
}

fn remove_folder(folder: &Path) -> Result<(), String> {
    match std::fs::remove_dir_all(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(format!("cannot remove the motion files: {error}"))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_limited_in_size_and_number() {
        let mut motions = Motions::default();
        assert!(motions.add("a/1.bvh", FILE_BYTES_MAX + 1).is_err());
        for n in 0..8 {
            motions.add(&format!("a/{n}.bvh"), FILE_BYTES_MAX).unwrap();
        }
        assert!(motions.add("a/9.bvh", 1).unwrap_err().contains("512 MiB"));
        motions.add("a/3.bvh", 10).unwrap();
        for n in 9..FILES_MAX + 1 {
            motions.add(&format!("a/{n}.bvh"), 1).unwrap();
        }
        assert!(motions.add("a/one more.bvh", 1).is_err());
        motions.add("a/3.bvh", 11).unwrap();
        motions.set_problems(&["a/3.bvh: no frames".into(), "a/33.bvh: empty".into()]);
        let json = motions.to_json();
        let problems: Vec<&Value> = json["files"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|file| !file["problem"].is_null())
            .collect();
        assert_eq!(problems.len(), 2);
        assert_eq!(
            problems[0],
            &json!({ "file": "a/3.bvh", "problem": "no frames" })
        );
    }
}
