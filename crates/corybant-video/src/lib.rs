//! Renders the video of a dance.
//!
//! In: a show, tick by tick; the beats and the song.
//! Out: an `.mp4`, `.webm` or `.mov` file or a folder of PNG pictures; complete or not at all.
//! Thread: any except show and audio; outputs have their own threads.
//! Allocates: freely.
//!
//! ```text
//! show ─▶ pose_track ─▶ camera, lights, figure ─▶ scene
//!      ─▶ canvas (pictures) ─▶ outputs (ffmpeg, PNG)
//! ```
//! Everything is drawn with wgpu: on a graphics card if there is one, otherwise in software (Mesa's
//! llvmpipe, Windows' WARP). "Picture" means a picture of the video; "frame" always means a motion
//! frame.

pub mod avatar;
#[cfg(feature = "gpu")]
mod avatar_meshes;
#[cfg(feature = "gpu")]
mod backends;
pub mod camera;
#[cfg(feature = "gpu")]
pub mod canvas;
#[cfg(not(feature = "gpu"))]
#[path = "canvas/missing.rs"]
pub mod canvas;
pub mod ffmpeg;
pub mod figure;
#[cfg(feature = "gpu")]
mod gpu;
pub mod lights;
pub mod look;
#[cfg(feature = "gpu")]
mod mesh;
pub mod outputs;
#[cfg(feature = "gpu")]
mod pipelines;
pub mod pose_track;
pub mod scene;
mod view;

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};

use thiserror::Error;

use avatar::Costume;
use camera::CameraKind;
use canvas::Canvas;
use corybant_core::beat::offline::Beat;
use corybant_files::{FileError, describe_io_error};
use look::Look;
use outputs::OutputWriters;
use pose_track::PoseTrack;
use scene::SceneBuilder;

/// The allowed widths and heights of a picture, in pixels. A width or height must also be even,
/// because video formats store colours for blocks of 2 by 2 pixels.
pub const SIDES: RangeInclusive<u32> = 16..=7680;
/// The allowed numbers of pictures per second of a video.
pub const FPS: RangeInclusive<u32> = 1..=240;

/// The reasons why a video cannot be rendered.
#[derive(Debug, Error)]
pub enum VideoError {
    /// The program was built without the Cargo feature `video`.
    #[error(
        "this build cannot draw videos: build corybant with the feature `video`, or write .glb, .bvh or .jsonl"
    )]
    NotBuilt,
    /// The computer has no graphics driver that can render a video.
    #[error(
        "nothing on this machine can draw a video ({reason}): install a Vulkan driver, on Debian `apt install mesa-vulkan-drivers`, which \
         needs no graphics card; the dance alone goes to .glb, .bvh or .jsonl"
    )]
    NoAdapter {
        /// The reason that the graphics library wgpu reports.
        reason: String,
    },
    /// The picture is larger than the graphics driver supports.
    #[error(
        "{name} draws pictures of up to {max} x {max} pixels, not {size}: choose a smaller --size"
    )]
    TooLarge {
        /// Name of the graphics adapter (GPU or software renderer).
        name: String,
        /// The greatest width and height of a picture that the graphics adapter supports, in
        /// pixels.
        max: u32,
        /// The picture size that the user requested.
        size: Size,
    },
    /// The graphics driver failed while drawing.
    #[error("drawing failed on {name}: {reason}")]
    Drawing {
        /// Name of the graphics adapter (GPU or software renderer).
        name: String,
        /// The reason that the driver reports.
        reason: String,
    },
    /// ffmpeg cannot be started.
    #[error(
        "cannot run ffmpeg, which writes {}: {reason}; install it (Debian: apt install ffmpeg, macOS: brew install ffmpeg, Windows: winget \
         install ffmpeg), or write pictures with --frames DIR",
        corybant_files::shown(path)
    )]
    NoFfmpeg {
        /// Path of the video that ffmpeg should write.
        path: PathBuf,
        /// The reason why ffmpeg cannot be started.
        reason: String,
    },
    /// The installed ffmpeg has no encoder that is suitable for the video.
    #[error("this ffmpeg has no encoder {}, which {} needs: install a complete ffmpeg, or write pictures with --frames DIR", wanted.join(" or "), corybant_files::shown(path))]
    NoEncoder {
        /// Path of the video that ffmpeg should write.
        path: PathBuf,
        /// ffmpeg's names of the suitable encoders. One of them must be installed.
        wanted: &'static [&'static str],
    },
    /// ffmpeg ended with an error.
    #[error(
        "cannot write {}: ffmpeg {status}{stderr}",
        corybant_files::shown(path)
    )]
    Ffmpeg {
        /// Path of the video that ffmpeg should write.
        path: PathBuf,
        /// How ffmpeg ended, as a phrase such as "ended with exit status: 1".
        status: String,
        /// The end of ffmpeg's error output on one line, after a colon; empty if there was none.
        stderr: String,
    },
    /// The output folder for pictures cannot be used, for example because it is not empty.
    #[error("cannot write pictures to {}: {reason}", corybant_files::shown(path))]
    Folder {
        /// Path of the output folder.
        path: PathBuf,
        /// The reason why the folder cannot be used, as a phrase.
        reason: &'static str,
    },
    /// The video has a transparent background, and the format of an output has no alpha channel.
    #[error(
        "{} cannot have a transparent background: MP4 has no alpha channel; write .webm, .mov or --frames DIR",
        corybant_files::shown(path)
    )]
    NoAlpha {
        /// Path of the video.
        path: PathBuf,
    },
    /// A file or folder cannot be written.
    #[error(
        "cannot write {}: {}",
        corybant_files::shown(path),
        describe_io_error("write", source)
    )]
    Write {
        /// Path of the file or folder that cannot be written.
        path: PathBuf,
        /// The error that the operating system reported.
        source: std::io::Error,
    },
    /// The video file cannot be created at its temporary path or moved to its final path.
    #[error(transparent)]
    File(#[from] FileError),
    /// The user cancelled the rendering of the video.
    #[error("stopped by a signal; nothing is written")]
    Stopped,
}

