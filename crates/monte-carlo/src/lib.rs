//! Random streams, the Monte-Carlo engine, and statistics with standard errors.
//!
//! ```
//! use fewbits_monte_carlo::{Moments, MonteCarlo, Stream};
//! use rand::RngExt;
//! let run = MonteCarlo::new(Stream::new(1).named("mean of a uniform"), 10_000);
//! let mean = run.fold(
//!     Moments::default,
//!     |sum, trial| Ok::<_, std::convert::Infallible>(sum.add(trial.stream.rng().random())),
//!     |total, part| total.merge(&part),
//! )?;
//! assert!(mean.estimate().z_score(0.5).abs() < 4.0);
//! # Ok::<(), fewbits_monte_carlo::MonteCarloError>(())
//! ```
//!
//! With feature `mpi` (needs an MPI library and libclang) `MonteCarlo::fold_over` and `MonteCarlo::run_over` distribute trials over the
//! ranks of an MPI job. Their result is bitwise that of one process.

pub mod engine;
pub mod parallel;
#[cfg(feature = "mpi")]
mod ranks;
pub mod statistics;
pub mod stream;

#[cfg(feature = "mpi")]
pub use mpi;

pub use engine::{MonteCarlo, MonteCarloError, Trial};
pub use statistics::{Estimate, Moments};
pub use stream::Stream;
