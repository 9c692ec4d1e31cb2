//! Wild arguments: deployments and graphs are finite or refused.

use fewbits_numerics::wild;
use fewbits_topology::{Deployment, Graph};
use nalgebra::Vector2;
use proptest::prelude::*;
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

proptest! {
    #[test]
    fn deployments_and_graphs_are_finite_or_refused(x in prop::array::uniform8(wild()), counts in prop::array::uniform2(0..5_usize), node in 0..30_usize) {
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let (lower, upper) = ([x[0], x[1]], [x[2], x[3]]);
        let mut all: Vec<Deployment> = Vec::new();
        all.extend(Deployment::given(vec![Vector2::new(x[0], x[1]), Vector2::new(x[2], x[3])]));
        all.extend(Deployment::uniform(&mut rng, lower, upper, node));
        all.extend(Deployment::grid(lower, upper, counts));
        for deployment in all {
            prop_assert!(deployment.positions().iter().all(|p| p.iter().all(|x| x.is_finite())), "{:?}", deployment);
            prop_assert!(deployment.nearest_to(&Vector2::new(x[5], x[6])) < deployment.len());
            if let Ok(graph) = Graph::within(deployment.positions(), x[7]) {
                prop_assert_eq!(graph.components().sizes.iter().sum::<usize>(), deployment.len());
                if let Ok(hops) = graph.hops_from(node) {
                    let _ = (hops.route(counts[0]), hops.distance(node), hops.parent(counts[1]));
                }
                let _ = graph.nearest(node, |other| other == counts[0]);
            }
            if let Ok(moved) = deployment.with_moved(node, Vector2::new(x[5], x[6])) {
                prop_assert!(moved.positions().iter().all(|p| p.iter().all(|x| x.is_finite())));
            }
        }
    }
}