/// The width and height of a picture, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Width of the picture in pixels, an even number within [`SIDES`].
    pub width: u32,
    /// Height of the picture in pixels, an even number within [`SIDES`].
    pub height: u32,
}

impl Default for Size {
    fn default() -> Self {
        Self {
            width: 1920,
            height: 1080,
        }
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides = text
            .split_once('x')
            .and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
        let (width, height) = sides.ok_or("two numbers of pixels are needed, such as 1280x720")?;
        match [width, height]
            .into_iter()
            .find(|side| !SIDES.contains(side) || side % 2 != 0)
        {
            Some(side) => Err(format!(
                "{side} pixels: even numbers from {} to {} are allowed",
                SIDES.start(),
                SIDES.end()
            )),
            None => Ok(Self { width, height }),
        }
    }
}

/// Returns the value of the name `text` in `names`. The error lists the allowed names.
fn find_name<T: Copy>(text: &str, names: &[(&str, T)]) -> Result<T, String> {
    let found = names.iter().find(|(name, _)| *name == text);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let allowed: Vec<&str> = names.iter().map(|(name, _)| *name).collect();
        format!("allowed: {}", allowed.join(", "))
    })
}

/// Picture size and picture rate of a video, its camera and its look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Width and height of the pictures.
    pub size: Size,
    /// Number of pictures per second, within [`FPS`].
    pub fps: u32,
    /// The camera that shows the dance.
    pub camera: CameraKind,
    /// The colours of stage and lights.
    pub look: Look,
    /// What is behind the dancers.
    pub background: Background,
}

/// What a video shows behind the dancers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Background {
    /// The stage: floor, backdrop and lights.
    #[default]
    Stage,
    /// Nothing: the pictures have an alpha channel and contain the dancers only.
    Transparent,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            size: Size::default(),
            fps: 60,
            camera: CameraKind::default(),
            look: Look::default(),
            background: Background::default(),
        }
    }
}

/// A file or folder to which a video is written. The variant is the format; its field is the path.
#[derive(Clone, Debug, PartialEq)]
pub enum Output {
    /// A file in MP4 format, with H.264 video and AAC sound.
    Mp4(PathBuf),
    /// A file in WebM format, with VP9 or VP8 video and Opus or Vorbis sound.
    Webm(PathBuf),
    /// A file in QuickTime format, with Apple ProRes video and uncompressed sound, for programs that cut
    /// videos.
    Mov(PathBuf),
    /// A folder of numbered PNG files, one for each picture, without sound.
    Frames(PathBuf),
}

impl Output {
    /// Returns the path of the output file or folder.
    pub fn path(&self) -> &Path {
        match self {
            Self::Mp4(path) | Self::Webm(path) | Self::Mov(path) | Self::Frames(path) => path,
        }
    }
}

