//! Reductions of a kernel estimate to a mixture of few components: the recommended one and those of the paper.

mod clumps;
pub mod cut;
mod em;
pub mod merge;
mod mixture_fit;
mod refine;

pub use clumps::{Clump, Clumps};
pub use mixture_fit::MixtureFit;
pub use refine::refine;

use crate::Error;
use crate::plug_in::Cubature;
use crate::tree::{Split, Tree};
use cut::{Criterion, NodeErrors, greedy, optimal};
use fewbits_core::Belief;
use fewbits_densities::{Component, KernelEstimate, Mixture};
use fewbits_numerics::error::at_least_one;
use merge::{MergeCost, merge};
use serde::{Deserialize, Serialize};

/// A method that reduces an estimate to a given number of components.
///
/// ```
/// use fewbits_core::Belief;
/// use fewbits_mixture_codec::Reduction;
/// use fewbits_densities::{Bandwidth, KernelEstimate, Particles};
/// let x: Vec<f64> = (0..100).map(|i| (f64::from(i) * 0.7).sin() + f64::from(i % 2)).collect();
/// let estimate = KernelEstimate::fit(Particles::uniform([x])?, &Bandwidth::default())?;
/// let mixture = Reduction::default().reduce(&estimate, 3)?;
/// assert!(mixture.len() <= 3 && (mixture.mean() - estimate.mean()).amax() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Reduction {
    /// The Gaussian of the same mean and covariance.
    SingleGaussian,
    /// A greedy cut of a tree (Algorithm 1 with errata); with [`Split::KD`] it is the paper's method.
    Greedy {
        /// How the tree is built.
        split: Split,
        /// The error that the cut minimises.
        criterion: Criterion,
    },
    /// The optimal cut of a tree.
    Optimal {
        /// How the tree is built.
        split: Split,
        /// The error that the cut minimises.
        criterion: Criterion,
    },
    /// Pairwise merging of all kernels. It evaluates `O(n^2)` costs, takes several times as long as the pipeline and is no better.
    Merging {
        /// The cost of a merge.
        cost: MergeCost,
    },
    /// A greedy cut to `cut` nodes in closed form, then Runnalls merging, then expectation-maximisation with a lower limit of the
    /// covariances.
    Pipeline {
        /// Number of nodes of the cut.
        cut: usize,
        /// Number of iterations of expectation-maximisation.
        iterations: usize,
    },
}

impl Default for Reduction {
    /// The recommended pipeline: a cut to 60 nodes and 15 iterations.
    fn default() -> Self {
        Self::Pipeline {
            cut: 60,
            iterations: 15,
        }
    }
}

impl Reduction {
    /// The paper's method with one of its three criteria.
    pub const fn paper(criterion: Criterion) -> Self {
        Self::Greedy {
            split: Split::KD,
            criterion,
        }
    }

    /// Reduces the estimate to at most `components` components. All methods but the pipeline keep mean and covariance exactly. The
    /// pipeline keeps the mean to the accuracy of its cubature, and the covariance except where its lower limit applies.
    ///
    /// # Errors
    /// If `components` is 0.
    pub fn reduce<const D: usize>(&self, estimate: &KernelEstimate<D>, components: usize) -> Result<Mixture<D>, Error> {
        at_least_one("components", components)?;
        match *self {
            Self::SingleGaussian => {
                let c = Component::new(1.0, estimate.mean(), estimate.covariance())?;
                Ok(Mixture::new(vec![c])?)
            }
            Self::Greedy { split, criterion } => {
                let tree = Tree::new(estimate, split)?;
                let errors = NodeErrors::new(estimate, &tree, criterion)?;
                greedy(&tree, &errors, components)?.mixture(&tree)
            }
            Self::Optimal { split, criterion } => {
                let tree = Tree::new(estimate, split)?;
                let errors = NodeErrors::new(estimate, &tree, criterion)?;
                optimal(&tree, &errors, components)?.mixture(&tree)
            }
            Self::Merging { cost } => Ok(merge(&estimate.to_mixture()?, components, cost)?.mixture),
            Self::Pipeline { cut, iterations } => {
                let tree = Tree::new(estimate, Split::PRINCIPAL)?;
                let errors = NodeErrors::new(estimate, &tree, Criterion::LogDeterminant)?;
                // Cut to an intermediate number of components, merge pairs to the final number, then fit to the whole estimate.
                let coarse = greedy(&tree, &errors, cut.max(components))?.mixture(&tree)?;
                let merged = merge(&coarse, components, MergeCost::Runnalls)?.mixture;
                let rule = if D <= 3 {
                    Cubature::GaussHermite
                } else {
                    Cubature::Spherical
                };
                refine(estimate, &merged, iterations, rule)
            }
        }
    }
}
