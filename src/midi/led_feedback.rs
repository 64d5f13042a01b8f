//! LED feedback: the LEDs of MIDI controllers show the state of the labels and of hold.
//!
//! In: the state of the show (the latest value counts), the LEDs and outputs of each controller.
//! Out: MIDI messages, sent only when an LED changes. Thread: its own, "leds";
//! [`LedPublisher::publish`] runs on the show thread, and never waits or allocates.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use crossbeam::queue::ArrayQueue;
use tokio::sync::watch;
use triple_buffer::{Input, Output, triple_buffer};

use super::led_protocol::{LedProtocol, LedState};
use crate::rt::cue_queue::TimedCue;
use crate::rt::histogram::{Histogram, Percentiles};
use crate::rt::takes::{TakeDesk, TakePhase, TakeState};
use crate::rt::waker::Waker;
use crate::rt::worker::{StopSignal, Worker};
use corybant_core::cue::control_text::ControlAction;
use corybant_core::cue::midi::{Control, MapEntry};
use corybant_core::cue::scene::SceneId;
use corybant_core::cue::take::TakeRequest;
use corybant_core::cue::{Cue, CueNames, DanceCommand};
use corybant_core::graph::LabelId;
use corybant_core::show::Show;
use corybant_core::show::status::Lamp;

/// Longest time between two updates of the LEDs of the controllers.
const UPDATE_INTERVAL: Duration = Duration::from_secs(1);
/// Capacity of the queue of cues for which the delay from the MIDI message to the LED message is
/// measured. If the queue is full, the oldest cue is dropped.
const CUES_MAX: usize = 64;
/// Longest time that the LED thread waits at its end until the messages that switch the LEDs off
/// are sent.
const SWITCH_OFF_TIMEOUT: Duration = Duration::from_millis(100);

/// An open MIDI output port for LED messages.
pub(super) enum LedOutput {
    System(super::system::Output),
    #[cfg(all(target_os = "linux", feature = "jack"))]
    Jack(super::jack::MessageQueue),
}

impl LedOutput {
    /// Sends the MIDI message `message`; returns false if the system refuses it or the queue is
    /// full.
    fn send(&mut self, message: [u8; 3]) -> bool {
        match self {
            Self::System(output) => output.send(&message).is_ok(),
            #[cfg(all(target_os = "linux", feature = "jack"))]
            Self::Jack(queue) => queue.push(message).is_ok(),
        }
    }

    /// Returns true if no LED message waits to be sent.
    fn is_flushed(&self) -> bool {
        match self {
            Self::System(_) => true,
            #[cfg(all(target_os = "linux", feature = "jack"))]
            Self::Jack(queue) => queue.is_empty(),
        }
    }
}

/// Function of a control, which its LED shows: launches a label, recalls a scene, holds the motion, records takes of
/// a label, or sends another command.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Function {
    Label(LabelId),
    Scene(SceneId),
    Hold,
    Take(String),
    Command,
}

#[derive(Clone, Debug)]
/// The LED that belongs to one control (pad, key or button) of a controller.
struct Led {
    control: Control,
    channel: u8,
    function: Function,
    /// Last MIDI message that was sent to the LED; an equal message is not sent again. `None` if
    /// the next message must be sent in any case.
    last_sent: Option<[u8; 3]>,
}

/// The part of the show's state that LEDs show.
#[derive(Clone, Debug, Default, PartialEq)]
struct ShowState {
    /// Show time of this state, in seconds.
    time: f64,
    /// True in the first half of each beat of the music, false in the second half.
    on_beat: bool,
    held: bool,
    /// The scene that is on, and the one that waits.
    scenes: [Option<SceneId>; 2],
    /// State of each label (idle, armed or dancing), indexed by label number.
    labels: Vec<Lamp>,
}

impl ShowState {
    fn led_state(&self, function: &Function, take: &TakeState) -> LedState {
        match function {
            Function::Label(label) => {
                match self
                    .labels
                    .get(usize::from(*label))
                    .copied()
                    .unwrap_or_default()
                {
                    Lamp::Idle => LedState::Idle,
                    Lamp::Armed => LedState::Armed,
                    Lamp::Dancing => LedState::Dancing,
                }
            }
            Function::Scene(scene) => match self.scenes {
                [on, _] if on == Some(*scene) => LedState::Dancing,
                [_, next] if next == Some(*scene) => LedState::Armed,
                _ => LedState::Idle,
            },
            Function::Hold if self.held => LedState::Dancing,
            Function::Take(label) if *label == take.label => match take.phase {
                TakePhase::CountIn => LedState::Armed,
                TakePhase::Recording => LedState::Dancing,
                _ => LedState::Command,
            },
            Function::Hold | Function::Take(_) | Function::Command => LedState::Command,
        }
    }
}

