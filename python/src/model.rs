//! Models of the state by name: linear dynamics in continuous time, their dimension known at run time.

use crate::array::{matrix, vector};
use crate::error::{Called, Outcome, refused};
use crate::given::{named, of_class};
use crate::stored::{self, Reduced};
use fewbits_core::{Dynamics, Evolution, GaussianDynamics};
use fewbits_models::{AffineGaussian, ContinuousLinear};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::positive;
use nalgebra::{SMatrix, SVector};
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::{Deserialize, Serialize};
use std::sync::{Mutex, OnceLock, PoisonError};

/// Calls `$body` with `$D` a constant equal to `$dimension`.
macro_rules! with_dimension {
    ($dimension:expr, $D:ident => $body:expr) => {
        with_dimension!(@ $dimension, $D, $body, 1 2 3 4 5 6)
    };
    (@ $dimension:expr, $D:ident, $body:expr, $($d:literal)*) => {
        match $dimension {
            $($d => {
                const $D: usize = $d;
                $body
            })*
            other => $crate::error::refused("dimension", other, "1 to 6 coordinates"),
        }
    };
}

pub(crate) use with_dimension;

/// Linear dynamics in continuous time, `dx = (A x + b) dt + dW`, for up to six coordinates. Time is in seconds.
///
/// >>> import numpy as np, fewbits as fb
/// >>> model = fb.Model.velocity(0.1)
/// >>> model.dimension
/// 2
/// >>> model.simulate([0.0, 1.0, 2.5], start=[0.0, 1.0], seed=1).shape
/// (3, 2)
#[pyclass(frozen, skip_from_py_object, module = "fewbits")]
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Model {
    dimension: usize,
    /// By columns.
    drift: Vec<f64>,
    offset: Vec<f64>,
    density: Vec<f64>,
    /// Of a model in steps: then `drift` is the transition and `density` the covariance of the noise of one step.
    interval: Option<f64>,
}

/// The dynamics of a model over any time.
#[derive(Clone, Copy)]
pub(crate) enum Moves<const D: usize> {
    Continuous(ContinuousLinear<D>),
    /// One step, and its seconds.
    Steps(AffineGaussian<D>, f64),
}

/// Largest distance of a time from a whole number of steps, as a share of one.
const WHOLE: f64 = 1e-6;

impl<const D: usize> Evolution<D> for Moves<D> {
    fn over(&self, seconds: f64) -> Result<Box<dyn GaussianDynamics<D> + '_>, ArgumentError> {
        Ok(Box::new(self.lasting(seconds)?))
    }
}

impl<const D: usize> Moves<D> {
    /// The model over `seconds`; of a model in steps only over whole ones.
    pub(crate) fn lasting(&self, seconds: f64) -> Result<AffineGaussian<D>, ArgumentError> {
        let (step, interval) = match self {
            Self::Continuous(model) => return model.over(seconds),
            Self::Steps(step, interval) => (step, interval),
        };
        let steps = (seconds / interval).round();
        if !(steps >= 0.0 && steps < 1e15 && (seconds / interval - steps).abs() <= WHOLE) {
            return Err(ArgumentError::new("seconds", seconds, format!("a whole number of intervals of {interval} s")));
        }
        // Square and multiply: the moves of 1, 2, 4, ... steps, those of the number's binary digits one after the other.
        let after = |(f, g, q): Affine<D>, (first_f, first_g, first_q): Affine<D>| {
            (f * first_f, f * first_g + g, f * first_q * f.transpose() + q)
        };
        let mut power = (*step.transition(), *step.offset(), *step.noise_covariance());
        let mut moved = (SMatrix::identity(), SVector::zeros(), SMatrix::zeros());
        let mut left = steps as u64;
        while left > 0 {
            if left & 1 == 1 {
                moved = after(power, moved);
            }
            power = after(power, power);
            left >>= 1;
        }
        let (f, g, q) = moved;
        AffineGaussian::new(f, g, (q + q.transpose()) * 0.5)
    }
}

type Affine<const D: usize> = (SMatrix<f64, D, D>, SVector<f64, D>, SMatrix<f64, D, D>);

