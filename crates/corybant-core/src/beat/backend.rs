//! The backend of a beat tracker: finds tempo and phase, either from single detected beats or from
//! activations.
//!
//! In: hops of samples. Out: a beat grid whenever the grid is new or corrected.
//! Thread: show.
//! Allocates: never after `new`.

use super::BeatDetector;
use super::activation::FrontEnd;
use super::metre::features::{BeatOdds, DownbeatFeatures, HOPS};
use super::tempo::bass_phase::BassPhase;
use super::tempo::estimate_follower::EstimateFollower;
use super::tempo::hypothesis::TempoHypothesis;
use super::tempo::period_range::PeriodRange;
use crate::dsp::decimator::Decimator;
use crate::dsp::{ACTIVATION_HOP, HOP, SAMPLE_RATE};
use crate::time::BeatGrid;

/// Greatest distance, in seconds, of a hop from the expected activation peak of a beat. Only hops
/// that end within this distance count for the downbeat activation of the beat.
const DOWNBEAT_WINDOW_S: f64 = 0.05;

/// The part of a beat tracker that finds tempo and phase of the beats, by one of two methods.
pub(super) enum TrackerBackend {
    /// Method 1: a detector reports single beats, and a follower fits a beat grid to these beats.
    Event(Box<EventTracker>),
    /// Method 2: a front end computes activations from the samples, and a hidden Markov model finds
    /// the beats in the activations.
    Activation(Box<ActivationTracker>),
}

/// A beat detector, and the follower that fits a beat grid to the single beats that the detector
/// reports.
pub(super) struct EventTracker {
    detector: Box<dyn BeatDetector>,
    follower: EstimateFollower,
    bass: BassPhase,
    /// True if a performer set the phase of the beat grid. The grid is then not shifted by half a
    /// beat, even if the bass is stronger on the off-beats.
    phase_held: bool,
}

/// A front end that computes activations from samples, and the tempo hypothesis that follows these
/// activations.
pub(super) struct ActivationTracker {
    front_end: Box<dyn FrontEnd>,
    hypothesis: TempoHypothesis,
    /// Samples of the incomplete activation hop. Only the first `filled` entries are valid.
    samples: [f32; ACTIVATION_HOP],
    filled: usize,
    /// Ring buffer of the downbeat activations of the latest hops. An entry is the sample time at
    /// the end of the hop (seconds) and the downbeat activation of the hop.
    downbeats: [(f64, f32); HOPS],
    next_downbeat: usize,
    /// Time of a beat (seconds) and the log odds that it is the first of a bar of four beats, from
    /// the phase classifier; `None` once they were used.
    bar_start: Option<(f64, f32)>,
    decimator: Decimator,
    features: DownbeatFeatures,
}

impl TrackerBackend {
    /// Creates a backend that fits a beat grid to the beats that `detector` reports. Beat periods
    /// stay within `range` (seconds).
    pub(super) fn event(detector: Box<dyn BeatDetector>, range: PeriodRange) -> Self {
        Self::Event(Box::new(EventTracker {
            detector,
            follower: EstimateFollower::new(range),
            bass: BassPhase::new(),
            phase_held: false,
        }))
    }

    /// Creates a backend that finds beats in the activations that `front_end` computes. Beat
    /// periods stay within `range` (seconds).
    pub(super) fn activation(front_end: Box<dyn FrontEnd>, range: PeriodRange) -> Self {
        let hypothesis = TempoHypothesis::new(range, front_end.as_ref());
        Self::Activation(Box::new(ActivationTracker {
            front_end,
            hypothesis,
            samples: [0.0; ACTIVATION_HOP],
            filled: 0,
            downbeats: [(f64::NEG_INFINITY, 0.0); HOPS],
            next_downbeat: 0,
            bar_start: None,
            decimator: Decimator::new(),
            features: DownbeatFeatures::new(),
        }))
    }

    /// Processes one hop of `samples`, which ends at sample time `now` (seconds). `active` is true
    /// if the activity gate is open: the input contains music. Returns the beat grid if it is new
    /// or corrected, otherwise `None`.
    pub(super) fn hop(&mut self, samples: &[f32; HOP], now: f64, active: bool) -> Option<BeatGrid> {
        match self {
            Self::Event(tracker) => tracker.hop(samples, now, active),
            Self::Activation(tracker) => tracker.hop(samples, now, active),
        }
    }

    /// Tells the backend that one more beat has got its final time. `before` and `beat` are the
    /// sample times (seconds) of the last two beats whose sound is complete. If the bass shows that
    /// the tracked beats are off-beats, returns the grid moved by half a beat; otherwise `None`.
    pub(super) fn beat_scheduled(&mut self, before: f64, beat: f64) -> Option<BeatGrid> {
        let Self::Event(tracker) = self else {
            return None;
        };
        if !tracker.follower.has_beat() {
            tracker.bass.forget();
            tracker.phase_held = false;
            return None;
        }
        if tracker.bass.beat(before, beat) && !tracker.phase_held {
            tracker.follower.shift_half_beat()
        } else {
            None
        }
    }

    /// Returns the downbeat activation, 0..1, of the beat at sample time `time` (seconds): the
    /// greatest value within 0.05 s of the time at which the activation of this beat should peak.
    /// Returns 0 if the backend uses a beat detector instead of activations.
    pub(super) fn downbeat_at(&self, time: f64) -> f32 {
        let Self::Activation(tracker) = self else {
            return 0.0;
        };
        let peak_at = time + tracker.front_end.delay().0;
        let near = tracker
            .downbeats
            .iter()
            .filter(|(at, _)| (at - peak_at).abs() < DOWNBEAT_WINDOW_S);
        near.fold(0.0, |most, &(_, downbeat)| most.max(downbeat))
    }

