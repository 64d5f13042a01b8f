//! MIDI clock and timecode input over JACK; JACK reports the frame of each message. In: a MIDI port
//! of a JACK server. Out: tempo messages, readings of timecode.
//!
//! Thread: JACK's. Real-time: [`ClockHandler::process`] only reads events and pushes tempo
//! messages; it never allocates, locks, logs or waits.

use jack::{Control, MidiIn, Port, PortFlags, ProcessHandler, ProcessScope};

use super::ClockReceiver;
use crate::midi::jack_client::{Active, Block, join, midi_ports, refused};
use crate::midi::{MidiError, find_port};

/// A JACK client that receives a MIDI clock until it is dropped.
pub(super) type Client = Active<ClockHandler>;

/// Converts the MIDI clock in each block of a JACK input port to tempo messages; JACK's thread
/// calls this handler.
pub(super) struct ClockHandler {
    port: Port<MidiIn>,
    receiver: ClockReceiver,
}

impl ProcessHandler for ClockHandler {
    fn process(&mut self, client: &jack::Client, scope: &ProcessScope) -> Control {
        let block = Block::of(client, scope);
        for event in self.port.iter(scope) {
            self.receiver
                .process(event.bytes, block.time_of(event.time));
        }
        Control::Continue
    }
}

/// Registers the input port `corybant_clock:clock_in` (`corybant_timecode:timecode_in` without a
/// clock) on the JACK server, which adds a number if the name is taken. If `source` is not empty, connects the port whose name contains `source` to
/// the input port. Returns the full name of the input port and the client.
///
/// # Errors
/// [`MidiError::NoPort`] or [`MidiError::ManyPorts`] if `source` does not name one port,
/// [`MidiError::Jack`] if the server does not answer or refuses.
pub(super) fn open(source: &str, receiver: ClockReceiver) -> Result<(String, Client), MidiError> {
    let wanted = receiver.wanted;
    let client = join(wanted.client_name())?;
    let source = if source.is_empty() {
        None
    } else {
        Some(find_port(
            source,
            &midi_ports(&client, PortFlags::IS_OUTPUT),
        )?)
    };
    let port = client
        .register_port(wanted.port_name(), MidiIn::default())
        .map_err(refused("register a port with"))?;
    let name = port.name().map_err(refused("name a port of"))?;
    let client = Active::new(client, ClockHandler { port, receiver })?;
    if let Some(source) = source {
        client.connect(&source, &name)?;
    }
    Ok((name, client))
}
