//! What the user can do about an audio device that does not open. In: cpal's kind of error and the
//! system's message. Out: a clause for the user. Thread: any. Pure.
//!
//! | cause | PipeWire, PulseAudio | ALSA | WASAPI | CoreAudio |
//! |---|---|---|---|---|
//! | another program uses the device alone | `DeviceBusy` (PulseAudio) | `DeviceBusy` (EBUSY) | `DeviceBusy` (AUDCLNT_E_DEVICE_IN_USE) | `BackendError` with the status `!hog` |
//! | no permission | `PermissionDenied` (PulseAudio) | `PermissionDenied` (EACCES) | `BackendError` with E_ACCESSDENIED | silence, no error; seldom `PermissionDenied` |
//! | the device is gone | `DeviceNotAvailable` | `DeviceNotAvailable` (ENODEV) | `DeviceNotAvailable` | `DeviceNotAvailable` |

use cpal::ErrorKind;

/// Remedy for a device that another program uses alone.
const IN_USE: &str = if cfg!(windows) {
    "another program uses it alone: close that program, or forbid exclusive use under Settings > Sound > More sound settings > Properties > Advanced"
} else if cfg!(target_os = "macos") {
    "another program uses it alone (hog mode): close that program, or choose another device"
} else {
    "another program uses it alone: close that program, or choose the device of PipeWire or PulseAudio, which several programs can share"
};
/// Remedy for a device that the user may not use.
const NO_PERMISSION: &str = if cfg!(windows) {
    "allow desktop apps to use the microphone under Settings > Privacy & security > Microphone"
} else if cfg!(target_os = "macos") {
    "allow Corybant, or the terminal in which it runs, to use the microphone under System Settings > Privacy & Security > Microphone"
} else {
    "add the user to the group audio (`sudo usermod -aG audio USER`), and log in again"
};
/// The status '!hog' of CoreAudio: another program has the device alone. cpal passes it on as a
/// number in the message.
const HOG_MODE: &str = "560492391";
/// E_ACCESSDENIED of Windows, as a Windows error and as an HRESULT. cpal passes it on as a number in
/// the message.
const ACCESS_DENIED: [&str; 2] = ["(os error 5)", "(os error -2147024891)"];

/// Returns what the user can do about a device that does not open because of an error of the kind
/// `kind` with the system's message `reason`.
pub(super) fn remedy(kind: ErrorKind, reason: &str) -> &'static str {
    match kind {
        ErrorKind::DeviceBusy => IN_USE,
        _ if cfg!(target_os = "macos") && reason.contains(HOG_MODE) => IN_USE,
        ErrorKind::PermissionDenied => NO_PERMISSION,
        _ if cfg!(windows) && ACCESS_DENIED.iter().any(|text| reason.contains(text)) => {
            NO_PERMISSION
        }
        ErrorKind::DeviceNotAvailable => "connect it and switch it on, or choose another device",
        ErrorKind::HostUnavailable => "start the audio service of the system",
        ErrorKind::UnsupportedConfig => {
            "choose another format in the sound settings of the system, or another device"
        }
        ErrorKind::ResourceExhausted => "close other programs",
        _ => "close other programs that use it, or choose another device",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_cause_has_its_remedy() {
        let busy = remedy(ErrorKind::DeviceBusy, "busy");
        assert!(busy.contains("another program uses it alone"), "{busy}");
        let refused = remedy(ErrorKind::PermissionDenied, "permission denied");
        let place = if cfg!(target_os = "linux") {
            "group audio"
        } else {
            "icrophone"
        };
        assert!(refused.contains(place), "{refused}");
        for (kind, text) in [
            (ErrorKind::DeviceNotAvailable, "connect it"),
            (ErrorKind::UnsupportedConfig, "another format"),
            (ErrorKind::BackendError, "close other programs"),
        ] {
            assert!(remedy(kind, "x").contains(text), "{kind:?}");
        }
    }
}
