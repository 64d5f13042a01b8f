//! One page about this computer for a report of a problem (`corybant doctor`). In: the system. Out:
//! text. Thread: any; each check has its own. No audio stream and no connection to a running show is
//! opened, so that none is disturbed.
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

use std::time::Duration;

use self::page::{Line, Section};
use self::privacy::Privacy;
use self::probe::Probe;
use crate::config::Config;

/// Longest time for a check of the system. A sound server that hangs never answers.
const LIMIT: Duration = Duration::from_secs(6);

/// What a check of a show file has found.
pub struct ShowFindings {
    /// Problems, and devices that are not available now; one sentence each.
    pub problems: Vec<String>,
    /// The settings; `None` if the show file cannot be read.
    pub config: Option<Config>,
}

/// Returns the page about this computer. `check_show` checks the show file whose devices and ports
/// belong on the page; `None` if there is none.
pub fn page(check_show: Option<impl FnOnce() -> ShowFindings + Send + 'static>) -> String {
    let privacy = Privacy::of_system();
    // Other checks would delay the timers.
    let timing = Probe::start("Timing", LIMIT, &privacy, timing::lines).finish();
    let mut probes = vec![
        Probe::start("System", LIMIT, &privacy, machine::system),
        Probe::start("Video", LIMIT, &privacy, machine::video),
    ];
    probes.extend(sound::probes(LIMIT, &privacy));
    probes.push(Probe::start("Ports", LIMIT, &privacy, ports::lines));
    if let Some(check_show) = check_show {
        let work = |privacy: &Privacy| show_lines(&check_show(), privacy);
        probes.push(Probe::start("Show file", LIMIT, &privacy, work));
    }
    let program = Section::new("Corybant", machine::program());
    let mut sections = vec![program, timing];
    sections.extend(probes.into_iter().map(Probe::finish));
    privacy.without_home(&page::text(&sections))
}

/// Returns the problems of a show file and the state of its ports.
fn show_lines(found: &ShowFindings, privacy: &Privacy) -> Vec<Line> {
    let problems = found.problems.iter();
    let mut lines: Vec<Line> = problems
        .map(|problem| Line::problem(privacy.clean(problem)))
        .collect();
    if lines.is_empty() {
        lines.push(Line::fact("settings", "OK"));
    }
    let config = found.config.as_ref();
    lines.extend(config.map_or(Vec::new(), |config| ports::of_show(config, privacy)));
    lines
}
