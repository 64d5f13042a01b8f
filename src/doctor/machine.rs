//! Program, system, GPU and ffmpeg for `corybant doctor`. In: the system. Out: lines of the page.

use sysinfo::{CpuRefreshKind, MemoryRefreshKind, RefreshKind, System};

use super::page::Line;
use super::privacy::Privacy;

/// Bytes in a GiB.
const GIB: f64 = (1_u64 << 30) as f64;
/// How to install ffmpeg.
const FFMPEG_REMEDY: &str = "install it (Debian: apt install ffmpeg, macOS: brew install ffmpeg, Windows: winget install ffmpeg)";
/// The features of the program, each with true if this build has it.
const FEATURES: [(&str, bool); 6] = [
    ("aubio", cfg!(feature = "aubio")),
    ("jack", cfg!(feature = "jack")),
    ("link", cfg!(feature = "link")),
    ("pipewire", cfg!(feature = "pipewire")),
    ("tui", cfg!(feature = "tui")),
    ("video", cfg!(feature = "video")),
];

/// Returns the version and the features of this program.
pub(super) fn program() -> Vec<Line> {
    let build = if cfg!(debug_assertions) {
        " (debug build)"
    } else {
        ""
    };
    let features = |wanted: bool| -> String {
        let names = FEATURES.iter().filter(|(_, is_built)| *is_built == wanted);
        let names: Vec<&str> = names.map(|(name, _)| *name).collect();
        if names.is_empty() {
            "none".into()
        } else {
            names.join(", ")
        }
    };
    vec![
        Line::fact("version", format!("{}{build}", env!("CARGO_PKG_VERSION"))),
        Line::fact("features", features(true)),
        Line::fact("without", features(false)),
    ]
}

/// Returns system, kernel, processor, memory and locale.
pub(super) fn system(privacy: &Privacy) -> Vec<Line> {
    let unknown = || "unknown".to_owned();
    let wanted = RefreshKind::nothing()
        .with_cpu(CpuRefreshKind::nothing())
        .with_memory(MemoryRefreshKind::nothing().with_ram());
    let system = System::new_with_specifics(wanted);
    let name = System::long_os_version().unwrap_or_else(unknown);
    let kernel = System::kernel_version().unwrap_or_else(unknown);
    let processor = system.cpus().first().map_or("", |cpu| cpu.brand()).trim();
    let count = std::thread::available_parallelism().map_or(0, usize::from);
    let mut lines = vec![
        Line::fact("system", format!("{name}, {}", std::env::consts::ARCH)),
        Line::fact("kernel", kernel),
        Line::fact("processor", format!("{processor}, {count} logical cores")),
        Line::fact(
            "memory",
            format!("{:.1} GiB", system.total_memory() as f64 / GIB),
        ),
    ];
    let locale = sys_locale::get_locale().unwrap_or_else(unknown);
    lines.push(Line::fact("locale", privacy.clean(&locale)));
    if cfg!(unix) && !is_utf8(["LC_ALL", "LC_CTYPE", "LANG"].map(|name| std::env::var(name).ok())) {
        lines.push(Line::problem(
            "the terminal is not set to UTF-8, so `corybant top` may show wrong characters: set LANG, for example to C.UTF-8",
        ));
    }
    lines
}

/// Returns true if the first of the environment variables `LC_ALL`, `LC_CTYPE` and `LANG` that has a
/// value selects UTF-8. On macOS, terminals use UTF-8 without them.
fn is_utf8(variables: [Option<String>; 3]) -> bool {
    let mut set = variables
        .into_iter()
        .flatten()
        .filter(|value| !value.is_empty());
    match set.next() {
        Some(value) => value.to_lowercase().replace('-', "").ends_with("utf8"),
        None => cfg!(target_os = "macos"),
    }
}

/// Returns the GPU and the version of ffmpeg.
pub(super) fn video(privacy: &Privacy) -> Vec<Line> {
    let gpu = match corybant_video::canvas::adapter() {
        Ok(name) => Line::fact("renderer", privacy.clean(&name)),
        Err(error) => Line::problem(privacy.clean(&error.to_string())),
    };
    let ffmpeg = match corybant_video::ffmpeg::version() {
        Ok(version) => Line::fact("ffmpeg", privacy.clean(&version)),
        Err(reason) => {
            let reason = privacy.clean(&reason.to_string());
            Line::problem(format!(
                "no ffmpeg, so no .mp4 and .webm ({reason}): {FFMPEG_REMEDY}"
            ))
        }
    };
    vec![gpu, ffmpeg]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_variable_with_a_value_decides_on_the_characters() {
        let of = |values: [&str; 3]| is_utf8(values.map(|value| Some(value.into())));
        assert!(of(["", "", "en_GB.UTF-8"]) && of(["C.utf8", "", "C"]));
        assert!(!of(["C", "", "en_GB.UTF-8"]) && !of(["", "POSIX", ""]));
        assert_eq!(is_utf8([None, None, None]), cfg!(target_os = "macos"));
    }
}
