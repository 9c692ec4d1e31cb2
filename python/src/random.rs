//! Random numbers of the library, and the parts of a particle filter over arrays: weights and resampling.

use crate::array::{line, shown, vector, zeros};
use crate::error::{Outcome, refused};
use crate::given::named;
use crate::stored::{self, Reduced};
use crate::weights::exponentials;
use fewbits_filters::Resampling;
use fewbits_monte_carlo::Stream;
use fewbits_numerics::kernels::{StandardNormals, largest_number, vectorised};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Numbers that are drawn together.
const BLOCK: usize = 512;
/// Largest number of numbers of one call.
const MOST: usize = 1 << 32;

/// The random source of callbacks: the library's normal numbers, some six times as fast as NumPy's and the same on every machine.
///
/// >>> import fewbits as fb
/// >>> rng = fb.Generator(1)
/// >>> rng.standard_normal(3).shape, bool(((rng.random(5) >= 0) & (rng.random(5) < 1)).all())
/// ((3,), True)
#[pyclass(module = "fewbits")]
pub(crate) struct Generator {
    normals: StandardNormals,
    uniforms: Pcg64Mcg,
}

/// What a generator is, to be stored.
#[derive(Serialize, Deserialize)]
pub(crate) struct State {
    normals: [u64; 2],
    uniforms: Pcg64Mcg,
}

impl Generator {
    pub(crate) fn state(&self) -> State {
        State {
            normals: self.normals.state(),
            uniforms: self.uniforms.clone(),
        }
    }

    pub(crate) fn restored(state: State) -> Outcome<Self> {
        let State { normals, uniforms } = state;
        match StandardNormals::from_state(normals) {
            Some(normals) => Ok(Self { normals, uniforms }),
            None => refused("state", "that of no generator", "the state of a generator"),
        }
    }

    pub(crate) fn of(seed: u64) -> Self {
        let mut rng = Stream::new(seed).fast_rng();
        Self {
            normals: StandardNormals::new(&mut rng),
            uniforms: rng,
        }
    }
}

#[pymethods]
impl Generator {
    #[new]
    fn new(#[pyo3(from_py_with = named)] seed: u64) -> Self {
        Self::of(seed)
    }

    #[staticmethod]
    fn _restored(state: &Bound<'_, PyAny>) -> Outcome<Self> {
        Self::restored(stored::state(state)?)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> Outcome<Reduced<'py, (Bound<'py, PyBytes>,)>> {
        Ok((stored::maker::<Self>(py)?, (stored::bytes(py, &self.state())?,)))
    }

    /// `count` independent standard normal numbers.
    fn standard_normal<'py>(
        &mut self,
        py: Python<'py>,
        #[pyo3(from_py_with = named)] count: usize,
    ) -> Outcome<Bound<'py, PyArray1<f64>>> {
        let mut normals = zeros(checked(count)?)?;
        self.normals.fill(&mut normals);
        Ok(PyArray1::from_vec(py, normals))
    }

    /// Adds independent normal numbers of mean 0 and this `deviation` to an array, in place: the noise of a coordinate without arrays in
    /// between.
    ///
    /// Raises `fewbits.ArgumentError` if `array` is no writable one-dimensional array of doubles.
    ///
    /// >>> import numpy as np, fewbits as fb
    /// >>> x = np.full((2, 1000), 5.0)
    /// >>> fb.Generator(1).add_normal(x[1], 0.5)
    /// >>> bool(x[0].std() == 0), bool(abs(x[1].std() - 0.5) < 0.05)
    /// (True, True)
    fn add_normal(&mut self, array: &Bound<'_, PyAny>, #[pyo3(from_py_with = named)] deviation: f64) -> Outcome<()> {
        if !(deviation >= 0.0 && deviation.is_finite()) {
            return refused("deviation", deviation, "a finite number, 0 or above");
        }
        let expected = "a writable one-dimensional array of doubles";
        let Ok(cells) = array.cast::<PyArray1<f64>>() else {
            return refused("array", shown(array), expected);
        };
        let Ok(mut cells) = cells.try_readwrite() else {
            return refused("array", "one that cannot be written", expected);
        };
        let mut normals = [0.0; BLOCK];
        let mut add = |cells: &mut [f64]| {
            for cells in cells.chunks_mut(BLOCK) {
                let normals = &mut normals[..cells.len()];
                self.normals.fill(normals);
                vectorised(
                    #[inline(always)]
                    || {
                        cells
                            .iter_mut()
                            .zip(normals)
                            .for_each(|(x, normal)| *x += deviation * *normal);
                    },
                );
            }
        };
        match cells.as_slice_mut() {
            Ok(cells) => add(cells),
            Err(_) => {
                let mut cells = cells.as_array_mut();
                let mut own = cells.to_vec();
                add(&mut own);
                cells.iter_mut().zip(own).for_each(|(x, own)| *x = own);
            }
        }
        Ok(())
    }

    /// `count` independent numbers, uniform in [0, 1).
    fn random<'py>(
        &mut self,
        py: Python<'py>,
        #[pyo3(from_py_with = named)] count: usize,
    ) -> Outcome<Bound<'py, PyArray1<f64>>> {
        let mut uniforms: Vec<f64> = zeros(checked(count)?)?;
        uniforms
            .iter_mut()
            .for_each(|uniform| *uniform = self.uniforms.random());
        Ok(PyArray1::from_vec(py, uniforms))
    }
}

