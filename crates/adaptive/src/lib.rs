//! Compression of real signals within a guaranteed error, sample by sample.
//!
//! A sensor and its receiver run the same bank of models of the signal and hold the same frequencies of past reports. Silence means
//! that the sample is within `delta` of the prediction of both. Otherwise the residual is coded under the probability law that
//! both compute. Neither knows anything of the signal beforehand, and only reports are sent. Blocks begin
//! with weights that were fitted once on recordings.
//!
//! ```
//! use fewbits_adaptive::{Config, Receiver, Sensor};
//! let config = Config::new(0.05)?; // every reconstruction within 0.05
//! let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
//! let mut bits = 0;
//! for n in 0..1000 {
//!     let sample = 20.0 + 3.0 * (f64::from(n) * 0.01).sin();
//!     let report = sensor.encode(sample)?;
//!     bits += report.as_ref().map_or(0, |report| report.packet.bits());
//!     let tracked = receiver.receive(&report.map(|report| report.packet).into())?;
//!     assert!(tracked.value.is_some_and(|value| (value - sample).abs() <= 0.05));
//! }
//! assert!(bits < 500); // half a bit per sample
//! # Ok::<(), fewbits_adaptive::Error>(())
//! ```
//!
//! | part | where |
//! |---|---|
//! | configuration: error bound, circle, refreshes | [`Config`] |
//! | sensor and receiver | [`Sensor`], [`Receiver`] |
//! | the bits of one slot, and of a whole recording | [`Packet`], [`StreamWriter`], [`StreamReader`] |
//! | the same number of bits in every slot | [`FixedRate`] |
//! | choice of `delta` for a bit rate, on a recording | [`best_within`], [`replay`] |
//!
//! **Both ends are updated only by integers.** Reconstructions lie on a lattice `anchor + 2 delta j` through the first sample. Values
//! that return are the same integer again, the steps of an instrument stay aligned, and both ends update from the same
//! exact numbers. The cost: the prediction is rounded to the lattice, so silence means a cell of the lattice instead of `+-delta` about
//! the best prediction. On recordings the lattice saves far more than that costs.
//!
//! The bank's filters have constant gains and logistic predictive laws; [`fewbits_filters::Imm`] would update by truncated normals
//! instead. One slot costs 24 exponentials and about 600 other operations; the
//! errors at equal bits are the same on recordings. All coding decisions use arithmetic that gives the same bits on every machine.
//!
//! The shared state and the sensor's half are in [`fewbits_node::adaptive`], which a microcontroller runs unchanged. This crate has the
//! receiver's half, streams, stored states and whole recordings.
//!
//! Not here: models of loss and the energy of a radio (`fewbits-network`), many samples at once
//! (`fewbits-block-codec`), files (`fewbits-record`).

mod config;
mod fixed_rate;
mod packet;
mod receiver;
mod report;
mod sensor;
mod stream;
mod tuning;

pub use config::Config;
pub use fewbits_core::Error;
pub use fewbits_node::adaptive::{MODELS, SCALES};
pub use fixed_rate::{FixedRate, Word};
pub use packet::Packet;
pub use receiver::{Receiver, Tracked};
pub use sensor::{Report, Sensor};
pub use stream::{Silence, StreamReader, StreamWriter};
pub use tuning::{Replay, best_within, own_steps, replay};
