//! One scheme in a closed loop with every filter: a two-sided bit over a link that loses and inverts.

use fewbits_core::factor::{Constant, Partition, Scalar};
use fewbits_core::{
    Belief, Error as CoreError, Gaussian, LinearDynamics, Link, Message, NumberFormat, Observation, Observed, Scheme,
    Sign, laws,
};
use fewbits_filters::{
    AssumedDensity, ClosedLoop, Filter, GaussianCloud, Grid, ParticleFilter, Particles, PointMass, PointMassFilter,
    RaoBlackwellised,
};
use fewbits_models::{Ar1, LinearSensor};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::error::finite;
use nalgebra::Vector1;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

const NOISE: f64 = 0.5;

/// One bit: is the measurement further than `reach` from the broadcast prediction?
struct TwoSided {
    reach: f64,
}

impl Scheme<1> for TwoSided {
    type State = ();
    type Feedback = f64;
    type Report = Sign;
    type Factor = Scalar;

    fn start(&self) {}

    fn feedback_format(&self) -> NumberFormat {
        NumberFormat::Single
    }

    fn report_format(&self) {}

    fn encode<R: Rng + ?Sized>(
        &self,
        _: &mut R,
        (): &mut (),
        measurement: &Vector1<f64>,
        prediction: &f64,
    ) -> Result<Option<Sign>, CoreError> {
        let deviation = finite("measurement", measurement[0])? - finite("prediction", *prediction)?;
        Ok(Some(Sign::of(deviation.abs(), self.reach)?))
    }

    fn factor(&self, prediction: &f64, observation: &Observation<Sign>, link: &Link) -> Result<Scalar, CoreError> {
        let given = |sent| match observation {
            Observation::Received(sign) if *sign == sent => link.arrival() * (1.0 - link.crossover()),
            _ => link.arrival() * link.crossover(),
        };
        if observation.received().is_none() {
            return Ok(Constant::of_delivery(observation, link).into());
        }
        let edges = vec![prediction - self.reach, prediction + self.reach];
        let given_cell = vec![given(Sign::Above), given(Sign::Below), given(Sign::Above)];
        Ok(Partition::new(edges, given_cell, NOISE)?.into())
    }
}

#[test]
fn the_scheme_obeys_the_laws() {
    let (scheme, link) = (TwoSided { reach: 0.9 }, Link::new(0.2, 0.1).unwrap().with_erasure(0.1).unwrap());
    let measurements = [-3.0, -0.5, 0.2, 1.4, 40.0].map(Vector1::new);
    laws::scheme::total_probability(&scheme, &0.3, &link, [Sign::Below, Sign::Above], &measurements).unwrap();
    let mut rng = Stream::new(3).fast_rng();
    let noise = |rng: &mut rand_pcg::Pcg64Mcg| Vector1::new(NOISE.sqrt() * rng.sample::<f64, _>(StandardNormal));
    for m in &measurements[1..4] {
        let reports = [Sign::Below, Sign::Above];
        laws::scheme::frequencies(&scheme, &0.3, &link, &mut rng, 20_000, m, noise, reports).unwrap();
    }
}

/// Final mean, variance and log-likelihood, and all observations, of one loop. The broadcast ignores the belief, so that every
/// filter sees the same.
fn run<F>(filter: &F, belief: F::Belief) -> (f64, f64, f64, Vec<Observation<Sign>>)
where
    F: Filter<1, Ar1, Observed<LinearSensor<1, 1>, Scalar, 1>>,
{
    let sensors = [LinearSensor::direct(NOISE).unwrap(); 3];
    let closed = ClosedLoop {
        dynamics: &Ar1::new(0.9, 0.6).unwrap(),
        sensors: &sensors,
        scheme: &TwoSided { reach: 0.9 },
        link: Link::new(0.2, 0.05).unwrap(),
        filter,
        broadcast: |_: &Gaussian<1>| 0.5,
    };
    let (mut world, mut rng) = (Stream::new(5).named("world").rng(), Stream::new(5).named("filter").fast_rng());
    let mut state = closed.start(Vector1::new(0.7), belief);
    let (mut log_likelihood, mut seen) = (0.0, Vec::new());
    for _ in 0..12 {
        let slot = closed.step(&mut world, &mut rng, &mut state).unwrap();
        assert_eq!((slot.report_bits, slot.feedback_bits), (3, 3 * 32));
        log_likelihood += slot.log_likelihood;
        seen.extend(slot.observations);
    }
    (state.belief.mean()[0], state.belief.covariance()[0], log_likelihood, seen)
}

