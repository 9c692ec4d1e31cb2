//! The laws of schemes, factors and likelihoods, on the quantized range.

use fewbits_baselines::pf_mpa::RangeFactor;
use fewbits_core::factor::{Factor, Scalar};
use fewbits_core::laws::{factor, likelihood, message, scheme};
use fewbits_core::{
    Belief, Dynamics, Gaussian, Likelihood, Link, NumberFormat, Observation, Observed, Scheme, Sensing,
};
use fewbits_filters::{BootstrapFilter, MomentFilter, ResamplingRule, StateFilter};
use fewbits_models::{PLANE_POSITION, constant_velocity_2d};
use fewbits_monte_carlo::Stream;
use fewbits_pf_mpa::{QuantizedRange, RangeNoise, RangeReference, RangeSensor};
use fewbits_quantizers::Symbol;
use nalgebra::{Vector1, Vector2, Vector4};

fn noises(scale: f64) -> [RangeNoise; 3] {
    [
        RangeNoise::from_snr_db(20.0).unwrap(),
        RangeNoise::constant(0.4 * scale).unwrap(),
        RangeNoise::new(0.2 * scale, 0.05).unwrap(),
    ]
}

fn reference(scale: f64) -> RangeReference {
    RangeReference {
        centre: 5.2 * scale,
        half_width: 3.05 * scale,
    }
}

#[test]
fn schemes_obey_their_laws() {
    for scale in [1e-4, 1.0, 1e4] {
        for noise in noises(scale) {
            for levels in [2, 3, 4, 16] {
                let range = QuantizedRange::new(levels, noise).unwrap();
                let at = [-2.0, 0.0, 1e-3, 3.0, 5.2, 7.0, 90.0].map(|m| Vector1::new(m * scale));
                let sources = [Stream::new(1).rng(), Stream::new(2).rng()];
                scheme::deterministic(&range, &reference(scale), &sources, &at).unwrap();
                for link in [Link::PERFECT, Link::new(0.2, 0.1).unwrap().with_erasure(0.3).unwrap()] {
                    let symbols = || {
                        (0..if link.crossover() > 0.0 {
                            1 << range.bits()
                        } else {
                            levels
                        })
                            .map(Symbol)
                    };
                    scheme::total_probability(&range, &reference(scale), &link, symbols(), &at).unwrap();
                    if levels == 4 {
                        let m = Vector1::new(6.0 * scale);
                        let sensor = RangeSensor::new(Vector2::zeros(), noise).unwrap();
                        let measure = |rng: &mut _| Vector1::new(sensor.measure(rng, m[0]) - m[0]);
                        let mut rng = Stream::new(4).rng();
                        scheme::frequencies(&range, &reference(scale), &link, &mut rng, 20_000, &m, measure, symbols())
                            .unwrap();
                    }
                }
            }
        }
    }
}

fn factors(scale: f64, noise: RangeNoise) -> Vec<Box<dyn Factor<1>>> {
    let range = QuantizedRange::new(4, noise).unwrap();
    let link = Link::new(0.1, 0.05).unwrap();
    let of = |observation, link: &Link| range.factor(&reference(scale), &observation, link).unwrap();
    let mut all: Vec<Scalar> = (0..4)
        .map(|q| of(Observation::Received(Symbol(q)), &Link::PERFECT))
        .collect();
    all.push(of(Observation::Received(Symbol(2)), &link));
    all.push(of(Observation::Received(Symbol(0)), &link));
    all.push(of(Observation::Nothing, &link));
    let mut all: Vec<Box<dyn Factor<1>>> = all.into_iter().map(|one| Box::new(one) as _).collect();
    all.push(Box::new(RangeFactor::value(5.5 * scale, noise).unwrap()));
    all
}

#[test]
fn factors_obey_their_laws() {
    for scale in [1e-4, 1.0, 1e4] {
        for noise in noises(scale) {
            for own in &factors(scale, noise) {
                let own = &**own;
                let at = [-1e9, -1.0, 0.0, 1e-9, 0.1, 2.0, 5.2, 40.0, 1e9].map(|m| Vector1::new(m * scale));
                factor::is_a_number(&own, &at).unwrap();
                factor::sweep_is_scalar(&own, &at[1..8]).unwrap();
                let prior = Gaussian::scalar(5.0 * scale, 0.4 * scale * scale).unwrap();
                factor::tilted_is_quadrature(&own, &prior, 4.9 * scale, 60_001, 1e-8).unwrap();
                let sensor = RangeSensor::new(Vector2::new(scale, -scale), noise).unwrap();
                let sensor = sensor.on_axes::<4>([0, 2]).unwrap();
                let states = [Vector4::zeros(), Vector4::new(3.0, 2.0, 1.0, 1.0) * scale];
                likelihood::sweep_is_scalar(&Observed::new(sensor, own), &states).unwrap();
            }
        }
    }
}

