//! Cuts of a tree: a choice of nodes whose Gaussians replace the estimate, found greedily or by dynamic programming.

use crate::plug_in::{PlugIn, node_errors};
use crate::tree::ROOT;
use crate::{Error, Tree};
use fewbits_densities::{KernelEstimate, Mixture};
use fewbits_numerics::error::{at_least_one, entries, refuse};
use fewbits_numerics::factored::half_log_det;
use serde::{Deserialize, Serialize};

/// The error that a cut minimises.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Criterion {
    /// The largest plug-in ML of a chosen node.
    Ml,
    /// The weighted sum of plug-in KLs; negative ones are replaced by 0.
    Kl,
    /// The weighted sum of plug-in L1s.
    L1,
    /// The weighted sum of `(ln det S - ln det H)/2`, an upper bound of the KL in closed form that needs no kernel evaluations.
    LogDeterminant,
}

/// How the errors of the chosen nodes combine to a bound for the whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Combine {
    Max,
    Sum,
}

impl Combine {
    fn of(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Max => a.max(b),
            Self::Sum => a + b,
        }
    }
}

/// The error of every node of a tree under one criterion, multiplied by the node's weight if the criterion is a sum.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeErrors {
    values: Vec<f64>,
    combine: Combine,
}

impl NodeErrors {
    /// Errors under a criterion. All but [`Criterion::LogDeterminant`] need `n^2/2` kernels. For several criteria use
    /// [`NodeErrors::from_plug_in`], which shares these evaluations.
    ///
    /// # Errors
    /// Does not occur for a tree of this estimate.
    pub fn new<const D: usize>(
        estimate: &KernelEstimate<D>,
        tree: &Tree<D>,
        criterion: Criterion,
    ) -> Result<Self, Error> {
        if criterion != Criterion::LogDeterminant {
            let plug_in = node_errors(estimate, tree)?;
            return Self::from_plug_in(tree, &plug_in, criterion);
        }
        let floor = estimate.kernel_factor().half_log_det;
        let closed = tree.nodes().iter().map(|node| match node.children {
            None => 0.0,
            Some(_) => node.weight * (half_log_det(&node.covariance) - floor).max(0.0),
        });
        Ok(Self {
            values: closed.collect(),
            combine: Combine::Sum,
        })
    }

    /// Errors under a criterion from the plug-in errors of all nodes.
    ///
    /// # Errors
    /// If there is not one per node, or the criterion is [`Criterion::LogDeterminant`].
    pub fn from_plug_in<const D: usize>(
        tree: &Tree<D>,
        plug_in: &[PlugIn],
        criterion: Criterion,
    ) -> Result<Self, Error> {
        entries("plug_in", plug_in.len(), tree.nodes().len())?;
        let nodes = tree.nodes().iter().zip(plug_in);
        let (values, combine) = match criterion {
            // The ML of a mixture is at most the largest of its parts, whatever their weights. KL and L1 add up with them.
            Criterion::Ml => (nodes.map(|(_, e)| e.ml_plugin).collect(), Combine::Max),
            Criterion::Kl => (nodes.map(|(n, e)| n.weight * e.kl_plugin.max(0.0)).collect(), Combine::Sum),
            Criterion::L1 => (nodes.map(|(n, e)| n.weight * e.l1_plugin).collect(), Combine::Sum),
            Criterion::LogDeterminant => {
                return refuse("criterion", "LogDeterminant", "ML, KL or L1");
            }
        };
        Ok(Self { values, combine })
    }

    /// Error of each node; for a sum it includes the node's weight.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Bound `B(S)` of a cut: the largest error of its nodes, or their sum.
    pub fn bound(&self, cut: &[usize]) -> f64 {
        cut.iter()
            .filter_map(|s| self.values.get(*s))
            .fold(0.0, |total, e| self.combine.of(total, *e))
    }
}

/// A choice of nodes such that every leaf has exactly one of them as ancestor or is one itself, and its bound.
#[derive(Debug, Clone, PartialEq)]
pub struct Cut {
    /// The nodes, left to right.
    pub nodes: Vec<usize>,
    /// The error bound `B(S)` under the criterion of the cut.
    pub bound: f64,
}

impl Cut {
    /// The nodes' Gaussians, each with its node's weight.
    ///
    /// # Errors
    /// If the cut is not one of this tree.
    pub fn mixture<const D: usize>(&self, tree: &Tree<D>) -> Result<Mixture<D>, Error> {
        tree.check_cut(&self.nodes)?;
        let components = self.nodes.iter().map(|s| tree.nodes()[*s].component());
        Mixture::new(components.collect::<Result<_, _>>()?)
    }
}

/// Repeatedly splits the node of largest error, as long as there are at most `components` nodes, and returns the best cut found
/// (Algorithm 1 with errata: the number of nodes is tested before the split, and the weight is inside the maximum).
///
/// A split can increase the bound, so the best cut may have fewer nodes than allowed. If every leaf is allowed, all
/// leaves are returned, with error 0.
///
/// # Errors
/// If `components` is 0 or the errors are not of this tree.
pub fn greedy<const D: usize>(tree: &Tree<D>, errors: &NodeErrors, components: usize) -> Result<Cut, Error> {
    at_least_one("components", components)?;
    greedy_within(tree, errors, |_| 1.0, components as f64)
}

