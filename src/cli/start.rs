//! `corybant` without a command, for example by a double click: a show whose page opens in the
//! browser and sets the show up.

use crate::daemon::setup::{PAGE_VARIABLE, Setup, open_in_browser, page_address};
use crate::rt::terminal::print_line;
use crate::web::probe::{self, Listener};

use super::{Outcome, run, stop_on_signal};

/// Runs a show with a page that sets it up, and opens the page in the browser. If a show of Corybant
/// runs already, opens the page of that one instead.
///
/// # Errors
/// The show cannot start, for example because a port is in use.
pub(super) fn start() -> Outcome {
    let listen = page_address(std::env::var(PAGE_VARIABLE).ok().as_deref())?;
    match probe::listener(listen) {
        Listener::Nobody => {}
        Listener::Corybant => return open_running(&format!("http://{listen}/")),
        Listener::Other => {
            return Err(format!(
                "the page cannot open: another program uses {listen}; end that program, or set the environment variable {PAGE_VARIABLE} to another address, such as 127.0.0.1:8720"
            )
            .into());
        }
    }
    let stop = stop_on_signal()?;
    let setup = Setup::new(listen, run::default_input())?;
    loop {
        match run::run_setup(&setup, &stop) {
            Err(error) if setup.restore(&error.to_string()) => {
                print_line(&format!("{error}; the settings before are back"));
                continue;
            }
            outcome => outcome?,
        }
        if !setup.must_start_again() {
            setup.remove_files();
            return Ok(());
        }
    }
}

/// Opens the page of the show that runs already, at `link`.
fn open_running(link: &str) -> Outcome {
    print_line(&format!(
        "Corybant runs already: this opens its page, {link}, in your browser. End that show first to start another one."
    ));
    open_in_browser(link)
        .map_err(|why| format!("no browser starts by itself ({why}); open {link}").into())
}

/// Waits for the Enter key on Windows. There, a console that was opened for this program would close
/// before an error can be read.
pub(super) fn wait_for_reader() {
    if cfg!(windows) {
        print_line("Press Enter to close this window.");
        // Without an input there is nothing to wait for.
        let _ = std::io::stdin().read_line(&mut String::new());
    }
}
