//! A particle filter whose belief is handed from node to node as a small message.
//!
//! The sensor nearest to a target leads: it alone measures, and it sends its belief to the next leader. A cloud of 500 particles is 32
//! kbit; a mixture of five Gaussians that approximates it takes 136 bits. Every step therefore loses some information, and the losses
//! accumulate. This crate has:
//!
//! - [`HandoffFilter`]: one leader's step, from the received mixture to the one that is sent. A [`Reducer`] reduces the belief:
//!   to a number of components, to a number of bits, or by a type of your own.
//! - [`Leaders`]: the same with messages as bits from node to node, over any network that runs the walks of `fewbits-protocol`.
//!
//! ```
//! use fewbits_core::Belief;
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
//! Not in this crate: the choice of the leader (by the simulated network), the true state, energy.

mod filter;
mod leaders;
mod reducer;

pub use fewbits_core::Error;
pub use filter::{HandoffFilter, HandoffInfo, trimmed};
pub use leaders::Leaders;
pub use reducer::{Coded, Components, Handover, RateLimited, Reducer, Whole};
