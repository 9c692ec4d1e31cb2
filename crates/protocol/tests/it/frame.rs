//! The wire format: its bytes, and what is refused.

use fewbits_core::{BitString, Observation};
use fewbits_protocol::{Check, DecodeError, Frame, Kind, Note, Payload, ReportLength, Slot, digest, echo, reports_of};
use proptest::prelude::*;

const KINDS: [Kind; 8] = [
    Kind::Feedback,
    Kind::Report,
    Kind::Echo,
    Kind::Snapshot,
    Kind::Request,
    Kind::Handover,
    Kind::Heartbeat,
    Kind::Acknowledgement,
];

/// CRC-16/XMODEM bit by bit, as the standard states it.
fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |sum: u16, byte| {
        (0..8).fold(sum ^ u16::from(*byte) << 8, |sum, _| sum << 1 ^ if sum >> 15 == 1 { 0x1021 } else { 0 })
    })
}

#[test]
fn the_frame_of_the_documentation() {
    assert_eq!(crc(b"123456789"), 0x31c3);
    let payload = Payload::new(&[0b1011_0000], 4).unwrap();
    let frame = Frame::new(Kind::Report, Slot::of_count(0x0001_0203), 0xdead_beef, payload);
    let mut buffer = [0; 64];
    let bytes = frame.encode(Check::Whole, &mut buffer).unwrap();
    // Version 1, kind 1, padding 4; slot; digest; payload.
    let mut expected = vec![0b01_001_100, 1, 2, 3, 0xde, 0xad, 0xbe, 0xef, 0b1011_0000];
    expected.extend(crc(&expected).to_be_bytes());
    assert_eq!(bytes, expected);
    // Under a check of the header the sum is over eight bytes.
    expected.truncate(9);
    expected.extend(crc(&expected[..8]).to_be_bytes());
    assert_eq!(frame.encode(Check::Header, &mut buffer).unwrap(), expected);
}

#[test]
fn a_future_version_is_named() {
    for version in [0, 2, 3] {
        let bytes = [version << 6, 0, 0];
        let error = Frame::decode(&bytes, Check::Whole).unwrap_err();
        assert_eq!(error, DecodeError::Version { found: version });
        let future = Note::FutureVersion { found: version };
        assert_eq!(Note::from(error) == future, version > 1);
    }
}

#[test]
fn a_short_buffer_is_not_written() {
    let frame = Frame::new(Kind::Request, Slot::default(), 0, Payload::EMPTY);
    assert_eq!(frame.encode(Check::Whole, &mut [0; 9]), None);
    assert!(frame.encode(Check::Whole, &mut [0; 10]).is_some());
}

#[test]
fn slots_are_ordered_around_the_wrap() {
    let (last, first) = (Slot::of_count((1 << 24) - 1), Slot::of_count(1 << 24));
    assert_eq!(first.number(), 0);
    assert!(first.is_after(last) && !last.is_after(first) && !first.is_after(first));
    assert_eq!((last.after(), first.before()), (first, last));
    assert_eq!(first.nearest_count((5 << 24) - 3), 5 << 24);
    assert_eq!(last.nearest_count((5 << 24) + 3), (5 << 24) - 1);
    assert_eq!(last.nearest_count(0), (1 << 24) - 1);
}

fn bits() -> impl Strategy<Value = BitString> {
    (prop::collection::vec(any::<u8>(), 0..40), 0_usize..8).prop_map(|(bytes, less)| {
        let bits = (bytes.len() * 8).saturating_sub(less);
        BitString::from_bytes(bytes, bits).unwrap()
    })
}

proptest! {
    #[test]
    fn frames_come_back(
        payload in bits(), slot in any::<u64>(), sum in any::<u32>(), kind in 0_usize..8, flip in any::<prop::sample::Index>(),
    ) {
        let mut frame = Frame::new(KINDS[kind], Slot::of_count(slot), sum, Payload::from(&payload));
        if frame.kind == Kind::Handover {
            frame.destination = !sum;
        }
        for check in [Check::Whole, Check::Header] {
            let mut buffer = [0; 64];
            let bytes = frame.encode(check, &mut buffer).unwrap();
            prop_assert_eq!(bytes.len(), frame.len());
            prop_assert_eq!(Frame::decode(bytes, check).unwrap(), frame);
            // Every single inverted bit is found that the check covers.
            let mut damaged = bytes.to_vec();
            let at = flip.index(8 * damaged.len());
            damaged[at / 8] ^= 0x80 >> (at % 8);
            match (check, Frame::decode(&damaged, check)) {
                (_, Err(_)) => {}
                (Check::Whole, Ok(_)) => prop_assert!(false, "bit {at} went unnoticed"),
                (Check::Header, Ok(found)) => prop_assert_eq!((found.slot, found.digest), (frame.slot, frame.digest)),
            }
        }
    }

    #[test]
    fn any_bytes_are_a_frame_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..40)) {
        for check in [Check::Whole, Check::Header] {
            let Ok(frame) = Frame::decode(&bytes, check) else { continue };
            let mut buffer = [0; 64];
            prop_assert_eq!(frame.encode(check, &mut buffer).unwrap(), &bytes);
        }
    }

    #[test]
    fn echoes_come_back(reports in prop::collection::vec((0..4, bits()), 0..6), noise in bits()) {
        let observed: Vec<_> = reports.iter().map(|(what, bits)| match what {
            0 => Some(Observation::Nothing),
            1 => Some(Observation::Lost),
            2 => None,
            _ => Some(Observation::Received(bits.clone())),
        }).collect();
        let lengths: Vec<_> = reports.iter().enumerate().map(|(i, (_, bits))| match i % 2 {
            0 => ReportLength::Varying,
            _ => ReportLength::Fixed(bits.bits() as u32),
        }).collect();
        let told = echo(&observed, &lengths).unwrap();
        prop_assert_eq!(reports_of(&told, &lengths).unwrap(), observed);
        let _ = reports_of(&noise, &lengths);
    }
}

#[test]
fn digests_differ_by_slot_and_length() {
    let (one, two) = (Payload::new(&[0], 1).unwrap(), Payload::new(&[0], 2).unwrap());
    let slot = Slot::of_count(3);
    assert_ne!(digest(slot, one), digest(slot, two));
    assert_ne!(digest(slot, one), digest(slot.after(), one));
    // FNV-1a over eight bytes of slot and eight of length, folded: computed by another program.
    assert_eq!(digest(Slot::of_count(1), Payload::EMPTY), FNV_OF_SLOT_1);
}

const FNV_OF_SLOT_1: u32 = 0x74c8_45d5;
