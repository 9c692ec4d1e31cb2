//! Sensors that send only unexpected measurements (censoring), and a fusion centre that also uses their silence.
//!
//! Each sensor of a network sends its measurement in full, or nothing. It sends if the normalised innovation squared reaches a
//! threshold; the innovation is measurement minus prediction. The threshold follows from a budget of messages per step. The fusion
//! centre knows the rule, so silence tells it that the innovation was small, without a message.
//!
//! | part | item |
//! |---|---|
//! | budget to threshold | [`Budget`](threshold::Budget) |
//! | the rule, and the sensor's own innovation covariance | [`CensoringRule`](rule::CensoringRule), [`OwnRecursion`](rule::OwnRecursion) |
//! | the schemes: state feedback or a schedule, state and covariance feedback, none | [`Censoring`](scheme::Censoring), [`CovarianceFeedback`](scheme::CovarianceFeedback), [`LocalSensor`](no_feedback::LocalSensor) |
//! | `ln p(value or silence given the noise-free measurement)` | [`Censored`](censored::Censored), [`Ellipsoid`](ellipsoid::Ellipsoid) |
//! | fusion with feedback, in a [`FusionCentre`](fewbits_filters::centre::FusionCentre) of any filter | [`Network::join`](network::Network::join), [`Network::remote_under`](network::Network::remote_under) |
//! | the same without a centre: the likelihoods of an instant | [`Network::likelihoods`](network::Network::likelihoods) |
//! | fusion without feedback | [`no_feedback`] |
//! | thresholds before deployment | [`expected_covariances`](schedule::expected_covariances) |
//!
//! **The likelihood of silence is computed in closed form or by quadrature, never by sampling.** With linear sensors
//! the belief is the Gaussian with the exact mean and covariance after each observation
//! ([`assumed_density`](fewbits_filters::assumed_density)). This costs one truncated normal (scalar measurement) or 24 of them (two
//! components). The published filter draws a thousand samples per particle and is not more accurate with a thousand particles. For
//! nonlinear sensors the same likelihood drives any particle filter.
//!
//! ```
//! use fewbits_cfwmd::network::Network;
//! use fewbits_cfwmd::threshold::Budget;
//! use fewbits_core::{Gaussian, Likelihood, Link};
//! use fewbits_filters::kalman;
//! use fewbits_models::{LinearSensor, constant_velocity_1d};
//! use nalgebra::{Vector1, Vector2};
//! use rand::SeedableRng;
//!
//! // Two sensors of position share one message per step.
//! let dynamics = constant_velocity_1d(1.0, 4.0)?;
//! let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0)?;
//! let threshold = Budget::new(1.0, 2)?.threshold(1)?;
//! let network = Network::new(vec![sensor; 2], threshold, Link::PERFECT)?;
//!
//! // The fusion centre predicts and broadcasts; each sensor compares and reports, or not.
//! let belief = Gaussian::known(Vector2::new(0.0, 10.0))?;
//! let predicted = kalman::predict(&dynamics, &belief);
//! let rules = network.rules_under(&predicted)?;
//! let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
//! let measurements = [10.4, 12.5].map(Vector1::new);
//! let (observations, sent) = network.transmit(&mut rng, &rules, predicted.mean(), &measurements)?;
//! assert_eq!(sent, 1);
//!
//! // One value and one silence, both informative.
//! let mut belief = predicted;
//! let observed: Vec<_> = observations.into_iter().map(Some).collect();
//! network.likelihoods(&rules, predicted.mean(), &observed)?.condition(&mut belief)?;
//! assert!(belief.mean()[0] > 10.0 && belief.mean()[0] < 12.5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not here: the radio (`fewbits-network`), and the design of a quantizer for the values (`fewbits-quantizer-design`).

pub mod censored;
pub mod ellipsoid;
mod missing;
pub mod network;
pub mod no_feedback;
pub mod rule;
pub mod schedule;
pub mod scheme;
pub mod threshold;

pub use fewbits_core::Error;
pub use {nalgebra, rand};
