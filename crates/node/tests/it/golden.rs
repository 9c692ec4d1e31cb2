//! The golden vectors give the same messages on this machine.

use fewbits_node::golden::{RECORDS, Scheme, VERSION, Vectors, hash};

/// Runs a scheme over the inputs of its file.
fn assert_file(scheme: Scheme, name: &str) {
    let path = format!("{}/tests/golden/v2/{name}.bin", env!("CARGO_MANIFEST_DIR"));
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

/// Sums that the Cortex-M4 and WebAssembly gave, too: a change of the models must not write other packets unnoticed.
#[test]
fn adaptive_messages_stay() {
    assert_eq!(hash(Scheme::Adaptive, 20_000), Ok(0xe37c_ea24_6177_d89b));
    assert_eq!(hash(Scheme::AdaptiveCircle, 20_000), Ok(0xaff8_d531_14d2_b8c7));
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
