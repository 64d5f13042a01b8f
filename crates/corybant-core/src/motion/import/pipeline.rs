//! Imports motion files: from bytes to clips that the graph builder accepts.
//!
//! In: bytes and options.
//! Out: clips, cleaned and analysed.
//! Thread: any.
//! Allocates: freely.
//!
//! Every motion, including the built-in ones, passes these four steps: [`import_file`] for each
//! file, [`super::clean::harmonise`] for all clips together, [`find_beats`] for each clip on the
//! skeleton of its file, and [`finish`] for each clip on its final skeleton. Beats are detected
//! before retargeting because users name joints of the file's skeleton.

use thiserror::Error;

use super::clean::{self, CleanError, Cleaned, Unit, Up};
use super::cut::{CutError, Span};
use super::{ReadError, Siblings, Source, beats, plant, read, retarget};
use crate::motion::{Analysed, MotionBeats, Skeleton, contact};

/// The options with which one motion file is imported; they are the same for all clips of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportOptions {
    /// Label that the imported clips get, such as `salsa`; `None` for clips without a label.
    pub label: Option<String>,
    /// True if the imported clips are idle clips, which are danced while no music plays.
    pub idle: bool,
    /// True if the label is danced only while a cue asks for it.
    pub on_request: bool,
    /// Number of frames per second that replaces the frame rate in the file; `None` keeps the rate
    /// in the file.
    pub fps: Option<f64>,
    /// The unit of length in the motion file. With `None`, it is the unit in which the height of
    /// the body is most plausible.
    pub unit: Option<Unit>,
    /// Length of one unit of the motion file, in metres. It takes precedence over `unit`.
    pub scale: Option<f32>,
    /// The axis that points up in the motion file. With `None`, it is derived from the motion.
    pub up: Option<Up>,
    /// Span of the file's time that is imported; the rest is cut off before anything else.
    pub span: Span,
    /// True if the mirror image of each clip is danced too.
    pub mirror: bool,
    /// The settings with which the clips are cleaned. The options `fps`, `unit`, `scale` and `up` of
    /// the import take precedence over the settings of the same names.
    pub clean: clean::Settings,
    /// The settings with which beats are detected in the clips.
    pub beats: beats::Settings,
}

