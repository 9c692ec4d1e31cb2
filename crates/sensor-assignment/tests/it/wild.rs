//! Wild arguments: assignments, costs and errors are numbers or refused.

use fewbits_baselines::sensor_assignment::{by_precision, flipped_estimate, variances_with_moments};
use fewbits_core::Observation;
use fewbits_numerics::wild;
use fewbits_sensor_assignment::{CodedSensors, CostMatrix, Estimator, pair_costs};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

proptest! {
    #[test]
    fn assignments_are_numbers_or_refused(x in prop::array::uniform9(wild()), count in 0..4_usize, choice in prop::collection::vec(0..4_usize, 0..4)) {
        if let Ok(costs) = CostMatrix::new(count, x[..count * count].to_vec()) {
            let found = costs.solve();
            prop_assert!(costs.cost(&found).is_ok(), "{:?} {:?}", costs, found);
            let _ = (costs.certificate(&found), costs.certificate(&choice), costs.cost(&choice));
        }
        let _ = (flipped_estimate(x[0], count, 3, x[1]), by_precision(&x[..count]));
        if let Ok(Some(variances)) = variances_with_moments(x[0], x[1], x[2], &x[3..6]) {
            prop_assert!(variances.iter().all(|v| v.is_finite() && *v >= 0.0), "{:?}", variances);
        }
        let sensors = [CodedSensors::with_variances(x[0], &x[1..1 + count]), CodedSensors::with_deviations(x[0], &x[1..1 + count])];
        // Noise that is narrow against the cells asks for many nodes: with others the costs are soon found.
        let quick = |sensors: &CodedSensors| sensors.noise_deviations().iter().all(|noise| sensors.half_width() < 100.0 * noise);
        for sensors in sensors.into_iter().flatten().filter(quick) {
            let costs = pair_costs(&sensors);
            let all = (0..costs.size()).flat_map(|i| (0..costs.size()).map(move |j| (i, j)));
            prop_assert!(all.into_iter().all(|(i, j)| costs.get(i, j).is_some_and(f64::is_finite)), "{:?}", sensors);
        }
    }
}

proptest! {
    // Each case sums over nodes and outcomes: one case in 8.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(8), ..ProptestConfig::default() })]
    #[test]
    fn errors_of_assignments_are_numbers_or_refused(x in prop::array::uniform4(wild()), choice in prop::collection::vec(0..3_usize, 2)) {
        let Ok(sensors) = CodedSensors::with_deviations(x[0], &x[1..3]) else { return Ok(()) };
        for error in [Estimator::PosteriorMean, Estimator::CellCentre].map(|estimator| sensors.mse(&choice, estimator)).into_iter().flatten() {
            prop_assert!(error.is_finite() && error >= 0.0, "{:?}: {}", sensors, error);
        }
        if let Ok(estimate) = sensors.decode(&choice, &[Observation::Nothing, Observation::Lost]) {
            prop_assert!(estimate.is_finite());
        }
    }
}
