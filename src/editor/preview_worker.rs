//! Previews for the page: a preview is the dance of a cue list over the whole song. A new request
//! replaces the one in progress. In: cue lists. Out: packed dances, the progress of the current
//! preview. Thread: its own, "preview", and rayon's; it ends when the [`PreviewWorker`] is dropped.
//!
//! The worker plans like `corybant render`, so the preview equals the rendered dance.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use serde_json::{Value, json};

use super::dance::{Dance, Moment, pack};
use corybant_core::beat::offline::Beat;
use corybant_core::beat::tracker::BeatSource;
use corybant_core::cue::list::CueList;
use corybant_core::dsp::SAMPLE_RATE;
use corybant_core::graph::Attribute;
use corybant_core::motion::{MOTION_FPS, Pose};
use corybant_core::show::script::{self, Song};
use corybant_core::show::{Cast, Settings, Show, TICK_HZ};
use corybant_core::time::Seconds;

/// Progress (0 to 1) of a preview when its dance is planned but its poses are not computed yet.
const PLANNING_SHARE: f64 = 0.5;

/// Dancers, settings and song of an editor session, from which the dance of any cue list can be
/// computed.
#[derive(Clone)]
pub struct PreviewJob {
    /// The dancers with their graphs.
    pub cast: Cast,
    /// Settings of the show, such as planning and tempo.
    pub settings: Settings,
    /// Samples of the song, mono at [`SAMPLE_RATE`].
    pub samples: Arc<[f32]>,
    /// All beats of the song, in ascending order.
    pub beats: Vec<Beat>,
    /// Number that the show gives to the first beat in `beats`; the later beats are numbered
    /// upwards.
    pub first: i64,
    /// Index in `beats` of the beat that is beat 0 in the cue list.
    pub counted_from: usize,
}

impl PreviewJob {
    /// Computes the dance of each dancer with the cue list `cues`. Calls `progress` with the
    /// progress, 0 to 1. Returns `None` if `stop` becomes true before the end.
    ///
    /// # Errors
    /// A message that says why the dance cannot be planned.
    pub fn run(
        &self,
        cues: &CueList,
        stop: &AtomicBool,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Option<Vec<Dance>>, String> {
        let song = Song {
            beats: &self.beats,
            first: self.first,
            counted_from: self.counted_from,
        };
        let scripts = script::write(&self.cast, &self.settings.plan, &song, cues, &mut |done| {
            progress(PLANNING_SHARE * done)
        });
        let cast = self
            .cast
            .clone()
            .scripted(scripts.map_err(|error| error.to_string())?);
        let times = self
            .beats
            .iter()
            .map(|beat| beat.time)
            .filter(|&time| time >= 0.0)
            .collect();
        let show = Show::new(
            cast,
            &self.settings,
            BeatSource::Annotated(times),
            Arc::default(),
        )
        .map_err(|error| error.to_string())?;
        Ok(self.poses(show, stop, progress))
    }

    fn poses(
        &self,
        mut show: Show,
        stop: &AtomicBool,
        progress: &mut dyn FnMut(f64),
    ) -> Option<Vec<Dance>> {
        let seconds = self.samples.len() as f64 / f64::from(SAMPLE_RATE);
        let ticks_per_pose = u64::from(TICK_HZ) / MOTION_FPS as u64;
        let ticks = ((seconds * MOTION_FPS).floor() as u64 + 1) * ticks_per_pose;
        let dancers = self.cast.names().enumerate();
        let mut dances: Vec<Dance> = dancers
            .map(|(number, name)| Dance::new(name, &show.graph(number).skeleton, self.cast.pads()))
            .collect();
        let mut pose = Pose::default();
        let mut sent = 0;
        for tick in 0..ticks {
            let now = Seconds(tick as f64 / f64::from(TICK_HZ));
            let until = ((now.0 * f64::from(SAMPLE_RATE)) as usize).min(self.samples.len());
            show.tick(now, &self.samples[sent..until], &[]);
            sent = until;
            if tick % ticks_per_pose > 0 {
                continue;
            }
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            for (number, dance) in dances.iter_mut().enumerate() {
                pose.rotations
                    .resize(dance.skeleton.len(), glam::Quat::IDENTITY);
                show.pose_at(number, now, &mut pose);
                dance.push(self.moment(&show, number, now), &pose);
            }
            progress(PLANNING_SHARE + (1.0 - PLANNING_SHARE) * tick as f64 / ticks as f64);
        }
        Some(dances)
    }

    /// Returns the show time `now`, the beat of the music at that time (counted as in the cue
    /// list), and the label of the motion that the dancer with the index `dancer` then shows.
    fn moment(&self, show: &Show, dancer: usize, now: Seconds) -> Moment {
        let label = match show.status(dancer).attribute {
            Attribute::Label(label) => Some(label),
            Attribute::None | Attribute::Idle => None,
        };
        let song_first = self.first as f64 + self.counted_from as f64;
        Moment {
            time: now.0,
            beat: show.dances().music_at(now).0.0 - song_first,
            label,
        }
    }
}

/// State of all previews: the requested, the running and the last finished preview.
#[derive(Default)]
struct PreviewState {
    /// Number and cue list of the preview that will be computed next; `None` if no preview is
    /// requested.
    next: Option<(u64, CueList)>,
    /// Number of the last requested preview; 0 before the first request.
    requested: u64,
    /// Number and progress (0 to 1) of the preview that is being computed; `None` if no preview is
    /// being computed.
    running: Option<(u64, f64)>,
    /// Number and packed dances of the last finished preview; `None` before the first one.
    ready: Option<(u64, Arc<[u8]>)>,
    /// Message that says why the last computed preview failed; `None` if it did not fail.
    error: Option<String>,
    /// True if the worker thread must end, because its handle is dropped.
    is_ending: bool,
}

struct Shared {
    state: Mutex<PreviewState>,
    /// Signals the worker thread that a new preview is requested or that the thread must end.
    changed: Condvar,
    /// When this flag is true, the preview that is being computed is cancelled.
    stop: AtomicBool,
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, PreviewState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Handle of the thread that computes the dance of the last requested cue list. Dropping the handle
/// ends the thread.
pub struct PreviewWorker {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl PreviewWorker {
    /// Starts a thread that computes the requested previews with `job`. If `job` is `None`, no
    /// thread starts, and the dances `finished` are the only preview.
    ///
    /// # Errors
    /// The operating system cannot start a thread.
    pub fn start(job: Option<PreviewJob>, finished: &[Dance]) -> Result<Self, std::io::Error> {
        let ready = (!finished.is_empty()).then(|| (0, pack(0, finished).into()));
        let state = Mutex::new(PreviewState {
            ready,
            ..PreviewState::default()
        });
        let shared = Arc::new(Shared {
            state,
            changed: Condvar::new(),
            stop: AtomicBool::new(false),
        });
        let in_thread = Arc::clone(&shared);
        let spawn = |job| {
            std::thread::Builder::new()
                .name("preview".into())
                .spawn(move || run(&job, &in_thread))
        };
        let thread = job.map(spawn).transpose()?;
        Ok(Self { shared, thread })
    }

