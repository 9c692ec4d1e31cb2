//! The filter against the Kalman filter, and what it refuses.

use fewbits_core::factor::Value;
use fewbits_core::{Belief, BitString, CodecError, Gaussian, Likelihood, Message, Observed};
use fewbits_densities::{Bandwidth, Mixture, Particles};
use fewbits_handoff::{Coded, Components, HandoffFilter, Handover, RateLimited, Reducer, Whole, trimmed};
use fewbits_mixture_codec::Reduction;
use fewbits_mixture_codec::plug_in::plug_in;
use fewbits_mixture_codec::wire::{CodedMixture, RateControl, WireFormat};
use fewbits_models::{Ar1, ScalarSensor};
use fewbits_monte_carlo::Stream;
use nalgebra::{SVector, Vector1};

/// Mean and variance of the scalar Kalman filter.
fn kalman(belief: (f64, f64), a: f64, q: f64, r: f64, z: f64) -> (f64, f64) {
    let (m, v) = (a * belief.0, a * a * belief.1 + q);
    let gain = v / (v + r);
    (m + gain * (z - m), (1.0 - gain) * v)
}

fn follows_kalman(reducer: &dyn Reducer<1>, slack: f64) {
    let (a, q, r) = (0.9, 0.3, 0.5);
    let filter = HandoffFilter::new(4000, reducer).unwrap();
    let (walk, sensor) = (Ar1::new(a, q).unwrap(), ScalarSensor::scalar(Vector1::new(1.0), r).unwrap());
    let mut rng = Stream::new(61).rng();
    let mut truth = (0.0, 1.0);
    let mut known = Mixture::single(&Gaussian::scalar(0.0, 1.0).unwrap()).unwrap();
    for z in [0.3, -0.8, 1.9, 0.4, -0.1, 2.2] {
        truth = kalman(truth, a, q, r, z);
        let seen = Observed::new(sensor, Value::new(Vector1::new(z), [[r]].into()).unwrap());
        let (handover, info) = filter.step(&mut rng, &known, &walk, &seen).unwrap();
        assert!(info.kept <= 4000 && info.effective_sample_size > 100.0 && info.log_likelihood.is_finite());
        known = handover.into_mixture();
        assert!((known.mean()[0] - truth.0).abs() < slack, "{} {}", known.mean()[0], truth.0);
        assert!((known.covariance()[(0, 0)] / truth.1 - 1.0).abs() < 3.0 * slack);
        let error = plug_in(&info.estimate, &known);
        let (ml, dr) = (error.ml_plugin, error.dr_plugin);
        assert!(error.kl_plugin.is_finite() && dr <= ml && ml <= 2.0 * dr + 0.5);
    }
}

#[test]
fn a_linear_world_is_tracked_as_by_kalman_whatever_travels() {
    follows_kalman(&Whole, 0.06);
    follows_kalman(&Components::new(3), 0.06);
    follows_kalman(
        &Components {
            components: 1,
            reduction: Reduction::SingleGaussian,
        },
        0.06,
    );
    let format = WireFormat::around_origin(1.0, 0.15).unwrap();
    follows_kalman(
        &Coded {
            components: 2,
            reduction: Reduction::default(),
            format: format.clone(),
            resolution: 0,
        },
        0.12,
    );
    let control = RateControl {
        components: vec![1, 2],
        ..RateControl::default()
    };
    follows_kalman(
        &RateLimited {
            control,
            format,
            budget: 60,
        },
        0.12,
    );
}

