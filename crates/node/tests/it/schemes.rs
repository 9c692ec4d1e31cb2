//! Each scheme beside its definition.

use fewbits_node::adaptive::{Config, Encoder};
use fewbits_node::censor::{self, OwnFilter};
use fewbits_node::golden::Signal;
use fewbits_node::{
    Packet, Quantizer, cell_of, edge, innovation_cell, innovation_cell_of_codes, pattern_bit, range_level,
    range_level_of_codes, sign_bit, trigger,
};

#[test]
fn sign_bit_counts_a_tie_as_reached() {
    assert_eq!([1, 2, 3].map(|x| sign_bit(x, 2_u16).unwrap()), [false, true, true]);
    assert_eq!(sign_bit(-0.0, 0.0), Ok(true));
    assert_eq!(sign_bit(f64::NAN, 0.0).unwrap_err().name, "measurement");
    assert_eq!(sign_bit(0.0, f32::INFINITY).unwrap_err().name, "threshold");
}

#[test]
fn quantizer_word_is_that_of_the_cell() {
    let words = [3_u16, 1, 0];
    let quantizer = Quantizer::new(&[-1.0, 1.0], &words, 2).unwrap();
    let said = [f64::NEG_INFINITY, -1.0, 0.999, 1.0, 9.0].map(|x| quantizer.word(x).unwrap());
    assert_eq!((said, quantizer.bits()), ([3, 1, 1, 0, 0], 2));
    assert!(quantizer.word(f64::NAN).is_err());
}

#[test]
fn quantizer_refuses_what_is_none() {
    let refused = |thresholds: &[i32], words: &[u16], bits| Quantizer::new(thresholds, words, bits).unwrap_err().name;
    assert_eq!(refused(&[1, 1], &[0, 1, 2], 2), "thresholds");
    assert_eq!(refused(&[1, 2], &[0, 1], 2), "words");
    assert_eq!(refused(&[1, 2], &[0, 1, 4], 2), "words");
    assert_eq!(refused(&[1, 2], &[0, 1, 2], 17), "bits");
    assert_eq!(Quantizer::new(&[f64::NAN], &[0, 1], 1).unwrap_err().name, "thresholds");
}

#[test]
fn cell_of_floats_is_cell_of_codes() {
    let (codes, floats) = ([-300, -7, 0, 12, 500], [-300.0, -7.0, 0.0, 12.0, 500.0]);
    for x in -600..600 {
        let cell = cell_of(&codes, x).unwrap();
        assert_eq!(cell, cell_of(&floats, f64::from(x)).unwrap());
        assert_eq!(cell, codes.iter().filter(|threshold| **threshold <= x).count());
        assert_eq!(pattern_bit(&codes, x).unwrap(), cell == 1 || cell == 3 || cell == 5);
    }
}

#[test]
fn innovation_cell_of_codes_is_exact() {
    let thresholds = [-98_765, -1, 0, 4_321, 70_000];
    let mut signal = Signal::new(5);
    for _ in 0..20_000 {
        let [x, mean] = [signal.random() as i32, signal.random() as i32];
        let deviation = (signal.random() >> (32 + signal.random() % 31)) as u32;
        let cell = innovation_cell_of_codes(&thresholds, x, mean, deviation);
        let below = |z: &&i32| i128::from(**z) * i128::from(deviation) <= (i128::from(x) - i128::from(mean)) << 16;
        assert_eq!(cell, thresholds.iter().filter(below).count());
    }
}

#[test]
fn innovation_cell_refuses_what_is_no_number() {
    assert_eq!(innovation_cell(&[0.0], 1.0, 1.0, 2.0), Ok(1));
    for (x, mean, deviation, name) in [
        (f64::NAN, 0.0, 1.0, "measurement"),
        (0.0, f64::INFINITY, 1.0, "prediction"),
        (0.0, 0.0, 0.0, "deviation"),
    ] {
        assert_eq!(innovation_cell(&[0.0], x, mean, deviation).unwrap_err().name, name);
    }
}

#[test]
fn range_level_agrees_with_its_edges() {
    let mut signal = Signal::new(9);
    for _ in 0..20_000 {
        let part = |r: u64| (r >> 11) as f64 / (1_u64 << 53) as f64;
        let (centre, half_width) = (20.0 * part(signal.random()), 0.01 + 3.0 * part(signal.random()));
        let (range, levels) = (20.0 * part(signal.random()), 1 + (signal.random() % 16) as u32);
        let level = range_level(range, centre, half_width, levels).unwrap();
        assert!(level == 0 || edge(level, levels, centre, half_width) <= range);
        assert!(level + 1 == levels || range < edge(level + 1, levels, centre, half_width));
    }
    assert_eq!(range_level(1e300, 0.0, 1e-300, 4), Ok(3));
    assert_eq!(range_level(-1e300, 0.0, 1e-300, 4), Ok(0));
    // Both zeros reach the edge at zero.
    assert_eq!([range_level(-0.0, 0.0, 1.0, 2), range_level(0.0, -0.0, 1.0, 2)], [Ok(1); 2]);
    assert!(range_level(1.0, 1.0, 1.0, 0).is_err() && range_level(f64::NAN, 1.0, 1.0, 4).is_err());
}

