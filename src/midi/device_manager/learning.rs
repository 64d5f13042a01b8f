//! Learn sessions of the device manager: while one runs, the next control that is moved gets the
//! requested action, in the running show and in the show file.
//!
//! In: a requested entry, moved controls. Out: [`LearnReport`]s, a changed map, a changed show
//! file. Thread: "midi".

use std::time::{Duration, Instant};

use tracing::info;

use super::ManagerThread;
use crate::midi::controller::{Controller, DeviceEvent};
use crate::midi::learn::{Assignment, LearnReport, LearnState, assign, control_kind};
use crate::midi::led_protocol::LedProtocol;
use crate::midi::mapper::Moved;
use crate::midi::{Backend, MidiMapper, Settings, save};
use corybant_core::cue::midi::{Control, MapEntry, MidiMap};

/// Duration after which a learn session ends if no control was learnt. In a learn session, the next
/// moved control gets a requested action.
const TIMEOUT: Duration = Duration::from_secs(60);
/// Largest number of MIDI ports that a learn session opens in addition to the ports of the show's
/// controllers.
const EXTRA_PORTS_MAX: usize = 16;

/// A learn session that is in progress.
pub(super) struct LearnRequest {
    /// Map entry with the requested action for the next moved control. The control and the channel
    /// in the entry are ignored.
    wanted: MapEntry,
    /// Time at which the learn session ends if no control was learnt.
    end: Instant,
    /// Controllers whose MIDI ports are open for this learn session only. Their indices follow
    /// those of the show's controllers.
    extra: Vec<Controller>,
}

impl ManagerThread {
    pub(super) fn begin_learn(&mut self, wanted: MapEntry) {
        self.end_learn();
        let extra = self.open_extra_ports();
        let message = format!("move the control for {:?}", wanted.label);
        self.report(LearnReport::new(
            LearnState::Waiting,
            &wanted.label,
            message,
        ));
        self.request = Some(LearnRequest {
            wanted,
            end: Instant::now() + TIMEOUT,
            extra,
        });
        self.session.set(true);
    }

    pub(super) fn cancel_learn(&mut self, message: &str) {
        if let Some(request) = self.end_learn() {
            self.report(LearnReport::new(
                LearnState::Cancelled,
                &request.wanted.label,
                message,
            ));
        }
    }

    pub(super) fn check_learn_timeout(&mut self, now: Instant) {
        if self
            .request
            .as_ref()
            .is_some_and(|request| now >= request.end)
        {
            self.cancel_learn("no control was moved for a minute, so learn was cancelled");
        }
    }

    pub(super) fn process_moved(&mut self, moved: &Moved) {
        let Some(request) = &self.request else {
            return;
        };
        match assign(&request.wanted, &moved.change) {
            Assignment::Ignore => {}
            Assignment::Refuse(reason) => self.report(LearnReport::new(
                LearnState::Refused,
                &request.wanted.label,
                reason,
            )),
            Assignment::Accept(entry) => self.accept(entry, moved),
        }
    }

    fn end_learn(&mut self) -> Option<LearnRequest> {
        self.session.set(false);
        self.request.take()
    }

    fn report(&self, report: LearnReport) {
        info!("learn: {}", report.message);
        // Without a subscriber, `send` fails; the log has the message.
        let _ = self.control.reports.send(report);
    }

    /// Opens the MIDI ports that no controller of the show uses, for this learn session only.
    /// Returns a controller for each port.
    fn open_extra_ports(&self) -> Vec<Controller> {
        let mut extra = Vec::new();
        for backend in [Backend::System, Backend::Jack] {
            let in_use = |name: &str| {
                self.controllers.iter().any(|controller| {
                    controller.settings.backend == backend
                        && controller.port().is_some_and(|port| port.name == name)
                })
            };
            for port in crate::midi::ports(backend).unwrap_or_default() {
                if in_use(&port.name) || extra.len() == EXTRA_PORTS_MAX {
                    continue;
                }
                let number = self.controllers.len() + extra.len();
                let Ok(mapper) = MidiMapper::new(
                    &[],
                    &[],
                    self.context.cues.clone(),
                    self.context.faults.clone(),
                ) else {
                    continue;
                };
                let settings = Settings {
                    backend,
                    port: port.stable_name().into(),
                    leds: LedProtocol::guess(&port.name),
                    ..Settings::default()
                };
                let mut controller =
                    Controller::new(settings, mapper.learning(number, &self.session));
                if let Some(DeviceEvent::Disconnected(error)) = controller.update(Instant::now()) {
                    info!("learn: cannot open the port {port}: {error}");
                }
                extra.push(controller);
            }
        }
        extra
    }

