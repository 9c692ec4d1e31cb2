//! The laws of resampling, for every law.

use fewbits_filters::{Resampling, Schedule};
use fewbits_monte_carlo::{Moments, Stream};
use proptest::prelude::*;

/// All four laws.
pub const ALL: [Resampling; 4] = [
    Resampling::Systematic,
    Resampling::Stratified,
    Resampling::Residual,
    Resampling::Multinomial,
];

fn draw(law: Resampling, seed: u64, weights: &[f64], count: usize) -> Vec<u32> {
    let mut ancestors = vec![u32::MAX; count];
    law.ancestors(&mut Stream::new(seed).fast_rng(), weights, &mut ancestors)
        .unwrap();
    ancestors
}

fn counts(ancestors: &[u32], particles: usize) -> Vec<f64> {
    let mut counts = vec![0.0; particles];
    ancestors.iter().for_each(|a| counts[*a as usize] += 1.0);
    counts
}

fn weights() -> impl Strategy<Value = Vec<f64>> {
    let weight = prop_oneof![2 => Just(0.0), 3 => 0.0..1.0f64, 1 => 0.0..1e-12f64, 1 => 1.0..1e6f64];
    prop::collection::vec(weight, 1..60).prop_filter("some weight", |w| w.iter().sum::<f64>() > 0.0)
}

proptest! {
    #[test]
    fn zero_weights_are_never_chosen_and_order_is_kept(w in weights(), count in 1..200usize, seed: u64) {
        for law in ALL {
            let ancestors = draw(law, seed, &w, count);
            prop_assert!(ancestors.windows(2).all(|pair| pair[0] <= pair[1]), "{law:?}");
            prop_assert!(ancestors.iter().all(|a| w[*a as usize] > 0.0), "{law:?}");
            prop_assert_eq!(counts(&ancestors, w.len()).iter().sum::<f64>(), count as f64);
        }
    }

    #[test]
    fn systematic_and_residual_counts_are_within_one_of_their_expectation(w in weights(), count in 1..200usize, seed: u64) {
        let total: f64 = w.iter().sum();
        let systematic = counts(&draw(Resampling::Systematic, seed, &w, count), w.len());
        let residual = counts(&draw(Resampling::Residual, seed, &w, count), w.len());
        for i in 0..w.len() {
            let expected = count as f64 * w[i] / total;
            let slack = 1e-9 * count as f64;
            prop_assert!(systematic[i] >= (expected - slack).floor() && systematic[i] <= (expected + slack).ceil());
            prop_assert!(residual[i] >= (expected - slack).floor(), "{} copies of {expected}", residual[i]);
        }
    }

    #[test]
    fn equal_weights_are_copied_once_by_the_three_balanced_laws(count in 1..300usize, seed: u64) {
        for law in [Resampling::Systematic, Resampling::Stratified, Resampling::Residual] {
            let ancestors = draw(law, seed, &vec![0.1; count], count);
            let off = counts(&ancestors, count).iter().filter(|c| **c != 1.0).count();
            // Rounding of the cumulative sum may shift a stratified point across an edge, never more.
            prop_assert!(off <= 2, "{law:?}: {off}");
        }
    }
}

#[test]
fn copies_have_the_right_expectation() {
    let w = [0.5, 0.0, 0.031, 0.169, 0.3];
    for law in ALL {
        for count in [3, 5, 17] {
            let mut copies = [Moments::default(); 5];
            for seed in 0..4000 {
                for (moments, c) in copies.iter_mut().zip(counts(&draw(law, seed, &w, count), 5)) {
                    moments.add(c);
                }
            }
            for (moments, w) in copies.iter().zip(w) {
                let expected = count as f64 * w;
                let slack = 4.5 * moments.standard_error() + 1e-9;
                assert!((moments.mean() - expected).abs() <= slack, "{law:?} {count}: {} {expected}", moments.mean());
            }
        }
    }
}

#[test]
fn one_heavy_particle_takes_all() {
    for law in ALL {
        assert!(draw(law, 3, &[0.0, 1e-300, 0.0], 50).iter().all(|a| *a == 1), "{law:?}");
    }
}

#[test]
fn bad_weights_are_refused_and_nothing_is_written() {
    let mut rng = Stream::new(0).fast_rng();
    for bad in [
        &[][..],
        &[0.0, 0.0],
        &[1.0, -1e-9],
        &[f64::NAN],
        &[f64::INFINITY],
        &[f64::MAX, f64::MAX],
    ] {
        for law in ALL {
            let mut ancestors = [7; 3];
            assert!(law.ancestors(&mut rng, bad, &mut ancestors).is_err(), "{law:?} {bad:?}");
            assert_eq!(ancestors, [7; 3]);
        }
    }
}

#[test]
fn the_schedule_looks_at_the_effective_sample_size() {
    assert!(Schedule::Always.is_due(100.0, 100));
    assert!(!Schedule::Never.is_due(1.0, 100));
    // Issue: NaN never resampled.
    assert!(Schedule::Below(f64::NAN).is_due(100.0, 100));
    assert!(Schedule::Below(0.5).is_due(49.9, 100) && !Schedule::Below(0.5).is_due(50.0, 100));
}

/// Issue: shares of subnormal weights overflowed.
#[test]
fn weights_at_the_ends_of_the_range_are_shared_like_any_others() {
    for law in ALL {
        for tiny in [5e-324, 1e-300, 1e300] {
            let ancestors = draw(law, 4, &[tiny, 0.0, tiny], 400);
            let first = ancestors.iter().filter(|a| **a == 0).count();
            assert!(ancestors.iter().all(|a| *a != 1) && first.abs_diff(200) < 50, "{law:?} {tiny}: {first}");
        }
    }
}

#[test]
fn weights_are_refused_wherever_they_stand_and_zeros_may_have_a_sign() {
    for at in 0..20 {
        for bad in [
            -1.0,
            -f64::MIN_POSITIVE,
            f64::NAN,
            -f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
        ] {
            let mut weights = [0.5; 20];
            weights[at] = bad;
            let mut ancestors = [7; 20];
            let refused = Resampling::Systematic.ancestors(&mut Stream::new(1).fast_rng(), &weights, &mut ancestors);
            assert!(refused.is_err() && ancestors == [7; 20], "{bad} at {at}");
        }
        let mut weights = [0.5; 20];
        weights[at] = -0.0;
        assert!(!draw(Resampling::Systematic, 1, &weights, 20).contains(&(at as u32)));
    }
}
