//! Numerical functions for all crates of the workspace. They assume no probability model.
//!
//! | module | what it holds |
//! |---|---|
//! | [`normal`] | the standard normal distribution, exact in its tails and in narrow cells |
//! | [`quadrature`] | Gauss-Legendre rules |
//! | [`kernels`] | the same functions, sums and exponentials over whole slices, in vector registers |
//! | [`factored`] | a covariance factored once, for densities and draws |
//! | [`linalg`], [`tridiagonal`], [`eigen`] | square roots of singular covariances, tridiagonal systems, eigenvalues |
//! | [`roots`], [`newton`] | roots inside a bracket, without and with a derivative |
//! | [`bisect`], [`golden`] | the place where a condition changes; the maximum of a function with one peak |
//! | [`binomial`], [`LogSum`], [`Runs`] | binomial coefficients, sums of exponentials that arrive one by one, runs of equal values |
//! | [`mod@stored`] | serde forms of matrices and of numbers that may be infinite |
//! | [`wild`] | extreme numbers for tests: NaN, infinities, the ends of the range |
//! | [`error`] | the argument error all constructors share, and the checks that raise it |
//!
//! Design rule: **probabilities of intervals are kept as logarithms.** This costs an `erfcx` and an `exp` where `1 - cdf` would be enough
//! in the middle of the distribution. In return, no filter in this workspace divides by zero when a report was very improbable.
//!
//! ```
//! use fewbits_numerics::normal;
//! // Forty standard deviations out the probability underflows; its logarithm does not.
//! assert_eq!(normal::cdf(-40.0), 0.0);
//! assert!((normal::log_cdf(-40.0) + 804.608_442_013_754).abs() < 1e-9);
//! ```
//!
//! Without the default feature `std` only [`kernels::scalar`]'s `exp` and `ln` and [`kernels::vectorised`] remain, which need neither the
//! standard library nor memory allocation. This is enough for a sensor. They give the same bits as with `std`.

#![cfg_attr(not(feature = "std"), no_std)]

#[cfg(feature = "std")]
pub mod binomial;
mod constants;
#[cfg(feature = "std")]
pub mod error;
pub mod kernels;
#[cfg(feature = "std")]
mod linear_algebra;
#[cfg(feature = "std")]
mod log_sum;
#[cfg(feature = "std")]
pub mod normal;
#[cfg(feature = "std")]
pub mod quadrature;
#[cfg(feature = "std")]
mod runs;
#[cfg(feature = "std")]
mod solvers;
#[cfg(feature = "std")]
pub mod stored;
#[cfg(feature = "std")]
pub mod wild;

#[cfg(feature = "std")]
pub use error::ArgumentError;
#[cfg(feature = "std")]
pub use linear_algebra::{eigen, factored, linalg, tridiagonal};
#[cfg(feature = "std")]
pub use log_sum::LogSum;
#[cfg(feature = "std")]
pub use runs::Runs;
#[cfg(feature = "std")]
pub use solvers::{bisect, golden, newton, roots};
