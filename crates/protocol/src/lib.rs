//! Frames and state machines of sensors around a fusion centre, without sockets, clocks or estimators.
//!
//! | use | when |
//! |---|---|
//! | [`Frame`] | bytes are written or read: `docs/wire.md` has the format byte by byte |
//! | [`Sensor`] | you write a sensor: for a simulator, a process or a microcontroller |
//! | `Centre` (feature `std`) | you write a fusion centre |
//! | `Receiver` (feature `std`) | an estimator runs under a `Centre`; feedback, reports and state are bits |
//! | `Leader`, `Bearer` (feature `std`) | a belief is sent from leader to leader |
//!
//! **A state machine takes events and returns what to do; it does nothing itself.** Its inputs are the time, received bytes, fired timers
//! and samples. Its outputs are frames to send, timers to set and notes. The same code therefore runs in the simulator of
//! `fewbits-network`, over the sockets of `fewbits-link`, and on a microcontroller. Each of them needs a driver that carries out the
//! outputs; the example on this page is a complete one.
//!
//! Frames and [`Sensor`] need neither the standard library nor allocation: depend on this crate with `default-features = false`.
//!
//! ```
//! use fewbits_protocol::{Check, Feedback, Frame, Kind, Payload, Sensor, SensorSettings, Slot, Task, digest};
//!
//! // The centre tells one byte of feedback in slot 7.
//! let told = Payload::new(&[0x5a], 8).ok_or("payload")?;
//! let slot = Slot::of_count(7);
//! let mut buffer = [0; 32];
//! let bytes = Frame::new(Kind::Feedback, slot, digest(slot, told), told).encode(Check::Whole, &mut buffer).ok_or("buffer")?;
//!
//! // The sensor is told to sample, encodes a report of one bit, and is given the frame to send.
//! let mut sensor = Sensor::new(SensorSettings::new(Feedback::Told));
//! let Task::Sample { feedback, .. } = sensor.on_frame(0, bytes).task else { return Err("sample".into()) };
//! assert_eq!(feedback, told);
//! let Task::Send(report) = sensor.on_sample(0, Payload::new(&[0x80], 1)).task else { return Err("send".into()) };
//! assert_eq!((report.kind, report.slot, report.len()), (Kind::Report, slot, 11));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not here: estimators, radio and energy (`fewbits-network`), sockets and keys (`fewbits-link`).
#![cfg_attr(not(feature = "std"), no_std)]

#[cfg(feature = "std")]
mod centre;
#[cfg(feature = "std")]
mod echo;
mod frame;
#[cfg(feature = "std")]
mod handover;
mod note;
mod payload;
#[cfg(feature = "std")]
mod receiver;
mod sensor;
mod slot;

#[cfg(feature = "std")]
pub use centre::{Action, Centre, CentreSettings, CentreTimer, Member, Recipient};
#[cfg(feature = "std")]
pub use echo::{ReportLength, echo, reports_of};
pub use frame::{CHECK_BYTES, Check, DecodeError, Frame, Kind, digest};
#[cfg(feature = "std")]
pub use handover::{Bearer, Errand, Lead, Leader};
pub use note::Note;
pub use payload::Payload;
#[cfg(feature = "std")]
pub use receiver::{BoxError, Outcome, Receiver, SensorHealth, predict_and_ask, update_asked, update_or_drop};
pub use sensor::{Feedback, Reaction, Sensor, SensorSettings, SensorTimer, Task};
pub use slot::{SLOT_BITS, Schedule, Slot};
