//! Joint design of the scalar quantizers of several sensors, and decoders for their symbols.
//!
//! Several sensors measure one unknown with noise, and each may report a few bits. The design chooses the cells of each sensor, and the
//! word of each cell, so that the estimate from all words is best. Start with [`Request`]: it takes the prior and the noise
//! ([`ObservationModel`]), the bits of each sensor ([`BitBudget`]) and the link, and returns [`Solutions`], best first. A [`Solution`]
//! encodes and decodes, and can be exported as a table, JSON, a C header or Rust constants ([`Export`]).
//!
//! ```
//! use fewbits_core::Link;
//! use fewbits_quantizer_design::{BitBudget, Noise, Prior, Request, ObservationModel};
//!
//! let model = ObservationModel::new(Prior::normal(20.0, 4.0)?, Noise::independent_with_deviations(&[1.0, 1.5])?)?;
//! let solutions = Request::estimation(model, BitBudget::Each(2), Link::flipping(0.02)?).run()?;
//! let best = solutions.best();
//! let words = best.encode(&[21.3, 22.0])?;
//! let estimate = best.decoder(16)?.decode_symbols(&words)?;
//! assert!((estimate.mean - 21.5).abs() < 2.0 && best.value < 16.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | contents |
//! |---|---|
//! | [`solve`] | requests, solutions, exports, designs for uncertain models |
//! | [`observation_model`], [`system`] | prior and noise; sensors with their quantizers and channels |
//! | [`design`] | local design for given numbers of levels by Newton's method: all sensors at once, or one after the other |
//! | [`decoder`], [`table`] | the posterior of the unknown, decisions and tests |
//! | [`bounds`] | bounds for every design |
//! | [`outcomes`] | the engine: joint outcomes of exchangeable sensors on quadrature nodes |
//!
//! Design rule: **every criterion is computed exactly, not by simulation.** Given the unknown (and a shared noise
//! factor) the sensors are independent, so the probability of a joint outcome is a one-dimensional sum of products of
//! positive cell probabilities. This gives twelve digits, gradients and Hessians, so that Newton's method works and a
//! stationary point can be classified as optimum or saddle ([`Certificate`]). The cost is the enumeration of outcomes:
//! `L^N` for `N` different sensors of `L` levels. Of identical sensors only the counts matter, which leaves
//! `C(N + L - 1, L - 1)`. Every enumeration has a limit, with a typed error above it. A model in other units gives the same design in those
//! units.
//!
//! ```
//! use fewbits_core::Observation;
//! use fewbits_quantizer_design::decoder::MmseDecoder;
//! use fewbits_quantizer_design::{Certificate, Criterion, Newton, ObservationModel, Symbol, System, design};
//!
//! // Two sensors with unit noise about a standard normal unknown, two bits each, started from Lloyd-Max quantizers.
//! let model = ObservationModel::gaussian_with_deviations(1.0, &[1.0, 1.0])?;
//! let start = System::lloyd_max(model, 4)?;
//! let best = design::joint(&start, Criterion::MutualInformation, &Newton::default())?;
//! assert!(best.certificate != Certificate::Saddle);
//! assert!((best.value - 0.474_687_859_5).abs() < 1e-9);
//!
//! // The sensor's half: a sample becomes a level. The other half: what arrives becomes an estimate.
//! let level = Symbol(best.system.quantizers()[0].encode(1.7)?);
//! let decoder = MmseDecoder::new(&best.system, 16)?;
//! let estimate = decoder.decode(&[Observation::Received(level), Observation::Lost])?;
//! assert!(estimate.mean > 0.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not in this crate: random numbers (designs from several starts use fixed streams, so they are reproducible), vector quantizers,
//! variable-length codes, time. A filter uses these quantizers through their factors.

#![cfg_attr(test, allow(clippy::unwrap_used))]

/// Parts of the exact evaluation, for the comparisons in `fewbits-baselines`. No promise is made of them.
#[doc(hidden)]
pub mod engine {
    pub use crate::criterion::LOG_FLOOR;
    pub use crate::deadline::Deadline;
    pub use crate::law::Active;
    pub use crate::newton::{Objective, Stationary, climb};
    pub use crate::problem::Problem;
}

pub mod bounds;
pub mod decoder;
pub mod design;
pub mod observation_model;
pub mod outcomes;
pub mod solve;
pub mod system;
pub mod table;

mod criterion;
mod deadline;
mod error;
mod law;
mod newton;
mod problem;

pub use criterion::{AllowedCells, Criterion};
pub use error::Error;
pub use fewbits_quantizers::{Channel, Labelling, Quantizer, Symbol, canonical, lloyd_max, quantizer};
pub use newton::{AtSaddle, Certificate, Derivatives, Newton};
pub use observation_model::{Noise, ObservationModel, Prior};
pub use solve::{Adc, BitBudget, Export, Progress, Request, Solution, Solutions, WordedCells};
pub use system::{SensorGroup, System};
pub use table::JointTable;
