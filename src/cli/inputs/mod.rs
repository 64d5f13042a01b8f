//! Reads the inputs that several commands share: show files, graphs, cue lists, beat times. In:
//! paths. Out: checked values, or an error with the file and the remedy. Thread: main.

pub(in crate::cli) mod files;
pub(in crate::cli) mod song;

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::audio::file::has_music_ending;
use crate::audio::input::FILE_PREFIX;
use crate::cli::Outcome;
use crate::config::graphs::read_graph;
use crate::config::song::{LoadedSongs, load};
use crate::config::{Config, ConfigError};
use corybant_core::beat::BeatError;
use corybant_core::cue::CueNames;
use corybant_core::cue::list::CueList;
use corybant_core::graph::Graph;
use corybant_core::show::{Cast, ShowError};
use corybant_core::text::one_line_each;
use corybant_files::shown;

/// Largest text file that is read, in MiB; a larger one is refused.
const TEXT_MIB_MAX: u64 = 16;

/// Reads and checks the show file at `path`; returns the default settings if `path` is `None`.
///
/// # Errors
/// The path names a music file, or the file cannot be read, is not UTF-8 text, or has problems
/// ([`ConfigError`]).
pub(in crate::cli) fn read_config(path: Option<&Path>) -> Result<Config, Box<dyn Error>> {
    let Some(path) = path else {
        return Ok(Config::default());
    };
    if has_music_ending(path) {
        let path = shown(path);
        return Err(format!(
            "{path} is a music file, and a show file (TOML) is needed here; to dance to the music, type `corybant run --input \"{FILE_PREFIX}{path}\"`"
        )
        .into());
    }
    let text = read_text(path)?;
    let config = Config::load(path, &text)?.in_folder(folder_of(path));
    Ok(Config {
        file: Some((path.into(), text)),
        ..config
    })
}

pub(in crate::cli) fn folder_of(show: &Path) -> &Path {
    show.parent().unwrap_or(Path::new(""))
}

pub(in crate::cli) fn read_text(path: &Path) -> Result<String, Box<dyn Error>> {
    let bytes = corybant_files::read(path, TEXT_MIB_MAX)?;
    corybant_files::text(bytes)
        .map_err(|error| format!("cannot read {}: {error}", shown(path)).into())
}

/// Creates the dancers of a show with their graphs. A dancer's graph is the one in its `[[dancer]]`
/// section, otherwise `option` (`--graph`), otherwise the one in the section `[graph]`, otherwise
/// the built-in repertoire. Paths in the show file are relative to its folder.
///
/// # Errors
/// A graph file cannot be read, or [`ShowError`] if the graphs and dancers do not match.
pub(in crate::cli) fn find_cast(
    option: Option<&Path>,
    show: Option<&Path>,
    config: &Config,
) -> Result<Cast, Box<dyn Error>> {
    let mut graphs: BTreeMap<Option<PathBuf>, Arc<Graph>> = BTreeMap::new();
    let mut dancers = Vec::with_capacity(config.dancer.len());
    for (dancer, file) in config.dancer.iter().zip(graph_files(option, show, config)) {
        let graph = match graphs.get(&file) {
            Some(graph) => graph.clone(),
            None => {
                let graph = Arc::new(read_graph(file.as_deref())?);
                graphs.insert(file, graph.clone());
                graph
            }
        };
        dancers.push((dancer.clone(), graph));
    }
    Ok(Cast::new(dancers)?.with_scenes(&config.scene))
}

/// Reads what the songs of the show file `show` name. `config` are its settings, and `cast` are its
/// dancers. Returns the songs, and the cast with the pads of all their graphs.
///
/// # Errors
/// [`ConfigError`] with one problem for each file or label that does not exist.
pub(in crate::cli) fn load_songs(
    show: Option<&Path>,
    config: &Config,
    cast: &Cast,
) -> Result<(LoadedSongs, Cast), ConfigError> {
    let (name, folder) = show.map_or((String::new(), Path::new("")), |show| {
        (shown(show), folder_of(show))
    });
    load(config, folder, cast).map_err(|sentences| ConfigError {
        problems: sentences
            .iter()
            .map(|sentence| config.files.located(&name, sentence))
            .collect(),
    })
}

/// Returns the path of each dancer's graph file; see [`Config::graph_files`]. `show` is the path of
/// the show file.
pub(in crate::cli) fn graph_files(
    option: Option<&Path>,
    show: Option<&Path>,
    config: &Config,
) -> Vec<Option<PathBuf>> {
    config.graph_files(option, show.map_or(Path::new(""), folder_of))
}

