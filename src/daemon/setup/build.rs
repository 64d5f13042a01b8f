//! Builds a graph from the uploaded motion files. In: the files. Out: a graph file in the temporary
//! folder, and an edit of the show file. Thread: its own, "build", with one worker of rayon, because
//! the show and the sound need the other processors.

use std::sync::Arc;

use tracing::info;

use super::motions::{FOLDER, Progress};
use super::{Setup, document};
use crate::offline::motion_dir::{self, MotionDirError, Options};
use corybant_core::graph::{Graph, build, file};
use corybant_files::Pending;

/// Share of the work after which all motion files are read.
const READ_SHARE: f32 = 0.5;

impl Setup {
    /// Starts to build a graph from the uploaded motion files. Afterwards the show dances it.
    ///
    /// # Errors
    /// A sentence that says why no build starts.
    pub(super) fn start_build(self: &Arc<Self>) -> Result<(), String> {
        self.refresh_motions()?;
        let mut state = self.state();
        if state.motions.is_building() {
            return Err("the motions are already being built".into());
        }
        if state.motions.is_empty() {
            return Err("there are no motion files yet".into());
        }
        state.motions.progress = Progress::Running { share: 0.0 };
        drop(state);
        let setup = self.clone();
        let thread = std::thread::Builder::new().name("build".into());
        let started = thread.spawn(move || setup.build());
        started.map(drop).map_err(|error| {
            let text = format!("cannot start a thread: {error}");
            self.set_progress(Progress::Failed { text: text.clone() });
            text
        })
    }

    fn set_progress(&self, progress: Progress) {
        self.state().motions.progress = progress;
    }

    /// Builds the graph, and stores the result.
    fn build(&self) {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let built = pool
            .map_err(|error| format!("cannot start a thread: {error}"))
            .and_then(|pool| pool.install(|| self.build_graph()))
            .and_then(|graph| self.use_graph(&graph));
        match built {
            Ok(text) => {
                info!("the uploaded motions are built: {text}");
                self.set_progress(Progress::Done { text });
            }
            Err(text) => {
                info!("the uploaded motions cannot be built: {text}");
                self.set_progress(Progress::Failed { text });
            }
        }
    }

    /// Reads the motion files and builds their graph. Stores problems with the files.
    fn build_graph(&self) -> Result<Graph, String> {
        let set_share = |share: f32| self.set_progress(Progress::Running { share });
        let loaded = motion_dir::load(
            &self.folder.path().join(FOLDER),
            &Options::default(),
            &mut |done, of, _| set_share(READ_SHARE * done as f32 / of.max(1) as f32),
        );
        let loaded = loaded.map_err(|error| match error {
            MotionDirError::Empty { skipped, .. } => {
                self.state().motions.set_problems(&skipped);
                "none of the files can be used".to_owned()
            }
            error => error.to_string(),
        })?;
        {
            let mut state = self.state();
            state.motions.set_problems(&loaded.skipped);
            state.motions.warnings = loaded.warnings;
        }
        build::build(loaded.clips, &loaded.graph, &mut |share| {
            set_share(READ_SHARE + (1.0 - READ_SHARE) * share);
        })
        .map_err(|error| error.to_string())
    }

    /// Writes `graph` to a file and lets the show dance it. Returns a description for the user.
    fn use_graph(&self, graph: &Graph) -> Result<String, String> {
        let old = self.text().ok().as_deref().and_then(document::graph_in);
        let names = (1..).map(|number| format!("motions-{number}.graph"));
        let free = |name: &String| !self.folder.path().join(name).exists();
        let name = names.into_iter().find(free).unwrap_or_default();
        let mut pending =
            Pending::create(&self.folder.path().join(&name)).map_err(|error| error.to_string())?;
        pending
            .put_with(|out| file::write(graph, out))
            .map_err(|error| error.to_string())?;
        pending.finish().map_err(|error| error.to_string())?;
        self.change(Box::new(move |text| {
            document::with_graph(text, Some(name.as_ref()))
        }))?;
        if let Some(old) = old.filter(|old| old.is_relative()) {
            // A graph that stays behind is removed with the folder.
            let _ = std::fs::remove_file(self.folder.path().join(old));
        }
        let count = graph.labels.len();
        let plural = if count == 1 { "" } else { "s" };
        Ok(format!(
            "{count} label{plural}: {}",
            graph.labels.join(", ")
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_file_that_cannot_be_read_is_named() {
        let setup = Setup::new("127.0.0.1:0".parse().unwrap(), "default").unwrap();
        assert!(setup.start_build().unwrap_err().contains("no motion files"));
        setup.add_motion("salsa", "a.bvh", b"HIERARCHY\n").unwrap();
        let why = setup.build_graph().unwrap_err();
        assert_eq!(why, "none of the files can be used");
        let json = setup.state().motions.to_json();
        assert_eq!(json["files"][0]["file"], "salsa/a.bvh");
        assert!(
            json["files"][0]["problem"]
                .as_str()
                .is_some_and(|text| text.len() > 5),
            "{json}"
        );
    }

    #[test]
    fn changes_on_the_import_page_are_built() {
        let setup = Setup::new("127.0.0.1:0".parse().unwrap(), "default").unwrap();
        assert!(setup.open_import().is_err(), "there is no import page");
        let salsa = include_bytes!("../../../tests/data/motion/salsa.bvh");
        setup.add_motion("salsa", "a.bvh", salsa).unwrap();
        // The page removes a file, adds another one, and gives it a label.
        setup.set_import(Arc::new(move |folder: &Path| {
            std::fs::remove_file(folder.join("salsa/a.bvh")).unwrap();
            std::fs::write(folder.join("b.bvh"), salsa).unwrap();
            let clips = "[[clip]]\nfile = \"b.bvh\"\nlabel = \"slow\"\n";
            std::fs::write(folder.join("clips.toml"), clips).unwrap();
            Ok("a link".into())
        }));
        assert_eq!(setup.open_import().unwrap(), "a link");
        setup.refresh_motions().unwrap();
        let json = setup.to_json();
        assert_eq!(json["has_import_page"], true);
        let files = serde_json::json!([{ "file": "b.bvh", "problem": null }]);
        assert_eq!(json["motions"]["files"], files);
        assert_eq!(setup.build_graph().unwrap().labels, ["slow"]);
    }

    #[test]
    fn a_zip_brings_its_files_with_their_labels() {
        let setup = Setup::new("127.0.0.1:0".parse().unwrap(), "default").unwrap();
        let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for (name, bytes) in [
            (
                "salsa/a.bvh",
                &include_bytes!("../../../tests/data/motion/salsa.bvh")[..],
            ),
            (
                "twist_2.bvh",
                include_bytes!("../../../tests/data/motion/twist.bvh"),
            ),
            ("con.bvh", b"x"),
        ] {
            let options = zip::write::SimpleFileOptions::default();
            writer.start_file(name, options).unwrap();
            std::io::Write::write_all(&mut writer, bytes).unwrap();
        }
        let zip = writer.finish().unwrap().into_inner();
        setup.add_motion("any", "clips.zip", &zip).unwrap();
        let graph = setup.build_graph().unwrap();
        assert_eq!(graph.labels, ["salsa", "twist"]);
        let json = setup.state().motions.to_json();
        let warnings = json["warnings"].to_string();
        assert!(warnings.contains("clips.zip: con.bvh: "), "{warnings}");
        let why = setup.add_motion("any", "b.zip", b"PK").unwrap_err();
        assert!(why.starts_with("b.zip: "), "{why}");
    }
}
