//! A simulated sensor network that counts bits and joules, with faulty links, for any estimation scheme.
//!
//! An estimator says only how many bits its reports have. This crate computes what they cost on a node, and what happens to them on the
//! way:
//!
//! | question | item |
//! |---|---|
//! | where the nodes are, and which are in range of each other | [`Field`]: positions, or a list of links as CSV |
//! | what a frame costs | [`Radio`] (one for all, or one per node), [`Account`], [`Ledger`] |
//! | what happens to frames and nodes | [`Channel`], [`Loss`] (one for all, or one per link), [`Fault`], clocks that drift ([`Setup::drift`]) |
//! | which node sends when | an ideal schedule, or carrier sense with collisions ([`Access`]) |
//! | sensors around a fusion centre | [`BitStar`]: any `Receiver` of `fewbits-protocol`, any `SensorNode` of `fewbits-core` |
//! | a belief that is sent from node to node | [`Walk`]: any `Leader` of `fewbits-protocol` |
//! | what the sensors measure | [`Measurements`]: a table, an iterator or a closure |
//! | results of a run | [`Summary`]; [`Log`], written and read; [`Simulator::snapshot`] and [`restore`](Simulator::restore) |
//! | a protocol of one's own | [`Protocol`], [`Simulator`] |
//!
//! **Nodes share nothing but bits.** A node is a small state machine. It sees its own state and the frames that
//! arrive. Every frame is encoded, crosses the channel bit by bit, and is decoded. Sending returns no result: an acknowledgement is a frame
//! that takes time on air and may be lost. The payload bits are therefore those of the codecs, and the states of two ends
//! differ only if bits were lost or inverted. Every frame whose meaning depends on shared state carries a digest of that state. The
//! receiver of the next frame detects a difference and notes it in the log; a snapshot ends it. A digest costs 32 bits per frame, which
//! are counted.
//!
//! Time is counted in whole nanoseconds. Events of the same time happen in the order in which they were scheduled. Every frame draws from
//! its own random stream. A run is therefore a function of its arguments and can be repeated bit for bit.
//!
//! ```
//! use fewbits_core::{Gaussian, Link};
//! use fewbits_dymbo::SignBit;
//! use fewbits_filters::MomentFilter;
//! use fewbits_filters::centre::{FusionCentre, Reporting};
//! use fewbits_link::FusionReceiver;
//! use fewbits_models::{ContinuousLinear, LinearSensor};
//! use fewbits_monte_carlo::Stream;
//! use fewbits_network::{BitStar, Clock, Radio, Seconds, Setup};
//! use nalgebra::Vector1;
//!
//! let scheme = SignBit::new(1.0)?;
//! let centre = move || {
//!     let (world, prior) = (ContinuousLinear::random_walk(0.5)?, Gaussian::scalar(0.0, 2.63)?);
//!     let mut centre = FusionCentre::new(&mut Stream::new(1).rng(), world, MomentFilter, &prior)?;
//!     let told = |_: &Gaussian<1>, measured: &Gaussian<1>| measured.mean()[0];
//!     centre.join(0, Reporting::new(LinearSensor::direct(1.0)?, scheme, Link::PERFECT, told))?;
//!     Ok(FusionReceiver::new(centre, 1.0, Stream::new(2)))
//! };
//! let measurements = [1.2, 0.8, 1.9, 2.4].map(|z| vec![Vector1::new(z)]).to_vec();
//! let clock = Clock::new(Seconds::new(1.0)?)?;
//! let star = BitStar::of_scheme(centre, scheme, measurements, clock, Stream::new(1))?;
//! let mut network = star.simulate(10.0, Setup::new(Radio::cc2420(0.0)?, Stream::new(2)))?;
//! network.run_until(clock.end(4))?;
//! let sensor = network.ledger().accounts()[1];
//! assert_eq!((sensor.payload.0, sensor.air.0), (4, 4 * 201));
//! assert!(network.nodes()[0].means()[3][0] > 0.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not here: estimators and filters (`fewbits-filters` and the crates of the schemes).

mod clock;
mod error;
mod measurements;
mod medium;
mod note;
mod protocols;
mod simulator;
mod units;

pub use clock::Clock;
pub use error::{Cause, Error};
pub use fewbits_protocol::{Check, Frame, Kind};
pub use measurements::Measurements;
pub use medium::{Channel, Field, Lora, Loss, Radio, ReceivedCopy, TWO_AA_CELLS, Transceiver, on_air};
pub use note::{Note, Stage};
pub use protocols::{BitNode, BitStar, CentreNode, SensingNode, SlotEstimate, StoredBitNode, Walk, WalkNode};
pub use simulator::{
    Access, Account, Acknowledgement, Batching, CarrierSense, Context, Detail, Entry, EstimateError, Fault, FaultKind,
    Faults, Ledger, Log, Protocol, Reception, Setup, Simulator, Storable, Summary, Ticket, Totals, Transmission,
};
pub use units::{Bits, Instant, Joules, Seconds, SensorId, Watts};
