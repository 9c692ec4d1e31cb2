//! Kalman-like filters fed with one sign bit a sample.
//!
//! A sensor that may send a single bit is asked the one question whose answer says most: *is your sample above what we
//! expect it to be?* The fusion centre broadcasts its prediction, the sensor answers with a sign, and the estimate moves by
//! a fixed step in that direction. The posterior is nearly normal, so two numbers describe it, and the recursion is a Kalman
//! filter in which the information of a measurement is multiplied by `2/pi` (Ribeiro, Giannakis and Roumeliotis call it the
//! sign-of-innovations filter; here it is Dymbo).
//!
//! The central choice is to keep **two numbers and closed forms**: no particle, no grid, no table at run time, and variances
//! that do not depend on the data. Its cost is that the belief is the normal density of the right moments and not the exact
//! posterior; [`chain`] and [`tree`] compute exactly what that costs (0.02 % of the mean squared error where the paper looks,
//! 0.14 % at worst for `|a| <= 1`, `gamma <= 1`), so nothing better is worth building from the same bits.
//!
//! | task | item |
//! |---|---|
//! | the sensors' schemes | [`SignBit`] (any threshold), [`InnovationWord`], [`RoundedSample`] |
//! | the filter, one bit | [`DymboFilter`] |
//! | more bits, more sensors, vectors | [`MultibitFilter`], [`ParallelFilter`], [`SignFilter`] |
//! | a closed loop in one call | [`ScalarFilter::exchange`] |
//! | what to expect | [`steady`] (closed forms, loss, contours), [`chain`] and [`tree`] (exact errors), [`gap`] (beside the exact posterior) |
//! | comparisons of the publications: how normal the posterior is, successive bits of one sample | [`published`] |
//!
//! What a report says is a [`Factor`](fewbits_core::Factor), whatever the threshold and the [`Link`](fewbits_core::Link):
//! `fewbits_filters::assumed_density::update` turns it into the moments of any Gaussian belief, and the filters here are its
//! closed forms. Reports known to be lost are [`Observation::Lost`](fewbits_core::Observation::Lost). Smoothing is that of
//! `fewbits_filters`, applied to the beliefs of any filter here.
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
//! Not here: energy (`fewbits-network`), the true state, any choice of which sensor reports.

mod centre;
pub mod chain;
mod filter;
mod first_message;
pub mod gap;
mod innovation_word;
mod multibit;
mod parallel;
mod plant;
pub mod published;
pub mod sign_bit;
pub mod steady;
pub mod tree;
mod vector;

pub use centre::{ParallelEstimator, ScalarEstimator};
pub use fewbits_core::Error;
pub use filter::{DymboFilter, ScalarFilter, StepInfo};
pub use first_message::{FirstMessageValue, Multiple, RoundedSample, first_message_mse, first_message_value};
pub use innovation_word::{CellIndex, InnovationWord, Prediction};
pub use multibit::MultibitFilter;
pub use parallel::{CountFusion, ParallelFilter};
pub use plant::{ScalarPlant, filtered_variance, innovation_gain};
pub use sign_bit::SignBit;
pub use vector::{SignFilter, VectorInfo};
pub use {nalgebra, rand};
