//! Reductions of the paper, its bounds between divergences, and divergences integrated over all of space. The recommended reduction is
//! [`Reduction::default`](fewbits_mixture_codec::Reduction::default).

pub mod divergence;
pub mod quadrature;

use fewbits_densities::KernelEstimate;
use fewbits_mixture_codec::Error;
use fewbits_mixture_codec::plug_in::node_errors;
use fewbits_mixture_codec::reduction::cut::{Criterion, NodeErrors};
use fewbits_mixture_codec::tree::{Split, Tree};

/// The paper's reductions of one estimate under its three criteria. The errors of the tree's nodes are evaluated only once.
#[derive(Debug, Clone)]
pub struct PaperReductions<const D: usize> {
    /// The tree.
    pub tree: Tree<D>,
    /// Node errors under ML, KL and L1.
    pub errors: [NodeErrors; 3],
}

impl<const D: usize> PaperReductions<D> {
    /// The criteria in the order of [`errors`](Self::errors).
    pub const CRITERIA: [Criterion; 3] = [Criterion::Ml, Criterion::Kl, Criterion::L1];

    /// Builds the KD-tree and its errors.
    ///
    /// # Errors
    /// If a node's covariance is not positive definite, which cannot happen for a valid estimate.
    pub fn new(estimate: &KernelEstimate<D>) -> Result<Self, Error> {
        let tree = Tree::new(estimate, Split::KD)?;
        let plug_in = node_errors(estimate, &tree)?;
        let of = |criterion| NodeErrors::from_plug_in(&tree, &plug_in, criterion);
        let errors = [of(Criterion::Ml)?, of(Criterion::Kl)?, of(Criterion::L1)?];
        Ok(Self { tree, errors })
    }
}
