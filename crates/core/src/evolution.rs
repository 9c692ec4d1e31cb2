//! Dynamics in continuous time.

use crate::dynamics::GaussianDynamics;
use fewbits_numerics::ArgumentError;

/// Dynamics in continuous time: gives the discrete dynamics over any number of seconds, so that samples need not be regular.
///
/// Laws ([`crate::laws::evolution`]): `over(a + b)` has the mean and covariance of `over(a)` followed by `over(b)`; `over(0)` is the
/// identity.
pub trait Evolution<const D: usize> {
    /// Dynamics over a fixed time.
    type Step: GaussianDynamics<D>;

    /// The dynamics over `seconds`.
    ///
    /// # Errors
    /// If the time is negative or not finite, or so long that a number overflows.
    fn over(&self, seconds: f64) -> Result<Self::Step, ArgumentError>;
}
