//! Moments after silence against brute force.

use crate::Instant;
use crate::Silence;
use fewbits_baselines::cfwmd::trigger::{StochasticTrigger, Triggered};
use fewbits_cfwmd::censored::{Censored, MissingReports};
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::rule::CensoringRule;
use fewbits_cfwmd::threshold::threshold;
use fewbits_core::laws::factor::{is_a_number, sweep_is_scalar};
use fewbits_core::{Dynamics, Factor, Gaussian, Link, Observation, Scheme, Sensing};
use fewbits_filters::kalman;
use fewbits_models::{Ar1, LinearSensor};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::normal::log_pdf_with;
use nalgebra::{Matrix2, Vector1, Vector2};
use proptest::prelude::*;

/// Mass, mean and variance by a fine trapezoid over everything that matters.
fn brute(s: &Silence, mean: f64, variance: f64) -> [f64; 3] {
    let factor = s.factor();
    let reach = 12.0 * variance.sqrt();
    let (n, low) = (6_000, mean - reach);
    let step = 2.0 * reach / n as f64;
    let log_terms: Vec<f64> = (0..=n)
        .map(|i| {
            let y = low + i as f64 * step;
            log_pdf_with(y, mean, variance) + factor.log_likelihood(&Vector1::new(y))
        })
        .collect();
    let largest = log_terms.iter().fold(f64::NEG_INFINITY, |m, t| m.max(*t));
    let weights: Vec<f64> = log_terms.iter().map(|t| (t - largest).exp()).collect();
    let total: f64 = weights.iter().sum();
    let at = |i: usize| low + i as f64 * step;
    let centre = weights.iter().enumerate().map(|(i, w)| w * at(i)).sum::<f64>() / total;
    let spread = weights
        .iter()
        .enumerate()
        .map(|(i, w)| w * (at(i) - centre).powi(2))
        .sum::<f64>()
        / total;
    [largest + (total * step).ln(), centre, spread]
}

proptest! {
    #[test]
    fn scalar_moments_are_the_integrals(
        mean in -4.0..4.0f64, variance in 0.05..60.0f64, centre in -3.0..3.0f64, half_width in 0.05..4.0f64,
        noise in 0.2..4.0f64, loss in prop_oneof![Just(0.0), 0.001..0.9f64], count in 1..5usize,
    ) {
        let silence = Silence { centre, half_width, noise_variance: noise, loss, count };
        let ours = silence.moments(mean, variance).unwrap();
        let [log_mass, m, v] = brute(&silence, mean, variance);
        prop_assert!((ours.log_evidence - log_mass).abs() < 1e-7, "{ours:?} {log_mass}");
        prop_assert!((ours.mean[0] - m).abs() < 1e-7 * variance.sqrt().max(1.0), "{ours:?} {m}");
        prop_assert!((ours.covariance[0] / v - 1.0).abs() < 1e-6, "{ours:?} {v}");
        prop_assert!(loss > 0.0 || ours.covariance[0] < variance);
    }
}

/// Erratum `cfwmd-1`.
#[test]
fn far_tails_and_wide_beliefs_stay_accurate() {
    let base = Silence {
        centre: 0.0,
        half_width: 1.0,
        noise_variance: 1.0,
        loss: 0.0,
        count: 2,
    };
    for (mean, variance) in [(30.0, 1.0), (200.0, 4.0), (0.5, 400.0), (-60.0, 300.0)] {
        let ours = base.moments(mean, variance).unwrap();
        let [log_mass, m, v] = brute(&Silence { ..base }, mean, variance);
        // The brute force window is centred on the prior; where it misses the bulk the derivative identity decides instead.
        if (m - mean).abs() < 11.0 * variance.sqrt() {
            assert!((ours.log_evidence - log_mass).abs() < 1e-7 * log_mass.abs().max(1.0), "{mean} {variance}");
            assert!((ours.mean[0] - m).abs() < 1e-6 * variance.sqrt() && (ours.covariance[0] / v - 1.0).abs() < 1e-5);
        }
        // d ln Z / d m = (E y - m)/p.
        let step = 1e-4 * variance.sqrt();
        let slope = (base.moments(mean + step, variance).unwrap().log_evidence
            - base.moments(mean - step, variance).unwrap().log_evidence)
            / (2.0 * step);
        assert!((mean + variance * slope - ours.mean[0]).abs() < 1e-4 * variance.sqrt(), "{mean} {variance}");
    }
}

