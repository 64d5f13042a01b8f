//! Art-Net with DMX levels: the packet ArtDmx. In: a UDP datagram. Out: a universe and a frame of
//! levels, or the reason why it has none. Thread: any. Allocates: never. Source: Art-Net 4, "ArtDmx".

use std::ops::RangeInclusive;

use super::CHANNELS;
use super::merge::Frame;
use crate::timecode::art_net::{ArtNetError, op_code};

/// Universes: the port addresses of Art-Net, which are net × 256 + sub-net × 16 + universe.
pub const UNIVERSES: RangeInclusive<u16> = 0..=32_767;
/// Longest time between two packets of a source, in seconds; then the source is lost. A sender
/// repeats levels that stay at least every 4 s.
pub const LOST_AFTER_S: f64 = 10.0;

/// Operation code of the packet ArtDmx.
const OP_DMX: u16 = 0x5000;
/// The oldest version of the protocol that has this packet.
const VERSION_MIN: u16 = 14;
/// Priority of each source, as of a source of sACN without a priority of its own.
const PRIORITY: u8 = 100;

/// Returns the universe and the levels of an Art-Net packet; `None` if it is a packet of Art-Net
/// without levels. `source` identifies the sender, such as its network address.
///
/// # Errors
/// [`ArtNetError`] if the datagram is malformed.
pub fn parse(datagram: &[u8], source: [u8; 16]) -> Result<Option<(u16, Frame<'_>)>, ArtNetError> {
    if op_code(datagram)? != OP_DMX {
        return Ok(None);
    }
    let Some((header, rest)) = datagram.split_first_chunk::<18>() else {
        return Err(ArtNetError::Malformed);
    };
    let [
        ..,
        version_high,
        version_low,
        sequence,
        _,
        low,
        net,
        length_high,
        length_low,
    ] = *header;
    let length = usize::from(u16::from_be_bytes([length_high, length_low]));
    let universe = u16::from_be_bytes([net, low]);
    let is_known = u16::from_be_bytes([version_high, version_low]) >= VERSION_MIN;
    let levels = rest
        .get(..length)
        .filter(|levels| is_known && !levels.is_empty() && levels.len() <= CHANNELS)
        .ok_or(ArtNetError::Malformed)?;
    if !UNIVERSES.contains(&universe) {
        return Err(ArtNetError::Malformed);
    }
    let frame = Frame {
        source,
        name: b"",
        priority: PRIORITY,
        // A sender without sequence numbers sends 0.
        sequence: (sequence > 0).then_some(sequence),
        is_terminated: false,
        levels,
    };
    Ok(Some((universe, frame)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const FROM: [u8; 16] = [7; 16];

    #[test]
    fn a_packet_has_a_universe_and_levels() {
        let bytes = b"Art-Net\0\x00\x50\x00\x0e\x09\x00\x12\x01\x00\x04\x01\x02\x03\x04pad";
        let (universe, frame) = parse(bytes, FROM).unwrap().unwrap();
        assert_eq!((universe, frame.levels), (0x112, &[1, 2, 3, 4][..]));
        assert_eq!((frame.sequence, frame.priority), (Some(9), 100));
        assert_eq!(frame.source, FROM);
    }

    #[test]
    fn an_independent_writer_is_understood() {
        use artnet_protocol::{ArtCommand, Output};
        let levels: Vec<u8> = (0..=255).chain(0..=255).collect();
        let command = ArtCommand::Output(Output {
            port_address: 300.try_into().unwrap(),
            data: levels.clone().into(),
            sequence: 0,
            ..Output::default()
        });
        let bytes = command.write_to_buffer().unwrap();
        let (universe, frame) = parse(&bytes, FROM).unwrap().unwrap();
        assert_eq!((universe, frame.sequence), (300, None));
        assert_eq!(frame.levels, levels);
        let poll = ArtCommand::Poll(artnet_protocol::Poll::default());
        assert_eq!(parse(&poll.write_to_buffer().unwrap(), FROM), Ok(None));
    }

    #[test]
    fn malformed_packets_are_errors() {
        let right = *b"Art-Net\0\x00\x50\x00\x0e\x09\x00\x12\x01\x00\x02\x01\x02";
        assert!(parse(&right, FROM).unwrap().is_some());
        for length in 10..right.len() {
            let cut = parse(&right[..length], FROM);
            assert_eq!(cut, Err(ArtNetError::Malformed), "{length} bytes");
        }
        assert_eq!(parse(b"Art-Nut\0\0\x50", FROM), Err(ArtNetError::NoArtNet));
        for (at, value) in [(11, 13), (15, 128), (16, 3), (17, 0)] {
            let mut wrong = right;
            wrong[at] = value;
            let error = parse(&wrong, FROM);
            assert_eq!(error, Err(ArtNetError::Malformed), "byte {at}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_parsed_or_refused(tail in proptest::collection::vec(any::<u8>(), 0..600), has_id: bool) {
            let bytes = if has_id { [&b"Art-Net\0\x00\x50\x00\x0e"[..], &tail].concat() } else { tail };
            if let Ok(Some((universe, frame))) = parse(&bytes, FROM) {
                prop_assert!(UNIVERSES.contains(&universe) && (1..=CHANNELS).contains(&frame.levels.len()));
            }
        }
    }
}
