//! Runs one check of the system with a time limit, so that a part of the system that hangs does not
//! stop the page. In: a check. Out: a section of the page. Thread: one for each check; a check that
//! hangs ends with the program.

use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use super::page::{Line, Section};
use super::privacy::Privacy;

/// A running check.
pub(super) struct Probe {
    title: String,
    end: Instant,
    limit: Duration,
    lines: Result<Receiver<Vec<Line>>, std::io::Error>,
}

impl Probe {
    /// Starts the check `work` in a thread. Its section has the title `title`.
    pub(super) fn start(
        title: impl Into<String>,
        limit: Duration,
        privacy: &Privacy,
        work: impl FnOnce(&Privacy) -> Vec<Line> + Send + 'static,
    ) -> Self {
        let (sender, receiver) = channel();
        let privacy = privacy.clone();
        let thread = std::thread::Builder::new().name("doctor".into());
        let started = thread.spawn(move || {
            // If nobody waits any more, the result is not needed.
            let _ = sender.send(work(&privacy));
        });
        Self {
            title: title.into(),
            end: Instant::now() + limit,
            limit,
            lines: started.map(|_| receiver),
        }
    }

    /// Waits for the end of the check, at most until its time limit, and returns its section.
    pub(super) fn finish(self) -> Section {
        let rest = self.end.saturating_duration_since(Instant::now());
        let lines = match self.lines.map(|receiver| receiver.recv_timeout(rest)) {
            Ok(Ok(lines)) => lines,
            Ok(Err(RecvTimeoutError::Timeout)) => vec![Line::problem(format!(
                "no answer within {} s: this part of the system hangs; restart it, or the computer",
                self.limit.as_secs()
            ))],
            Ok(Err(RecvTimeoutError::Disconnected)) => {
                vec![Line::problem("this check has failed; please report it")]
            }
            Err(error) => vec![Line::problem(format!("cannot start this check: {error}"))],
        };
        Section::new(self.title, lines)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::page::text;

    fn finished(
        limit: Duration,
        work: impl FnOnce(&Privacy) -> Vec<Line> + Send + 'static,
    ) -> String {
        text(&[Probe::start("Part", limit, &Privacy::default(), work).finish()])
    }

    #[test]
    fn a_check_that_hangs_or_fails_gives_a_problem() {
        let minute = Duration::from_secs(60);
        let page = finished(minute, |_| vec![Line::fact("name", "value")]);
        assert!(
            page.contains("value") && page.ends_with("No problem found.\n"),
            "{page}"
        );
        let page = finished(Duration::ZERO, |_| {
            loop {
                std::thread::park();
            }
        });
        assert!(page.contains("! no answer within 0 s"), "{page}");
        let page = finished(minute, |_| panic!("on purpose"));
        assert!(page.contains("! this check has failed"), "{page}");
    }
}
