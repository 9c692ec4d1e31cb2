//! Numerics that every estimator here stands on, free of any probability model.
//!
//! | module | what it holds |
//! |---|---|
//! | [`normal`] | the standard normal distribution, exact in its tails and in narrow cells |
//! | [`quadrature`] | Gauss-Legendre rules |
//! | [`kernels`] | the same functions, sums and exponentials over whole columns, in vector registers |
//! | [`factored`] | a covariance factored once, for densities and draws |
//! | [`linalg`], [`tridiagonal`], [`eigen`] | square roots of singular covariances, tridiagonal systems, eigenvalues |
//! | [`roots`], [`newton`] | roots inside a bracket, without and with a derivative |
//! | [`golden`] | the maximum of a function with one peak |
//! | [`binomial`], [`LogSum`] | binomial coefficients, sums of exponentials that arrive one by one |
//! | [`stored!`] | how types with checking constructors are written and read |
//! | [`wild`] | numbers to test with: no numbers, infinities, the ends of the range |
//! | [`error`] | the argument error all constructors share, and the checks that raise it |
//!
//! The central choice: **probabilities of intervals live in the log domain, and nowhere else is one formed.** It costs an
//! `erfcx` and an `exp` where `1 - cdf` would do in the middle of the distribution. Therefore no filter in this workspace divides
//! by zero when a report was very improbable.
//!
//! ```
//! use fewbits_numerics::normal;
//! // Forty standard deviations out the probability underflows; its logarithm does not.
//! assert_eq!(normal::cdf(-40.0), 0.0);
//! assert!((normal::log_cdf(-40.0) + 804.608_442_013_754).abs() < 1e-9);
//! ```
//!
//! Without the default feature `std` only the functions of [`kernels::scalar`] that need neither a library nor memory are left, `exp`
//! and `ln`, and [`kernels::vectorised`]: what a sensor's half needs. They give the same bits either way.

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
pub use solvers::{golden, newton, roots};
