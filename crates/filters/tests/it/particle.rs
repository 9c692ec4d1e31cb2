//! Particle filters against the exact Kalman and grid filters.

use fewbits_core::factor::{Constant, Levels, Scalar, Value};
use fewbits_core::{
    Belief, BitString, Cell, Dynamics, FullValue, Gaussian, Likelihood, Link, Message, NumberFormat, Observation,
    Observed, Sensing, Sign,
};
use fewbits_filters::centre::{FusionCentre, Reporting, Slot};
use fewbits_filters::{
    BootstrapFilter, GuidedFilter, GuidedParticles, MomentFilter, Particles, ResamplingRule, Schedule, StateFilter,
    kalman,
};
use fewbits_models::{Ar1, ContinuousLinear, LinearGaussian, LinearSensor, constant_velocity_1d};
use fewbits_monte_carlo::{Moments, Stream};
use nalgebra::{Matrix1, Matrix2, SVector, Vector1, Vector2};
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
    let mut state = prior.sample(&mut rng);
    let measurements = (0..steps)
        .map(|_| {
            state = dynamics.propagate(&mut rng, &state);
            sensor.sample(&mut rng, &state)[0]
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

    fn value(&self, z: f64) -> Observed<LinearSensor<2, 1>, Value<1>, 1> {
        Observed::new(self.sensor, Value::scalar(z, self.sensor.noise_variance()).unwrap())
    }

    fn start(&self, count: usize, rng: &mut Pcg64Mcg) -> Particles<2> {
        Particles::from_belief(rng, &self.prior, count).unwrap()
    }
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Bootstrap,
    Guided,
}

impl Kind {
    const ALL: [Self; 2] = [Self::Bootstrap, Self::Guided];
}

/// One step of either filter in place; the estimate of the log-likelihood and the effective sample size.
fn advance<const D: usize>(
    kind: Kind,
    filter: ResamplingRule,
    rng: &mut Pcg64Mcg,
    dynamics: &impl fewbits_core::GaussianDynamics<D>,
    belief: &mut Particles<D>,
    observed: &dyn Likelihood<D>,
) -> (f64, f64) {
    let count = belief.len();
    let (next, info) = match kind {
        Kind::Bootstrap => BootstrapFilter::new(filter, count)
            .unwrap()
            .step(rng, dynamics, belief, &[observed])
            .unwrap(),
        Kind::Guided => {
            let mut guided = GuidedFilter::new(filter, count).unwrap();
            let (next, info) = guided.step(rng, dynamics, &belief.clone().into(), &[observed]).unwrap();
            (next.particles().clone(), info)
        }
    };
    *belief = next;
    (info.log_likelihood, info.effective_sample_size.unwrap())
}

/// Runs one filter over the scene; the final belief and the estimate of the log-likelihood.
fn run(scene: &Scene, kind: Kind, filter: ResamplingRule, count: usize, stream: Stream) -> (Particles<2>, f64) {
    let mut rng = stream.fast_rng();
    let mut belief = scene.start(count, &mut rng);
    let mut log_likelihood = 0.0;
    for z in &scene.measurements {
        let (log, size) = advance(kind, filter, &mut rng, &scene.dynamics, &mut belief, &scene.value(*z));
        log_likelihood += log;
        assert!((size - belief.effective_sample_size()).abs() < 1e-9);
    }
    (belief, log_likelihood)
}

#[test]
fn all_filters_agree_with_the_kalman_filter() {
    let scene = scene(STEPS);
    let (exact, log_likelihood) = scene.kalman();
    for kind in Kind::ALL {
        for resampling in crate::resample::ALL {
            let filter = ResamplingRule {
                resampling,
                schedule: Schedule::Below(0.7),
            };
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

/// Erratum `mpa-6`.
#[test]
fn the_likelihood_estimate_is_unbiased_for_every_law() {
    let scene = scene(6);
    let (_, log_likelihood) = scene.kalman();
    for kind in Kind::ALL {
        for resampling in crate::resample::ALL {
            for schedule in [Schedule::Always, Schedule::Below(0.5)] {
                let filter = ResamplingRule { resampling, schedule };
                let ratio: Moments = (0..1000)
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

/// Anything observed of a scalar state, through the same filter.
fn against_the_grid(observed_at: impl Fn(usize) -> Scalar) {
    let dynamics = Ar1::new(0.9, 0.6).unwrap();
    let likelihoods: Vec<_> = (0..8)
        .map(|k| Observed::new(LinearSensor::direct(NOISE).unwrap(), observed_at(k)))
        .collect();
    let (exact, evidence) = crate::on_a_grid(&dynamics, [0.0, 3.0], &likelihoods);
    let filter = ResamplingRule::default();
    for kind in Kind::ALL {
        let mut moments = <(Moments, Moments, Moments)>::default();
        for repeat in 0..10 {
            let mut rng = Stream::new(21).indexed(repeat).fast_rng();
            let prior = Gaussian::scalar(0.0, 3.0).unwrap();
            let mut belief = Particles::from_belief(&mut rng, &prior, 4000).unwrap();
            let mut total = 0.0;
            for likelihood in &likelihoods {
                total += advance(kind, filter, &mut rng, &dynamics, &mut belief, likelihood).0;
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
            let found = ours.estimate();
            assert!(off < 5.0 * ours.standard_error() + 1e-3 && off < 0.05, "{kind:?}: {found:?} against {truth}");
        }
    }
}

/// Variance of the scalar measurements.
const NOISE: f64 = 0.49;

#[test]
fn sign_bits_through_a_noisy_link_run_through_the_filter() {
    let link = Link::flipping(0.1).unwrap();
    against_the_grid(|k| {
        let sign = if k % 3 == 0 { Sign::Below } else { Sign::Above };
        Levels::sign(sign, 0.3 * k as f64 - 1.0, NOISE, &link).unwrap().into()
    });
}

#[test]
fn quantizer_cells_run_through_the_filter() {
    against_the_grid(|k| {
        let cell = Cell::new(k as f64 * 0.4 - 1.0, k as f64 * 0.4 - 0.2).unwrap();
        Levels::certain(cell, NOISE).unwrap().into()
    });
}

#[test]
fn censored_silence_and_loss_run_through_the_filter() {
    against_the_grid(|k| match k % 4 {
        0 => Value::scalar(1.0, NOISE).unwrap().into(),
        1 => Constant::new(1.0).unwrap().into(),
        _ => {
            let link = Link::lossy(0.2 * (k % 2) as f64).unwrap();
            Levels::silence(Cell::new(-0.2, 1.6).unwrap(), NOISE, &link)
                .unwrap()
                .into()
        }
    });
}

/// A sharp value seen through the square root of a distance: weights of the proposal that has seen it are far more even.
#[test]
fn a_guided_filter_pays_where_the_dynamics_are_wide() {
    struct Root;
    impl Sensing<1, 1> for Root {
        fn mean(&self, state: &Vector1<f64>) -> Vector1<f64> {
            state.map(|x| (1.0 + x * x).sqrt())
        }
        fn jacobian(&self, state: &Vector1<f64>) -> Matrix1<f64> {
            state.map(|x| x / (1.0 + x * x).sqrt())
        }
        fn noise_covariance_at(&self, _: &Vector1<f64>) -> Matrix1<f64> {
            Matrix1::new(1e-4)
        }
        fn sample(&self, _: &mut dyn rand::Rng, state: &Vector1<f64>) -> Vector1<f64> {
            self.mean(state)
        }
    }
    let dynamics = Ar1::new(0.9, 1.0).unwrap();
    let observed = Observed::new(Root, Value::scalar(5.0, 1e-4).unwrap());
    let prior = Gaussian::scalar(5.0, 0.5).unwrap();
    let (mut plain, mut guided) = <(Moments, Moments)>::default();
    let mut sizes = [0.0; 2];
    for repeat in 0..40 {
        let mut rng = Stream::new(22).indexed(repeat).fast_rng();
        let start = Particles::from_belief(&mut rng, &prior, 4000).unwrap();
        for (kind, moments, sum) in [(Kind::Bootstrap, &mut plain, 0), (Kind::Guided, &mut guided, 1)] {
            let mut belief = start.clone();
            let (log, size) = advance(kind, ResamplingRule::default(), &mut rng, &dynamics, &mut belief, &observed);
            moments.add(log.exp());
            sizes[sum] += size;
        }
    }
    let error = plain.standard_error().hypot(guided.standard_error());
    assert!((plain.mean() - guided.mean()).abs() < 4.0 * error, "{:?} {:?}", plain.estimate(), guided.estimate());
    assert!(sizes[1] > 20.0 * sizes[0], "{sizes:?}");
}

/// Another prediction in between, or a store, changes nothing of an update.
#[test]
fn guided_proposals_belong_to_the_belief() {
    let scene = scene(1);
    let new = || GuidedFilter::new(ResamplingRule::default(), 300).unwrap();
    let (mut filter, mut rng) = (new(), Stream::new(23).fast_rng());
    let mut belief = filter.start(&mut rng, &scene.prior).unwrap();
    filter.predict(&mut rng, &scene.dynamics, &mut belief).unwrap();
    let observed = scene.value(scene.measurements[0]);
    let update = |filter: &mut GuidedFilter<2>, belief: &GuidedParticles<2>| {
        let mut next = belief.clone();
        filter
            .update(&mut Stream::new(24).fast_rng(), &mut next, &[&observed])
            .unwrap();
        next
    };
    let expected = update(&mut filter, &belief);
    let weighed = update(&mut filter, &belief.particles().clone().into());
    assert!(expected.particles().columns() != weighed.particles().columns());
    let mut later = expected.clone();
    filter
        .predict(&mut rng, &constant_velocity_1d(5.0, 2.0).unwrap(), &mut later)
        .unwrap();
    assert!(update(&mut filter, &belief) == expected);
    let mut stored = serde_json::to_value(&belief).unwrap();
    assert!(update(&mut new(), &serde_json::from_value(stored.clone()).unwrap()) == expected);
    stored["moves"].as_array_mut().unwrap().pop();
    let refused = serde_json::from_value::<GuidedParticles<2>>(stored)
        .unwrap_err()
        .to_string();
    assert!(refused.contains("moves") && refused.contains("299 Gaussians"), "{refused}");
}

/// A report of time 1 that arrives at time 2 counts as if it had been in time.
#[test]
fn late_reports_reach_a_guided_filter() {
    fn centre<F: StateFilter<1>>(rng: &mut Pcg64Mcg, filter: F) -> FusionCentre<1, F> {
        let world = ContinuousLinear::ornstein_uhlenbeck(0.0, 20.0, 2.0).unwrap();
        let prior = Gaussian::scalar(0.0, 2.0).unwrap();
        let centre = FusionCentre::new(rng, world, filter, &prior).unwrap();
        let mut centre = centre.with_window(10.0).unwrap();
        for number in 0..2 {
            let values = FullValue::new(0.1).unwrap();
            let sensor = Reporting::values(LinearSensor::direct(0.1).unwrap(), values, Link::PERFECT);
            centre.join(number, sensor).unwrap();
        }
        centre
    }
    let slot = |sensor, value: f64| {
        let bits = Message::to_bits(&value, &NumberFormat::Double).unwrap();
        Slot::new(sensor, BitString::default(), Observation::Received(bits))
    };
    let mut rng = Stream::new(25).fast_rng();
    let mut exact = centre(&mut rng, MomentFilter);
    exact.advance(&mut rng, 1.0).unwrap();
    exact.receive(&mut rng, &[slot(0, 1.0), slot(1, 1.6)]).unwrap();
    exact.advance(&mut rng, 2.0).unwrap();
    exact.receive(&mut rng, &[slot(0, 1.2)]).unwrap();
    let mut means = Moments::default();
    for _ in 0..100 {
        let mut late = centre(&mut rng, GuidedFilter::new(ResamplingRule::default(), 400).unwrap());
        for (time, value) in [(1.0, 1.0), (2.0, 1.2)] {
            late.advance(&mut rng, time).unwrap();
            late.receive(&mut rng, &[slot(0, value)]).unwrap();
        }
        assert!(late.late(&mut rng, 1.0, &[slot(1, 1.6)]).unwrap());
        means.add(late.estimate().mean()[0]);
    }
    let z = means.estimate().z_score(exact.estimate().mean()[0]);
    assert!(z.abs() < 4.5 && means.standard_error() < 5e-3, "{:?} {z}", means.estimate());
}
