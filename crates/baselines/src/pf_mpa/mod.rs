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
//! | the manoeuvring target and its chain; how nodes compute the same cells | [`Target`], [`WithManoeuvre`], [`AccelerationChain`]; [`Encoder`] |
//! | what a sensor reported, with the interval from which messages are drawn | [`RangeFactor`], [`IntervalRule`] |
//! | the other trackers: linearised, particles and draws | [`Linearised`], [`GuidedGaussian`], [`RaoBlackwellGuided`] |
//! | bounds; which sensor leads, what it hands over, in bits | [`CramerRao`]; [`leader`] |
//! | factor graphs, sum-product over finite alphabets | [`graph`] |

pub mod association;
mod bound;
mod chain;
mod encoder;
pub mod graph;
mod grid;
mod guided;
mod labels;
pub mod leader;
mod linearised;
mod message;
mod message_passing;
pub mod product;
mod product_sampler;
mod range_factor;
mod rao_blackwell;
mod ring;
mod target;
mod tracker;

pub use bound::{CramerRao, position_information};
pub use chain::AccelerationChain;
pub use encoder::{Encoder, Normalisation};
pub use guided::{GuidedGaussian, GuidedWorkspace};
pub use labels::{LabelChain, ratio_second_moments};
pub use linearised::{Linearised, QuantizationNoise, Velocity};
pub use message::{DynamicsWeight, KernelRule, Ring, RingWeight, kernel_error};
pub use message_passing::{MessagePassing, MessageWorkspace};
pub use product_sampler::ProductSampler;
pub use range_factor::{IntervalRule, RangeFactor};
pub use rao_blackwell::{RaoBlackwellGuided, VelocityCloud, VelocityWorkspace};
pub use ring::RingBias;
pub use target::{Manoeuvres, Target, WithManoeuvre};
pub use tracker::{GaussianTracker, Network, POSITION, Ranged, Reports, Step, StepInfo, Tracker};
