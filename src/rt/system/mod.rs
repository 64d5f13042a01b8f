//! What a show asks of the operating system: priority, accurate timers, no sleep of the machine,
//! time to end. In: requests. Out: the system's consent, or its refusal as text.
//! Thread: the thread for which something is requested.
//!
//! | file | system |
//! |---|---|
//! | `priority` | all: real-time priority of the current thread |
//! | `awake` | Windows, macOS: the machine stays awake and fast during a show |
//! | `console` | Windows: the time between the closing of the console and the end of the program |
//! | `streams` | Linux: the names of audio streams in PipeWire; unsafe code to set a variable |
//! | `udp` | all: a UDP port that no other program can share |
//! | `windows` | the calls of the Windows API; unsafe code |

pub(crate) mod awake;
#[cfg(any(windows, test))]
pub(crate) mod console;
pub(crate) mod priority;
#[cfg(all(target_os = "linux", feature = "pipewire"))]
pub(crate) mod streams;
pub(crate) mod udp;
#[cfg(windows)]
mod windows;
