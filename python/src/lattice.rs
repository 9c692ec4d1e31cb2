//! The exact filter of several numbers on a lattice, with the user's dynamics and likelihood as functions of all nodes at once.

use crate::array::{matrix, vector};
use crate::callbacks::Likelihoods;
use crate::error::{Called, Failure, Outcome, refused};
use crate::given::named;
use crate::nodes::{Kept, Parts, callable, dt_of, step};
use crate::rows::Rows;
use crate::stored::{self, Reduced};
use crate::table::Table;
use fewbits_filters::{Lattice, LatticeKernel as Kernel, UniformGrid};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

/// An exact filter of two or a few numbers, on the nodes of a lattice: on each axis from `lower` to `upper`, `spacing` apart.
///
/// Over `dt` seconds the state at node `x` becomes normal and independent along the axes, with means `mean(x, dt)` and deviations
/// `deviation(x, dt)`. In `x` each row is a coordinate and each column a node; the means have its shape, and the deviations too, unless they
/// are one number per axis or one for all. `likelihood(x, z)` returns the logarithms of the likelihood of the observation `z` at the nodes; a
/// dictionary has one such function per column. `start` is means and deviations before the first observation, or the density at the nodes, of
/// any sum. A deviation must be at least the distance between nodes on its axis.
///
/// >>> import numpy as np, fewbits as fb
/// >>> place = fb.LatticeFilter(
/// ...     lambda x, dt: x, lambda x, dt: 0.3 * np.sqrt(dt), lambda x, z: -0.5 * ((z - np.hypot(x[0], x[1])) / 0.2) ** 2,
/// ...     lower=[0, 0], upper=[6, 6], spacing=[0.2, 0.2], start=([3.0, 1.0], [1.0, 0.5]),
/// ... )
/// >>> _ = place.step(5.0)
/// >>> place.density.shape, place.nodes.shape, bool(abs(np.hypot(*place.mean) - 5) < 0.2)
/// ((31, 31), (2, 961), True)
/// >>> place.run(fb.Table({"t": [0.0, 1.0], "z": [5.0, 5.1]}), time="t").columns
/// ['t', 'x0', 'x0_sd', 'x1', 'x1_sd', 'log_likelihood']
#[pyclass(module = "fewbits")]
pub(crate) struct LatticeFilter {
    mean: Py<PyAny>,
    deviation: Py<PyAny>,
    likelihoods: Likelihoods,
    belief: Lattice,
    kernel: Kept<Kernel>,
}

