//! Reductions: optimality of cuts, conserved moments, units, bad input.

use crate::common::{crescent, d1_scaled, random_mixture};
use fewbits_baselines::mixture_codec::quadrature::integrated;
use fewbits_core::Belief;
use fewbits_densities::{Bandwidth, Component, KernelEstimate, Mixture, Particles};
use fewbits_mixture_codec::cut::{Cut, greedy, greedy_within, optimal};
use fewbits_mixture_codec::merge::{MergeCost, merge};
use fewbits_mixture_codec::plug_in::{cubature, node_errors, plug_in};
use fewbits_mixture_codec::tree::{At, Axis};
use fewbits_mixture_codec::{Criterion, Cubature, NodeErrors, PlugIn, Reduction, Split, Tree, refine};
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
                best.mixture(&tree).unwrap();
                greedy.mixture(&tree).unwrap();
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

    /// Erratum `handoff-6`.
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
        let estimate = crescent(seed, 80, 1.0);
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
    let holds = |seed, particles, m, criterion| {
        let estimate = crescent(seed, particles, 1.0);
        let truth = estimate.to_mixture().unwrap();
        let tree = Tree::new(&estimate, Split::KD).unwrap();
        let errors = NodeErrors::new(&estimate, &tree, criterion).unwrap();
        let cut = greedy(&tree, &errors, m).unwrap();
        assert!(integrated(&truth, &cut.mixture(&tree).unwrap()).unwrap().kl <= cut.bound);
    };
    for m in [1, 3, 10] {
        // A theorem, and what is true of enough kernels.
        (0..4).for_each(|seed| holds(seed, 20, m, Criterion::LogDeterminant));
        holds(m as u64, 100, m, Criterion::Kl);
    }
}

/// Plug-in errors of inner nodes may be zero by chance: with room for every leaf nothing is merged.
#[test]
fn paper_reduction_with_room_for_all_keeps_all() {
    let mut rng = Stream::new(11).rng();
    for n in [1, 2, 30, 300] {
        let column = |rng: &mut _| -> Vec<f64> {
            (0..n)
                .map(|_| RngExt::sample::<f64, _>(rng, rand_distr::StandardNormal))
                .collect()
        };
        let particles = Particles::uniform([column(&mut rng), column(&mut rng)]).unwrap();
        let estimate = KernelEstimate::new(particles, Matrix2::identity() * 0.3).unwrap();
        let whole = estimate.to_mixture().unwrap();
        for criterion in [Criterion::Ml, Criterion::Kl, Criterion::L1] {
            for components in [n, n + 7] {
                let optimal = Reduction::Optimal {
                    split: Split::KD,
                    criterion,
                };
                for reduction in [Reduction::paper(criterion), optimal] {
                    let mixture = reduction.reduce(&estimate, components).unwrap();
                    assert_eq!(mixture.len(), n, "{criterion:?} {components}");
                    let point = nalgebra::Vector2::new(0.3, -0.7);
                    assert!((mixture.log_pdf(&point) - whole.log_pdf(&point)).abs() < 1e-12);
                }
            }
        }
    }
}

/// Erratum `handoff-7`.
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

