//! A call of a centre that fails leaves it as it was, by the bytes of its state; stored between prediction and update, it goes on with the same
//! bits.

use fewbits_core::{BitString, FullValue, Gaussian, Link, Message, NumberFormat, Observation, OnAxes};
use fewbits_filters::centre::{CentreState, Event, Failures, FusionCentre, Health, NoiseLearning, Reporting, Slot};
use fewbits_filters::{
    BootstrapFilter, GridFilter, Imm, MomentFilter, PointMassFilter, RaoBlackwellised, ResamplingRule,
    SigmaPointFilter, StateFilter, UniformGrid, smoother,
};
use fewbits_models::{Ar1, ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::Stream;
use proptest::prelude::*;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Numbers of the sensors.
const SENSORS: [u32; 3] = [2, 5, 9];

fn centre<F: StateFilter<1>>(filter: F, rng: &mut dyn Rng, health: Health) -> FusionCentre<1, F> {
    let world = ContinuousLinear::ornstein_uhlenbeck(0.0, 20.0, 2.0).unwrap();
    let mut centre = FusionCentre::new(rng, world, filter, &Gaussian::scalar(0.0, 2.0).unwrap())
        .unwrap()
        .with_health(health)
        .with_window(5.0)
        .unwrap()
        .learning_noise(NoiseLearning::DEFAULT)
        .unwrap()
        .reacquire_from(Gaussian::scalar(0.0, 4.0).unwrap());
    for number in SENSORS {
        let sensing = OnAxes::new(LinearSensor::direct(0.5).unwrap(), [0]).unwrap();
        let link = Link::lossy(0.1).unwrap();
        centre
            .join(number, Reporting::values(sensing, FullValue::new(0.5).unwrap(), link))
            .unwrap();
    }
    centre
}

fn value(number: f64) -> Observation<BitString> {
    Observation::Received(Message::to_bits(&number, &NumberFormat::Double).unwrap())
}

/// A slot that may hold anything: an unknown sensor, a question that none was asked, bits that are no report.
fn wild(rng: &mut dyn Rng) -> Slot {
    let number = SENSORS[rng.random_range(0..3)];
    let sensor = if rng.random_range(0..12) == 0 { 7 } else { number };
    let mut junk = |bits: usize| {
        let bytes = (0..bits.div_ceil(8)).map(|_| rng.random::<u8>()).collect();
        BitString::from_bytes(bytes, bits).unwrap_or_default()
    };
    let (feedback, report) = (junk(8), junk(64));
    let feedback = if rng.random_range(0..12) == 0 {
        feedback
    } else {
        BitString::default()
    };
    let observation = match rng.random_range(0..6) {
        0 => Observation::Nothing,
        1 => Observation::Lost,
        2 => Observation::Received(report),
        // What is no number is among the junk.
        3 => value(
            Some(f64::from_bits(rng.random()))
                .filter(|x| x.is_finite())
                .unwrap_or(1e300),
        ),
        _ => value(rng.sample::<f64, _>(StandardNormal)),
    };
    Slot::new(sensor, feedback, observation)
}

/// Every call that fails leaves the bytes of the state.
fn stays<F: StateFilter<1, Belief: Serialize>>(name: &str, filter: F, seed: u64) -> usize {
    let mut rng = Stream::new(seed).named(name).rng();
    let health = [Health::Off, Health::Report, Health::Exclude][seed as usize % 3];
    let (mut centre, mut failures) = (centre(filter, &mut rng, health), 0);
    for k in 1..30 {
        let before = centre.state().to_bytes().unwrap();
        let time = match rng.random_range(0..8) {
            0 => f64::from_bits(rng.random()),
            1 => centre.time() - 0.5,
            _ => centre.time() + 1.0,
        };
        let slots: Vec<Slot> = (0..rng.random_range(1..4)).map(|_| wild(&mut rng)).collect();
        let failed = match rng.random_range(0..4) {
            0 => centre.late(&mut rng, time, &slots).is_err(),
            1 => centre.advance(&mut rng, time).is_err(),
            _ => centre.receive(&mut rng, &slots).is_err(),
        };
        if failed {
            failures += 1;
            assert!(centre.state().to_bytes().unwrap() == before, "{name} {seed}, call {k}");
        }
        let estimate = centre.estimate();
        assert!(estimate.is_finite(), "{name} {seed}, call {k}: {estimate:?}");
    }
    failures
}

fn grid() -> UniformGrid {
    UniformGrid::symmetric(9.0, 0.2).unwrap()
}

fn particles() -> ResamplingRule {
    ResamplingRule::default()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(4), ..ProptestConfig::default() })]
    #[test]
    fn a_call_that_fails_leaves_the_centre_as_it_was(seed in any::<u64>()) {
        stays("moments", MomentFilter, seed);
        stays("masses", PointMassFilter::new(grid()), seed);
        stays("grid", GridFilter::<1, 1>::new([0]).unwrap(), seed);
        stays("bootstrap", BootstrapFilter::new(particles(), 50).unwrap(), seed);
        stays("cloud", RaoBlackwellised::new(particles(), 30).unwrap(), seed);
        stays("bank", Imm::new(MomentFilter, vec![0.25, 1.0, 4.0], 0.05).unwrap(), seed);
    }
}

