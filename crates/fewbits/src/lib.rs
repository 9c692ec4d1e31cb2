//! Estimation from sensors that may hardly speak: one bit a sample, a message only when it matters.
//!
//! This crate only re-exports; depend on the single crates if you need one of them. Each is behind a feature of its name,
//! all on by default:
//!
//! | module | feature | what it is for |
//! |---|---|---|
//! | [`core`] | always | normal numerics, messages and their bits, likelihoods, random streams, Monte Carlo |
//! | `dymbo` | `dymbo` | Kalman-like filters fed with one sign bit a sample |
//! | `cfwmd` | `cfwmd` | sensors that censor dull measurements, and fusion that hears their silence |
//! | `quantizers` | `quantizers` | design and decoding of distributed scalar and binary quantizers |
//! | `filters`, `models`, `densities` | `filters` | Kalman, particle and exact grid filters, and what they run on |

pub use fewbits_core as core;

#[cfg(feature = "cfwmd")]
pub use fewbits_cfwmd as cfwmd;
#[cfg(feature = "filters")]
pub use fewbits_densities as densities;
#[cfg(feature = "dymbo")]
pub use fewbits_dymbo as dymbo;
#[cfg(feature = "filters")]
pub use fewbits_filters as filters;
#[cfg(feature = "filters")]
pub use fewbits_models as models;
#[cfg(feature = "quantizers")]
pub use fewbits_quantizers as quantizers;

/// The README's program, kept compiling.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
