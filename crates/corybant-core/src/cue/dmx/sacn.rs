//! sACN: packets of streaming ACN with DMX levels. In: a UDP datagram. Out: a universe and a frame of
//! levels, or the reason why it has none. Thread: any. Allocates: never. Source: ANSI E1.31-2018,
//! "DMX512-A lightweight streaming protocol".
//!
//! A data packet has three layers, each with a length that must fit into the datagram:
//!
//! | bytes | contents |
//! |---|---|
//! | 0..16 | preamble, with the identifier `ASC-E1.17` |
//! | 16..38 | root layer: length, vector, identifier of the source |
//! | 38..115 | framing layer: length, vector, name, priority, sequence number, options, universe |
//! | 115.. | property layer: length, vector, number of values, start code, levels |
//!
//! Synchronisation is not used: levels count when they arrive.

use std::ops::RangeInclusive;

use thiserror::Error;

use super::CHANNELS;
use super::merge::Frame;

/// UDP port of sACN.
pub const PORT: u16 = 5568;
/// Universes that carry levels.
pub const UNIVERSES: RangeInclusive<u16> = 1..=63_999;
/// Longest time between two packets of a source, in seconds; then the source is lost.
pub const LOST_AFTER_S: f64 = 2.5;

/// Preamble and postamble sizes and the identifier of ACN packets.
const PREAMBLE: &[u8; 16] = b"\0\x10\0\0ASC-E1.17\0\0\0";
/// Vector of a root layer that carries levels.
const VECTOR_DATA: u32 = 4;
/// Vector of a root layer for synchronisation and discovery.
const VECTOR_EXTENDED: u32 = 8;
/// Vector of a framing layer that carries levels.
const VECTOR_FRAME: u32 = 2;
/// Vector, type of address, first address and increment of the property layer.
const PROPERTIES: [u8; 6] = [2, 0xa1, 0, 0, 0, 1];
/// The start of each layer, in bytes from the start of the datagram.
const LAYERS: [usize; 3] = [16, 38, 115];
/// Where the levels begin, in bytes from the start of the datagram.
const LEVELS: usize = 126;
/// Greatest priority of a source.
const PRIORITY_MAX: u8 = 200;
/// Option: the levels are only for a preview.
const OPTION_PREVIEW: u8 = 0x80;
/// Option: the source ends its stream.
const OPTION_TERMINATED: u8 = 0x40;

/// The reasons why a datagram has no levels.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum SacnError {
    /// The datagram is not a packet of ACN.
    #[error("it is no ACN packet")]
    NoAcn,
    /// A layer has an unknown vector or header.
    #[error("one of its layers has an unknown type")]
    Unknown,
    /// The lengths of the layers do not fit to the datagram or to each other.
    #[error("the lengths of its layers are wrong")]
    Length,
    /// The universe or the priority is out of range.
    #[error("its universe is not from 1 to 63999, or its priority is above 200")]
    Range,
}

/// Returns the multicast address (IPv4) of a universe.
///
/// ```
/// assert_eq!(corybant_core::cue::dmx::sacn::group(258), [239, 255, 1, 2]);
/// ```
pub const fn group(universe: u16) -> [u8; 4] {
    let [high, low] = universe.to_be_bytes();
    [239, 255, high, low]
}

/// Returns the universe and the levels of a packet; `None` if it is a packet of sACN without levels
/// for a show: synchronisation, discovery, a preview, or another start code than 0.
///
/// # Errors
/// [`SacnError`] if the datagram is malformed.
pub fn parse(datagram: &[u8]) -> Result<Option<(u16, Frame<'_>)>, SacnError> {
    let rest = datagram.strip_prefix(PREAMBLE).ok_or(SacnError::NoAcn)?;
    match u32_at(rest, 2)? {
        VECTOR_DATA => {}
        VECTOR_EXTENDED => return Ok(None),
        _ => return Err(SacnError::Unknown),
    }
    let end = layers_end(datagram)?;
    let packet = datagram.get(..end).ok_or(SacnError::Length)?;
    if u32_at(packet, 40)? != VECTOR_FRAME || packet.get(117..123) != Some(&PROPERTIES) {
        return Err(SacnError::Unknown);
    }
    let values = usize::from(u16_at(packet, 123)?);
    let (start_code, levels) = packet[LEVELS - 1..]
        .split_first()
        .ok_or(SacnError::Length)?;
    if values != levels.len() + 1 || levels.len() > CHANNELS {
        return Err(SacnError::Length);
    }
    let (priority, sequence, options) = (packet[108], packet[111], packet[112]);
    let universe = u16_at(packet, 113)?;
    if priority > PRIORITY_MAX || !UNIVERSES.contains(&universe) {
        return Err(SacnError::Range);
    }
    if options & OPTION_PREVIEW != 0 || *start_code != 0 {
        return Ok(None);
    }
    let mut source = [0; 16];
    source.copy_from_slice(&packet[22..38]);
    let name = &packet[44..108];
    let frame = Frame {
        source,
        name: name.split(|&byte| byte == 0).next().unwrap_or_default(),
        priority,
        sequence: Some(sequence),
        is_terminated: options & OPTION_TERMINATED != 0,
        levels,
    };
    Ok(Some((universe, frame)))
}

