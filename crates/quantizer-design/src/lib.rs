//! Design and decoding of scalar and binary quantizers for distributed estimation.
//!
//! Several sensors see one unknown through noise, each may say a few bits, and nobody hears the others. Which cells should each
//! sensor use so that together they tell most? And what follows from what they say? This crate answers for three families:
//!
//! | module | quantizers | designed for |
//! |---|---|---|
//! | [`design`], [`System`] | a few levels a sample, contiguous cells or not, any discrete channel | mutual information, squared error, Bayes error |
//! | [`binary`] | one bit a sample from patterned cells | exact MAP and MMSE decoding, bounds, counts |
//! | [`assignment`] | which pattern goes to which sensor | squared error under unequal noise |
//! | [`lloyd_max`] | one sensor alone | squared error of the sample itself |
//!
//! [`decoder`] holds what the fusion centre does with the symbols, [`bounds`] what no design can beat.
//!
//! The central choice: **every figure of merit is computed exactly, never sampled.** Given the unknown (and a shared noise
//! factor) the sensors are independent, so each joint outcome has a probability that is a one-dimensional sum of products of
//! positive cell probabilities. That gives twelve digits, and with them gradients, Hessians, Newton's method, and the
//! certainty that a stationary point is an optimum and not a saddle. The price is the enumeration of outcomes, `L^N` of them
//! for `N` different sensors of `L` levels; identical sensors are counted instead of told apart, which leaves
//! `C(N + L - 1, L - 1)`, and every enumeration has a limit with a typed error beyond it.
//!
//! ```
//! use fewbits_core::message::Message;
//! use fewbits_quantizer_design::{Criterion, Labelling, Newton, Quantizer, Scene, Symbol, System};
//! use fewbits_quantizer_design::{decoder::MmseDecoder, design, lloyd_max};
//!
//! // Two sensors with unit noise about a standard normal unknown, two bits each, started from Lloyd-Max quantizers.
//! let scene = Scene::gaussian(1.0, &[1.0, 1.0])?;
//! let start = Quantizer::from(lloyd_max::gaussian_table(2)?);
//! let start = System::ideal(scene, vec![start.clone(), start])?;
//! let best = design::joint(&start, Criterion::MutualInformation, &Newton::default())?;
//! assert!(!best.is_saddle());
//! assert!((best.value - 0.474_687_859_5).abs() < 1e-9);
//!
//! // The sensor's half: a sample becomes a level, a level two bits. The other half: the symbols become an estimate.
//! let sensor = &best.quantizers()[0];
//! let gray = Labelling::gray(4)?;
//! let bits = Symbol(sensor.encode(1.7)).to_bits(&gray)?;
//! assert_eq!(bits.bits(), 2);
//! let heard = Symbol::from_bits(&gray, &bits)?;
//! let decoder = MmseDecoder::new(&best.system, 16)?;
//! let estimate = decoder.decode(&[heard.0, 2])?;
//! assert!(estimate.mean > 0.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not here: random numbers (multi-starts draw from fixed streams, so every design is reproducible), vector quantizers,
//! variable-length codes, time: a filter uses these quantizers through their likelihoods.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod bounds;
pub mod decoder;
pub mod design;
pub mod scene;
pub mod system;
pub mod table;

mod axis;
mod compositions;
mod criterion;
mod error;
mod law;
mod moments;
mod newton;
mod problem;

pub use criterion::Criterion;
pub use error::Error;
pub use fewbits_quantizers::{Channel, Labelling, Quantizer, Symbol, lloyd_max, quantizer};
pub use newton::Newton;
pub use scene::{Noise, Prior, Scene};
pub use system::{Group, System};
pub use table::JointTable;
