//! A simulated sensor network: bits and joules, faulty links, and any scheme over them.
//!
//! An estimator alone says how many bits its reports have. What they cost on a node, and what happens to them on the way, is here:
//!
//! | question | item |
//! |---|---|
//! | who stands where, who reaches whom | [`Field`] |
//! | what a frame costs | [`Radio`], [`Account`], [`Ledger`] |
//! | what befalls frames and nodes | [`Channel`], [`Fault`] |
//! | how sensors and centre talk | [`Star`] (told, or following by echo), [`AdHoc`] (no centre), [`Walk`] (a belief that travels) |
//! | what runs over it | [`Estimator`], [`Walker`]; the library's own in [`estimators`]; any `Scheme` with any filter by [`Reporting`](estimators::Reporting) |
//! | what happened | [`Log`]: written, read, replayed; [`Simulator::snapshot`] and [`restore`](Simulator::restore) |
//! | a protocol of one's own | [`Protocol`], [`Simulator`] |
//!
//! The central choice: **nodes share nothing but bits.** A node is a small state machine that sees its own state and the frames that
//! came; every frame is encoded, crosses the air bit by bit, and is decoded. So payload bits are those of the codecs, and two ends
//! disagree exactly when bits went astray. Every frame that rests on shared state carries a digest of it: a disagreement is seen by
//! whoever receives the next frame, noted in the log, and ended by a snapshot. The price is 32 bits a frame, which are charged.
//!
//! Time is in whole nanoseconds and events of one time happen in the order in which they were scheduled; every frame draws from a
//! random stream of its own. So a run is a function of its arguments, to the byte.
//!
//! ```
//! use fewbits_core::Gaussian;
//! use fewbits_dymbo::{DymboFilter, ScalarPlant};
//! use fewbits_monte_carlo::Stream;
//! use fewbits_network::estimators::Bits;
//! use fewbits_network::{Clock, Radio, Seconds, Setup, Star};
//! use nalgebra::Vector1;
//!
//! let filter = DymboFilter::new(ScalarPlant::new(0.9, 0.5, 1.0)?);
//! let estimator = Bits { filter, start: Gaussian::scalar(0.0, 2.63)? };
//! let measurements = [1.2, 0.8, 1.9, 2.4].map(|z| vec![Vector1::new(z)]).to_vec();
//! let clock = Clock::new(Seconds::new(1.0)?)?;
//! let star = Star::echoed(estimator, measurements, clock, Stream::new(1))?;
//! let mut network = star.simulate(10.0, Setup::new(Radio::cc2420(0.0)?, Stream::new(2)))?;
//! network.run_until(clock.end(4))?;
//! let sensor = network.ledger().accounts()[1];
//! assert_eq!((sensor.payload.0, sensor.air.0), (4, 4 * 201));
//! assert!(network.nodes()[0].estimates()[3][0] > 0.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not here: contention for the channel (slots are taken to be divided among the nodes), clock drift, new estimation mathematics.

mod adhoc;
mod air;
mod channel;
mod clock;
mod error;
mod estimator;
pub mod estimators;
mod exchange;
mod field;
mod frame;
mod kernel;
mod ledger;
mod log;
mod queue;
mod radio;
mod simulator;
mod star;
mod units;
mod walk;

pub use adhoc::{AdHoc, Peer};
pub use channel::{Channel, Check, Copy, Loss};
pub use clock::Clock;
pub use error::Error;
pub use estimator::{Estimator, Replicable, gaussian_bits, gaussian_of};
pub use field::Field;
pub use frame::{Frame, Kind, digest};
pub use ledger::{Account, Faults, Ledger, Totals};
pub use log::{Detail, Entry, Log, Note, Reception, Stored, Transmission};
pub use radio::{CC2420_OUTPUT, Radio, TWO_AA_CELLS, Transceiver};
pub use simulator::{Batching, Context, Fault, Mishap, Protocol, Setup, Simulator};
pub use star::{Centre, Feedback, Sensor, Star, StarNode};
pub use units::{Bits, Instant, Joules, Seconds, SensorId, Watts};
pub use walk::{Lead, Walk, WalkNode, Walker};
