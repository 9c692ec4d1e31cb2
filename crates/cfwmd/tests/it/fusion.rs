//! Fusion with feedback: the Gaussian, the particle and the Rao-Blackwellised centre against each other and exact limits.

use fewbits_cfwmd::Error;
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::particle::{HeardScalars, HeardVectors};
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion};
use fewbits_cfwmd::schedule::expected_covariances;
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::likelihood::{Heard, ScalarLikelihood};
use fewbits_core::message::Cell;
use fewbits_core::{Gaussian, Likelihood, Observation};
use fewbits_densities::Particles;
use fewbits_filters::{ParticleFilter, RaoBlackwellised, Resampling, Schedule, Workspace, kalman};
use fewbits_models::{LinearSensor, ReceivedPower, constant_velocity_1d, constant_velocity_2d};
use fewbits_monte_carlo::{Moments, Stream};
use nalgebra::{Matrix2, Matrix4, SVector, Vector1, Vector2, Vector4};

fn prior() -> Gaussian<2> {
    Gaussian::new(Vector2::new(1.0, 10.0), Matrix2::new(3.0, 1.0, 1.0, 2.0)).unwrap()
}

fn scalar_network(loss: f64, count: usize) -> Network<2, 1> {
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
    let eta = Budget::new(1.0, count).unwrap().threshold(1).unwrap();
    Network::new(vec![sensor; count], eta, loss).unwrap()
}

fn vector_network(loss: f64) -> Network<2, 2> {
    let sensor = LinearSensor::new(Matrix2::identity(), Matrix2::new(2.0, 0.0, 0.0, 4.0)).unwrap();
    Network::new(vec![sensor; 2], Budget::new(1.0, 2).unwrap().threshold(2).unwrap(), loss).unwrap()
}

fn rules<const M: usize>(network: &Network<2, M>, belief: &Gaussian<2>) -> Vec<CensoringRule<M>> {
    (0..network.len())
        .map(|i| network.rule_under(i, belief.covariance()).unwrap())
        .collect()
}

/// Exact posterior moments by weighting a huge fixed cloud: the law of large numbers as the referee.
fn referee(belief: &Gaussian<2>, likelihood: &impl Likelihood<2>) -> (Particles<2>, f64) {
    let mut rng = Stream::new(77).fast_rng();
    let mut cloud = Particles::from_draws(200_000, || belief.sample(&mut rng).unwrap()).unwrap();
    let log_likelihood = ParticleFilter::default()
        .update(likelihood, &mut cloud)
        .unwrap()
        .log_likelihood;
    (cloud, log_likelihood)
}

fn assert_close(ours: &Gaussian<2>, log_likelihood: f64, cloud: &Particles<2>, evidence: f64) {
    let spread = cloud.covariance();
    let n = cloud.effective_sample_size();
    let slack = 5.0 * (spread.amax() / n).sqrt();
    assert!((ours.mean() - cloud.mean()).amax() < slack, "{} against {}", ours.mean(), cloud.mean());
    assert!((ours.covariance() - spread).amax() < 5.0 * spread.amax() * (2.0 / n).sqrt() + 1e-3);
    assert!((log_likelihood - evidence).abs() < 0.02, "{log_likelihood} against {evidence}");
}

#[test]
fn one_gaussian_update_has_the_exact_moments() {
    let belief = prior();
    let broadcast = belief.mean() + Vector2::new(0.4, -0.2);
    for loss in [0.0, 0.3] {
        // All silent sensors of a scalar network are heard exactly, together.
        let network = scalar_network(loss, 4);
        let rules = rules(&network, &belief);
        let heard = [
            Observation::Silent,
            Observation::Received(Vector1::new(6.0)),
            Observation::Silent,
            Observation::Lost,
        ];
        let (ours, info) = network.fuse(&belief, &rules, &broadcast, &heard).unwrap();
        let mut likelihood = HeardScalars::new();
        network
            .hear(&rules, &broadcast, &heard, 200_000, &mut likelihood)
            .unwrap();
        let (cloud, evidence) = referee(&belief, &likelihood);
        assert_close(&ours, info.log_likelihood, &cloud, evidence);
        assert_eq!(info.received, 1);

        // One silent vector sensor is exact; a second one meets a belief that is no longer quite Gaussian.
        let network = vector_network(loss);
        let rules = self::rules(&network, &belief);
        for other in [Observation::Lost, Observation::Received(Vector2::new(5.0, 12.0))] {
            let heard = [Observation::Silent, other];
            let (ours, info) = network.fuse(&belief, &rules, &broadcast, &heard).unwrap();
            let likelihood = HeardVectors::new(&network, &rules, &broadcast, &heard).unwrap();
            let (cloud, evidence) = referee(&belief, &likelihood);
            assert_close(&ours, info.log_likelihood, &cloud, evidence);
        }
    }
}

