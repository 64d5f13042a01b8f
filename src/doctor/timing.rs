//! Real-time priority and timers for `corybant doctor`. In: the system. Out: lines of the page.
//! Thread: its own, whose priority it raises as the show thread does.

use std::time::{Duration, Instant};

use super::page::Line;
use super::privacy::Privacy;
use crate::rt::system::priority;

/// Interval between two wake-ups of the measured timer, and their number: half a second in all.
const STEP: Duration = Duration::from_millis(5);
const STEPS: u32 = 100;
/// Largest lateness, exceeded by one wake-up in a hundred, that poses need.
const LATE_MAX: Duration = Duration::from_millis(4);
/// How to get real-time priority.
const PRIORITY_REMEDY: &str = if cfg!(target_os = "linux") {
    "write `@audio - rtprio 20` into a file in /etc/security/limits.d/, add the user to the group audio, and log in again"
} else {
    "poses may be late while other programs are busy; close them during a show"
};

/// Returns the limit of real-time priorities, whether this thread gets one, and the lateness of its
/// timers.
pub(super) fn lines(privacy: &Privacy) -> Vec<Line> {
    let mut lines = limits();
    lines.push(match priority::raise() {
        Ok(priority) => Line::fact("show thread", priority),
        Err(error) => Line::problem(format!(
            "the show thread gets no real-time priority: {}; {PRIORITY_REMEDY}",
            privacy.clean(&error)
        )),
    });
    let mut late: Vec<Duration> = wake_ups();
    late.sort_unstable();
    let at = |share: usize| late[(late.len() - 1) * share / 100];
    let ms = |late: Duration| format!("{:.2} ms", late.as_secs_f64() * 1_000.0);
    let (half, most) = (ms(at(50)), ms(at(100)));
    let value = format!("half of {STEPS} wake-ups at most {half} late, all at most {most}");
    lines.push(Line::fact("timers", value));
    if at(99) > LATE_MAX {
        lines.push(Line::problem(
            "timers are late, so poses will be: close other programs, switch power saving off, and measure again with `corybant bench tick`",
        ));
    }
    lines
}

/// Returns the lateness of each of [`STEPS`] wake-ups at fixed times.
fn wake_ups() -> Vec<Duration> {
    let start = Instant::now();
    let lateness = |step| {
        let due = start + STEP * step;
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        Instant::now().saturating_duration_since(due)
    };
    (1..=STEPS).map(lateness).collect()
}

/// Returns the user's limit of real-time priorities.
#[cfg(target_os = "linux")]
fn limits() -> Vec<Line> {
    let shown = |limit: u64| match limit {
        rlimit::INFINITY => "unlimited".into(),
        limit => limit.to_string(),
    };
    vec![match rlimit::Resource::RTPRIO.get() {
        Ok((soft, hard)) => Line::fact(
            "RLIMIT_RTPRIO",
            format!("{} (at most {})", shown(soft), shown(hard)),
        ),
        Err(error) => Line::fact("RLIMIT_RTPRIO", format!("unknown: {error}")),
    }]
}

/// Other systems have no such limit.
#[cfg(not(target_os = "linux"))]
fn limits() -> Vec<Line> {
    Vec::new()
}
