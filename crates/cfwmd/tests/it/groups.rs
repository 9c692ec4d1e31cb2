//! A network in a fusion centre: identical silent sensors are one likelihood with a count.

use crate::Instant;
use fewbits_cfwmd::network::Network;
use fewbits_core::nalgebra::{Matrix2, Vector1, Vector2};
use fewbits_core::{Belief, Evolution, Gaussian, Link, Message, NumberFormat, Observation, Sensing};
use fewbits_filters::centre::{Failures, FusionCentre, Slot};
use fewbits_filters::{BootstrapFilter, MomentFilter, ResamplingRule, StateFilter};
use fewbits_models::{ContinuousLinear, LinearSensor, ScalarSensor};
use fewbits_monte_carlo::Stream;

const SENSORS: usize = 5;

fn network(loss: f64, format: NumberFormat) -> Network<ScalarSensor<2>, 2, 1> {
    let position = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
    let speed = LinearSensor::scalar(Vector2::new(0.0, 1.0), 0.5).unwrap();
    let sensors = vec![position, position, speed, position, speed];
    Network::new(sensors, 1.2, Link::lossy(loss).unwrap())
        .unwrap()
        .with_format(format)
}

fn prior() -> Gaussian<2> {
    Gaussian::new(Vector2::new(0.0, 1.0), Matrix2::new(2.0, 0.3, 0.3, 1.0)).unwrap()
}

fn world() -> ContinuousLinear<2> {
    ContinuousLinear::nearly_constant_velocity(0.4).unwrap()
}

fn centre<F: StateFilter<2>>(filter: F, rate: f64) -> FusionCentre<2, F> {
    let mut centre = FusionCentre::new(&mut Stream::new(1).rng(), world(), filter, &prior()).unwrap();
    let failures = Failures {
        rate,
        ..Failures::default()
    };
    centre = centre.with_failures(failures).unwrap();
    network(0.1, NumberFormat::Double).join(&mut centre).unwrap();
    centre
}

/// What arrives in slot `k` of all sensors: values, silence, and losses that were noticed.
fn observed(
    k: u64,
    rules: &[fewbits_cfwmd::rule::CensoringRule<1>],
    predicted: &Gaussian<2>,
) -> Vec<Observation<Vector1<f64>>> {
    let mut rng = Stream::new(7).indexed(k).rng();
    let truth = predicted.sample(&mut rng);
    let network = network(0.1, NumberFormat::Double);
    let measurements: Vec<_> = network
        .sensors()
        .iter()
        .map(|sensor| sensor.sample(&mut rng, &truth))
        .collect();
    network
        .transmit(&mut rng, rules, predicted.mean(), &measurements)
        .unwrap()
        .0
}

fn agree(one: &Gaussian<2>, other: &Gaussian<2>) {
    let off = (one.mean() - other.mean())
        .amax()
        .max((one.covariance() - other.covariance()).amax());
    assert!(off < 1e-11, "{one:?} against {other:?}");
}

/// A centre takes the same steps as conditioning on the likelihoods of the instant.
#[test]
fn a_centre_of_a_network_conditions_on_one_likelihood_per_group() {
    let (mut rng, network) = (Stream::new(2).rng(), network(0.1, NumberFormat::Double));
    let mut centre = centre(MomentFilter, 0.0);
    let (mut belief, mut silences) = (prior(), 0);
    for k in 1..=40_u32 {
        belief = Evolution::over(&world(), 1.0).unwrap().predict(&belief, 1.0);
        centre.advance(&mut rng, f64::from(k)).unwrap();
        agree(&centre.estimate(), &belief);
        let rules = network.rules_under(&belief).unwrap();
        let observations = observed(u64::from(k), &rules, &belief);
        silences += observations.iter().filter(|one| **one == Observation::Nothing).count();
        let slots: Vec<Slot> = (0..)
            .zip(&observations)
            .map(|(number, one)| {
                let bits = match one {
                    Observation::Received(value) => {
                        Observation::Received(value.to_bits(&NumberFormat::Double).unwrap())
                    }
                    Observation::Nothing => Observation::Nothing,
                    Observation::Lost => Observation::Lost,
                };
                Slot::new(number, centre.feedback(number).unwrap(), bits)
            })
            .collect();
        let (next, found) = network.fuse(&belief, &rules, belief.mean(), &observations).unwrap();
        belief = next;
        let info = centre.receive(&mut rng, &slots).unwrap().info;
        agree(&centre.estimate(), &belief);
        assert!((info.log_likelihood - found.log_likelihood).abs() < 1e-9, "slot {k}");
    }
    assert!(silences > 2 * SENSORS, "{silences} silences");
}

