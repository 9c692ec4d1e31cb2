//! Wild arguments: every constructor and step of this crate returns numbers or an error.

use fewbits_core::factor::Factor;
use fewbits_core::{Gaussian, Link, Observation, Scheme};
use fewbits_numerics::wild;
use fewbits_quantizers::density::{Normal, Uniform};
use fewbits_quantizers::{Channel, Labelling, LloydMax, Quantizer, QuantizingSensor, Symbol, lloyd_max};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

fn is_distribution(p: &[f64]) -> bool {
    p.iter().all(|p| (0.0..=1.0 + 1e-12).contains(p)) && (p.iter().sum::<f64>() - 1.0).abs() < 1e-9
}

fn check_design(q: &LloydMax) {
    assert!(q.breakpoints().iter().chain(q.centroids()).all(|x| x.is_finite()), "{q:?}");
    assert!(is_distribution(q.probabilities()) && q.mean_squared_error() >= 0.0, "{q:?}");
}

proptest! {
    #[test]
    fn quantizers_answer_numbers_or_errors(x in prop::array::uniform8(wild()), labels in prop::collection::vec(0..5_usize, 0..5), count in 0..5_usize) {
        let mut all: Vec<Quantizer> = Vec::new();
        all.extend(Quantizer::new(x[..count].to_vec()));
        all.extend(Quantizer::with_labels(x[..count].to_vec(), labels));
        all.extend(Quantizer::symmetric(x[0]));
        let mut sorted = x.to_vec();
        sorted.sort_by(f64::total_cmp);
        all.extend(Quantizer::new(sorted[..count].to_vec()));
        for q in &all {
            let _ = (q.encode(x[4]), q.cell(count), q.mirrored(), q.edges(count.min(q.cells() - 1)));
            if let Ok(moved) = q.affine(x[6], x[7]) {
                prop_assert!(moved.breakpoints().iter().all(|b| b.is_finite()), "{:?}", moved);
            }
            let channel = Channel::pulse_amplitude(q.levels(), x[6]);
            if let Some(factor) = channel.ok().and_then(|channel| q.factor(count, &channel, x[5]).ok()) {
                let log = factor.log_likelihood(&[x[4]].into());
                prop_assert!(!x[4].is_finite() || !log.is_nan(), "{:?} {}", factor, x[4]);
            }
            let Ok(labelling) = Labelling::natural(q.levels()) else { continue };
            if let Ok(sensor) = QuantizingSensor::with_variance(q.clone(), labelling, x[5]) {
                let link = Link::new(x[0], x[1]).unwrap_or(Link::PERFECT);
                if let Ok(factor) = sensor.factor(&(), &Observation::Received(Symbol(count)), &link) {
                    prop_assert!(!x[4].is_finite() || !factor.log_likelihood(&[x[4]].into()).is_nan());
                    if let Ok(tilted) = Gaussian::scalar(x[2], x[3]).map_err(Into::into).and_then(|prior| factor.tilted(&prior)) {
                        prop_assert!(tilted.mean[0].is_finite() && tilted.covariance[0] >= 0.0, "{:?}", tilted);
                    }
                }
            }
        }
    }

    #[test]
    fn channels_are_distributions(x in prop::array::uniform8(wild()), levels in 0..9_usize) {
        let mut all: Vec<Channel> = Vec::new();
        all.extend(Channel::ideal(levels));
        all.extend(Channel::symbol_erasure(levels, x[0]));
        all.extend(Channel::pulse_amplitude(levels, x[0]));
        all.extend(Channel::from_rows(&[vec![x[0], x[1]], vec![x[2], x[3]]]));
        if let Ok(labelling) = Labelling::gray(levels) {
            all.extend(Channel::binary_symmetric(&labelling, x[1]));
        }
        for channel in &all {
            for input in 0..channel.inputs() {
                let row: Vec<f64> = (0..channel.outputs()).map(|output| channel.probability(output, input)).collect();
                prop_assert!(is_distribution(&row), "{:?}", channel);
            }
        }
        let _ = Labelling::new(x.iter().map(|x| *x as u32).collect());
        let _ = Labelling::with_words(levels as u32, x.iter().map(|x| *x as u32).collect());
    }
}

proptest! {
    // Each case designs several quantizers: one case in 8.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(8), ..ProptestConfig::default() })]
    #[test]
    fn designs_are_numbers_or_errors(x in prop::array::uniform4(wild()), levels in 0..6_usize) {
        if let Ok(normal) = Normal::with_deviation(x[0], x[1]) {
            if let Ok(q) = lloyd_max::design(&normal, levels) {
                check_design(&q);
                if let Ok(moved) = q.affine(x[2], x[3]) {
                    prop_assert!(moved.centroids().iter().all(|c| c.is_finite()) && !moved.mean_squared_error().is_nan(), "{:?}", moved);
                }
            }
            if let Ok(q) = lloyd_max::design_from(&normal, &x[2..]) {
                check_design(&q);
            }
        }
        if let Ok(q) = Uniform::new(x[0], x[1]).map_err(|_| ()).and_then(|u| lloyd_max::design(&u, levels).map_err(|_| ())) {
            check_design(&q);
        }
    }
}
