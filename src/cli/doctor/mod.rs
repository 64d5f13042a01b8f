//! `corybant doctor`: one page about this computer for a report of a problem. It opens no audio
//! device and no connection to a running show, so it does not disturb one.
//!
//! | file | subject |
//! |---|---|
//! | `page` | lines of the page, and their text |
//! | `privacy` | removes names, addresses and the home folder from texts |
//! | `probe` | runs one check with a time limit |
//! | `machine` | program, system, locale, GPU, ffmpeg |
//! | `timing` | real-time priority, limits, timers |
//! | `sound` | audio services and devices, MIDI ports, permissions |
//! | `ports` | network ports and the programs that listen on them |

mod machine;
mod page;
mod ports;
mod privacy;
mod probe;
mod sound;
mod timing;

use std::path::PathBuf;
use std::time::Duration;

use self::page::{Line, Section};
use self::privacy::Privacy;
use self::probe::Probe;
use super::check::{self, Findings};
use super::{Outcome, print};

/// Longest time for a check of the system. A sound server that hangs never answers.
const LIMIT: Duration = Duration::from_secs(6);

/// Arguments of `corybant doctor`.
#[derive(clap::Args, Debug)]
pub(super) struct DoctorArgs {
    /// Show file whose devices and ports are checked too
    show: Option<PathBuf>,
}

/// `corybant doctor`: prints a page about this computer. A problem that the page reports is no error
/// of the command.
///
/// # Errors
/// Standard output cannot be written.
pub(super) fn doctor(args: &DoctorArgs) -> Outcome {
    let privacy = Privacy::of_system();
    // Other checks would delay the timers.
    let timing = Probe::start("Timing", LIMIT, &privacy, timing::lines).finish();
    let mut probes = vec![
        Probe::start("System", LIMIT, &privacy, machine::system),
        Probe::start("Video", LIMIT, &privacy, machine::video),
    ];
    probes.extend(sound::probes(LIMIT, &privacy));
    probes.push(Probe::start("Ports", LIMIT, &privacy, ports::lines));
    if let Some(show) = args.show.clone() {
        let work = move |privacy: &Privacy| check_show(&show, privacy);
        probes.push(Probe::start("Show file", LIMIT, &privacy, work));
    }
    let program = Section::new("Corybant", machine::program());
    let mut sections = vec![program, timing];
    sections.extend(probes.into_iter().map(Probe::finish));
    print(&privacy.without_home(&page::text(&sections)))
}

/// Returns the problems and notes about the show file `show`, and the state of its ports.
fn check_show(show: &std::path::Path, privacy: &Privacy) -> Vec<Line> {
    let outside = |text: &str| privacy.clean(text);
    let Findings {
        problems,
        notes,
        config,
    } = match check::examine(show) {
        Ok(found) => found,
        Err(error) => return vec![Line::problem(outside(&error.to_string()))],
    };
    let mut lines: Vec<Line> = problems
        .iter()
        .map(|problem| Line::problem(outside(problem)))
        .chain(notes.lines().map(|note| Line::problem(outside(note))))
        .collect();
    if lines.is_empty() {
        lines.push(Line::fact("settings", "OK"));
    }
    if let Some(config) = config {
        lines.extend(ports::of_show(&config, privacy));
    }
    lines
}