/// The reasons why a motion file cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum MotionError {
    /// The motion file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The span of time that is imported has no frames.
    #[error(transparent)]
    Cut(#[from] CutError),
    /// A clip of the motion file cannot be cleaned.
    #[error(transparent)]
    Clean(#[from] CleanError),
    /// A clip cannot be transferred to the skeleton of a motion graph.
    #[error("{reason}")]
    OtherSkeleton {
        /// The reason, as words for a message.
        reason: String,
    },
}

/// Reads all motions of one file and cleans each of them separately. `name` is the name of the
/// file; `siblings` returns other files of the same folder. Returns at least one clip.
///
/// # Errors
/// [`MotionError`] if the file cannot be read, if a motion has no frame in the span of
/// `options`, if a motion cannot be cleaned, or if no clip is left.
pub fn import_file(
    name: &str,
    bytes: &[u8],
    siblings: Siblings,
    options: &ImportOptions,
) -> Result<Vec<Cleaned>, MotionError> {
    let settings = clean::Settings {
        fps: options.fps.or(options.clean.fps),
        unit: options
            .unit
            .or(options.clean.unit.filter(|_| options.scale.is_none())),
        scale: options
            .scale
            .or(options.clean.scale.filter(|_| options.unit.is_none())),
        up: options.up.or(options.clean.up),
        ..options.clean.clone()
    };
    let mut imported = Vec::new();
    for source in read(name, bytes, siblings)? {
        let Source {
            mut clip,
            warnings,
            about_file,
            axes,
        } = source;
        clip.label.clone_from(&options.label);
        clip.idle = options.idle;
        clip.on_request = options.on_request;
        options.span.cut(&mut clip, settings.fps)?;
        let mut parts = clean::clean_with_axes(clip, axes, &settings)?;
        if let Some(first) = parts.first_mut() {
            first.steps.splice(..0, warnings.iter().cloned());
            first.warnings.splice(..0, warnings);
            first.about_file = about_file;
        }
        imported.append(&mut parts);
    }
    if imported.is_empty() {
        Err(CleanError::Empty { clip: name.into() }.into())
    } else {
        Ok(imported)
    }
}

/// Detects the beats of a cleaned clip, also in further components of its motion. Must be called after [`super::clean::harmonise`] and before
/// retargeting, because `options.beats` names joints of the file's skeleton.
///
/// A motion without beats is not an error: the function adds a warning to the clip and returns
/// `None`.
pub fn find_beats(cleaned: &mut Cleaned, options: &ImportOptions) -> Option<MotionBeats> {
    let skeleton = &cleaned.clip.skeleton;
    let unknown: Vec<&str> = options
        .beats
        .joints
        .iter()
        .map(String::as_str)
        .filter(|joint| skeleton.find(joint).is_none())
        .collect();
    if !unknown.is_empty() {
        let unknown = unknown.join(", ");
        cleaned.warn(format!("its beats are to be found in {unknown}, which its skeleton does not have, or not below the hips"));
    }
    let (beats, tried) = beats::analyse_components(&cleaned.clip, &options.beats);
    let first = options.beats.component;
    match &beats {
        None => cleaned.warn(format!(
            "there is no beat in it: nothing moves, or only once (tried: components {first} to {tried} of the motion)"
        )),
        Some(it) if tried > first && it.frames.len() > 1 => cleaned.step(format!(
            "component {first} of the motion has fewer than two beats, so the beats are those of component {tried}"
        )),
        Some(_) => {}
    }
    beats
}

/// Finishes the import of a clip: detects the ground contacts of its feet, and plants the feet that
/// creep while they stand. Must be called after all
/// retargeting. Returns the analysed clip with `beats`, and the warnings of all cleaning steps.
pub fn finish(
    cleaned: Cleaned,
    beats: Option<MotionBeats>,
    options: &ImportOptions,
) -> (Analysed, Vec<String>) {
    let Cleaned {
        mut clip,
        trimmed,
        spikes,
        steps,
        warnings,
        ..
    } = cleaned;
    let contacts = contact::contacts(&clip);
    plant::plant(&mut clip, &contacts);
    (
        Analysed {
            clip,
            beats,
            trimmed,
            spikes,
            steps,
            contacts,
            mirror: options.mirror,
        },
        warnings,
    )
}

/// Reads, cleans and analyses a single motion file. Returns the clip and its warnings. If the file
/// has several motions, or if a motion is split, only the first clip is returned.
///
/// # Errors
/// The errors of [`import_file`].
pub fn analyse(
    name: &str,
    bytes: &[u8],
    options: &ImportOptions,
) -> Result<(Analysed, Vec<String>), MotionError> {
    let (cleaned, beats) = import_first(name, bytes, options)?;
    Ok(finish(cleaned, beats, options))
}

/// Does the same as [`analyse`] and transfers the clip to `skeleton`, that of a motion graph.
///
/// # Errors
/// The errors of [`import_file`], and [`MotionError::OtherSkeleton`] if the clip cannot be
/// transferred.
pub fn analyse_onto(
    skeleton: &Skeleton,
    (name, bytes): (&str, &[u8]),
    options: &ImportOptions,
) -> Result<(Analysed, Vec<String>), MotionError> {
    let (mut cleaned, beats) = import_first(name, bytes, options)?;
    retarget::onto(&mut cleaned, skeleton, "the graph")
        .map_err(|reason| MotionError::OtherSkeleton { reason })?;
    Ok(finish(cleaned, beats, options))
}

/// Imports the first clip of a motion file, and detects its beats.
fn import_first(
    name: &str,
    bytes: &[u8],
    options: &ImportOptions,
) -> Result<(Cleaned, Option<MotionBeats>), MotionError> {
    let mut imported = import_file(name, bytes, &|_| None, options)?;
    imported.truncate(1);
    clean::harmonise(&mut imported);
    let mut first = imported
        .pop()
        .ok_or_else(|| CleanError::Empty { clip: name.into() })?;
    let beats = find_beats(&mut first, options);
    Ok((first, beats))
}
