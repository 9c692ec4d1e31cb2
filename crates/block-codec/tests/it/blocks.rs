//! Blocks: the bound for wild samples, exact samples, damage, other columns.

use super::common::mixed;
use fewbits_block_codec::bytes::Bytes;
use fewbits_block_codec::{BlockCodec, Effort, Error, Start};
use proptest::prelude::*;

const EFFORTS: [Effort; 2] = [Effort::Thorough, Effort::Fast];

/// A bound, and the period of a circle.
#[derive(Clone, Copy)]
struct Config {
    delta: f64,
    period: Option<f64>,
}

impl Config {
    fn new(delta: f64) -> Self {
        Self { delta, period: None }
    }

    fn circular(self, period: f64) -> Self {
        Self {
            period: Some(period),
            ..self
        }
    }

    fn codec(self) -> BlockCodec {
        let codec = BlockCodec::new(self.delta).unwrap();
        self.period.map_or(codec, |period| codec.on_circle(period).unwrap())
    }
}

fn bytes_of(codec: &BlockCodec, start: &Start) -> Vec<u8> {
    let mut bytes = Vec::new();
    codec.code_start(&mut bytes, Some(start)).unwrap();
    bytes
}

/// The start, and the bytes behind it.
fn read_start<'a>(codec: &BlockCodec, bytes: &'a [u8]) -> Result<(Start, &'a [u8]), Error> {
    let mut fields = Bytes(bytes);
    Ok((codec.code_start(&mut fields, None)?, fields.0))
}

fn distance(config: &Config, value: f64, sample: f64) -> f64 {
    match config.period {
        None => (value - sample).abs(),
        Some(period) => {
            let straight = (value - sample.rem_euclid(period)).abs();
            straight.min((period - straight).abs())
        }
    }
}

fn check(config: Config, samples: &[f64]) -> usize {
    let mut size = 0;
    for effort in EFFORTS {
        let codec = config.codec().with_effort(effort);
        let bytes = codec.encode(samples).unwrap();
        let values = codec.decode(&bytes, samples.len()).unwrap();
        assert_eq!(values.len(), samples.len());
        for (value, sample) in values.iter().zip(samples) {
            if sample.is_finite() {
                assert!(distance(&config, *value, *sample) <= config.delta, "{sample}: {value}");
            } else {
                assert_eq!(value.to_bits(), sample.to_bits());
            }
        }
        size = size.max(bytes.len());
        // The same samples behind a start that some others taught.
        let some = &samples[..samples.len().min(40)];
        if let Some(start) = codec.start(some) {
            let started = codec.encode_from(&start, samples, &[]).unwrap();
            let again = read_start(&codec, &bytes_of(&codec, &start)).unwrap().0;
            let read = codec.decode_from(&again, &started.bytes, samples.len(), &[]).unwrap();
            for (value, sample) in read.iter().zip(samples) {
                let exact = value.to_bits() == sample.to_bits();
                assert!(exact || distance(&config, *value, *sample) <= config.delta, "{sample}: {value}");
            }
        }
    }
    size
}

