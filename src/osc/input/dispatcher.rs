//! Converts OSC packets of every transport to cues. In: a packet and its sender. Out: cues into the
//! show's queue; each message to the caller. Thread: listeners. Messages that cannot be resolved
//! are counted and, at most once a second, logged.

use std::fmt::Display;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::DATAGRAM_MAX;
use crate::osc::feedback::challenge;
use crate::osc::feedback::surfaces::FEEDBACK_MARKER;
use crate::rt::cue_queue::CueQueue;
use crate::rt::rate_limiter::RateLimiter;
use crate::rt::show_names::NamesReader;
use crate::rt::takes::{NO_TAKES, TakeDesk};
use corybant_core::cue::namespace::Namespace;
use corybant_core::cue::osc::pattern::is_pattern;
use corybant_core::cue::osc::{OscMap, Rejected, Resolved, Value, beat, packet, timecode};
use corybant_core::cue::take;
use corybant_core::fault::{Fault, Faults};
use corybant_core::text::did_you_mean;
use corybant_core::time::Seconds;
use corybant_core::timecode::Reading;

/// Largest number of messages with an address pattern (OSC address with wildcards, such as `*`)
/// that are processed per second; further ones are refused. Such messages are expensive, because
/// the pattern is compared with every OSC address.
pub const PATTERNS_PER_SECOND_MAX: u32 = 500;
/// Typical error of the arrival times of timecode.
const TIMECODE_JITTER: Seconds = Seconds(0.005);
/// Shortest time between two log lines about refused or malformed messages.
const LOG_EVERY: Duration = Duration::from_secs(1);

/// A received OSC message, as `OscDispatcher::process` passes it to its callback.
pub enum Received<'a> {
    /// A message to the show. [`Resolved`] has the cues that the message requests, and the OSC
    /// addresses that it matches; [`Value`] is the first argument of the message.
    Message(&'a Resolved, Value),
    /// A challenge message, by which a sender asks for a number or returns it (see [`challenge`]).
    /// The value is the number in its first argument; `None` if that argument is not an integer.
    Challenge(Option<i32>),
}

/// Converts the OSC packets of one listener to cues and pushes them into the cue queue.
pub struct OscDispatcher {
    /// Labels (kinds of motion) of the show, as the names of its pads.
    names: NamesReader,
    map: OscMap,
    queue: CueQueue,
    faults: Arc<Faults>,
    /// Flag that another thread can change: if true, the number in an OSC message that starts a
    /// label (kind of motion) also sets the intensity of the dance.
    velocity_as_intensity: Arc<AtomicBool>,
    patterns: RateLimiter,
    start: Instant,
    log: Throttle,
    /// Recorder of takes; `None` if the show records none.
    takes: Option<TakeDesk>,
    /// True if messages `/timecode` lead the show.
    takes_timecode: bool,
    /// True if a show's feedback (messages with its state for control surfaces) has arrived here as
    /// input. This is logged only once.
    feedback_logged: bool,
}

impl OscDispatcher {
    /// Creates a dispatcher that pushes cues into `queue`. `labels[i]` is the name of label `i`
    /// (kind of motion) of the show. If `velocity_as_intensity` is true, the number in an OSC
    /// message that starts a label also sets the intensity of the dance.
    pub fn new(
        labels: &[String],
        velocity_as_intensity: bool,
        queue: CueQueue,
        faults: Arc<Faults>,
    ) -> Self {
        Self {
            names: NamesReader::fixed(labels, &[]),
            map: OscMap::new(labels),
            queue,
            faults,
            velocity_as_intensity: Arc::new(AtomicBool::new(velocity_as_intensity)),
            patterns: RateLimiter::new(PATTERNS_PER_SECOND_MAX, Duration::ZERO),
            start: Instant::now(),
            log: Throttle::default(),
            takes: None,
            takes_timecode: false,
            feedback_logged: false,
        }
    }

    /// Returns this dispatcher with `velocity_as_intensity` as a flag that another thread can
    /// change. If the flag is true, the number in an OSC message that starts a label (kind of
    /// motion) also sets the intensity of the dance.
    pub fn with_velocity_flag(self, velocity_as_intensity: &Arc<AtomicBool>) -> Self {
        Self {
            velocity_as_intensity: velocity_as_intensity.clone(),
            ..self
        }
    }

    /// Returns this dispatcher with the labels of `names`, which can grow during the show.
    pub fn with_names(self, names: NamesReader) -> Self {
        Self {
            map: OscMap::of(names.seen().cue_names()),
            names,
            ..self
        }
    }