#[pymethods]
impl LatticeFilter {
    #[new]
    #[pyo3(signature = (mean, deviation, likelihood, *, lower, upper, spacing, start))]
    fn new(
        mean: &Bound<'_, PyAny>,
        deviation: &Bound<'_, PyAny>,
        likelihood: &Bound<'_, PyAny>,
        lower: &Bound<'_, PyAny>,
        upper: &Bound<'_, PyAny>,
        spacing: &Bound<'_, PyAny>,
        start: &Bound<'_, PyAny>,
    ) -> Outcome<Self> {
        callable("mean", mean)?;
        callable("deviation", deviation)?;
        let (lower, upper) = (vector("lower", lower)?, vector("upper", upper)?);
        let spacing = vector("spacing", spacing)?;
        for (name, ends) in [("upper", &upper), ("spacing", &spacing)] {
            if ends.len() != lower.len() {
                return refused(name, format!("{} numbers", ends.len()), format!("{}, as in `lower`", lower.len()));
            }
        }
        let axes = lower.iter().zip(&upper).zip(&spacing);
        let axes: Result<Vec<_>, _> = axes.map(|((l, u), s)| UniformGrid::new(*l, *u, *s)).collect();
        let axes = axes?;
        let belief = match start.extract::<(Vec<f64>, Vec<f64>)>() {
            Ok((means, deviations)) => {
                Lattice::normal(axes, &means, &deviations).called(&[("mean", "start"), ("deviation", "start")])?
            }
            Err(_) => {
                let made = Lattice::uniform(axes)?;
                let flat = crate::array::flat("start", start)?;
                made.with_density(flat)?
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
        let (axes, density): (Vec<UniformGrid>, Vec<f64>) = stored::state(state)?;
        Ok(Self {
            mean,
            deviation,
            likelihoods: Likelihoods::parsed("likelihood", likelihood)?,
            belief: Lattice::uniform(axes)?.with_density(density)?,
            kernel: None,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> Outcome<Reduced<'py, Parts<'py>>> {
        let (mean, deviation) = (self.mean.bind(py).clone(), self.deviation.bind(py).clone());
        let state = stored::bytes(py, &(self.belief.axes(), self.belief.density()))?;
        let parts = (mean, deviation, self.likelihoods.given(py)?, state);
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
        let nodes = self.nodes(py)?.into_any();
        let moved = |belief: &Lattice| moved(py, &self.mean, &self.deviation, belief, dt);
        let of = (dt, &nodes);
        step(py, &mut self.belief, &mut self.kernel, &self.likelihoods, observation.as_ref(), of, moved)
    }

    /// One step per row of a table, its column `time` in seconds or timestamps; null and NaN are missing. The first row is the time of the
    /// start. The result has mean and deviation of each coordinate.
    #[pyo3(signature = (table, *, time))]
    fn run(
        &mut self,
        py: Python<'_>,
        table: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named)] time: &str,
    ) -> Outcome<Table> {
        let mut rows = Rows::read(table, time, &self.likelihoods, self.belief.axes().len())?;
        while let Some((observation, [before, now])) = rows.next(py)? {
            let log = self.step(py, Some(observation), dt_of(now, before))?;
            let all = self.belief.moments().into_iter();
            rows.push(log, all.map(|(mean, variance)| (mean, variance.max(0.0).sqrt())));
        }
        rows.table(None)
    }

    /// The nodes, a coordinate in each row.
    #[getter]
    fn nodes<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyArray2<f64>>> {
        nodes(py, &self.belief)
    }

    /// The density at the nodes, an axis for each coordinate: its sum times the product of the spacings is one.
    #[getter]
    fn density<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let shape: Vec<usize> = self.belief.axes().iter().map(UniformGrid::points).collect();
        PyArray1::from_slice(py, self.belief.density()).call_method1("reshape", (shape,))
    }

    /// The density of one coordinate, at the nodes of its axis.
    ///
    /// >>> import numpy as np, fewbits as fb
    /// >>> still = fb.LatticeFilter(
    /// ...     lambda x, dt: x, lambda x, dt: 1.0, lambda x, z: 0 * x[0], lower=[-4, -4], upper=[4, 4], spacing=[0.5, 1], start=([0, 0], [1, 1])
    /// ... )
    /// >>> still.marginal(1).shape, round(float(still.marginal(1).sum()), 6)
    /// ((9,), 1.0)
    fn marginal<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = named)] coordinate: usize,
    ) -> Outcome<Bound<'py, PyArray1<f64>>> {
        let axes = self.belief.axes().len();
        if coordinate >= axes {
            return refused("coordinate", coordinate, format!("0 to {}", axes - 1));
        }
        Ok(PyArray1::from_vec(py, self.belief.marginal(coordinate)))
    }

    /// Means of the coordinates.
    #[getter]
    fn mean<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.belief.moments().into_iter().map(|(mean, _)| mean).collect())
    }

    /// Their standard deviations.
    #[getter]
    fn deviation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let deviations = self
            .belief
            .moments()
            .into_iter()
            .map(|(_, variance)| variance.max(0.0).sqrt());
        PyArray1::from_vec(py, deviations.collect())
    }
}

/// The nodes of a lattice, a coordinate in each row.
fn nodes<'py>(py: Python<'py>, belief: &Lattice) -> Outcome<Bound<'py, PyArray2<f64>>> {
    let rows: Vec<Vec<f64>> = (0..belief.axes().len()).map(|axis| belief.positions(axis)).collect();
    Ok(PyArray2::from_vec2(py, &rows).map_err(PyErr::from)?)
}

/// The kernel over `dt` seconds.
fn moved(py: Python<'_>, mean: &Py<PyAny>, deviation: &Py<PyAny>, belief: &Lattice, dt: f64) -> Outcome<Kernel> {
    let (d, n) = (belief.axes().len(), belief.density().len());
    let by_rows = |name: &'static str, found: &Bound<'_, PyAny>| -> Outcome<Vec<Vec<f64>>> {
        let (rows, columns, numbers) = matrix(name, found)?;
        if (rows, columns) != (d, n) {
            return refused(
                name,
                format!("an array of shape ({rows}, {columns})"),
                format!("({d}, {n}), as the nodes"),
            );
        }
        Ok(numbers.chunks_exact(n).map(<[f64]>::to_vec).collect())
    };
    let means = by_rows("mean", &mean.bind(py).call1((nodes(py, belief)?, dt))?)?;
    let found = deviation.bind(py).call1((nodes(py, belief)?, dt))?;
    let deviations = match vector("deviation", &found) {
        Ok(one) if one.len() == 1 => vec![vec![one[0]; n]; d],
        Ok(each) if each.len() == d => each.into_iter().map(|one| vec![one; n]).collect(),
        _ => by_rows("deviation", &found)?,
    };
    py.detach(|| Kernel::new(means, deviations, belief))
        .map_err(Failure::from)
}