fn wild() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -10.0..10.0_f64,
        2 => (-300..300_i32, -1.0..1.0_f64).prop_map(|(e, m)| m * 10.0_f64.powi(e)),
        1 => any::<f64>(),
        1 => prop_oneof![Just(0.0), Just(-0.0), Just(f64::MAX), Just(f64::MIN), Just(5e-324), Just(f64::NAN), Just(f64::INFINITY)],
        3 => (-50..50_i32).prop_map(|i| f64::from(i) * 0.25),
        3 => (-5000..5000_i32).prop_map(|i| f64::from(i) / 1000.0),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(4), ..ProptestConfig::default() })]

    #[test]
    fn bound_holds_for_any_samples(samples in prop::collection::vec(wild(), 0..80), exponent in -300..300_i32, near in any::<bool>()) {
        let delta = if near { 0.125 } else { 10.0_f64.powi(exponent) };
        check(Config::new(delta), &samples);
    }

    #[test]
    fn bound_holds_for_decimals_at_any_delta(digits in prop::collection::vec(-9999..9999_i32, 1..80), delta in 1e-5..100.0_f64, power in 0..6_u32) {
        let ten = f64::from(10_u32.pow(power));
        let samples: Vec<f64> = digits.iter().map(|d| f64::from(*d) / ten).collect();
        check(Config::new(delta), &samples);
        // A whole number of steps is where rounding could lose a neighbour.
        check(Config::new((delta / 5.0).ceil() / ten), &samples);
        check(Config::new(0.5 * (delta / 5.0).ceil() / ten), &samples);
    }

    #[test]
    fn bound_holds_on_any_circle(samples in prop::collection::vec(wild(), 1..60), delta in 0.001..400.0_f64) {
        check(Config::new(delta).circular(360.0), &samples);
    }

    #[test]
    fn bound_holds_for_recorded_traits(seed in any::<u64>(), delta in 0.0001..10.0_f64) {
        check(Config::new(delta), &mixed(seed, 1500));
    }

    #[test]
    fn lossless_blocks_return_every_bit(samples in prop::collection::vec(wild(), 0..80), round in any::<bool>()) {
        let samples: Vec<f64> = samples.into_iter().map(|x| if round { (x * 100.0).round() / 100.0 } else { x }).collect();
        for effort in EFFORTS {
            let codec = BlockCodec::lossless().with_effort(effort);
            let values = codec.decode(&codec.encode(&samples).unwrap(), samples.len()).unwrap();
            prop_assert!(values.iter().zip(&samples).all(|(value, sample)| value.to_bits() == sample.to_bits()));
        }
    }

    #[test]
    fn any_bytes_give_samples_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..60), rows in 0..300_usize, head in 0..16_u8, joint in any::<bool>()) {
        let other = vec![1.0; rows];
        let columns: &[&[f64]] = if joint { &[&other] } else { &[] };
        let mut with_head = bytes.clone();
        if let Some(first) = with_head.first_mut() {
            *first = *first & 0xF0 | head;
        }
        let line = Config::new(0.1);
        for codec in [line.codec(), line.circular(360.0).codec(), BlockCodec::lossless()] {
            if let Ok(samples) = codec.decode_with(&with_head, rows, columns) {
                prop_assert_eq!(samples.len(), rows);
            }
        }
    }
}

/// Cut short, lengthened, with a flipped bit or of another number of rows: the stated number of samples or an error, no panic. An
/// arithmetic code has no redundancy, so that only a container's checksum can tell all of these apart.
#[test]
fn damaged_blocks_give_the_stated_rows_or_an_error() {
    let samples: Vec<f64> = mixed(3, 500).iter().map(|x| (x * 1000.0).round() / 1000.0).collect();
    let codec = BlockCodec::new(0.05).unwrap();
    for effort in EFFORTS {
        let bytes = codec.with_effort(effort).encode(&samples).unwrap();
        assert!(codec.decode(&[bytes.as_slice(), &[0]].concat(), 500).is_err());
        assert!(codec.decode(&[], 500).is_err() && codec.decode(&bytes, 0).is_err());
        let shortened = (0..bytes.len()).map(|end| (bytes[..end].to_vec(), 500));
        let flipped = (0..8 * bytes.len()).map(|bit| {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            (flipped, 500)
        });
        let counted = [1, 10, 499, 501, 5000, usize::MAX].map(|rows| (bytes.clone(), rows));
        for (damaged, rows) in shortened.chain(flipped).chain(counted) {
            if let Ok(values) = codec.decode(&damaged, rows) {
                assert_eq!(values.len(), rows);
            }
        }
    }
}

/// A number below 4096 that is hard to predict.
fn scattered(n: u32) -> u32 {
    let mut z = n.wrapping_add(1).wrapping_mul(0x9E37_79B9);
    z = (z ^ z >> 16).wrapping_mul(0x85EB_CA6B);
    z = (z ^ z >> 13).wrapping_mul(0xC2B2_AE35);
    (z ^ z >> 16) >> 20
}

/// A cell holds as many of the instrument's steps as lie within the bound: 2 delta = 2.5 steps is three of them.
#[test]
fn decimal_cells_hold_every_neighbour_within_the_bound() {
    let samples: Vec<f64> = (0..2000_u32).map(|n| f64::from(scattered(n)) / 10.0).collect();
    let size = |delta: f64| check(Config::new(delta), &samples) as f64 * 8.0 / 2000.0;
    // 4096 equally likely values: 12 bits less log2(3), and a few per cent for learning.
    let expected = 12.0 - 3.0_f64.log2();
    assert!((size(0.125) - expected).abs() < 0.4, "{}", size(0.125));
}

