//! The exact filter of a scalar state on a grid, with the user's dynamics and likelihood as functions of all nodes at once.

use crate::callbacks::{Likelihoods, returned};
use crate::error::{Called, Outcome, refused};
use crate::given::named;
use crate::nodes::{Kept, Parts, callable, dt_of, step};
use crate::rows::Rows;
use crate::stored::{self, Reduced};
use crate::table::Table;
use fewbits_filters::{PointMass, TransitionKernel, UniformGrid};
use numpy::PyArray1;
use pyo3::prelude::*;

/// An exact filter of one number, on nodes from `lower` to `upper`, `spacing` apart.
///
/// Over `dt` seconds the state at node `x` becomes normal with mean `mean(x, dt)` and deviation `deviation(x, dt)`, both functions of all
/// nodes at once (a deviation may be one number). `likelihood(x, z)` returns the logarithms of the likelihood of the observation `z` at the
/// nodes; a dictionary has one such function per column. `start` is mean and deviation before the first observation, or the density at the
/// nodes, of any sum. The deviation must be at least the distance between nodes.
///
/// >>> import numpy as np, fewbits as fb
/// >>> grid = fb.GridFilter(
/// ...     lambda x, dt: x, lambda x, dt: 0.5 * np.sqrt(dt), lambda x, z: -0.5 * ((z - x) / 0.4) ** 2,
/// ...     lower=-10, upper=10, spacing=0.05, start=(0.0, 2.0),
/// ... )
/// >>> _ = grid.step(1.5)
/// >>> bool(abs(grid.mean - 1.5) < 0.1), grid.nodes.shape
/// (True, (401,))
#[pyclass(module = "fewbits")]
pub(crate) struct GridFilter {
    mean: Py<PyAny>,
    deviation: Py<PyAny>,
    likelihoods: Likelihoods,
    belief: PointMass,
    kernel: Kept<TransitionKernel>,
}

