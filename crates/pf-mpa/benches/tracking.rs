//! Costs of one tracking step in multiples of one standard normal draw, and that a step does not allocate.

#![allow(clippy::unwrap_used)]

use divan::{AllocProfiler, Bencher};
use fewbits_baselines::pf_mpa::MessagePassing;
use fewbits_baselines::pf_mpa::{
    Encoder, GuidedGaussian, Linearised, Network, POSITION, Ranged, Reports, Target, Tracker,
};
use fewbits_core::Gaussian;
use fewbits_monte_carlo::Stream;
use fewbits_pf_mpa::{GridFilter, QuantizedRange, RangeNoise};
use nalgebra::{Matrix4, Vector2, Vector4};
use rand::RngExt;
use rand_distr::StandardNormal;

/// Allocations are counted and shown: a step has none.
#[global_allocator]
static ALLOC: AllocProfiler = AllocProfiler::system();

fn main() {
    divan::main();
}

#[divan::bench(sample_size = 4096)]
fn standard_normal(bencher: Bencher) {
    let mut rng = Stream::new(1).rng();
    bencher.bench_local(|| rng.sample::<f64, _>(StandardNormal));
}

fn prior() -> Gaussian<4> {
    let covariance = Matrix4::from_diagonal(&Vector4::new(0.04, 0.04, 0.01, 0.01));
    Gaussian::new(Vector4::new(13.0, 17.0, 0.0, -0.6), covariance).unwrap()
}

fn observed(target: &Target) -> Vec<Ranged> {
    let scheme = QuantizedRange::new(4, RangeNoise::from_snr_db(50.0).unwrap()).unwrap();
    let places = [[4.0, 4.0], [16.0, 4.0], [10.0, 10.0], [4.0, 16.0], [16.0, 16.0]].map(Vector2::from);
    let network = Network::new(&places, scheme, Encoder::published(3.0).unwrap()).unwrap();
    let ranges = network.measure(&mut Stream::new(2).rng(), 13.1, 16.4);
    network.observe(target, 0, &prior(), &ranges, Reports::Levels).unwrap()
}

fn step<T: Tracker>(bencher: Bencher, tracker: &T) {
    let target = Target::printed().unwrap();
    let observed = observed(&target);
    let mut rng = Stream::new(3).fast_rng();
    let start = tracker.start(&mut rng, &target, &prior()).unwrap();
    let mut workspace = T::Workspace::default();
    let mut belief = start.clone();
    // The first step fills the workspace.
    tracker
        .step_in_place(&mut rng, &target, 0, &mut belief, &observed, &mut workspace)
        .unwrap();
    bencher.bench_local(|| {
        belief.clone_from(&start);
        tracker
            .step_in_place(&mut rng, &target, 0, &mut belief, &observed, &mut workspace)
            .unwrap()
    });
}

#[divan::bench]
fn grid_15(bencher: Bencher) {
    step(bencher, &GridFilter::new(POSITION).unwrap());
}

#[divan::bench]
fn message_passing_improved_40(bencher: Bencher) {
    step(bencher, &MessagePassing::improved(40).unwrap());
}

#[divan::bench]
fn message_passing_published_40(bencher: Bencher) {
    step(bencher, &MessagePassing::published(40).unwrap());
}

#[divan::bench]
fn gaussian_message_passing(bencher: Bencher) {
    step(bencher, &Linearised::MESSAGE_PASSING);
}

#[divan::bench]
fn guided_40(bencher: Bencher) {
    step(bencher, &GuidedGaussian::new(40).unwrap());
}
