//! The beat for WLED: packets of UDP Sound Sync, version 2, with a loudness that falls from beat to
//! beat. In: clock events. Out: datagrams. Thread: "clock". Allocates: never. Source: WLED, "Sound
//! Sync"; the struct `audioSyncPacket` of its usermod AudioReactive. Numbers are little-endian.
//!
//! | bytes | contents |
//! |---|---|
//! | 0..6 | `00002` and a zero |
//! | 8..12, 12..16 | loudness and smoothed loudness, floats from 0 to 255 |
//! | 16 | 1 on a beat, otherwise 0 |
//! | 17 | number of the packet, from 0 to 255 and again |
//! | 18..34 | 16 bands, 0 to 255 |
//! | 36..40 | magnitude of the strongest frequency, up to about 4096 |
//! | 40..44 | strongest frequency, Hz, at least 40 |

use super::metronome::{ClockEvent, PULSES_PER_BEAT};
use corybant_core::show::status::TempoState;

/// Length of a packet.
pub(super) const LENGTH: usize = 44;
/// Loudest value of a beat, and of the first beat of a bar.
const LOUD: [f32; 2] = [200.0, 255.0];
/// Frequency of a beat, Hz: that of a bass drum.
const FREQUENCY_HZ: f32 = 60.0;
/// Magnitude of that frequency at the loudest value.
const MAGNITUDE: f32 = 4096.0;
/// A packet is sent on each second pulse: WLED reads at most 50 packets a second.
const PULSES_PER_PACKET: i64 = 2;

/// Encodes the beat of the show for WLED.
#[derive(Debug)]
pub(super) struct WledBeat {
    number: u8,
    packet: [u8; LENGTH],
}

impl WledBeat {
    /// Creates an encoder whose first packet has the number 0.
    pub(super) fn new() -> Self {
        Self {
            number: 0,
            packet: [0; LENGTH],
        }
    }

    /// Returns the packet for the clock event `event`; `None` if none is sent.
    pub(super) fn encode(
        &mut self,
        event: ClockEvent,
        tempo_state: &TempoState,
    ) -> Option<&[u8; LENGTH]> {
        let ClockEvent::Pulse(pulse, beat) = event else {
            return None;
        };
        if pulse % PULSES_PER_PACKET != 0 {
            return None;
        }
        let is_bar = tempo_state.timeline.bar_position(beat) == 0;
        let left = 1.0 - pulse as f32 / PULSES_PER_BEAT as f32;
        let loudness = if tempo_state.music {
            LOUD[usize::from(is_bar)] * left * left
        } else {
            0.0
        };
        let is_beat = pulse == 0 && tempo_state.music;
        self.write(loudness, is_beat);
        Some(&self.packet)
    }

    fn write(&mut self, loudness: f32, is_beat: bool) {
        let packet = &mut self.packet;
        packet[..6].copy_from_slice(b"00002\0");
        packet[8..12].copy_from_slice(&loudness.to_le_bytes());
        packet[12..16].copy_from_slice(&loudness.to_le_bytes());
        packet[16] = u8::from(is_beat);
        packet[17] = self.number;
        // Low bands are louder, as those of a drum.
        for (band, value) in packet[18..34].iter_mut().enumerate() {
            *value = (loudness / (1.0 + band as f32 / 4.0)) as u8;
        }
        let magnitude = MAGNITUDE * loudness / LOUD[1];
        packet[36..40].copy_from_slice(&magnitude.to_le_bytes());
        packet[40..44].copy_from_slice(&FREQUENCY_HZ.to_le_bytes());
        self.number = self.number.wrapping_add(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use corybant_core::time::{Seconds, Timeline};

    /// Reads a packet as WLED does: the loudness, the peak, the number and the bands.
    fn read(packet: &[u8; LENGTH]) -> (f32, u8, u8, [u8; 16]) {
        assert_eq!(&packet[..6], b"00002\0");
        let float = |at: usize| f32::from_le_bytes(packet[at..at + 4].try_into().unwrap());
        assert_eq!(float(8), float(12));
        assert!((0.0..=4096.0).contains(&float(36)) && float(40) >= 40.0);
        (
            float(8),
            packet[16],
            packet[17],
            packet[18..34].try_into().unwrap(),
        )
    }

    #[test]
    fn the_loudness_falls_from_beat_to_beat_and_silence_is_silent() {
        let mut tempo_state = TempoState {
            timeline: Timeline::steady(0, Seconds(0.0), Seconds(0.5)),
            music: true,
            ..TempoState::default()
        };
        let mut wled = WledBeat::new();
        let mut packets = Vec::new();
        for beat in 0..2 {
            for pulse in 0..24 {
                let event = ClockEvent::Pulse(pulse, beat);
                packets.extend(wled.encode(event, &tempo_state).map(read));
            }
        }
        assert_eq!(packets.len(), 24, "12 for each beat");
        assert_eq!((packets[0].0, packets[0].1, packets[0].2), (255.0, 1, 0));
        assert_eq!(packets[0].3[0], 255);
        assert_eq!(
            (packets[12].0, packets[12].1, packets[12].2),
            (200.0, 1, 12)
        );
        for pair in packets[..12].windows(2) {
            assert!(pair[1].0 < pair[0].0 && pair[1].1 == 0, "{pair:?}");
        }
        tempo_state.music = false;
        let silent = wled.encode(ClockEvent::Pulse(0, 2), &tempo_state);
        assert_eq!(read(silent.unwrap()), (0.0, 0, 24, [0; 16]));
        assert_eq!(wled.encode(ClockEvent::Stop, &tempo_state), None);
    }
}
