//! What a fusion centre costs beside the bare updates of its filter.

#![allow(clippy::unwrap_used)]

use divan::{Bencher, black_box};
use fewbits_core::{BitString, Gaussian, Link, Observation, Observed, OnAxes, Scheme, Sign};
use fewbits_dymbo::SignBit;
use fewbits_filters::centre::{FusionCentre, Reporting, Slot};
use fewbits_filters::{MomentFilter, assumed_density};
use fewbits_models::{ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix2, Vector2};
use rand::{Rng, RngExt};

const SENSORS: u32 = 1000;

fn main() {
    divan::main();
}

/// Position and speed, and a sensor of the position.
fn setting() -> (Gaussian<2>, OnAxes<LinearSensor<1, 1>, 2, 1>, SignBit) {
    let prior = Gaussian::new(Vector2::zeros(), Matrix2::identity()).unwrap();
    (prior, OnAxes::new(LinearSensor::direct(1.0).unwrap(), [0]).unwrap(), SignBit::new(1.0).unwrap())
}

/// The bits of an instant.
fn bits(draws: &mut impl Rng) -> Vec<bool> {
    (0..SENSORS).map(|_| draws.random_bool(0.5)).collect()
}

/// A thousand one-bit sensors. Over [`bare_updates_of_1000_bits`] it is what bits, presence and health cost.
#[divan::bench(sample_size = 1, sample_count = 100)]
fn centre_of_1000_bits(bencher: Bencher) {
    let mut rng = Stream::new(1).rng();
    let (prior, sensing, scheme) = setting();
    let world = ContinuousLinear::nearly_constant_velocity(0.1).unwrap();
    let mut centre = FusionCentre::new(&mut rng, world, MomentFilter, &prior).unwrap();
    let threshold = |_: &Gaussian<2>, m: &Gaussian<1>| m.mean()[0];
    for number in 0..SENSORS {
        let sensor = Reporting::new(sensing, scheme, Link::PERFECT, threshold);
        centre.join(number, sensor).unwrap();
    }
    let feedback = centre.feedback(0).unwrap();
    let mut draws = Stream::new(2).rng();
    let slots = || -> Vec<Slot> {
        let report = |above: bool| BitString::from_bytes(vec![if above { 0x80 } else { 0 }], 1).unwrap();
        let slot = |(number, bit)| Slot::new(number, feedback.clone(), Observation::Received(report(bit)));
        (0..).zip(bits(&mut draws)).map(slot).collect()
    };
    bencher
        .with_inputs(slots)
        .bench_local_refs(|slots| centre.receive(&mut rng, black_box(slots)).unwrap());
}

/// The same bits, as alternating ones would teach the processor their pattern.
#[divan::bench(sample_size = 1, sample_count = 100)]
fn bare_updates_of_1000_bits(bencher: Bencher) {
    let (prior, sensing, scheme) = setting();
    let mut draws = Stream::new(2).rng();
    bencher.with_inputs(|| bits(&mut draws)).bench_local_refs(|bits| {
        let mut belief = prior;
        for above in bits {
            let bit = Observation::Received(if *above { Sign::Above } else { Sign::Below });
            let factor = scheme.factor(black_box(&0.0), &bit, &Link::PERFECT).unwrap();
            belief = assumed_density::update_through(&belief, &Observed::new(sensing, factor))
                .unwrap()
                .0;
        }
        belief
    });
}
