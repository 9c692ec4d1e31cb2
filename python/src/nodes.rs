//! What the filters on nodes share: a step by the user's functions of all nodes at once.

use crate::callbacks::{Likelihoods, returned};
use crate::error::{Outcome, refused};
use fewbits_filters::{Error, Lattice, LatticeKernel, PointMass, TransitionKernel};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// A density at nodes, and the kernel that moves it.
pub(crate) trait OnNodes: Clone + Send + Sync {
    /// The transition over one time.
    type Kernel: Send + Sync;

    /// The density after the kernel.
    fn predicted(&self, kernel: &Self::Kernel) -> Result<Self, Error>;

    /// Bayes' rule by log likelihoods at the nodes.
    fn weigh(&mut self, logs: &[f64]) -> Result<f64, Error>;
}

impl OnNodes for PointMass {
    type Kernel = TransitionKernel;

    fn predicted(&self, kernel: &TransitionKernel) -> Result<Self, Error> {
        kernel.predict(self)
    }

    fn weigh(&mut self, logs: &[f64]) -> Result<f64, Error> {
        self.update_at_nodes(logs)
    }
}

impl OnNodes for Lattice {
    type Kernel = LatticeKernel;

    fn predicted(&self, kernel: &LatticeKernel) -> Result<Self, Error> {
        kernel.predict(self)
    }

    fn weigh(&mut self, logs: &[f64]) -> Result<f64, Error> {
        self.update(logs)
    }
}

/// The functions of a filter, and its state.
pub(crate) type Parts<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyBytes>);

/// The kernel of the last step, and its seconds.
pub(crate) type Kept<K> = Option<(f64, K)>;

/// Checks that a model is a function.
pub(crate) fn callable(name: &'static str, function: &Bound<'_, PyAny>) -> Outcome<()> {
    if function.is_callable() {
        return Ok(());
    }
    refused(name, function.get_type().name()?, "a function of the nodes and seconds")
}

/// Prediction over `dt` seconds and update. `moved` makes the kernel of a time that is not that of the last step. A step that fails leaves
/// the density as it was.
pub(crate) fn step<'py, B: OnNodes>(
    py: Python<'py>,
    belief: &mut B,
    kept: &mut Kept<B::Kernel>,
    likelihoods: &Likelihoods,
    observation: Option<&Bound<'py, PyAny>>,
    (dt, nodes): (f64, &Bound<'py, PyAny>),
    moved: impl FnOnce(&B) -> Outcome<B::Kernel>,
) -> Outcome<f64> {
    if !(dt >= 0.0 && dt.is_finite()) {
        return refused("dt", dt, "a finite number, 0 or above");
    }
    let mut next = belief.clone();
    if dt > 0.0 {
        let kernel = match kept.take() {
            Some((seconds, kernel)) if seconds == dt => kernel,
            _ => moved(belief)?,
        };
        let predicted = py.detach(|| belief.predicted(&kernel));
        *kept = Some((dt, kernel));
        next = predicted?;
    }
    let mut log_likelihood = 0.0;
    for (_, function, observation) in likelihoods.of(observation)? {
        // Each function gets nodes of its own, which it may change.
        let own = nodes.call_method0("copy")?;
        let count = nodes.getattr("shape")?.call_method1("__getitem__", (-1,))?.extract()?;
        let found = function.bind(py).call1((own, observation))?;
        let found = returned("likelihood", "node", &found, count)?;
        let logs: Vec<f64> = found.as_array().iter().copied().collect();
        log_likelihood += next.weigh(&logs)?;
    }
    *belief = next;
    Ok(log_likelihood)
}

/// Differences of times to the nanosecond: steps of equal length then share their kernel.
pub(crate) fn dt_of(second: f64, before: f64) -> f64 {
    let dt = second - before;
    let rounded = (dt * 1e9).round() / 1e9;
    if rounded > 0.0 { rounded } else { dt }
}
