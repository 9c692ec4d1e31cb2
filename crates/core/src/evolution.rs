//! Dynamics in continuous time.

use crate::dynamics::GaussianDynamics;
use fewbits_numerics::ArgumentError;

/// Dynamics in continuous time: gives the discrete dynamics over any number of seconds, so that samples need not be regular. Object-safe.
///
/// A concrete type may have an inherent `over` that returns the dynamics by their own type, for static use.
///
/// Laws ([`crate::laws::evolution`]): `over(a + b)` has the mean and covariance of `over(a)` followed by `over(b)`; `over(0)` is the
/// identity.
pub trait Evolution<const D: usize>: Send + Sync {
    /// The dynamics over `seconds`.
    ///
    /// # Errors
    /// If the time is negative or not finite, or so long that a number overflows.
    fn over(&self, seconds: f64) -> Result<Box<dyn GaussianDynamics<D> + '_>, ArgumentError>;
}

impl<const D: usize, E: Evolution<D> + ?Sized> Evolution<D> for Box<E> {
    fn over(&self, seconds: f64) -> Result<Box<dyn GaussianDynamics<D> + '_>, ArgumentError> {
        (**self).over(seconds)
    }
}
