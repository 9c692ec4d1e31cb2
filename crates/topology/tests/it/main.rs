//! Deployments and graphs against brute force.

mod wild;

use fewbits_topology::{Deployment, Graph};
use nalgebra::Vector2;
use proptest::prelude::*;
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::SeedableRng;

fn brute(positions: &[Vector2<f64>], range: f64) -> Vec<Vec<u32>> {
    let close = |i: usize, j: usize| i != j && (positions[i] - positions[j]).norm_squared() <= range * range;
    (0..positions.len())
        .map(|i| {
            (0..positions.len())
                .filter(|j| close(i, *j))
                .map(|j| j as u32)
                .collect()
        })
        .collect()
}

proptest! {
    // One case in 4 of `PROPTEST_CASES`: they are dear.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(4), ..ProptestConfig::default() })]

    #[test]
    fn cell_lists_are_brute_force(
        points in prop::collection::vec((-50.0..50.0f64, -50.0..50.0f64), 1..120),
        range in 0.1..60.0f64,
        stretch in prop::sample::select(vec![1.0, 1e-9, 1e6]),
        unit in prop::sample::select(vec![1e-4, 1.0, 1e4]),
    ) {
        let positions: Vec<_> = points.iter().map(|p| Vector2::new(p.0 * unit, p.1 * stretch * unit)).collect();
        let graph = Graph::within(&positions, range * unit).unwrap();
        for (node, expected) in brute(&positions, range * unit).iter().enumerate() {
            prop_assert_eq!(graph.neighbours(node), expected.as_slice());
        }
    }

    /// Distances obey the edges; a route has as many edges as the distance says; `nearest` agrees.
    #[test]
    fn hops_are_shortest(seed in 0_u64..1000, nodes in 2_usize..80, range in 5.0..40.0f64) {
        let field = Deployment::uniform(&mut Pcg64Mcg::seed_from_u64(seed), [0.0; 2], [100.0; 2], nodes).unwrap();
        let graph = Graph::within(field.positions(), range).unwrap();
        let hops = graph.hops_from(0).unwrap();
        for node in 0..nodes {
            for other in graph.neighbours(node) {
                match (hops.distance(node), hops.distance(*other as usize)) {
                    (Some(a), Some(b)) => prop_assert!(a.abs_diff(b) <= 1),
                    (a, b) => prop_assert_eq!(a, b),
                }
            }
            if let Some(distance) = hops.distance(node) {
                let route = hops.route(node).unwrap();
                prop_assert_eq!((route[0], *route.last().unwrap(), route.len()), (0, node, distance + 1));
                for pair in route.windows(2) {
                    prop_assert!(graph.neighbours(pair[0]).contains(&(pair[1] as u32)));
                }
            }
            if node > 0 {
                let (found, away) = graph.nearest(0, |other| other == node).unwrap();
                prop_assert_eq!(found.first().map(|_| away), hops.distance(node));
            }
        }
        let pieces = graph.components();
        prop_assert_eq!(pieces.sizes.iter().sum::<usize>(), nodes);
        prop_assert_eq!(pieces.sizes[pieces.labels[0] as usize], hops.reached().len());
    }
}

#[test]
fn pieces_and_dead_ends() {
    let at = |x: f64| Vector2::new(x, 0.0);
    let graph = Graph::within(&[at(0.0), at(1.0), at(2.0), at(9.0)], 1.5).unwrap();
    let pieces = graph.components();
    assert_eq!((pieces.sizes, pieces.labels), (vec![3, 1], vec![0, 0, 0, 1]));
    assert_eq!(graph.nearest(0, |node| node == 2).unwrap(), (vec![2], 2));
    assert_eq!(graph.nearest(0, |node| node == 3).unwrap(), (vec![], 0));
    assert_eq!(graph.hops_from(0).unwrap().route(3), None);
    assert!(matches!(graph.hops_from(7), Err(e) if e.name == "node" && e.value == "7"));
    assert!(graph.neighbours(17).is_empty());
}

#[test]
fn bad_input_is_refused() {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    assert!(Deployment::given(vec![]).is_err());
    assert!(Deployment::given(vec![Vector2::new(f64::NAN, 0.0)]).is_err());
    assert!(Deployment::uniform(&mut rng, [0.0; 2], [0.0, 1.0], 3).is_err());
    assert!(Deployment::uniform(&mut rng, [0.0; 2], [1.0; 2], 0).is_err());
    assert!(Graph::within(&[Vector2::zeros()], 0.0).is_err());
    assert!(Graph::within(&[Vector2::new(f64::INFINITY, 0.0)], 1.0).is_err());
    assert!(Graph::within(&[], 1.0).unwrap().is_empty());
}

/// Coincident nodes, ranges and fields of extreme size: graphs by distance, never a panic.
#[test]
fn extremes() {
    let at = |x: f64, y: f64| Vector2::new(x, y);
    let neighbours = |positions: &[Vector2<f64>], range: f64| -> Vec<Vec<u32>> {
        let graph = Graph::within(positions, range).unwrap();
        (0..positions.len())
            .map(|node| graph.neighbours(node).to_vec())
            .collect()
    };
    let coincident = neighbours(&[at(3.0, 4.0); 5], 1e-300);
    assert!(coincident.iter().all(|list| list.len() == 4));
    // Squares of these would vanish, or overflow.
    assert_eq!(neighbours(&[at(0.0, 0.0), at(1e-170, 0.0), at(1e-201, 0.0)], 1e-200), [vec![2], vec![], vec![0]]);
    assert_eq!(neighbours(&[at(0.0, 0.0), at(1e250, 0.0), at(1e199, 0.0)], 1e200), [vec![2], vec![], vec![0]]);
    assert_eq!(neighbours(&[at(-1.7e308, 0.0), at(1.7e308, 0.0)], 1.0), [vec![], vec![]]);
    assert_eq!(neighbours(&[at(0.0, 0.0), at(1.0, 0.0)], f64::MAX), [vec![1], vec![0]]);
    assert_eq!(neighbours(&[at(0.0, 0.0), at(1e300, 1.0), at(1e300, 1.5)], 1.0), [vec![], vec![2], vec![1]]);
    for range in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Graph::within(&[at(0.0, 0.0)], range).is_err(), "{range}");
    }
    let one = Graph::within(&[at(0.0, 0.0)], 1.0).unwrap();
    assert_eq!(
        (one.edges(), one.components().sizes, one.hops_from(0).unwrap().route(0)),
        (0, vec![1], Some(vec![0]))
    );
    let none = Graph::within(&[], 1.0).unwrap();
    assert!(none.hops_from(0).is_err() && none.nearest(0, |_| true).is_err() && none.components().sizes.is_empty());
}
