//! The ensemble Kalman filter, with the user's dynamics and measurement as functions of all members at once.

use crate::array::{matrix, shown};
use crate::callbacks::{Likelihoods, returned};
use crate::error::{Failure, Outcome, refused};
use crate::given::named;
use crate::model::with_dimension;
use crate::random::{self, Generator};
use crate::rows::Rows;
use crate::sigma::{Sensor, moved, of_columns, said, sensors};
use crate::stored::{self, Reduced};
use crate::table::Table;
use fewbits_core::Gaussian;
use fewbits_core::points::move_measured_points;
use fewbits_filters::Error;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// The functions, and the state.
type Parts<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyBytes>);

/// The ensemble Kalman filter: equally weighted members that move by the dynamics, noise included, and by regression on what was measured.
///
/// `start` has the members, shape (d, n), up to six coordinates. `move(x, dt, rng)` draws the next states: it changes `x` in place, or returns
/// an array of its shape; `rng` is a `Generator`. `measure(x)` returns the noise-free measurement of each member; a dictionary has one such
/// function per column. `noise` is the deviation of the measurements, and `send` what their sensors send: "value", "bit" (is the sample at or
/// above the prediction?) or "word:2" to "word:4"; a dictionary has them by column. `period` is that of measurements on a circle, as 360 of
/// bearings in degrees: they are compared the shorter way around. After each time update deviations from the mean are
/// multiplied by `inflation`, at least 1: `1 + 1 / (2 n)` makes up for the sampling error of the variance. No observations are perturbed: an
/// update gives the members the mean and the covariance of the exact update of their own. A step that fails leaves the members as they were.
///
/// >>> import numpy as np, fewbits as fb
/// >>> def move(x, dt, rng):
/// ...     x[0] += dt * x[1]
/// ...     rng.add_normal(x[1], 0.1 * np.sqrt(dt))
/// >>> start = np.random.default_rng(1).standard_normal((2, 200)) + [[3.0], [0.0]]
/// >>> ensemble = fb.EnsembleFilter(start, move, lambda x: np.hypot(x[0], 3.0), noise=0.1, seed=1)
/// >>> for z in [5.0, 5.1, 5.2]:
/// ...     _ = ensemble.step(z)
/// >>> bool(abs(np.hypot(ensemble.mean[0], 3.0) - 5.2) < 0.2), ensemble.states.shape
/// (True, (2, 200))
#[pyclass(module = "fewbits")]
pub(crate) struct EnsembleFilter {
    /// By coordinates.
    members: Vec<Vec<f64>>,
    transition: Py<PyAny>,
    measures: Likelihoods,
    sensors: Vec<Sensor>,
    inflation: f64,
    generator: Py<Generator>,
}