fn checked(count: usize) -> Outcome<usize> {
    if count <= MOST {
        return Ok(count);
    }
    refused("count", count, format!("at most {MOST}"))
}

/// Weights that sum to one from logarithms of weights, with the logarithm of their sum and the effective sample size.
///
/// Raises `fewbits.ImpossibleError` if all are -inf, `fewbits.Error` if one is NaN.
///
/// >>> import numpy as np, fewbits as fb
/// >>> weights, log_sum, size = fb.normalise(np.log([1.0, 3.0]) - 1000)
/// >>> weights.round(6), round(size, 6)
/// (array([0.25, 0.75]), 1.6)
#[pyfunction]
pub(crate) fn normalise<'py>(
    py: Python<'py>,
    log_weights: &Bound<'py, PyAny>,
) -> Outcome<(Bound<'py, PyArray1<f64>>, f64, f64)> {
    // Without a copy of an array: memory for two would go back to the system after each call, and is slow to get again.
    let own;
    let given = line::<f64>("log_weights", log_weights);
    let logs = match &given {
        Ok(given) => given.as_slice().map_err(PyErr::from)?,
        Err(_) => {
            own = vector("log_weights", log_weights)?;
            &own
        }
    };
    let mut weights = zeros(logs.len())?;
    let sums = exponentials(logs, largest_number(logs), &mut weights)?;
    let scale = 1.0 / sums.sum;
    weights.iter_mut().for_each(|weight| *weight *= scale);
    Ok((PyArray1::from_vec(py, weights), sums.log_sum, sums.effective_sample_size))
}

/// Indices of `count` draws (as many as there are weights, if left out) with probabilities in proportion to weights of any sum. `scheme` is
/// "systematic", "stratified", "residual" or "multinomial". Indices do not decrease.
///
/// >>> import fewbits as fb
/// >>> fb.resample([0.0, 0.5, 0.5, 1.0], seed=1).tolist()
/// [1, 2, 3, 3]
#[pyfunction]
#[pyo3(signature = (weights, *, count=None, scheme="systematic", seed))]
pub(crate) fn resample<'py>(
    py: Python<'py>,
    weights: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = named)] count: Option<usize>,
    #[pyo3(from_py_with = named)] scheme: &str,
    #[pyo3(from_py_with = named)] seed: u64,
) -> Outcome<Bound<'py, PyArray1<i64>>> {
    let weights = line::<f64>("weights", weights)?;
    let weights = weights.as_slice().map_err(PyErr::from)?;
    let scheme = match scheme {
        "systematic" => Resampling::Systematic,
        "stratified" => Resampling::Stratified,
        "residual" => Resampling::Residual,
        "multinomial" => Resampling::Multinomial,
        other => {
            let expected = "'systematic', 'stratified', 'residual' or 'multinomial'";
            return refused("scheme", format!("'{other}'"), expected);
        }
    };
    let count = count.unwrap_or(weights.len());
    if u32::try_from(count.max(weights.len())).is_err() {
        return refused("count", count, "less than 2^32, as the number of weights");
    }
    let (mut ancestors, mut indices) = (zeros(count)?, zeros(count)?);
    let mut rng = Stream::new(seed).fast_rng();
    scheme.ancestors(&mut rng, weights, &mut ancestors)?;
    let found = indices.iter_mut().zip(ancestors);
    found.for_each(|(index, ancestor)| *index = i64::from(ancestor));
    Ok(PyArray1::from_vec(py, indices))
}
