//! Wild arguments: every constructor and step returns numbers or an error.

use fewbits_baselines::dymbo::SignFilter;
use fewbits_baselines::dymbo::first_message::first_message_value;
use fewbits_core::{Gaussian, Link, Observation, Quantized, Sign};
use fewbits_dymbo::{
    CellIndex, CountFusion, DymboFilter, InnovationWord, MultibitFilter, Multiple, ParallelFilter, Prediction,
    RoundedSample, ScalarFilter, ScalarPlant, SignBit,
};
use fewbits_models::{LinearGaussian, ScalarSensor};
use nalgebra::{Matrix2, Vector2};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(fewbits_core::laws::wild::number)
}

fn observation(which: usize) -> Observation<Sign> {
    [
        Observation::Received(Sign::Above),
        Observation::Received(Sign::Below),
        Observation::Nothing,
        Observation::Lost,
    ][which % 4]
}

fn finite(belief: &Gaussian<1>) -> bool {
    belief.is_finite() && belief.covariance()[0] >= 0.0
}

proptest! {
    #[test]
    fn scalar_filters_return_numbers_or_errors(x in prop::array::uniform8(wild()), which in 0..4_usize, word in any::<u16>(), bits in 0..10_usize) {
        let link = Link::new(x[5], x[6]).and_then(|link| link.with_erasure(x[7])).unwrap_or(Link::PERFECT);
        let Ok(belief) = Gaussian::scalar(x[3], x[4]) else { return Ok(()) };
        for plant in [ScalarPlant::new(x[0], x[1], x[2]), ScalarPlant::new_unstable(x[0], x[1], x[2])].into_iter().flatten() {
            let dymbo = DymboFilter::new(plant).with_link(link);
            if let Ok((after, info)) = dymbo.step(&belief, &observation(which)) {
                prop_assert!(finite(&after) && info.log_likelihood.is_finite(), "{:?} {:?}", dymbo, belief);
            }
            if let Ok(steady) = plant.steady_state(dymbo.information()) {
                prop_assert!(steady.predicted_variance.is_finite(), "{:?}", dymbo);
            }
            let word = Observation::Received(CellIndex(word % 300));
            if let Ok(words) = MultibitFilter::new(plant, bits)
                && let Ok((after, info)) = words.with_link(link).step(&belief, &word)
            {
                prop_assert!(finite(&after) && info.log_likelihood.is_finite(), "{:?} {:?}", plant, belief);
            }
            for fusion in [CountFusion::Linear, CountFusion::Exact] {
                if let Ok(parallel) = ParallelFilter::new(plant, 3, fusion) {
                    let seen = [observation(which), observation(which + 1), observation(which + 2)];
                    if let Ok((after, info)) = parallel.with_link(link).step(&belief, &seen) {
                        prop_assert!(finite(&after) && info.log_likelihood.is_finite(), "{:?} {:?}", parallel, belief);
                    }
                }
            }
        }
        let _ = ParallelFilter::new(ScalarPlant::new(0.9, 0.5, 1.0).unwrap(), usize::from(word) * 100, CountFusion::Linear);
    }

    #[test]
    fn first_messages_and_words_return_numbers_or_errors(x in prop::array::uniform6(wild()), multiple in any::<i64>(), bits in 0..40_u32) {
        let _ = SignBit::new(x[0]);
        if let Ok(word) = InnovationWord::new(x[0], bits as usize) {
            let prediction = Prediction { mean: x[1], deviation: x[2] };
            let _ = (word.report_of(x[3], &prediction), word.only_cell(&CellIndex(multiple as u16), &prediction));
        }
        let Ok(scheme) = RoundedSample::new(x[0], x[1]).and_then(|scheme| scheme.with_bits(bits)) else { return Ok(()) };
        let _ = (scheme.round(x[2]), scheme.cell(Multiple(multiple)));
        let message = Multiple(multiple);
        if let Ok(belief) = scheme.belief(message) {
            prop_assert!(finite(&belief), "{:?}", belief);
        }
        if let Ok(prior) = Gaussian::scalar(x[3], x[4]) {
            if let Ok(belief) = scheme.belief_with_prior(message, &prior) {
                prop_assert!(finite(&belief), "{:?}", belief);
            }
            if prior.covariance()[0] + x[0] < 1e4 * x[1] * x[1]
                && let Ok(value) = first_message_value(&scheme, &prior)
            {
                prop_assert!(value.expected_variance.is_finite() && value.entropy_bits.is_finite(), "{:?} {:?}: {:?}", scheme, prior, value);
            }
        }
    }

    #[test]
    fn vector_filters_return_numbers_or_errors(x in prop::array::uniform16(wild()), which in 0..4_usize) {
        let dynamics = LinearGaussian::with_covariance(Matrix2::new(1.0, 1.0, 0.0, 1.0), Matrix2::identity()).unwrap();
        let sensors = [ScalarSensor::scalar(Vector2::new(x[0], x[1]), x[2]), ScalarSensor::scalar(Vector2::new(x[3], x[4]), x[5])];
        let [Ok(one), Ok(two)] = sensors else { return Ok(()) };
        let Ok(belief) = Gaussian::new(Vector2::new(x[6], x[7]), Matrix2::new(x[8], x[9], x[9], x[10])) else { return Ok(()) };
        let link = Link::new(x[11], x[12]).unwrap_or(Link::PERFECT);
        let filter = SignFilter::new(dynamics, [one, two]).with_link(link);
        for after in [
            filter.update(&belief, which % 3, &observation(which)),
            filter.update_parallel(&belief, &[observation(which), observation(which + 1)]),
        ]
        .into_iter()
        .flatten()
        {
            prop_assert!(after.0.is_finite() && after.1.log_likelihood.is_finite(), "{:?} {:?}: {:?}", filter, belief, after);
        }
    }
}
