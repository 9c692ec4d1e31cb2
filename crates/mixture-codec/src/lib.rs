//! From a kernel estimate of hundreds of particles to a Gaussian mixture in a few bytes.
//!
//! A particle filter that hands its belief to another node cannot send the particles: 500 of them in the plane are 32 kbit. This crate
//! reduces the kernel estimate over them to a mixture of a few Gaussians, measures what was lost, and codes the mixture in about
//! 30 bits a component.
//!
//! | task | use |
//! |---|---|
//! | few Gaussians for an estimate | [`Reduction`]; [`Reduction::default`] is the recommended method |
//! | few Gaussians for weighted points or cells | [`Clumps`], [`MixtureFit`] |
//! | the message, as bits | [`wire::CodedMixture`] under a [`wire::WireFormat`] that both ends know |
//! | the message as numbers in double, single or fixed precision | [`wire::RoundedMixture`] |
//! | the best message within a number of bits | [`wire::RateControl`] |
//! | the difference between two densities, estimated at points | [`plug_in`] |
//! | the single steps of a reduction | [`tree`], [`cut`], [`merge`], [`refine`] |
//!
//! The reduction has three steps. A tree over the particles is cut to 60 nodes by a bound in closed form. Pairs of nodes are merged, each
//! time the pair with the smallest bound of the information lost. Expectation-maximisation then fits the result to the whole estimate.
//! The tree alone is the paper's method ([`Reduction::paper`]); it loses several times as much information with as many components.
//!
//! ```
//! use fewbits_core::Message;
//! use fewbits_densities::{Bandwidth, KernelEstimate, Particles};
//! use fewbits_mixture_codec::Reduction;
//! use fewbits_mixture_codec::wire::{CodedMixture, WireFormat};
//! let x: Vec<f64> = (0..100).map(|i| (f64::from(i) * 0.7).sin() + f64::from(i % 2)).collect();
//! let estimate = KernelEstimate::fit(Particles::uniform([x])?, &Bandwidth::default())?;
//! let format = WireFormat::around_origin(1.0, 0.25)?;
//! let message = CodedMixture::new(&Reduction::default().reduce(&estimate, 2)?, &format, 0)?;
//! assert!(message.to_bits(&format)?.bits() < 60);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not in this crate: the densities themselves (`fewbits-densities`), and which node sends to which (`fewbits-handoff`).

pub mod plug_in;
pub mod reduction;
pub mod tree;
pub mod wire;

pub use fewbits_core::Error;
pub use plug_in::{Cubature, PlugIn};
pub use reduction::cut::{Criterion, Cut, NodeErrors};
pub use reduction::merge::MergeCost;
pub use reduction::{Clump, Clumps, MixtureFit, Reduction, cut, merge, refine};
pub use tree::{Split, Tree};
