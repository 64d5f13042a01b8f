//! LTC from a WAV leads a cue list of three minutes on a virtual clock: with two locates, a short and
//! a long drop-out and a stray frame. The labels are those of the same song as `render` dances it.

use std::path::Path;
use std::sync::Arc;

use assert_no_alloc::assert_no_alloc;
use corybant::audio::feed::FileFeed;
use corybant::audio::file::{HOURS_MAX, decode_channels};
use corybant::audio::ltc_feed::LtcFeed;
use corybant_core::beat::offline;
use corybant_core::beat::tracker::BeatSource;
use corybant_core::cue::Cue;
use corybant_core::cue::list::CueList;
use corybant_core::cue::list::lead::{SongBeats, TimecodeLead};
use corybant_core::fault::Faults;
use corybant_core::graph::{Attribute, Graph};
use corybant_core::plan;
use corybant_core::show::script::{self, Song};
use corybant_core::show::{Cast, Settings, Show, TICK_HZ};
use corybant_core::tempo;
use corybant_core::tempo::source::TempoSource;
use corybant_core::time::Seconds;
use corybant_core::timecode::ltc::generator::LtcGenerator;
use corybant_core::timecode::settings;
use corybant_core::timecode::{State, TimecodeEvent};
use smpte_timecode::{FrameRate, Timecode};

use crate::common::wav::wav_of;

const RATE_HZ: u32 = 48_000;
const SONG_S: f64 = 180.0;
/// The beats of the song: 116 beats a minute, the first at 0.4 s.
const PERIOD_S: f64 = 60.0 / 116.0;
const FIRST_BEAT_S: f64 = 0.4;
/// Beats from one cue to the next, and of each cue.
const CUE_BEATS: usize = 16;
const LABELS: [&str; 5] = ["salsa", "disco", "twist", "robot", "wave"];
/// Longest time until timecode is followed.
const LOCK_S: f64 = 0.5;
const ERROR_S: f64 = 0.005;

/// A part of the recording: the source runs from a place in the song on, or is silent.
#[derive(Clone, Copy)]
enum Part {
    Runs { song: f64, seconds: f64 },
    Stray,
    Silent { seconds: f64 },
}

/// The recording: the place in the song at each time, if the source runs.
const PARTS: [Part; 9] = [
    Part::Runs {
        song: 0.0,
        seconds: 30.0,
    },
    // A locate forwards.
    Part::Runs {
        song: 101.0,
        seconds: 20.0,
    },
    // A locate backwards.
    Part::Runs {
        song: 40.0,
        seconds: 12.0,
    },
    Part::Stray,
    Part::Runs {
        song: 52.04,
        seconds: 7.96,
    },
    // A drop-out within the freewheel, then one that is longer.
    Part::Silent { seconds: 0.6 },
    Part::Runs {
        song: 60.6,
        seconds: 19.4,
    },
    Part::Silent { seconds: 9.0 },
    Part::Runs {
        song: 89.0,
        seconds: 90.0,
    },
];

fn seconds_of(part: Part) -> f64 {
    match part {
        Part::Runs { seconds, .. } | Part::Silent { seconds } => seconds,
        Part::Stray => 0.04,
    }
}

/// Returns a stereo WAV with music on the first channel and LTC (25 frames, from 01:00:00:00) on the
/// second, and for each run its beginning in the WAV, its place in the song and its length.
fn recording() -> (Vec<u8>, Vec<(f64, f64, f64)>) {
    let hour = Timecode::parse("01:00:00:00", FrameRate::FPS_25).unwrap();
    let frames = |song: f64| (song * 25.0).round() as i64;
    let (mut ltc, mut runs, mut at) = (Vec::new(), Vec::new(), 0.0);
    for part in PARTS {
        let (song, level) = match part {
            Part::Runs { song, seconds } => {
                runs.push((at, song, seconds));
                (song, 0.3)
            }
            Part::Stray => (80_000.0, 0.3),
            Part::Silent { .. } => (0.0, 0.0),
        };
        let first = hour.wrapping_add_frames(frames(song));
        let mut generator = LtcGenerator::new(first, 1.0, RATE_HZ, level);
        for _ in 0..frames(seconds_of(part)) {
            generator.frame(&mut ltc);
        }
        at += seconds_of(part);
    }
    let stereo = ltc.iter().enumerate().flat_map(|(n, &x)| {
        let music = 0.2 * ((n as f32) * 0.02).sin();
        [music, x].map(|x| (x * 32_767.0) as i16)
    });
    let stereo: Vec<i16> = stereo.collect();
    (wav_of(RATE_HZ, 2, &stereo), runs)
}

