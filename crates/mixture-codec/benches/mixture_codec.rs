//! Costs of kernels, reductions and messages, in multiples of one standard normal draw.

#![allow(clippy::unwrap_used)]

use divan::{Bencher, black_box};
use fewbits_core::Message;
use fewbits_densities::{Bandwidth, KernelEstimate, Particles};
use fewbits_mixture_codec::wire::{CodedMixture, WireFormat};
use fewbits_mixture_codec::{Criterion, Reduction};
use fewbits_monte_carlo::Stream;
use rand::RngExt;
use rand_distr::StandardNormal;

fn main() {
    divan::main();
}

/// A crescent of 500 weighted particles.
fn crescent(n: usize) -> KernelEstimate<2> {
    let mut rng = Stream::new(1).rng();
    let mut columns = [Vec::new(), Vec::new()];
    let mut logs = Vec::new();
    for _ in 0..n {
        let angle = 0.9 * rng.sample::<f64, _>(StandardNormal);
        let radius = 1.5 + 0.15 * rng.sample::<f64, _>(StandardNormal);
        columns[0].push(radius * angle.cos());
        columns[1].push(radius * angle.sin());
        logs.push(0.8 * rng.sample::<f64, _>(StandardNormal));
    }
    KernelEstimate::fit(Particles::new(columns, &logs).unwrap(), &Bandwidth::default()).unwrap()
}

#[divan::bench(sample_size = 1024)]
fn standard_normal(bencher: Bencher) {
    let mut rng = Stream::new(1).rng();
    bencher.bench_local(|| rng.sample::<f64, _>(StandardNormal));
}

/// A thousand kernels.
#[divan::bench]
fn kernels_1000(bencher: Bencher) {
    let estimate = crescent(500);
    let points = [vec![0.3, 1.4], vec![-0.2, 1.0]];
    let mut out = [0.0; 2];
    bencher.bench_local(|| estimate.log_pdf_columns([black_box(&points[0]), &points[1]], &mut out));
}

#[divan::bench]
fn centres_of_500(bencher: Bencher) {
    let estimate = crescent(500);
    bencher.bench_local(|| black_box(&estimate).log_pdf_at_centres());
}

#[divan::bench]
fn pipeline_500_to_5(bencher: Bencher) {
    let estimate = crescent(500);
    bencher.bench_local(|| Reduction::default().reduce(black_box(&estimate), 5).unwrap());
}

#[divan::bench]
fn paper_500_to_5(bencher: Bencher) {
    let estimate = crescent(500);
    bencher.bench_local(|| Reduction::paper(Criterion::Kl).reduce(black_box(&estimate), 5).unwrap());
}

#[divan::bench]
fn message_of_5(bencher: Bencher) {
    let mixture = Reduction::default().reduce(&crescent(500), 5).unwrap();
    let format = WireFormat::around_origin(1.0, 0.25).unwrap();
    bencher.bench_local(|| {
        let bits = CodedMixture::new(black_box(&mixture), &format, 0)
            .unwrap()
            .to_bits(&format)
            .unwrap();
        CodedMixture::from_bits(&format, &bits).unwrap()
    });
}

#[divan::bench]
fn exponentials_1000(bencher: Bencher) {
    let logs: Vec<f64> = (0..1000).map(|i| -f64::from(i) * 0.01).collect();
    let mut out = vec![0.0; 1000];
    bencher.bench_local(|| fewbits_numerics::kernels::exp_minus(black_box(&logs), 0.0, &mut out));
}
