//! Coding of real signals within a guaranteed error.
//!
//! A sensor and its receiver run the same bank of models of the signal and hold the same frequencies of past reports. Silence means
//! that the sample is within `delta` of what both predict, and costs nothing; otherwise the residual is coded under the law that
//! both predict for it. Nothing is fitted beforehand, and nothing but reports travels.
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
//! | the agreement: accuracy, circle, refreshes | [`Config`] |
//! | the two halves | [`Sensor`], [`Receiver`] |
//! | whole bits in a slot, and a whole recording | [`Packet`], [`StreamWriter`], [`StreamReader`] |
//! | many samples at once, each block decodable alone | [`BlockCodec`] |
//! | what many such blocks have in common, told once | [`Start`] |
//! | decisions of known probability as bytes | [`arithmetic`] |
//! | links that lose packets: one lost packet costs the slots until the next | [`CosetSensor`], [`CosetReceiver`] |
//! | a slot for other filters | [`SlotScheme`] |
//! | the same number of bits in every slot | [`FixedRate`] |
//! | `delta` for a rate, on a recording | [`best_within`], [`replay`] |
//!
//! The central choice: **replicas hold integers.** Reconstructions lie on a lattice `anchor + 2 delta j` through the first sample, so
//! that values which return are the same integer again, an instrument's own steps stay aligned, and both ends update from the same
//! exact numbers. The cost is that the prediction is rounded to the lattice: silence is a cell of the lattice and not `+-delta` about
//! the best prediction. On recordings the first is worth far more than the second.
//!
//! The second choice: the bank's filters have constant gains and logistic predictive laws, where
//! [`fewbits_filters::Imm`] would update by truncated normals. One slot costs 24 exponentials and some 600 other operations; the
//! errors at equal bits are the same on recordings. Only arithmetic that is the same on every machine decides what is coded.
//!
//! The replicas and the sensor's half stand in [`fewbits_node::adaptive`], which a microcontroller runs as it is; here are the
//! receiver's half, streams, stored states and whole recordings.
//!
//! Not here: loss models and the energy of a radio, baselines, files.

mod block;
mod config;
mod coset;
mod error;
mod fixed_rate;
mod packet;
mod receiver;
mod report;
mod scheme;
mod sensor;
mod stream;
mod tuning;

pub use block::coder as arithmetic;
pub use block::{BlockCodec, Effort, JOINT_COLUMNS, Start, StartedBlock};
pub use config::Config;
pub use coset::{CosetConfig, CosetReceiver, CosetSensor, TOLERATED};
pub use error::Error;
pub use fewbits_node::adaptive::{MODELS, SCALES};
pub use fixed_rate::{FixedRate, Word};
pub use packet::Packet;
pub use receiver::{Receiver, Tracked};
pub use scheme::{SlotFactor, SlotScheme};
pub use sensor::{Report, Sensor};
pub use stream::{Silence, StreamReader, StreamWriter};
pub use tuning::{Replay, best_within, own_steps, replay};