    /// Ends the learn session: assigns the action of `entry` to the moved control `moved`, and
    /// saves `entry` in the show file.
    fn accept(&mut self, entry: MapEntry, moved: &Moved) {
        let Some(request) = self.end_learn() else {
            return;
        };
        let Some(number) = self.adopt(request, moved.controller) else {
            return;
        };
        let Some(controller) = self.controllers.get_mut(number) else {
            return;
        };
        let before = insert(&mut controller.settings.map, &entry);
        match MidiMap::new(&controller.settings.map, self.context.names()) {
            Ok(map) => controller.set_map(map),
            Err(error) => {
                return self.report(LearnReport::new(
                    LearnState::Cancelled,
                    &entry.label,
                    error.to_string(),
                ));
            }
        }
        let settings = controller.settings.clone();
        self.search(Instant::now());
        self.leds
            .set_leds(number, settings.leds, &settings.map, self.context.names());
        let saved = self.save(&settings, &entry);
        let Some(control) = entry.control() else {
            return;
        };
        let port = if settings.port.is_empty() {
            "JACK".to_owned()
        } else {
            settings.port.clone()
        };
        let learnt = Learnt {
            entry: &entry,
            control,
            channel: moved.change.channel,
            port: &port,
            before: before.as_deref(),
        };
        let message = learnt.message(&saved);
        self.report(LearnReport {
            control: Some(control.to_string()),
            channel: Some(moved.change.channel),
            port: Some(port),
            kept: Some(saved.is_ok()),
            ..LearnReport::new(LearnState::Learnt, &entry.label, message)
        });
    }

    /// Closes the controllers that were opened for the learn session only. If the controller with
    /// the learnt control (index `number`) is one of them, it joins the controllers of the show.
    /// Returns the index that it then has; `None` if its [`MidiMapper`] cannot be created.
    fn adopt(&mut self, mut request: LearnRequest, number: usize) -> Option<usize> {
        let extra = number
            .checked_sub(self.controllers.len())
            .filter(|&extra| extra < request.extra.len());
        let Some(extra) = extra else {
            return Some(number);
        };
        // The controller's number changes, so it needs a new mapper.
        let settings = request.extra.swap_remove(extra).settings;
        let number = self.controllers.len();
        let mapper = MidiMapper::new(
            &[],
            &[],
            self.context.cues.clone(),
            self.context.faults.clone(),
        )
        .ok()?;
        self.controllers.push(Controller::new(
            settings,
            mapper
                .learning(number, &self.session)
                .with_takes(&self.takes),
        ));
        Some(number)
    }

    /// Writes the map entry `entry` into the show file, or into an included file that has the
    /// controller, for the controller with the settings
    /// `settings`.
    ///
    /// # Errors
    /// The reason as text, if there is no show file or the show file cannot be changed.
    fn save(&self, settings: &Settings, entry: &MapEntry) -> Result<(), String> {
        let file = self
            .context
            .show_file
            .as_ref()
            .ok_or("there is no show file")?;
        file.change_where(
            |text| save::has_controller(text, settings),
            |text| save::with(text, settings, entry),
        )
    }
}

/// Replaces the entry of `map` for the same control by `entry`, or appends `entry`. Returns the
/// label of the replaced entry; `None` if there was none.
fn insert(map: &mut Vec<MapEntry>, entry: &MapEntry) -> Option<String> {
    let same = |other: &&mut MapEntry| {
        other.control() == entry.control()
            && other
                .channel
                .is_none_or(|channel| Some(channel) == entry.channel)
    };
    let Some(old) = map.iter_mut().find(same) else {
        map.push(entry.clone());
        return None;
    };
    let new = MapEntry {
        channel: old.channel,
        ..entry.clone()
    };
    Some(std::mem::replace(old, new).label)
}

/// The result of a successful learn session, from which the message to the user is made.
struct Learnt<'a> {
    entry: &'a MapEntry,
    control: Control,
    channel: u8,
    port: &'a str,
    /// Label that the learnt control had before the learn session; `None` if the control had no map
    /// entry.
    before: Option<&'a str>,
}

impl Learnt<'_> {
    fn message(&self, saved: &Result<(), String>) -> String {
        let Self {
            entry,
            control,
            channel,
            port,
            before,
        } = self;
        let mut message = format!(
            "{control} on channel {channel} of {port} ({}) is now {:?}",
            control_kind(*control),
            entry.label
        );
        if let Some(before) = before.filter(|before| *before != entry.label) {
            message += &format!(" instead of {before:?}");
        }
        message += &match saved {
            Ok(()) => ", and saved in the show file".to_owned(),
            Err(reason) => format!("; it is not kept after this run: {reason}"),
        };
        message
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_control_has_one_entry() {
        let entry = |channel, label: &str| {
            MapEntry {
                label: label.into(),
                ..MapEntry::default()
            }
            .of(Control::Note(36), channel)
        };
        let mut map = vec![entry(Some(1), "a"), entry(Some(2), "b")];
        assert_eq!(insert(&mut map, &entry(Some(2), "c")), Some("b".into()));
        assert_eq!(insert(&mut map, &entry(Some(3), "d")), None);
        assert_eq!(
            map,
            [
                entry(Some(1), "a"),
                entry(Some(2), "c"),
                entry(Some(3), "d")
            ]
        );
        let mut any = vec![entry(None, "a")];
        assert_eq!(insert(&mut any, &entry(Some(3), "d")), Some("a".into()));
        assert_eq!(any, [entry(None, "d")]);
    }
}
