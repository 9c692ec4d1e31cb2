//! One step of fusion, Gaussian against particles, and the silent factors, against a standard normal draw.
//!
//! Read the medians: `particles_1000 / gaussian`, averaged over what is observed (none silent in a quarter of the steps, one in
//! half, two in a quarter), is at least 15.

#![allow(clippy::unwrap_used)]

use divan::{AllocProfiler, Bencher, black_box};
use fewbits_baselines::cfwmd::likelihood_of_particles;
use fewbits_cfwmd::censored::{Censored, MissingReports};
use fewbits_cfwmd::ellipsoid::Ellipsoid;
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::rule::CensoringRule;
use fewbits_cfwmd::scheme::Censoring;
use fewbits_cfwmd::threshold::Budget;
use fewbits_core::{Belief, Factor, Gaussian, Likelihood, LinearSensing, Link, Observation};
use fewbits_densities::Particles;
use fewbits_filters::centre::{FusionCentre, Slot};
use fewbits_filters::{BootstrapFilter, MomentFilter, ResamplingRule, StateFilter, assumed_density, kalman};
use fewbits_models::{ContinuousLinear, LinearSensor, ScalarSensor, constant_velocity_1d};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix1, Matrix2, Vector1, Vector2};
use rand::RngExt;
use rand_distr::StandardNormal;

#[global_allocator]
static ALLOCATOR: AllocProfiler = AllocProfiler::system();

fn main() {
    divan::main();
}

/// The unit of account.
#[divan::bench]
fn standard_normal(bencher: Bencher<'_, '_>) {
    let mut rng = Stream::new(1).fast_rng();
    bencher.bench_local(|| rng.sample::<f64, _>(StandardNormal));
}

fn network() -> (Network<ScalarSensor<2>, 2, 1>, Vec<CensoringRule<1>>) {
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
    let threshold = Budget::new(1.0, 2).unwrap().threshold(1).unwrap();
    let network = Network::new(vec![sensor; 2], threshold, Link::PERFECT).unwrap();
    let rule = CensoringRule::scalar(6.854, threshold).unwrap();
    (network, vec![rule; 2])
}

/// What a step may observe: two values, one, or none.
fn observed(silent: usize) -> [Observation<Vector1<f64>>; 2] {
    let value = Observation::Received(Vector1::new(3.5));
    [
        if silent > 1 { Observation::Nothing } else { value },
        if silent > 0 { Observation::Nothing } else { value },
    ]
}

#[divan::bench(args = [0, 1, 2])]
fn gaussian(bencher: Bencher<'_, '_>, silent: usize) {
    let (network, rules) = network();
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let belief = Gaussian::new(Vector2::zeros(), Matrix2::new(0.6, 0.4, 0.4, 2.0)).unwrap();
    let observations = observed(silent).map(Some);
    bencher.bench_local(|| {
        let mut belief = kalman::predict(&dynamics, black_box(&belief));
        let all = network.likelihoods(&rules, &Vector2::zeros(), &observations).unwrap();
        all.condition(&mut belief).unwrap();
        belief
    });
}

/// The loop that knows the types of its likelihoods: a Kalman update for each value, then one for the silence. The others are multiples of it.
#[divan::bench(args = [0, 1, 2])]
fn typed_loop_unit(bencher: Bencher<'_, '_>, silent: usize) {
    let (network, rules) = network();
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let belief = Gaussian::new(Vector2::zeros(), Matrix2::new(0.6, 0.4, 0.4, 2.0)).unwrap();
    let observations = observed(silent);
    bencher.bench_local(|| {
        let mut belief = kalman::predict(&dynamics, black_box(&belief));
        let scheme = |i: usize| Censoring::new(network.sensors()[i], rules[i].clone(), network.format()).unwrap();
        let (mut log_likelihood, mut missing) = (0.0, MissingReports::default());
        for (i, (sensor, observation)) in network.sensors().iter().zip(&observations).enumerate() {
            match observation {
                Observation::Received(value) => {
                    scheme(i).received(&Vector2::zeros(), value, network.link()).unwrap();
                    let (next, info) = kalman::update(sensor, &belief, value).unwrap();
                    belief = next;
                    log_likelihood += info.log_likelihood;
                }
                _ => missing.nothing += 1,
            }
        }
        if missing.nothing > 0 {
            let factor = scheme(1).missing(&Vector2::zeros(), network.link(), missing).unwrap();
            let (next, info) = assumed_density::update(&belief, network.sensors()[1].matrix(), &factor).unwrap();
            belief = next;
            log_likelihood += info.log_likelihood;
        }
        (belief, log_likelihood)
    });
}

