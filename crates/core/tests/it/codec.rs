//! Bits: what is written is read back, and arbitrary bits never panic.

use fewbits_core::bits::{BitReader, BitString, BitWriter, CodecError};
use fewbits_core::message::{Cell, Observation, Sign, laws};
use proptest::prelude::*;

proptest! {
    #[test]
    fn fields_are_read_back(fields in prop::collection::vec((any::<u64>(), 0_u32..=64), 0..40)) {
        let fields: Vec<(u64, u32)> =
            fields.into_iter().map(|(v, w)| (if w == 64 { v } else { v & ((1 << w) - 1) }, w)).collect();
        let mut writer = BitWriter::new();
        for (value, width) in &fields {
            writer.write(*value, *width).unwrap();
        }
        let total: u32 = fields.iter().map(|f| f.1).sum();
        let message = writer.finish();
        prop_assert_eq!(message.bits(), total as usize);
        prop_assert_eq!(message.bytes().len(), (total as usize).div_ceil(8));
        let mut reader = BitReader::new(&message);
        for (value, width) in &fields {
            prop_assert_eq!(reader.read(*width).unwrap(), *value);
        }
        prop_assert!(reader.finish().is_ok());
    }

    #[test]
    fn reading_arbitrary_bits_is_total(bytes in prop::collection::vec(any::<u8>(), 0..8), widths in prop::collection::vec(0_u32..80, 0..8)) {
        let bits = bytes.len() * 8;
        let message = BitString::from_bytes(bytes, bits).unwrap();
        let mut reader = BitReader::new(&message);
        for width in widths {
            let before = reader.remaining();
            if reader.read(width).is_err() {
                prop_assert_eq!(reader.remaining(), before);
            }
        }
        prop_assert!(laws::decoding_is_total::<Sign>(&message, &()));
    }
}

#[test]
fn a_sign_is_one_bit() {
    for sign in [Sign::Above, Sign::Below] {
        assert_eq!(laws::round_trip(&sign, &()).unwrap(), 1);
        assert_eq!(Sign::try_from(sign.value() as i32).unwrap(), sign);
    }
    assert_eq!(Sign::of(1.0, 1.0), Sign::Above);
    assert!(Sign::try_from(0).is_err());
}

#[test]
fn misuse_is_refused_and_writes_nothing() {
    let mut writer = BitWriter::new();
    assert_eq!(writer.write(4, 2), Err(CodecError::ValueTooLarge { value: 4, width: 2 }));
    assert_eq!(writer.write(0, 65), Err(CodecError::FieldTooWide { width: 65 }));
    assert_eq!(writer.bits(), 0);
    assert!(BitString::from_bytes(vec![0], 9).is_err());
    let two = BitString::from_bytes(vec![0b1100_0000], 2).unwrap();
    let mut reader = BitReader::new(&two);
    assert!(reader.read_bit().unwrap());
    assert_eq!(reader.finish(), Err(CodecError::TrailingBits { left: 1 }));
    assert_eq!(two.clone().with_flipped(1).bytes(), [0b1000_0000]);
    assert_eq!(two.clone().with_flipped(7), two);
}

#[test]
fn silence_is_not_loss() {
    assert_ne!(Observation::<Sign>::Silent, Observation::Lost);
    assert_eq!(Observation::Received(Sign::Above).received(), Some(&Sign::Above));
    assert!(Cell::new(1.0, 1.0).is_err() && Cell::new(f64::NAN, 1.0).is_err());
    let above = Cell::of_sign(Sign::Above, 0.5).unwrap();
    assert!(above.contains(0.5) && !above.contains(0.4));
}