/// Silence that arrives late is one likelihood, too.
#[test]
fn late_silence_of_a_group_is_as_good_as_in_time() {
    let mut rng = Stream::new(4).rng();
    let new = || centre(MomentFilter, 0.0).with_window(5.0).unwrap();
    let (mut in_time, mut late) = (new(), new());
    for one in [&mut in_time, &mut late] {
        one.advance(&mut rng, 0.5).unwrap().receive(&mut rng, &[]).unwrap();
    }
    let told = in_time.advance(&mut rng, 1.0).unwrap().feedback(0).unwrap();
    let silent = |number| Slot::new(number, told.clone(), Observation::Nothing);
    let first: Vec<Slot> = (0..SENSORS as u32).map(silent).collect();
    in_time.receive(&mut rng, &first).unwrap();
    let told = in_time.advance(&mut rng, 2.0).unwrap().feedback(0).unwrap();
    let far = Vector1::new(in_time.estimate().mean()[0] + 4.0)
        .to_bits(&NumberFormat::Double)
        .unwrap();
    let second = [Slot::new(0, told, Observation::Received(far))];
    in_time.receive(&mut rng, &second).unwrap();
    late.advance(&mut rng, 2.0).unwrap().receive(&mut rng, &second).unwrap();
    let before = late.estimate();
    assert!(late.late(&mut rng, 1.0, &first).unwrap());
    assert!((late.estimate().mean() - in_time.estimate().mean()).amax() < 1e-12);
    assert!((late.estimate().covariance() - in_time.estimate().covariance()).amax() < 1e-12);
    assert!((before.mean() - late.estimate().mean()).amax() > 1e-3, "silence told something");
}

/// Particles under the same centre find the moments of the Gaussian one after an instant of silence.
#[test]
fn silence_of_a_group_weighs_particles() {
    const PARTICLES: usize = 40_000;
    let silent = |number| Slot::new(number, Default::default(), Observation::Nothing);
    fn after<F: StateFilter<2>>(filter: F, slot: impl Fn(u32) -> Slot) -> Gaussian<2> {
        let (mut rng, mut centre) = (Stream::new(3).rng(), centre(filter, 1e-2));
        centre.advance(&mut rng, 1.0).unwrap();
        // All are told the same: one broadcast.
        let told = centre.feedback(0).unwrap();
        let slots: Vec<Slot> = (0..SENSORS as u32)
            .map(|number| Slot {
                feedback: told.clone(),
                ..slot(number)
            })
            .collect();
        centre.receive(&mut rng, &slots).unwrap();
        centre.estimate()
    }
    let exact = after(MomentFilter, silent);
    let cloud = after(BootstrapFilter::new(ResamplingRule::default(), PARTICLES).unwrap(), silent);
    let n = PARTICLES as f64 / 4.0;
    for d in 0..2 {
        let variance = exact.covariance()[(d, d)];
        assert!(
            variance
                < 0.8
                    * Evolution::over(&world(), 1.0)
                        .unwrap()
                        .predict(&prior(), 1.0)
                        .covariance()[(d, d)]
        );
        assert!((cloud.mean()[d] - exact.mean()[d]).abs() < 4.0 * (variance / n).sqrt() + 0.01);
        assert!((cloud.covariance()[(d, d)] / variance - 1.0).abs() < 4.0 * (2.0 / n).sqrt() + 0.02);
    }
}

/// The rule of a slot, known to both ends, is renewed in each; what is known of the sensor stays.
#[test]
fn a_rule_that_changes_from_slot_to_slot_is_renewed() {
    let (mut rng, network) = (Stream::new(2).rng(), network(0.1, NumberFormat::Double));
    let mut centre = centre(MomentFilter, 1e-4);
    let mut belief = prior();
    for k in 1..=6_u32 {
        centre.advance(&mut rng, f64::from(k)).unwrap();
        let working = centre.sensor(0).unwrap().working;
        belief = centre.estimate();
        let rules = network.rules_under(&belief).unwrap();
        for (number, rule) in (0..).zip(&rules) {
            centre
                .renew(number, network.remote_under(number as usize, rule).unwrap())
                .unwrap();
        }
        assert_eq!(centre.sensor(0).unwrap().working, working);
        let told = centre.feedback(0).unwrap();
        assert_eq!(told.bits(), 128, "two numbers, no covariance");
        let slots: Vec<Slot> = (0..SENSORS as u32)
            .map(|number| Slot::new(number, told.clone(), Observation::Nothing))
            .collect();
        centre.receive(&mut rng, &slots).unwrap();
        assert!(centre.sensor(0).unwrap().working < 1.0);
    }
    assert!(centre.estimate().covariance()[(0, 0)] < belief.covariance()[(0, 0)]);
    let rule = network.rules_under(&belief).unwrap().remove(0);
    assert!(
        centre.renew(9, network.remote_under(0, &rule).unwrap()).is_err() && network.remote_under(5, &rule).is_err()
    );
}
