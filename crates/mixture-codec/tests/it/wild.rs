//! Wild arguments: trees, reductions and messages are numbers, or refused.

use fewbits_core::{BitString, Message};
use fewbits_densities::{Bandwidth, Component, KernelEstimate, Mixture, Particles};
use fewbits_mixture_codec::plug_in;
use fewbits_mixture_codec::wire::{CodedMixture, WireFormat};
use fewbits_mixture_codec::{Criterion, MergeCost, Reduction, Split, merge};
use fewbits_numerics::wild;
use nalgebra::{Matrix2, Vector2};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

fn mixture(x: &[f64]) -> Option<Mixture<2>> {
    let covariance = Matrix2::new(x[0], x[1], x[1], x[2]);
    let parts = [
        Component::new(x[3], Vector2::new(x[4], x[5]), covariance),
        Component::new(x[6], Vector2::new(x[7], x[8]), Matrix2::identity()),
    ];
    Mixture::new(parts.into_iter().flatten().collect()).ok()
}

/// Squares of all numbers are numbers.
fn tame(x: &[f64]) -> bool {
    x.iter().all(|x| x.abs() < 1e150)
}

proptest! {
    #[test]
    fn messages_are_decoded_as_they_were_or_refused(x in prop::array::uniform12(wild()), bytes in prop::collection::vec(any::<u8>(), 0..40), resolution in 0..3_usize) {
        let format = WireFormat::new(Vector2::new(x[9], x[10]), x[11], x[0], &[x[1], 0.25]);
        let formats = [format, WireFormat::around_origin(x[0], x[1]), WireFormat::around_origin(1.0, 0.25)];
        for format in formats.into_iter().flatten() {
            if let Some(mixture) = mixture(&x)
                && let Ok(message) = CodedMixture::new(&mixture, &format, resolution)
            {
                prop_assert!(message.mixture().components().iter().all(|c| c.gaussian().is_finite()), "{:?} {:?}", format, mixture);
                let bits = message.to_bits(&format).unwrap();
                prop_assert_eq!(&CodedMixture::from_bits(&format, &bits).unwrap(), &message);
            }
            if let Ok(bits) = BitString::from_bytes(bytes.clone(), 8 * bytes.len())
                && let Ok(message) = CodedMixture::from_bits(&format, &bits)
            {
                prop_assert!(message.mixture().components().iter().all(|c| c.gaussian().is_finite()), "{:?}", message);
                prop_assert_eq!(message.to_bits(&format).unwrap(), bits);
            }
        }
    }
}

proptest! {
    // Each case builds trees and merges: one case in 8.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(8), ..ProptestConfig::default() })]
    #[test]
    fn reductions_are_numbers_or_refused(x in prop::array::uniform12(wild()), components in 0..6_usize) {
        let Ok(cloud) = Particles::new([x[..4].to_vec(), x[4..8].to_vec()], &x[8..12]) else { return Ok(()) };
        let kernel = Matrix2::new(x[1].abs(), 0.0, 0.0, x[2].abs());
        let estimates = [KernelEstimate::new(cloud.clone(), kernel), KernelEstimate::fit(cloud, &Bandwidth::default())];
        for estimate in estimates.into_iter().flatten() {
            for reduction in [
                Reduction::SingleGaussian,
                Reduction::paper(Criterion::Kl),
                Reduction::Optimal { split: Split::PRINCIPAL, criterion: Criterion::LogDeterminant },
                Reduction::Merging { cost: MergeCost::Runnalls },
                Reduction::default(),
            ] {
                if let Ok(reduced) = reduction.reduce(&estimate, components) {
                    prop_assert!(reduced.len() <= components && reduced.components().iter().all(|c| c.gaussian().is_finite()), "{:?} {:?}: {:?}", reduction, estimate, reduced);
                    let error = plug_in::plug_in(&estimate, &reduced);
                    prop_assert!(!tame(&x) || !error.kl_plugin.is_nan(), "{:?} {:?}: {:?}", reduction, estimate, error);
                }
            }
        }
        if let Some(mixture) = mixture(&x) && let Ok(merged) = merge::merge(&mixture, components, MergeCost::Runnalls) {
            prop_assert!(merged.mixture.components().iter().all(|c| c.gaussian().is_finite()), "{:?}", mixture);
        }
    }
}
