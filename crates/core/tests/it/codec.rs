//! Bits: what is written is read back, and arbitrary bits never panic.

use fewbits_core::bits::{BitReader, BitString, BitWriter, CodecError};
use fewbits_core::laws::message as laws;
use fewbits_core::{Cell, Link, Observation, Sign};
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

    /// Messages within messages, at any place of a byte.
    #[test]
    fn messages_are_appended_and_read_back(parts in prop::collection::vec((prop::collection::vec(any::<u8>(), 0..40), 0_usize..8), 0..6)) {
        let parts: Vec<BitString> = parts
            .into_iter()
            .map(|(bytes, less)| {
                let bits = (bytes.len() * 8).saturating_sub(less);
                let whole = BitString::from_bytes(bytes, bits).unwrap();
                let mut writer = BitWriter::new();
                for bit in 0..bits {
                    writer.write(u64::from(whole.bytes()[bit / 8] >> (7 - bit % 8) & 1), 1).unwrap();
                }
                writer.finish()
            })
            .collect();
        let mut writer = BitWriter::new();
        parts.iter().for_each(|part| writer.append(part));
        let message = writer.finish();
        let mut reader = BitReader::new(&message);
        for part in &parts {
            prop_assert_eq!(&reader.read_message(part.bits()).unwrap(), part);
        }
        prop_assert!(reader.read_message(1).is_err());
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
    assert_eq!(Sign::of(1.0, 1.0), Ok(Sign::Above));
    assert!(Sign::of(f64::NAN, 1.0).is_err() && Sign::of(0.0, f64::INFINITY).is_err());
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
    assert_eq!(reader.read(1), Ok(1));
    assert_eq!(reader.finish(), Err(CodecError::TrailingBits { left: 1 }));
    assert_eq!(two.clone().with_flipped(1).bytes(), [0b1000_0000]);
    assert_eq!(two.clone().with_flipped(7), two);
}

#[test]
fn nothing_is_not_erased() {
    assert_ne!(Observation::<Sign>::Nothing, Observation::Lost);
    assert_eq!(Observation::Received(Sign::Above).received(), Some(&Sign::Above));
    assert!(Cell::new(1.0, 1.0).is_err() && Cell::new(f64::NAN, 1.0).is_err());
    // P(1.5 <= 1 + N(0, 4) < 3) = Phi(1) - Phi(1/4).
    let inside = Cell::new(1.5, 3.0).unwrap().log_probability(1.0, 2.0);
    assert!((inside.exp() - (0.841_344_746_068_542_9 - 0.598_706_325_682_923_7)).abs() < 1e-15);
    let above = Cell::new(0.5, f64::INFINITY).unwrap();
    assert!(above.contains(0.5) && !above.contains(0.4));
}

/// Frequencies of what a link delivers are those it promises.
#[test]
fn a_link_loses_and_inverts_as_it_says() {
    let link = Link::new(0.25, 0.1).unwrap().with_erasure(0.2).unwrap();
    let mut rng = fewbits_monte_carlo::Stream::new(3).rng();
    let n = 40_000;
    let (mut nothing, mut inverted, mut lost) = (0, 0, 0);
    for _ in 0..n {
        match link.transmit(&mut rng, Some(&Sign::Above), &()).unwrap() {
            Observation::Nothing => nothing += 1,
            Observation::Received(Sign::Below) => inverted += 1,
            Observation::Received(Sign::Above) => {}
            Observation::Lost => lost += 1,
        }
    }
    for (count, p) in [(nothing, 0.25), (inverted, 0.055), (lost, 0.2)] {
        let error = (p * (1.0 - p) / f64::from(n)).sqrt();
        assert!((f64::from(count) / f64::from(n) - p).abs() < 4.0 * error);
    }
    let words: f64 = (0..8).map(|received| link.word_probability(5, received, 3)).sum();
    assert!((words - 1.0).abs() < 1e-15);
    assert_eq!(link.transmit::<Sign, _>(&mut rng, None, &()).unwrap(), Observation::Nothing);
}

#[test]
fn an_empty_field_leaves_no_byte_and_a_cleared_writer_begins_again() {
    let mut writer = BitWriter::with_capacity(20);
    writer.write(0, 0).unwrap();
    assert_eq!((writer.bits(), writer.clone().finish().bytes()), (0, &[][..]));
    writer.write(0xab, 8).unwrap();
    writer.write(0, 0).unwrap();
    writer.write(0x5, 3).unwrap();
    writer.write(0x1f3, 9).unwrap();
    assert_eq!(writer.clone().finish().bytes(), [0xab, 0b1011_1111, 0b0011_0000]);
    assert_eq!(writer.bits(), 20);
    writer.clear();
    writer.write(0x3, 2).unwrap();
    assert_eq!((writer.bits(), writer.finish().bytes()), (2, &[0xc0][..]));
}

/// Defect: bits behind the end of a message were kept, so that equal messages compared unequal.
#[test]
fn padding_is_no_part_of_a_message() {
    let padded = BitString::from_bytes(vec![0b1010_1111, 0xff], 4).unwrap();
    assert_eq!(padded, BitString::from_bytes(vec![0b1010_0000], 4).unwrap());
    assert_eq!((padded.bits(), padded.bytes()), (4, &[0b1010_0000][..]));
    let mut writer = BitWriter::new();
    writer.append(&padded);
    writer.write(0, 4).unwrap();
    assert_eq!(writer.clone().finish().bytes(), [0b1010_0000]);
    assert_eq!(BitString::from_bytes(vec![0xff], 0).unwrap(), BitString::default());
}
