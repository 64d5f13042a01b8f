//! Reads the motions and builds the graph. In: the folder. Out: the report on the files, the graph
//! file, a dance of the graph. Thread: its own, "import", and rayon's; it ends when nothing is left
//! to do.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use tracing::info;

use super::report::Report;
use super::{Importer, Progress};
use crate::config::Config;
use crate::editor::dance::pack;
use crate::editor::preview_worker::PreviewJob;
use crate::offline::motion_dir::{self, Loaded, MotionDirError, Options};
use corybant_core::beat::offline::Beat;
use corybant_core::cue::list::CueList;
use corybant_core::dsp::SAMPLE_RATE;
use corybant_core::graph::{Graph, build, file};
use corybant_core::show::Cast;
use corybant_files::{Pending, shown};

/// Share of the work of a build after which all motion files are read.
const READ_SHARE: f32 = 0.5;
/// Time between two beats of the shown dance, in seconds.
const BEAT_S: f64 = 0.5;
/// Number of beats for which the shown dance has each label.
const BEATS_PER_LABEL: usize = 8;
/// Smallest and largest number of beats of the shown dance.
const BEATS_MIN: usize = 16;
const BEATS_MAX: usize = 160;

/// What the thread does next.
enum Job {
    Read,
    Build,
}

impl Importer {
    /// Starts to read the motions again, after the current work.
    ///
    /// # Errors
    /// A sentence if the system cannot start a thread.
    pub(super) fn start_reading(self: &Arc<Self>) -> Result<(), String> {
        self.state().must_read = true;
        self.start_working()
    }

    /// Starts to build the graph, after the current work.
    ///
    /// # Errors
    /// A sentence that says why no build starts.
    pub(super) fn start_build(self: &Arc<Self>) -> Result<(), String> {
        let (graph, listing) = {
            let folder = self.folder();
            (folder.graph(), folder.listing()?)
        };
        if listing.entries.is_empty() {
            return Err("there are no motion files yet: drop some here".into());
        }
        if graph.exists() && !motion_dir::is_graph(&graph) {
            return Err(format!(
                "{} exists and is no graph: rename it first, because the graph gets this name",
                shown(&graph)
            ));
        }
        {
            let mut state = self.state();
            if matches!(state.build, Progress::Running { .. }) {
                return Err("the graph is already being built".into());
            }
            state.must_build = true;
            state.is_stale = false;
            state.build = Progress::Running { share: 0.0 };
        }
        self.start_working()
    }

    fn start_working(self: &Arc<Self>) -> Result<(), String> {
        let mut state = self.state();
        if state.is_working {
            return Ok(());
        }
        let importer = self.clone();
        let thread = std::thread::Builder::new().name("import".into());
        let started = thread.spawn(move || importer.work_on_its_cores());
        started.map_err(|error| format!("cannot start a thread: {error}"))?;
        state.is_working = true;
        Ok(())
    }

    /// Does the same as [`Importer::work`], on one core beside a show.
    fn work_on_its_cores(&self) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
        match self.is_beside_show.then(|| pool.build()) {
            Some(Ok(pool)) => pool.install(|| self.work()),
            _ => self.work(),
        }
    }

    /// Does what is wanted until nothing is left to do.
    fn work(&self) {
        while let Some(job) = self.next_job() {
            match job {
                Job::Read => drop(self.read(1.0)),
                Job::Build => {
                    let progress = match self.build() {
                        Ok(text) => Progress::Done { text },
                        Err(text) => Progress::Failed { text },
                    };
                    self.state().build = progress;
                }
            }
        }
    }

    fn next_job(&self) -> Option<Job> {
        let mut state = self.state();
        // A build reads the motions too.
        if std::mem::take(&mut state.must_build) {
            state.must_read = false;
            return Some(Job::Build);
        }
        if std::mem::take(&mut state.must_read) {
            return Some(Job::Read);
        }
        state.is_working = false;
        state.reading = None;
        None
    }

    /// Reads all motions and stores the report on them. `share` is the share of this work in the
    /// progress of a build.
    fn read(&self, share: f32) -> Result<Loaded, MotionDirError> {
        let (path, listing) = {
            let folder = self.folder();
            (folder.path().to_path_buf(), folder.listing())
        };
        let entries = listing.map(|listing| listing.entries).unwrap_or_default();
        let names: Vec<String> = entries.into_iter().map(|entry| entry.file).collect();
        let loaded = motion_dir::load(&path, &Options::default(), &mut |done, of, _| {
            let done = done as f32 / of.max(1) as f32;
            let mut state = self.state();
            state.reading = Some(done);
            if let Progress::Running { share: whole } = &mut state.build {
                *whole = done * share;
            }
        });
        let report = Report::new(&names, &loaded);
        let mut state = self.state();
        state.report = Arc::new(report);
        state.generation += 1;
        state.reading = None;
        loaded
    }

    /// Builds the graph and writes it. Returns a description for the user.
    fn build(&self) -> Result<String, String> {
        let graph_path = self.folder().graph();
        let loaded = self.read(READ_SHARE).map_err(|error| match error {
            MotionDirError::Empty { .. } => "none of the files can be used".into(),
            error => error.to_string(),
        })?;
        let graph = build::build(loaded.clips, &loaded.graph, &mut |share| {
            if let Progress::Running { share: whole } = &mut self.state().build {
                *whole = READ_SHARE + (1.0 - READ_SHARE) * share;
            }
        });
        let graph = graph.map_err(|error| error.to_string())?;
        write(&graph, &graph_path)?;
        info!("wrote {}", shown(&graph_path));
        let (clips, beats) = (graph.clips.len(), graph.nodes.len());
        let labels = graph.labels.clone();
        // Without this dance the page shows the command alone.
        let dance = dance(graph).inspect_err(|why| info!("no dance is shown: {why}"));
        self.state().dance = dance.ok();
        Ok(format!(
            "{clips} clips with {beats} motion beats; {}",
            match labels.len() {
                0 => "no labels".to_owned(),
                1 => format!("1 label: {}", labels[0]),
                count => format!("{count} labels: {}", labels.join(", ")),
            }
        ))
    }
}