/// A model that keeps its dynamics over the first time, which are read without a lock, and over the last: rows of a table are mostly as far
/// apart as those before.
pub(crate) struct Remembering<const D: usize> {
    moves: Moves<D>,
    first: OnceLock<(f64, AffineGaussian<D>)>,
    last: Mutex<Option<(f64, AffineGaussian<D>)>>,
}

impl<const D: usize> Remembering<D> {
    pub(crate) fn new(moves: Moves<D>) -> Self {
        Self {
            moves,
            first: OnceLock::new(),
            last: Mutex::new(None),
        }
    }

    fn lasting(&self, seconds: f64) -> Result<AffineGaussian<D>, ArgumentError> {
        // A lock whose owner has panicked holds a whole entry: it is written at once.
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        match *last {
            Some((same, moved)) if same == seconds => Ok(moved),
            _ => {
                let moved = self.moves.lasting(seconds)?;
                *last = Some((seconds, moved));
                Ok(moved)
            }
        }
    }
}

impl<const D: usize> Evolution<D> for Remembering<D> {
    fn over(&self, seconds: f64) -> Result<Box<dyn GaussianDynamics<D> + '_>, ArgumentError> {
        let moved = match self.first.get() {
            Some((same, moved)) if *same == seconds => *moved,
            Some(_) => self.lasting(seconds)?,
            None => {
                let moved = self.moves.lasting(seconds)?;
                // Another thread may have been faster.
                let _ = self.first.set((seconds, moved));
                moved
            }
        };
        Ok(Box::new(moved))
    }
}

impl Model {
    pub(crate) fn of<const D: usize>(model: ContinuousLinear<D>) -> Self {
        Self {
            dimension: D,
            drift: model.drift().as_slice().to_vec(),
            offset: model.offset().as_slice().to_vec(),
            density: model.density().as_slice().to_vec(),
            interval: None,
        }
    }

    pub(crate) fn checked(self) -> Outcome<Self> {
        with_dimension!(self.dimension, D => self.typed::<D>().map(|_| ()))?;
        Ok(self)
    }

    pub(crate) fn typed<const D: usize>(&self) -> Outcome<Moves<D>> {
        let square = D * D;
        if (self.drift.len(), self.offset.len(), self.density.len()) != (square, D, square) {
            return refused("model", "of other lengths", format!("{D} coordinates"));
        }
        let (drift, density) = (SMatrix::from_column_slice(&self.drift), SMatrix::from_column_slice(&self.density));
        let offset = SVector::from_column_slice(&self.offset);
        Ok(match self.interval {
            None => Moves::Continuous(ContinuousLinear::new(drift, offset, density)?),
            Some(interval) => {
                Moves::Steps(AffineGaussian::new(drift, offset, density)?, positive("interval", interval)?)
            }
        })
    }

    pub(crate) fn coordinates(&self) -> usize {
        self.dimension
    }
}

#[pymethods]
impl Model {
    /// A random walk whose variance grows by `density` a second.
    ///
    /// >>> import fewbits as fb
    /// >>> fb.Model.walk(0.1).dimension
    /// 1
    #[staticmethod]
    fn walk(#[pyo3(from_py_with = named)] density: f64) -> Outcome<Self> {
        Ok(Self::of(ContinuousLinear::random_walk(density)?))
    }

    /// A level that returns to `mean` within `time_constant` seconds, with variance `variance` in the long run (Ornstein-Uhlenbeck).
    ///
    /// >>> import fewbits as fb
    /// >>> fb.Model.reverting(mean=20.0, time_constant=3600.0, variance=4.0).dimension
    /// 1
    #[staticmethod]
    #[pyo3(signature = (*, mean, time_constant, variance))]
    fn reverting(
        #[pyo3(from_py_with = named)] mean: f64,
        #[pyo3(from_py_with = named)] time_constant: f64,
        #[pyo3(from_py_with = named)] variance: f64,
    ) -> Outcome<Self> {
        Ok(Self::of(
            ContinuousLinear::ornstein_uhlenbeck(mean, time_constant, variance)
                .called(&[("drift", "time_constant"), ("density", "variance")])?,
        ))
    }

    /// Nearly constant velocity on a line: position, velocity. `density` is that of the acceleration.
    ///
    /// >>> import fewbits as fb
    /// >>> fb.Model.velocity(0.1).dimension
    /// 2
    #[staticmethod]
    fn velocity(#[pyo3(from_py_with = named)] density: f64) -> Outcome<Self> {
        Ok(Self::of(ContinuousLinear::nearly_constant_velocity(density)?))
    }