    /// Returns this dispatcher with a recorder of takes.
    pub fn with_takes(self, takes: Option<TakeDesk>) -> Self {
        Self { takes, ..self }
    }

    /// Returns this dispatcher, which sends the messages `/timecode` to the show if `is_on` is true.
    pub fn with_timecode(self, is_on: bool) -> Self {
        Self {
            takes_timecode: is_on,
            ..self
        }
    }

    /// Takes the current labels of the show. Returns true if the namespace has grown: new labels
    /// add addresses at its end.
    pub fn update(&mut self) -> bool {
        let is_new = self.names.update();
        if is_new {
            self.map = OscMap::of(self.names.seen().cue_names());
        }
        is_new
    }

    /// Returns the namespace: all OSC addresses of the show.
    pub fn namespace(&self) -> &Namespace {
        self.map.namespace()
    }

    /// Returns the counters of the faults of the show, such as refused or malformed messages.
    pub fn faults(&self) -> &Arc<Faults> {
        &self.faults
    }

    /// Counts a malformed packet and logs `text`, at most once a second.
    pub fn count_malformed(&mut self, text: impl FnOnce() -> String) {
        self.faults.count(Fault::BadOsc);
        self.log.warn(text);
    }

    /// Decodes an OSC packet from the sender `from` and calls `each` for each message. If `each`
    /// returns true, the cues that the message requests are pushed into the cue queue. The message
    /// [`FEEDBACK_MARKER`] begins feedback (the state of a show for control surfaces): it and all
    /// later messages in the packet are ignored.
    pub fn process(
        &mut self,
        packet: &[u8],
        from: &dyn Display,
        each: &mut dyn FnMut(Received) -> bool,
    ) {
        if packet.len() > DATAGRAM_MAX {
            return self.count_malformed(|| {
                format!("ignored OSC from {from}: the packet has more than {DATAGRAM_MAX} bytes")
            });
        }
        let now = self.start.elapsed();
        self.map
            .set_velocity_as_intensity(self.velocity_as_intensity.load(Ordering::Relaxed));
        let mut is_feedback = false;
        let result = packet::decode(packet, &mut |address, arguments| {
            is_feedback |= address == FEEDBACK_MARKER;
            let is_elsewhere = address.starts_with(take::PREFIX) || address == timecode::TIMECODE;
            if !is_feedback && !is_elsewhere {
                self.process_message(now, address, arguments, from, each);
            }
        });
        if is_feedback {
            self.log_feedback(from);
        } else {
            self.process_takes(packet, from);
            self.process_timecode(packet, from);
        }
        if let Err(error) = result {
            self.count_malformed(|| format!("ignored bytes from {from} that are not OSC: {error}"));
        }
    }

    /// Sends the requests for takes in `packet` to the recorder of takes.
    fn process_takes(&mut self, packet: &[u8], from: &dyn Display) {
        take::requests(packet, &mut |request| {
            let takes = self.takes.clone();
            let why = match (request, takes) {
                (Ok(request), Some(takes)) => return takes.request(request),
                (Err(refusal), _) => refusal.to_string(),
                (Ok(_), None) => NO_TAKES.into(),
            };
            self.count_malformed(|| format!("ignored OSC from {from}: {why}"));
        });
    }

    /// Sends the timecode in `packet` to the show.
    fn process_timecode(&mut self, packet: &[u8], from: &dyn Display) {
        let at = self.queue.clock().at(Instant::now());
        timecode::places(packet, &mut |place| {
            let place = match (place, self.takes_timecode) {
                (Ok(place), true) => place,
                (Ok(_), false) => {
                    return self.count_malformed(|| {
                        format!("ignored /timecode from {from}: [timecode] source of the show file is not \"osc\"")
                    });
                }
                (Err(error), _) => {
                    self.faults.count(Fault::BadTimecode);
                    return self
                        .log
                        .warn(|| format!("ignored OSC from {from}: {error}"));
                }
            };
            // Before the start of the show there is nothing to lead.
            if let Some(at) = at {
                self.queue.send_timecode(Reading {
                    at,
                    place,
                    frame: None,
                    jitter: TIMECODE_JITTER,
                    is_locate: false,
                });
            }
        });
    }

    /// Logs a warning that the sender `from` sent a show's feedback (messages with its state for
    /// control surfaces) to this show. Only the first call has an effect.
    fn log_feedback(&mut self, from: &dyn Display) {
        if !std::mem::replace(&mut self.feedback_logged, true) {
            tracing::warn!(
                "ignored feedback of a show from {from}: osc.feedback of this or another show contains this show's address; set the address and port of the receiver there"
            );
        }
    }

