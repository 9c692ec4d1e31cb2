//! Bearings that cross from `pi` to `-pi`. The reference is the same world turned by half a turn, where they cross zero.

use fewbits_core::circle::{OnCircle, Periodic, nearest};
use fewbits_core::factor::{Levels, Scalar, Value};
use fewbits_core::rand::{Rng, RngExt};
use fewbits_core::{
    Cell, Dynamics, Error, FullValue, Gaussian, Likelihood, Link, MeasurementNoise, NumberFormat, Observation,
    Observed, OnAxes, Scheme, SchemeNode, Sensing, SensorNode, Sign,
};
use fewbits_densities::Particles;
use fewbits_filters::centre::{FusionCentre, Reporting, Slot};
use fewbits_filters::{BootstrapFilter, EnsembleFilter, MomentFilter, ResamplingRule, SigmaPointFilter, StateFilter};
use fewbits_models::{Bearing, ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix1, Matrix4, Vector1, Vector2, Vector4};

const NOISE: f64 = 4e-4;

#[derive(Clone, Copy)]
struct OneBit;

impl Scheme<1> for OneBit {
    type State = ();
    type Feedback = f64;
    type Report = Sign;
    type Factor = Scalar;

    fn feedback_format(&self) -> NumberFormat {
        NumberFormat::Double
    }

    fn report_format(&self) {}

    fn encode(&self, _: &mut dyn Rng, (): &mut (), z: &Vector1<f64>, asked: &f64) -> Result<Option<Sign>, Error> {
        Ok(Some(Sign::of(z[0], *asked)?))
    }

    fn factor(&self, asked: &f64, observation: &Observation<Sign>, link: &Link) -> Result<Scalar, Error> {
        Ok(match observation {
            Observation::Received(sign) => Levels::sign(*sign, *asked, NOISE, link)?.into(),
            missing => fewbits_core::factor::Constant::of_delivery(missing, link).into(),
        })
    }
}

impl MeasurementNoise<1> for OneBit {
    fn noise_covariance_at(&self, _: &Vector1<f64>) -> Matrix1<f64> {
        Matrix1::new(NOISE)
    }
}

/// A target passes two sensors that see it in the west (`side` 1, bearings about pi) or in the east (-1, about 0). Squared error of the places,
/// averaged over time, and the log-likelihood. Measurements arrive in `(-pi, pi]`.
fn run<F: StateFilter<4>>(filter: F, side: f64, is_value: bool) -> (f64, f64) {
    let (mut world, mut rng) = (Stream::new(5).rng(), Stream::new(6).rng());
    let motion = ContinuousLinear::nearly_constant_velocity_2d(1e-3).unwrap();
    let turned = |x: f64, vx: f64, y: f64, vy: f64| Vector4::new(x, vx, y, vy) * side;
    let prior =
        Gaussian::new(turned(-10.0, 0.0, -8.0, 0.4), Matrix4::from_diagonal(&[1.0, 0.01, 1.0, 0.01].into())).unwrap();
    let mut truth = prior.mean() + turned(0.5, 0.05, -0.5, 0.05);
    let mut centre = FusionCentre::new(&mut rng, motion, filter, &prior).unwrap();
    let sensors = [(0.0, 0.0), (4.0, 6.0)].map(|(x, y)| {
        let bearing = Bearing::new(Vector2::new(x, y) * side, NOISE).unwrap();
        OnAxes::<_, 4, 2>::new(bearing, [0, 2]).unwrap()
    });
    let (values, bits) = (FullValue::new(NOISE).unwrap(), OnCircle::new(OneBit, std::f64::consts::TAU).unwrap());
    for (number, sensor) in (0..).zip(sensors) {
        if is_value {
            centre
                .join(number, Reporting::values(sensor, values, Link::PERFECT))
                .unwrap();
        } else {
            let ask = |_: &Gaussian<4>, m: &Gaussian<1>| m.mean()[0];
            centre
                .join(number, Reporting::new(sensor, bits, Link::PERFECT, ask))
                .unwrap();
        }
    }
    let (mut squares, mut log) = (0.0, 0.0);
    for k in 1..=40 {
        // The same noise in both worlds.
        let step = motion.over(1.0).unwrap();
        truth = step.propagate(&mut world, &(truth * side)) * side;
        centre.advance(&mut rng, f64::from(k)).unwrap();
        let slots: Vec<Slot> = (0..)
            .zip(&sensors)
            .map(|(number, sensor)| {
                let feedback = centre.feedback(number).unwrap();
                let noise: f64 = world.sample(rand_distr::StandardNormal);
                let z = sensor.mean(&truth)[0] + NOISE.sqrt() * noise;
                let z = Vector1::new(nearest(z, 0.0, std::f64::consts::TAU));
                let report = if is_value {
                    SchemeNode::new(values).report(&mut world, &z, &feedback).unwrap()
                } else {
                    SchemeNode::new(bits).report(&mut world, &z, &feedback).unwrap()
                };
                Slot::new(number, feedback, report.into())
            })
            .collect();
        let received = centre.receive(&mut rng, &slots).unwrap();
        assert!(received.events.is_empty(), "{:?}", received.events);
        log += received.info.log_likelihood;
        let off = centre.estimate().mean() - truth;
        squares += (off[0] * off[0] + off[2] * off[2]) / 40.0;
    }
    (squares, log)
}

