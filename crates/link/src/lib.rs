//! A fusion centre and its sensors as processes on a network.
//!
//! | use | when |
//! |---|---|
//! | [`run_station`], [`run_sensor`] | a centre or a sensor runs by the clock of the machine, over a [`Transport`] |
//! | [`Udp`] | datagrams are sent over UDP |
//! | `mqtt::Mqtt` (feature `mqtt`) | datagrams are sent through a broker: for sensors behind networks that accept no connections |
//! | `zenoh::Zenoh` (feature `zenoh`) | many sensors on several hosts, with or without routers |
//! | [`Station`], [`SensorLink`] | you have your own sockets and clock, but need keys and a stored state |
//! | [`FusionReceiver`] | the estimator is the fusion centre of `fewbits-filters` |
//! | [`LivePage`] | a web page is to show a running centre, or Prometheus is to collect its numbers |
//! | [`doors`] | estimates or reports are to be written or read in the formats of other programs |
//! | [`FleetKey`] | the keys of many sensors are to be derived from one |
//! | [`Key`], [`ReplayWindow`], [`Store`] | you need the parts |
//!
//! The state machines are those of `fewbits-protocol`, which the simulated network runs too. This crate adds what a real network needs:
//! protection against foreign senders, and states that survive the end of a process.
//!
//! **Every frame is authenticated, none is encrypted.** A report of one bit tells nothing to a reader who does not know the threshold.
//! Authentication ensures that nobody else can change the estimate. It costs 28 bytes per frame. A reader of the network can read the
//! feedback, and thereby the estimate. If that matters, run the link inside an encrypted tunnel.
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

mod base64;
mod disk;
pub mod doors;
mod envelope;
mod error;
mod fleet;
mod fusion;
mod hello;
mod http;
mod live;
#[cfg(feature = "mqtt")]
pub mod mqtt;
mod private;
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
pub use fleet::FleetKey;
pub use fusion::FusionReceiver;
pub use live::LivePage;
pub use private::{require_private, write_private};
pub use sensor::{Request, SensorLink};
pub use station::{Counts, Output, Peer, Start, Station, Step};
pub use store::Store;
pub use transport::{Datagram, Program, Transport, now, run_sensor, run_station};
pub use udp::Udp;