#[test]
fn every_filter_agrees_with_the_grid() {
    let start = Gaussian::scalar(0.0, 2.0).unwrap();
    let grid = Grid::symmetric(12.0, 0.1).unwrap();
    let referee = PointMassFilter::new(&Ar1::new(0.9, 0.6).unwrap(), grid).unwrap();
    let (mean, variance, evidence, seen) = run(&referee, PointMass::normal(grid, 0.0, 2.0).unwrap());
    assert!(seen.contains(&Observation::Nothing) && seen.contains(&Observation::Received(Sign::Above)));
    let mut rng = Stream::new(9).fast_rng();
    let agree = |name: &str, found: (f64, f64, f64, Vec<Observation<Sign>>), slack: f64| {
        assert_eq!(found.3, seen, "{name}");
        let off = [found.0 - mean, found.1 - variance, found.2 - evidence];
        assert!(off.iter().all(|d| d.abs() < slack), "{name}: {off:?}");
    };
    let particles = Particles::from_belief(&mut rng, &start, 40_000).unwrap();
    agree("particle", run(&ParticleFilter::default(), particles), 0.15);
    agree(
        "Rao-Blackwellised",
        run(&RaoBlackwellised::default(), GaussianCloud::agreed(&start, 20_000).unwrap()),
        0.15,
    );
    // Two-sided bits make beliefs of two peaks, which a Gaussian blurs: it must see the same and stay near the evidence.
    let found = run(&AssumedDensity, start);
    assert_eq!(found.3, seen);
    assert!((found.2 - evidence).abs() < 1.0, "{}", found.2 - evidence);
}

#[test]
fn a_failed_slot_leaves_the_belief() {
    struct Broken;
    impl<G: LinearDynamics<1>, O> Filter<1, G, O> for Broken {
        type Belief = Gaussian<1>;
        type Workspace = ();
        fn advance<R: Rng + ?Sized>(
            &self,
            _: &mut R,
            _: &G,
            belief: &mut Gaussian<1>,
            (): &mut (),
        ) -> Result<(), fewbits_filters::Error> {
            *belief = Gaussian::scalar(9.0, 1.0)?;
            Ok(())
        }
        fn absorb<R: Rng + ?Sized>(
            &self,
            _: &mut R,
            _: &mut Gaussian<1>,
            _: &O,
            (): &mut (),
        ) -> Result<f64, fewbits_filters::Error> {
            Err(CoreError::Impossible.into())
        }
    }
    let before = Gaussian::scalar(1.0, 2.0).unwrap();
    let closed = ClosedLoop {
        dynamics: &Ar1::new(0.9, 0.6).unwrap(),
        sensors: &[LinearSensor::direct(NOISE).unwrap()],
        scheme: &TwoSided { reach: 0.9 },
        link: Link::PERFECT,
        filter: &Broken,
        broadcast: |predicted: &Gaussian<1>| predicted.mean()[0],
    };
    let mut state = closed.start(Vector1::new(0.0), before);
    let mut rng = Stream::new(1).fast_rng();
    assert!(closed.step(&mut rng.clone(), &mut rng, &mut state).is_err());
    assert_eq!(state.belief, before);
    assert_eq!(Sign::Above.to_bits(&()).unwrap().bits(), 1);
}