    fn process_message(
        &mut self,
        now: Duration,
        address: &str,
        arguments: &[Value],
        from: &dyn Display,
        each: &mut dyn FnMut(Received) -> bool,
    ) {
        let argument = arguments.first().copied().unwrap_or(Value::Absent);
        if address == challenge::ADDRESS {
            each(Received::Challenge(integer(argument)));
            return;
        }
        self.queue
            .last_messages()
            .osc(|| format!("{address} {}", display(argument)));
        if is_pattern(address) && !self.patterns.take(now) {
            return self.count_malformed(|| {
                format!(
                    "ignored OSC from {from}: more than {PATTERNS_PER_SECOND_MAX} patterns per second"
                )
            });
        }
        let resolved = match beat::message(address, arguments) {
            Some(message) => message.map(|message| {
                message
                    .into_iter()
                    .for_each(|message| self.queue.send_tempo(message));
                Resolved::default()
            }),
            None => self.map.resolve(address, argument),
        };
        match resolved {
            Ok(resolved) => {
                if each(Received::Message(&resolved, argument)) {
                    resolved.cues.iter().for_each(|&cue| self.queue.push(cue));
                }
            }
            Err(rejected) => {
                self.faults.count(if rejected == Rejected::Label {
                    Fault::UnknownLabel
                } else {
                    Fault::BadOsc
                });
                let Self { log, map, .. } = self;
                log.warn(|| {
                    // The OSC address comes from an unknown sender, so it is shortened and escaped.
                    let address: String = address.chars().take(80).collect();
                    let why = reason(rejected, &address, argument, map.namespace());
                    format!("ignored {address:?} from {from}: {why}")
                });
            }
        }
    }
}

/// Returns the argument of an OSC message as an integer; `None` if it is no integer or does not fit
/// in 32 bits.
fn integer(argument: Value) -> Option<i32> {
    match argument {
        Value::Number(x) if x.fract() == 0.0 && x.abs() < f64::from(i32::MAX) + 1.0 => {
            Some(x as i32)
        }
        _ => None,
    }
}

/// Returns the argument of an OSC message as text for the user; the text is empty if there is no
/// argument.
fn display(argument: Value) -> String {
    match argument {
        Value::Absent => String::new(),
        Value::Number(number) => number.to_string(),
        Value::Source(source) => source.name().into(),
        Value::Title(_) | Value::Other => "…".into(),
    }
}

/// Returns a phrase for the user with the reason why a message was rejected; `address` is its
/// address and `argument` its first argument.
fn reason(rejected: Rejected, address: &str, argument: Value, namespace: &Namespace) -> String {
    let label = |address: &str| address.rsplit('/').next().map(str::to_owned);
    match rejected {
        Rejected::Label => {
            let known: Vec<String> = namespace.triggers().collect();
            let labels: Vec<String> = known.iter().filter_map(|known| label(known)).collect();
            let meant = label(address).map_or_else(String::new, |word| {
                did_you_mean(&word, labels.iter().map(String::as_str))
            });
            let known = if known.is_empty() {
                "none".into()
            } else {
                known.join(", ")
            };
            format!("unknown label; allowed are: {known}{meant}")
        }
        Rejected::Address => {
            format!(
                "unknown address; allowed are: {}",
                namespace.commands_in_words()
            )
        }
        Rejected::ReadOnly => "this address is read-only".into(),
        Rejected::Ambiguous => {
            "the pattern matches different kinds of command; a pattern may match many labels of one kind".into()
        }
        Rejected::Argument { .. } | Rejected::BeatArgument => {
            let takes = rejected.takes().unwrap_or_default();
            format!("the argument is {argument:?}; allowed is {takes}")
        }
    }
}

/// Writes at most one log line per second, and counts the lines that it leaves out.
#[derive(Debug, Default)]
struct Throttle {
    last: Option<Instant>,
    suppressed: u64,
}

impl Throttle {
    fn warn(&mut self, text: impl FnOnce() -> String) {
        let now = Instant::now();
        if self
            .last
            .is_some_and(|last| now.duration_since(last) < LOG_EVERY)
        {
            self.suppressed += 1;
            return;
        }
        match std::mem::take(&mut self.suppressed) {
            0 => tracing::warn!("{}", text()),
            n => tracing::warn!("{} ({n} similar lines suppressed)", text()),
        }
        self.last = Some(now);
    }
}
