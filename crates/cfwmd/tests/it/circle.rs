//! Directions across north: a prediction of 358 degrees and a measurement of 3 are five degrees apart.

use fewbits_cfwmd::rule::CensoringRule;
use fewbits_cfwmd::scheme::Censoring;
use fewbits_core::circle::Periodic;
use fewbits_core::{Gaussian, Likelihood, Link, NumberFormat, Observation, Observed, Scheme};
use fewbits_models::LinearSensor;
use nalgebra::Vector1;

#[test]
fn silence_and_reports_cross_north() {
    let compass = Periodic::new(LinearSensor::direct(4.0).unwrap(), [Some(360.0)]).unwrap();
    // Silent within 10 degrees of the prediction.
    let rule = CensoringRule::scalar(25.0, 4.0).unwrap();
    let scheme = Censoring::new(compass, rule, NumberFormat::Double).unwrap();
    let (told, mut rng) = (Vector1::new(358.0), fewbits_monte_carlo::Stream::new(1).rng());
    let mut said = |z: f64| scheme.encode(&mut rng, &mut (), &Vector1::new(z), &told).unwrap();
    assert_eq!((said(3.0), said(349.0), said(9.0)), (None, None, Some(Vector1::new(9.0))));
    let after = |observation: Observation<Vector1<f64>>| {
        let factor = scheme.factor(&told, &observation, &Link::PERFECT).unwrap();
        let mut belief = Gaussian::scalar(358.0, 21.0).unwrap();
        Observed::new(compass, factor).condition(&mut belief).unwrap();
        belief.mean()[0]
    };
    // The Kalman gain is 21 / 25, the innovation 11 degrees.
    assert!((after(Observation::Received(Vector1::new(9.0))) - (358.0 + 11.0 * 21.0 / 25.0)).abs() < 1e-9);
    assert!((after(Observation::Nothing) - 358.0).abs() < 1e-9);
}