/// Where samples rest at some levels, cells are placed about these, wherever they are and whether the samples have decimals or not.
#[test]
fn cells_lie_about_the_levels_where_samples_rest() {
    let codec = BlockCodec::new(0.5).unwrap();
    for tenth in 0..10 {
        for unit in [0.01, 0.01 * std::f64::consts::FRAC_PI_3] {
            let offset = 100.0 * f64::from(tenth) * 0.1;
            let samples: Vec<f64> = (0..1000_u32)
                .map(|n| unit * (offset + f64::from(scattered(n) % 50) + 300.0 * f64::from(n / 250 % 2)))
                .collect();
            let bytes = codec.encode(&samples).unwrap();
            assert!(bytes.len() < 40, "{tenth} {unit}: {}", bytes.len());
            let start = codec.start(&samples).unwrap();
            let block = codec.encode_from(&start, &samples, &[]).unwrap();
            assert!(block.bytes.len() < 40, "{tenth} {unit}: {}", block.bytes.len());
            let start = read_start(&codec, &bytes_of(&codec, &start)).unwrap().0;
            for values in [
                codec.decode(&bytes, samples.len()).unwrap(),
                codec.decode_from(&start, &block.bytes, samples.len(), &[]).unwrap(),
            ] {
                let mut pairs = values.iter().zip(&samples);
                assert!(pairs.all(|(value, sample)| (value - sample).abs() <= 0.5), "{tenth} {unit}");
            }
        }
    }
}

/// A column that follows another costs almost nothing beside it; one that does not, at most 1 % more than alone.
#[test]
fn joint_columns_help_or_cost_nothing() {
    let codec = BlockCodec::new(0.02).unwrap();
    let (driver, unrelated) = (mixed(5, 3000), mixed(77, 3000));
    let follower: Vec<f64> = driver.iter().map(|x| 3.0 - 0.5 * x).collect();
    let read = |samples: &[f64]| codec.decode(&codec.encode(samples).unwrap(), samples.len()).unwrap();
    for (other, most) in [(read(&driver), 0.6), (read(&unrelated), 1.01)] {
        let alone = codec.encode(&follower).unwrap();
        let joint = codec.encode_with(&follower, &[&other]).unwrap();
        assert!((joint.len() as f64) < most * alone.len() as f64, "{} {}", joint.len(), alone.len());
        let values = codec.decode_with(&joint, 3000, &[&other]).unwrap();
        assert!(
            values
                .iter()
                .zip(&follower)
                .all(|(value, sample)| (value - sample).abs() <= 0.02)
        );
    }
    assert!(codec.encode_with(&follower, &[&driver[1..]]).is_err());
}

/// The format is fixed: another machine, or a change of the models, must not write other bytes unnoticed.
#[test]
fn blocks_are_the_same_bytes_everywhere() {
    let samples: Vec<f64> = (0..4000_u32)
        .map(|n| f64::from(n % 50) + f64::from((n.wrapping_mul(2_654_435_761) >> 28) % 5) * 0.25)
        .collect();
    let expected = [(557, 0x3928_33fc_0bf1_2522), (849, 0x1632_ff3f_10ef_c1ce)];
    for (effort, expected) in EFFORTS.into_iter().zip(expected) {
        let codec = BlockCodec::new(0.3).unwrap().with_effort(effort);
        let bytes = codec.encode(&samples).unwrap();
        let digest = bytes
            .iter()
            .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3));
        assert_eq!((bytes.len(), digest), expected, "{effort:?}");
    }
}

/// Indices about `2^46` in size, the largest, of which the positive one is an exception.
#[test]
fn largest_indices_return() {
    for end in [2.0_f64.powi(46), -2.0_f64.powi(46)] {
        let samples: Vec<f64> = (0..3000_u64).map(|i| end - (i * i % 7) as f64 * end.signum()).collect();
        for rows in [1500, 3000] {
            for effort in EFFORTS {
                let codec = BlockCodec::lossless().with_effort(effort);
                let bytes = codec.encode(&samples[..rows]).unwrap();
                assert_eq!(codec.decode(&bytes, rows).unwrap(), samples[..rows]);
            }
        }
    }
}

/// Blocks of rows of one signal share grid and usual index: each is some bytes shorter, and the start pays from a few blocks on.
#[test]
fn a_start_shortens_every_block() {
    let samples: Vec<f64> = mixed(7, 4096).iter().map(|x| (100.0 * x).round() / 100.0).collect();
    for (codec, what) in [
        (BlockCodec::new(0.5).unwrap(), "within"),
        (BlockCodec::lossless(), "lossless"),
    ] {
        let start = codec.start(&samples[..128]).unwrap();
        let (mut alone, mut started) = (0, bytes_of(&codec, &start).len());
        for block in samples.chunks(128) {
            alone += codec.encode(block).unwrap().len();
            started += codec.encode_from(&start, block, &[]).unwrap().bytes.len();
        }
        assert!(started < alone, "{what}: {started} behind a start, {alone} alone");
    }
}

