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
//! | the sensor's half | [`OneBitSensor`], [`MultibitSensor`], [`FineSensor`] |
//! | the filter, one bit | [`DymboFilter`], [`Initialisation`], [`bit_update`], [`cell_update`] |
//! | more bits, more sensors | [`MultibitFilter`], [`ParallelFilter`], [`vector`] |
//! | what to expect | [`steady`] (closed forms, loss, contours), [`chain`] and [`tree`] (exact errors) |
//! | how normal the posterior is | [`skew_normal`]; successive bits of one sample: [`iterated`] |
//!
//! Erased bits are [`Observation::Lost`](fewbits_core::Observation::Lost). Smoothing is that of `fewbits_filters`, applied to
//! the beliefs of any filter here.
//!
//! ```
//! use fewbits_core::{Encoder, Gaussian, Observation};
//! use fewbits_dymbo::{DymboFilter, FineSensor, Initialisation, OneBitSensor, ScalarPlant};
//!
//! let filter = DymboFilter::new(ScalarPlant::new(0.9, 0.5, 1.0)?);
//! let samples = [2.31, 1.27, 3.05, 0.42];
//!
//! let sensor = FineSensor::new(1.0)?;
//! let message = sensor.encode(&samples[0], &());
//! let mut belief = filter.init(&Initialisation::Fine { sensor, message })?;
//! for sample in &samples[1..] {
//!     let bit = OneBitSensor.encode(sample, &filter.threshold(&belief));
//!     belief = filter.step(&belief, Observation::Received(bit))?.0;
//! }
//! assert!((belief.mean()[0] - 0.842_833).abs() < 1e-6);
//! # Ok::<(), fewbits_dymbo::Error>(())
//! ```
//!
//! Not here: energy and links (`fewbits-network`), the true state, any choice of which sensor speaks.

pub mod chain;
mod error;
mod filter;
mod initial;
pub mod iterated;
mod multibit;
mod parallel;
mod plant;
mod sensor;
pub mod skew_normal;
pub mod steady;
pub mod tree;
mod update;
pub mod vector;

pub use error::Error;
pub use filter::{DymboFilter, StepInfo, ThresholdRule};
pub use initial::{FirstMessageValue, Initialisation, first_message_mse, first_message_value};
pub use multibit::MultibitFilter;
pub use parallel::{CountFusion, ParallelFilter};
pub use plant::ScalarPlant;
pub use sensor::{CellIndex, FineMessage, FineSensor, MultibitSensor, OneBitSensor, Prediction};
pub use update::{UpdateInfo, bit_update, cell_update, expected_bit_information};
