//! Kalman-like filters that receive one sign bit per sample.
//!
//! The fusion centre broadcasts its prediction of the next sample. The sensor answers with one bit: is the sample at or above the
//! prediction? The estimate then moves by a known step in that direction. The posterior is nearly normal, so a mean and a variance
//! describe it. The recursion is a Kalman filter in which the information of a measurement is multiplied by `2/pi`. Ribeiro, Giannakis
//! and Roumeliotis call it the sign-of-innovations filter; the paper that this crate follows calls it Dymbo.
//!
//! The filters keep **a mean and a variance and use closed forms**: no particles, no grid, no table. The variances do not depend on
//! the data. The cost: the belief is a normal density with the posterior's moments, not the exact posterior. [`chain`]
//! computes what that adds to the mean squared error: 0.02 % for the paper's parameters, at most 0.14 % for `|a| <= 1`, `gamma <= 1`. A
//! better estimator from the same bits can gain no more.
//!
//! | task | item |
//! |---|---|
//! | the sensors' schemes | [`SignBit`] (any threshold), [`InnovationWord`], [`RoundedSample`] |
//! | the filter, one bit | [`DymboFilter`] |
//! | several bits per sample, several sensors, vector states | [`MultibitFilter`], [`ParallelFilter`], the factor of [`SignBit`] in any filter of `fewbits_filters` |
//! | one slot of sensor, link and filter in one call | [`ScalarFilter::exchange`] |
//! | expected errors | [`ScalarPlant::steady_state`], [`ScalarPlant::loss`] (closed forms), [`chain`] (exact errors) |
//!
//! The likelihood of a report is a [`Factor`](fewbits_core::Factor), for any threshold and any [`Link`](fewbits_core::Link).
//! `fewbits_filters::assumed_density::update` applies it to a Gaussian belief; the filters here are closed forms of that update. A
//! report that is known to be lost is [`Observation::Lost`](fewbits_core::Observation::Lost). For smoothing, apply the smoothers of
//! `fewbits_filters` to the beliefs of any filter here.
//!
//! ```
//! use fewbits_core::{Observation, Sign};
//! use fewbits_dymbo::{DymboFilter, RoundedSample, ScalarFilter, ScalarPlant};
//!
//! let filter = DymboFilter::new(ScalarPlant::new(0.9, 0.5, 1.0)?);
//! let samples = [2.31, 1.27, 3.05, 0.42];
//!
//! let scheme = RoundedSample::new(1.0, 1.0)?;
//! let message = scheme.round(samples[0])?;
//! let mut belief = scheme.belief(message)?;
//! for sample in &samples[1..] {
//!     let bit = Sign::of(*sample, filter.threshold(&belief))?;      // at the sensor
//!     belief = filter.step(&belief, &Observation::Received(bit))?.0;
//! }
//! assert!((belief.mean()[0] - 0.842_833).abs() < 1e-6);
//! # Ok::<(), fewbits_dymbo::Error>(())
//! ```
//!
//! Not here: energy and radio (`fewbits-network`), and the choice of which sensor reports (`fewbits-sensor-assignment`).

pub mod chain;
mod filter;
mod first_message;
mod innovation_word;
mod multibit;
mod parallel;
mod plant;
pub mod sign_bit;
pub mod steady;

pub use fewbits_core::Error;
pub use filter::{DymboFilter, ScalarFilter, StepInfo};
pub use first_message::{Multiple, RoundedSample};
pub use innovation_word::{CellIndex, InnovationWord, Prediction};
pub use multibit::MultibitFilter;
pub use parallel::{CountFusion, ParallelFilter};
pub use plant::{ScalarPlant, filtered_variance, innovation_gain};
pub use sign_bit::SignBit;
pub use {nalgebra, rand};
