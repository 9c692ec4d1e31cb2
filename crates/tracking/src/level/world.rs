//! The model of the level.

use crate::level::options::Model;
use fewbits_core::Gaussian;
use fewbits_filters::Error as FilterError;
use fewbits_filters::calibration::{self, Calibration, Level, Number, Openness};
use fewbits_models::ContinuousLinear;
use nalgebra::{SMatrix, SVector};

/// Standard deviation of an unknown slope, in multiples of the change per time.
const STEEPEST: f64 = 10.0;

/// Calls a method of the level under the model of a world, whose change is guessed.
macro_rules! of_level {
    ($world:expr, $guess:expr, |$level:ident| $call:expr) => {{
        let (period, own) = ($world.period, $world);
        match own.model {
            Model::Velocity => {
                let (world, prior) = (|change| own.velocity(change), &own.start($guess)?);
                let $level = Level { world, prior, period };
                $call
            }
            Model::Acceleration => {
                let (world, prior) = (|change| own.acceleration(change), &own.start($guess)?);
                let $level = Level { world, prior, period };
                $call
            }
            _ => {
                let (world, prior) = (|change| own.walk(change), &own.start::<1>($guess)?);
                let $level = Level { world, prior, period };
                $call
            }
        }
    }};
}

/// Model of the level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct World {
    pub(crate) model: Model,
    /// Standard deviation of the level from its forecast, and after how many seconds.
    pub(crate) change: f64,
    pub(crate) within: f64,
    /// Mean and standard deviation of the level before the first row.
    pub(crate) prior: (f64, f64),
    /// The same of the slope per second, if it is stated.
    pub(crate) slope: Option<(f64, f64)>,
    /// Standard deviation of the slope per second that the first rows suggest; 0 if they are not known.
    pub(crate) steepest: f64,
    /// Period of the level, if it is an angle.
    pub(crate) period: Option<f64>,
    /// Whether the change is adapted during the run.
    pub(crate) is_learning: bool,
    /// Number of sensors of the first rows.
    pub(crate) sensors: usize,
    /// Whether all beliefs are kept, to be smoothed.
    pub(crate) is_smoothed: bool,
    /// Whether the noise of sensors is followed, so that the centre may return to states before.
    pub(crate) is_followed: bool,
    /// Whether errors of sensors last from row to row.
    pub(crate) is_lasting: bool,
    /// Standard deviation of what the offsets that were found shift all values.
    pub(crate) zero: f64,
    /// What the rows leave open of the change and the noises that were found from them.
    pub(crate) open: Option<Openness>,
    /// Whether readings cut the belief so that it is no Gaussian: it is then followed on a grid.
    pub(crate) is_on_grid: bool,
    /// Whether values are sent on change only.
    pub(crate) is_on_change: bool,
    /// Seconds between rows.
    pub(crate) interval: f64,
}

impl World {
    /// Mean and covariance of the state before the first row.
    pub(crate) fn start<const D: usize>(&self, change: f64) -> Result<Gaussian<D>, FilterError> {
        let per_time = STEEPEST * change;
        let of = |i: usize| match (i, self.slope) {
            (0, _) => self.prior,
            (1, Some(slope)) => slope,
            (1, None) => (0.0, (per_time / self.within).max(self.steepest)),
            _ => (0.0, per_time / self.within.powi(i as i32)),
        };
        let mean = SVector::<f64, D>::from_fn(|i, _| of(i).0);
        let deviations = SVector::<f64, D>::from_fn(|i, _| of(i).1);
        Ok(Gaussian::new(mean, SMatrix::from_diagonal(&deviations.component_mul(&deviations)))?)
    }

    /// From known values at time 0, the level after `t` has the variance `q t`, `q t^3 / 3` or `q t^5 / 20` if the level, the slope or the
    /// curvature is a random walk of density `q`. Here it is `change^2`.
    pub(crate) fn walk(&self, change: f64) -> Result<ContinuousLinear<1>, FilterError> {
        let (c, t) = (change * change, self.within);
        match self.model {
            Model::Returning => {
                let variance = self.prior.1 * self.prior.1;
                // The deviation after `within` seconds, `v (1 - exp(-2 t / tau))`, solved for `tau`.
                let rate = -0.5 * (-c / variance).ln_1p() / t;
                ContinuousLinear::ornstein_uhlenbeck(self.prior.0, 1.0 / rate, variance)
            }
            _ => ContinuousLinear::random_walk(c / t),
        }
    }

    pub(crate) fn velocity(&self, change: f64) -> Result<ContinuousLinear<2>, FilterError> {
        ContinuousLinear::nearly_constant_velocity(3.0 * change * change / self.within.powi(3))
    }

    pub(crate) fn acceleration(&self, change: f64) -> Result<ContinuousLinear<3>, FilterError> {
        ContinuousLinear::nearly_constant_acceleration(20.0 * change * change / self.within.powi(5))
    }

    /// Change and noise of each sensor, found together from the first values.
    pub(crate) fn calibrate(
        &self,
        instants: &[calibration::Instant],
        change: Number,
        guess: f64,
        noises: &[Number],
    ) -> Result<Calibration, FilterError> {
        if self.is_on_grid && self.is_on_change && !matches!(self.model, Model::Velocity | Model::Acceleration) {
            let (world, prior) = (|change| self.walk(change), &self.start(guess)?);
            let level = Level {
                world,
                prior,
                period: self.period,
            };
            return level.calibrate_on_grid(instants, change, noises);
        }
        of_level!(self, guess, |level| level.calibrate(instants, change, noises))
    }

    /// What the values leave open of the numbers that were found from them, which are the guesses.
    pub(crate) fn openness(
        &self,
        instants: &[calibration::Instant],
        change: Number,
        noises: &[Number],
    ) -> Result<Option<Openness>, FilterError> {
        of_level!(self, self.change, |level| level.openness(instants, change, noises))
    }
}
