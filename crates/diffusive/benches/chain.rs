//! Costs of the search in multiples of one standard normal draw.

#![allow(clippy::unwrap_used)]

use divan::{Bencher, black_box};
use fewbits_core::Gaussian;
use fewbits_diffusive::density::CellOptions;
use fewbits_diffusive::{
    Posterior, Prior, RateModel, RateRange, Search, SearchBox, SearchField, SourceLikelihood, SourceSensor,
};
use fewbits_models::diffusion::{Air, Ground};
use fewbits_monte_carlo::Stream;
use fewbits_topology::{Deployment, Graph};
use nalgebra::{Matrix2, Vector2, Vector3};
use rand::RngExt;
use rand_distr::StandardNormal;

fn main() {
    divan::main();
}

#[divan::bench(sample_size = 4096)]
fn standard_normal(bencher: Bencher) {
    let mut rng = Stream::new(1).rng();
    bencher.bench_local(|| rng.sample::<f64, _>(StandardNormal));
}

#[divan::bench(sample_size = 4096)]
fn exponential(bencher: Bencher) {
    bencher.bench(|| black_box(-1.234_f64).exp());
}

#[divan::bench(sample_size = 4096)]
fn windy_concentration(bencher: Bencher) {
    let air = Air::new(40.0, Vector3::new(-20.0, -10.0, 0.0), Ground::Impermeable).unwrap();
    let (field, source) = (Vector3::new(63.0, 41.0, 0.0), Vector3::new(73.0, 38.0, 0.0));
    bencher.bench(|| air.concentration(black_box(&field), black_box(&source), black_box(5.0)));
}

fn sensor() -> SourceSensor {
    let air = Air::new(40.0, Vector3::zeros(), Ground::Impermeable).unwrap();
    SourceSensor::new(air, vec![5.0, 10.0, 15.0, 20.0, 25.0], 8e-6).unwrap()
}

fn joint() -> RateModel {
    RateModel::Joint(RateRange::new(0.5, 1.5).unwrap())
}

fn field() -> SearchBox {
    SearchBox {
        lower: [-20.0; 2],
        upper: [120.0; 2],
    }
}

/// One node's update of the exact belief: the record, its table and the cells.
#[divan::bench]
fn exact_update(bencher: Bencher) {
    let sensor = sensor();
    let node = Vector2::new(50.0, 54.0);
    let samples = sensor
        .sample(&mut Stream::new(1).rng(), &node, &Vector2::new(62.0, 50.0), 1.0)
        .unwrap();
    let prior = Prior::Exact(Gaussian::new(node, Matrix2::identity() * 2500.0).unwrap());
    bencher.bench_local(|| {
        let record = sensor.record(black_box(&node), &samples).unwrap();
        let likelihood = SourceLikelihood::new(vec![record], joint()).unwrap();
        Posterior::new(&prior, &likelihood, &field(), None, &CellOptions::default()).unwrap()
    });
}

/// A whole search with the exact belief among 300 nodes.
#[divan::bench]
fn exact_chain(bencher: Bencher) {
    let sensor = sensor();
    let mut rng = Stream::new(3).rng();
    let alarm = Vector2::new(44.396, 52.042);
    let deployed = Deployment::uniform(&mut rng, [0.0; 2], [100.0; 2], 300).unwrap();
    let start = deployed.nearest_to(&alarm);
    let deployed = deployed.with_moved(start, alarm).unwrap();
    let search = Search::new(&alarm, 50.0, field(), joint(), 1e-5).unwrap();
    bencher.bench_local(|| {
        let graph = Graph::within(deployed.positions(), 15.0).unwrap();
        let field = SearchField::new(sensor.clone(), deployed.clone(), graph).unwrap();
        let mut rng = Stream::new(4).rng();
        search
            .run(&field, start, |node| {
                sensor.sample(&mut rng, &deployed.positions()[node], &Vector2::new(62.0, 50.0), 1.0)
            })
            .unwrap()
    });
}
