//! Speed of evaluating and designing multi-level quantizers, to be read as multiples of one encoding and of each other.

#![allow(clippy::unwrap_used)]

use divan::{Bencher, black_box};
use fewbits_core::bits::BitWriter;
use fewbits_core::message::Message;
use fewbits_quantizer_design::decoder::MmseDecoder;
use fewbits_quantizer_design::{
    Criterion, Labelling, Newton, Noise, ObservationModel, Prior, Quantizer, Symbol, System, design, lloyd_max,
};

fn main() {
    divan::main();
}

fn lloyd(levels: usize) -> Quantizer {
    Quantizer::from(&lloyd_max::gaussian(levels).unwrap())
}

fn pair(levels: usize, rho: f64) -> System {
    let model = ObservationModel::new(
        Prior::normal(0.0, 1.0).unwrap(),
        Noise::equicorrelated_with_deviations(&[1.0; 2], rho).unwrap(),
    );
    System::ideal(model.unwrap(), vec![lloyd(levels); 2]).unwrap()
}

fn nine() -> ObservationModel {
    ObservationModel::gaussian_with_deviations(1.0, &[1.0; 9]).unwrap()
}

/// The unit: one encoding by eight levels.
#[divan::bench]
fn encode_unit(bencher: Bencher) {
    let quantizer = lloyd(8);
    bencher.bench(|| quantizer.encode(black_box(0.3)));
}

/// A sample on its way: encoded and written as three bits.
#[divan::bench]
fn encode_and_write(bencher: Bencher) {
    let (quantizer, labelling) = (lloyd(8), Labelling::gray(8).unwrap());
    let mut writer = BitWriter::with_capacity(8);
    bencher.bench_local(|| {
        writer.clear();
        Symbol(quantizer.encode(black_box(0.3)).unwrap()).encode(&labelling, &mut writer)
    });
}

/// One estimate from nine counted sensors.
#[divan::bench]
fn decode_nine(bencher: Bencher) {
    let decoder = MmseDecoder::new(&System::identical(nine(), lloyd(4)).unwrap(), 220).unwrap();
    bencher.bench(|| {
        decoder
            .decode_symbols(black_box(&[0, 1, 2, 3, 3, 2, 1, 2, 2]))
            .unwrap()
            .mean
    });
}

/// Information, gradient and Hessian of two sensors.
#[divan::bench(args = [0.0, 0.85])]
fn derivatives_pair(bencher: Bencher, rho: f64) {
    let system = pair(4, rho);
    bencher.bench(|| system.derivatives(Criterion::MutualInformation).unwrap().value);
}

/// The whole joint design for N = 2, L = 8 from Lloyd-Max quantizers; at most 200 evaluations (a test asserts it).
#[divan::bench]
fn joint_newton_eight_levels(bencher: Bencher) {
    let system = pair(8, 0.0);
    bencher.bench(|| {
        design::joint(&system, Criterion::MutualInformation, &Newton::default())
            .unwrap()
            .value
    });
}

/// Nine identical sensors of four levels as 220 counts: information, gradient and Hessian.
#[divan::bench]
fn nine_counted_derivatives(bencher: Bencher) {
    let system = System::identical(nine(), lloyd(4)).unwrap();
    bencher.bench(|| system.derivatives(Criterion::MutualInformation).unwrap().value);
}

/// The same sensors told apart, 4^9 outcomes: the information alone.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn nine_enumerated_value(bencher: Bencher) {
    let system = System::ideal(nine(), vec![lloyd(4); 9]).unwrap();
    bencher.bench(|| system.value(Criterion::MutualInformation).unwrap());
}

/// The same sensors told apart, 4^9 outcomes: information, gradient and Hessian.
#[divan::bench(sample_count = 1, sample_size = 1)]
fn nine_enumerated_derivatives(bencher: Bencher) {
    let system = System::ideal(nine(), vec![lloyd(4); 9]).unwrap();
    bencher.bench(|| system.derivatives(Criterion::MutualInformation).unwrap().value);
}
