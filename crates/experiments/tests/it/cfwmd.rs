//! How many particles a fusion centre of linear sensors needs to be as good as the Gaussian one, and what the printed likelihood of
//! silence says.

use super::assert_agrees;
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion};
use fewbits_cfwmd::threshold::{Budget, threshold};
use fewbits_core::factor::{self, Levels, Scalar};
use fewbits_core::{Belief, Cell, Dynamics, Gaussian, Likelihood, Link, Observed, Sensing};
use fewbits_densities::GaussianCloud;
use fewbits_experiments::schema::Value;
use fewbits_experiments::{Context, Measured, all};
use fewbits_filters::{RaoBlackwellised, Resampling, ResamplingRule, Schedule, StateFilter, kalman};
use fewbits_models::{LinearSensor, constant_velocity_1d};
use fewbits_monte_carlo::{Moments, MonteCarlo, Stream, Trial};
use fewbits_numerics::normal;
use fewbits_numerics::quadrature::gauss_legendre;
use nalgebra::Vector2;

/// Position and velocity error and rate, in `cfwmd-fig1`, of the Gaussian belief and of so many particles.
fn fig1(particles: u64, trials: u64) -> [[Measured; 3]; 2] {
    let figure = all()
        .into_iter()
        .find(|figure| figure.about().id == "cfwmd-fig1")
        .unwrap();
    let settings = [("particles", particles), ("trials", trials)].map(|(name, n)| (name.to_owned(), n.to_string()));
    let outcome = figure
        .configure(&settings, false)
        .unwrap()
        .outcome(&Context::new(1))
        .unwrap();
    let summary = outcome.tables.iter().find(|table| table.name == "summary").unwrap();
    let number = |scheme: &str, name: &str| {
        let column = summary.columns.iter().position(|column| column.name == name).unwrap();
        let row = summary
            .rows
            .iter()
            .find(|row| row[0] == Value::Text(scheme.to_owned()))
            .unwrap();
        match row[column] {
            Value::Number(number) => number,
            ref other => panic!("{other:?}"),
        }
    };
    ["CFwMD", "CFwMD particles"].map(|scheme| {
        ["position_rmse", "velocity_rmse", "rate"].map(|name| Measured {
            value: number(scheme, name),
            standard_error: Some(number(scheme, &format!("{name}_se"))),
        })
    })
}

fn assert_row(scheme: &str, own: [Measured; 3]) {
    for (quantity, own) in ["position_rmse", "velocity_rmse", "rate"].into_iter().zip(own) {
        assert_agrees(&format!("cfwmd-cost/{quantity}/{scheme}, l = 1"), own);
    }
}

/// With its closed-form moments the Gaussian belief is as good as a thousand particles; a hundred are not enough. That it is at
/// least fifteen times cheaper than a thousand is shown by the bench `fusion`.
#[test]
fn a_hundred_particles_are_too_few() {
    let [gaussian, few] = fig1(100, 1500);
    assert!(few[0].value > 1.03 * gaussian[0].value);
    assert_row("ADF", gaussian);
    assert_row("PF 100", few);
    assert_row("PF 300", fig1(300, 600)[1]);
    let [gaussian, many] = fig1(1000, 400);
    assert!(many[0].value >= 0.995 * gaussian[0].value);
    assert_row("PF 1000", many);
}