fn beat_times() -> Vec<f64> {
    let count = ((SONG_S - FIRST_BEAT_S) / PERIOD_S) as usize;
    (0..=count)
        .map(|n| FIRST_BEAT_S + n as f64 * PERIOD_S)
        .collect()
}

/// Returns the cue list: a label every 16 beats, for 16 beats.
fn cue_list(pads: &[String]) -> CueList {
    let line = |n: usize| {
        let label = LABELS[n % LABELS.len()];
        format!("@{} {label} {CUE_BEATS}\n", (n + 1) * CUE_BEATS)
    };
    let text: String = (0..beat_times().len() / CUE_BEATS - 1).map(line).collect();
    CueList::parse(&text, pads).unwrap()
}

fn settings() -> Settings {
    Settings {
        tempo: tempo::settings::Settings {
            source: TempoSource::Timecode,
            ..Default::default()
        },
        plan: plan::Settings {
            freestyle: false,
            ..Default::default()
        },
        ..Default::default()
    }
}

/// Returns the attribute that `render` dances on each beat of the song.
fn rendered(graph: &Arc<Graph>) -> Vec<Attribute> {
    let beats = offline::annotated(&beat_times(), &vec![0.1; 44_100 * 180], 4);
    let song = Song {
        beats: &beats,
        first: 0,
        counted_from: 0,
    };
    let cast = Cast::from(graph.clone());
    let cues = cue_list(cast.pads());
    let scripts = script::write(&cast, &settings().plan, &song, &cues, &mut |_| ()).unwrap();
    let steps = scripts[0].as_ref().unwrap().steps.iter();
    steps
        .flat_map(|step| std::iter::repeat_n(step.attribute, step.beats as usize))
        .collect()
}

fn feed(wav: &[u8]) -> LtcFeed {
    let folder = tempfile::tempdir().unwrap();
    let path: &Path = &folder.path().join("ltc.wav");
    std::fs::write(path, wav).unwrap();
    let sound = decode_channels(path, &[2], 60 * HOURS_MAX).unwrap();
    LtcFeed::new(FileFeed::new(sound.samples, false))
}

/// A show that timecode leads.
struct Led {
    show: Show,
    lead: TimecodeLead,
    ltc: LtcFeed,
    list: CueList,
    cues: Vec<Cue>,
}

impl Led {
    fn new(graph: &Arc<Graph>, wav: &[u8]) -> Self {
        let show = Show::new(
            graph.clone(),
            &settings(),
            BeatSource::Audio,
            Arc::new(Faults::default()),
        );
        let timecode = settings::Settings {
            source: "ltc:2".parse().unwrap(),
            offset: "01:00:00:00".parse().unwrap(),
            ..Default::default()
        };
        Self {
            show: show.unwrap(),
            lead: TimecodeLead::new(&timecode, SongBeats::new(beat_times())),
            ltc: feed(wav),
            list: cue_list(Cast::from(graph.clone()).pads())
                .timed(&beat_times())
                .in_order_of_time(),
            cues: Vec::with_capacity(64),
        }
    }

    fn tick(&mut self, now: Seconds) {
        let Self {
            show,
            lead,
            ltc,
            list,
            cues,
        } = self;
        cues.clear();
        let period = show.music().timeline.period_at(now);
        assert_no_alloc(|| {
            ltc.read_until(now, &mut |reading| lead.receive(&reading));
            lead.tick(now, period, list, &mut |cue| cues.push(cue));
        });
        show.tick(now, &[], cues);
    }
}