/// Publishes the state of the show from the show thread to the LED thread.
pub struct LedPublisher {
    input: Input<ShowState>,
    last: ShowState,
    /// Queue of the cues for which the delay to their LED message is measured. Each entry has the
    /// show time of the tick that processed the cue, and the time at which the MIDI message
    /// arrived.
    cues: Arc<ArrayQueue<(f64, Instant)>>,
    waker: Waker,
}

impl LedPublisher {
    /// Publishes the state of `show` after a tick that processed the cues `cues`. Does nothing if
    /// the state is unchanged and no cue has a known arrival time.
    pub fn publish(&mut self, show: &Show, cues: &[TimedCue]) {
        let status = show.status(0);
        let new = self.input.input_buffer_mut();
        show.lamps(&mut new.labels);
        (new.time, new.held, new.on_beat) =
            (status.time, status.held, status.beat.rem_euclid(1.0) < 0.5);
        new.scenes = [status.scene, status.next_scene];
        let same = (&new.labels, new.held, new.on_beat, new.scenes)
            == (
                &self.last.labels,
                self.last.held,
                self.last.on_beat,
                self.last.scenes,
            );
        let arrivals = cues.iter().filter_map(|cue| cue.received);
        if same && arrivals.clone().next().is_none() {
            return;
        }
        self.last.labels.copy_from_slice(&new.labels);
        (self.last.held, self.last.on_beat) = (new.held, new.on_beat);
        self.last.scenes = new.scenes;
        for arrival in arrivals {
            // A full queue drops its oldest cue.
            let _ = self.cues.force_push((status.time, arrival));
        }
        self.input.publish();
        self.waker.wake();
    }
}

/// A message of the device manager, which opens the controllers, to the LED thread.
enum Command {
    /// Replaces the LEDs of a controller. The values are the index of the controller, its LED
    /// protocol and its LEDs.
    SetLeds(usize, LedProtocol, Vec<Led>),
    /// Replaces the output for the LEDs of a controller. The values are the index of the controller
    /// and the new output (`None` if the controller was disconnected).
    SetOutput(usize, Option<LedOutput>),
}

/// Handle of the LED thread. Dropping the handle switches the LEDs off and ends the thread.
pub(super) struct LedFeedback {
    commands: Sender<Command>,
    waker: Waker,
    delays: Arc<Mutex<Histogram>>,
    worker: Mutex<Option<Worker>>,
}

impl LedFeedback {
    /// Starts the LED thread for a show with at most `label_count` labels and with the recorder of
    /// takes `takes`; the thread first calls `raise_priority`. Returns the handle of the thread, and the publisher through which the show
    /// thread sends its state.
    ///
    /// # Errors
    /// The operating system cannot start a thread.
    pub(super) fn start(
        label_count: usize,
        raise_priority: fn(),
        takes: Option<&TakeDesk>,
    ) -> std::io::Result<(Self, LedPublisher)> {
        let initial = ShowState {
            labels: vec![Lamp::default(); label_count],
            ..ShowState::default()
        };
        let (input, output) = triple_buffer(&initial);
        let (commands, receiver) = channel();
        let waker = Waker::default();
        let delays = Arc::new(Mutex::new(Histogram::default()));
        let cues = Arc::new(ArrayQueue::new(CUES_MAX));
        let thread = LedThread {
            state: output,
            commands: receiver,
            cues: cues.clone(),
            next_cue: None,
            devices: Vec::new(),
            delays: delays.clone(),
            takes: takes.map(TakeDesk::state),
        };
        if let Some(takes) = takes {
            takes.wake_on_change(waker.clone());
        }
        let own_waker = waker.clone();
        let worker = Worker::start("leds", move |stop| {
            own_waker.wake_me();
            raise_priority();
            thread.run(stop);
        })?;
        Ok((
            Self {
                commands,
                waker: waker.clone(),
                delays,
                worker: Mutex::new(Some(worker)),
            },
            LedPublisher {
                input,
                last: initial,
                cues,
                waker,
            },
        ))
    }

    /// Replaces the LEDs of the controller with index `controller`: one LED for each button or key
    /// in `map`. `leds` is the LED protocol of the controller, and `names` are the labels and
    /// scenes of the show.
    pub(super) fn set_leds(
        &self,
        controller: usize,
        leds: LedProtocol,
        map: &[MapEntry],
        names: CueNames,
    ) {
        let led = |entry: &MapEntry| {
            let control = entry.control()?;
            let function = match entry.action(names).ok()? {
                ControlAction::Button(Cue::Dance(DanceCommand::Launch(launch))) => {
                    Function::Label(launch.label)
                }
                ControlAction::Button(Cue::Dance(DanceCommand::Hold(_))) => Function::Hold,
                ControlAction::Button(Cue::Scene(Some(scene))) => Function::Scene(scene),
                ControlAction::Take(request) => match &*request {
                    TakeRequest::Toggle { label, .. } => Function::Take(label.clone()),
                    _ => Function::Command,
                },
                ControlAction::Button(_) => Function::Command,
                ControlAction::Fader(_) => return None,
            };
            Some(Led {
                control,
                channel: entry.channel.unwrap_or(1),
                function,
                last_sent: None,
            })
        };
        self.send(Command::SetLeds(
            controller,
            leds,
            map.iter().filter_map(led).collect(),
        ));
    }

