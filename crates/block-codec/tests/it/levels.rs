//! Signals of few levels, and of single precision.

use super::common::mixed;
use fewbits_block_codec::BlockCodec;

fn returned(codec: BlockCodec, samples: &[f64]) -> usize {
    let bytes = codec.encode(samples).unwrap();
    let read = codec.decode(&bytes, samples.len()).unwrap();
    assert!(
        read.iter()
            .zip(samples)
            .all(|(value, sample)| value.to_bits() == sample.to_bits())
    );
    bytes.len()
}

/// Decimals that went through single precision cost as much as the decimals.
#[test]
fn single_precision_costs_nothing() {
    let decimals: Vec<f64> = mixed(11, 3000).iter().map(|x| (1000.0 * x).round() / 1000.0).collect();
    let singles: Vec<f64> = decimals.iter().map(|x| f64::from(*x as f32)).collect();
    let (exact, single) = (returned(BlockCodec::lossless(), &decimals), returned(BlockCodec::lossless(), &singles));
    assert!(single < exact + exact / 100 + 8, "{single} for {exact}");
}

/// Forty levels without a common grid cost the list, and then as much as forty neighbouring integers.
#[test]
fn uneven_levels_cost_their_list_once() {
    let level = |n: usize| (1.0 + n as f64 * std::f64::consts::SQRT_2).exp2().sin() * 1e6;
    let number = |i: usize| (20.0 + 15.0 * (i as f64 * 0.01).sin()) as usize + i * i % 3;
    let integers: Vec<f64> = (0..4000).map(|i| number(i) as f64).collect();
    let mut sorted: Vec<f64> = (0..40).map(level).collect();
    sorted.sort_by(f64::total_cmp);
    let samples: Vec<f64> = (0..4000).map(|i| sorted[number(i)]).collect();
    let (even, uneven) = (returned(BlockCodec::lossless(), &integers), returned(BlockCodec::lossless(), &samples));
    assert!(uneven < even + 40 * 9, "{uneven} for {even}");
    let within = BlockCodec::new(1e-3).unwrap().encode(&samples).unwrap().len();
    assert!(within < even + 40 * 6, "{within} for {even}");
}

/// Directions with few decimals are on their own grid if the bound is fine.
#[test]
fn decimals_on_a_circle_return_for_less() {
    let samples: Vec<f64> = (0..2000_u64).map(|i| (i * i * 7919 % 360) as f64).collect();
    let codec = BlockCodec::new(0.001).unwrap().on_circle(360.0).unwrap();
    let bytes = codec.encode(&samples).unwrap();
    // 360 directions take 8.5 bits; cells of .002 degrees would take 17.5.
    assert!(bytes.len() < 2000 * 10 / 8, "{}", bytes.len());
    let read = codec.decode(&bytes, samples.len()).unwrap();
    assert!(
        read.iter()
            .zip(&samples)
            .all(|(value, sample)| (value - sample).abs() <= 0.001)
    );
}