/// Squared position and velocity error and messages of one trial, averaged over its steps: of Rao-Blackwellised particles, and
/// of the Gaussian belief where there are none.
fn run(particles: usize, stream: Stream) -> [f64; 3] {
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
    let threshold = Budget::new(1.0, 2).unwrap().threshold(1).unwrap();
    let network = Network::new(vec![sensor; 2], threshold, Link::PERFECT).unwrap();
    let mut truth = Vector2::new(0.0, 10.0);
    let mut belief = Gaussian::known(truth).unwrap();
    let mut own = OwnRecursion::new(&belief);
    let mut cloud = GaussianCloud::agreed(&belief, particles.max(1)).unwrap();
    let rule = ResamplingRule {
        resampling: Resampling::Systematic,
        schedule: Schedule::Below(0.5),
    };
    let mut filter = RaoBlackwellised::new(rule, particles.max(1)).unwrap();
    let mut rng = stream.named("particles").fast_rng();
    let mut world = stream.named("world").rng();
    let mut sums = [0.0; 3];
    for _ in 0..20 {
        truth = dynamics.propagate(&mut world, &truth);
        let step = own.advance(&dynamics, &sensor, &truth).unwrap();
        let rules = vec![CensoringRule::new(&step.innovation_covariance, threshold).unwrap(); 2];
        let predicted = kalman::predict(&dynamics, &belief);
        filter.predict(&mut rng, &dynamics, &mut cloud).unwrap();
        let broadcast = if particles > 0 {
            cloud.means.mean()
        } else {
            *predicted.mean()
        };
        let measurements = [(); 2].map(|()| sensor.sample(&mut world, &truth));
        let (observations, sent) = network.transmit(&mut rng, &rules, &broadcast, &measurements).unwrap();
        belief = if particles > 0 {
            let c = rules[0].half_width();
            let silence = Levels::certain(Cell::new(broadcast[0] - c, broadcast[0] + c).unwrap(), 1.0).unwrap();
            for observation in &observations {
                let factor = match observation.received() {
                    Some(z) => Scalar::from(factor::Value::scalar(z[0], 1.0).unwrap()),
                    None => silence.clone().into(),
                };
                let observed = Observed::new(sensor, factor);
                filter.update(&mut rng, &mut cloud, &[&observed]).unwrap();
            }
            cloud.gaussian()
        } else {
            let (mut next, observed) = (predicted, observations.into_iter().map(Some).collect::<Vec<_>>());
            let all = network.likelihoods(&rules, &broadcast, &observed).unwrap();
            all.condition(&mut next).unwrap();
            next
        };
        let error = truth - belief.mean();
        let now = [error[0] * error[0], error[1] * error[1], sent as f64];
        sums.iter_mut().zip(now).for_each(|(sum, now)| *sum += now / 20.0);
    }
    sums
}

/// Thirty Rao-Blackwellised particles are on a par with the Gaussian belief, on the same trials.
#[test]
fn thirty_rao_blackwellised_particles_are_on_a_par() {
    let of = |particles: usize| {
        let trial = |it: Trial| Ok::<_, fewbits_cfwmd::Error>(run(particles, it.stream));
        let runs = MonteCarlo::new(Stream::new(1), 1500).run(trial).unwrap();
        let [position, velocity, rate] = [0, 1, 2].map(|k| runs.iter().map(|run| run[k]).collect::<Moments>());
        [
            Measured::root_mean(&position),
            Measured::root_mean(&velocity),
            rate.into(),
        ]
    };
    let gaussian = of(0);
    assert_row("ADF", gaussian);
    for particles in [10, 30, 100] {
        let own = of(particles);
        assert_row(&format!("RBPF {particles}"), own);
        let ratio = own[0].value / gaussian[0].value;
        assert!(particles != 30 || (ratio - 1.0).abs() <= 0.015, "{particles} particles: {ratio}");
    }
}

/// The likelihood of silence as printed, averaged over an own estimate that scatters about the position, is `1 - l/N` at every
/// position and step: it says nothing (erratum cfwmd-2).
#[test]
fn the_printed_likelihood_of_silence_says_nothing() {
    let dynamics = constant_velocity_1d(1.0, 4.0).unwrap();
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
    let start = Gaussian::known(Vector2::new(0.0, 10.0)).unwrap();
    // Who always sends is never silent.
    for rate in [0.25, 0.5, 1.0] {
        let threshold = threshold(rate, 1).unwrap();
        let mut own = OwnRecursion::new(&start);
        for k in 1..=20 {
            let step = own.advance(&dynamics, &sensor, start.mean()).unwrap();
            let half_width = CensoringRule::new(&step.innovation_covariance, threshold)
                .unwrap()
                .half_width();
            let spread = step.innovation_covariance[(0, 0)] - sensor.noise_variance();
            let reach = 9.0 * spread.sqrt();
            for offset in [-10.0, -1.0, 0.0, 1.0, 10.0] {
                let estimates = gauss_legendre::<24>().panels(offset - reach, offset + reach, 8);
                let silent = estimates.map(|(estimate, weight)| {
                    let density = normal::log_pdf_with(estimate, offset, spread).exp();
                    let [low, high] = [-half_width, half_width].map(|side| estimate + side - offset);
                    weight * density * normal::log_interval(low, high).exp()
                });
                let probability: f64 = silent.sum();
                assert!((probability - (1.0 - rate)).abs() < 1e-9, "rate {rate}, step {k}, {offset} m: {probability}");
            }
        }
    }
}