#[pymethods]
impl EnsembleFilter {
    #[new]
    #[pyo3(signature = (start, r#move, measure, *, noise, seed, send=None, inflation=1.0, period=None))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        start: &Bound<'_, PyAny>,
        r#move: &Bound<'_, PyAny>,
        measure: &Bound<'_, PyAny>,
        noise: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named)] seed: u64,
        send: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = named)] inflation: f64,
        period: Option<&Bound<'_, PyAny>>,
    ) -> Outcome<Self> {
        let (d, n, numbers) = matrix("start", start)?;
        if numbers.is_empty() || d > 6 {
            return refused("start", format!("{d} by {n} numbers"), "at least one member of 1 to 6 coordinates");
        }
        if let Some(bad) = numbers.iter().find(|x| !x.is_finite()) {
            return refused("start", bad, "finite numbers only");
        }
        if !r#move.is_callable() {
            return refused("move", r#move.get_type().name()?, "a function of states, seconds and a random generator");
        }
        if !(inflation >= 1.0 && inflation.is_finite()) {
            return refused("inflation", inflation, "a finite number of at least 1");
        }
        let measures = Likelihoods::parsed("measure", measure)?;
        Ok(Self {
            members: numbers.chunks_exact(n).map(<[f64]>::to_vec).collect(),
            transition: r#move.clone().unbind(),
            sensors: sensors(&measures.names(), noise, send, period)?,
            measures,
            inflation,
            generator: Py::new(py, Generator::of(seed))?,
        })
    }

    #[staticmethod]
    fn _restored(
        py: Python<'_>,
        r#move: Py<PyAny>,
        measure: &Bound<'_, PyAny>,
        state: &Bound<'_, PyAny>,
    ) -> Outcome<Self> {
        let (members, sensors, inflation, generator): (Vec<Vec<f64>>, Vec<Sensor>, f64, random::State) =
            stored::state(state)?;
        let measures = Likelihoods::parsed("measure", measure)?;
        let count = members.first().map_or(0, Vec::len);
        let alike = members
            .iter()
            .all(|column| column.len() == count && column.iter().all(|x| x.is_finite()));
        let right = (1..=6).contains(&members.len()) && count > 0 && sensors.len() == measures.names().len();
        if !(alike && right && inflation >= 1.0 && sensors.iter().all(Sensor::is_valid)) {
            return refused("state", format!("{} coordinates", members.len()), "that of an ensemble filter");
        }
        Ok(Self {
            members,
            transition: r#move,
            measures,
            sensors,
            inflation,
            generator: Py::new(py, Generator::restored(generator)?)?,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> Outcome<Reduced<'py, Parts<'py>>> {
        let generator = self.generator.borrow(py).state();
        let state = stored::bytes(py, &(&self.members, &self.sensors, self.inflation, generator))?;
        let parts = (self.transition.bind(py).clone(), self.measures.given(py)?, state);
        Ok((stored::maker::<Self>(py)?, parts))
    }

    /// Moves the members by `dt` seconds (not if 0) and by the observation (not if None or NaN). Returns the log likelihood. With
    /// measurements by name the observation is a dictionary.
    #[pyo3(signature = (observation=None, *, dt=1.0))]
    fn step(
        &mut self,
        py: Python<'_>,
        observation: Option<Bound<'_, PyAny>>,
        #[pyo3(from_py_with = named)] dt: f64,
    ) -> Outcome<f64> {
        Ok(self.advanced(py, observation.as_ref(), dt)?.0)
    }

    /// One step per row of a table, its column `time` in seconds or timestamps; null and NaN are missing. The first row is the time of the
    /// start.
    ///
    /// >>> import numpy as np, polars as pl, fewbits as fb
    /// >>> level = fb.EnsembleFilter(
    /// ...     np.linspace(-1, 1, 50)[None], lambda x, dt, rng: rng.add_normal(x[0], 0.1), {"a": lambda x: x[0]}, noise=0.5, seed=1, send="bit",
    /// ... )
    /// >>> level.run(pl.DataFrame({"t": [0.0, 1.0, 3.0], "a": [1.2, None, 1.5]}), time="t").columns
    /// ['t', 'x0', 'x0_sd', 'log_likelihood', 'bits']
    #[pyo3(signature = (table, *, time))]
    fn run(
        &mut self,
        py: Python<'_>,
        table: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named)] time: &str,
    ) -> Outcome<Table> {
        let (mut rows, mut sent) = (Rows::read(table, time, &self.measures, self.members.len())?, Vec::new());
        while let Some((observation, [before, now])) = rows.next(py)? {
            let (log, bits) = self.advanced(py, Some(&observation), now - before)?;
            let all = self.members.iter().map(|column| moments(column));
            rows.push(log, all.map(|(mean, variance)| (mean, variance.sqrt())));
            sent.push(bits);
        }
        rows.table(Some(sent))
    }

    /// The members, (d, n).
    #[getter]
    fn states<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyArray2<f64>>> {
        of_columns(py, self.members.clone())
    }

    /// Their mean.
    #[getter]
    fn mean<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.members.iter().map(|column| moments(column).0).collect())
    }

    /// Their covariance, (d, d): the mean of products of deviations.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyArray2<f64>>> {
        let means: Vec<f64> = self.members.iter().map(|column| moments(column).0).collect();
        let of = |(a, mean_a): (&Vec<f64>, f64), (b, mean_b): (&Vec<f64>, f64)| {
            a.iter().zip(b).map(|(a, b)| (a - mean_a) * (b - mean_b)).sum::<f64>() / a.len() as f64
        };
        let pairs = || self.members.iter().zip(means.iter().copied());
        of_columns(py, pairs().map(|a| pairs().map(|b| of(a, b)).collect()).collect())
    }
}

