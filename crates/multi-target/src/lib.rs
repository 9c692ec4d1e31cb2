//! Several targets that appear and disappear, tracked from reports whose origin is unknown.
//!
//! Which report is of which target is unknown, reports may be missing, and some are of no target. A [`Tracker`] keeps a list of labelled
//! [`Track`]s, each a Gaussian belief with a probability that its target exists. It sums over *all* joint associations of tracks and
//! reports exactly ([`marginals`]) and replaces each track's mixture by its moments: joint integrated probabilistic data association. A
//! report is any [`Likelihood`](fewbits_core::Likelihood): a value, three bits of a range, a sign. Its evidence under a track,
//! which [`condition`](fewbits_core::Likelihood::condition) gives, is all that association needs, so few-bit reports need no gate
//! or distance of their own.
//!
//! | question | answer |
//! |---|---|
//! | where are the targets, and which is which | [`Tracker`], [`Tracks`], [`Label`] |
//! | which report is of which track, with which probability | [`marginals`] |
//! | how wrong is a set of estimates | [`gospa`]: localisation, missed and false targets |
//! | the cheapest assignment | [`assign`] |
//!
//! ```
//! use fewbits_core::factor::Levels;
//! use fewbits_core::{Cell, Gaussian, Observed};
//! use fewbits_models::{LinearSensor, constant_velocity_1d};
//! use fewbits_multi_target::{Birth, Report, Tracker, Tracks};
//! use nalgebra::{Matrix2, Vector2};
//!
//! let entrance = Gaussian::new(Vector2::new(0.0, 1.0), Matrix2::identity())?;
//! let tracker = Tracker::new(0.99, vec![Birth { probability: 0.1, belief: entrance }])?;
//! let (motion, sensor) = (constant_velocity_1d(1.0, 0.01)?, LinearSensor::scalar(Vector2::new(1.0, 0.0), 0.1)?);
//! let mut tracks = Tracks::default();
//! for step in 0..6 {
//!     tracker.predict(&motion, &mut tracks)?;
//!     // The report is a cell of width 1; one in ten reports is false and then any of ten cells.
//!     let place = f64::from(step);
//!     let in_cell = Observed::new(sensor, Levels::certain(Cell::new(place - 0.5, place + 0.5)?, 0.1)?);
//!     tracker.update(&mut tracks, |_| 0.9, &[Report { likelihood: &in_cell, clutter: 0.1 / 10.0 }])?;
//! }
//! let target = tracks.confirmed(0.5).next().ok_or("no target")?;
//! assert!((target.belief.mean()[0] - 5.0).abs() < 0.5 && target.existence > 0.9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not here: targets without known places of entrance, extended targets, several hypotheses over time, the sensors' halves.

mod assignment;
mod association;
mod gospa;
mod tracker;

pub use assignment::assign;
pub use association::{Marginals, Weights, marginals};
pub use fewbits_core::Error;
pub use gospa::{Gospa, gospa};
pub use tracker::{Birth, Label, Report, Track, Tracker, Tracks};
