//! Presets of clock outputs: the tempo in the protocols of other programs. In: nothing. Out: messages
//! and default receivers. Thread: any.
//!
//! | preset | protocol | sources |
//! |---|---|---|
//! | `resolume` | OSC to port 7000 | Resolume's range of tempo is 20 to 500, which OSC gives as 0 to 1 |
//! | `grandma3` | OSC to port 8000 | grandMA3 manual, "OSC" (no bundles) and "Speed Masters" |
//! | `madmapper` | OSC to port 8010 | no documented address of the tempo: assign it by OSC learn |
//! | `os2l` | JSON over TCP | os2l.org |
//! | `wled` | UDP Sound Sync, version 2 | WLED's page "Sound Sync" |

use serde::{Deserialize, Serialize};

use super::template::{Argument, MessageTemplate, When};

/// A program or protocol to which the beat is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// Resolume Arena and Avenue.
    Resolume,
    /// grandMA3, speed master 1.
    Grandma3,
    /// MadMapper.
    Madmapper,
    /// Open Sound to Light: the lighting programs that VirtualDJ connects to.
    Os2l,
    /// WLED with AudioReactive.
    Wled,
}

impl Preset {
    /// Returns the receiver that applies if the show file names none; empty for a receiver that is
    /// looked for by multicast DNS.
    pub(super) fn receiver(self) -> &'static str {
        match self {
            Self::Resolume => "127.0.0.1:7000",
            Self::Grandma3 => "127.0.0.1:8000",
            Self::Madmapper => "127.0.0.1:8010",
            Self::Os2l => "",
            Self::Wled => "239.0.0.1:11988",
        }
    }

    /// Returns the OSC messages of the preset; none for a protocol without OSC.
    pub(super) fn messages(self) -> Vec<MessageTemplate> {
        let text = |text: &str| Argument::Text(text.into());
        match self {
            Self::Resolume => vec![
                MessageTemplate::new(
                    "/composition/tempocontroller/tempo",
                    When::Tempo,
                    vec![text("bpm:20:500")],
                ),
                MessageTemplate::new(
                    "/composition/tempocontroller/resync",
                    When::Start,
                    vec![Argument::Int(1)],
                ),
            ],
            Self::Grandma3 => vec![MessageTemplate::new(
                "/cmd",
                When::Tempo,
                vec![text("=Master 3.1 At BPM {bpm}")],
            )],
            Self::Madmapper => vec![
                MessageTemplate::new("/bpm", When::Tempo, vec![text("bpm")]),
                MessageTemplate::new("/beat", When::Beat, vec![text("beat")]),
            ],
            Self::Os2l | Self::Wled => Vec::new(),
        }
    }
}