#[test]
fn ltc_from_a_wav_leads_a_cue_list_of_three_minutes() {
    let graph = Arc::new(corybant_repertoire::graph().unwrap());
    let expected = rendered(&graph);
    let (wav, runs) = recording();
    let mut led = Led::new(&graph, &wav);
    let end: f64 = PARTS.iter().map(|&part| seconds_of(part)).sum();
    let (mut error_max, mut lock_max, mut label_max) = (0.0f64, 0.0f64, 0.0f64);
    let (mut compared, mut equal, mut idle_ticks) = (0, 0, 0);
    let (mut locked_at, mut danced_at) = (vec![None; runs.len()], vec![None; runs.len()]);
    for tick in 0..(end * f64::from(TICK_HZ)) as u64 {
        let now = tick as f64 / f64::from(TICK_HZ);
        led.tick(Seconds(now));
        let status = led.lead.status(Seconds(now));
        let attribute = led.show.status(0).attribute;
        idle_ticks += u32::from(now > 1.0 && attribute == Attribute::Idle);
        let run = runs.iter().rposition(|&(start, ..)| now >= start).unwrap();
        let (start, song, seconds) = runs[run];
        let place = song + now - start;
        if status.position.state == State::Locked
            && status
                .song
                .is_some_and(|song| (song - place).abs() <= ERROR_S)
        {
            locked_at[run].get_or_insert(now - start);
        }
        if now - start >= seconds {
            continue;
        }
        let beat = (place - FIRST_BEAT_S) / PERIOD_S;
        let danced = expected.get(beat.max(0.0) as usize).copied();
        if danced == Some(attribute) {
            danced_at[run].get_or_insert(now - start);
        }
        if now - start < LOCK_S {
            continue;
        }
        error_max = error_max.max((status.song.unwrap() - place).abs());
        // In the middle of a beat, from half of a cue on, when each label has been reached. On its
        // last beat, `render` may be on the way to the next label, which it knows.
        let into_cue = beat.rem_euclid(CUE_BEATS as f64);
        let is_middle = (0.4..0.6).contains(&beat.rem_euclid(1.0));
        if is_middle
            && beat > CUE_BEATS as f64
            && (8.0..15.0).contains(&into_cue)
            && now - start > 6.0 * PERIOD_S
        {
            compared += 1;
            equal += u32::from(danced == Some(attribute));
        }
    }
    for (run, (locked, danced)) in locked_at.iter().zip(&danced_at).enumerate() {
        let (start, song, _) = runs[run];
        let locked = locked.unwrap_or_else(|| panic!("run {run} at {start} s is not followed"));
        assert!(locked <= LOCK_S, "run {run} is followed after {locked} s");
        lock_max = lock_max.max(locked);
        // The locates: to 101 s, 40 s and, after the long drop-out, 89 s.
        if [101.0, 40.0, 89.0].contains(&song) {
            let danced = danced.expect("the label of the place is danced");
            assert!(
                danced - locked <= PERIOD_S,
                "run {run}: danced after {danced} s"
            );
            label_max = label_max.max(danced);
        }
    }
    assert!(error_max <= ERROR_S, "{error_max} s");
    assert_eq!(idle_ticks, 0, "the dance has stopped");
    assert!(compared > 1_500, "{compared}");
    assert!(
        equal == compared,
        "{equal} of {compared} ticks have the label of render"
    );
    let events: Vec<TimecodeEvent> = std::iter::from_fn(|| led.lead.next_event()).collect();
    assert_eq!(events.len(), 4, "{events:?}");
    assert!(matches!(events[2], TimecodeEvent::Lost(_)), "{events:?}");
    assert!(led.lead.ignored() <= 1, "{}", led.lead.ignored());
    println!(
        "lock within {lock_max:.3} s, error at most {:.2} ms, label of a locate after {label_max:.2} s, {equal} ticks as rendered",
        1000.0 * error_max
    );
}