#[test]
fn calls_do_fail() {
    let failures: usize = (0..30).map(|seed| stays("moments", MomentFilter, seed)).sum();
    assert!(failures > 50, "{failures}");
}

/// Runs 40 instants; at `stored`, the state goes through bytes into a new centre between prediction and update.
fn run<F>(filter: &impl Fn() -> F, stored: Option<u32>) -> (Vec<u8>, Vec<Event>)
where
    F: StateFilter<1, Belief: Serialize + DeserializeOwned>,
{
    let (mut rng, mut draws) = (Stream::new(3).rng(), Stream::new(4).rng());
    let mut one = centre(filter(), &mut draws, Health::Exclude);
    let mut events = Vec::new();
    for k in 1..=40 {
        one.advance(&mut draws, f64::from(k)).unwrap();
        if stored == Some(k) {
            let bytes = one.state().to_bytes().unwrap();
            let mut other = centre(filter(), &mut Stream::new(9).rng(), Health::Exclude);
            other.restore(CentreState::from_bytes(&bytes).unwrap()).unwrap();
            one = other;
        }
        let mut slots: Vec<Slot> = SENSORS
            .iter()
            .map(|number| Slot::new(*number, BitString::default(), value(rng.sample(StandardNormal))))
            .collect();
        if k > 20 {
            slots[1] = Slot::new(5, BitString::default(), value(30.0));
        }
        events.extend(one.receive(&mut draws, &slots).unwrap().events);
        if k % 9 == 0 {
            let late = Slot::new(2, BitString::default(), value(rng.sample(StandardNormal)));
            one.late(&mut draws, f64::from(k) - 1.5, &[late]).unwrap();
        }
    }
    (one.state().to_bytes().unwrap(), events)
}

fn goes_on<F>(name: &str, filter: impl Fn() -> F)
where
    F: StateFilter<1, Belief: Serialize + DeserializeOwned>,
{
    let whole = run(&filter, None);
    for stored in [1, 10, 22, 40] {
        assert!(run(&filter, Some(stored)) == whole, "{name}, stored at {stored}");
    }
}

#[test]
fn a_centre_stored_between_prediction_and_update_goes_on_with_the_same_bits() {
    goes_on("moments", || MomentFilter);
    goes_on("masses", || PointMassFilter::new(grid()));
    goes_on("grid", || GridFilter::<1, 1>::new([0]).unwrap());
    goes_on("bootstrap", || BootstrapFilter::new(particles(), 200).unwrap());
    goes_on("cloud", || RaoBlackwellised::new(particles(), 100).unwrap());
    goes_on("bank", || Imm::new(MomentFilter, vec![0.25, 1.0, 4.0], 0.05).unwrap());
}

