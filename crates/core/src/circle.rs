//! Measurements on a circle: angles, phases, times of day.
//!
//! Values that differ by whole periods are the same measurement. A difference `z - h(x)` of two of them is therefore taken by the shorter way
//! around. [`Sensing::periods`] says which components of a measurement are periodic; [`Observed`](crate::Observed) then moves `h(x)` by whole
//! periods until it is nearest to [`Factor::location`](crate::Factor::location). A factor on the line is so one on the circle, as long as the
//! noise's deviation is below about a sixth of the period. [`Levels::around`](crate::factor::Levels::around) has no such limit.
//!
//! | you have | take |
//! |---|---|
//! | a sensing model that measures an angle | [`Periodic`] about it, or [`Sensing::periods`] of your own model |
//! | a scheme that compares a sample with its feedback | [`nearest`] in its `encode`, or [`OnCircle`] about it |

use crate::columns::{Columns, ColumnsMut};
use crate::error::Error;
use crate::measurement_noise::MeasurementNoise;
use crate::message::Message;
use crate::observation::{Link, Observation};
use crate::scheme::{Deterministic, Scheme};
use crate::sensing::Sensing;
use fewbits_numerics::error::{ArgumentError, positive};
use nalgebra::{Matrix1, SMatrix, SVector, Vector1};
use rand::Rng;

/// `value` moved by whole periods so that it is nearest to `about`: in `[about - period / 2, about + period / 2]`.
///
/// ```
/// use fewbits_core::circle::nearest;
/// assert_eq!(nearest(359.0, 1.0, 360.0), -1.0);
/// assert_eq!(nearest(1.0, 359.0, 360.0), 361.0);
/// ```
#[inline]
pub fn nearest(value: f64, about: f64, period: f64) -> f64 {
    value - period * ((value - about) / period).round()
}

/// Every component that has a period by [`nearest`].
#[inline]
pub fn all_nearest<const M: usize>(
    values: SVector<f64, M>,
    about: &SVector<f64, M>,
    periods: &[Option<f64>; M],
) -> SVector<f64, M> {
    SVector::from_fn(|k, _| periods[k].map_or(values[k], |period| nearest(values[k], about[k], period)))
}

/// A sensing model whose measurements are periodic.
///
/// A compass in degrees; the state is a heading that may grow beyond a turn:
///
/// ```
/// use fewbits_core::circle::Periodic;
/// use fewbits_core::factor::Value;
/// use fewbits_core::{Gaussian, Likelihood, Observed, Sensing};
/// # use fewbits_core::rand::Rng;
/// # use nalgebra::{Matrix1, Vector1};
/// # #[derive(Clone)]
/// # struct Compass;
/// # impl Sensing<1, 1> for Compass {
/// #     fn mean(&self, x: &Vector1<f64>) -> Vector1<f64> { *x }
/// #     fn jacobian(&self, _: &Vector1<f64>) -> Matrix1<f64> { Matrix1::new(1.0) }
/// #     fn noise_covariance_at(&self, _: &Vector1<f64>) -> Matrix1<f64> { Matrix1::new(4.0) }
/// #     fn sample(&self, _: &mut dyn Rng, x: &Vector1<f64>) -> Vector1<f64> { *x }
/// # }
/// let compass = Periodic::new(Compass, [Some(360.0)])?; // noise variance 4
/// let mut heading = Gaussian::scalar(358.0, 4.0)?;
/// Observed::new(compass, Value::scalar(2.0, 4.0)?).condition(&mut heading)?;
/// assert!((heading.mean()[0] - 360.0).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Periodic<S, const M: usize> {
    sensing: S,
    periods: [Option<f64>; M],
}

impl<S, const M: usize> Periodic<S, M> {
    /// `sensing`, of which component `k` has the period `periods[k]`; `None`: the component is a number on the line.
    ///
    /// # Errors
    /// If a period is not positive and finite.
    pub fn new(sensing: S, periods: [Option<f64>; M]) -> Result<Self, ArgumentError> {
        periods
            .iter()
            .flatten()
            .try_for_each(|period| positive("periods", *period).map(|_| ()))?;
        Ok(Self { sensing, periods })
    }
}

impl<S: Sensing<D, M>, const D: usize, const M: usize> Sensing<D, M> for Periodic<S, M> {
    #[inline]
    fn mean(&self, state: &SVector<f64, D>) -> SVector<f64, M> {
        self.sensing.mean(state)
    }

    fn jacobian(&self, state: &SVector<f64, D>) -> SMatrix<f64, M, D> {
        self.sensing.jacobian(state)
    }

    fn noise_covariance_at(&self, state: &SVector<f64, D>) -> SMatrix<f64, M, M> {
        self.sensing.noise_covariance_at(state)
    }

    fn sample(&self, rng: &mut dyn Rng, state: &SVector<f64, D>) -> SVector<f64, M> {
        self.sensing.sample(rng, state)
    }

    fn mean_columns(&self, states: &Columns<'_, D>, means: ColumnsMut<'_, M>) {
        self.sensing.mean_columns(states, means);
    }

    fn periods(&self) -> [Option<f64>; M] {
        self.periods
    }
}

/// A scheme that compares a sample with a number that it is told, for samples on a circle: its sensor takes the sample nearest to that number.
///
/// A bit at the prediction then says on which side of it the sample lies, by the shorter way around.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnCircle<C> {
    scheme: C,
    period: f64,
}

impl<C> OnCircle<C> {
    /// `scheme` for samples of this period.
    ///
    /// # Errors
    /// If the period is not positive and finite.
    pub fn new(scheme: C, period: f64) -> Result<Self, ArgumentError> {
        let period = positive("period", period)?;
        Ok(Self { scheme, period })
    }
}

impl<C: MeasurementNoise<1>> MeasurementNoise<1> for OnCircle<C> {
    fn noise_covariance_at(&self, m: &Vector1<f64>) -> Matrix1<f64> {
        self.scheme.noise_covariance_at(m)
    }
}

impl<C: Deterministic<1> + Scheme<1, Feedback = f64>> Deterministic<1> for OnCircle<C> {}

impl<C: Scheme<1, Feedback = f64>> Scheme<1> for OnCircle<C> {
    type State = C::State;
    type Feedback = f64;
    type Report = C::Report;
    type Factor = C::Factor;

    fn start(&self) -> C::State {
        self.scheme.start()
    }

    fn feedback_format(&self) -> <f64 as Message>::Format {
        self.scheme.feedback_format()
    }

    fn report_format(&self) -> <C::Report as Message>::Format {
        self.scheme.report_format()
    }

    fn encode(
        &self,
        rng: &mut dyn Rng,
        state: &mut C::State,
        measurement: &Vector1<f64>,
        feedback: &f64,
    ) -> Result<Option<C::Report>, Error> {
        let near = nearest(measurement[0], *feedback, self.period);
        self.scheme.encode(rng, state, &Vector1::new(near), feedback)
    }

    fn factor(&self, feedback: &f64, observation: &Observation<C::Report>, link: &Link) -> Result<C::Factor, Error> {
        self.scheme.factor(feedback, observation, link)
    }
}