/// The renderer of a video, with the picture size, the outputs and the graphics adapter.
/// `Renderer::open` checks all of these, so that errors appear before the dance is computed.
pub struct Renderer {
    settings: Settings,
    outputs: Vec<Output>,
    canvas: Canvas,
}

impl Renderer {
    /// Opens the graphics adapter, and checks that ffmpeg has the encoders and that the output
    /// paths can be written.
    ///
    /// # Errors
    /// [`VideoError`] if an adapter, ffmpeg or an encoder is missing, or if a path cannot be
    /// written.
    pub fn open(settings: Settings, outputs: Vec<Output>) -> Result<Self, VideoError> {
        outputs
            .iter()
            .try_for_each(|output| outputs::check(output, settings.background))?;
        Ok(Self {
            settings,
            canvas: Canvas::open(settings.size, settings.background)?,
            outputs,
        })
    }

    /// Returns the picture size and picture rate of the video.
    pub fn settings(&self) -> Settings {
        self.settings
    }

    /// Returns the name of the graphics adapter (GPU or software renderer).
    pub fn adapter_name(&self) -> &str {
        self.canvas.name()
    }

    /// Renders the dance in `track` with the beats and the song of `job`. The outputs are complete
    /// afterwards, but still at temporary paths; [`OutputWriters::finish`] moves them to their
    /// final paths.
    ///
    /// # Errors
    /// [`VideoError`] if drawing or writing fails, or if the job's `stop` is set. In these cases no
    /// output is written.
    pub fn draw(
        mut self,
        mut track: PoseTrack,
        job: &RenderJob,
    ) -> Result<OutputWriters, VideoError> {
        let pictures = track.pictures();
        let mut builder = SceneBuilder::new(&mut track, job.beats, self.settings, job.costumes);
        self.canvas.dress(&builder.avatars())?;
        let mut writers = OutputWriters::open(&self.outputs, self.settings, job.song)?;
        let mut drawn = 0;
        for picture in 0..pictures {
            if job.stop.load(Ordering::Relaxed) {
                return Err(VideoError::Stopped);
            }
            let lit_radius = builder.lit_radius();
            self.canvas.begin(builder.scene(picture), lit_radius)?;
            while self.canvas.is_full() {
                self.write_next(&mut writers, &mut drawn)?;
            }
            (job.progress)((picture + 1) as f64 / pictures as f64);
        }
        while self.write_next(&mut writers, &mut drawn)? {}
        writers.close(job.stop)?;
        Ok(writers)
    }

    /// Waits for the oldest picture that is still being rendered and sends it to `writers` as
    /// picture number `drawn`. Then increases `drawn`. Returns false if no picture is being
    /// rendered.
    fn write_next(
        &mut self,
        writers: &mut OutputWriters,
        drawn: &mut usize,
    ) -> Result<bool, VideoError> {
        let Some(pixels) = self.canvas.finish()? else {
            return Ok(false);
        };
        writers.write(*drawn, &pixels)?;
        *drawn += 1;
        Ok(true)
    }
}

/// The beats and the song of one video, a flag that cancels the rendering, and a function that
/// receives the progress.
pub struct RenderJob<'a> {
    /// The beats of the song, in ascending order of time.
    pub beats: &'a [Beat],
    /// The avatars of the dancers, in their order; a dancer without one has a plain figure.
    pub costumes: &'a [Option<Costume>],
    /// Path of the music file whose sound the video gets.
    pub song: &'a Path,
    /// A flag that another thread sets to true to cancel the rendering.
    pub stop: &'a AtomicBool,
    /// A function that is called after each picture with the fraction of the pictures that are
    /// done, 0..1.
    pub progress: &'a dyn Fn(f64),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_even_and_in_words() {
        assert_eq!(
            "1280x720".parse(),
            Ok(Size {
                width: 1280,
                height: 720
            })
        );
        assert_eq!(
            "1280x721".parse::<Size>().unwrap_err(),
            "721 pixels: even numbers from 16 to 7680 are allowed"
        );
        assert_eq!(
            "8x720".parse::<Size>().unwrap_err(),
            "8 pixels: even numbers from 16 to 7680 are allowed"
        );
        for wrong in [
            "",
            "1280",
            "1280x",
            "x720",
            "-2x20",
            "1280*720",
            "99999999999x2",
        ] {
            assert_eq!(
                wrong.parse::<Size>().unwrap_err(),
                "two numbers of pixels are needed, such as 1280x720",
                "{wrong}"
            );
        }
    }
}
