//! Frames as bits on air: without the padding of their payload, and frames that are relayed within others.

use crate::units::SensorId;
use fewbits_core::BitString;
use fewbits_protocol::{CHECK_BYTES, Check, Frame, Kind};

/// The bits of a frame on air. They are its bytes without padding: the check follows the last bit of the payload directly.
pub fn on_air(frame: &Frame<'_>, check: Check) -> BitString {
    let mut bytes = frame.to_bytes(check);
    let padding = 8 * frame.payload.bytes().len() - frame.payload.bits();
    if padding > 0 {
        let check = bytes.len() - CHECK_BYTES;
        for at in check..bytes.len() {
            bytes[at - 1] |= bytes[at] >> (8 - padding);
            bytes[at] <<= padding;
        }
    }
    let bits = 8 * bytes.len() - padding;
    // The bytes contain that many bits by construction.
    BitString::from_bytes(bytes, bits).unwrap_or_default()
}

/// The bytes of a frame that has arrived, to be decoded. Every bit string gives bytes.
pub(crate) fn from_air(bits: &BitString) -> Vec<u8> {
    let mut bytes = bits.bytes().to_vec();
    let padding = 8 * bytes.len() - bits.bits();
    if padding > 0 && bytes.len() > CHECK_BYTES {
        let check = bytes.len() - CHECK_BYTES;
        for at in (check..bytes.len()).rev() {
            bytes[at] = bytes[at] >> padding | bytes[at - 1] << (8 - padding);
        }
        bytes[check - 1] &= 0xff << padding;
    }
    bytes
}

/// A frame that contains another one, whose bits on air are `bits`, on its way to or from `sensor` over several hops.
pub(crate) fn carrying<'a>(frame: &Frame<'_>, bits: &'a BitString, sensor: SensorId) -> Frame<'a> {
    Frame {
        destination: sensor.0,
        ..Frame::new(Kind::Handover, frame.slot, frame.digest, bits.into())
    }
}

/// The bytes of the frame that `frame` contains, if it is relayed: slot and digest are the same. `None` for a belief.
pub(crate) fn carried(frame: &Frame<'_>) -> Option<Vec<u8>> {
    if frame.kind != Kind::Handover {
        return None;
    }
    let bytes = from_air(&frame.payload.into());
    let inner = Frame::decode(&bytes, Check::Whole).ok()?;
    let carries = inner.kind != Kind::Handover && (inner.slot, inner.digest) == (frame.slot, frame.digest);
    carries.then_some(bytes)
}

/// Number of payload bits among the bits of a frame. The header of a contained frame does not count.
pub(crate) fn payload_bits(bits: &BitString) -> usize {
    let overhead = |kind: Kind| 8 * kind.overhead();
    let overhead = match Frame::kind_of(bits.bytes()) {
        Some(Kind::Handover) => {
            let bytes = from_air(bits);
            let carried = Frame::decode(&bytes, Check::Whole)
                .ok()
                .and_then(|frame| carried(&frame));
            overhead(Kind::Handover) + carried.map_or(0, |_| overhead(Kind::Report))
        }
        Some(kind) => overhead(kind),
        None => 0,
    };
    bits.bits().saturating_sub(overhead)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_protocol::Slot;
    use proptest::prelude::*;

    const KINDS: [Kind; 4] = [Kind::Feedback, Kind::Report, Kind::Handover, Kind::Heartbeat];

    fn bit_string() -> impl Strategy<Value = BitString> {
        (prop::collection::vec(any::<u8>(), 0..40), 0_usize..8).prop_map(|(bytes, less)| {
            let bits = (bytes.len() * 8).saturating_sub(less);
            BitString::from_bytes(bytes, bits).unwrap()
        })
    }

    proptest! {
        #[test]
        fn frames_come_back_and_any_bits_are_a_frame_or_an_error(
            payload in bit_string(), slot in any::<u64>(), digest in any::<u32>(), kind in 0_usize..4, noise in bit_string(),
            flip in any::<prop::sample::Index>(),
        ) {
            let kind = KINDS[kind];
            let mut frame = Frame::new(kind, Slot::of_count(slot), digest, (&payload).into());
            if kind == Kind::Handover {
                frame.destination = digest;
            }
            for check in [Check::Whole, Check::Header] {
                let bits = on_air(&frame, check);
                prop_assert_eq!(bits.bits(), payload.bits() + 8 * kind.overhead());
                prop_assert_eq!(payload_bits(&bits), payload.bits());
                let bytes = from_air(&bits);
                prop_assert_eq!(Frame::decode(&bytes, check), Ok(frame));
                let _ = (Frame::decode(&from_air(&noise), check), payload_bits(&noise));
                // The check finds every single inverted bit that it covers.
                let damaged = from_air(&bits.clone().with_flipped(flip.index(bits.bits())));
                let decoded = Frame::decode(&damaged, check);
                match check {
                    Check::Whole => prop_assert!(decoded.is_err()),
                    Check::Header => prop_assert!(decoded.map_or(true, |f| f.slot == frame.slot)),
                }
            }
        }

        #[test]
        fn frames_within_frames(payload in bit_string(), slot in any::<u64>(), digest in any::<u32>()) {
            let inner = Frame::new(Kind::Report, Slot::of_count(slot), digest, (&payload).into());
            let bits = on_air(&inner, Check::Whole);
            let outer = carrying(&inner, &bits, SensorId(3));
            let bytes = carried(&outer).unwrap();
            prop_assert_eq!(Frame::decode(&bytes, Check::Whole), Ok(inner));
            let on_way = on_air(&outer, Check::Whole);
            prop_assert_eq!((on_way.bits(), payload_bits(&on_way)), (bits.bits() + 112, payload.bits()));
            // None within none, and a belief is none.
            prop_assert_eq!(carried(&inner), None);
            prop_assert_eq!(carried(&Frame { digest: !digest, ..outer }), None);
            prop_assert_eq!(carried(&carrying(&outer, &on_way, SensorId(3))), None);
        }
    }
}
