//! One scheme, two-sided bits over a link that loses and inverts, through every filter of the contract.

use fewbits_core::factor::{Constant, Levels, Scalar, Value};
use fewbits_core::rand::Rng;
use fewbits_core::{
    Belief, Deterministic, Dynamics, Error as CoreError, Evolution, Gaussian, Likelihood, Link, NumberFormat,
    Observation, Observed, Scheme, Sensing, Sign, laws,
};
use fewbits_filters::{
    BootstrapFilter, Error, GridFilter, GuidedFilter, Imm, MomentFilter, PointMassFilter, RaoBlackwellised,
    ResamplingRule, StateFilter, Switching, UniformGrid, assumed_density,
};
use fewbits_models::{Ar1, ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::error::finite;
use nalgebra::Vector1;
use rand::RngExt;
use rand_distr::StandardNormal;

const NOISE: f64 = 0.5;

/// One bit: is the measurement further than `reach` from the broadcast prediction?
struct TwoSided {
    reach: f64,
}

impl Deterministic<1> for TwoSided {}

impl Scheme<1> for TwoSided {
    type State = ();
    type Feedback = f64;
    type Report = Sign;
    type Factor = Scalar;

    fn feedback_format(&self) -> NumberFormat {
        NumberFormat::Single
    }

    fn report_format(&self) {}

    fn encode(
        &self,
        _: &mut dyn Rng,
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
        Ok(Levels::partition(&edges, &given_cell, NOISE)?.into())
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

type Slot = Vec<Observed<LinearSensor<1, 1>, Scalar, 1>>;

/// Twelve slots of three sensors. All are told the same, so that every filter sees the same.
fn slots() -> Vec<Slot> {
    let (scheme, link, sensor) =
        (TwoSided { reach: 0.9 }, Link::new(0.2, 0.05).unwrap(), LinearSensor::direct(NOISE).unwrap());
    let (mut rng, mut state) = (Stream::new(5).rng(), Vector1::new(0.7));
    let mut slot = || {
        state = Ar1::new(0.9, 0.6).unwrap().propagate(&mut rng, &state);
        let mut sense = |_| {
            let sample = sensor.sample(&mut rng, &state);
            let report = scheme.encode(&mut rng, &mut (), &sample, &0.5).unwrap();
            let observation = link.transmit(&mut rng, report.as_ref(), &()).unwrap();
            Observed::new(sensor, scheme.factor(&0.5, &observation, &link).unwrap())
        };
        (0..3).map(&mut sense).collect()
    };
    (0..12).map(|_| slot()).collect()
}

/// Final mean, variance and log-likelihood.
fn run<F: StateFilter<1>>(mut filter: F) -> [f64; 3] {
    let (dynamics, mut rng) = (Ar1::new(0.9, 0.6).unwrap(), Stream::new(5).named("filter").fast_rng());
    let mut belief = filter.start(&mut rng, &Gaussian::scalar(0.0, 2.0).unwrap()).unwrap();
    let mut log_likelihood = 0.0;
    for slot in slots() {
        let slot: Vec<&dyn Likelihood<1>> = slot.iter().map(|one| one as _).collect();
        let (next, info) = filter.step(&mut rng, &dynamics, &belief, &slot).unwrap();
        (belief, log_likelihood) = (next, log_likelihood + info.log_likelihood);
    }
    [belief.mean()[0], belief.covariance()[0], log_likelihood]
}

#[test]
fn every_filter_agrees_with_the_grid() {
    let exact = run(PointMassFilter::new(UniformGrid::symmetric(12.0, 0.1).unwrap()));
    let agree = |name: &str, found: [f64; 3], slack: f64| {
        let off: [f64; 3] = std::array::from_fn(|i| found[i] - exact[i]);
        assert!(off.iter().all(|d| d.abs() < slack), "{name}: {off:?}");
    };
    let filter = ResamplingRule::default();
    agree("bootstrap", run(BootstrapFilter::new(filter, 40_000).unwrap()), 0.15);
    agree("guided", run(GuidedFilter::new(filter, 20_000).unwrap()), 0.15);
    agree("Rao-Blackwellised", run(RaoBlackwellised::new(filter, 20_000).unwrap()), 0.15);
    // Two-sided bits make beliefs of two peaks, which a Gaussian blurs: it stays near the evidence.
    for blurred in [run(MomentFilter), run(GridFilter::<1, 1>::new([0]).unwrap())] {
        assert!((blurred[2] - exact[2]).abs() < 1.0, "{}", blurred[2] - exact[2]);
    }
}

fn refused<F: StateFilter<1>>(mut filter: F)
where
    F::Belief: PartialEq + std::fmt::Debug,
{
    let mut rng = Stream::new(1).fast_rng();
    let before = filter.start(&mut rng, &Gaussian::scalar(1.0, 2.0).unwrap()).unwrap();
    let sensor = LinearSensor::direct(NOISE).unwrap();
    let [fine, never] = [1.0, 0.0].map(|p| Observed::new(sensor, Scalar::from(Constant::new(p).unwrap())));
    let mut belief = before.clone();
    let found = filter.update(&mut rng, &mut belief, &[&fine, &never]);
    assert!(matches!(found, Err(Error::Impossible)), "{found:?}");
    assert_eq!(belief, before);
    let info = filter.update(&mut rng, &mut belief, &[]).unwrap();
    assert!(info.log_likelihood.abs() < 1e-12);
}

#[test]
fn what_is_impossible_leaves_every_belief_as_it_was() {
    let filter = ResamplingRule::default();
    refused(MomentFilter);
    refused(GridFilter::<1, 1>::new([0]).unwrap());
    refused(PointMassFilter::new(UniformGrid::symmetric(12.0, 0.1).unwrap()));
    refused(BootstrapFilter::new(filter, 50).unwrap());
    refused(GuidedFilter::new(filter, 50).unwrap());
    refused(RaoBlackwellised::new(filter, 50).unwrap());
    refused(Imm::new(MomentFilter, vec![1.0, 2.0], 0.1).unwrap());
}

#[test]
fn a_bank_of_equal_filters_is_that_of_one_and_odd_matrices_are_refused() {
    let scales = [0.5, 2.0];
    let filters = || scales.map(|scale| (MomentFilter, scale)).to_vec();
    // An even switch of probability .1 between two: .05 to the other.
    let mut own = Imm::<1, MomentFilter>::of(filters(), &[vec![0.95, 0.05], vec![0.05, 0.95]]).unwrap();
    let mut same = Imm::<1, _>::new(MomentFilter, scales.to_vec(), 0.1).unwrap();
    let (mut rng, prior) = (Stream::new(3).rng(), Gaussian::scalar(0.0, 1.0).unwrap());
    let (sensor, world) =
        (LinearSensor::direct(0.1).unwrap(), ContinuousLinear::ornstein_uhlenbeck(0.0, 2.0, 1.0).unwrap());
    let mut beliefs = [
        own.start(&mut rng, &prior).unwrap(),
        same.start(&mut rng, &prior).unwrap(),
    ];
    for z in [0.4, -1.1, 3.0] {
        let observed = Observed::new(sensor, Value::new(Vector1::new(z), nalgebra::Matrix1::new(0.1)).unwrap());
        let motion = Evolution::over(&world, 0.7).unwrap();
        for (bank, belief) in [&mut own, &mut same].into_iter().zip(&mut beliefs) {
            bank.predict(&mut rng, &*motion, belief).unwrap();
            bank.update(&mut rng, belief, &[&observed]).unwrap();
        }
    }
    let [a, b] = beliefs.map(|belief| belief.probabilities()[1]);
    assert!((a - b).abs() < 1e-12 && (a - 0.5).abs() > 0.01, "{a} {b}");
    for transition in [
        vec![vec![1.0]],
        vec![vec![0.5, 0.6], vec![0.5, 0.5]],
        vec![vec![1.0, 0.0], vec![1.0]],
    ] {
        assert!(Imm::<1, MomentFilter>::of(filters(), &transition).is_err(), "{transition:?}");
    }
    assert!(Imm::<1, MomentFilter>::of(Vec::new(), &[]).is_err());
}

/// A quick and a slow world: the bank of both is the interacting-multiple-model filter, here without switching a bank of two Kalman
/// filters with Bayes' weights, over any stretch of time.
#[test]
fn a_bank_over_switching_worlds_weighs_them_by_evidence() {
    let worlds = [5.0, 0.5].map(|tau| ContinuousLinear::ornstein_uhlenbeck(0.0, tau, 1.0).unwrap());
    let both = worlds.map(|world| Box::new(world) as Box<dyn Evolution<1>>);
    let switching = Switching::new(both.into()).unwrap();
    let mut filter = Imm::new(MomentFilter, vec![1.0; 2], 0.0).unwrap();
    let (mut rng, sensor) = (Stream::new(2).rng(), LinearSensor::direct(0.1).unwrap());
    let start = Gaussian::scalar(0.0, 1.0).unwrap();
    let mut belief = filter.start(&mut rng, &start).unwrap();
    let mut alone = [(start, 0.5_f64.ln()); 2];
    for k in 0..60 {
        let seconds = 0.1 + 0.05 * f64::from(k % 7);
        let z = (0.3 * f64::from(k)).sin();
        let observed = Observed::new(sensor, Value::scalar(z, 0.1).unwrap());
        let motion = switching.over(seconds).unwrap();
        belief = filter.step(&mut rng, &*motion, &belief, &[&observed]).unwrap().0;
        for ((one, log), world) in alone.iter_mut().zip(&worlds) {
            let predicted = assumed_density::predict(&*Evolution::over(world, seconds).unwrap(), one);
            let (next, info) = assumed_density::update_through(&predicted, &observed).unwrap();
            (*one, *log) = (next, *log + info.log_likelihood);
        }
    }
    let weight = 1.0 / (1.0 + (alone[1].1 - alone[0].1).exp());
    assert!((belief.probabilities()[0] - weight).abs() < 1e-9, "{} {weight}", belief.probabilities()[0]);
    assert!((belief.modes()[1].mean() - alone[1].0.mean()).amax() < 1e-9);
    assert!(
        Imm::new(MomentFilter, vec![1.0; 3], 0.0)
            .unwrap()
            .step(
                &mut rng,
                &*switching.over(1.0).unwrap(),
                &fewbits_filters::ImmBelief::agreed(&start, 3).unwrap(),
                &[]
            )
            .is_err()
    );
}