#[pymethods]
impl GridFilter {
    #[new]
    #[pyo3(signature = (mean, deviation, likelihood, *, lower, upper, spacing, start))]
    fn new(
        mean: &Bound<'_, PyAny>,
        deviation: &Bound<'_, PyAny>,
        likelihood: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named)] lower: f64,
        #[pyo3(from_py_with = named)] upper: f64,
        #[pyo3(from_py_with = named)] spacing: f64,
        start: &Bound<'_, PyAny>,
    ) -> Outcome<Self> {
        callable("mean", mean)?;
        callable("deviation", deviation)?;
        let grid = UniformGrid::new(lower, upper, spacing)?;
        let belief = match start.extract::<(f64, f64)>() {
            Ok((mean, deviation)) => PointMass::normal(grid, mean, deviation * deviation)
                .called(&[("mean", "start"), ("variance", "start")])?,
            Err(_) => {
                let density = returned("start", "node", start, grid.points())?;
                let mut belief = PointMass::new(grid, |_| 0.0)?;
                let density: Vec<f64> = density.as_array().iter().copied().collect();
                if let Some(bad) = density.iter().find(|p| !(**p >= 0.0 && p.is_finite())) {
                    return refused("start", bad, "finite numbers, 0 or above");
                }
                belief.reweight(&density)?;
                belief
            }
        };
        Ok(Self {
            mean: mean.clone().unbind(),
            deviation: deviation.clone().unbind(),
            likelihoods: Likelihoods::parsed("likelihood", likelihood)?,
            belief,
            kernel: None,
        })
    }

    #[staticmethod]
    fn _restored(
        mean: Py<PyAny>,
        deviation: Py<PyAny>,
        likelihood: &Bound<'_, PyAny>,
        state: &Bound<'_, PyAny>,
    ) -> Outcome<Self> {
        Ok(Self {
            mean,
            deviation,
            likelihoods: Likelihoods::parsed("likelihood", likelihood)?,
            belief: stored::state(state)?,
            kernel: None,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> Outcome<Reduced<'py, Parts<'py>>> {
        let (mean, deviation) = (self.mean.bind(py).clone(), self.deviation.bind(py).clone());
        let parts = (mean, deviation, self.likelihoods.given(py)?, stored::bytes(py, &self.belief)?);
        Ok((stored::maker::<Self>(py)?, parts))
    }

    /// Prediction over `dt` seconds (none if 0) and update by the observation (none if None or NaN). Returns the log likelihood. With
    /// likelihoods by name the observation is a dictionary. A step that fails leaves the density as it was.
    #[pyo3(signature = (observation=None, *, dt=1.0))]
    fn step(
        &mut self,
        py: Python<'_>,
        observation: Option<Bound<'_, PyAny>>,
        #[pyo3(from_py_with = named)] dt: f64,
    ) -> Outcome<f64> {
        let nodes = self.nodes(py).into_any();
        let moved = |belief: &PointMass| moved(py, &self.mean, &self.deviation, belief.grid(), dt);
        let of = (dt, &nodes);
        step(py, &mut self.belief, &mut self.kernel, &self.likelihoods, observation.as_ref(), of, moved)
    }

    /// One step per row of a table, its column `time` in seconds or timestamps; null and NaN are missing. The first row is the time of the
    /// start.
    ///
    /// >>> import numpy as np, polars as pl, fewbits as fb
    /// >>> from math import log
    /// >>> bit = lambda x, z: np.log(np.where(z > 0, 1, 0) * (x > 1) * 0.98 + 0.01)
    /// >>> grid = fb.GridFilter(
    /// ...     lambda x, dt: x, lambda x, dt: 0.5 * np.sqrt(dt), {"alarm": bit}, lower=-10, upper=10, spacing=0.05, start=(0.0, 2.0)
    /// ... )
    /// >>> grid.run(pl.DataFrame({"t": [0.0, 1.0, 2.0], "alarm": [1, None, 1]}), time="t").columns
    /// ['t', 'x0', 'x0_sd', 'log_likelihood']
    #[pyo3(signature = (table, *, time))]
    fn run(
        &mut self,
        py: Python<'_>,
        table: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named)] time: &str,
    ) -> Outcome<Table> {
        let mut rows = Rows::read(table, time, &self.likelihoods, 1)?;
        while let Some((observation, [before, now])) = rows.next(py)? {
            let log = self.step(py, Some(observation), dt_of(now, before))?;
            rows.push(log, [(self.belief.mean(), self.belief.variance().max(0.0).sqrt())]);
        }
        rows.table(None)
    }

    /// The nodes.
    #[getter]
    fn nodes<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.belief.grid().nodes().collect())
    }

    /// The density at the nodes: its sum times their distance is one.
    #[getter]
    fn density<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.belief.density())
    }

    /// Mean of the density.
    #[getter]
    fn mean(&self) -> f64 {
        self.belief.mean()
    }

    /// Its standard deviation.
    #[getter]
    fn deviation(&self) -> f64 {
        self.belief.variance().max(0.0).sqrt()
    }
}

/// The kernel over `dt` seconds.
fn moved(
    py: Python<'_>,
    mean: &Py<PyAny>,
    deviation: &Py<PyAny>,
    grid: &UniformGrid,
    dt: f64,
) -> Outcome<TransitionKernel> {
    let nodes = || PyArray1::from_vec(py, grid.nodes().collect());
    let points = grid.points();
    let mean = mean.bind(py).call1((nodes(), dt))?;
    let mean = returned("mean", "node", &mean, points)?;
    let deviation = deviation.bind(py).call1((nodes(), dt))?;
    let deviations: Vec<f64> = match deviation.extract::<f64>() {
        Ok(one) => vec![one; points],
        Err(_) => returned("deviation", "node", &deviation, points)?
            .as_array()
            .iter()
            .copied()
            .collect(),
    };
    let moved: Vec<(f64, f64)> = mean.as_array().iter().copied().zip(deviations).collect();
    Ok(py.detach(|| TransitionKernel::from_transitions(*grid, &moved))?)
}
