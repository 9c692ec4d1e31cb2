//! A fusion centre and its sensors as processes.
//!
//! | use | when |
//! |---|---|
//! | [`run_station`], [`run_sensor`] | a centre and its sensors by the clock of the machine, over a [`Transport`] |
//! | [`Udp`] | datagrams over UDP |
//! | `mqtt::Mqtt` (feature `mqtt`) | datagrams through a broker: sensors behind networks that let nothing in |
//! | `zenoh::Zenoh` (feature `zenoh`) | fleets over several hosts, with or without routers |
//! | [`Station`], [`SensorLink`] | frames under keys and a state that is stored, with sockets and clock of one's own |
//! | [`FusionReceiver`] | the estimator is the mixed fusion centre of `fewbits-filters` |
//! | `LivePage` (feature `live`) | people want to see a running centre |
//! | [`Key`], [`ReplayWindow`], [`Store`] | the parts |
//!
//! The machines are those of `fewbits-protocol`, which the simulated network runs too. Here are what a real network adds: others who can send, and
//! processes that are stopped.
//!
//! The central choice: **every frame is authenticated, none is encrypted.** A report of one bit says nothing to whoever does not know what was asked, and
//! what matters is that nobody else can move the estimate. The price is 28 bytes a frame, and that whoever can read the network can read the estimate's
//! feedback. Where that matters, run the link inside a tunnel.
//!
//! ```
//! use fewbits_link::{Direction, Key, Refusal, ReplayWindow};
//! let key = Key::new(&[7; 32])?;
//! let envelope = key.seal(Direction::ToCentre, 3, 1, b"frame");
//! assert_eq!(key.open(Direction::ToCentre, &envelope), Ok((1, &b"frame"[..])));
//! // Sent back, it is forged; sent again, it is replayed.
//! assert_eq!(key.open(Direction::ToSensor, &envelope), Err(Refusal::Forged));
//! let mut seen = ReplayWindow::default();
//! assert_eq!((seen.take(1), seen.take(1)), (Ok(()), Err(Refusal::Replayed)));
//! # Ok::<(), fewbits_link::Error>(())
//! ```
//!
//! Not here: radio and energy (`fewbits-network`), estimators.

mod envelope;
mod error;
mod fusion;
#[cfg(feature = "live")]
mod live;
#[cfg(feature = "mqtt")]
pub mod mqtt;
mod sensor;
mod station;
mod store;
#[cfg(any(feature = "mqtt", feature = "zenoh"))]
mod topics;
mod transport;
mod udp;
#[cfg(feature = "zenoh")]
pub mod zenoh;

pub use envelope::{Direction, Key, Refusal, ReplayWindow, sensor_of};
pub use error::Error;
pub use fusion::FusionReceiver;
#[cfg(feature = "live")]
pub use live::LivePage;
pub use sensor::{Request, SensorLink};
pub use station::{Counts, Output, Peer, Station, Step};
pub use store::Store;
pub use transport::{Datagram, Program, Transport, now, run_sensor, run_station};
pub use udp::Udp;