/// The same behind the contract of filters: likelihoods without their types.
#[divan::bench(args = [0, 1, 2])]
fn contract(bencher: Bencher<'_, '_>, silent: usize) {
    let (network, rules) = network();
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let belief = Gaussian::new(Vector2::zeros(), Matrix2::new(0.6, 0.4, 0.4, 2.0)).unwrap();
    let observations = observed(silent).map(Some);
    let (mut filter, mut rng) = (MomentFilter, Stream::new(3).fast_rng());
    bencher.bench_local(|| {
        let mut belief = black_box(&belief).to_owned();
        filter.predict(&mut rng, &dynamics, &mut belief).unwrap();
        let all = network.likelihoods(&rules, &Vector2::zeros(), &observations).unwrap();
        filter.update(&mut rng, &mut belief, &[&all]).unwrap();
        belief
    });
}

/// A centre of many identical sensors, all silent: one likelihood with a count.
#[divan::bench(args = [2, 10, 100])]
fn centre_of_silent_sensors(bencher: Bencher<'_, '_>, sensors: u32) {
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
    let network = Network::new(vec![sensor; sensors as usize], 1.0, Link::PERFECT).unwrap();
    let (world, prior) = (
        ContinuousLinear::nearly_constant_velocity(4.0).unwrap(),
        Gaussian::new(Vector2::zeros(), Matrix2::new(0.6, 0.4, 0.4, 2.0)).unwrap(),
    );
    let mut rng = Stream::new(4).fast_rng();
    let mut centre = FusionCentre::new(&mut rng, world, MomentFilter, &prior).unwrap();
    network.join(&mut centre).unwrap();
    let told = centre.feedback(0).unwrap();
    let slots: Vec<Slot> = (0..sensors)
        .map(|i| Slot::new(i, told.clone(), Observation::Nothing))
        .collect();
    bencher.bench_local(|| centre.receive(&mut rng, black_box(&slots)).unwrap().info);
}

#[divan::bench(args = [0, 1, 2])]
fn particles_1000(bencher: Bencher<'_, '_>, silent: usize) {
    let (network, rules) = network();
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let belief = Gaussian::new(Vector2::zeros(), Matrix2::new(0.6, 0.4, 0.4, 2.0)).unwrap();
    let mut rng = Stream::new(2).fast_rng();
    let start = Particles::from_belief(&mut rng, &belief, 1000).unwrap();
    let mut filter = BootstrapFilter::new(ResamplingRule::default(), 1000).unwrap();
    let mut cloud = start.clone();
    let observations = observed(silent);
    let mut step = || {
        cloud.clone_from(&start);
        filter.predict(&mut rng, &dynamics, &mut cloud).unwrap();
        let likelihood = likelihood_of_particles(&network, &rules, &Vector2::zeros(), &observations).unwrap();
        filter.update(&mut rng, &mut cloud, &[&likelihood]).unwrap();
        cloud.mean()
    };
    step();
    bencher.bench_local(step);
}

/// A thousand scalar factors of silence in one sweep.
#[divan::bench]
fn scalar_factors_1000(bencher: Bencher<'_, '_>) {
    let rule = CensoringRule::scalar(1.8 * 1.8, 1.0).unwrap();
    let factor = Censored::missing(
        &rule,
        &Vector1::zeros(),
        &Matrix1::new(1.0),
        &Link::PERFECT,
        MissingReports { nothing: 1, lost: 0 },
    )
    .unwrap();
    let values: Vec<f64> = (0..1000).map(|i| f64::from(i) * 0.006 - 3.0).collect();
    let mut sums = vec![0.0; 1000];
    bencher.bench_local(|| {
        factor.add_log_likelihoods(&[&values], &mut sums);
        sums[7]
    });
}

/// One factor of a sensor with two components.
#[divan::bench]
fn vector_factor(bencher: Bencher<'_, '_>) {
    let region = Ellipsoid::new(&Matrix2::new(3.5, 1.0, 1.0, 5.5), 1.386).unwrap();
    let under = region.under(&Matrix2::new(2.0, 0.0, 0.0, 4.0)).unwrap();
    bencher.bench_local(|| under.log_probability(black_box(&Vector2::new(0.7, -0.4))));
}

/// Its probability, mean and covariance together.
#[divan::bench]
fn vector_moments(bencher: Bencher<'_, '_>) {
    let region = Ellipsoid::new(&Matrix2::new(3.5, 1.0, 1.0, 5.5), 1.386).unwrap();
    let under = region.under(&Matrix2::new(2.8, 0.7, 0.7, 4.9)).unwrap();
    bencher.bench_local(|| under.moments(black_box(&Vector2::new(0.7, -0.4))).unwrap());
}