#[test]
fn bearings_across_pi_are_as_good_as_across_zero() {
    for is_value in [true, false] {
        let (west, east) = (run(MomentFilter, 1.0, is_value), run(MomentFilter, -1.0, is_value));
        assert!((west.0 - east.0).abs() < 1e-9 && (west.1 - east.1).abs() < 1e-7, "{west:?} {east:?}");
        assert!(west.0 < 1.0, "{west:?}");
        let points = || SigmaPointFilter::<4>::unscented(1.0).unwrap();
        let (west, east) = (run(points(), 1.0, is_value), run(points(), -1.0, is_value));
        assert!((west.0 - east.0).abs() < 1e-7 && (west.1 - east.1).abs() < 1e-6, "{west:?} {east:?}");
        let particles = || BootstrapFilter::new(ResamplingRule::default(), 4000).unwrap();
        let (west, east) = (run(particles(), 1.0, is_value), run(particles(), -1.0, is_value));
        assert!(west.0 < 1.5 * east.0 + 0.05 && (west.1 - east.1).abs() < 1.5, "{west:?} {east:?}");
        let ensemble = || EnsembleFilter::new(200).unwrap();
        let (west, east) = (run(ensemble(), 1.0, is_value), run(ensemble(), -1.0, is_value));
        assert!(west.0 < 1.5 * east.0 + 0.05, "{west:?} {east:?}");
    }
}

/// A range and a bearing in one measurement: only the second is periodic.
#[test]
fn one_of_two_components_is_periodic() {
    let sensor = LinearSensor::new(nalgebra::Matrix2::identity(), nalgebra::Matrix2::identity()).unwrap();
    let polar = Periodic::new(sensor, [None, Some(360.0)]).unwrap();
    let z = Value::new(Vector2::new(400.0, 2.0), nalgebra::Matrix2::identity()).unwrap();
    let mut belief = Gaussian::new(Vector2::new(398.0, 719.0), nalgebra::Matrix2::identity()).unwrap();
    let evidence = Observed::new(polar, z).condition(&mut belief).unwrap();
    assert!((belief.mean() - Vector2::new(399.0, 720.5)).norm() < 1e-12);
    // ln N((2, 3); 0, 2 I)
    assert!((evidence.log_likelihood + 13.0 / 4.0 + (2.0 * std::f64::consts::TAU).ln()).abs() < 1e-12);
    assert!(
        Periodic::new(sensor, [None, Some(0.0)]).is_err() && Periodic::new(sensor, [Some(f64::NAN), None]).is_err()
    );
}

/// The probability that a direction is in a cell of the circle, summed over turns.
#[test]
fn a_cell_around_a_circle_is_the_sum_over_turns() {
    let (edges, given) = ([20.0, 140.0, 260.0], [0.9, 0.2, 0.4]);
    let factor = Levels::around(360.0, &edges, &given, 900.0).unwrap();
    let compass = Periodic::new(LinearSensor::direct(900.0).unwrap(), [Some(360.0)]).unwrap();
    let observed = Observed::new(compass, factor);
    for heading in [-700.0, 0.0, 15.0, 130.0, 200.0, 300.0, 359.0, 1000.0] {
        let mut exact = 0.0;
        for turn in -6..=6 {
            for (i, p) in given.iter().enumerate() {
                let upper = if i == 2 { edges[0] + 360.0 } else { edges[i + 1] };
                let cell = Cell::new(edges[i] + 360.0 * f64::from(turn), upper + 360.0 * f64::from(turn)).unwrap();
                exact += p * fewbits_numerics::normal::interval(
                    (cell.lower() - heading) / 30.0,
                    (cell.upper() - heading) / 30.0,
                );
            }
        }
        let found = observed.log_likelihood(&Vector1::new(heading)).exp();
        assert!((found - exact).abs() < 1e-9, "{heading}: {found} {exact}");
    }
    assert!(Levels::around(360.0, &[0.0, 360.0], &[1.0, 0.0], 1.0).is_err());
    assert!(Levels::around(360.0, &[0.0, 10.0], &[1.0], 1.0).is_err() && Levels::around(360.0, &[], &[], 1.0).is_err());
}

/// A heading of which nothing is known: particles all around, of which those near the value are left.
#[test]
fn particles_all_around_the_circle() {
    let compass = Periodic::new(LinearSensor::direct(25.0).unwrap(), [Some(360.0)]).unwrap();
    let states: Vec<f64> = (0..360).map(|degree| f64::from(degree) - 180.0).collect();
    let mut around = Particles::new([states], &[0.0; 360]).unwrap();
    let observed = Observed::new(compass, Value::scalar(178.0, 25.0).unwrap());
    around
        .reweigh(|states, logs| observed.add_log_likelihoods(states, logs))
        .unwrap();
    let near: f64 = (0..360)
        .filter(|i| (i + 2) % 360 < 20 || (i + 2) % 360 > 340)
        .map(|i| around.log_weights()[i].exp())
        .sum();
    let total: f64 = around.log_weights().iter().map(|log| log.exp()).sum();
    assert!(near / total > 0.99, "{}", near / total);
}
