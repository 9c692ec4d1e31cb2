//! Reductions: optimality of cuts, conserved moments, units, bad input.

use crate::common::{crescent, d1_scaled, random_mixture};
use fewbits_densities::cut::{greedy, greedy_within, optimal};
use fewbits_densities::merge::{MergeCost, merge};
use fewbits_densities::plug_in::{cubature, plug_in};
use fewbits_densities::quadrature::integrated;
use fewbits_densities::tree::{At, Axis};
use fewbits_densities::{
    Bandwidth, Criterion, Cubature, KernelEstimate, NodeErrors, Particles, Reduction, Split, Tree, refine,
};
use fewbits_monte_carlo::Stream;
use nalgebra::Matrix2;
use proptest::prelude::*;

const CRITERIA: [Criterion; 4] = [Criterion::Ml, Criterion::Kl, Criterion::L1, Criterion::LogDeterminant];

fn all_splits() -> Vec<Split> {
    let axes = [Axis::Widest, Axis::Principal, Axis::Alternating];
    axes.iter()
        .flat_map(|axis| [At::CountMedian, At::WeightMedian].map(|at| Split { axis: *axis, at }))
        .collect()
}

/// The smallest bound over every cut with at most `m` nodes, by brute force.
fn brute_force(tree: &Tree<2>, errors: &NodeErrors, m: usize) -> f64 {
    fn cuts(tree: &Tree<2>, node: usize, m: usize) -> Vec<Vec<usize>> {
        let mut all = vec![vec![node]];
        if let (Some([l, r]), true) = (tree.nodes()[node].children, m > 1) {
            for left in cuts(tree, l, m - 1) {
                for right in cuts(tree, r, m - left.len()) {
                    all.push([left.clone(), right].concat());
                }
            }
        }
        all
    }
    cuts(tree, 0, m)
        .iter()
        .filter(|c| c.len() <= m)
        .map(|c| errors.bound(c))
        .fold(f64::INFINITY, f64::min)
}

