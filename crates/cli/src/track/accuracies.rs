//! Accuracies that rows of `ranges` state, as shares of the noise that is estimated.

use super::rows::Instants;
use crate::error::Error;
use crate::files::is_regular;
use crate::numbers::short;

/// Rows from which the accuracy is taken that stands for the estimated noise.
const FIRST_ROWS: usize = 600;
/// The noise that is found may differ from what rows state by this factor before it is said.
const APART: f64 = 2.0;

/// The accuracy that stands for the estimated noise.
#[derive(Default)]
pub(super) struct Accuracies {
    reference: Option<f64>,
}

impl Accuracies {
    /// The median of the first rows of a file. What comes through a pipe is not waited for: the first accuracy is taken.
    pub(super) fn of(instants: &mut Instants, file: &str) -> Result<Self, Error> {
        let mut found: Vec<f64> = Vec::new();
        if instants.roles.any_accuracy().is_some() && is_regular(file) {
            let stated = instants.peek(FIRST_ROWS)?.iter().flat_map(|row| &row.qualifiers);
            found.extend(stated.filter_map(|one| one.accuracy).filter(|accuracy| *accuracy > 0.0));
            found.sort_by(f64::total_cmp);
        }
        Ok(Self {
            reference: found.get(found.len() / 2).copied(),
        })
    }

    /// The noise of a range, as a share of the estimated one. A range that states none has that.
    pub(super) fn share(&mut self, stated: Option<f64>) -> f64 {
        let Some(stated) = stated.filter(|accuracy| *accuracy > 0.0) else {
            return 1.0;
        };
        stated / *self.reference.get_or_insert(stated)
    }

    /// What to say if the ranges scatter far more or less than rows state.
    pub(super) fn hint(&self, noise: f64) -> Option<String> {
        let times = noise / self.reference?;
        let is_apart = times.is_finite() && !(1.0 / APART..=APART).contains(&times);
        is_apart.then(|| {
            let times = short(times);
            format!("ranges scatter {times} times as much as rows state: accuracies are taken in proportion only")
        })
    }
}
