//! Particle filters against the exact Kalman and grid filters.

use fewbits_core::likelihood::{Heard, ScalarLikelihood};
use fewbits_core::message::{Cell, Sign};
use fewbits_core::{Dynamics, Gaussian, Likelihood};
use fewbits_densities::Particles;
use fewbits_filters::{
    Error, Grid, OptimalProposal, ParticleFilter, PointMass, PointMassFilter, Resampling, Schedule, Workspace, kalman,
};
use fewbits_models::{Ar1, LinearGaussian, LinearSensor, constant_velocity_1d};
use fewbits_monte_carlo::{Moments, Stream};
use nalgebra::{Matrix2, SVector, Vector2};
use rand_pcg::Pcg64Mcg;

const STEPS: usize = 12;

/// A constant-velocity target seen through its position.
struct Scene {
    dynamics: LinearGaussian<2, 1>,
    sensor: LinearSensor<2, 1>,
    prior: Gaussian<2>,
    measurements: Vec<f64>,
}

fn scene(steps: usize) -> Scene {
    let dynamics = constant_velocity_1d(1.0, 0.5).unwrap();
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 2.0).unwrap();
    let prior = Gaussian::new(Vector2::new(0.0, 1.0), Matrix2::new(1.0, 0.2, 0.2, 0.5)).unwrap();
    let mut rng = Stream::new(11).rng();
    let mut state = prior.sample(&mut rng).unwrap();
    let measurements = (0..steps)
        .map(|_| {
            state = dynamics.propagate(&mut rng, &state);
            fewbits_core::Sensing::sample(&sensor, &mut rng, &state)[0]
        })
        .collect();
    Scene {
        dynamics,
        sensor,
        prior,
        measurements,
    }
}

impl Scene {
    fn kalman(&self) -> (Gaussian<2>, f64) {
        let mut belief = self.prior;
        let mut log_likelihood = 0.0;
        for z in &self.measurements {
            let (next, info) = kalman::step(&self.dynamics, &self.sensor, &belief, &SVector::from([*z])).unwrap();
            belief = next;
            log_likelihood += info.log_likelihood;
        }
        (belief, log_likelihood)
    }

    fn value(&self, z: f64) -> ScalarLikelihood<2> {
        ScalarLikelihood::new(self.sensor.direction(), self.sensor.noise_variance().sqrt(), Heard::Value(z)).unwrap()
    }

    fn start(&self, count: usize, rng: &mut Pcg64Mcg) -> Particles<2> {
        Particles::from_draws(count, || self.prior.sample(rng).unwrap()).unwrap()
    }
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Bootstrap,
    Guided,
    Auxiliary,
}

/// Runs one filter over the scene; the final belief and the estimate of the log-likelihood.
fn run(scene: &Scene, kind: Kind, filter: ParticleFilter, count: usize, stream: Stream) -> (Particles<2>, f64) {
    let mut rng = stream.fast_rng();
    let mut belief = scene.start(count, &mut rng);
    let mut workspace = Workspace::default();
    let mut log_likelihood = 0.0;
    for z in &scene.measurements {
        let heard = scene.value(*z);
        let info = match kind {
            Kind::Bootstrap => filter.step_in_place(&mut rng, &scene.dynamics, &heard, &mut belief, &mut workspace),
            Kind::Guided => {
                let proposal = OptimalProposal::new(&scene.dynamics, &scene.sensor, SVector::from([*z])).unwrap();
                filter.guided_step(&mut rng, &proposal, &mut belief, &mut workspace)
            }
            Kind::Auxiliary => filter.auxiliary_step(&mut rng, &scene.dynamics, &heard, &mut belief, &mut workspace),
        }
        .unwrap();
        log_likelihood += info.log_likelihood;
        assert!((info.effective_sample_size - belief.effective_sample_size()).abs() < 1e-9);
    }
    (belief, log_likelihood)
}

#[test]
fn all_three_filters_agree_with_the_kalman_filter() {
    let scene = scene(STEPS);
    let (exact, log_likelihood) = scene.kalman();
    for kind in [Kind::Bootstrap, Kind::Guided, Kind::Auxiliary] {
        for resampling in Resampling::ALL {
            let filter = ParticleFilter::new(resampling, Schedule::Below(0.7));
            let (mut x, mut v, mut spread, mut evidence) = <(Moments, Moments, Moments, Moments)>::default();
            for repeat in 0..8 {
                let stream = Stream::new(5).named("kalman").indexed(repeat);
                let (belief, estimate) = run(&scene, kind, filter, 4000, stream);
                x.add(belief.mean()[0]);
                v.add(belief.mean()[1]);
                spread.add(belief.covariance()[(0, 1)]);
                evidence.add(estimate);
            }
            for (name, moments, truth) in [
                ("position", x, exact.mean()[0]),
                ("velocity", v, exact.mean()[1]),
                ("covariance", spread, exact.covariance()[(0, 1)]),
                ("log-likelihood", evidence, log_likelihood),
            ] {
                // Eight repeats estimate their own error: Student's t with 7 degrees of freedom.
                let slack = 6.0 * moments.standard_error() + 2e-3;
                let off = (moments.mean() - truth).abs();
                assert!(off < slack, "{kind:?} {resampling:?} {name}: {} against {truth}", moments.mean());
                assert!(off < 0.15, "{kind:?} {resampling:?} {name}: {} against {truth}", moments.mean());
            }
        }
    }
}

