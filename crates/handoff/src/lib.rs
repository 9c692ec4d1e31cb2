//! A particle filter whose belief travels.
//!
//! The sensor nearest to a target leads: it alone measures, and hands what is known on to the next leader. A cloud of 500
//! particles is 32 kbit; five Gaussians that say nearly the same are 136 bits. So every step ends in a loss, and the losses
//! act on each other. This crate has both halves:
//!
//! - [`HandoffFilter`]: one leader's step, from the mixture that was received to the one that is sent. How the belief is reduced
//!   is a [`Reducer`]: to a number of components, to a number of bits, or a type of your own.
//! - [`Leaders`]: the same as bits from node to node, over any network that runs the walks of `fewbits-protocol`.
//! - [`published::bounds`]: what the losses of all steps say about the error at the end, by the bounds as printed, corrected and
//!   tightened.
//!
//! ```
//! use fewbits_core::factor::Value;
//! use fewbits_core::{Gaussian, Observed};
//! use fewbits_densities::Mixture;
//! use fewbits_handoff::{Components, HandoffFilter};
//! use fewbits_models::{Ar1, ScalarSensor};
//! use fewbits_monte_carlo::Stream;
//! use nalgebra::Vector1;
//!
//! let leader = HandoffFilter::new(200, Components::new(3))?;
//! let (walk, sensor) = (Ar1::new(0.95, 0.1)?, ScalarSensor::scalar(Vector1::new(1.0), 0.2)?);
//! let mut rng = Stream::new(1).rng();
//! let mut known = Mixture::single(&Gaussian::scalar(0.0, 1.0)?)?;
//! for z in [0.4, 0.7, 0.2] {
//!     let measured = Value::new(Vector1::new(z), [[0.2]].into())?;
//!     let (handover, _) = leader.step(&mut rng, &known, &walk, &Observed::new(sensor, measured))?;
//!     known = handover.into_mixture();
//! }
//! assert!(known.len() <= 3 && known.mean()[0].abs() < 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not here: who leads (the simulated network decides), the true state, the price of energy.

mod filter;
mod leaders;
pub mod published;
mod reducer;

pub use fewbits_core::Error;
pub use filter::{HandoffFilter, HandoffInfo, trimmed};
pub use leaders::Leaders;
pub use reducer::{Coded, Components, Handover, RateLimited, Reducer, Whole};
