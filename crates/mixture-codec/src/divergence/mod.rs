//! Four divergences between densities, at points and integrated.
//!
//! With `f = ln p - ln q`:
//!
//! | measure | definition |
//! |---|---|
//! | `KL[p, q]` | `int p f` |
//! | `L1[p, q]` | `int abs(p - q)`, at most 2 |
//! | `ML[p, q]` | `sup abs(f)` |
//! | `DR[p, q]` | `min_a sup abs(f + a) = (sup f - inf f) / 2` |
//!
//! `2 DR` is Hilbert's projective metric: it satisfies the triangle inequality, and neither a Bayes update nor a Markov prediction
//! increases it. The printed formula (minimum inside, maximum outside) is identically zero. For normalised densities
//! `L1^2 <= 2 KL <= 2 ML` and `DR <= ML <= 2 DR`.
//!
//! Over all of `R^d`, ML and DR between an estimate and anything wider than its kernels are infinite. Values that are computed at
//! finitely many points are called `*_plugin`: they are estimates, not bounds.

pub mod plug_in;

use serde::{Deserialize, Serialize};

/// The four measures between two known distributions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Divergence {
    /// Kullback-Leibler divergence in nats; infinite if `q` is zero where `p` is not.
    pub kl: f64,
    /// Integral (sum) of the absolute difference, at most 2.
    pub l1: f64,
    /// Largest absolute log ratio.
    pub ml: f64,
    /// Half the range of the log ratio.
    pub dr: f64,
}