/// Returns where the layers end, in bytes from the start of the datagram. All layers end at the same
/// byte; bytes after it do not belong to the packet.
fn layers_end(datagram: &[u8]) -> Result<usize, SacnError> {
    let end = |start: usize| {
        let flags_and_length = u16_at(datagram, start)?;
        match flags_and_length >> 12 {
            7 => Ok(start + usize::from(flags_and_length & 0x0fff)),
            _ => Err(SacnError::Length),
        }
    };
    let [root, framing, properties] = LAYERS.map(end);
    let (root, framing, properties) = (root?, framing?, properties?);
    if root != framing || framing != properties || root < LEVELS {
        return Err(SacnError::Length);
    }
    Ok(root)
}

fn u16_at(bytes: &[u8], at: usize) -> Result<u16, SacnError> {
    let found = bytes.get(at..).and_then(<[u8]>::first_chunk);
    found
        .copied()
        .map(u16::from_be_bytes)
        .ok_or(SacnError::Length)
}

fn u32_at(bytes: &[u8], at: usize) -> Result<u32, SacnError> {
    let found = bytes.get(at..).and_then(<[u8]>::first_chunk);
    found
        .copied()
        .map(u32::from_be_bytes)
        .ok_or(SacnError::Length)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Returns a packet for universe 258 with priority 100, sequence number 7 and these levels.
    fn packet(levels: &[u8]) -> Vec<u8> {
        let length = |start: usize| 0x7000 | (LEVELS + levels.len() - start) as u16;
        let mut bytes = PREAMBLE.to_vec();
        bytes.extend(length(16).to_be_bytes());
        bytes.extend(VECTOR_DATA.to_be_bytes());
        bytes.extend([9; 16]);
        bytes.extend(length(38).to_be_bytes());
        bytes.extend(VECTOR_FRAME.to_be_bytes());
        let mut name = [0; 64];
        name[..4].copy_from_slice(b"desk");
        bytes.extend(name);
        bytes.extend([100, 0, 0, 7, 0, 1, 2]);
        bytes.extend(length(115).to_be_bytes());
        bytes.extend(PROPERTIES);
        bytes.extend((levels.len() as u16 + 1).to_be_bytes());
        bytes.push(0);
        bytes.extend(levels);
        bytes
    }

    #[test]
    fn a_packet_has_a_universe_a_source_and_levels() {
        let bytes = packet(&[1, 2, 3]);
        let (universe, frame) = parse(&bytes).unwrap().unwrap();
        let expected = Frame {
            source: [9; 16],
            name: b"desk",
            priority: 100,
            sequence: Some(7),
            is_terminated: false,
            levels: &[1, 2, 3],
        };
        assert_eq!((universe, frame), (258, expected));
        let full = packet(&[255; 512]);
        assert_eq!(full.len(), 638, "the length of a full packet in E1.31");
        assert_eq!(parse(&full).unwrap().unwrap().1.levels.len(), 512);
        let padded = [&bytes[..], &[0; 9]].concat();
        assert_eq!(parse(&padded).unwrap().unwrap().1.levels, [1, 2, 3]);
        let mut ended = bytes.clone();
        ended[112] = OPTION_TERMINATED;
        assert!(parse(&ended).unwrap().unwrap().1.is_terminated);
    }

    #[test]
    fn packets_without_levels_for_a_show_are_no_error() {
        for (at, value) in [(112, OPTION_PREVIEW), (125, 0xdd), (21, 8)] {
            let mut other = packet(&[1]);
            other[at] = value;
            assert_eq!(parse(&other), Ok(None), "byte {at}");
        }
    }

    #[test]
    fn malformed_packets_are_errors() {
        assert_eq!(parse(b""), Err(SacnError::NoAcn));
        assert_eq!(parse(b"Art-Net\0"), Err(SacnError::NoAcn));
        let right = packet(&[1, 2]);
        for length in 16..right.len() {
            assert!(parse(&right[..length]).is_err(), "{length} bytes");
        }
        for (at, value, error) in [
            (21, 5, SacnError::Unknown),
            (43, 1, SacnError::Unknown),
            (118, 0, SacnError::Unknown),
            (17, 0xff, SacnError::Length),
            (39, 0, SacnError::Length),
            (115, 0x60, SacnError::Length),
            (124, 2, SacnError::Length),
            (108, 201, SacnError::Range),
            (113, 0xff, SacnError::Range),
        ] {
            let mut wrong = right.clone();
            wrong[at] = value;
            assert_eq!(parse(&wrong), Err(error), "byte {at}");
        }
        let mut zero = right.clone();
        zero[113..115].fill(0);
        assert_eq!(parse(&zero), Err(SacnError::Range));
        assert_eq!(parse(&packet(&[0; 513])), Err(SacnError::Length));
    }

    proptest! {
        #[test]
        fn any_change_of_a_packet_is_parsed_or_refused(at in 0_usize..140, value: u8, cut in 0_usize..140) {
            let mut bytes = packet(&[5; 14]);
            if let Some(byte) = bytes.get_mut(at) {
                *byte = value;
            }
            let length = bytes.len().min(cut.max(16));
            for bytes in [&bytes[..], &bytes[..length]] {
                if let Ok(Some((universe, frame))) = parse(bytes) {
                    prop_assert!(UNIVERSES.contains(&universe) && frame.levels.len() <= CHANNELS);
                    prop_assert!(frame.priority <= PRIORITY_MAX && frame.name.len() <= 64);
                }
            }
        }
    }
}
