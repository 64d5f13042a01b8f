//! `corybant demo`: the built-in repertoire dances to the built-in track.

use std::sync::Arc;

use tracing::info;

use crate::audio;
use crate::audio::feed::FileFeed;
use crate::config::Config;
use crate::daemon::{self, Recordings, Samples, ShowInputs};
use crate::osc::output::{self, Kind};
use crate::rt::warnings::Warnings;
use corybant_core::cue::list::CueList;

use super::{Outcome, seconds, stop_on_signal};

/// Receiver to which the demo sends plain OSC poses, in addition to VMC.
const PLAIN_RECEIVER: &str = "127.0.0.1:10000";

/// Arguments of `corybant demo`.
#[derive(clap::Args, Debug)]
pub(super) struct DemoArgs {
    /// Stop after N seconds (more than 0) [default: until Ctrl-C]
    #[arg(long, value_name = "N", value_parser = seconds)]
    seconds: Option<f64>,
    /// Do not play the track on the sound card
    #[arg(long)]
    no_sound: bool,
}

/// `corybant demo`: dances the built-in repertoire to the built-in track, which plays on the
/// default audio output unless it is missing or `--no-sound` is given.
///
/// # Errors
/// The show cannot start, for example because a port is in use.
pub(super) fn demo(args: &DemoArgs) -> Outcome {
    let stop = stop_on_signal()?;
    let graph = Arc::new(corybant_repertoire::graph()?);
    let track: Arc<[f32]> = corybant_repertoire::track::render().samples.into();
    let mut config = Config::default();
    config.output.push(output::Settings {
        kind: Kind::Plain,
        to: PLAIN_RECEIVER.into(),
        ..Default::default()
    });
    let playing = match (!args.no_sound).then(|| audio::output::open(track.clone(), true)) {
        Some(Ok(playing)) => Some(playing),
        Some(Err(error)) => {
            info!("{error}; the demo dances silently");
            None
        }
        None => None,
    };
    let samples = match &playing {
        Some(playing) => Samples::Played(playing.feed()),
        None => Samples::File(FileFeed::new(track, true)),
    };
    let inputs = ShowInputs {
        samples,
        cue_list: CueList::default(),
        recordings: Recordings::default(),
        faults: Arc::default(),
        warnings: Warnings::default(),
        setup: None,
    };
    let outcome = daemon::run(&config, &graph.into(), inputs, args.seconds, &stop);
    drop(playing);
    outcome?;
    Ok(())
}
