//! Directions across north: a prediction of 358 degrees and a measurement of 3 are five degrees apart.

use fewbits_cfwmd::rule::CensoringRule;
use fewbits_cfwmd::scheme::Censoring;
use fewbits_core::circle::Periodic;
use fewbits_core::{
    Gaussian, Likelihood, Link, NumberFormat, Observation, Observed, Scheme, SchemeNode, Sensing, SensorNode,
};
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{ConstantNoise, FusionCentre, Reporting, Slot};
use fewbits_models::{ContinuousLinear, LinearSensor};
use nalgebra::Vector1;
use rand::RngExt;
use statrs::distribution::{ContinuousCDF, Normal};

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

/// A heading that walks across north, a compass that is silent within 5 degrees of the prediction over a link that loses a fifth, and a centre. The
/// truth is a grid on the circle of 720 directions.
#[test]
fn a_censoring_compass_joins_a_centre() {
    let (noise, walk, width, loss) = (9.0_f64, 16.0_f64, 5.0, 0.2);
    let compass = Periodic::new(LinearSensor::direct(noise).unwrap(), [Some(360.0)]).unwrap();
    let rule = CensoringRule::scalar(1.0, width * width).unwrap();
    let scheme = ConstantNoise {
        scheme: Censoring::new(compass, rule, NumberFormat::Double).unwrap(),
        noise: compass.noise_covariance_at(&Vector1::zeros()),
    };
    let mut rng = fewbits_monte_carlo::Stream::new(4).rng();
    let motion = ContinuousLinear::random_walk(walk).unwrap();
    let prior = Gaussian::scalar(357.0, 25.0).unwrap();
    let mut centre = FusionCentre::new(&mut rng, motion, MomentFilter, &prior).unwrap();
    let wrong = ConstantNoise {
        noise: scheme.noise * 2.0,
        ..scheme.clone()
    };
    let ask = |belief: &Gaussian<1>, _: &Gaussian<1>| *belief.mean();
    let link = Link::lossy(loss).unwrap();
    assert!(centre.join(0, Reporting::new(compass, wrong, link, ask)).is_err());
    centre
        .join(0, Reporting::new(compass, scheme.clone(), link, ask))
        .unwrap();

    let wrapped = |x: f64| x - 360.0 * (x / 360.0).round();
    let normal = |variance: f64| move |x: f64| (-0.5 * x * x / variance).exp();
    let nodes: Vec<f64> = (0..720).map(|i| 0.5 * f64::from(i)).collect();
    let mut grid: Vec<f64> = nodes.iter().map(|x| normal(25.0)(wrapped(x - 357.0))).collect();
    let kernel: Vec<f64> = nodes.iter().map(|x| normal(walk)(wrapped(*x))).collect();
    let unit = Normal::new(0.0, 1.0).unwrap();
    let (mut truth, mut silent, mut crossed) = (357.0, 0, 0);
    for k in 1..=30 {
        let draw = |rng: &mut rand_pcg::Pcg64Dxsm| rng.sample::<f64, _>(rand_distr::StandardNormal);
        let (step, error) = (draw(&mut rng), draw(&mut rng));
        truth += walk.sqrt() * step;
        crossed += i32::from(truth > 360.0);
        centre.advance(&mut rng, f64::from(k)).unwrap();
        let feedback = centre.feedback(0).unwrap();
        let told = centre.estimate().mean()[0];
        let z = Vector1::new((truth + noise.sqrt() * error).rem_euclid(360.0));
        let report = SchemeNode::new(scheme.clone()).report(&mut rng, &z, &feedback).unwrap();
        let arrived = report.filter(|_| k % 5 > 0);
        silent += i32::from(arrived.is_none());
        grid = (0..720)
            .map(|i| (0..720).map(|j| grid[j] * kernel[(i + 720 - j) % 720]).sum())
            .collect();
        for (p, x) in grid.iter_mut().zip(&nodes) {
            let off = wrapped(x - told);
            *p *= match &arrived {
                Some(_) => normal(noise)(wrapped(z[0] - x)),
                None => {
                    let inside = |side: f64| unit.cdf((side - off) / noise.sqrt());
                    let inside = inside(width) - inside(-width);
                    inside + loss * (1.0 - inside)
                }
            };
        }
        centre
            .receive(&mut rng, &[Slot::new(0, feedback, arrived.into())])
            .unwrap();
        let total: f64 = grid.iter().sum();
        grid.iter_mut().for_each(|p| *p /= total);
        let moment = |f: &dyn Fn(f64) -> f64| -> f64 { grid.iter().zip(&nodes).map(|(p, x)| p * f(*x)).sum() };
        let about = centre.estimate().mean()[0];
        let off = moment(&|x| wrapped(x - about));
        let deviation = (moment(&|x| wrapped(x - about).powi(2)) - off * off).sqrt();
        // Of a belief that is not Gaussian the moments of the filter differ a little.
        let own = centre.estimate().covariance()[(0, 0)].sqrt();
        assert!(off.abs() < 0.1 * deviation && (own / deviation - 1.0).abs() < 0.1, "{k}: {off} {own} {deviation}");
    }
    assert!(silent > 8 && crossed > 3 && crossed < 28, "{silent} {crossed}");
}