    /// Requests the preview (dance) of the cue list `cues`; an unfinished request is dropped.
    /// Returns the number of the new preview.
    pub fn request(&self, cues: CueList) -> u64 {
        let mut state = self.shared.state();
        state.requested += 1;
        state.next = Some((state.requested, cues));
        self.shared.stop.store(true, Ordering::Relaxed);
        self.shared.changed.notify_one();
        state.requested
    }

    /// Returns the JSON value `{"wanted":n,"ready":n|null,"done":0..1,"error":text|null}`: number
    /// of the last requested preview, number of the last finished one, progress of the requested
    /// one (0 if it is not being computed), and the reason why the last computed one failed.
    pub fn status(&self) -> Value {
        let state = self.shared.state();
        let done = state
            .running
            .filter(|(id, _)| *id == state.requested)
            .map_or(0.0, |(_, done)| done);
        json!({ "wanted": state.requested, "ready": state.ready.as_ref().map(|(id, _)| id), "done": done, "error": state.error })
    }

    /// Returns the packed dances of the last finished preview; `None` if there is none yet.
    pub fn latest(&self) -> Option<Arc<[u8]>> {
        self.shared
            .state()
            .ready
            .as_ref()
            .map(|(_, bytes)| Arc::clone(bytes))
    }
}

impl Drop for PreviewWorker {
    fn drop(&mut self) {
        self.shared.state().is_ending = true;
        self.shared.stop.store(true, Ordering::Relaxed);
        self.shared.changed.notify_one();
        if self
            .thread
            .take()
            .is_some_and(|thread| thread.join().is_err())
        {
            tracing::error!("the thread `preview` of the editor has panicked");
        }
    }
}

/// Computes the requested previews one after the other until the thread must end.
fn run(job: &PreviewJob, shared: &Shared) {
    loop {
        let mut state = shared.state();
        let (id, cues) = loop {
            if state.is_ending {
                return;
            }
            match state.next.take() {
                Some(next) => break next,
                None => {
                    state = shared
                        .changed
                        .wait(state)
                        .unwrap_or_else(PoisonError::into_inner)
                }
            }
        };
        shared.stop.store(false, Ordering::Relaxed);
        (state.running, state.error) = (Some((id, 0.0)), None);
        drop(state);
        let result = job.run(&cues, &shared.stop, &mut |done| {
            shared.state().running = Some((id, done))
        });
        let packed = result.map(|dances| dances.map(|dances| pack(id, &dances).into()));
        let mut state = shared.state();
        state.running = None;
        match packed {
            Ok(Some(bytes)) => state.ready = Some((id, bytes)),
            Ok(None) => {}
            Err(error) => state.error = Some(error),
        }
    }
}
