//! The arguments of the commands that dance to a music file: rehearse, render and score. In: the
//! command line. Out: the settings, the dancers and the beat times, or an error. Thread: main.

use std::error::Error;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use super::files::add_show_inputs;
use super::{BeatTimes, check_labels, find_cast, read_beats, read_config};
use crate::config::Config;
use corybant_core::show::Cast;
use corybant_files::Places;

/// The music file of a command, and the files that decide how the dancers dance to it.
#[derive(clap::Args, Debug)]
pub(in crate::cli) struct SongArgs {
    /// Music file: wav, flac, ogg or mp3
    pub(in crate::cli) audio: PathBuf,
    /// Show file (TOML) [default: built-in repertoire]
    show: Option<PathBuf>,
    /// Motion graph made by `corybant build`
    #[arg(long)]
    graph: Option<PathBuf>,
    /// Text file with beat times in seconds, one per line, instead of the tracker
    #[arg(long)]
    beats: Option<PathBuf>,
}

impl SongArgs {
    /// Reads the settings of the show file. The song determines the tempo, so scenes select no tempo
    /// source.
    ///
    /// # Errors
    /// The show file cannot be read or has problems.
    pub(in crate::cli) fn config(&self) -> Result<Config, Box<dyn Error>> {
        let mut config = read_config(self.show.as_deref())?;
        for scene in &mut config.scene {
            scene.tempo_source = None;
        }
        Ok(config)
    }

    /// Returns the arguments with which this program renders the same song.
    pub(in crate::cli) fn render_arguments(&self) -> Vec<OsString> {
        let mut arguments: Vec<OsString> = vec!["render".into()];
        for (option, path) in [("--graph", &self.graph), ("--beats", &self.beats)] {
            if let Some(path) = path {
                arguments.extend([option.into(), path.into()]);
            }
        }
        // A path that begins with a hyphen is not an option after `--`, but options follow.
        let place = |path: &Path| match path.is_relative() {
            true => Path::new(".").join(path).into_os_string(),
            false => path.into(),
        };
        arguments.push(place(&self.audio));
        arguments.extend(self.show.as_deref().map(place));
        arguments
    }

    /// Returns the paths of all input files, so that the command can refuse to write an output file
    /// over one of them. `cues` is the path of the cue list; `None` if there is none.
    pub(in crate::cli) fn inputs(&self, cues: Option<&Path>, config: &Config) -> Places {
        let mut places = Places::default();
        places.reads("the music file", &self.audio);
        let optional = [
            ("the cue list", cues),
            ("the beat times", self.beats.as_deref()),
        ];
        for (what, path) in optional {
            path.iter().for_each(|path| places.reads(what, path));
        }
        let (show, graph) = (self.show.as_deref(), self.graph.as_deref());
        add_show_inputs(&mut places, show, graph, config);
        places
    }

    /// Creates the dancers of the show and checks that each label in the show file exists in one of
    /// their graphs.
    ///
    /// # Errors
    /// A graph file cannot be read, the graphs do not match the dancers, or a label is in no graph.
    pub(in crate::cli) fn cast(&self, config: &Config) -> Result<Cast, Box<dyn Error>> {
        let show = self.show.as_deref();
        let cast = find_cast(self.graph.as_deref(), show, config)?;
        check_labels(show, config, &cast)?;
        Ok(cast)
    }

    /// Reads the beat times of `--beats`; `None` without this option.
    ///
    /// # Errors
    /// The file cannot be read, or a line does not start with a number of seconds.
    pub(in crate::cli) fn beat_times(&self) -> Result<Option<BeatTimes<'_>>, Box<dyn Error>> {
        self.beats.as_deref().map(read_beats).transpose()
    }
}