#[test]
fn references_travel_as_two_numbers() {
    let single = |x: f64| NumberFormat::Single.rounded(x).unwrap();
    let sent = RangeReference {
        centre: single(5.2),
        half_width: single(3.05),
    };
    assert_eq!(message::round_trip(&sent, &NumberFormat::Single), Ok(64));
}

/// The root mean squared position error of 20 slots of five sensors.
fn tracking_error<F: StateFilter<4>>(mut filter: F, start: &Gaussian<4>) -> f64 {
    let noise = RangeNoise::from_snr_db(30.0).unwrap();
    let places = [[4.0, 4.0], [16.0, 4.0], [10.0, 10.0], [4.0, 16.0], [16.0, 16.0]];
    let dynamics = constant_velocity_2d(1.0, 0.02).unwrap();
    let scheme = QuantizedRange::new(4, noise).unwrap();
    let (mut world, mut rng) = (Stream::new(1).rng(), Stream::new(2).rng());
    let (mut truth, mut belief) = (*start.mean(), filter.start(&mut rng, start).unwrap());
    let mut squares = 0.0;
    for _ in 0..20 {
        truth = dynamics.propagate(&mut world, &truth);
        filter.predict(&mut rng, &dynamics, &mut belief).unwrap();
        let (mean, covariance) = (belief.mean(), belief.covariance());
        let observed = places.map(|place| {
            let sensor = RangeSensor::new(place.into(), noise)
                .unwrap()
                .on_axes(PLANE_POSITION)
                .unwrap();
            let (range, jacobian) = (sensor.mean(&mean)[0], sensor.jacobian(&mean));
            let spread = (jacobian * covariance * jacobian.transpose())[0]
                .sqrt()
                .hypot(noise.deviation(range));
            let reference = RangeReference {
                centre: range,
                half_width: 1.991 * spread,
            };
            let sample = sensor.sample(&mut world, &truth);
            let report = scheme.encode(&mut world, &mut (), &sample, &reference).unwrap();
            Observed::new(sensor, scheme.factor(&reference, &report.into(), &Link::PERFECT).unwrap())
        });
        let observed = observed.each_ref().map(|one| one as &dyn Likelihood<4>);
        filter.update(&mut rng, &mut belief, &observed).unwrap();
        let error = belief.mean() - truth;
        squares += (error[0] * error[0] + error[2] * error[2]) / 20.0;
    }
    squares.sqrt()
}

#[test]
fn every_filter_of_the_library_tracks_with_it() {
    let covariance = nalgebra::Matrix4::from_diagonal(&Vector4::new(0.04, 0.01, 0.04, 0.01));
    let start = Gaussian::new(Vector4::new(13.0, 0.0, 17.0, -0.6), covariance).unwrap();
    let particles = BootstrapFilter::new(ResamplingRule::default(), 4000).unwrap();
    let (particle, assumed) = (tracking_error(particles, &start), tracking_error(MomentFilter, &start));
    assert!(particle < 0.4 && assumed < 0.4, "{particle} {assumed}");
}

/// Cells far wider than the noise are swept by their nearer edge alone.
#[test]
fn wide_cells_are_swept_exactly() {
    for (snr, half_width) in [(50.0, 3.05), (60.0, 30.0), (40.0, 1.4)] {
        let range = QuantizedRange::new(4, RangeNoise::from_snr_db(snr).unwrap()).unwrap();
        let reference = RangeReference {
            centre: 9.0,
            half_width,
        };
        for q in 0..4 {
            let own = range.received(Symbol(q), &reference).unwrap();
            let at: Vec<Vector1<f64>> = (0..400).map(|i| Vector1::new(0.02 + 0.05 * f64::from(i))).collect();
            for near in at.chunks(40) {
                factor::sweep_is_scalar(&own, near).unwrap();
            }
        }
    }
}

/// Law 3 at a place where the posterior is far from the prior.
#[test]
fn a_surprising_level_still_has_moments() {
    let range = QuantizedRange::new(4, RangeNoise::from_snr_db(50.0).unwrap()).unwrap();
    let factor = range.received(Symbol(0), &reference(1.0)).unwrap();
    let tilted = factor.tilted(&Gaussian::scalar(5.2, 0.01).unwrap()).unwrap();
    assert!(tilted.mean[0] < 3.7 && tilted.log_evidence < -80.0);
}
