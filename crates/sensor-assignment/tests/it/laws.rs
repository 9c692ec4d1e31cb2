//! Laws of assignments on random sensors.

use fewbits_baselines::sensor_assignment::{all_errors, variances_with_moments};
use fewbits_binary_patterns::bounds::optimal_weight_van_trees;
use fewbits_sensor_assignment::{CodedSensors, Estimator, exchange, pair_costs};
use proptest::prelude::*;

fn variances() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec((-7.0f64..-1.0).prop_map(f64::exp), 2..6)
}

proptest! {
    // One case in 16 of `PROPTEST_CASES`: they are dear.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(16), ..ProptestConfig::default() })]

    #[test]
    fn enumeration_bounds_every_assignment(variances in variances(), half_width in 0.5f64..2.0) {
        let sensors = CodedSensors::with_variances(half_width, &variances).unwrap();
        let costs = pair_costs(&sensors);
        let found = costs.solve();
        prop_assert!(costs.certificate(&found).unwrap().is_optimal());
        for estimator in [Estimator::CellCentre, Estimator::PosteriorMean] {
            let all = all_errors(&sensors, estimator).unwrap();
            let ours = sensors.mse(&found, estimator).unwrap();
            let swapped = exchange(&sensors, &found, estimator).unwrap();
            prop_assert!(all.least <= swapped.error * (1.0 + 1e-9));
            prop_assert!(swapped.error <= ours * (1.0 + 1e-12));
            prop_assert!(ours <= all.largest * (1.0 + 1e-9));
        }
        // The posterior mean beats the centre decoder and obeys the Bayesian bound.
        let mmse = sensors.mse(&found, Estimator::PosteriorMean).unwrap();
        prop_assert!(mmse <= sensors.mse(&found, Estimator::CellCentre).unwrap() * (1.0 + 1e-12));
        prop_assert!(optimal_weight_van_trees(&sensors.bank(&found).unwrap()).unwrap() <= mmse * (1.0 + 1e-9));
    }

    #[test]
    fn moments_are_met_or_refused(mean in 0.01f64..0.1, share in 0.0f64..2.0, direction in prop::collection::vec(-3.0f64..3.0, 4)) {
        let std = share * mean;
        match variances_with_moments(mean, std, 1e-4, &direction) {
            Ok(Some(v)) => {
                let m = v.iter().sum::<f64>() / 4.0;
                let s = (v.iter().map(|v| (v - m) * (v - m)).sum::<f64>() / 4.0).sqrt();
                prop_assert!((m - mean).abs() < 1e-12 && (s - std).abs() < 1e-12 && v.iter().all(|v| *v >= 1e-4));
            }
            Ok(None) => prop_assert!(std > 0.0),
            Err(_) => prop_assert!(std > mean * 3f64.sqrt()),
        }
    }
}

/// Six sensors: the linear assignment is within a few per cent for the centre decoder, exchanges reach the optimum under the
/// posterior mean.
#[test]
fn exchanges_close_the_gap_of_the_linear_assignment() {
    let directions = [
        [0.3, -1.1, 0.7, 1.9, -0.4, -1.3],
        [1.0, 0.2, -0.6, -1.5, 0.9, 0.1],
        [-0.8, 0.4, 0.4, -0.2, 2.1, -1.0],
        [0.0, 0.5, -0.5, 1.0, -1.0, 0.2],
    ];
    for direction in directions {
        let Some(v) = variances_with_moments(0.02, 0.01, 1e-4, &direction).unwrap() else {
            panic!("a variance is too small");
        };
        let sensors = CodedSensors::with_variances(1.0, &v).unwrap();
        let found = pair_costs(&sensors).solve();
        let centre = all_errors(&sensors, Estimator::CellCentre).unwrap();
        assert!(sensors.mse(&found, Estimator::CellCentre).unwrap() <= 1.09 * centre.least);
        let mmse = all_errors(&sensors, Estimator::PosteriorMean).unwrap();
        let swapped = exchange(&sensors, &found, Estimator::PosteriorMean).unwrap();
        assert!((swapped.error - mmse.least).abs() <= 1e-9 * mmse.least);
    }
}