/// Errors that have nothing to do with the tree, so that more nodes may well be worse.
/// Erratum `handoff-8`.
#[test]
fn any_errors_are_cut_optimally() {
    use rand::RngExt;
    let mut rng = Stream::new(71).rng();
    for seed in 0..20 {
        let tree = Tree::new(&crescent(seed, 10, 1.0), Split::KD).unwrap();
        let random = tree.nodes().iter().map(|node| match node.children {
            None => PlugIn::default(),
            Some(_) => PlugIn {
                ml_plugin: rng.random_range(0.0..1.0),
                kl_plugin: rng.random_range(-0.3..1.0),
                l1_plugin: rng.random_range(0.0..1.0),
                dr_plugin: 0.0,
            },
        });
        let random: Vec<PlugIn> = random.collect();
        for criterion in [Criterion::Ml, Criterion::Kl, Criterion::L1] {
            let errors = NodeErrors::from_plug_in(&tree, &random, criterion).unwrap();
            for (value, (node, e)) in errors.values().iter().zip(tree.nodes().iter().zip(&random)) {
                let exact = match criterion {
                    Criterion::Ml => e.ml_plugin,
                    Criterion::Kl => node.weight * e.kl_plugin.max(0.0),
                    _ => node.weight * e.l1_plugin,
                };
                assert_eq!(*value, exact);
            }
            for m in 1..=10 {
                let best = optimal(&tree, &errors, m).unwrap();
                assert!(best.nodes.len() <= m && best.mixture(&tree).is_ok());
                assert!((best.bound - brute_force(&tree, &errors, m)).abs() < 1e-14, "{criterion:?} {m}");
                // Of the cuts on the greedy way the best.
                let found = greedy(&tree, &errors, m).unwrap();
                assert_eq!(found.bound, errors.bound(&found.nodes));
                let shorter = greedy(&tree, &errors, m.max(2) - 1).unwrap();
                assert!(found.bound <= shorter.bound && best.bound <= found.bound + 1e-14);
            }
        }
        assert!(NodeErrors::from_plug_in(&tree, &random, Criterion::LogDeterminant).is_err());
        assert!(NodeErrors::from_plug_in(&tree, &random[1..], Criterion::Ml).is_err());
        let other = Tree::new(&crescent(seed, 9, 1.0), Split::KD).unwrap();
        let errors = NodeErrors::from_plug_in(&tree, &random, Criterion::Ml).unwrap();
        assert!(optimal(&other, &errors, 3).is_err() && greedy(&other, &errors, 3).is_err());
    }
}