/// What is handed on is what the message holds: decoded again by another receiver it is the same mixture, and a message that is
/// changed on the way changes it.
#[test]
fn handover_is_decoded_from_its_message() {
    let x: Vec<f64> = (0..100).map(|i| (f64::from(i) * 0.77).sin()).collect();
    let estimate = HandoffFilter::new(100, Whole)
        .unwrap()
        .estimate(&Particles::uniform([x]).unwrap())
        .unwrap();
    let format = WireFormat::around_origin(1.0, 0.25).unwrap();
    let coded = Coded {
        components: 3,
        reduction: Reduction::default(),
        format: format.clone(),
        resolution: 0,
    };
    let limited = RateLimited {
        control: RateControl::default(),
        format: format.clone(),
        budget: 60,
    };
    let reducers: [&dyn Reducer<1>; 2] = [&coded, &limited];
    for reducer in reducers {
        let handover = reducer.reduce(&estimate).unwrap();
        let message = handover.message().unwrap();
        let decoded = CodedMixture::from_bits(&format, message).unwrap().into_mixture();
        assert_eq!(handover.mixture(), &decoded);
        // The message is coarser than the estimate that it stands for.
        assert_ne!(decoded.mean(), estimate.mean());
    }
    let whole = Whole.reduce(&estimate).unwrap();
    assert_eq!(whole.message(), None);
    let lost =
        Handover::<1>::received(
            BitString::default(),
            |bits| Ok(CodedMixture::from_bits(&format, bits)?.into_mixture()),
        );
    assert!(lost.map_err(|error: CodecError| error).is_err());
}

#[test]
fn shrinkage_undoes_what_the_kernel_adds() {
    let x: Vec<f64> = (0..100).map(|i| (f64::from(i) * 0.77).sin()).collect();
    let particles = Particles::uniform([x]).unwrap();
    let filter = HandoffFilter::new(100, Whole).unwrap();
    let kept = filter.estimate(&particles).unwrap().covariance()[(0, 0)];
    let unshrunk = HandoffFilter {
        shrink: false,
        ..filter
    };
    let wide = unshrunk.estimate(&particles).unwrap().covariance()[(0, 0)];
    assert!((kept - particles.covariance()[(0, 0)]).abs() < 1e-12 && wide > 1.05 * kept);
}

struct Impossible;

impl Likelihood<1> for Impossible {
    fn log_likelihood(&self, _: &SVector<f64, 1>) -> f64 {
        f64::NEG_INFINITY
    }
}

#[test]
fn what_cannot_be_is_an_error_by_name() {
    let filter = HandoffFilter::new(50, Components::new(2)).unwrap();
    let walk = Ar1::new(0.9, 0.3).unwrap();
    let known = Mixture::single(&Gaussian::scalar(0.0, 1.0).unwrap()).unwrap();
    let mut rng = Stream::new(62).rng();
    let refusal = filter
        .step(&mut rng, &known, &walk, &Impossible)
        .unwrap_err()
        .to_string();
    assert!(refusal.contains("impossible"), "{refusal}");
    assert!(HandoffFilter::new(0, Whole).is_err());
    let none = HandoffFilter::new(50, Components::new(0)).unwrap();
    let sensor = ScalarSensor::scalar(Vector1::new(1.0), 0.5).unwrap();
    let seen = Observed::new(sensor, Value::new(Vector1::new(0.1), [[0.5]].into()).unwrap());
    assert!(
        none.step(&mut rng, &known, &walk, &seen)
            .unwrap_err()
            .to_string()
            .contains("components")
    );
    // A single particle has no spread to smooth over, unless the bandwidth has a floor.
    let mut single = HandoffFilter::new(1, Components::new(1)).unwrap();
    assert!(single.step(&mut rng, &known, &walk, &seen).is_err());
    single.bandwidth = Bandwidth {
        floor: 0.1,
        ..Bandwidth::default()
    };
    single.step(&mut rng, &known, &walk, &seen).unwrap();
}

#[test]
fn trimming_keeps_the_heavy_and_normalises() {
    let p = Particles::new([vec![0.0, 1.0, 2.0, 3.0]], &[0.0, -20.0, f64::NEG_INFINITY, 0.0]).unwrap();
    let kept = trimmed(&p, 0.01).unwrap();
    assert_eq!(kept.columns()[0], [0.0, 3.0]);
    assert!((kept.weights().iter().sum::<f64>() - 1.0).abs() < 1e-15);
    assert_eq!(trimmed(&p, 0.0).unwrap().len(), 3);
    assert_eq!(trimmed(&p, 1e9).unwrap().len(), 2);
    assert!(trimmed(&p, -1.0).is_err() && trimmed(&p, f64::NAN).is_err());
}
