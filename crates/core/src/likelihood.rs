//! Likelihoods of what scalar linear sensors say, `z = h'x + n`, `n ~ N(0, sigma^2)`.
//!
//! One exact `ln p(heard | x)` for each way of saying little: the value itself, a sign bit through a noisy link, a quantizer
//! cell, silence of a censoring sensor, loss. Any filter can hear them.

use crate::message::{Cell, Sign};
use crate::state_space::{Columns, Likelihood};
use fewbits_numerics::error::{self, ArgumentError};
use fewbits_numerics::normal;
use nalgebra::SVector;

/// What was heard of one scalar measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Heard {
    /// The measurement itself.
    Value(f64),
    /// A sign bit at `threshold`, delivered inverted with probability `crossover`.
    Bit {
        /// The received bit.
        sign: Sign,
        /// The threshold the sensor used.
        threshold: f64,
        /// Probability in `[0, 1/2]` that the link inverted the bit.
        crossover: f64,
    },
    /// The cell of a quantizer.
    Cell(Cell),
    /// Nothing arrived. The sensor is silent if and only if its measurement is in `cell`; a spoken message is lost with
    /// probability `loss`: `p = loss + (1 - loss) P(cell)`.
    Silence {
        /// Where a silent measurement lies.
        cell: Cell,
        /// Probability in `[0, 1)` that a sent message does not arrive.
        loss: f64,
    },
    /// Nothing is known: a lost message of a sensor that always speaks.
    Lost,
}

/// `ln p(heard | x)` for a scalar linear sensor.
///
/// ```
/// use fewbits_core::likelihood::{Heard, ScalarLikelihood};
/// use fewbits_core::{Likelihood, message::Sign};
/// use nalgebra::SVector;
/// let bit = Heard::Bit { sign: Sign::Above, threshold: 0.0, crossover: 0.0 };
/// let heard = ScalarLikelihood::new(SVector::from([1.0]), 1.0, bit)?;
/// assert!((heard.log_likelihood(&SVector::from([0.0])) - 0.5_f64.ln()).abs() < 1e-15);
/// # Ok::<(), fewbits_numerics::ArgumentError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScalarLikelihood<const D: usize> {
    row: SVector<f64, D>,
    standard_deviation: f64,
    heard: Heard,
}

impl<const D: usize> ScalarLikelihood<D> {
    /// The likelihood of `heard` from a sensor with row `h` and noise `standard_deviation`.
    ///
    /// # Errors
    /// If a number is not finite, `standard_deviation <= 0`, `crossover` outside `[0, 1/2]` or `loss` outside `[0, 1)`.
    pub fn new(row: SVector<f64, D>, standard_deviation: f64, heard: Heard) -> Result<Self, ArgumentError> {
        error::all_finite("row", row.as_slice())?;
        error::positive("standard_deviation", standard_deviation)?;
        match heard {
            Heard::Value(value) => error::finite("value", value).map(drop)?,
            Heard::Bit {
                threshold, crossover, ..
            } => {
                error::finite("threshold", threshold)?;
                error::within("crossover", crossover, 0.0, 0.5)?;
            }
            Heard::Silence { loss, .. } => {
                if !(0.0..1.0).contains(&loss) {
                    return Err(ArgumentError::new("loss", loss, "a probability in [0, 1)"));
                }
            }
            Heard::Cell(_) | Heard::Lost => {}
        }
        Ok(Self {
            row,
            standard_deviation,
            heard,
        })
    }

    /// What was heard.
    pub fn heard(&self) -> &Heard {
        &self.heard
    }

    /// `ln p(heard | h'x = mean)`.
    #[inline]
    pub fn given_mean(&self, mean: f64) -> f64 {
        let s = self.standard_deviation;
        match self.heard {
            Heard::Value(value) => normal::log_pdf((value - mean) / s) - s.ln(),
            Heard::Bit {
                sign,
                threshold,
                crossover,
            } => {
                let log_clean = normal::log_cdf(sign.value() * (mean - threshold) / s);
                mix_in(log_clean, crossover, 1.0 - 2.0 * crossover)
            }
            Heard::Cell(cell) => cell.log_probability(mean, s),
            Heard::Silence { cell, loss } => mix_in(cell.log_probability(mean, s), loss, 1.0 - loss),
            Heard::Lost => 0.0,
        }
    }
}

/// `ln(floor + share exp(log_p))`.
#[inline]
fn mix_in(log_p: f64, floor: f64, share: f64) -> f64 {
    if floor == 0.0 {
        log_p
    } else {
        (floor + share * log_p.exp()).ln()
    }
}

impl<const D: usize> Likelihood<D> for ScalarLikelihood<D> {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        self.given_mean(self.row.dot(state))
    }

    fn add_log_likelihoods(&self, states: Columns<'_, D>, log_weights: &mut [f64]) {
        let s = self.standard_deviation;
        if let Heard::Value(value) = self.heard {
            // A plain quadratic: kept free of branches so that it vectorises.
            let (half_precision, constant) = (0.5 / (s * s), normal::LN_SQRT_2PI + s.ln());
            for (i, log_weight) in log_weights.iter_mut().enumerate() {
                let mean: f64 = (0..D).map(|d| self.row[d] * states[d][i]).sum();
                let innovation = value - mean;
                *log_weight -= innovation * innovation * half_precision + constant;
            }
        } else {
            for (i, log_weight) in log_weights.iter_mut().enumerate() {
                *log_weight += self.given_mean((0..D).map(|d| self.row[d] * states[d][i]).sum());
            }
        }
    }
}
