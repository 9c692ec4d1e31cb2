//! Censoring sensors, and a fusion centre that hears their silence.
//!
//! Each sensor of a network may send its measurement in full, or nothing. It sends what surprises: an innovation, weighed with
//! its covariance, beyond a threshold that a message budget sets. The fusion centre knows the rule, so silence says that the
//! innovation was small, and it says so for free.
//!
//! | part | item |
//! |---|---|
//! | budget to threshold | [`Budget`](threshold::Budget) |
//! | the rule, and whose covariance weighs the innovation | [`CensoringRule`](rule::CensoringRule), [`Weighing`](rule::Weighing), [`OwnRecursion`](rule::OwnRecursion) |
//! | the sensor's half with feedback, without, and a random one | [`CensoringSensor`](network::CensoringSensor), [`LocalSensor`](no_feedback::LocalSensor), [`StochasticTrigger`](trigger::StochasticTrigger) |
//! | the message and its bits | [`Report`](message::Report) |
//! | `ln p(silence given x)`, scalar and vector | [`SilentFactor`](silence::SilentFactor), [`Ellipsoid`](ellipsoid::Ellipsoid) |
//! | fusion with feedback | [`Network::fuse`](network::Network::fuse) (Gaussian, the default), [`HeardScalars`](particle::HeardScalars) and [`HeardVectors`](particle::HeardVectors) for particle filters |
//! | fusion without feedback | [`NoFeedbackCentre`](no_feedback::NoFeedbackCentre) |
//! | thresholds before deployment | [`expected_covariances`](schedule::expected_covariances) |
//! | what a message is worth | [`information`] |
//!
//! The central choice: **silence is a likelihood in closed form or by quadrature, never by sampling**, and with linear sensors
//! the belief is the Gaussian with the exact mean and covariance after each message. It costs a truncated normal (scalar) or
//! 24 of them (two components) where the published filter draws a thousand samples a particle, and it is not less accurate
//! than a thousand particles. For nonlinear sensors the same likelihood drives any particle filter.
//!
//! ```
//! use fewbits_cfwmd::message::Format;
//! use fewbits_cfwmd::network::{CensoringSensor, Network};
//! use fewbits_cfwmd::threshold::Budget;
//! use fewbits_core::{Encoder, Gaussian};
//! use fewbits_filters::kalman;
//! use fewbits_models::{LinearSensor, constant_velocity_1d};
//! use nalgebra::{Vector1, Vector2};
//!
//! // Two sensors of position share one message a step.
//! let dynamics = constant_velocity_1d(1.0, 4.0)?;
//! let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0)?;
//! let threshold = Budget::new(1.0, 2)?.threshold(1)?;
//! let network = Network::new(vec![sensor; 2], threshold, 0.0)?;
//!
//! // The fusion centre predicts and broadcasts; each sensor compares.
//! let belief = Gaussian::known(Vector2::new(0.0, 10.0))?;
//! let predicted = kalman::predict(&dynamics, &belief);
//! let rule = network.rule_under(0, predicted.covariance())?;
//! let half = CensoringSensor { rule: rule.clone(), format: Format::Single };
//! let prediction = sensor.matrix() * predicted.mean();
//! let heard = [10.4, 12.5].map(|z| half.encode(&Vector1::new(z), &prediction).heard());
//! assert!(heard[0].received().is_none() && heard[1].received().is_some());
//!
//! // One value and one silence, both heard.
//! let (belief, info) = network.fuse(&predicted, &[rule.clone(), rule], predicted.mean(), &heard)?;
//! assert_eq!(info.received, 1);
//! assert!(belief.mean()[0] > 10.0 && belief.mean()[0] < 12.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not here: the radio, the truth, and design of the quantizer behind a value.

pub mod assumed_density;
pub mod ellipsoid;
mod error;
pub mod information;
pub mod message;
pub mod network;
pub mod no_feedback;
mod no_feedback_particle;
pub mod particle;
pub mod rule;
pub mod schedule;
pub mod silence;
pub mod threshold;
pub mod trigger;

pub use error::Error;
