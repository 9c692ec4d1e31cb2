//! Binary trees over the kernels of an estimate, with the moments of every node.

use crate::Error;
use fewbits_densities::{Component, KernelEstimate};
use fewbits_numerics::eigen::symmetric_eigen;
use fewbits_numerics::error::refuse;
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The direction along which a node is split.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Axis {
    /// The coordinate axis with the largest weighted variance of the centres, the lowest on a tie: a KD-tree.
    Widest,
    /// The principal axis of the centres, in coordinates where the kernel is isotropic.
    Principal,
    /// The coordinate axes in turn. Gives much worse reductions; for comparison.
    Alternating,
}

/// The position along the direction at which a node is split.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum At {
    /// The left child gets the first `ceil(n/2)` kernels.
    CountMedian,
    /// The left child gets kernels until it has half of the weight; it gets at least one and not all.
    WeightMedian,
}

/// How a tree is built.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Split {
    /// Direction of a split.
    pub axis: Axis,
    /// Place of a split.
    pub at: At,
}

impl Split {
    /// The KD-tree of the paper.
    pub const KD: Self = Self {
        axis: Axis::Widest,
        at: At::CountMedian,
    };
    /// Principal axes and weight medians, as the recommended reduction uses them.
    pub const PRINCIPAL: Self = Self {
        axis: Axis::Principal,
        at: At::WeightMedian,
    };
}

/// A node of a [`Tree`]: a contiguous range of kernels in the tree's order, and their moments.
#[derive(Debug, Clone, PartialEq)]
pub struct Node<const D: usize> {
    /// Its kernels as a range of positions in the tree's order, in which those of a node are contiguous.
    pub range: Range<usize>,
    /// Indices of the two children; `None` for a leaf.
    pub children: Option<[usize; 2]>,
    /// Total weight.
    pub weight: f64,
    /// Weighted mean of the centres.
    pub mean: SVector<f64, D>,
    /// Weighted covariance of the centres plus the kernel: the covariance of the node's density.
    pub covariance: SMatrix<f64, D, D>,
}

impl<const D: usize> Node<D> {
    /// The node's Gaussian, with the node's weight.
    ///
    /// # Errors
    /// If the node's covariance is not positive definite, which cannot happen for a node of a tree.
    pub(crate) fn component(&self) -> Result<Component<D>, Error> {
        Component::new(self.weight, self.mean, self.covariance)
    }
}

/// A binary tree over the kernels of an estimate: `2 n - 1` nodes, the root first.
///
/// Moments are computed from the children by `w = w_L + w_R`, `m = (w_L m_L + w_R m_R)/w`, `S = sum_k (w_k/w)(S_k + (m_k - m)(m_k - m)')`,
/// without subtraction of large numbers. Nodes are split by position in a stable order, not by value, so duplicates of a resampled cloud do
/// no harm. `O(n log^2 n)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Tree<const D: usize> {
    nodes: Vec<Node<D>>,
    order: Vec<usize>,
}

/// The root.
pub(crate) const ROOT: usize = 0;

impl<const D: usize> Tree<D> {
    /// Builds the tree. Kernels of weight zero are left out.
    ///
    /// # Errors
    /// [`Error::Impossible`] if every weight is zero, which cannot happen for a valid estimate.
    pub fn new(estimate: &KernelEstimate<D>, split: Split) -> Result<Self, Error> {
        let weights = estimate.particles().weights();
        let order: Vec<usize> = (0..weights.len()).filter(|i| weights[*i] > 0.0).collect();
        if order.is_empty() {
            return Err(Error::Impossible);
        }
        let mut tree = Self {
            nodes: Vec::with_capacity(2 * order.len()),
            order,
        };
        tree.build(estimate, split);
        Ok(tree)
    }

    /// Adds the root and all nodes below it. The depth is `O(log n)` with count medians but can be `n` with extreme weights, so an
    /// explicit stack is used instead of recursion.
    fn build(&mut self, estimate: &KernelEstimate<D>, split: Split) {
        let mut keys = vec![0.0; estimate.particles().weights().len()];
        let mut pending = vec![(0..self.order.len(), 0, None::<(usize, usize)>)];
        while let Some((range, depth, parent)) = pending.pop() {
            let index = self.nodes.len();
            if let Some((parent, side)) = parent
                && let Some(children) = &mut self.nodes[parent].children
            {
                children[side] = index;
            }
            let mut node = Node {
                range: range.clone(),
                children: None,
                weight: 0.0,
                mean: SVector::zeros(),
                covariance: *estimate.kernel(),
            };
            if range.len() > 1 {
                node.children = Some([0, 0]);
                let middle = self.part(estimate, split, range.clone(), depth, &mut keys);
                pending.push((middle..range.end, depth + 1, Some((index, 1))));
                pending.push((range.start..middle, depth + 1, Some((index, 0))));
            }
            self.nodes.push(node);
        }
        // Children have larger indices than their parent, so in reverse order they come first.
        for index in (0..self.nodes.len()).rev() {
            self.fill_moments(estimate, index);
        }
    }

