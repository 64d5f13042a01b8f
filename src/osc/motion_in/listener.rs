//! The motion input of a show: hands the latest pose of a live performer to the show. In: UDP
//! datagrams. Out: the latest pose; faults; a warning while no motion arrives. Thread: its own,
//! "motion-in", which ends when the [`MotionListener`] is dropped.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Instant;

use tracing::info;

use super::counter::MotionCounter;
use super::{MotionInError, MotionSocket, Settings};
use crate::rt::latest::Latest;
use crate::rt::show_clock::ShowClock;
use crate::rt::warnings::Warnings;
use crate::rt::worker::{StopSignal, Worker};
use corybant_core::fault::{Fault, Faults};
use corybant_core::motion::live::LivePose;

/// The shared parts of a show that a motion input uses.
#[derive(Clone)]
pub(crate) struct MotionContext {
    /// Clock of the show, on which the poses have their times.
    pub(crate) clock: ShowClock,
    /// Counters of faults.
    pub(crate) faults: Arc<Faults>,
    /// Current warnings of the show.
    pub(crate) warnings: Warnings,
    /// Called with each pose, for the recording of takes.
    pub(crate) record: Arc<dyn Fn(&LivePose) + Send + Sync>,
}

/// A running motion input; dropping the value stops it.
#[derive(Debug)]
pub(crate) struct MotionListener {
    local: SocketAddr,
    counter: MotionCounter,
    _worker: Worker,
}

impl MotionListener {
    /// Starts to receive motion with `settings`; `key` is their path in the show file. Returns the
    /// listener, and the latest pose.
    ///
    /// # Errors
    /// [`MotionInError`] if the system refuses the network address or the thread.
    pub(crate) fn start(
        settings: &Settings,
        key: &str,
        context: &MotionContext,
    ) -> Result<(Self, Latest<LivePose>), MotionInError> {
        let setting = format!("{key}.listen");
        let socket = MotionSocket::open(&settings.listen, &setting)?;
        let local = socket.local_addr();
        let latest = Latest::default();
        let counter = MotionCounter::default();
        let receiver = MotionReceiver {
            about: key.into(),
            socket,
            latest: latest.clone(),
            context: context.clone(),
            sender: None,
            faults: 0,
            counter: counter.clone(),
        };
        let worker = Worker::start("motion-in", move |stop| receiver.run(stop));
        let worker = worker.map_err(|source| MotionInError {
            listen: settings.listen.clone(),
            setting,
            source,
        })?;
        let listener = Self {
            local,
            counter,
            _worker: worker,
        };
        Ok((listener, latest))
    }

    /// Returns the network address at which motion is received; the port is never 0.
    pub(crate) fn local_addr(&self) -> SocketAddr {
        self.local
    }

    /// Returns the counter of what the listener receives.
    pub(crate) fn counter(&self) -> &MotionCounter {
        &self.counter
    }
}

/// The state of the thread that receives motion.
struct MotionReceiver {
    /// Path of the settings in the show file, the subject of the warning.
    about: String,
    socket: MotionSocket,
    latest: Latest<LivePose>,
    context: MotionContext,
    sender: Option<SocketAddr>,
    /// Number of faults that have been counted.
    faults: u64,
    counter: MotionCounter,
}

impl MotionReceiver {
    fn run(mut self, stop: &StopSignal) {
        self.warn();
        while !stop.is_set() {
            let Self {
                socket,
                latest,
                context,
                counter,
                ..
            } = &mut self;
            socket.receive(&mut |pose| {
                let now = Instant::now();
                counter.count_pose(now);
                // Before the start of the show there is no pose to mix.
                if let Some(time) = context.clock.at(now) {
                    let pose = LivePose {
                        time,
                        ..pose.clone()
                    };
                    (context.record)(&pose);
                    latest.publish(pose);
                }
            });
            self.report();
        }
        self.context.warnings.clear(&self.about);
    }

    /// Counts new faults, and logs a change of the sender.
    fn report(&mut self) {
        let faults = self.socket.counts().faults();
        self.context.faults.add(Fault::BadOsc, faults - self.faults);
        self.faults = faults;
        let sender = self.socket.sender();
        self.counter.set(faults, sender);
        if sender == self.sender {
            return;
        }
        self.sender = sender;
        match sender {
            Some(sender) => {
                info!("{}: a performer sends from {sender}", self.about);
                self.context.warnings.clear(&self.about);
            }
            None => self.warn(),
        }
    }

    fn warn(&self) {
        self.context.warnings.set(
            &self.about,
            &format!(
                "no motion arrives at {}, so the dancer dances alone; let the performer's program send VMC there",
                self.socket.local_addr()
            ),
        );
    }
}
