//! `corybant doctor`: a page about this computer for a report of a problem.

use std::path::{Path, PathBuf};

use crate::doctor::{self, ShowFindings};

use super::check::{self, Findings};
use super::{Outcome, print};

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
    let check_show = args.show.clone().map(|show| move || check_show(&show));
    print(&doctor::page(check_show))
}

fn check_show(show: &Path) -> ShowFindings {
    match check::examine(show) {
        Ok(Findings {
            mut problems,
            notes,
            config,
        }) => {
            problems.extend(notes.lines().map(String::from));
            ShowFindings { problems, config }
        }
        Err(error) => ShowFindings {
            problems: vec![error.to_string()],
            config: None,
        },
    }
}
