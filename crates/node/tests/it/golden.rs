//! The golden vectors give the same messages on this machine.

use fewbits_node::golden::{Hash, RECORDS, Scheme, VERSION, Vectors, hash};

/// Runs a scheme over the inputs of its file.
fn assert_file(scheme: Scheme, name: &str) {
    let path = format!("{}/tests/golden/v1/{name}.bin", env!("CARGO_MANIFEST_DIR"));
    let bytes = std::fs::read(path).unwrap();
    let (header, mut rest) = bytes.split_at(12);
    assert_eq!(&header[..6], [b'f', b'b', b'g', b'v', VERSION, scheme as u8], "{name}");
    let width = usize::from(u16::from_le_bytes([header[6], header[7]]));
    assert_eq!(header[8..12], RECORDS.to_le_bytes(), "{name}");
    let mut vectors = Vectors::new(scheme).unwrap();
    for record in 0..RECORDS {
        let (input, message) = vectors.next_record().unwrap();
        let packet = message.unwrap_or_default();
        let count = packet.byte_count();
        assert_eq!(input.bytes(), &rest[..width], "{name}, input {record}");
        assert_eq!(u32::from(rest[width]), packet.bits(), "{name}, length {record}");
        assert_eq!(packet.to_bytes()[..count], rest[width + 1..width + 1 + count], "{name}, message {record}");
        rest = &rest[width + 1 + count..];
    }
    assert!(rest.is_empty(), "{name}");
}

#[test]
fn files_hold_these_messages() {
    for (scheme, name) in Scheme::ALL {
        assert_file(scheme, name);
    }
}

/// Printed by the adaptive codec before it was moved here: the same signal through its own `Sensor`.
#[test]
fn adaptive_messages_are_those_of_the_first_release() {
    let mut vectors = Vectors::new(Scheme::Adaptive).unwrap();
    let mut sum = Hash::START;
    for n in 1..=100_000 {
        sum.add(vectors.next_record().unwrap().1);
        match n {
            1_000 => assert_eq!(sum.0, 0x8591_41dc_ecfe_88f6),
            10_000 => assert_eq!(sum.0, 0xf9d1_413d_0edb_415a),
            _ => {}
        }
    }
    assert_eq!(sum.0, 0x0eda_ea99_8f54_942e);
}

#[test]
fn sums_tell_messages_apart() {
    let mut sums: Vec<u64> = Scheme::ALL
        .iter()
        .map(|(scheme, _)| hash(*scheme, 100).unwrap())
        .collect();
    sums.sort_unstable();
    sums.dedup();
    assert_eq!(sums.len(), Scheme::ALL.len());
}
