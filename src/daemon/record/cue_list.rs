//! Records the cues of a show as a cue list (`--record-cues`). In: cues from the show thread. Out:
//! a file, put in place when the show has ended. Thread: main.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crossbeam::queue::ArrayQueue;

use crate::rt::show_names::NamesReader;
use corybant_core::cue::Cue;
use corybant_core::cue::recorder::{Recorder, TakenAt};
use corybant_files::{FileError, Pending};

/// Capacity of the queue of cues that wait to be written.
const CUES_MAX: usize = 1024;

/// A recording of the cues of a running show as a cue list file.
pub struct CueRecording {
    path: PathBuf,
    file: Pending,
    recorder: Recorder,
    /// Names of the labels, which new motion graphs change.
    names: NamesReader,
    /// Queue of the cues that the show thread has processed. Each cue has the time and beat at
    /// which it was processed.
    queue: Arc<ArrayQueue<(TakenAt, Cue)>>,
    /// First error that occurred while the file was written; `None` if all writes succeeded.
    error: Option<std::io::Error>,
}

impl CueRecording {
    /// Creates a recording whose file appears at `path` when the recording is finished. `labels`
    /// are the labels of the show, indexed by label number.
    ///
    /// # Errors
    /// [`FileError`] if a file cannot be written at `path`.
    pub fn create(path: &Path, labels: &[String]) -> Result<Self, FileError> {
        let queue = Arc::new(ArrayQueue::new(CUES_MAX));
        let (file, recorder) = (Pending::create(path)?, Recorder::new(labels));
        Ok(Self {
            path: path.into(),
            file,
            recorder,
            names: NamesReader::fixed(labels, &[]),
            queue,
            error: None,
        })
    }

    /// Returns this recording with the scenes of `names`, and its labels, which new motion graphs
    /// change.
    pub(super) fn with_names(mut self, names: NamesReader) -> Self {
        self.recorder = self.recorder.with_scenes(&names.seen().scenes);
        self.recorder.set_labels(&names.seen().pads);
        self.names = names;
        self
    }

    /// Returns the queue into which the show thread pushes each processed cue, with the time and
    /// beat at which it was processed.
    pub(super) fn queue(&self) -> Arc<ArrayQueue<(TakenAt, Cue)>> {
        self.queue.clone()
    }

    /// Takes all cues from the queue and writes them to the file.
    pub(super) fn write(&mut self) {
        if self.names.update() {
            self.recorder.set_labels(&self.names.seen().pads);
        }
        while let Some((at, cue)) = self.queue.pop() {
            let line = self.recorder.line(at, cue);
            self.write_lines(line);
        }
    }

    fn write_lines(&mut self, lines: impl IntoIterator<Item = String>) {
        for line in lines {
            if let Err(error) = writeln!(self.file, "{line}") {
                self.error.get_or_insert(error);
            }
        }
    }

    /// Writes the cues that still wait in the queue and moves the file to its final path. `end` is
    /// the time and beat at which the show ended.
    ///
    /// # Errors
    /// [`FileError`] of the first write that failed.
    pub(super) fn finish(mut self, end: TakenAt) -> Result<(), FileError> {
        self.write();
        let lines = self.recorder.finish(end);
        self.write_lines(lines);
        match self.error {
            Some(source) => Err(FileError::System {
                action: "write",
                path: self.path,
                source,
            }),
            None => self.file.finish(),
        }
    }
}