    /// Processes the sound of the beat from `from` to `to` (sample times in seconds); beats must be
    /// passed in order. Returns the log odds that the *previous* beat is the first of its bar, and
    /// those that bars have three and not four beats.
    pub(super) fn bar_odds(&mut self, from: f64, to: f64) -> BeatOdds {
        match self {
            Self::Event(_) => BeatOdds::default(),
            Self::Activation(tracker) => tracker.features.beat(from, to),
        }
    }

    /// Returns the sample time of a past beat (seconds) and the log odds that it is the first of a
    /// bar of four beats, from its rhythm pattern; `None` if there is no new result. Each result is
    /// returned once.
    pub(super) fn take_bar_start(&mut self) -> Option<(f64, f32)> {
        match self {
            Self::Event(_) => None,
            Self::Activation(tracker) => tracker.bar_start.take(),
        }
    }

    /// Forgets the downbeat features of all past beats. Later beats are then not compared with
    /// them.
    pub(super) fn forget_features(&mut self) {
        if let Self::Activation(tracker) = self {
            tracker.features.forget();
        }
    }

    /// Sets the beat grid to `grid`, which a performer chose. `now` is the present sample time
    /// (seconds).
    pub(super) fn seed(&mut self, grid: BeatGrid, now: f64) {
        match self {
            Self::Event(tracker) => tracker.follower.seed(grid, now),
            Self::Activation(tracker) => tracker.hypothesis.seed(grid, now),
        }
    }

    /// Marks the phase of the beat grid as set by a performer. The backend then does not move the
    /// grid to the off-beats.
    pub(super) fn hold_phase(&mut self) {
        match self {
            Self::Event(tracker) => tracker.phase_held = true,
            Self::Activation(tracker) => tracker.hypothesis.hold_phase(),
        }
    }

    /// Keeps the beat period within half an octave of `period` (seconds), until the tempo of the
    /// music changes clearly or the beats are lost.
    pub(super) fn hold_octave(&mut self, period: f64) {
        match self {
            Self::Event(tracker) => tracker.follower.hold_octave(period),
            Self::Activation(tracker) => tracker.hypothesis.hold_octave(period),
        }
    }

    /// Makes tempi near the beat period `period` (seconds) more probable; `None` ends this. A backend
    /// that uses a beat detector has no such probabilities and ignores the hint.
    pub(super) fn hint(&mut self, period: Option<f64>) {
        match self {
            Self::Event(_) => {}
            Self::Activation(tracker) => tracker.hypothesis.hint(period),
        }
    }

    /// Returns true while there is a beat grid: false before the first grid is found and after the
    /// beats of the music were lost.
    pub(super) fn has_beat(&self) -> bool {
        match self {
            Self::Event(tracker) => tracker.follower.has_beat(),
            Self::Activation(tracker) => tracker.hypothesis.has_beat(),
        }
    }

    /// Returns the confidence: the probability that the next beat of the grid is right, 0..1.
    pub(super) fn confidence(&self) -> f32 {
        match self {
            Self::Event(tracker) => tracker.follower.confidence(),
            Self::Activation(tracker) => tracker.hypothesis.confidence(),
        }
    }
}

impl EventTracker {
    fn hop(&mut self, samples: &[f32; HOP], now: f64, active: bool) -> Option<BeatGrid> {
        self.bass.hop(samples);
        let estimate = self.detector.hop(samples).filter(|_| active);
        let grid = estimate.and_then(|estimate| self.follower.update(estimate));
        self.follower
            .advance(now, HOP as f64 / f64::from(SAMPLE_RATE), active);
        grid
    }
}

impl ActivationTracker {
    fn hop(&mut self, samples: &[f32; HOP], now: f64, active: bool) -> Option<BeatGrid> {
        let mut grid = None;
        for (i, &sample) in samples.iter().enumerate() {
            self.samples[self.filled] = sample;
            self.filled += 1;
            if self.filled == ACTIVATION_HOP {
                self.filled = 0;
                let end = now - (HOP - 1 - i) as f64 / f64::from(SAMPLE_RATE);
                grid = self.activation_hop(end, active).or(grid);
            }
        }
        grid
    }

    /// Processes the samples of a complete activation hop, which ends at sample time `end`
    /// (seconds). `active` is true if the activity gate is open: the input contains music. Returns
    /// the beat grid if it is new or corrected, otherwise `None`.
    fn activation_hop(&mut self, end: f64, active: bool) -> Option<BeatGrid> {
        let activation = self.front_end.hop(&self.samples);
        self.features
            .hop(self.front_end.levels(), &self.decimator.hop(&self.samples));
        self.downbeats[self.next_downbeat] = (end, activation.downbeat);
        self.next_downbeat = (self.next_downbeat + 1) % HOPS;
        let grid = self
            .hypothesis
            .hop(activation, self.front_end.tempo_likelihoods(), end, active);
        self.decide_phase(end).or(grid)
    }

    /// Asks the phase classifier once per beat whether the beat grid lies on the beats of the
    /// music. `end` is the sample time (seconds) at the end of the last hop. Returns the moved grid
    /// if the answer moves the grid by half a beat, otherwise `None`.
    fn decide_phase(&mut self, end: f64) -> Option<BeatGrid> {
        let classifier = self.front_end.phase_classifier()?;
        let Some(grid) = self.hypothesis.grid() else {
            classifier.forget();
            return None;
        };
        let estimate = classifier.update(grid, end)?;
        self.bar_start = Some((estimate.beat, estimate.bar_odds));
        let moved = self.hypothesis.decide_phase(estimate, end)?;
        self.bar_start = None;
        classifier.forget();
        Some(moved)
    }
}
