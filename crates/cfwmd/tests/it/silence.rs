//! Moments after silence against brute force.

use fewbits_cfwmd::assumed_density::ScalarSilence;
use fewbits_cfwmd::silence::SilentFactor;
use fewbits_numerics::normal::log_pdf_with;
use proptest::prelude::*;

/// Mass, mean and variance by a fine trapezoid over everything that matters.
fn brute(s: &ScalarSilence, mean: f64, variance: f64) -> [f64; 3] {
    let factor = SilentFactor::new(s.half_width, s.noise_variance, s.loss).unwrap();
    let reach = 12.0 * variance.sqrt();
    let (n, low) = (40_000, mean - reach);
    let step = 2.0 * reach / n as f64;
    let log_terms: Vec<f64> = (0..=n)
        .map(|i| {
            let y = low + i as f64 * step;
            log_pdf_with(y, mean, variance) + s.count as f64 * factor.log_probability(y - s.centre)
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
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn scalar_moments_are_the_integrals(
        mean in -4.0..4.0f64, variance in 0.05..60.0f64, centre in -3.0..3.0f64, half_width in 0.05..4.0f64,
        noise in 0.2..4.0f64, loss in prop_oneof![Just(0.0), 0.001..0.9f64], count in 1..5usize,
    ) {
        let silence = ScalarSilence { centre, half_width, noise_variance: noise, loss, count };
        let ours = silence.moments(mean, variance).unwrap();
        let [log_mass, m, v] = brute(&silence, mean, variance);
        prop_assert!((ours.log_mass - log_mass).abs() < 1e-7, "{ours:?} {log_mass}");
        prop_assert!((ours.mean - m).abs() < 1e-7 * variance.sqrt().max(1.0), "{ours:?} {m}");
        prop_assert!((ours.variance / v - 1.0).abs() < 1e-6, "{ours:?} {v}");
        prop_assert!(loss > 0.0 || ours.variance < variance);
    }
}

#[test]
fn far_tails_and_wide_beliefs_stay_accurate() {
    let base = ScalarSilence {
        centre: 0.0,
        half_width: 1.0,
        noise_variance: 1.0,
        loss: 0.0,
        count: 2,
    };
    for (mean, variance) in [(30.0, 1.0), (200.0, 4.0), (0.5, 400.0), (-60.0, 300.0)] {
        let ours = base.moments(mean, variance).unwrap();
        let [log_mass, m, v] = brute(&ScalarSilence { ..base }, mean, variance);
        // The brute force window is centred on the prior; where it misses the bulk the derivative identity decides instead.
        if (m - mean).abs() < 11.0 * variance.sqrt() {
            assert!((ours.log_mass - log_mass).abs() < 1e-7 * log_mass.abs().max(1.0), "{mean} {variance}");
            assert!((ours.mean - m).abs() < 1e-6 * variance.sqrt() && (ours.variance / v - 1.0).abs() < 1e-5);
        }
        // d ln Z / d m = (E y - m)/p.
        let step = 1e-4 * variance.sqrt();
        let slope = (base.moments(mean + step, variance).unwrap().log_mass
            - base.moments(mean - step, variance).unwrap().log_mass)
            / (2.0 * step);
        assert!((mean + variance * slope - ours.mean).abs() < 1e-4 * variance.sqrt(), "{mean} {variance}");
    }
}

#[test]
fn a_known_state_only_weighs() {
    let silence = ScalarSilence {
        centre: 0.2,
        half_width: 1.0,
        noise_variance: 2.0,
        loss: 0.1,
        count: 3,
    };
    let ours = silence.moments(0.7, 0.0).unwrap();
    let factor = SilentFactor::new(1.0, 2.0, 0.1).unwrap();
    assert_eq!((ours.mean, ours.variance), (0.7, 0.0));
    assert!((ours.log_mass - 3.0 * factor.log_probability(0.5)).abs() < 1e-14);
}

#[test]
fn an_always_sending_sensor_behind_a_lossy_link_says_nothing() {
    let silence = ScalarSilence {
        centre: 0.0,
        half_width: 0.0,
        noise_variance: 1.0,
        loss: 0.25,
        count: 2,
    };
    let ours = silence.moments(3.0, 2.0).unwrap();
    assert!((ours.mean - 3.0).abs() < 1e-15 && (ours.variance - 2.0).abs() < 1e-15);
    assert!((ours.log_mass - 2.0 * 0.25_f64.ln()).abs() < 1e-15);
    assert!(ScalarSilence { loss: 0.0, ..silence }.moments(3.0, 2.0).is_err());
    assert!(silence.moments(f64::NAN, 1.0).is_err() && silence.moments(0.0, -1.0).is_err());
}