proptest! {
    // One case in 5 of `PROPTEST_CASES`: they are dear.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(5), ..ProptestConfig::default() })]

    #[test]
    fn dynamic_programming_is_brute_force_and_greed_is_no_better(seed in any::<u64>(), n in 2..14_usize, m in 1..7_usize) {
        let estimate = crescent(seed, n, 1.0);
        for split in all_splits() {
            let tree = Tree::new(&estimate, split).unwrap();
            prop_assert_eq!(tree.nodes().len(), 2 * n - 1);
            for criterion in CRITERIA {
                let errors = NodeErrors::new(&estimate, &tree, criterion).unwrap();
                let (best, greedy) = (optimal(&tree, &errors, m).unwrap(), greedy(&tree, &errors, m).unwrap());
                tree.check_cut(&best.nodes).unwrap();
                tree.check_cut(&greedy.nodes).unwrap();
                prop_assert!(best.nodes.len() <= m && greedy.nodes.len() <= m);
                let brute = brute_force(&tree, &errors, m);
                prop_assert!((best.bound - brute).abs() < 1e-12, "{} {}", best.bound, brute);
                prop_assert!(best.bound <= greedy.bound + 1e-12);
                if criterion == Criterion::Ml {
                    prop_assert!((best.bound - greedy.bound).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn merging_keeps_the_moments(seed in any::<u64>(), n in 1..12_usize, m in 1..6_usize) {
        let mixture = random_mixture::<3, _>(&mut Stream::new(seed).rng(), n, 1.0);
        for cost in [MergeCost::Runnalls, MergeCost::Salmond, MergeCost::Williams] {
            let merged = merge(&mixture, m, cost).unwrap();
            prop_assert_eq!(merged.mixture.len(), m.min(n));
            prop_assert!((merged.mixture.mean() - mixture.mean()).amax() < 1e-12);
            prop_assert!((merged.mixture.covariance() - mixture.covariance()).amax() < 1e-11);
            prop_assert!(merged.cost >= 0.0 && (n > m || merged.cost == 0.0));
        }
    }

    #[test]
    fn cuts_keep_the_moments_and_runnalls_bounds_the_loss(seed in any::<u64>(), m in 1..6_usize) {
        let estimate = crescent(seed, 24, 1.0);
        let truth = estimate.to_mixture().unwrap();
        for criterion in CRITERIA {
            let q = Reduction::paper(criterion).reduce(&estimate, m).unwrap();
            prop_assert!((q.mean() - estimate.mean()).amax() < 1e-12);
            prop_assert!((q.covariance() - estimate.covariance()).amax() < 1e-12);
        }
        let merged = merge(&truth, m, MergeCost::Runnalls).unwrap();
        prop_assert!(integrated(&truth, &merged.mixture).unwrap().kl <= merged.cost + 1e-9);
    }
}

#[test]
fn nothing_depends_on_the_unit() {
    let reductions = [
        Reduction::SingleGaussian,
        Reduction::paper(Criterion::Ml),
        Reduction::paper(Criterion::Kl),
        Reduction::Optimal {
            split: Split::PRINCIPAL,
            criterion: Criterion::L1,
        },
        Reduction::Merging {
            cost: MergeCost::Salmond,
        },
        Reduction::Merging {
            cost: MergeCost::Williams,
        },
        Reduction::default(),
    ];
    for reduction in reductions {
        let reference = reduction.reduce(&d1_scaled(1.0), 4).unwrap();
        for unit in [1e-4, 1e4] {
            let scaled = reduction.reduce(&d1_scaled(unit), 4).unwrap();
            assert_eq!(scaled.len(), reference.len(), "{reduction:?}");
            for (a, b) in scaled.components().iter().zip(reference.components()) {
                assert!((a.weight() - b.weight()).abs() < 1e-9, "{reduction:?}");
                assert!((a.mean() / unit - b.mean()).amax() < 1e-8, "{reduction:?}");
                assert!((a.covariance() / (unit * unit) - b.covariance()).amax() < 1e-8, "{reduction:?}");
            }
        }
    }
}

#[test]
fn the_pipeline_is_well_below_the_cut_of_the_paper() {
    let (mut ours, mut papers) = (0.0, 0.0);
    for seed in 0..4 {
        let estimate = crescent(seed, 200, 1.0);
        let truth = estimate.to_mixture().unwrap();
        let kl = |reduction: Reduction| integrated(&truth, &reduction.reduce(&estimate, 5).unwrap()).unwrap().kl;
        ours += kl(Reduction::default());
        papers += kl(Reduction::paper(Criterion::Kl));
    }
    assert!(ours < 0.7 * papers, "{ours} {papers}");
}

#[test]
fn refinement_lowers_its_own_estimate_at_every_step_and_keeps_to_its_floor() {
    let estimate = crescent(7, 120, 1.0);
    let mut mixture = Reduction::Pipeline { cut: 40, iterations: 0 }
        .reduce(&estimate, 20)
        .unwrap();
    let mut last = f64::INFINITY;
    for _ in 0..30 {
        let kl = cubature(&estimate, &mixture, Cubature::GaussHermite).kl_plugin;
        // The floor may cost a little.
        assert!(kl <= last + 2e-3, "{kl} after {last}");
        last = kl;
        mixture = refine(&estimate, &mixture, 1, Cubature::GaussHermite).unwrap();
    }
    for c in mixture.components() {
        let excess = c.covariance() - estimate.kernel();
        assert!(excess[(0, 0)] > -1e-12 && excess.determinant() > -1e-12);
    }
}

#[test]
fn sums_over_a_cut_bound_the_true_errors() {
    for seed in 0..6 {
        let estimate = crescent(seed, 100, 1.0);
        let truth = estimate.to_mixture().unwrap();
        let tree = Tree::new(&estimate, Split::KD).unwrap();
        for m in [1, 3, 5, 10] {
            for criterion in [Criterion::Kl, Criterion::LogDeterminant] {
                let errors = NodeErrors::new(&estimate, &tree, criterion).unwrap();
                let cut = greedy(&tree, &errors, m).unwrap();
                assert!(integrated(&truth, &cut.mixture(&tree).unwrap()).unwrap().kl <= cut.bound);
            }
        }
    }
}

#[test]
fn a_price_in_bits_is_kept() {
    let estimate = crescent(3, 64, 1.0);
    let tree = Tree::new(&estimate, Split::KD).unwrap();
    let errors = NodeErrors::new(&estimate, &tree, Criterion::Kl).unwrap();
    let price = |node: usize| 20.0 + tree.nodes()[node].range.len() as f64 * 0.01;
    for limit in [21.0, 45.0, 150.0] {
        let cut = greedy_within(&tree, &errors, price, limit).unwrap();
        assert!(cut.nodes.iter().map(|s| price(*s)).sum::<f64>() <= limit);
    }
    assert!(greedy_within(&tree, &errors, price, 10.0).is_err());
    assert!(greedy_within(&tree, &errors, price, f64::NAN).is_err());
}

#[test]
fn coincident_particles_and_wild_weights_do_no_harm() {
    let n = 200;
    let duplicates = Particles::uniform([vec![3.0; n], vec![-1.0; n]]).unwrap();
    let estimate = KernelEstimate::new(duplicates, Matrix2::identity()).unwrap();
    let logs: Vec<f64> = (0..n).map(|i| -3.0 * i as f64).collect();
    let x: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
    let wild = Particles::new([x.clone(), x], &logs).unwrap();
    let wild = KernelEstimate::new(wild, Matrix2::new(1e-6, 0.0, 0.0, 1e-6)).unwrap();
    for estimate in [&estimate, &wild] {
        for split in all_splits() {
            for criterion in CRITERIA {
                for m in [1, 5, 300] {
                    let q = Reduction::Greedy { split, criterion }.reduce(estimate, m).unwrap();
                    assert!(plug_in(estimate, &q).kl_plugin.is_finite());
                    Reduction::Optimal { split, criterion }
                        .reduce(estimate, m.min(20))
                        .unwrap();
                }
            }
        }
        for m in [1, 5, 80] {
            let q = Reduction::default().reduce(estimate, m).unwrap();
            assert!(q.log_pdf(&q.mean()).is_finite());
        }
    }
    assert!(Reduction::default().reduce(&wild, 0).is_err());
    assert!(KernelEstimate::fit(Particles::uniform([vec![1.0; 3]]).unwrap(), &Bandwidth::default()).is_err());
    assert!(KernelEstimate::new(Particles::uniform([vec![1.0], vec![2.0]]).unwrap(), Matrix2::zeros()).is_err());
}