#[test]
fn the_joint_likelihood_is_the_product_of_the_single_ones() {
    let belief = prior();
    let network = scalar_network(0.1, 5);
    let rules = rules(&network, &belief);
    let heard = [
        Observation::Silent,
        Observation::Received(Vector1::new(-3.0)),
        Observation::Silent,
        Observation::Received(Vector1::new(6.5)),
        Observation::Lost,
    ];
    let mut likelihood = HeardScalars::new();
    network
        .hear(&rules, belief.mean(), &heard, 1000, &mut likelihood)
        .unwrap();
    let c = rules[0].half_width();
    let cell = Cell::new(1.0 - c, 1.0 + c).unwrap();
    let single: Vec<_> = heard
        .iter()
        .map(|o| match o {
            Observation::Received(z) => Heard::Value(z[0]),
            Observation::Silent => Heard::Silence { cell, loss: 0.1 },
            Observation::Lost => Heard::Lost,
        })
        .map(|h| ScalarLikelihood::new(Vector2::new(1.0, 0.0), 1.0, h).unwrap())
        .collect();
    let x: Vec<f64> = (0..1000).map(|i| i as f64 * 0.02 - 9.0).collect();
    let v = vec![3.0; 1000];
    let mut ours = vec![0.0; 1000];
    likelihood.add_log_likelihoods([&x, &v], &mut ours);
    for (i, ours) in ours.iter().enumerate() {
        let state = Vector2::new(x[i], 3.0);
        let product: f64 = single.iter().map(|s| s.log_likelihood(&state)).sum();
        assert!((ours - product).abs() < 1e-8 * product.abs().max(1.0), "{}: {ours} {product}", x[i]);
        assert!((likelihood.log_likelihood(&state) - product).abs() < 1e-9 * product.abs().max(1.0));
    }
}

#[test]
fn a_cloud_hears_power_sensors_as_single_states_do() {
    let mut likelihood = HeardScalars::new();
    let sensor = |x, y| ReceivedPower::<4>::new(Vector2::new(x, y), [0, 2], 1000.0, 1.0, 2.0, 1.0).unwrap();
    likelihood
        .values(&sensor(-10.0, -10.0), [9.0, 9.4].into_iter())
        .unwrap();
    likelihood.silence(&sensor(0.0, 0.0), 3.0, 0.8, 0.0, 1, 600).unwrap();
    likelihood.silence(&sensor(10.0, 0.0), 1.0, 2.5, 0.2, 2, 600).unwrap();
    let mut rng = Stream::new(3).fast_rng();
    let belief = Gaussian::new(Vector4::new(-8.0, 2.0, -8.0, 2.0), Matrix4::identity() * 4.0).unwrap();
    let cloud = Particles::from_draws(600, || belief.sample(&mut rng).unwrap()).unwrap();
    let mut ours = vec![0.0; 600];
    likelihood.add_log_likelihoods(cloud.columns(), &mut ours);
    for (i, ours) in ours.iter().enumerate() {
        let single = likelihood.log_likelihood(&cloud.point(i).unwrap());
        assert!((ours - single).abs() < 1e-8 * single.abs().max(1.0));
    }
}

