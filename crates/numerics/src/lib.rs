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
//! | [`error`] | the argument error all constructors share, and the checks that raise it |
//!
//! The central choice: **probabilities of intervals live in the log domain, and nowhere else is one formed.** It costs an
//! `erfcx` and an `exp` where `1 - cdf` would do in the middle of the bell, and it is why no filter in this workspace divides
//! by zero when a bit is surprising.
//!
//! ```
//! use fewbits_numerics::normal;
//! // Forty standard deviations out the probability underflows; its logarithm does not.
//! assert_eq!(normal::cdf(-40.0), 0.0);
//! assert!((normal::log_cdf(-40.0) + 804.608_442_013_754).abs() < 1e-9);
//! ```

pub mod binomial;
mod constants;
pub mod error;
pub mod kernels;
mod linear_algebra;
mod log_sum;
pub mod normal;
pub mod quadrature;
mod solvers;
pub mod stored;

pub use error::ArgumentError;
pub use linear_algebra::{eigen, factored, linalg, tridiagonal};
pub use log_sum::LogSum;
pub use solvers::{golden, newton, roots};