/// Any bytes are a start or an error, and any bytes behind one are samples or an error.
#[test]
fn starts_and_what_follows_them_are_total() {
    let codec = BlockCodec::new(0.01).unwrap();
    let samples: Vec<f64> = (0..100).map(|n| f64::from(n % 17) * 0.25).collect();
    let start = codec.start(&samples).unwrap();
    let block = codec.encode_from(&start, &samples, &[]).unwrap().bytes;
    for at in 0..block.len() {
        for value in [0, 1, 0x7f, 0x80, 0xff] {
            let mut damaged = block.clone();
            damaged[at] = value;
            let _ = codec.decode_from(&start, &damaged, samples.len(), &[]);
            assert!(codec.decode_from(&start, &damaged, usize::MAX, &[]).is_err());
            let _ = codec.decode_from(&start, &block[..at], samples.len(), &[]);
        }
    }
    let bytes = bytes_of(&codec, &start);
    for at in 0..bytes.len() {
        for value in 0..=u8::MAX {
            let mut damaged = bytes.clone();
            damaged[at] = value;
            if let Ok((start, _)) = read_start(&codec, &damaged) {
                let _ = codec.decode_from(&start, &block, samples.len(), &[]);
                let _ = codec.encode_from(&start, &samples, &[]).unwrap();
            }
        }
        assert!(read_start(&codec, &bytes[..at]).is_err());
    }
}

/// Largest errors of 0.0001 to 2 % of the range, in the geometric mean. The lattice of other codecs has steps of twice the bound.
#[test]
fn blocks_take_fewer_bits_than_pco_on_a_lattice() {
    let mut logarithms = Vec::new();
    for seed in 0..4 {
        let samples = mixed(seed, 3800);
        let (low, high) = samples
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        for percent in [1e-4, 0.01, 0.25, 0.5, 1.0, 2.0] {
            let bound = 0.01 * percent * (high - low);
            let block = BlockCodec::new(bound).unwrap().encode(&samples).unwrap();
            let indices: Vec<i64> = samples.iter().map(|x| (x / (2.0 * bound)).round() as i64).collect();
            let packed = pco::standalone::simple_compress(&indices, &pco::ChunkConfig::default()).unwrap();
            logarithms.push((block.len() as f64 / packed.len() as f64).ln());
        }
    }
    assert!(logarithms.iter().sum::<f64>() < 0.0, "{logarithms:?}");
}

/// How long an index rests says when it will step next, in blocks of enough rows to learn from.
#[test]
fn rests_of_a_smooth_signal_cost_little() {
    let mut level = 0.0;
    let samples: Vec<f64> = (0..16_384_u32)
        .map(|row| {
            // Rests of some 6 to 22 rows, up and down.
            let angle = f64::from(row) * 0.001;
            level += (0.1 + 0.05 * angle.sin()) * if row / 2000 % 2 == 0 { 1.0 } else { -1.0 };
            level
        })
        .collect();
    let codec = BlockCodec::new(0.5).unwrap();
    let whole = codec.encode(&samples).unwrap();
    let read = codec.decode(&whole, samples.len()).unwrap();
    assert!(
        read.iter()
            .zip(&samples)
            .all(|(value, sample)| (value - sample).abs() <= 0.5)
    );
    // In blocks of fewer rows contexts have no lengths of rests.
    let parts: usize = samples.chunks(1023).map(|part| codec.encode(part).unwrap().len()).sum();
    assert!(10 * whole.len() < 7 * parts, "{} {parts}", whole.len());
    // A start says so too.
    let start = codec.start(&samples).unwrap();
    let started = codec.encode_from(&start, &samples, &[]).unwrap();
    assert!(started.bytes.len() < whole.len() + 8, "{} {}", started.bytes.len(), whole.len());
    let mut bytes = bytes_of(&codec, &start);
    bytes.push(7);
    assert_eq!(read_start(&codec, &bytes).unwrap(), (start, &[7][..]));
    let read = codec.decode_from(&start, &started.bytes, samples.len(), &[]).unwrap();
    assert!(
        read.iter()
            .zip(&samples)
            .all(|(value, sample)| (value - sample).abs() <= 0.5)
    );
}
