//! Dynamics over any stretch of time.

use crate::dynamics::GaussianDynamics;
use fewbits_numerics::ArgumentError;

/// A world that moves in continuous time: its dynamics over any number of seconds, so that irregular samples are the normal case.
///
/// Laws ([`crate::laws::evolution`]): `over(a + b)` has the mean and covariance of `over(a)` followed by `over(b)`; `over(0)` is the
/// identity.
pub trait Evolution<const D: usize> {
    /// Dynamics over a fixed time.
    type Step: GaussianDynamics<D>;

    /// The dynamics over `seconds`.
    ///
    /// # Errors
    /// If the time is negative or not finite, or so long that the state leaves the range of numbers.
    fn over(&self, seconds: f64) -> Result<Self::Step, ArgumentError>;
}
