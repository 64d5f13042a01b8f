//! Converts the levels of a universe to cues by its patch. In: levels. Out: the cues of the channels
//! that have changed. Thread: any. Allocates: only in `new`.

use super::CHANNELS;
use super::entry::{Band, PatchEntry, PatchError};
use crate::cue::control_text::ControlAction;
use crate::cue::midi::map;
use crate::cue::verbs::{Command, Value};
use crate::cue::{Cue, CueNames};

/// The value of a press, as the velocity of a MIDI note.
const PRESSED: u8 = 127;

/// One band of a channel, which is pressed while the level is in it.
#[derive(Clone, Copy, Debug)]
struct Button {
    channel: usize,
    band: Band,
    cue: Cue,
    is_pressed: bool,
}

/// A channel whose level is the value of a command.
#[derive(Clone, Copy, Debug)]
struct Fader {
    channel: usize,
    command: Command,
    level: u8,
}

/// The patch of a universe. Before the first levels, every channel counts as 0, so that a desk that
/// is switched on with its faders at 0 changes nothing.
///
/// ```
/// use corybant_core::cue::dmx::{DmxPatch, PatchEntry};
/// use corybant_core::cue::{Cue, Launch};
///
/// let entry = PatchEntry {
///     channel: 1,
///     labels: vec!["salsa".into(), "pop".into()],
///     ..PatchEntry::default()
/// };
/// let mut patch = DmxPatch::new(&[entry], (&["salsa".into(), "pop".into()]).into()).unwrap();
/// let mut levels = [0; 512];
/// levels[0] = 24;
/// let mut sent = Vec::new();
/// patch.update(&levels, &mut |cue| sent.push(cue));
/// patch.update(&levels, &mut |cue| sent.push(cue));
/// assert_eq!(sent, [Cue::from(Launch::plain(1))]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct DmxPatch {
    buttons: Vec<Button>,
    faders: Vec<Fader>,
}

impl DmxPatch {
    /// Creates the patch with these `entries`; `names` are the names of all labels and scenes of the show.
    /// Leaves out entries whose channel does not exist.
    ///
    /// # Errors
    /// [`PatchError`] of the first entry that cannot be used.
    pub fn new(entries: &[PatchEntry], names: CueNames) -> Result<Self, PatchError> {
        let mut patch = Self::default();
        for entry in entries {
            let Some(channel) = usize::from(entry.channel).checked_sub(1) else {
                continue;
            };
            if channel >= CHANNELS {
                continue;
            }
            for (band, action) in entry.actions(names)? {
                match action {
                    ControlAction::Button(cue) => patch.buttons.push(Button {
                        channel,
                        band,
                        cue,
                        is_pressed: false,
                    }),
                    ControlAction::Fader(command) => patch.faders.push(Fader {
                        channel,
                        command,
                        level: 0,
                    }),
                    // `PatchEntry::actions` has refused it.
                    ControlAction::Take(_) => {}
                }
            }
        }
        Ok(patch)
    }

    /// Calls `each` with the cues of all channels that have changed since the last call: first those
    /// of bands that were left, then those of bands that were entered, then those of faders.
    pub fn update(&mut self, levels: &[u8; CHANNELS], each: &mut dyn FnMut(Cue)) {
        for is_pressed in [false, true] {
            for button in &mut self.buttons {
                let is_now = button.band.has(levels[button.channel]);
                if is_now != button.is_pressed && is_now == is_pressed {
                    button.is_pressed = is_now;
                    let velocity = if is_now { PRESSED } else { 0 };
                    map::button(button.cue, velocity)
                        .into_iter()
                        .for_each(&mut *each);
                }
            }
        }
        for fader in &mut self.faders {
            let level = levels[fader.channel];
            if level != fader.level {
                fader.level = level;
                let value = f64::from(level) / f64::from(u8::MAX);
                let cue = fader.command.cue(Value::Number(value));
                cue.into_iter().for_each(&mut *each);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cue::DanceCommand;
    use crate::cue::launch::{Launch, Mode};
    use crate::tempo::command::TempoCommand;

    /// Returns the patch of these entries, written as in a show file.
    fn patch(text: &str) -> DmxPatch {
        #[derive(serde::Deserialize)]
        struct Input {
            patch: Vec<PatchEntry>,
        }
        let input: Input = toml::from_str(text).unwrap();
        DmxPatch::new(&input.patch, (&["salsa", "pop"].map(String::from)).into()).unwrap()
    }

    /// Sets channel `channel` to `level` and returns the cues.
    fn set(patch: &mut DmxPatch, levels: &mut [u8; 512], channel: usize, level: u8) -> Vec<Cue> {
        let mut sent = Vec::new();
        levels[channel - 1] = level;
        patch.update(levels, &mut |cue| sent.push(cue));
        sent
    }

    #[test]
    fn a_band_sends_its_cue_once_and_a_gate_ends_when_it_is_left() {
        let mut patch = patch("[[patch]]\nchannel = 2\nlabels = ['salsa', 'pop']\nmode = 'gate'");
        let mut levels = [0; 512];
        let mut at = |level| set(&mut patch, &mut levels, 2, level);
        let gate = |label| {
            Cue::from(Launch {
                mode: Mode::Gate,
                ..Launch::plain(label)
            })
        };
        let lift = |label| Cue::from(DanceCommand::Lift { label });
        assert_eq!(at(9), []);
        assert_eq!(at(10), [gate(0)]);
        assert_eq!(at(19), []);
        assert_eq!(at(25), [lift(0), gate(1)]);
        assert_eq!(at(30), [lift(1)]);
        assert_eq!(at(20), [gate(1)]);
    }

    #[test]
    fn buttons_are_on_from_128_and_faders_follow_the_level() {
        let mut patch = patch(
            "[[patch]]\nchannel = 1\nlabel = '!hold'\n[[patch]]\nchannel = 3\nlabel = '!intensity'\n\
             [[patch]]\nchannel = 4\nlabel = '!tap'\nfrom = 1",
        );
        let mut levels = [0; 512];
        patch.update(&levels, &mut |cue| panic!("a desk at 0 sends {cue:?}"));
        assert_eq!(set(&mut patch, &mut levels, 1, 127), []);
        let hold = |on| Cue::from(DanceCommand::Hold(on));
        assert_eq!(set(&mut patch, &mut levels, 1, 128), [hold(true)]);
        assert_eq!(set(&mut patch, &mut levels, 1, 255), []);
        assert_eq!(set(&mut patch, &mut levels, 1, 0), [hold(false)]);
        let intensity = |x| Cue::from(DanceCommand::Intensity(Some(x)));
        assert_eq!(set(&mut patch, &mut levels, 3, 255), [intensity(1.0)]);
        assert_eq!(set(&mut patch, &mut levels, 3, 51), [intensity(0.2)]);
        assert_eq!(set(&mut patch, &mut levels, 3, 51), []);
        assert_eq!(set(&mut patch, &mut levels, 3, 0), [intensity(0.0)]);
        let tap = Cue::Tempo(TempoCommand::Tap);
        assert_eq!(set(&mut patch, &mut levels, 4, 1), [tap]);
        assert_eq!(set(&mut patch, &mut levels, 4, 0), []);
    }
}