    /// Sets the output for the LEDs of the controller with index `controller`; `None` if the
    /// controller was disconnected.
    pub(super) fn set_output(&self, controller: usize, output: Option<LedOutput>) {
        self.send(Command::SetOutput(controller, output));
    }

    /// Returns percentiles of the delay from the arrival of a MIDI message to the LED message that
    /// the MIDI message caused.
    pub(super) fn delay(&self) -> Percentiles {
        self.delays
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .percentiles()
    }

    /// Switches the LEDs off and waits until the LED thread has ended.
    pub(super) fn end(&self) {
        let worker = self
            .worker
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        drop(worker);
    }

    fn send(&self, command: Command) {
        // The send fails after the end of the LED thread; then nobody needs the command.
        let _ = self.commands.send(command);
        self.waker.wake();
    }
}

/// The LEDs of one controller, with the output for their messages.
#[derive(Default)]
struct DeviceLeds {
    protocol: LedProtocol,
    leds: Vec<Led>,
    output: Option<LedOutput>,
}

impl DeviceLeds {
    /// Sends a MIDI message for each LED whose state in `state` has changed. Returns true if a
    /// message was sent.
    fn update(&mut self, state: &ShowState, take: &TakeState) -> bool {
        let Self {
            protocol,
            leds,
            output: Some(output),
        } = self
        else {
            return false;
        };
        let mut sent = false;
        for led in leds {
            let Some(message) = protocol.message(
                led.control,
                led.channel,
                state.led_state(&led.function, take),
                state.on_beat,
            ) else {
                continue;
            };
            if led.last_sent != Some(message) && output.send(message) {
                led.last_sent = Some(message);
                sent = true;
            }
        }
        sent
    }

    fn switch_off(&mut self) {
        let Some(output) = &mut self.output else {
            return;
        };
        for message in self.leds.iter().filter_map(|led| led.last_sent) {
            // If this fails, an LED stays lit after the show, which does no harm.
            let _ = output.send([message[0], message[1], 0]);
        }
    }
}

/// The state of the thread that sends LED messages to all controllers.
struct LedThread {
    state: Output<ShowState>,
    commands: Receiver<Command>,
    cues: Arc<ArrayQueue<(f64, Instant)>>,
    /// Next cue from `cues`, if the LEDs do not show its effect yet: the show time of the tick that
    /// processed the cue, and the arrival time of its MIDI message. `None` if there is no such cue.
    next_cue: Option<(f64, Instant)>,
    /// LEDs of each controller, indexed like the controllers of the show.
    devices: Vec<DeviceLeds>,
    delays: Arc<Mutex<Histogram>>,
    /// The state of the take; `None` if the show records none.
    takes: Option<watch::Receiver<TakeState>>,
}

impl LedThread {
    fn run(mut self, stop: &StopSignal) {
        while !stop.is_set() {
            self.process_commands();
            self.update();
            std::thread::park_timeout(UPDATE_INTERVAL);
        }
        self.devices.iter_mut().for_each(DeviceLeds::switch_off);
        let end = Instant::now() + SWITCH_OFF_TIMEOUT;
        let is_flushed =
            |device: &DeviceLeds| device.output.as_ref().is_none_or(LedOutput::is_flushed);
        while Instant::now() < end && !self.devices.iter().all(is_flushed) {
            std::thread::park_timeout(Duration::from_millis(2));
        }
    }

    fn process_commands(&mut self) {
        while let Ok(command) = self.commands.try_recv() {
            let (Command::SetLeds(number, ..) | Command::SetOutput(number, _)) = command;
            while self.devices.len() <= number {
                self.devices.push(DeviceLeds::default());
            }
            let device = &mut self.devices[number];
            match command {
                Command::SetLeds(_, protocol, leds) => {
                    device.switch_off();
                    (device.protocol, device.leds) = (protocol, leds);
                }
                Command::SetOutput(_, output) => {
                    device.output = output;
                    for led in &mut device.leds {
                        led.last_sent = None;
                    }
                }
            }
        }
    }

    /// Sends the latest state of the show to the LEDs. If this causes a message, records the delays
    /// of the cues that the show had processed before this state.
    fn update(&mut self) {
        self.state.update();
        let state = self.state.output_buffer();
        let take = self.takes.as_ref().map(|takes| takes.borrow().clone());
        let take = take.unwrap_or_default();
        let mut sent = false;
        for device in &mut self.devices {
            sent |= device.update(state, &take);
        }
        let now = Instant::now();
        while let Some((time, arrival)) = self.next_cue.take().or_else(|| self.cues.pop()) {
            if time > state.time {
                self.next_cue = Some((time, arrival));
                break;
            }
            if sent {
                self.delays
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .record(now.duration_since(arrival));
            }
        }
    }
}
