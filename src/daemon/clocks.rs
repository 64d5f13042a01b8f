//! Opens the clocks of a show: MIDI clock in, Ableton Link, timecode in, clock outputs. In: settings. Out: open
//! ports. Thread: main.

use std::sync::Arc;

use crate::clock::art_net::{self, ArtNetInput};
#[cfg(feature = "link")]
use crate::clock::link;
use crate::clock::midi_in::{self, MidiClockInput, Wanted};
use crate::clock::out::{self, ClockOut};
use crate::config::Config;
use crate::rt::cue_queue::CueQueue;
use corybant_core::fault::Faults;
use corybant_core::timecode::settings::Source;

use super::DaemonError;
use super::surfaces::Watchers;

/// The open clock inputs and outputs of a show: MIDI clock and timecode inputs, Ableton Link session,
/// clock outputs. Dropping this value closes them.
pub(super) struct Clocks {
    /// Receiver of a MIDI clock; `None` if the show file names no port for it.
    midi_in: Option<MidiClockInput>,
    /// Receiver of MIDI timecode on a port of its own.
    timecode_midi: Option<MidiClockInput>,
    art_net: Option<ArtNetInput>,
    #[cfg(feature = "link")]
    link: Option<link::LinkSession>,
    outs: Vec<ClockOut>,
}

impl Clocks {
    /// Opens the clock inputs and outputs that `config` names. Adds to `watchers` a reader of the
    /// show's tempo for the Link session and for each clock output.
    ///
    /// # Errors
    /// [`DaemonError`] if a port is missing or cannot be opened.
    pub(super) fn open(
        config: &Config,
        cues: &CueQueue,
        faults: &Arc<Faults>,
        watchers: &mut Watchers,
    ) -> Result<Self, DaemonError> {
        let port = Some(&config.tempo.midi_clock).filter(|port| !port.is_empty());
        let rate = config.timecode.rate;
        let (mut on_clock, mut on_own, mut address) = (None, None, None);
        match &config.timecode.source {
            Source::Mtc(port) if port.is_empty() => on_clock = Some(rate),
            Source::Mtc(port) => on_own = Some(port),
            Source::ArtNet(listen) => address = Some(listen),
            Source::Off | Source::Ltc(_) | Source::Osc => {}
        }
        let open = |port: &String, clock, timecode| {
            let wanted = Wanted { clock, timecode };
            midi_in::open(port, wanted, cues.clone(), faults.clone())
        };
        let midi_in = port.map(|port| open(port, true, on_clock)).transpose()?;
        let timecode_midi = on_own
            .map(|port| open(port, false, Some(rate)))
            .transpose()?;
        let art_net = address
            .map(|listen| art_net::open(listen, cues.clone(), faults.clone()))
            .transpose()?;
        #[cfg(feature = "link")]
        let link = config
            .tempo
            .joins_link()
            .then(|| link::join(&config.tempo, cues.clone(), watchers.add_tempo_reader()))
            .transpose()
            .map_err(DaemonError::Thread)?;
        #[cfg(not(feature = "link"))]
        if config.tempo.joins_link() {
            return Err(DaemonError::WithoutLink);
        }
        let outs = config.clock_out.iter().map(|settings| {
            out::open(
                settings,
                watchers.add_tempo_reader(),
                cues.clock().clone(),
                faults.clone(),
            )
        });
        let outs = outs.collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            midi_in,
            timecode_midi,
            art_net,
            #[cfg(feature = "link")]
            link,
            outs,
        })
    }

    /// Returns one line of text about each open clock input and output, for the terminal.
    pub(super) fn lines(&self) -> Vec<String> {
        let midi = self
            .midi_in
            .iter()
            .map(|midi| format!("listening clock {}", midi.name()));
        let timecode = self
            .timecode_midi
            .iter()
            .map(|midi| format!("listening timecode {}", midi.name()));
        let art_net = self
            .art_net
            .iter()
            .map(|input| format!("listening art-net {}", input.local_addr()));
        #[cfg(feature = "link")]
        let link = self.link.iter().map(|_| "listening link".to_owned());
        #[cfg(not(feature = "link"))]
        let link = std::iter::empty();
        midi.chain(timecode)
            .chain(art_net)
            .chain(link)
            .chain(
                self.outs
                    .iter()
                    .map(|out| format!("sending clock to {}", out.name())),
            )
            .collect()
    }
}
