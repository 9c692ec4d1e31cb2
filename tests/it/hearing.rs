//! One stream of messages, three listeners: the special estimator, the exact grid filter and a particle filter that knows
//! nothing but the likelihood. They must agree as far as each is exact.

use fewbits::core::likelihood::{Heard, ScalarLikelihood};
use fewbits::core::{Cell, Dynamics, Encoder, Gaussian, Likelihood, Message, Observation};
use fewbits::densities::Particles;
use fewbits::dymbo::{DymboFilter, MultibitFilter, OneBitSensor, ScalarPlant, StepInfo};
use fewbits::filters::{Grid, ParticleFilter, PointMass, PointMassFilter, Workspace};
use fewbits::monte_carlo::Stream;
use nalgebra::SVector;
use rand::{Rng, RngExt};

const STEPS: u64 = 40;
const PARTICLES: usize = 20_000;

/// Means, variances and the log-likelihood of everything heard, as the listeners see them after the last step.
struct Agreement {
    special: Gaussian<1>,
    exact_mean: f64,
    exact_variance: f64,
    particle_mean: f64,
    log_likelihoods: [f64; 3],
    bits: u32,
}

/// Runs plant, sensor, link and the three listeners. `speak` encodes a sample given the special estimator's belief, sends it
/// through real bits, and returns the estimator's next belief with the likelihood of what was heard.
fn listen(
    plant: &ScalarPlant,
    loss: f64,
    speak: impl Fn(&Gaussian<1>, f64, bool) -> (Gaussian<1>, StepInfo, Heard),
) -> Agreement {
    let stream = Stream::new(11).named("hearing");
    let (mut world, mut cloud_rng) = (stream.named("world").rng(), stream.named("cloud").fast_rng());
    let start = Gaussian::scalar(0.0, plant.dynamics().stationary_variance().unwrap()).unwrap();
    let mut state = start.sample(&mut world).unwrap();
    let grid = Grid::symmetric(9.0 * start.standard_deviations()[0], 0.2).unwrap();
    let referee = PointMassFilter::new(plant.dynamics(), grid).unwrap();
    let mut exact = PointMass::normal(grid, 0.0, start.covariance()[0]).unwrap();
    let mut cloud = Particles::from_draws(PARTICLES, || start.sample(&mut cloud_rng).unwrap()).unwrap();
    let (filter, mut workspace) = (ParticleFilter::default(), Workspace::default());
    let mut belief = start;
    let (mut log_likelihoods, mut bits) = ([0.0; 3], 0);
    for _ in 0..STEPS {
        state = plant.dynamics().propagate(&mut world, &state);
        let sample = state[0] + plant.measurement_variance().sqrt() * normal(&mut world);
        let (next, info, heard) = speak(&belief, sample, world.random::<f64>() < loss);
        belief = next;
        bits += info.bits;
        log_likelihoods[0] += info.update.map_or(0.0, |update| update.log_likelihood);
        let sd = plant.measurement_variance().sqrt();
        let likelihood = ScalarLikelihood::new(SVector::from([1.0]), sd, heard).unwrap();
        exact = referee.predict(&exact).unwrap();
        log_likelihoods[1] += exact
            .update(|x| likelihood.log_likelihood(&SVector::from([x])))
            .unwrap();
        let step = filter.step_in_place(&mut cloud_rng, plant.dynamics(), &likelihood, &mut cloud, &mut workspace);
        log_likelihoods[2] += step.unwrap().log_likelihood;
    }
    Agreement {
        special: belief,
        exact_mean: exact.mean(),
        exact_variance: exact.variance(),
        particle_mean: cloud.mean()[0],
        log_likelihoods,
        bits,
    }
}

fn normal<R: Rng>(rng: &mut R) -> f64 {
    fewbits::numerics::normal::quantile(rng.random::<f64>().clamp(1e-12, 1.0 - 1e-12))
}

impl Agreement {
    fn check(&self, special_error: f64) {
        let sd = self.exact_variance.sqrt();
        assert!((self.special.mean()[0] - self.exact_mean).abs() < special_error * sd);
        assert!((self.special.covariance()[0] / self.exact_variance - 1.0).abs() < 4.0 * special_error);
        // A particle mean errs by about sd/sqrt(N) times a small factor for correlated resampling.
        assert!((self.particle_mean - self.exact_mean).abs() < 8.0 * sd / (PARTICLES as f64).sqrt());
        let [special, exact, particle] = self.log_likelihoods;
        assert!((special - exact).abs() < special_error * STEPS as f64, "{special} against {exact}");
        assert!((particle - exact).abs() < 0.15, "{particle} against {exact}");
    }
}

#[test]
fn sign_bits_through_a_noisy_link_with_losses() {
    let plant = ScalarPlant::new(0.9, 0.5, 1.0).unwrap();
    let crossover = 0.1;
    let filter = DymboFilter::new(plant).with_crossover(crossover).unwrap();
    let speak = |belief: &Gaussian<1>, sample: f64, lost: bool| {
        let threshold = filter.threshold(belief);
        let sent = OneBitSensor.encode(&sample, &threshold).to_bits(&()).unwrap();
        let sign = Message::from_bits(&(), &sent).unwrap();
        let (observation, heard) = if lost {
            (Observation::Lost, Heard::Lost)
        } else {
            (
                Observation::Received(sign),
                Heard::Bit {
                    sign,
                    threshold,
                    crossover,
                },
            )
        };
        let (next, info) = filter.step(belief, observation).unwrap();
        (next, info, heard)
    };
    let agreement = listen(&plant, 0.25, speak);
    assert!(agreement.bits < STEPS as u32 && agreement.bits > STEPS as u32 / 2);
    agreement.check(0.05);
}

#[test]
fn words_of_a_lloyd_max_quantizer() {
    let plant = ScalarPlant::new(0.9, 0.5, 1.0).unwrap();
    let filter = MultibitFilter::new(plant, 2).unwrap();
    let speak = |belief: &Gaussian<1>, sample: f64, _: bool| {
        let prediction = filter.broadcast(belief);
        let index = filter.sensor().encode(&sample, &prediction);
        let sent = index.to_bits(&filter.sensor().bits()).unwrap();
        assert_eq!(sent.bits(), 2);
        let index = Message::from_bits(&filter.sensor().bits(), &sent).unwrap();
        let cell: Cell = filter.sensor().cell(index, &prediction).unwrap();
        let (next, info) = filter.step(belief, Observation::Received(index)).unwrap();
        (next, info, Heard::Cell(cell))
    };
    let agreement = listen(&plant, 0.0, speak);
    assert_eq!(agreement.bits, 2 * STEPS as u32);
    // The filter's variance is the average over cells; the exact one depends on the last cell heard.
    let sd = agreement.exact_variance.sqrt();
    assert!((agreement.special.mean()[0] - agreement.exact_mean).abs() < 0.1 * sd);
    assert!((agreement.particle_mean - agreement.exact_mean).abs() < 8.0 * sd / (PARTICLES as f64).sqrt());
    assert!((agreement.log_likelihoods[2] - agreement.log_likelihoods[1]).abs() < 0.15);
}