/// A whole run: common observations, three estimators.
#[test]
fn the_three_centres_agree_over_a_run() {
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let network = scalar_network(0.0, 2);
    let start = Gaussian::known(Vector2::new(0.0, 10.0)).unwrap();
    let sensor = network.sensors()[0];
    let mut truth_rng = Stream::new(9).rng();
    let mut truth = *start.mean();
    let mut recursion = OwnRecursion::new(&start);
    let mut gaussian = start;
    let mut rng = Stream::new(10).fast_rng();
    let filter = ParticleFilter::new(Resampling::Systematic, Schedule::Below(0.5));
    let (mut workspace, mut likelihood) = (Workspace::default(), HeardScalars::new());
    let mut cloud = Particles::from_draws(30_000, || *start.mean()).unwrap();
    let mut rao = RaoBlackwellised::new(&start, 3_000).unwrap();
    let (mut squares, mut lowest) = ([0.0; 2], f64::INFINITY);
    for _ in 0..20 {
        truth = fewbits_core::Dynamics::propagate(&dynamics, &mut truth_rng, &truth);
        let step = recursion.advance(&dynamics, &sensor, start.mean()).unwrap();
        let rules = vec![CensoringRule::new(&step.innovation_covariance, network.threshold()).unwrap(); 2];
        let predicted = kalman::predict(&dynamics, &gaussian);
        let broadcast = *predicted.mean();
        let heard: Vec<_> = (0..2)
            .map(|_| fewbits_core::Sensing::sample(&sensor, &mut truth_rng, &truth))
            .map(|z| {
                if rules[0].speaks(&(z - sensor.matrix() * broadcast)) {
                    Observation::Received(z)
                } else {
                    Observation::Silent
                }
            })
            .collect();
        gaussian = network.fuse(&predicted, &rules, &broadcast, &heard).unwrap().0;

        network
            .hear(&rules, &broadcast, &heard, cloud.len(), &mut likelihood)
            .unwrap();
        filter
            .step_in_place(&mut rng, &dynamics, &likelihood, &mut cloud, &mut workspace)
            .unwrap();

        rao.predict(&mut rng, &filter, &dynamics, &mut workspace).unwrap();
        let c = rules[0].half_width();
        let cell = Cell::new(broadcast[0] - c, broadcast[0] + c).unwrap();
        for observation in &heard {
            let what = match observation {
                Observation::Received(z) => Heard::Value(z[0]),
                _ => Heard::Silence { cell, loss: 0.0 },
            };
            rao.update(&mut rng, &sensor, &what).unwrap();
        }
        let exact = rao.gaussian();
        let scale = exact.standard_deviations();
        lowest = cloud.effective_sample_size().min(3.0 * lowest);
        let particle_error = (cloud.mean() - exact.mean()).component_div(&scale).amax();
        squares[0] += particle_error * particle_error;
        // A message in the tail of the bootstrap filter's proposal leaves it few particles.
        assert!(particle_error < 0.05 + 4.5 / lowest.sqrt(), "{particle_error} with {lowest} effective particles");
        squares[1] += (gaussian.mean() - exact.mean()).component_div(&scale).amax().powi(2);
        let ratio = gaussian.covariance()[(0, 0)] / exact.covariance()[(0, 0)];
        assert!((0.85..1.18).contains(&ratio), "{ratio}");
    }
    // Root mean squares, in standard deviations of the exact belief.
    assert!((squares[0] / 20.0).sqrt() < 0.1 && (squares[1] / 20.0).sqrt() < 0.05, "{squares:?}");
}

#[test]
fn all_send_is_the_kalman_filter() {
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
    let network = Network::new(vec![sensor; 2], Budget::new(2.0, 2).unwrap().threshold(1).unwrap(), 0.0).unwrap();
    let mut ours = Gaussian::known(Vector2::new(0.0, 10.0)).unwrap();
    let mut exact = ours;
    for k in 0..20 {
        let z = [10.0 * k as f64, 10.5 * k as f64];
        let predicted = kalman::predict(&dynamics, &ours);
        let rules = rules(&network, &predicted);
        let heard = z.map(|z| Observation::Received(Vector1::new(z)));
        ours = network.fuse(&predicted, &rules, predicted.mean(), &heard).unwrap().0;
        exact = kalman::predict(&dynamics, &exact);
        for z in z {
            exact = kalman::update(&sensor, &exact, &Vector1::new(z)).unwrap().0;
        }
        assert_eq!(ours, exact);
    }
    assert!((ours.standard_deviations()[0] - 0.669_070_886_207).abs() < 1e-11);
}

#[test]
fn silence_makes_the_belief_sharper_and_moves_it_to_the_prediction() {
    let network = scalar_network(0.0, 4);
    let belief = prior();
    let broadcast = belief.mean() - Vector2::new(2.0, 0.0);
    let (after, _) = network
        .fuse(&belief, &rules(&network, &belief), &broadcast, &[Observation::Silent; 4])
        .unwrap();
    assert!(after.covariance()[(0, 0)] < belief.covariance()[(0, 0)]);
    assert!(after.mean()[0] < belief.mean()[0] && after.mean()[0] > broadcast[0]);
}