#[test]
fn the_likelihood_estimate_is_unbiased_for_every_law() {
    let scene = scene(6);
    let (_, log_likelihood) = scene.kalman();
    for kind in [Kind::Bootstrap, Kind::Guided, Kind::Auxiliary] {
        for resampling in Resampling::ALL {
            for schedule in [Schedule::Always, Schedule::Below(0.5)] {
                let filter = ParticleFilter::new(resampling, schedule);
                let ratio: Moments = (0..1500)
                    .map(|repeat| {
                        let stream = Stream::new(8).named("unbiased").indexed(repeat);
                        (run(&scene, kind, filter, 60, stream).1 - log_likelihood).exp()
                    })
                    .collect();
                let z = ratio.estimate().z_score(1.0);
                assert!(z.abs() < 4.0, "{kind:?} {resampling:?} {schedule:?}: {:?}, z = {z}", ratio.estimate());
                assert!(ratio.standard_error() < 0.05);
            }
        }
    }
}

/// Anything heard of a scalar state, through the same filter.
fn against_the_grid(heard_at: impl Fn(usize) -> Heard) {
    let dynamics = Ar1::new(0.9, 0.6).unwrap();
    let likelihoods: Vec<_> = (0..8)
        .map(|k| ScalarLikelihood::new(SVector::from([1.0]), 0.7, heard_at(k)).unwrap())
        .collect();
    let grid = Grid::new(-12.0, 12.0, 0.02).unwrap();
    let referee = PointMassFilter::new(&dynamics, grid).unwrap();
    let mut exact = PointMass::normal(grid, 0.0, 3.0).unwrap();
    let mut evidence = 0.0;
    for likelihood in &likelihoods {
        exact = referee.predict(&exact).unwrap();
        evidence += exact
            .update(|x| likelihood.log_likelihood(&SVector::from([x])))
            .unwrap();
    }
    let filter = ParticleFilter::default();
    let mut moments = <(Moments, Moments, Moments)>::default();
    for repeat in 0..10 {
        let mut rng = Stream::new(21).indexed(repeat).fast_rng();
        let prior = Gaussian::scalar(0.0, 3.0).unwrap();
        let mut belief = Particles::from_draws(4000, || prior.sample(&mut rng).unwrap()).unwrap();
        let mut total = 0.0;
        for likelihood in &likelihoods {
            let (next, info) = filter.step(&mut rng, &dynamics, &belief, likelihood).unwrap();
            belief = next;
            total += info.log_likelihood;
        }
        moments.0.add(belief.mean()[0]);
        moments.1.add(belief.covariance()[(0, 0)]);
        moments.2.add(total);
    }
    for (ours, truth) in [
        (moments.0, exact.mean()),
        (moments.1, exact.variance()),
        (moments.2, evidence),
    ] {
        let off = (ours.mean() - truth).abs();
        assert!(off < 5.0 * ours.standard_error() + 1e-3 && off < 0.05, "{:?} against {truth}", ours.estimate());
    }
}

#[test]
fn sign_bits_through_a_noisy_link_run_through_the_filter() {
    against_the_grid(|k| Heard::Bit {
        sign: if k % 3 == 0 { Sign::Below } else { Sign::Above },
        threshold: 0.3 * k as f64 - 1.0,
        crossover: 0.1,
    });
}

#[test]
fn quantizer_cells_run_through_the_filter() {
    against_the_grid(|k| Heard::Cell(Cell::new(k as f64 * 0.4 - 1.0, k as f64 * 0.4 - 0.2).unwrap()));
}

#[test]
fn censored_silence_and_loss_run_through_the_filter() {
    against_the_grid(|k| match k % 4 {
        0 => Heard::Value(1.0),
        1 => Heard::Lost,
        _ => Heard::Silence {
            cell: Cell::new(-0.2, 1.6).unwrap(),
            loss: 0.2 * (k % 2) as f64,
        },
    });
}

#[test]
fn an_impossible_message_keeps_the_belief() {
    struct Never;
    impl Likelihood<1> for Never {
        fn log_likelihood(&self, _: &SVector<f64, 1>) -> f64 {
            f64::NEG_INFINITY
        }
    }
    let mut belief = Particles::uniform([vec![1.0, 2.0, 4.0]]).unwrap();
    let before = belief.clone();
    let refused = ParticleFilter::default().update(&Never, &mut belief);
    assert!(matches!(refused, Err(Error::Density(_))), "{refused:?}");
    assert_eq!(belief, before);
}

#[test]
fn the_number_of_particles_can_change() {
    let mut rng = Stream::new(2).fast_rng();
    let mut belief = Particles::new([vec![0.0, 10.0]], &[0.0, 3.0_f64.ln()]).unwrap();
    let filter = ParticleFilter::default();
    filter
        .resample_to(&mut rng, &mut belief, 400, &mut Workspace::default())
        .unwrap();
    assert_eq!(belief.len(), 400);
    assert!((belief.mean()[0] - 7.5).abs() < 0.05);
    assert!(
        filter
            .resample_to(&mut rng, &mut belief, 0, &mut Workspace::default())
            .is_err()
    );
    assert_eq!(belief.len(), 400);
}