#[test]
fn a_known_state_only_weighs() {
    let silence = Silence {
        centre: 0.2,
        half_width: 1.0,
        noise_variance: 2.0,
        loss: 0.1,
        count: 3,
    };
    let ours = silence.moments(0.7, 0.0).unwrap();
    assert_eq!((ours.mean[0], ours.covariance[0]), (0.7, 0.0));
    assert!((ours.log_evidence - silence.factor().log_likelihood(&Vector1::new(0.7))).abs() < 1e-14);
}

#[test]
fn an_always_sending_sensor_behind_a_lossy_link_says_nothing() {
    let silence = Silence {
        centre: 0.0,
        half_width: 0.0,
        noise_variance: 1.0,
        loss: 0.25,
        count: 2,
    };
    let ours = silence.moments(3.0, 2.0).unwrap();
    assert!((ours.mean[0] - 3.0).abs() < 1e-15 && (ours.covariance[0] - 2.0).abs() < 1e-15);
    assert!((ours.log_evidence - 2.0 * 0.25_f64.ln()).abs() < 1e-15);
    assert!(Silence { loss: 0.0, ..silence }.moments(3.0, 2.0).is_err());
}

/// Issue: the mode lies far from the prior's mean, or far from the interval; many sensors make it narrow.
#[test]
fn many_silent_sensors_far_from_the_prior_have_moments() {
    let lossy = Silence {
        centre: 0.0,
        half_width: 1.414,
        noise_variance: 1.0,
        loss: 0.3,
        count: 15,
    };
    let ours = lossy.moments(4.0, 0.01).unwrap();
    assert!((ours.mean[0] - 3.9949).abs() < 1e-4 && (ours.covariance[0] - 0.01013).abs() < 1e-5, "{ours:?}");
    let wide = Silence {
        half_width: 10.0,
        noise_variance: 30.0,
        loss: 0.0,
        count: 9,
        ..lossy
    };
    let ours = wide.moments(24.0, 0.1).unwrap();
    assert!((ours.mean[0] - 23.54).abs() < 0.005 && (ours.covariance[0] - 0.0973).abs() < 1e-4, "{ours:?}");
    for (silence, mean, variance) in [(lossy, 4.0, 0.01), (wide, 24.0, 0.1)] {
        let ours = silence.moments(mean, variance).unwrap();
        let [log_mass, m, v] = brute(&silence, mean, variance);
        assert!((ours.log_evidence - log_mass).abs() < 1e-7 && (ours.mean[0] - m).abs() < 1e-7);
        assert!((ours.covariance[0] / v - 1.0).abs() < 1e-6);
    }
}

/// Issue: two silences about zero, a belief at 1e200.
#[test]
fn an_absurd_prior_is_impossible_or_finite() {
    for (count, loss) in [(1, 0.0), (2, 0.0), (2, 0.3)] {
        let silence = Silence {
            centre: 0.0,
            half_width: 1.0,
            noise_variance: 1.0,
            loss,
            count,
        };
        for mean in [1e10, 1e150, 1e200, -1e300] {
            match silence.moments(mean, 2.0) {
                Ok(t) => assert!(t.log_evidence.is_finite() && t.mean[0].is_finite() && t.covariance[0] >= 0.0),
                Err(error) => assert_eq!(error, fewbits_core::Error::Impossible),
            }
        }
    }
}

/// Values of identical sensors that are so far apart that no number holds their probability.
#[test]
fn values_too_far_apart_are_impossible_and_not_refused() {
    let prior = Gaussian::scalar(0.0, 1.0).unwrap();
    let factor = Censored::values(&[Vector1::new(1e200), Vector1::new(-1e200)], &[[1.0]].into(), 0.5).unwrap();
    assert_eq!(factor.tilted(&prior), Err(fewbits_core::Error::Impossible));
    assert_eq!(factor.log_likelihood(&Vector1::new(0.3)), f64::NEG_INFINITY);
}

