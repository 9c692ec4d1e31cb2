//! Accuracies that rows of `ranges` state, as shares of the noise that is estimated.

use crate::text::short;

/// The noise that is found may differ from what rows state by this factor before it is said.
const APART: f64 = 2.0;

/// The accuracy that stands for the estimated noise.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Accuracies {
    reference: Option<f64>,
}

impl Accuracies {
    /// The median of what the first rows of a file state. What comes through a pipe is not waited for: the first accuracy is taken.
    pub(crate) fn of(mut stated: Vec<f64>) -> Self {
        stated.retain(|accuracy| *accuracy > 0.0);
        stated.sort_by(f64::total_cmp);
        Self {
            reference: stated.get(stated.len() / 2).copied(),
        }
    }

    /// The noise of a range, as a share of the estimated one. A range that states none has that.
    pub(crate) fn share(&mut self, stated: Option<f64>) -> f64 {
        let Some(stated) = stated.filter(|accuracy| *accuracy > 0.0) else {
            return 1.0;
        };
        stated / *self.reference.get_or_insert(stated)
    }

    /// What to say if the ranges scatter far more or less than rows state.
    pub(crate) fn hint(&self, noise: f64) -> Option<String> {
        let times = noise / self.reference?;
        let is_apart = times.is_finite() && !(1.0 / APART..=APART).contains(&times);
        is_apart.then(|| {
            let times = short(times);
            format!("ranges scatter {times} times as much as rows state: accuracies are taken in proportion only")
        })
    }
}
