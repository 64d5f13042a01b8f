//! The terminal: every text that the program prints or logs goes through this file. In: texts.
//! Out: the same texts, with control characters escaped by [`corybant_core::text`].
//! Thread: any except show and audio.
//!
//! Names of labels, clips, dancers, devices and files come from outside and may hold control
//! characters, which could move the cursor or change the colours of a terminal. They appear
//! escaped, as in `\u{1b}`.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corybant_core::text::{lines, one_line};
use tracing_subscriber::fmt::MakeWriter;

/// Prints `text` on standard output. Control characters are escaped; line feeds are kept.
///
/// # Errors
/// Standard output cannot be written.
pub fn print(text: &str) -> io::Result<()> {
    io::stdout().lock().write_all(lines(text).as_bytes())
}

/// Prints `text`, after which the user writes on the same line. Control characters are escaped.
///
/// # Errors
/// Standard output cannot be written.
pub fn prompt(text: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(one_line(text).as_bytes())?;
    out.flush()
}

/// Sets `stop` to true when standard input closes, which a thread of its own waits for.
pub fn set_on_closed_input(stop: &Arc<AtomicBool>) {
    let stop = stop.clone();
    std::thread::spawn(move || {
        let _ = io::copy(&mut io::stdin(), &mut io::sink());
        stop.store(true, Ordering::Relaxed);
    });
}

/// Prints the JSON text `json` on standard output. The control characters that JSON itself does not
/// escape are printed as `\u007f` to `\u009f`.
///
/// # Errors
/// Standard output cannot be written.
pub fn print_json(json: &str) -> io::Result<()> {
    let mut escaped = String::with_capacity(json.len() + 1);
    for c in json.chars() {
        if c.is_control() && c != '\n' {
            escaped.push_str(&format!("\\u{:04x}", u32::from(c)));
        } else {
            escaped.push(c);
        }
    }
    writeln!(io::stdout().lock(), "{escaped}")
}

/// Writes `bytes`, the content of a file, on standard output as they are. The caller makes sure that
/// standard output is not a terminal.
///
/// # Errors
/// Standard output cannot be written.
pub fn print_file(bytes: &[u8]) -> io::Result<()> {
    io::stdout().lock().write_all(bytes)
}

/// Prints `line` and a line feed on standard output. Errors, such as a closed standard output, are
/// ignored.
pub fn print_line(line: &str) {
    let _ = writeln!(io::stdout(), "{}", one_line(line));
}

/// Prints `text`, which may have several lines, on standard error. Errors, such as a closed
/// standard error, are ignored.
pub fn print_error(text: &str) {
    let _ = writeln!(io::stderr(), "{}", lines(text));
}

/// The writer of the log to standard error. Each log event is one line; line feeds inside an event
/// are escaped.
#[derive(Clone, Copy, Debug, Default)]
pub struct LogWriter;

impl<'a> MakeWriter<'a> for LogWriter {
    type Writer = Self;

    fn make_writer(&'a self) -> Self {
        *self
    }
}

impl Write for LogWriter {
    /// Writes one formatted log event as one line.
    fn write(&mut self, event: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(event);
        let line = text.strip_suffix('\n').unwrap_or(&text);
        writeln!(io::stderr(), "{}", one_line(line))?;
        Ok(event.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}