#[test]
fn range_level_of_codes_counts_exact_edges() {
    let mut signal = Signal::new(11);
    for _ in 0..20_000 {
        let [range, centre] = [(signal.random() >> 48) as i32, (signal.random() >> 48) as i32];
        let (half_width, levels) = ((signal.random() >> 50) as u32, 1 + (signal.random() % 40) as u16);
        let level = range_level_of_codes(range, centre, half_width, levels);
        // Edge q: (range - centre) levels >= half_width (2 q - levels).
        let reached = |q: &u32| {
            let edge = i128::from(half_width) * (2 * i128::from(*q) - i128::from(levels));
            i128::from(range - centre) * i128::from(levels) >= edge
        };
        assert_eq!(level as usize, (1..u32::from(levels)).filter(reached).count());
    }
    assert_eq!(range_level_of_codes(i32::MAX, i32::MIN, u32::MAX, u16::MAX), 65_534);
}

#[test]
fn censoring_speaks_at_a_tie() {
    assert_eq!([1.9, 2.0, 2.1].map(|x| censor::speaks(x, 1.0, 1.0).unwrap()), [false, true, true]);
    assert_eq!([-5, -4, 4, 5].map(|x| censor::speaks_of_codes(x, 0, 5)), [true, false, false, true]);
    assert!(censor::speaks_of_codes(i32::MIN, i32::MAX, u32::MAX));
    assert!(censor::speaks(f64::NAN, 0.0, 1.0).is_err() && censor::speaks(0.0, 0.0, f64::NAN).is_err());
}

#[test]
fn half_width_is_that_of_the_innovation() {
    // h P h' = 1 + 2 * .5 * .5 + .25 * 4 = 2.5; S = 3; eta S = 6.
    let told = censor::half_width(&[1.0, 0.5], &[[1.0, 0.5], [0.5, 4.0]], 0.5, 2.0).unwrap();
    assert!((told - 6.0_f64.sqrt()).abs() < 1e-15);
    assert!(censor::half_width(&[1.0], &[[-3.0]], 0.5, 2.0).is_err());
}

#[test]
fn own_filter_follows_its_recursion() {
    let mut own = OwnFilter::new([[1.0, 1.0], [0.0, 0.5]], [1.0, 0.0], [2.0, 1.0]).unwrap();
    // Predicted (3, .5), innovation 4: (3 + 2, .5 + 1).
    assert_eq!(own.speaks(7.0, &[0.5, 0.25], 4.0), Ok(true));
    assert_eq!(own.estimate(), &[5.0, 1.5]);
    // Predicted (6.5, .75): silent, and the filter goes on with the sample.
    assert_eq!(own.speaks(7.5, &[0.5, 0.25], 4.0), Ok(false));
    assert_eq!(own.estimate(), &[7.0, 1.0]);
    assert!(own.speaks(f64::NAN, &[0.5, 0.25], 4.0).is_err() && own.estimate() == &[7.0, 1.0]);
}

#[test]
fn trigger_probability_is_its_formula() {
    for innovation in [0.0, 1e-9, 0.3, 5.0, 100.0] {
        let p = trigger::probability(innovation, 0.7);
        let square = 0.5 * innovation * innovation * 0.7;
        let expected = if square < 1e-8 { square } else { 1.0 - (-square).exp() };
        assert!((p - expected).abs() <= 1e-15 + 1e-12 * expected, "{innovation}");
    }
    assert_eq!(trigger::speaks(0.0, 0.0, 1.0, 0.0), Ok(false));
    assert_eq!(trigger::speaks(100.0, 0.0, 1.0, 0.999), Ok(true));
    assert!(trigger::speaks(f64::INFINITY, 0.0, 1.0, 0.5).is_err());
}

#[test]
fn encoder_keeps_its_bound_and_its_size() {
    let config = Config::new(0.05).unwrap();
    let mut encoder = Encoder::new(config);
    let mut signal = Signal::new(3);
    for _ in 0..5_000 {
        let sample = signal.sample();
        encoder.encode(sample).unwrap();
        assert!((encoder.reconstruction().unwrap() - sample).abs() <= 0.05);
    }
    assert!(size_of::<Encoder>() <= 3_776, "{}", size_of::<Encoder>());
    let before = encoder.clone();
    assert!(encoder.encode(f64::NAN).is_err() && encoder.encode_after(0, 1.0).is_err() && encoder == before);
}

#[test]
fn first_packet_is_the_sample_in_its_digits() {
    // 0, sign 0, 2 decimals, 11 bits: 2031.
    let packet = Encoder::new(Config::new(0.05).unwrap())
        .encode(20.31)
        .unwrap()
        .unwrap()
        .packet;
    assert_eq!((packet.bits(), &packet.to_bytes()[..3]), (23, &[0x08, 0xbf, 0xde][..]));
}

#[test]
fn irregular_samples_keep_the_bound() {
    let mut encoder = Encoder::new(Config::new(0.05).unwrap());
    let mut signal = Signal::new(4);
    for n in 0..1_000 {
        let sample = signal.sample();
        encoder.encode_after(1 + n % 70, sample).unwrap();
        assert!((encoder.reconstruction().unwrap() - sample).abs() <= 0.05);
    }
}

#[test]
fn packets_hold_128_bits() {
    let mut packet = Packet::default();
    packet.push(5, 3);
    packet.push(u64::MAX, 64);
    packet.push(1, 61);
    assert_eq!((packet.bits(), packet.byte_count(), packet.to_bytes()[0]), (128, 16, 0b1011_1111));
    packet.push(1, 1);
    assert_eq!((packet.bits(), packet.word() & 1), (128, 1));
    assert_eq!(Packet::default().to_bytes(), [0; 16]);
    assert_eq!(Packet::from_word(4, 2), None);
    assert_eq!(Packet::from_word(packet.word(), 128), Some(packet));
}