    /// Nearly constant acceleration on a line: position, velocity, acceleration. `density` is that of the jerk.
    ///
    /// >>> import fewbits as fb
    /// >>> fb.Model.acceleration(0.1).dimension
    /// 3
    #[staticmethod]
    fn acceleration(#[pyo3(from_py_with = named)] density: f64) -> Outcome<Self> {
        Ok(Self::of(ContinuousLinear::nearly_constant_acceleration(density)?))
    }

    /// Nearly constant velocity in a plane: x, its velocity, y, its velocity.
    ///
    /// >>> import fewbits as fb
    /// >>> fb.Model.plane(0.1).dimension
    /// 4
    #[staticmethod]
    fn plane(#[pyo3(from_py_with = named)] density: f64) -> Outcome<Self> {
        Ok(Self::of(ContinuousLinear::nearly_constant_velocity_2d(density)?))
    }

    /// Any linear model of one to six coordinates: drift `A` and noise density, square matrices, and offset `b` (zero if left out).
    ///
    /// >>> import numpy as np, fewbits as fb
    /// >>> fb.Model.linear(-np.eye(2), np.eye(2)).dimension
    /// 2
    #[staticmethod]
    #[pyo3(signature = (drift, density, offset=None))]
    fn linear(
        drift: &Bound<'_, PyAny>,
        density: &Bound<'_, PyAny>,
        offset: Option<&Bound<'_, PyAny>>,
    ) -> Outcome<Self> {
        let (dimension, _, _) = matrix("drift", drift)?;
        let offset = offset.map(|given| vector("offset", given)).transpose()?;
        let model = Self {
            dimension,
            drift: square("drift", drift, dimension)?,
            density: square("density", density, dimension)?,
            offset: sized("offset", offset.unwrap_or_else(|| vec![0.0; dimension]), dimension)?,
            interval: None,
        };
        model.checked()
    }

    /// A linear model in steps of `interval` seconds, `x' = F x + g + n` with `n ~ N(0, Q)`: `transition`, `noise` and `offset`. All times
    /// must be a whole number of steps apart.
    ///
    /// >>> import fewbits as fb
    /// >>> fb.Model.steps([[1, 1], [0, 1]], [[0.25, 0.5], [0.5, 1.0]]).dimension
    /// 2
    #[staticmethod]
    #[pyo3(signature = (transition, noise, *, offset=None, interval=1.0))]
    fn steps(
        transition: &Bound<'_, PyAny>,
        noise: &Bound<'_, PyAny>,
        offset: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = named)] interval: f64,
    ) -> Outcome<Self> {
        let (dimension, _, _) = matrix("transition", transition)?;
        let offset = offset.map(|given| vector("offset", given)).transpose()?;
        let model = Self {
            dimension,
            drift: square("transition", transition, dimension)?,
            density: square("noise", noise, dimension)?,
            offset: sized("offset", offset.unwrap_or_else(|| vec![0.0; dimension]), dimension)?,
            interval: Some(interval),
        };
        model.checked().called(&[("noise_covariance", "noise")])
    }

    /// This model and another side by side, independent of each other: the coordinates of this one, then those of the other.
    ///
    /// >>> import fewbits as fb
    /// >>> fb.Model.velocity(0.1).beside(fb.Model.walk(0.01)).dimension
    /// 3
    fn beside(&self, #[pyo3(from_py_with = of_class)] other: &Bound<'_, Self>) -> Outcome<Self> {
        let other = other.get();
        if self.interval != other.interval {
            let shown = |model: &Self| match model.interval {
                None => "in continuous time".to_owned(),
                Some(interval) => format!("in steps of {interval} s"),
            };
            return refused("other", shown(other), shown(self));
        }
        let (a, b) = (self.dimension, other.dimension);
        let d = a + b;
        let both = |first: &[f64], second: &[f64]| -> Vec<f64> {
            let entry = |k: usize| match (k % d, k / d) {
                (i, j) if i < a && j < a => first[j * a + i],
                (i, j) if i >= a && j >= a => second[(j - a) * b + i - a],
                _ => 0.0,
            };
            (0..d * d).map(entry).collect()
        };
        let model = Self {
            dimension: d,
            drift: both(&self.drift, &other.drift),
            offset: [self.offset.as_slice(), &other.offset].concat(),
            density: both(&self.density, &other.density),
            interval: self.interval,
        };
        model.checked()
    }

    #[staticmethod]
    fn _restored(state: &Bound<'_, PyAny>) -> Outcome<Self> {
        stored::state::<Self>(state)?.checked()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> Outcome<Reduced<'py, (Bound<'py, PyBytes>,)>> {
        Ok((stored::maker::<Self>(py)?, (stored::bytes(py, self)?,)))
    }

    /// Number of coordinates.
    ///
    /// >>> import fewbits as fb
    /// >>> fb.Model.walk(0.1).dimension
    /// 1
    #[getter]
    fn dimension(&self) -> usize {
        self.dimension
    }

    /// A random path: the state at each of the `times` (seconds, not decreasing), beginning with `start` at the first. Shape (times, d).
    ///
    /// >>> import fewbits as fb
    /// >>> fb.Model.walk(0.1).simulate([0.0, 1.0], start=5.0, seed=1)[0]
    /// array([5.])
    #[pyo3(signature = (times, *, start, seed))]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        times: &Bound<'py, PyAny>,
        start: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = named)] seed: u64,
    ) -> Outcome<Bound<'py, PyArray2<f64>>> {
        let (times, start) = (vector("times", times)?, sized("start", vector("start", start)?, self.dimension)?);
        let path = py.detach(|| with_dimension!(self.dimension, D => self.path::<D>(&times, &start, seed)))?;
        Ok(PyArray2::from_vec2(py, &path).map_err(PyErr::from)?)
    }
}