/// Every node of every kind of tree: where it is cut, its moments, and the plug-in errors of its Gaussian, from their definitions.
#[test]
fn trees_are_cut_where_they_say_and_nodes_are_what_they_hold() {
    let particles = crescent(9, 23, 1.0).particles().clone();
    let (weights, [x, y]) = (particles.weights().to_vec(), particles.columns().map(<[f64]>::to_vec));
    let kernel = Matrix2::new(0.5, 0.1, 0.1, 0.05);
    let estimate = KernelEstimate::new(particles, kernel).unwrap();
    let whitener = nalgebra::Cholesky::new(kernel).unwrap().l().try_inverse().unwrap();
    let point = |i: usize| nalgebra::Vector2::new(x[i], y[i]);
    let moments = |members: &[usize], map: &Matrix2<f64>| {
        let total: f64 = members.iter().map(|i| weights[*i]).sum();
        let mean = members
            .iter()
            .map(|i| map * point(*i) * weights[*i])
            .sum::<nalgebra::Vector2<f64>>()
            / total;
        let spread = |i: &usize| (map * point(*i) - mean) * (map * point(*i) - mean).transpose() * weights[*i];
        (total, mean, members.iter().map(spread).sum::<Matrix2<f64>>() / total)
    };
    for split in all_splits() {
        let tree = Tree::new(&estimate, split).unwrap();
        let errors = node_errors(&estimate, &tree).unwrap();
        let logdet = NodeErrors::new(&estimate, &tree, Criterion::LogDeterminant).unwrap();
        assert_eq!(logdet.values().len(), tree.nodes().len());
        let mut depths = vec![0; tree.nodes().len()];
        for (index, node) in tree.nodes().iter().enumerate() {
            let members = tree.members(index);
            let (weight, mean, spread) = moments(&members, &Matrix2::identity());
            assert!((node.weight - weight).abs() < 1e-14 && (node.mean - mean).amax() < 1e-13);
            assert!((node.covariance - spread - kernel).amax() < 1e-13);
            let own = members
                .iter()
                .map(|i| Component::new(weights[*i], point(*i), kernel).unwrap());
            let (own, gaussian) = (
                Mixture::new(own.collect()).unwrap(),
                Mixture::new(vec![Component::new(node.weight, node.mean, node.covariance).unwrap()]).unwrap(),
            );
            let ratios: Vec<(f64, f64)> = members
                .iter()
                .map(|i| (weights[*i] / weight, own.log_pdf(&point(*i)) - gaussian.log_pdf(&point(*i))))
                .collect();
            let (top, bottom) = ratios
                .iter()
                .fold((f64::MIN, f64::MAX), |(t, b), r| (r.1.max(t), r.1.min(b)));
            let e = errors[index];
            for (found, exact) in [
                (e.ml_plugin, top.max(-bottom)),
                (e.dr_plugin, 0.5 * (top - bottom)),
                (e.kl_plugin, ratios.iter().map(|(w, f)| w * f).sum()),
                (e.l1_plugin, ratios.iter().map(|(w, f)| w * (1.0 - (-f).exp()).abs()).sum()),
            ] {
                assert!((found - exact).abs() < 1e-11, "{index}: {found} {exact}");
            }
            let bound = 0.5 * weight * (node.covariance.determinant() / kernel.determinant()).ln();
            assert!((logdet.values()[index] - bound).abs() < 1e-12);
            let Some([left, right]) = node.children else {
                assert_eq!(members.len(), 1);
                continue;
            };
            (depths[left], depths[right]) = (depths[index] + 1, depths[index] + 1);
            let direction = match split.axis {
                Axis::Alternating => nalgebra::Vector2::ith(depths[index] % 2, 1.0),
                Axis::Widest => nalgebra::Vector2::ith(usize::from(spread[(1, 1)] > spread[(0, 0)]), 1.0),
                _ => {
                    let eigen = moments(&members, &whitener).2.symmetric_eigen();
                    whitener.transpose() * eigen.eigenvectors.column(eigen.eigenvalues.imax())
                }
            };
            let keys =
                |node: usize| -> Vec<f64> { tree.members(node).iter().map(|i| direction.dot(&point(*i))).collect() };
            let range = |keys: Vec<f64>| keys.iter().fold((f64::MAX, f64::MIN), |(l, h), k| (k.min(l), k.max(h)));
            let (l, r) = (range(keys(left)), range(keys(right)));
            assert!(l.1 <= r.0 || r.1 <= l.0, "{split:?} {index}");
            let half = tree.members(left).len();
            match split.at {
                At::CountMedian => assert_eq!(half, members.len().div_ceil(2)),
                // With its last kernel the left child has half of the weight, or leaves one kernel; without it less than half.
                At::WeightMedian => {
                    let (own, side) = (tree.members(left), if l.1 <= r.0 { 1.0 } else { -1.0 });
                    let key = |i: &usize| side * direction.dot(&point(*i));
                    let last = own.iter().max_by(|a, b| key(a).total_cmp(&key(b))).unwrap();
                    let with: f64 = own.iter().map(|i| weights[*i]).sum();
                    assert!(half == 1 || with - weights[*last] < 0.5 * weight);
                    assert!(with >= 0.5 * weight - 1e-15 || members.len() == half + 1);
                }
            }
        }
        let leaves: Vec<usize> = (0..tree.nodes().len())
            .filter(|i| tree.nodes()[*i].children.is_none())
            .collect();
        let is_cut = |nodes: &[usize]| {
            Cut {
                nodes: nodes.to_vec(),
                bound: 0.0,
            }
            .mixture(&tree)
            .is_ok()
        };
        assert!(is_cut(&leaves) && !is_cut(&leaves[1..]) && !is_cut(&[]) && !is_cut(&[0, 1]) && !is_cut(&[99]));
        assert!(tree.members(99).is_empty());
    }
}

