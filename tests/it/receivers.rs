//! One stream of reports, three receivers: the closed-form estimator, the exact grid filter and a particle filter that knows
//! nothing but the factor. They must agree as far as each is exact.

use fewbits::core::{Belief, Dynamics, Gaussian, Link, Observed, Scheme, Sensing};
use fewbits::densities::{Particles, PointMass};
use fewbits::dymbo::{DymboFilter, MultibitFilter, ScalarFilter, ScalarPlant};
use fewbits::filters::{BootstrapFilter, ResamplingRule};
use fewbits::monte_carlo::Stream;
use fewbits_baselines::dymbo::gap::exact_filter;

const STEPS: usize = 40;
const PARTICLES: usize = 20_000;

/// Means, variances and the log-likelihood of all observations, as the receivers see them after the last step.
struct Agreement {
    special: Gaussian<1>,
    exact: PointMass,
    particle_mean: f64,
    log_likelihoods: [f64; 3],
    bits: u32,
}

/// Runs plant, sensor, the filter's link and the three receivers.
fn receive<F: ScalarFilter>(filter: &F) -> Agreement {
    let stream = Stream::new(11).named("receivers");
    let (mut world, mut cloud_rng) = (stream.named("world").rng(), stream.named("cloud").fast_rng());
    let (plant, scheme, link) = (filter.plant(), filter.scheme(), filter.link());
    let start = Gaussian::scalar(0.0, plant.dynamics().stationary_variance().unwrap()).unwrap();
    let mut state = start.sample(&mut world);
    let referee = exact_filter(plant, STEPS).unwrap();
    let mut exact = PointMass::normal(*referee.grid(), 0.0, start.covariance()[0]).unwrap();
    let mut cloud = Particles::from_belief(&mut cloud_rng, &start, PARTICLES).unwrap();
    let mut particle = BootstrapFilter::new(ResamplingRule::default(), PARTICLES).unwrap();
    let mut special = start;
    let (mut log_likelihoods, mut bits) = ([0.0; 3], 0);
    for _ in 0..STEPS {
        state = plant.dynamics().propagate(&mut world, &state);
        let sample = plant.sensor().sample(&mut world, &state);
        let feedback = filter.feedback(&filter.predict(&special));
        let report = scheme.encode(&mut world, &mut (), &sample, &feedback).unwrap();
        let observation = link
            .transmit(&mut world, report.as_ref(), &scheme.report_format())
            .unwrap();
        let observed = Observed::new(*plant.sensor(), scheme.factor(&feedback, &observation, link).unwrap());

        let (next, info) = filter.step(&special, &observation).unwrap();
        special = next;
        bits += info.bits;
        log_likelihoods[0] += info.log_likelihood;
        exact = referee.predict(&exact).unwrap();
        log_likelihoods[1] += exact.update(&observed).unwrap();
        let step = particle.step_in_place(&mut cloud_rng, plant.dynamics(), &mut cloud, &[&observed]);
        log_likelihoods[2] += step.unwrap().log_likelihood;
    }
    Agreement {
        special,
        exact,
        particle_mean: cloud.mean()[0],
        log_likelihoods,
        bits,
    }
}

impl Agreement {
    fn check(&self, mean_error: f64) {
        let sd = self.exact.variance().sqrt();
        assert!((self.special.mean()[0] - self.exact.mean()).abs() < mean_error * sd);
        // A particle mean errs by about sd/sqrt(N) times a small factor for correlated resampling.
        assert!((self.particle_mean - self.exact.mean()).abs() < 8.0 * sd / (PARTICLES as f64).sqrt());
        let [special, exact, particle] = self.log_likelihoods;
        assert!((special - exact).abs() < 0.05 * STEPS as f64, "{special} against {exact}");
        assert!((particle - exact).abs() < 0.15, "{particle} against {exact}");
    }
}

#[test]
fn sign_bits_through_a_noisy_link_with_losses() {
    let plant = ScalarPlant::new(0.9, 0.5, 1.0).unwrap();
    let filter = DymboFilter::new(plant).with_link(Link::new(0.25, 0.1).unwrap());
    let agreement = receive(&filter);
    assert!(agreement.bits < STEPS as u32 && agreement.bits > STEPS as u32 / 2);
    agreement.check(0.05);
    assert!((agreement.special.covariance()[0] / agreement.exact.variance() - 1.0).abs() < 0.2);
}

#[test]
fn words_of_a_lloyd_max_quantizer() {
    let plant = ScalarPlant::new(0.9, 0.5, 1.0).unwrap();
    let agreement = receive(&MultibitFilter::new(plant, 2).unwrap());
    assert_eq!(agreement.bits, 2 * STEPS as u32);
    // The filter's variance is the average over cells; the exact one depends on the last cell.
    agreement.check(0.1);
}