#[test]
fn bad_steps_are_typed_errors_and_leave_the_belief() {
    let network = scalar_network(0.0, 2);
    let belief = prior();
    let rules = rules(&network, &belief);
    let fuse = |heard: &[Observation<SVector<f64, 1>>]| network.fuse(&belief, &rules, belief.mean(), heard);
    let value = |z: f64| Observation::Received(Vector1::new(z));
    assert_eq!(fuse(&[Observation::Silent]).unwrap_err(), Error::ObservationCount { heard: 1, sensors: 2 });
    assert!(matches!(fuse(&[value(1.1), value(9.0)]).unwrap_err(), Error::ProtocolViolation { sensor: 0, .. }));
    assert!(matches!(fuse(&[value(9.0), value(f64::NAN)]).unwrap_err(), Error::Argument(_)));
    assert!(fuse(&[Observation::Silent, Observation::Silent]).is_ok());
    assert!(fuse(&[Observation::Lost, Observation::Lost]).unwrap().0 == belief);

    let always = Network::new(network.sensors().to_vec(), 0.0, 0.0).unwrap();
    let rules = self::rules(&always, &belief);
    let silent = always.fuse(&belief, &rules, belief.mean(), &[value(1.0), Observation::Silent]);
    assert_eq!(silent.unwrap_err(), Error::ImpossibleSilence { sensor: 1 });
    assert!(
        always
            .fuse(&belief, &rules[..1], belief.mean(), &[value(1.0), value(2.0)])
            .is_err()
    );

    assert!(Network::<2, 1>::new(vec![], 1.0, 0.0).is_err());
    for (eta, loss) in [(-1.0, 0.0), (f64::NAN, 0.0), (1.0, 1.0), (1.0, -0.1), (1.0, f64::NAN)] {
        assert!(Network::new(network.sensors().to_vec(), eta, loss).is_err());
    }
    assert!(network.rule_under(2, belief.covariance()).is_err());
    assert!(CensoringRule::scalar(0.0, 1.0).is_err() && CensoringRule::scalar(1.0, -1.0).is_err());
}

#[test]
fn scheduled_covariances_are_between_the_extremes() {
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let network = scalar_network(0.0, 2);
    let start = Gaussian::known(Vector2::new(0.0, 10.0)).unwrap();
    let mut rng = Stream::new(31).fast_rng();
    let schedule = expected_covariances(&mut rng, &network, &dynamics, &start, 20, 100).unwrap();
    let mut all = start;
    let mut own = OwnRecursion::new(&start);
    for p in &schedule {
        let predicted = kalman::predict(&dynamics, &all);
        let one = own.advance(&dynamics, &network.sensors()[0], start.mean()).unwrap();
        // Better than one sensor that always speaks is not promised; worse than all of them it must be.
        assert!(p[(0, 0)] >= predicted.covariance()[(0, 0)] - 1e-12 && p[(0, 0)] < 1.5 * one.predicted[(0, 0)]);
        all = predicted;
        for sensor in network.sensors() {
            all = kalman::update(sensor, &all, &Vector1::new(0.0)).unwrap().0;
        }
    }
    assert!(expected_covariances(&mut rng, &network, &dynamics, &start, 0, 10).is_err());
}

#[test]
fn the_rate_is_met_without_feedback_of_any_kind() {
    // P(|nu| >= c) for the sensor's own innovation, over many draws of a stationary plane.
    let dynamics = constant_velocity_2d(0.5, 0.1).unwrap();
    let sensor = LinearSensor::scalar(Vector4::new(1.0, 0.0, 0.0, 0.0), 1.0).unwrap();
    let start = Gaussian::new(Vector4::zeros(), Matrix4::identity()).unwrap();
    let rule =
        CensoringRule::under(&dynamics, &sensor, &start, Budget::new(0.3, 1).unwrap().threshold(1).unwrap()).unwrap();
    let mut rng = Stream::new(6).fast_rng();
    let rate: Moments = (0..20_000)
        .map(|_| {
            let truth = start.sample(&mut rng).unwrap();
            let state = fewbits_core::Dynamics::propagate(&dynamics, &mut rng, &truth);
            let z = fewbits_core::Sensing::sample(&sensor, &mut rng, &state);
            f64::from(u8::from(rule.speaks(&z)))
        })
        .collect();
    assert!(rate.estimate().z_score(0.3).abs() < 4.0, "{:?}", rate.estimate());
}
