//! Wild arguments: models, systems and designs answer numbers or errors.

use fewbits_core::Observation;
use fewbits_numerics::wild;
use fewbits_quantizer_design::decoder::MmseDecoder;
use fewbits_quantizer_design::{
    Channel, Criterion, JointTable, Labelling, Newton, Noise, ObservationModel, Prior, Quantizer, Symbol, System,
    bounds, design,
};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

fn priors(x: &[f64; 8]) -> impl Iterator<Item = Prior> {
    [
        Prior::normal(x[0], x[1]),
        Prior::normal(0.0, x[1]),
        Prior::uniform(x[0], x[1]),
        Prior::binary(x[0], x[1]),
        Prior::discrete(vec![x[0], x[1]], vec![x[2], x[3]]),
        Prior::sample(&x[..3]),
        Prior::mixture(&[(x[0], x[1], x[2]), (0.5, 0.0, 1.0)]),
    ]
    .into_iter()
    .flatten()
}

fn noises(x: &[f64; 8]) -> impl Iterator<Item = Noise> {
    [
        Noise::independent_with_deviations(&x[4..6]),
        Noise::equicorrelated_with_deviations(&x[4..6], x[6]),
        Noise::one_factor_with_deviations(&x[2..4], &x[4..6]),
    ]
    .into_iter()
    .flatten()
}

fn models(x: &[f64; 8]) -> Vec<ObservationModel> {
    let noises: Vec<Noise> = noises(x).collect();
    priors(x)
        .flat_map(|prior| {
            noises
                .iter()
                .flat_map(move |noise| ObservationModel::new(prior.clone(), noise.clone()).ok())
                .collect::<Vec<_>>()
        })
        .collect()
}

proptest! {
    // Each case builds up to 28 models: one case in 16.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(16), ..ProptestConfig::default() })]
    #[test]
    fn models_and_systems_answer_numbers(x in prop::array::uniform8(wild()), levels in 1..4_usize) {
        for prior in priors(&x) {
            prop_assert!(prior.mean().is_finite() && !prior.deviation().is_nan(), "{:?}", prior);
        }
        for model in models(&x) {
            prop_assert!(model.prior().deviation().powi(2) >= 0.0 && model.prior().mean().is_finite() && model.sample_deviation(0) >= 0.0, "{:?}", model);
            let _ = model.subset(&[levels]);
            for criterion in [Criterion::MutualInformation, Criterion::MeanSquaredError] {
                if let Ok(Some(bound)) = bounds::unquantised(&model, criterion) {
                    prop_assert!(!bound.is_nan(), "{:?}", model);
                }
            }
            let Ok(system) = System::lloyd_max(model, levels) else { continue };
            if let Ok(table) = system.subset(&[0]).and_then(|alone| JointTable::new(&alone)) {
                let total: f64 = (0..table.outcomes()).map(|t| table.probability(t)).sum();
                prop_assert!((total - 1.0).abs() < 1e-6, "{:?}: {}", system, total);
            }
        }
    }
}

proptest! {
    // Each case designs quantizers: one case in 64.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(64), ..ProptestConfig::default() })]
    #[test]
    fn decoders_and_designs_answer_numbers(x in prop::array::uniform8(wild()), symbols in prop::array::uniform2(0..4_usize)) {
        for model in models(&x).into_iter().take(3) {
            let channel = Channel::binary_symmetric(&Labelling::natural(2).unwrap(), x[7]).unwrap_or_else(|_| Channel::ideal(2).unwrap());
            let quantizers = vec![Quantizer::new(vec![x[6]]).unwrap_or_else(|_| Quantizer::new(vec![0.0]).unwrap()); 2];
            let Ok(system) = System::distinct(model, quantizers, vec![channel; 2]) else { continue };
            if let Ok(decoder) = MmseDecoder::new(&system, 64)
                && let Ok(estimate) = decoder.decode(&[Observation::Received(Symbol(symbols[0])), Observation::Lost])
            {
                prop_assert!(estimate.mean.is_finite() && estimate.variance >= 0.0, "{:?}: {:?}", system, estimate);
            }
            if let Ok(table) = JointTable::new(&system) {
                let _ = (table.decide(symbols[0]), table.equivocation());
            }
            for criterion in [Criterion::MutualInformation, Criterion::MeanSquaredError] {
                if let Ok(found) = design::joint(&system, criterion, &Newton::default()) {
                    prop_assert!(found.value.is_finite(), "{:?}: {:?}", system, found.value);
                    prop_assert!(found.system.quantizers().iter().flat_map(|q| q.breakpoints().to_vec()).all(|b| b.is_finite()));
                }
            }
        }
    }
}