impl Model {
    fn path<const D: usize>(&self, times: &[f64], start: &[f64], seed: u64) -> Outcome<Vec<Vec<f64>>> {
        let model = self.typed::<D>()?;
        let mut rng = Stream::new(seed).rng();
        let mut state = SVector::<f64, D>::from_column_slice(start);
        let mut now = times.first().copied().unwrap_or(0.0);
        let mut path = Vec::with_capacity(times.len());
        for (row, time) in times.iter().enumerate() {
            if row % 1024 == 1023 {
                Python::attach(|py| py.check_signals())?;
            }
            state = model.lasting(time - now)?.propagate(&mut rng, &state);
            now = *time;
            path.push(state.as_slice().to_vec());
        }
        Ok(path)
    }
}

/// A square matrix by columns.
pub(crate) fn square(name: &'static str, given: &Bound<'_, PyAny>, dimension: usize) -> Outcome<Vec<f64>> {
    match matrix(name, given)? {
        (rows, columns, by_rows) if rows == dimension && columns == dimension => Ok((0..rows * columns)
            .map(|k| by_rows[k % rows * columns + k / rows])
            .collect()),
        (rows, columns, _) => refused(name, format!("{rows} by {columns}"), format!("{dimension} by {dimension}")),
    }
}

/// Numbers of one dimension, of this length.
pub(crate) fn sized(name: &'static str, given: Vec<f64>, dimension: usize) -> Outcome<Vec<f64>> {
    if given.len() == dimension {
        return Ok(given);
    }
    refused(name, format!("{} numbers", given.len()), format!("{dimension}"))
}

/// The covariance, by columns, of deviations or of a matrix.
pub(crate) fn covariance(
    deviation: Option<&Bound<'_, PyAny>>,
    covariance: Option<&Bound<'_, PyAny>>,
    dimension: usize,
) -> Outcome<Vec<f64>> {
    match (deviation, covariance) {
        (Some(deviation), None) => {
            let deviation = sized("deviation", vector("deviation", deviation)?, dimension)?;
            if let Some(bad) = deviation.iter().find(|x| !(**x >= 0.0 && (**x * **x).is_finite())) {
                return refused("deviation", bad, "numbers, 0 or above, whose squares are finite");
            }
            let entry = |k: usize| match (k % dimension, k / dimension) {
                (i, j) if i == j => deviation[i] * deviation[i],
                _ => 0.0,
            };
            Ok((0..dimension * dimension).map(entry).collect())
        }
        (None, Some(covariance)) => square("covariance", covariance, dimension),
        _ => refused("deviation", "given with a covariance, or neither is", "one of the two"),
    }
}