    fn fill_moments(&mut self, estimate: &KernelEstimate<D>, index: usize) {
        let (weight, mean, covariance) = match self.nodes[index].children {
            None => {
                let i = self.order[self.nodes[index].range.start];
                let columns = estimate.particles().columns();
                let centre = SVector::from_fn(|d, _| columns[d][i]);
                (estimate.particles().weights()[i], centre, *estimate.kernel())
            }
            Some([left, right]) => {
                let (l, r) = (&self.nodes[left], &self.nodes[right]);
                let weight = l.weight + r.weight;
                let (a, b) = (l.weight / weight, r.weight / weight);
                let gap = r.mean - l.mean;
                let between = gap * gap.transpose() * (a * b);
                (weight, l.mean + gap * b, l.covariance * a + r.covariance * b + between)
            }
        };
        let node = &mut self.nodes[index];
        (node.weight, node.mean, node.covariance) = (weight, mean, covariance);
    }

    /// Orders the kernels of `range` along the split direction and returns the first position of the right child.
    fn part(
        &mut self,
        estimate: &KernelEstimate<D>,
        split: Split,
        range: Range<usize>,
        depth: usize,
        keys: &mut [f64],
    ) -> usize {
        let weights = estimate.particles().weights();
        let own = &mut self.order[range.clone()];
        let raw = estimate.particles().columns();
        let columns: [&[f64]; D] = match split.axis {
            Axis::Principal => estimate.whitened_centres().each_ref().map(Vec::as_slice),
            Axis::Widest | Axis::Alternating => raw,
        };
        let total: f64 = own.iter().map(|i| weights[*i]).sum();
        let mean: [f64; D] =
            std::array::from_fn(|d| own.iter().map(|i| weights[*i] * columns[d][*i]).sum::<f64>() / total);
        let moment = |a: usize, b: usize, own: &[usize]| -> f64 {
            own.iter()
                .map(|i| weights[*i] * (columns[a][*i] - mean[a]) * (columns[b][*i] - mean[b]))
                .sum::<f64>()
                / total
        };
        // The axis along which to split.
        let direction: SVector<f64, D> = match split.axis {
            Axis::Widest => {
                let spread: [f64; D] = std::array::from_fn(|d| moment(d, d, own));
                let widest = (1..D).fold(0, |best, d| if spread[d] > spread[best] { d } else { best });
                SVector::from_fn(|d, _| f64::from(u8::from(d == widest)))
            }
            Axis::Alternating => SVector::from_fn(|d, _| f64::from(u8::from(d == depth % D.max(1)))),
            Axis::Principal => {
                let scatter = SMatrix::<f64, D, D>::from_fn(|a, b| moment(a, b, own));
                let (values, vectors) = symmetric_eigen(scatter);
                vectors.column(values.imax()).into_owned()
            }
        };
        for i in own.iter() {
            keys[*i] = (0..D)
                .filter(|d| direction[*d] != 0.0)
                .map(|d| direction[d] * columns[d][*i])
                .sum();
        }
        // Ties are decided by index, so that the order does not depend on the sorting algorithm.
        own.sort_by(|a, b| keys[*a].total_cmp(&keys[*b]).then(a.cmp(b)));
        let left = match split.at {
            At::CountMedian => own.len().div_ceil(2),
            At::WeightMedian => {
                let mut cumulative = 0.0;
                let reached = own.iter().take_while(|i| {
                    cumulative += weights[**i];
                    cumulative < 0.5 * total
                });
                (reached.count() + 1).clamp(1, own.len() - 1)
            }
        };
        range.start + left
    }

    /// The nodes: parents before their children, the root first.
    pub fn nodes(&self) -> &[Node<D>] {
        &self.nodes
    }

    /// The kernels in the tree's order, in which those of a node are contiguous.
    pub(crate) fn order(&self) -> &[usize] {
        &self.order
    }

    /// The kernels under a node, as increasing indices into the estimate; empty if there is no such node.
    pub fn members(&self, index: usize) -> Vec<usize> {
        let mut members = self
            .nodes
            .get(index)
            .map_or(Vec::new(), |node| self.order[node.range.clone()].to_vec());
        members.sort_unstable();
        members
    }

    /// Checks that every leaf has exactly one node of `cut` among its ancestors and itself.
    ///
    /// # Errors
    /// If this is not so.
    pub(crate) fn check_cut(&self, cut: &[usize]) -> Result<(), Error> {
        let mut ranges: Vec<Range<usize>> = Vec::with_capacity(cut.len());
        for index in cut {
            match self.nodes.get(*index) {
                Some(node) => ranges.push(node.range.clone()),
                None => {
                    return refuse("cut", index, format!("nodes below {}", self.nodes.len()));
                }
            }
        }
        ranges.sort_by_key(|r| r.start);
        let reached = ranges.iter().try_fold(0, |at, r| (r.start == at).then_some(r.end));
        if reached == Some(self.order.len()) {
            Ok(())
        } else {
            let expected = "exactly one ancestor-or-self of every leaf";
            refuse("cut", format!("{cut:?}"), expected)
        }
    }
}
