//! Tests of `run --cues` on a music file: the beat numbers of the cue list count the beats of the
//! song, not those that the live tracker has found.
#![allow(clippy::unwrap_used, missing_docs)]

use std::f32::consts::TAU;
use std::path::Path;
use std::process::Output;

use corybant_core::graph::file::to_bytes;
use corybant_core::timecode::ltc::generator::LtcGenerator;
use serde_json::Value;
use smpte_timecode::{FrameRate, Timecode};

use crate::common::program;
use crate::common::wav;

use wav::{wav, wav_of};

/// The length of the song in seconds. Its beats are half a second apart; the first is at
/// [`FIRST_S`].
const SECONDS: usize = 14;
const FIRST_S: f64 = 0.5;

/// Returns a song with clear beats at 120 bpm.
fn song() -> Vec<f32> {
    let sample = |n: usize| {
        let since = (n as f64 / 44_100.0 - FIRST_S).rem_euclid(0.5) as f32;
        if (n as f64) < FIRST_S * 44_100.0 {
            0.0
        } else {
            0.8 * (TAU * 90.0 * since).sin() * (-since * 18.0).exp()
        }
    };
    (0..SECONDS * 44_100).map(sample).collect()
}

fn corybant(arguments: &[&str], folder: &Path) -> Output {
    program::corybant()
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("all.graph"),
        to_bytes(&corybant_repertoire::graph().unwrap()),
    )
    .unwrap();
    std::fs::write(folder.path().join("song.wav"), wav(&song())).unwrap();
    std::fs::write(
        folder.path().join("show.toml"),
        "[osc]\nlisten = \"127.0.0.1:0\"\n[page]\nlisten = \"off\"\n[plan]\nfreestyle = false\n",
    )
    .unwrap();
    folder
}

const RUN: [&str; 8] = [
    "run",
    "show.toml",
    "--graph",
    "all.graph",
    "--input",
    "file:song.wav",
    "--cues",
    "cues.txt",
];

#[test]
fn the_cues_of_a_list_are_danced_on_the_beats_of_the_song() {
    let folder = folder();
    std::fs::write(folder.path().join("cues.txt"), "@7 salsa 4\n8.25 disco 4\n").unwrap();
    let ran = corybant(
        &[&RUN[..], &["--seconds", "13", "--record", "show.tape"]].concat(),
        folder.path(),
    );
    assert!(
        ran.status.success(),
        "{}",
        String::from_utf8_lossy(&ran.stderr)
    );
    let again = corybant(
        &["replay", "show.tape", "--poses", "dance.jsonl"],
        folder.path(),
    );
    assert!(
        again.status.success(),
        "{}",
        String::from_utf8_lossy(&again.stderr)
    );
    let text = std::fs::read_to_string(folder.path().join("dance.jsonl")).unwrap();
    let poses: Vec<Value> = text
        .lines()
        .skip(1)
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    // Each cue is half a beat before the beat of its label. In a live show the label is danced as
    // soon as the graph allows, within eight beats.
    for (label, cued_s) in [("salsa", FIRST_S + 6.5 * 0.5), ("disco", 8.25)] {
        let danced: Vec<f64> = poses
            .iter()
            .filter(|pose| pose["label"] == label)
            .map(|pose| pose["t"].as_f64().unwrap())
            .collect();
        let first = *danced
            .first()
            .unwrap_or_else(|| panic!("{label} is not danced"));
        assert!(
            first >= cued_s && first <= cued_s + 4.5,
            "{label}, cued at {cued_s} s, is danced from {first} s on"
        );
    }
}

#[test]
fn cues_after_the_end_of_the_song_are_refused_before_the_show() {
    let folder = folder();
    for (cues, words) in [
        (
            "2 tango\n",
            "cues.txt: cue list, line 1: unknown label `tango`",
        ),
        (
            "2 salsa\n@80 salsa\n",
            "cues.txt: cue list, line 2: @80 is after the last of the song's beats",
        ),
        (
            "20 salsa\n",
            "cues.txt: cue list, line 1: 20 s is after the end of the song",
        ),
    ] {
        std::fs::write(folder.path().join("cues.txt"), cues).unwrap();
        let ran = corybant(&RUN, folder.path());
        let said = String::from_utf8_lossy(&ran.stderr).into_owned();
        assert!(
            ran.status.code() == Some(1) && said.contains(words),
            "{cues:?}: {said}"
        );
        assert!(!String::from_utf8_lossy(&ran.stdout).contains("listening"));
    }
}

/// Returns a stereo WAV: the song on the first channel, and LTC from 01:00:20:00 on the second.
fn song_with_timecode() -> Vec<u8> {
    let first = Timecode::parse("01:00:20:00", FrameRate::FPS_25).unwrap();
    let mut generator = LtcGenerator::new(first, 1.0, 44_100, 0.3);
    let mut ltc = Vec::new();
    (0..SECONDS * 25).for_each(|_| generator.frame(&mut ltc));
    let both = song().into_iter().zip(ltc).flat_map(|(x, y)| [x, y]);
    let samples: Vec<i16> = both.map(|x| (x * 32_767.0) as i16).collect();
    wav_of(44_100, 2, &samples)
}

#[test]
fn ltc_of_a_music_file_leads_the_cue_list() {
    let folder = folder();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    let beats: String = (0..80)
        .map(|n| format!("{}\n", f64::from(n) * 0.5))
        .collect();
    write("song.wav", &song_with_timecode());
    write("beats.txt", beats.as_bytes());
    // At the start, salsa is danced for another eight beats; disco and what is before are not.
    write("cues.txt", b"@2 disco 8\n@32 salsa 16\n@56 robot 8\n");
    let timecode = "[tempo]\nsource = \"timecode\"\n[timecode]\nsource = \"ltc:2\"\noffset = \"01:00:00:00\"\n[osc]\nlisten = \"127.0.0.1:0\"\n[page]\nlisten = \"off\"\n[plan]\nfreestyle = false\n";
    write("show.toml", timecode.as_bytes());
    let without_beats = corybant(&RUN, folder.path());
    let said = String::from_utf8_lossy(&without_beats.stderr).into_owned();
    assert!(
        said.contains("the cue list has cues at beats (@)") && said.contains("--beats FILE"),
        "{said}"
    );
    let ran = corybant(
        &[&RUN[..], &["--beats", "beats.txt", "--seconds", "11"]].concat(),
        folder.path(),
    );
    let said = String::from_utf8_lossy(&ran.stderr).into_owned();
    assert!(ran.status.success(), "{said}");
    let place = |words: &str| {
        said.find(words)
            .unwrap_or_else(|| panic!("no {words:?} in {said}"))
    };
    let found = place("timecode found at 01:00:20:0");
    let (salsa, robot) = (place(": salsa"), place(": robot"));
    assert!(found < salsa && salsa < robot, "{said}");
    // The way to robot may lead over a beat of disco.
    assert!(
        said.find(": disco").is_none_or(|disco| disco > salsa),
        "{said}"
    );
    assert!(!said.contains("timecode lost"), "{said}");
    write("show.toml", b"[timecode]\nsource = \"ltc:3\"\n");
    let said = String::from_utf8_lossy(&corybant(&RUN[..6], folder.path()).stderr).into_owned();
    assert!(said.contains("song.wav has 2 channels"), "{said}");
}
