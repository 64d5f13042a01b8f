//! The beat network as a [`FrontEnd`]: a causal convolutional recurrent network on a spectrum.
//!
//! In: hops of samples.
//! Out: activations of beat and downbeat, tempo likelihoods.
//! Thread: show; made on any thread.
//! Allocates: never after [`Net::from_bytes`].
//!
//! ```text
//! samples ─▶ two spectra: band levels and rises ─▶ network: local sound and metre
//!         ─▶ activation, tempo likelihoods
//! ```
//! R. Vogl and others, "Drum transcription via joint beat and drum modeling using convolutional
//! recurrent neural networks" (ISMIR 2017), here without look-ahead; S. Böck, M. Davies and P.
//! Knees, "Multi-task learning of tempo and beat" (ISMIR 2019), for the tempo.

pub(crate) mod dense;
pub mod error;
pub mod file;
pub mod network;
pub(crate) mod recurrent;
pub(crate) mod tensors;

use crate::beat::activation::net::error::NetError;
use crate::beat::activation::net::network::Network;
use crate::beat::activation::{Activation, FrontEnd};
use crate::dsp::ACTIVATION_HOP;
use crate::dsp::spectrum::{LONG_WINDOW, SHORT_WINDOW, Spectrum};
use crate::time::Seconds;

/// Bytes of the weight file that is built into the program; `CARD.md` in this folder describes how
/// the weights were trained.
const WEIGHTS: &[u8] = include_bytes!("weights.safetensors");

/// A front end that computes a spectrum from the samples, and activations from the spectrum with
/// the beat network.
pub struct Net {
    short: Spectrum,
    long: Spectrum,
    /// Input of the network in the last hop: the levels of all spectrum bands, then the rises of
    /// the same bands. The bands of the short window come first, followed by those of the long
    /// window.
    features: Vec<f32>,
    network: Network,
    delay: Seconds,
    tempi_bpm: Vec<f32>,
}

impl Net {
    /// Creates a front end that has processed no samples, with the built-in weights of the beat
    /// network.
    ///
    /// # Errors
    /// [`NetError`] if the built-in weights are damaged.
    pub fn new() -> Result<Self, NetError> {
        Self::from_bytes(WEIGHTS)
    }

    /// Creates a front end with the weights in `bytes`, which must be a weight file in the
    /// safetensors format of this program. No sample is processed yet.
    ///
    /// # Errors
    /// [`NetError`] if `bytes` is not a weight file, is damaged, or is for a spectrum with another
    /// number of bands.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, NetError> {
        let (short, long) = (Spectrum::new(SHORT_WINDOW), Spectrum::new(LONG_WINDOW));
        let bands = short.bands() + long.bands();
        let weights = file::read(bytes, bands)?;
        let delay = Seconds(f64::from(weights.delay_s));
        let tempi_bpm = weights.tempi_bpm.clone();
        Ok(Self {
            short,
            long,
            features: vec![0.0; 2 * bands],
            network: Network::new(weights),
            delay,
            tempi_bpm,
        })
    }

    /// Returns the spectrum of the last processed hop, computed with the short analysis window of
    /// 46 ms.
    pub fn spectrum(&self) -> &Spectrum {
        &self.short
    }

    /// Returns the spectrum of the last processed hop, computed with the long analysis window of
    /// 93 ms.
    pub fn long_spectrum(&self) -> &Spectrum {
        &self.long
    }
}

impl FrontEnd for Net {
    fn hop(&mut self, samples: &[f32; ACTIVATION_HOP]) -> Activation {
        self.short.hop(samples);
        self.long.hop(samples);
        let parts = [
            self.short.levels(),
            self.long.levels(),
            self.short.rises(),
            self.long.rises(),
        ];
        let mut start = 0;
        for part in parts {
            self.features[start..start + part.len()].copy_from_slice(part);
            start += part.len();
        }
        self.network.hop(&self.features)
    }

    fn levels(&self) -> &[f32] {
        self.short.levels()
    }

    fn delay(&self) -> Seconds {
        self.delay
    }

    fn tempo_likelihoods(&self) -> &[f32] {
        self.network.tempo_likelihoods()
    }

    fn tempi(&self) -> &[f32] {
        &self.tempi_bpm
    }
}