/// Issue: 50 honest sensors over a lossy link; with 60,000 steps it passes as well.
#[test]
fn fifty_honest_sensors_never_make_a_belief_that_is_no_number() {
    let (dynamics, sensor) = (Ar1::new(0.95, 4.0).unwrap(), LinearSensor::direct(1.0).unwrap());
    let network = Network::new(vec![sensor; 50], 1.0, Link::lossy(0.3).unwrap()).unwrap();
    let mut rng = Stream::new(4).fast_rng();
    let (mut truth, mut belief) = (Vector1::new(0.0), Gaussian::scalar(0.0, 1.0).unwrap());
    let mut squares = 0.0;
    for k in 0..4_000 {
        truth = dynamics.propagate(&mut rng, &truth);
        let predicted = kalman::predict(&dynamics, &belief);
        let rules = network.rules_under(&predicted).unwrap();
        let measurements: Vec<_> = (0..50).map(|_| sensor.sample(&mut rng, &truth)).collect();
        let (observations, _) = network
            .transmit(&mut rng, &rules, predicted.mean(), &measurements)
            .unwrap();
        belief = network
            .fuse(&predicted, &rules, predicted.mean(), &observations)
            .unwrap()
            .0;
        let (mean, variance) = (belief.mean()[0], belief.covariance()[0]);
        assert!(mean.is_finite() && variance > 0.0 && variance < 10.0, "step {k}: {mean} {variance}");
        squares += (truth[0] - mean).powi(2) / variance;
    }
    assert!((squares / 4_000.0 - 1.0).abs() < 0.12, "{}", squares / 4_000.0);
}

#[test]
fn silence_is_a_lawful_factor() {
    let grid: Vec<_> = (-60..=60).map(|i| Vector1::new(f64::from(i) * 0.3)).collect();
    let far = [0.0, 1.0, -40.0, 1e4, -1e8].map(Vector1::new);
    for scale in [1e-4, 1.0, 1e4] {
        for (half_width, loss, count) in [(1.1, 0.0, 1), (0.3, 0.2, 3), (0.0, 0.25, 2)] {
            let silence = Silence {
                centre: 0.5 * scale,
                half_width: half_width * scale,
                noise_variance: scale * scale,
                loss,
                count,
            };
            let factor = silence.factor();
            let points: Vec<_> = grid.iter().chain(&far).map(|m| m * scale).collect();
            sweep_is_scalar(&factor, &points).unwrap();
            is_a_number(&factor, &points).unwrap();
            // Scaled input, scaled output.
            let [ours, unit] = [
                (silence, scale),
                (
                    Silence {
                        centre: 0.5,
                        half_width,
                        noise_variance: 1.0,
                        ..silence
                    },
                    1.0,
                ),
            ]
            .map(|(s, k)| s.moments(2.0 * k, 3.0 * k * k).unwrap());
            assert!((ours.log_evidence - unit.log_evidence).abs() < 1e-10);
            assert!((ours.mean[0] / scale - unit.mean[0]).abs() < 1e-10);
            assert!((ours.covariance[0] / (scale * scale) / unit.covariance[0] - 1.0).abs() < 1e-9);
        }
    }
    // The square root covers eta s only: an offset beyond eta s is no NaN.
    let rule = CensoringRule::scalar(1.0, 1.0).unwrap();
    assert_eq!(rule.half_width(), 1.0);
}

/// Sweeps over vectors and over random triggers, more than one block long, with loss and without.
#[test]
fn sweeps_of_ellipsoids_and_triggers_are_the_scalar() {
    let rule = CensoringRule::new(&Matrix2::new(3.0, 0.4, 0.4, 2.0), 1.4).unwrap();
    let planes: Vec<_> = (0..150)
        .map(|i| Vector2::new(0.1 * f64::from(i) - 7.0, (f64::from(i) * 0.7).sin()))
        .collect();
    let lines: Vec<_> = planes.iter().map(|m| Vector1::new(m[0])).collect();
    let sensing = LinearSensor::direct(0.8).unwrap();
    let trigger = StochasticTrigger::for_rate(0.4, 2.0).unwrap();
    let triggered: Triggered<_, 1> = Triggered { sensing, trigger };
    for loss in [0.0, 0.3] {
        let link = Link::lossy(loss).unwrap();
        for reports in MISSING {
            let region =
                Censored::missing(&rule, &Vector2::new(0.3, 0.1), &Matrix2::identity(), &link, reports).unwrap();
            is_a_number(&region, &planes).unwrap();
            sweep_is_scalar(&region, &planes).unwrap();
        }
        for observation in [Observation::Nothing, Observation::Received(0.7), Observation::Lost] {
            let bump = triggered.factor(&Vector1::new(0.2), &observation, &link).unwrap();
            sweep_is_scalar(&bump, &lines).unwrap();
        }
    }
}