/// Checks that each label in the show file `show` exists in the graph of at least one dancer. Does
/// nothing if `show` is `None`.
///
/// # Errors
/// [`ConfigError`] with one problem for each label that no dancer has.
pub(in crate::cli) fn check_labels(show: Option<&Path>, config: &Config, cast: &Cast) -> Outcome {
    let Some(show) = show else {
        return Ok(());
    };
    let mut problems = Vec::new();
    config.check_labels(cast.pads(), &mut problems);
    if problems.is_empty() {
        return Ok(());
    }
    let name = shown(show);
    Err(Box::new(ConfigError {
        problems: problems
            .iter()
            .map(|it| config.files.located(&name, it))
            .collect(),
    }))
}

/// Reads the cue list at `path` for a show with these labels and scenes; returns an empty list if
/// `path` is `None`.
///
/// # Errors
/// The file cannot be read, or lines of the list are invalid. The message has one line for each
/// invalid line.
pub(in crate::cli) fn read_cue_list(
    path: Option<&Path>,
    names: CueNames,
) -> Result<CueList, Box<dyn Error>> {
    let Some(path) = path else {
        return Ok(CueList::default());
    };
    let list = CueList::parse(&read_text(path)?, names);
    list.map_err(|errors| lines_in_file(path, &errors).into())
}

/// Returns the message about `problems` in the file at `path`: one line for each problem. Each line
/// begins with the path.
pub(in crate::cli) fn lines_in_file(path: &Path, problems: &[impl Display]) -> String {
    let lines: Vec<String> = problems
        .iter()
        .map(|problem| format!("{}: {problem}", shown(path)))
        .collect();
    one_line_each(&lines)
}

/// Times of the beats of a song, read from a file (`--beats`).
pub(in crate::cli) struct BeatTimes<'a> {
    path: &'a Path,
    /// Time of each beat, seconds.
    pub(in crate::cli) times: Vec<f64>,
    /// For each beat, the number of its line in the file, counted from 1.
    lines: Vec<usize>,
}

/// Reads beat times in seconds from the file `path`: the first number of each line. Empty lines and
/// comments after `#` are ignored.
///
/// # Errors
/// The file cannot be read, or a line does not start with a number of seconds.
pub(in crate::cli) fn read_beats(path: &Path) -> Result<BeatTimes<'_>, Box<dyn Error>> {
    let mut beats = BeatTimes {
        path,
        times: Vec::new(),
        lines: Vec::new(),
    };
    let text = read_text(path)?;
    for (i, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let Some(word) = line
            .split('#')
            .next()
            .and_then(|line| line.split_whitespace().next())
        else {
            continue;
        };
        let time = word.parse::<f64>().ok().filter(|time| time.is_finite());
        beats.times.push(time.ok_or_else(|| {
            format!(
                "{}:{}: `{word}` is no beat time: a number of seconds is needed",
                shown(path),
                i + 1
            )
        })?);
        beats.lines.push(i + 1);
    }
    Ok(beats)
}

/// Converts `error` to a message. If the error is about the beat times in `beats`, the message
/// begins with the path of their file and, if possible, with the number of the line. Other errors
/// are returned unchanged.
pub(in crate::cli) fn locate_beat_error(
    error: ShowError,
    beats: Option<&BeatTimes>,
) -> Box<dyn Error> {
    let (ShowError::Beat(problem), Some(beats)) = (&error, beats) else {
        return error.into();
    };
    let name = shown(beats.path);
    match problem {
        BeatError::BeatTime { line, .. } | BeatError::BeatOrder { line, .. } => {
            match beats.lines.get(line.saturating_sub(1)) {
                Some(line) => format!("{name}:{line}: {problem}").into(),
                None => format!("{name}: {problem}").into(),
            }
        }
        BeatError::NoBeats => format!("{name}: {problem}").into(),
        _ => error.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Windows PowerShell 5 writes UTF-16 with `>`, and UTF-8 with a byte order mark with
    /// `Out-File -Encoding utf8`.
    #[test]
    fn beats_that_powershell_wrote_are_read_or_explained() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("beats.txt");
        let text = "\u{feff}0.5 0.98 120\r\n1.0 0.98 120\r\n";
        std::fs::write(&path, text).unwrap();
        assert_eq!(read_beats(&path).unwrap().times, [0.5, 1.0]);
        let utf16: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        std::fs::write(&path, utf16).unwrap();
        let error = read_beats(&path).map(|beats| beats.times).unwrap_err();
        assert!(error.to_string().contains("beats.txt: it is UTF-16 text"));
    }
}