/// Expectation-maximisation over the spherical points as the textbooks have it, with the eigenvalue floor; one component is so far
/// off and so narrow that every share underflows.
#[test]
fn refinement_is_expectation_maximisation_with_a_floor() {
    let (weights, kernel) = ([0.3, 0.0, 0.2, 0.1, 0.4, 0.6, 0.5], Matrix2::new(0.5, 0.1, 0.1, 0.3));
    let x = [0.0, 9.0, 1.5, 2.0, -1.0, 3.0, 300.0];
    let y = [0.3, 9.0, -0.4, 2.0, 2.5, 1.0, -200.0];
    let particles = Particles::new([x.to_vec(), y.to_vec()], &weights.map(f64::ln)).unwrap();
    let estimate = KernelEstimate::new(particles, kernel).unwrap();
    let lower = nalgebra::Cholesky::new(kernel).unwrap().l();
    let mut points = Vec::new();
    for i in (0..7).filter(|i| weights[*i] > 0.0) {
        for axis in 0..2 {
            for side in [-1.0, 1.0] {
                let offset = lower.column(axis) * (side * 2.0_f64.sqrt());
                points.push((nalgebra::Vector2::new(x[i], y[i]) + offset, weights[i] / 2.1 / 4.0));
            }
        }
    }
    let single =
        Component::new(1.0, nalgebra::Vector2::new(1.0, -0.5), Matrix2::new(900.0, -40.0, -40.0, 500.0)).unwrap();
    let ratio = |x: &nalgebra::Vector2<f64>| estimate.log_pdf(x) - single.log_pdf(x);
    let kl: f64 = points.iter().map(|(x, w)| w * ratio(x)).sum();
    let found = cubature(&estimate, &Mixture::new(vec![single]).unwrap(), Cubature::Spherical).kl_plugin;
    assert!((found - kl).abs() < 1e-10, "{found} {kl}");
    let start = [
        (0.5, nalgebra::Vector2::new(0.2, 0.1), Matrix2::new(0.6, 0.05, 0.05, 0.4)),
        (0.3, nalgebra::Vector2::new(2.0, 1.5), Matrix2::new(0.9, -0.1, -0.1, 0.8)),
        (0.2, nalgebra::Vector2::new(-1.0, 2.0), Matrix2::new(0.02, 0.0, 0.0, 0.03)),
    ];
    let mut parts = start.to_vec();
    let whitener = lower.try_inverse().unwrap();
    for iterations in 0..4 {
        let components = start.iter().map(|(w, m, c)| Component::new(*w, *m, *c).unwrap());
        let mixture = Mixture::new(components.collect()).unwrap();
        let refined = refine(&estimate, &mixture, iterations, Cubature::Spherical).unwrap();
        assert_eq!(refined.len(), parts.len());
        for (a, b) in refined.components().iter().zip(&parts) {
            assert!((a.weight() - b.0).abs() < 1e-10 && (a.mean() - b.1).amax() < 1e-8, "{iterations} {a:?} {b:?}");
            assert!((a.covariance() - b.2).amax() < 1e-9 * b.2.amax(), "{iterations} {a:?} {b:?}");
        }
        let mut sums = vec![(0.0, nalgebra::Vector2::zeros(), Matrix2::zeros()); 3];
        for (p, w) in &points {
            let log = |(w, m, c): &(f64, nalgebra::Vector2<f64>, Matrix2<f64>)| {
                let d = p - m;
                w.ln() - 0.5 * (c.determinant().ln() + d.dot(&(c.try_inverse().unwrap() * d)))
            };
            let logs: Vec<f64> = parts.iter().map(log).collect();
            let most = logs.iter().copied().fold(f64::MIN, f64::max);
            let total: f64 = logs.iter().map(|l| (l - most).exp()).sum();
            for (sum, l) in sums.iter_mut().zip(&logs) {
                let share = w * (l - most).exp() / total;
                *sum = (sum.0 + share, sum.1 + p * share, sum.2 + p * p.transpose() * share);
            }
        }
        parts = sums
            .into_iter()
            .map(|(w, first, second)| {
                let mean = first / w;
                let white = whitener * (second / w - mean * mean.transpose()) * whitener.transpose();
                let eigen = white.symmetric_eigen();
                let floored = eigen.eigenvectors
                    * Matrix2::from_diagonal(&eigen.eigenvalues.map(|v| v.max(1.0)))
                    * eigen.eigenvectors.transpose();
                (w, mean, lower * floored * lower.transpose())
            })
            .collect();
    }
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