const MISSING: [MissingReports; 2] = [
    MissingReports { nothing: 1, lost: 0 },
    MissingReports { nothing: 0, lost: 1 },
];

/// Evidence and moments of a vector sensor without report under a belief of its measurement, by summing over a lattice.
#[test]
fn vector_moments_are_the_sums_over_a_lattice() {
    let rule = CensoringRule::new(&Matrix2::new(2.0, 0.5, 0.5, 1.2), 1.9).unwrap();
    let noise = Matrix2::new(0.9, -0.2, -0.2, 0.6);
    let prior = Gaussian::new(Vector2::new(1.1, -0.4), Matrix2::new(1.5, 0.6, 0.6, 2.1)).unwrap();
    for (loss, reports) in [(0.0, MISSING[0]), (0.3, MISSING[0]), (0.3, MISSING[1])] {
        let link = Link::lossy(loss).unwrap().with_erasure(0.5).unwrap();
        let silence = Censored::missing(&rule, &Vector2::new(0.2, 0.5), &noise, &link, reports).unwrap();
        let (n, h) = (50, 0.3);
        let (mut mass, mut first, mut second) = (0.0, Vector2::zeros(), Matrix2::zeros());
        for m in (-n..=n).flat_map(|i| (-n..=n).map(move |j| Vector2::new(f64::from(i), f64::from(j)) * h)) {
            let p = h * h * (prior.log_pdf(&m).unwrap() + silence.log_likelihood(&m)).exp();
            mass += p;
            first += m * p;
            second += m * m.transpose() * p;
        }
        let mean = first / mass;
        let tilted = silence.tilted(&prior).unwrap();
        assert!((tilted.log_evidence - mass.ln()).abs() < 1e-8, "{loss}: {}", tilted.log_evidence - mass.ln());
        assert!((tilted.mean - mean).amax() < 1e-8);
        assert!((tilted.covariance - (second / mass - mean * mean.transpose())).amax() < 1e-8);
    }
}

/// Under the broadcast's own belief a sensor speaks with its rate and is silent with one less it.
#[test]
fn silence_has_the_probability_of_the_rule() {
    let belief = Gaussian::new(Vector2::new(1.0, 10.0), Matrix2::new(3.0, 1.0, 1.0, 2.0)).unwrap();
    let (rate, loss) = (0.35, 0.2);
    let link = Link::lossy(loss).unwrap();
    let expected = f64::ln(loss + (1.0 - loss) * (1.0 - rate));
    let line = LinearSensor::scalar(Vector2::new(1.0, 0.3), 1.7).unwrap();
    let one = Network::new(vec![line], threshold(rate, 1).unwrap(), link).unwrap();
    let rules = one.rules_under(&belief).unwrap();
    let (_, info) = one
        .fuse(&belief, &rules, belief.mean(), &[Observation::Nothing])
        .unwrap();
    assert!((info.log_likelihood - expected).abs() < 1e-9);
    let plane = LinearSensor::new(Matrix2::identity(), Matrix2::new(2.0, 0.0, 0.0, 4.0)).unwrap();
    let two = Network::new(vec![plane], threshold(rate, 2).unwrap(), link).unwrap();
    let rules = two.rules_under(&belief).unwrap();
    let (_, info) = two
        .fuse(&belief, &rules, belief.mean(), &[Observation::Nothing])
        .unwrap();
    assert!((info.log_likelihood - expected).abs() < 1e-7);
    let (after, info) = two.fuse(&belief, &rules, belief.mean(), &[Observation::Lost]).unwrap();
    assert!((info.log_likelihood - f64::ln(rate)).abs() < 1e-7);
    assert!((after.mean() - belief.mean()).amax() < 1e-9);
    assert!(after.covariance()[(0, 0)] > belief.covariance()[(0, 0)]);
}
