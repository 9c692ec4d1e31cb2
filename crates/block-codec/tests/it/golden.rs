//! Bytes of blocks that were written before this crate was one of its own.

use fewbits_block_codec::{BlockCodec, Effort};

fn signal(kind: usize, rows: usize) -> Vec<f64> {
    let mut state = 88_172_645_463_325_252_u64 + kind as u64;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as i64 - (1 << 23)
    };
    let (mut level, mut slope) = (0_i64, 0_i64);
    (0..rows)
        .map(|_| {
            let draw = next();
            slope += draw >> 19;
            slope -= slope / 8;
            level += slope;
            match kind {
                0 => level as f64 / 100.0,
                1 => (level + (draw >> 20)) as f64 / 128.0 + 0.1,
                2 => (level.rem_euclid(3600)) as f64 / 10.0,
                3 => ((level / 64) * 5) as f64,
                _ => draw as f64 / 8191.0,
            }
        })
        .collect()
}

fn hash(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3))
}

/// Blocks for which the codings that were added since do not pay: kind of signal, accuracy, length and hash of all bytes.
const GOLDEN: [(usize, &str, usize, u64); 30] = [
    (0, "within", 212, 0xa2f660281903a8b0),
    (0, "within", 213, 0xc1947b3babceab77),
    (0, "circle", 212, 0xdb53d0a863e66830),
    (0, "circle", 213, 0x1c00559f97ea67aa),
    (0, "lossless", 1378, 0x0b71f5b4aa511db1),
    (0, "lossless", 1478, 0xc5024b09ce4f9006),
    (1, "within", 178, 0x6a8344657b886458),
    (1, "within", 181, 0xb7c8c437332a1d92),
    (1, "circle", 200, 0x86859b8d00a6f715),
    (1, "circle", 198, 0xe5b4c1c3588b9817),
    (1, "lossless", 2770, 0xc1a338ca18859cd7),
    (1, "lossless", 2770, 0xc1a338ca18859cd7),
    (2, "within", 705, 0xc71aa8e74a7fe680),
    (2, "within", 677, 0x7f62b37e9e80b9ce),
    (2, "circle", 579, 0xcf9210881c1025c2),
    (2, "circle", 584, 0x74f219535aa8c678),
    (2, "lossless", 1544, 0xbb4f0df1a311ac1c),
    (2, "lossless", 1571, 0x24d786a1f269434c),
    (3, "within", 270, 0xb231d2a9acea0237),
    (3, "within", 278, 0x1f0f9f1a8e5ff690),
    (3, "circle", 299, 0x3d1df96be5a88fd1),
    (3, "circle", 285, 0x493038466a3bafd9),
    (3, "lossless", 270, 0xb231d2a9acea0237),
    (3, "lossless", 278, 0x1f0f9f1a8e5ff690),
    (4, "within", 2955, 0xb13f48d7b1dd6700),
    (4, "within", 2980, 0x1d18a4b7f160e38b),
    (4, "circle", 2309, 0xb77d53051a6f3f90),
    (4, "circle", 2372, 0x8a2ead5545524164),
    (4, "lossless", 14779, 0xbeef4cdfa1cc1f0c),
    (4, "lossless", 14779, 0xbeef4cdfa1cc1f0c),
];

#[test]
fn blocks_have_the_bytes_of_before() {
    let mut golden = GOLDEN.iter();
    for kind in 0..5 {
        let samples = signal(kind, 700);
        let other = signal(kind + 5, 700);
        for (name, codec) in [
            ("within", BlockCodec::new(0.5).unwrap()),
            ("circle", BlockCodec::new(0.5).unwrap().on_circle(360.0).unwrap()),
            ("lossless", BlockCodec::lossless()),
        ] {
            for effort in [Effort::Thorough, Effort::Fast] {
                let codec = codec.with_effort(effort);
                let plain = codec.encode(&samples).unwrap();
                let joint = codec.encode_with(&samples, &[&other]).unwrap();
                let start = codec
                    .start(&samples[..100])
                    .unwrap_or_else(|| codec.start(&[1.0, 2.0]).unwrap());
                let started = codec.encode_from(&start, &samples, &[]).unwrap();
                let mut taught = Vec::new();
                codec.code_start(&mut taught, Some(&start)).unwrap();
                let all = [plain, joint, taught, started.bytes].concat();
                let expected = golden.next().unwrap();
                assert_eq!((kind, name), (expected.0, expected.1));
                if (all.len(), hash(&all)) != (expected.2, expected.3) {
                    // What changed is shorter.
                    assert!(all.len() < expected.2, "{kind} {name} {effort:?}: {} for {}", all.len(), expected.2);
                }
            }
        }
    }
}
