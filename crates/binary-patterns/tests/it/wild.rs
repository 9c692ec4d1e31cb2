//! Wild arguments: sources, grids, quantizers and banks answer numbers or errors.

use fewbits_baselines::binary_patterns::{bounded_mle, centralised_bound, printed_gaussian_cells, remote_distortion};
use fewbits_binary_patterns::{Bank, BinaryQuantizer, PatternSensor, Source, uniform_cells};
use fewbits_core::{Link, Observation, Scheme, factor::Factor, laws::wild};
use fewbits_quantizers::Quantizer;
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

fn sources(scale: f64) -> impl Iterator<Item = Source> {
    [Source::uniform(scale), Source::gaussian_with_deviation(scale)]
        .into_iter()
        .flatten()
}

proptest! {
    #[test]
    fn quantizers_and_grids_answer_numbers(x in prop::array::uniform8(wild()), bits in 0..6_usize, count in 0..5_usize) {
        for source in sources(x[0]) {
            prop_assert!(source.variance() >= 0.0 && !source.density(x[1]).is_nan() || x[1].is_nan(), "{:?} {}", source, x[1]);
            if let Ok(number) = source.noise_deviation(x[1]) {
                prop_assert!(!number.is_nan() && number >= 0.0, "{:?} {}: {}", source, x[1], number);
            }
        }
        for grid in [uniform_cells(x[0], bits), Quantizer::new(x[..count].to_vec()), printed_gaussian_cells(x[0])].into_iter().flatten() {
            prop_assert!(grid.breakpoints().iter().all(|b| b.is_finite()), "{:?}", grid);
            let _ = grid.encode(x[1]);
        }
        let mut sorted = x[..count].to_vec();
        sorted.sort_by(f64::total_cmp);
        for quantizer in [BinaryQuantizer::new(x[..count].to_vec()), BinaryQuantizer::new(sorted)].into_iter().flatten() {
            let _ = quantizer.encode(x[5]);
            let Ok(sensor) = PatternSensor::with_deviation(quantizer, x[6]) else { continue };
            let p = sensor.quantizer().probabilities(x[7], x[6]);
            prop_assert!(!x[7].is_finite() || (p[0] + p[1] - 1.0).abs() < 1e-9, "{:?} {}: {:?}", sensor, x[7], p);
            prop_assert!(!x[7].is_finite() || !sensor.quantizer().fisher_information(x[7], x[6]).is_nan(), "{:?} {}", sensor, x[7]);
            let link = Link::new(x[0], x[1]).unwrap_or(Link::PERFECT);
            if let Ok(factor) = sensor.factor(&(), &Observation::Received(bits % 2 == 0), &link) {
                prop_assert!(!x[7].is_finite() || !factor.log_likelihood(&[x[7]].into()).is_nan(), "{:?}", factor);
            }
        }
        if let Ok(estimate) = bounded_mle(&[(x[0], true), (x[1], false)], x[2], x[3]) {
            prop_assert!(estimate.is_finite(), "{:?}: {}", x, estimate);
        }
    }
}

proptest! {
    // Each case integrates over nodes: one case in 64.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(64), ..ProptestConfig::default() })]
    #[test]
    fn banks_answer_numbers(x in prop::array::uniform6(wild()), count in 1..3_usize) {
        for source in sources(x[0]) {
            if let Ok(distortion) = remote_distortion(&source, x[1])
                && let Ok(error) = distortion.at(x[2])
            {
                prop_assert!(error.is_finite() && error >= 0.0, "{:?} {}: {}", source, x[2], error);
            }
            // Noise far narrower or wider than the source takes many nodes.
            if (0.05..20.0).contains(&(x[1] / x[0]))
                && let Ok(bound) = centralised_bound(&source, x[1], count)
            {
                prop_assert!(bound >= 0.0, "{:?} {}: {}", source, x[1], bound);
            }
            if !(0.02..50.0).contains(&(x[1] / x[0])) {
                continue;
            }
            let mut breakpoints = x[2..2 + count].to_vec();
            breakpoints.sort_by(f64::total_cmp);
            let Ok(quantizer) = BinaryQuantizer::new(breakpoints) else { continue };
            let Ok(bank) = Bank::homogeneous_with_deviation(source, vec![quantizer; count], x[1]) else { continue };
            let seen: Vec<_> = (0..count).map(|i| if i == 0 { Observation::Received(true) } else { Observation::Nothing }).collect();
            for number in [bank.mmse(), bank.table().map(|table| table.mse()), bank.posterior_mean(&seen)].into_iter().flatten() {
                prop_assert!(!number.is_nan(), "{:?} {:?}", x, number);
            }
            if let Ok(table) = bank.table() {
                for number in table.decode_with_error(&seen).into_iter().flat_map(|(mean, error)| [mean, error]) {
                    prop_assert!(!number.is_nan(), "{:?} {:?}", x, number);
                }
            }
        }
    }
}

#[test]
fn sources_whose_variance_is_beyond_the_numbers_are_refused() {
    for size in [1e254, 1e-254] {
        assert!(Source::uniform(size).is_err() && Source::gaussian_with_deviation(size).is_err());
    }
}
