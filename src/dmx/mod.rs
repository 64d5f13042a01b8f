//! DMX inputs of a show: a lighting desk sends cues by sACN or Art-Net. In: UDP datagrams. Out: cues
//! with the times of their arrival, into the show's queue; counters; a warning while no source sends.
//! Thread: "sacn", one for each socket, and "art-net", which timecode shares.
//!
//! | file | contents |
//! |---|---|
//! | `settings` | one `[[dmx_in]]` section of a show file |
//! | `universe` | frames of one universe → cues and counters |
//! | `input` | datagrams → frames of the universes |
//! | `sacn` | the sockets of sACN |

mod input;
mod sacn;
mod settings;
#[cfg(test)]
mod tests;
mod universe;

use std::io;
use std::sync::Arc;

use thiserror::Error;

use crate::clock::datagrams::Listening;
use crate::rt::cue_queue::CueQueue;
use crate::rt::warnings::Warnings;
use crate::rt::worker::Worker;
use corybant_core::cue::CueNames;
use corybant_core::cue::dmx::PatchError;
use corybant_core::fault::Faults;

pub use settings::{Protocol, Settings, check_all};
pub(crate) use universe::{Counts, SourceState};
use universe::{SharedUniverse, Universe};

/// The reasons why DMX cannot be received.
#[derive(Debug, Error)]
pub enum DmxError {
    /// The system refuses a network address or a thread.
    #[error(
        "{key}: cannot receive sACN on {address}: {source}; if another program has this port, stop it; {key}.interface must be an IPv4 address of this computer"
    )]
    Socket {
        /// Path of the settings in the show file.
        key: String,
        /// The network address or the multicast group.
        address: String,
        /// The error that the operating system reported.
        source: io::Error,
    },
    /// The patch names a label or a command that does not exist.
    #[error("{key} {source}")]
    Patch {
        /// Path of the settings in the show file.
        key: String,
        /// The reason.
        source: PatchError,
    },
}

/// The shared parts of a show that DMX inputs use.
#[derive(Clone)]
pub(crate) struct DmxContext {
    /// Queue of cues for the show.
    pub(crate) cues: CueQueue,
    /// Counters of faults.
    pub(crate) faults: Arc<Faults>,
    /// Current warnings of the show.
    pub(crate) warnings: Warnings,
}

/// The open DMX inputs of a show. Dropping the value closes those of sACN.
#[derive(Default)]
pub(crate) struct DmxInputs {
    inputs: Vec<(Settings, SharedUniverse)>,
    _workers: Vec<Worker>,
}

impl DmxInputs {
    /// Opens the inputs with these `settings`. `names` are the names of the labels and scenes of the show. Also
    /// returns the inputs of Art-Net, whose socket the caller opens.
    ///
    /// # Errors
    /// [`DmxError`] of the first input that cannot be opened.
    pub(crate) fn open(
        settings: &[Settings],
        names: CueNames,
        context: &DmxContext,
    ) -> Result<(Self, Vec<Listening>), DmxError> {
        let mut inputs = Vec::new();
        for (number, settings) in (1..).zip(settings) {
            let key = format!("dmx_in {number}");
            let universe = Universe::new(&key, settings, names, context)?;
            inputs.push((settings.clone(), SharedUniverse::new(universe)));
        }
        let workers = sacn::open(&inputs, &context.faults)?;
        let art_net = input::art_net(&inputs, &context.faults);
        let inputs = Self {
            inputs,
            _workers: workers,
        };
        Ok((inputs, art_net))
    }

    /// Returns the settings and the counts of each input, in the order of the show file.
    pub(crate) fn counts(&self) -> impl Iterator<Item = (&Settings, Counts)> {
        let inputs = self.inputs.iter();
        inputs.map(|(settings, universe)| (settings, universe.lock().counts()))
    }

    /// Returns one line of text about each input of sACN, for the terminal.
    pub(crate) fn lines(&self) -> Vec<String> {
        let settings = self.inputs.iter().map(|(settings, _)| settings);
        settings
            .filter(|settings| settings.protocol == Protocol::Sacn)
            .map(|settings| format!("listening sacn {}", settings.places()))
            .collect()
    }
}
