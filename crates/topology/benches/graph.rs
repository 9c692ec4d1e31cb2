//! Neighbour graphs: time a node must not depend on the number of nodes.

use divan::counter::ItemsCount;
use fewbits_topology::{Deployment, Graph};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;

fn main() {
    divan::main();
}

#[divan::bench(args = [10_000, 100_000, 1_000_000], sample_count = 5, sample_size = 1)]
fn neighbour_graph(bencher: divan::Bencher<'_, '_>, nodes: usize) {
    let side = (nodes as f64).sqrt();
    let field = Deployment::uniform(&mut Pcg64Mcg::seed_from_u64(1), [0.0; 2], [side; 2], nodes);
    let Ok(field) = field else { return };
    bencher
        .counter(ItemsCount::new(nodes))
        .bench_local(|| Graph::within(field.positions(), 2.0));
}

#[divan::bench(sample_count = 50)]
fn standard_normal(bencher: divan::Bencher<'_, '_>) {
    use rand::RngExt;
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    bencher.counter(ItemsCount::new(1000_usize)).bench_local(|| {
        (0..1000)
            .map(|_| rng.sample::<f64, _>(rand_distr::StandardNormal))
            .sum::<f64>()
    });
}