/// A centre without tests takes a single report in fewer steps than one that keeps what it would need for late reports. Both are the same to
/// the bit, whatever arrives.
#[test]
fn one_report_is_taken_as_one_of_many() {
    let mut rng = Stream::new(3).fast_rng();
    let made = |rng: &mut dyn Rng, window: f64, rate: f64| {
        let world = ContinuousLinear::nearly_constant_velocity(0.1).unwrap();
        let prior = Gaussian::new([0.0, 0.0].into(), nalgebra::Matrix2::identity() * 9.0).unwrap();
        let failures = Failures {
            rate,
            ..Failures::default()
        };
        let mut centre = FusionCentre::new(rng, world, MomentFilter, &prior)
            .unwrap()
            .with_health(Health::Off)
            .with_failures(failures)
            .unwrap()
            .with_window(window)
            .unwrap();
        for number in SENSORS {
            let sensing = LinearSensor::scalar([1.0, 0.3].into(), 0.5).unwrap();
            let link = Link::lossy(0.1).unwrap();
            centre
                .join(number, Reporting::values(sensing, FullValue::new(0.5).unwrap(), link))
                .unwrap();
        }
        centre
    };
    for rate in [0.0, 0.01] {
        let (mut short, mut long) = (made(&mut rng, 0.0, rate), made(&mut rng, 0.5, rate));
        for step in 0..400 {
            let slot = match step % 7 {
                0 => wild(&mut rng),
                _ => {
                    let number = 3.0 * rng.sample::<f64, _>(StandardNormal) + 1e200 * f64::from(u8::from(step == 300));
                    Slot::new(SENSORS[step % 3], BitString::default(), value(number))
                }
            };
            let time = step as f64 * 0.3;
            short.advance(&mut rng, time).unwrap();
            long.advance(&mut rng, time).unwrap();
            let (one, other) = (
                short.receive(&mut rng, std::slice::from_ref(&slot)),
                long.receive(&mut rng, std::slice::from_ref(&slot)),
            );
            assert_eq!(format!("{one:?}"), format!("{other:?}"), "step {step}");
            assert_eq!(short.estimate(), long.estimate(), "step {step}");
            for number in SENSORS {
                assert_eq!(short.sensor(number).unwrap(), long.sensor(number).unwrap(), "step {step}");
            }
        }
    }
}

/// Defect: finite arguments near the largest number gave infinite moments.
#[test]
fn moments_that_overflow_are_refused() {
    let wide = || ContinuousLinear::random_walk(1.7e308).unwrap();
    let mut rng = Stream::new(3).rng();
    let prior = Gaussian::scalar(0.0, 1.0).unwrap();
    let mut centre = FusionCentre::new(&mut rng, wide(), MomentFilter, &prior).unwrap();
    centre.advance(&mut rng, 1.0).unwrap();
    let before = centre.state();
    let error = centre.advance(&mut rng, 2.0).map(drop).unwrap_err().to_string();
    assert!(error.contains("time") && error.contains('2') && error.contains("finite"), "{error}");
    assert!(centre.state() == before);
    let over = wide().over(1.0).unwrap();
    let far = Gaussian::scalar(0.0, 1.7e308).unwrap();
    assert!(MomentFilter.predict(&mut rng, &over, &mut far.clone()).is_err());
    assert!(
        GridFilter::new([0])
            .unwrap()
            .predict(&mut rng, &over, &mut far.clone())
            .is_err()
    );
    let mut points = SigmaPointFilter::<1>::cubature().unwrap();
    let mut belief = points.start(&mut rng, &far).unwrap();
    assert!(points.predict(&mut rng, &over, &mut belief).is_err());
    let still = Ar1::new(1.0, 1.0).unwrap();
    assert!(smoother::smooth_step(&still, &Gaussian::scalar(1.7e308, 1.0).unwrap(), &far).is_ok());
    let opposite = [1.7e308, -1.7e308].map(|mean| Gaussian::scalar(mean, 1.0).unwrap());
    assert!(smoother::smooth_step(&still, &opposite[0], &opposite[1]).is_err());
}
