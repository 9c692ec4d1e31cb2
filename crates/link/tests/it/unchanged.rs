//! A call of a centre that fails leaves it as it was, by the bytes of its state: every pair of scheme and question, under several filters,
//! with questions, reports and times that may be anything.

use crate::pairs::pairs;
use fewbits_core::{BitString, Evolution, Gaussian, Observation, SensorNode};
use fewbits_filters::centre::{FusionCentre, Health, NoiseLearning, Slot};
use fewbits_filters::{BootstrapFilter, GridFilter, GuidedFilter, Imm, MomentFilter, ResamplingRule, StateFilter};
use fewbits_models::ContinuousLinear;
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix4, Vector4};
use rand::{Rng, RngExt};
use serde::Serialize;

fn junk(rng: &mut dyn Rng, bits: usize) -> BitString {
    let mut bytes: Vec<u8> = (0..bits.div_ceil(8)).map(|_| rng.random::<u8>()).collect();
    // What is behind the last bit must be zero.
    if let Some(last) = bytes.last_mut().filter(|_| !bits.is_multiple_of(8)) {
        *last &= 0xff << (8 - bits % 8);
    }
    BitString::from_bytes(bytes, bits).unwrap_or_default()
}

/// The same bits with one inverted; a bit of junk if there is none.
fn changed(rng: &mut dyn Rng, bits: &BitString) -> BitString {
    if bits.bits() == 0 {
        return junk(rng, 1);
    }
    let (at, mut bytes) = (rng.random_range(0..bits.bits()), bits.bytes().to_vec());
    bytes[at / 8] ^= 0x80 >> (at % 8);
    BitString::from_bytes(bytes, bits.bits()).unwrap()
}

/// Number of failed calls by what was called: `advance`, `receive`, `late`.
fn stays<F: StateFilter<4, Belief: Serialize>>(name: &str, filter: F, seed: u64) -> [usize; 3] {
    let mut rng = Stream::new(seed).named(name).rng();
    let model = ContinuousLinear::nearly_constant_velocity_2d(0.01).unwrap();
    let prior = Gaussian::new(Vector4::new(0.1, 0.2, -0.3, 0.1), Matrix4::identity() * 0.3).unwrap();
    let health = [Health::Off, Health::Report, Health::Exclude][seed as usize % 3];
    let mut centre = FusionCentre::new(&mut rng, model, filter, &prior)
        .unwrap()
        .with_health(health)
        .with_window(4.0)
        .unwrap()
        .learning_noise(NoiseLearning::DEFAULT)
        .unwrap()
        .reacquire_from(prior);
    let mut halves = Vec::new();
    for (number, pair) in pairs().into_iter().enumerate() {
        centre.join_boxed(number as u32, pair.remote).unwrap();
        halves.push((pair.node, pair.measure));
    }
    let (mut truth, mut failures) = (fewbits_core::Belief::sample(&prior, &mut rng), [0; 3]);
    for k in 1..40 {
        truth = Evolution::over(&model, 1.0).unwrap().propagate(&mut rng, &truth);
        let mut slots = Vec::new();
        for _ in 0..rng.random_range(1..5) {
            let number = rng.random_range(0..halves.len());
            let (node, measure) = &mut halves[number];
            let asked = centre.feedback(number as u32).unwrap_or_default();
            let sample = measure(&mut rng, &truth);
            let report = SensorNode::report(&mut **node, &mut rng, &sample, &asked)
                .ok()
                .flatten();
            let feedback = match rng.random_range(0..6) {
                0 => {
                    let bits = rng.random_range(0..200);
                    junk(&mut rng, bits)
                }
                1 => changed(&mut rng, &asked),
                _ => asked,
            };
            let observation = match (rng.random_range(0..6), report) {
                (0, _) => Observation::Nothing,
                (1, _) => Observation::Lost,
                (2, _) => {
                    let bits = [1, 2, 3, 4, 32, 64, 70][rng.random_range(0..7)];
                    Observation::Received(junk(&mut rng, bits))
                }
                (3, Some(report)) => Observation::Received(changed(&mut rng, &report)),
                (_, Some(report)) => Observation::Received(report),
                (_, None) => Observation::Nothing,
            };
            let sensor = if rng.random_range(0..20) == 0 {
                999
            } else {
                number as u32
            };
            slots.push(Slot::new(sensor, feedback, observation));
        }
        let before = centre.state().to_bytes().unwrap();
        let (called, failed) = match rng.random_range(0..4) {
            0 => {
                let time = match rng.random_range(0..4) {
                    0 => f64::from_bits(rng.random()),
                    1 => centre.time() - 0.5,
                    _ => centre.time() + 1.0,
                };
                (0, centre.advance(&mut rng, time).is_err())
            }
            1 => (2, centre.late(&mut rng, centre.time() - 0.5, &slots).is_err()),
            _ => (1, centre.receive(&mut rng, &slots).is_err()),
        };
        if failed {
            failures[called] += 1;
            assert!(centre.state().to_bytes().unwrap() == before, "{name} {seed}, call {k} of kind {called}");
        }
        assert!(centre.estimate().is_finite(), "{name} {seed}, call {k}");
    }
    failures
}

#[test]
fn failed_calls_leave_a_centre_of_all_schemes_as_it_was() {
    let mut failures = [0; 3];
    let mut add = |found: [usize; 3]| failures.iter_mut().zip(found).for_each(|(all, one)| *all += one);
    for seed in 0..12 {
        add(stays("moments", MomentFilter, seed));
        add(stays("bank", Imm::new(MomentFilter, vec![0.25, 1.0, 4.0], 0.05).unwrap(), seed));
        if seed % 3 == 0 {
            let rule = ResamplingRule::default();
            add(stays("bootstrap", BootstrapFilter::new(rule, 40).unwrap(), seed));
            add(stays("guided", GuidedFilter::new(rule, 40).unwrap(), seed));
        }
        if seed % 6 == 0 {
            add(stays("grid", GridFilter::<4, 2>::new([0, 2]).unwrap(), seed));
        }
    }
    println!("failed calls: {failures:?}");
    assert!(failures.iter().all(|failures| *failures > 20), "{failures:?}");
}
