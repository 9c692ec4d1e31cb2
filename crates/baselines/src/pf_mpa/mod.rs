//! Particle message passing as published and with its errata corrected, to reproduce the thesis's tables.
//! [`GridFilter`](fewbits_pf_mpa::GridFilter) has smaller errors at a tenth of the cost.
//!
//! | part | item |
//! |---|---|
//! | Algorithm 6 | [`MessagePassing`] |
//! | its messages, their kernels and weights | [`Ring`], [`RingWeight`], [`DynamicsWeight`], [`KernelRule`], [`RingBias`] |
//! | products of mixtures by enumeration | [`product`] |
//! | draws from products of messages; convergence of Gibbs sweeps over their labels | [`ProductSampler`]; [`LabelChain`] |
//! | two targets, measurements in unknown order | [`association`] |
//! | factor graphs, sum-product over finite alphabets | [`graph`] |

pub mod association;
pub mod graph;
mod labels;
mod message;
mod message_passing;
pub mod product;
mod product_sampler;
mod ring;

pub use labels::{LabelChain, ratio_second_moments};
pub use message::{DynamicsWeight, KernelRule, Ring, RingWeight, kernel_error};
pub use message_passing::{MessagePassing, MessageWorkspace};
pub use product_sampler::ProductSampler;
pub use ring::RingBias;