impl EnsembleFilter {
    /// Log likelihood and bits of a step.
    fn advanced(&mut self, py: Python<'_>, observation: Option<&Bound<'_, PyAny>>, dt: f64) -> Outcome<(f64, i64)> {
        if !(dt >= 0.0 && dt.is_finite()) {
            return refused("dt", dt, "a finite number, 0 or above");
        }
        let observed = self.measures.of(observation)?;
        let mut next = self.members.clone();
        let (d, n) = (next.len(), next.first().map_or(0, Vec::len));
        if dt > 0.0 {
            let given = of_columns(py, next.clone())?;
            let returned = self.transition.bind(py).call1((&given, dt, self.generator.bind(py)))?;
            moved("members", given, returned, &mut next)?;
            if !next.iter().flatten().all(|x| x.is_finite()) {
                return Err(Error::NotANumber { what: "a member" }.into());
            }
            for column in next.iter_mut().filter(|_| self.inflation > 1.0) {
                let mean = moments(column).0;
                column.iter_mut().for_each(|x| *x = mean + (*x - mean) * self.inflation);
            }
        }
        let (mut log_likelihood, mut bits) = (0.0, 0);
        for (at, function, sample) in observed {
            let Ok(sample) = sample.extract::<f64>() else {
                return refused("observation", shown(&sample), "a number");
            };
            let found = function.bind(py).call1((of_columns(py, next.clone())?,))?;
            let mut measured = returned("measure", "member", &found, n)?.as_array().to_vec();
            let sensor = &self.sensors[at];
            sensor.unwrap(&mut measured);
            let (log, sent) = with_dimension!(d, D => updated::<D>(&mut next, &measured, sensor, sample))?;
            (log_likelihood, bits) = (log_likelihood + log, bits + sent);
        }
        self.members = next;
        Ok((log_likelihood, bits))
    }
}

/// Moves the members by what the sensor says of its sample. Returns the log likelihood and the bits.
fn updated<const D: usize>(
    members: &mut [Vec<f64>],
    measured: &[f64],
    sensor: &Sensor,
    sample: f64,
) -> Outcome<(f64, i64)> {
    let (mean, variance) = moments(measured);
    if !(mean.is_finite() && variance.is_finite()) {
        let what = "a measurement of a member";
        return Err(Error::NotANumber { what }.into());
    }
    let (factor, bits) = said(sensor, sample, &Gaussian::scalar(mean, variance)?)?;
    let mut columns = members.iter_mut();
    let states: [&mut [f64]; D] = std::array::from_fn(|_| columns.next().map_or(&mut [][..], Vec::as_mut_slice));
    let weights = vec![1.0 / measured.len() as f64; measured.len()];
    let (log_likelihood, _) = move_measured_points(states, &weights, &[measured], &factor)
        .map_err(|error| Failure::from(Error::from(error)))?;
    Ok((log_likelihood, bits))
}

/// Mean and variance of equally weighted numbers.
fn moments(column: &[f64]) -> (f64, f64) {
    let count = column.len() as f64;
    let mean = column.iter().sum::<f64>() / count;
    (mean, column.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / count)
}
