//! Art-Net timecode: the packet ArtTimeCode. In: a UDP datagram. Out: a place in timecode, or the
//! reason why it has none. Thread: any. Allocates: never. Source: Art-Net 4, "ArtTimeCode".

use smpte_timecode::{Fields, FrameRate, Timecode};
use thiserror::Error;

use super::Place;

/// UDP port of Art-Net.
pub const PORT: u16 = 6454;
/// The first bytes of each Art-Net packet.
const ID: &[u8; 8] = b"Art-Net\0";
/// Operation code of the packet ArtTimeCode.
const OP_TIME_CODE: u16 = 0x9700;
/// The oldest version of the protocol that has this packet.
const VERSION_MIN: u16 = 14;
/// Number of bytes of the packet; longer packets are allowed, as for all packets of Art-Net.
const LENGTH: usize = 19;

/// The reasons why a datagram is no timecode.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum ArtNetError {
    /// The datagram is not a packet of Art-Net.
    #[error("it is no Art-Net packet")]
    NoArtNet,
    /// The packet of timecode is too short, or of an old version of the protocol.
    #[error("it is shorter than 19 bytes or its version is below 14")]
    Malformed,
    /// The packet has an unknown frame rate or a frame that does not exist.
    #[error("its frame rate or its frame does not exist")]
    Frame,
}

/// Returns the place in timecode of an Art-Net packet; `None` if it is a packet of Art-Net without
/// timecode, such as the light levels that share its port.
///
/// ```
/// let packet = b"Art-Net\0\x00\x97\x00\x0e\0\0\x18\x03\x02\x01\x01";
/// assert!(corybant_core::timecode::art_net::parse(packet).unwrap().is_some());
/// ```
///
/// # Errors
/// [`ArtNetError`] if the datagram is malformed.
pub fn parse(datagram: &[u8]) -> Result<Option<Place>, ArtNetError> {
    let rest = datagram.strip_prefix(ID).ok_or(ArtNetError::NoArtNet)?;
    match rest {
        [low, high, ..] if u16::from_le_bytes([*low, *high]) != OP_TIME_CODE => return Ok(None),
        [_, _, ..] => {}
        _ => return Err(ArtNetError::NoArtNet),
    }
    let [
        _,
        _,
        version_high,
        version_low,
        _,
        _,
        frames,
        seconds,
        minutes,
        hours,
        kind,
        ..,
    ] = *rest
    else {
        return Err(ArtNetError::Malformed);
    };
    if u16::from_be_bytes([version_high, version_low]) < VERSION_MIN {
        return Err(ArtNetError::Malformed);
    }
    let rate = match kind {
        0 => FrameRate::FPS_24,
        1 => FrameRate::FPS_25,
        2 => FrameRate::FPS_29_97_DF,
        3 => FrameRate::FPS_30,
        _ => return Err(ArtNetError::Frame),
    };
    let fields = Fields {
        hours,
        minutes,
        seconds,
        frames,
    };
    Timecode::from_fields(fields, rate).map_err(|_| ArtNetError::Frame)?;
    Ok(Some(Place::Frame {
        fields,
        rate: Some(rate),
        drops: rate.is_drop_frame(),
        after_frames: 0.0,
    }))
}

/// Returns the packet ArtTimeCode of a frame. A rate that Art-Net does not have is sent as the one
/// with the same number of frames in a second.
pub fn packet(timecode: Timecode) -> [u8; LENGTH] {
    let Fields {
        hours,
        minutes,
        seconds,
        frames,
    } = timecode.fields();
    let rate = timecode.rate();
    let kind = match (rate.nominal(), rate.is_drop_frame()) {
        (24, _) => 0,
        (25, _) => 1,
        (_, true) => 2,
        _ => 3,
    };
    let mut packet = [0; LENGTH];
    packet[..8].copy_from_slice(ID);
    packet[8..10].copy_from_slice(&OP_TIME_CODE.to_le_bytes());
    packet[10..12].copy_from_slice(&VERSION_MIN.to_be_bytes());
    packet[14..].copy_from_slice(&[frames, seconds, minutes, hours, kind]);
    packet
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn packets_of_all_rates_are_parsed() {
        for rate in [
            FrameRate::FPS_24,
            FrameRate::FPS_25,
            FrameRate::FPS_29_97_DF,
            FrameRate::FPS_30,
        ] {
            let sent = Timecode::from_frames(1_234_567, rate).unwrap();
            let Ok(Some(Place::Frame {
                fields, rate: read, ..
            })) = parse(&packet(sent))
            else {
                panic!("{rate:?}");
            };
            assert_eq!((fields, read), (sent.fields(), Some(rate)));
        }
    }

    #[test]
    fn other_packets_are_no_timecode_and_malformed_ones_are_errors() {
        assert_eq!(parse(b""), Err(ArtNetError::NoArtNet));
        assert_eq!(parse(b"/panic\0\0"), Err(ArtNetError::NoArtNet));
        // ArtDmx, ArtPoll.
        assert_eq!(parse(b"Art-Net\0\x00\x50\x00\x0e"), Ok(None));
        assert_eq!(parse(b"Art-Net\0\x00\x20\x00\x0e"), Ok(None));
        let right = packet(Timecode::from_frames(0, FrameRate::FPS_25).unwrap());
        assert_eq!(parse(&right[..18]), Err(ArtNetError::Malformed));
        for (at, value, error) in [
            (11, 13, ArtNetError::Malformed),
            (14, 25, ArtNetError::Frame),
            (15, 60, ArtNetError::Frame),
            (17, 24, ArtNetError::Frame),
            (18, 4, ArtNetError::Frame),
        ] {
            let mut wrong = right;
            wrong[at] = value;
            assert_eq!(parse(&wrong), Err(error), "byte {at}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_parsed_or_refused(tail in proptest::collection::vec(any::<u8>(), 0..40), has_id: bool) {
            let bytes = if has_id { [&b"Art-Net\0\x00\x97\x00\x0e"[..], &tail].concat() } else { tail };
            if let Ok(Some(Place::Frame { fields, .. })) = parse(&bytes) {
                prop_assert!(fields.hours < 24 && fields.minutes < 60 && fields.seconds < 60 && fields.frames < 30);
            }
        }
    }
}