/// Writes `graph` to the file `path`, completely or not at all.
fn write(graph: &Graph, path: &Path) -> Result<(), String> {
    let mut pending = Pending::create(path).map_err(|error| error.to_string())?;
    pending
        .put_with(|out| file::write(graph, out))
        .and_then(|()| pending.finish())
        .map_err(|error| error.to_string())
}

/// Returns a dance of `graph` at 120 bpm with each label in turn, packed for the page.
///
/// # Errors
/// A sentence that says why there is no dance.
fn dance(graph: Graph) -> Result<Arc<[u8]>, String> {
    let labels = graph.labels.clone();
    let count = (labels.len() * BEATS_PER_LABEL).clamp(BEATS_MIN, BEATS_MAX);
    let shown = labels.iter().take(count / BEATS_PER_LABEL).enumerate();
    let lines: Vec<String> = shown
        .map(|(number, label)| format!("@{} {label} {BEATS_PER_LABEL}", number * BEATS_PER_LABEL))
        .collect();
    let cues = CueList::parse(&lines.join("\n"), &labels)
        .map_err(|errors| errors.iter().map(ToString::to_string).collect::<String>())?;
    let beat = |number: usize| Beat {
        time: number as f64 * BEAT_S,
        bar_position: (number % 4) as u32,
        beats_per_bar: 4,
        confidence: 1.0,
        energy: 0.5,
        music: true,
        section: None,
        begins_section: false,
    };
    let job = PreviewJob {
        cast: Cast::from(Arc::new(graph)),
        settings: Config::default().show_settings(),
        samples: vec![0.0; (count as f64 * BEAT_S * f64::from(SAMPLE_RATE)) as usize].into(),
        beats: (0..=count).map(beat).collect(),
        first: 0,
        counted_from: 0,
    };
    let dances = job.run(&cues, &AtomicBool::new(false), &mut |_| {})?;
    Ok(pack(0, &dances.unwrap_or_default()).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shown_dance_has_each_label() {
        let motion = |name: &str, bytes: &[u8]| {
            let options = corybant_core::motion::ImportOptions {
                label: Some(name.into()),
                mirror: true,
                ..Default::default()
            };
            corybant_core::motion::analyse(&format!("{name}.bvh"), bytes, &options)
                .unwrap()
                .0
        };
        let clips = vec![
            motion("salsa", include_bytes!("../../tests/data/motion/salsa.bvh")),
            motion("twist", include_bytes!("../../tests/data/motion/twist.bvh")),
        ];
        let graph = build::build(clips, &Default::default(), &mut |_| {}).unwrap();
        let packed = dance(graph).unwrap();
        let length = u32::from_le_bytes(packed[..4].try_into().unwrap()) as usize;
        let header: serde_json::Value = serde_json::from_slice(&packed[4..4 + length]).unwrap();
        let about = &header["dances"][0];
        assert_eq!(about["labels"], serde_json::json!(["salsa", "twist"]));
        let poses = about["poses"].as_u64().unwrap() as usize;
        assert_eq!(poses, BEATS_MIN * 30 + 1);
        let labels = &packed[4 + length + poses * 28..][..2 * poses];
        let label = |pose: usize| i16::from_le_bytes([labels[2 * pose], labels[2 * pose + 1]]);
        assert_eq!((label(120), label(360)), (0, 1));
    }
}
