//! What a client of the page may do. In: the token of a request. Out: the right. Pure.

/// What a client may do; a later right includes the earlier ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Right {
    /// Look at the stage, and read the state of the show.
    View,
    /// Send cues, too.
    Play,
    /// Change the settings of the show, learn MIDI controls and record takes, too.
    Configure,
}

impl Right {
    /// Returns the name of the right, as the API tells it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::View => "view",
            Self::Play => "play",
            Self::Configure => "configure",
        }
    }
}