/// As [`greedy`], with a price per node (such as a code length in bits) and a limit of their sum. Two children must
/// together cost more than their parent. If all leaves are within the limit, they are the result.
///
/// # Errors
/// If the root alone exceeds the limit, or the errors are not of this tree.
pub fn greedy_within<const D: usize>(
    tree: &Tree<D>,
    errors: &NodeErrors,
    price: impl Fn(usize) -> f64,
    limit: f64,
) -> Result<Cut, Error> {
    check(tree, errors)?;
    let mut total = price(ROOT);
    if !matches!(total.partial_cmp(&limit), Some(std::cmp::Ordering::Less | std::cmp::Ordering::Equal)) {
        return refuse("limit", limit, format!("at least {total}, the price of the root"));
    }
    // Plug-in errors of inner nodes may happen to be 0 or negative, so the loop must not stop there.
    let leaves = leaves(tree);
    if leaves.nodes.iter().map(|leaf| price(*leaf)).sum::<f64>() <= limit {
        return Ok(leaves);
    }
    let mut cut = vec![ROOT];
    let mut best = Cut {
        bound: errors.bound(&cut),
        nodes: cut.clone(),
    };
    loop {
        // Of equal errors the first is taken.
        let worst = (1..cut.len()).fold(0, |w, i| {
            if errors.values[cut[i]] > errors.values[cut[w]] {
                i
            } else {
                w
            }
        });
        let Some([left, right]) = tree.nodes()[cut[worst]].children else {
            return Ok(best);
        };
        total += price(left) + price(right) - price(cut[worst]);
        if total.is_nan() || total > limit {
            return Ok(best);
        }
        // The children take the place of their parent, so the cut stays in order from left to right.
        cut.splice(worst..=worst, [left, right]);
        let bound = errors.bound(&cut);
        if bound < best.bound {
            best = Cut {
                nodes: cut.clone(),
                bound,
            };
        }
    }
}

/// The cut of smallest bound among all with at most `components` nodes, by dynamic programming from the leaves to the root:
/// `B(s, m) = min(e(s), min_a B(s_L, a) (+ or max) B(s_R, m - a))`. `O(n m^2)`. If every leaf is allowed, all leaves are
/// returned.
///
/// # Errors
/// If `components` is 0 or the errors are not of this tree.
pub fn optimal<const D: usize>(tree: &Tree<D>, errors: &NodeErrors, components: usize) -> Result<Cut, Error> {
    at_least_one("components", components)?;
    check(tree, errors)?;
    let nodes = tree.nodes();
    if components >= nodes[ROOT].range.len() {
        return Ok(leaves(tree));
    }
    // For each node and budget of 1, 2, ... nodes: the smallest bound, and how many nodes the left child gets (0: no split).
    let mut tables: Vec<Vec<(f64, usize)>> = vec![Vec::new(); nodes.len()];
    for (index, node) in nodes.iter().enumerate().rev() {
        let own = match node.children {
            None => 0.0,
            Some(_) => errors.values[index],
        };
        let most = node.range.len().min(components);
        let mut table = vec![(own, 0); most];
        if let Some([left, right]) = node.children {
            for m in 2..=most {
                let mut best = table[m - 2];
                let (l, r) = (&tables[left], &tables[right]);
                for a in m.saturating_sub(r.len()).max(1)..=l.len().min(m - 1) {
                    let bound = errors.combine.of(l[a - 1].0, r[m - a - 1].0);
                    if bound < best.0 {
                        best = (bound, a);
                    }
                }
                // If no split into so many nodes improves the bound, the entry of the smaller budget is copied. Its share of the left child
                // belongs to that smaller budget, which the reconstruction below therefore searches first.
                table[m - 1] = best;
            }
        }
        tables[index] = table;
    }
    let mut cut = Vec::new();
    let mut pending = vec![(ROOT, nodes[ROOT].range.len().min(components))];
    while let Some((index, m)) = pending.pop() {
        let table = &tables[index];
        // The smallest budget that has the same bound.
        let m = (1..=m).find(|k| table[k - 1].0 <= table[m - 1].0).unwrap_or(m);
        match (table[m - 1].1, nodes[index].children) {
            (a, Some([left, right])) if a > 0 => {
                pending.push((right, m - a));
                pending.push((left, a));
            }
            _ => cut.push(index),
        }
    }
    Ok(Cut {
        bound: errors.bound(&cut),
        nodes: cut,
    })
}

/// The cut of all leaves, left to right, which is the estimate itself.
fn leaves<const D: usize>(tree: &Tree<D>) -> Cut {
    let nodes = tree.nodes();
    let mut leaves: Vec<usize> = (0..nodes.len()).filter(|s| nodes[*s].children.is_none()).collect();
    leaves.sort_by_key(|s| nodes[*s].range.start);
    Cut {
        nodes: leaves,
        bound: 0.0,
    }
}

fn check<const D: usize>(tree: &Tree<D>, errors: &NodeErrors) -> Result<(), Error> {
    Ok(entries("errors", errors.values.len(), tree.nodes().len())?)
}
