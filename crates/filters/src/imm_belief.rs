//! The belief of several models.

use crate::Error;
use fewbits_core::columns::change_each;
use fewbits_core::{Belief, ColumnsMut, Gaussian};
use fewbits_densities::{Categorical, moment_matched};
use fewbits_numerics::error::{ArgumentError, at_least_one, probabilities};
use nalgebra::{SMatrix, SVector};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// The belief of an [`Imm`](crate::Imm): a Gaussian and a probability for each model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored<D>")]
pub struct ImmBelief<const D: usize> {
    pub(crate) probabilities: Vec<f64>,
    pub(crate) modes: Vec<Gaussian<D>>,
}

/// The stored form of [`ImmBelief`].
#[derive(Deserialize)]
#[serde(rename = "ImmBelief")]
#[serde(deny_unknown_fields)]
struct Stored<const D: usize> {
    probabilities: Vec<f64>,
    modes: Vec<Gaussian<D>>,
}

impl<const D: usize> TryFrom<Stored<D>> for ImmBelief<D> {
    type Error = ArgumentError;

    fn try_from(parts: Stored<D>) -> Result<Self, ArgumentError> {
        ImmBelief::new(parts.probabilities, parts.modes)
    }
}

impl<const D: usize> ImmBelief<D> {
    /// Buffers for a belief, without a model.
    pub(crate) fn buffers() -> Self {
        Self {
            probabilities: Vec::new(),
            modes: Vec::new(),
        }
    }

    /// Takes all models away.
    pub(crate) fn clear(&mut self) {
        self.probabilities.clear();
        self.modes.clear();
    }

    /// A belief with a probability and a Gaussian for each model.
    ///
    /// # Errors
    /// If the two lists differ in length, or the probabilities do not sum to one.
    pub fn new(probabilities_: Vec<f64>, modes: Vec<Gaussian<D>>) -> Result<Self, ArgumentError> {
        probabilities("probabilities", &probabilities_)?;
        if modes.len() != probabilities_.len() {
            let expected = format!("{}, one for each probability", probabilities_.len());
            return Err(ArgumentError::new("modes", format!("{} Gaussians", modes.len()), expected));
        }
        Ok(Self {
            probabilities: probabilities_,
            modes,
        })
    }

    /// A belief of `count` models with equal probability and the same Gaussian.
    ///
    /// # Errors
    /// If `count` is 0.
    pub fn agreed(belief: &Gaussian<D>, count: usize) -> Result<Self, ArgumentError> {
        at_least_one("count", count)?;
        Ok(Self {
            probabilities: vec![1.0 / count as f64; count],
            modes: vec![*belief; count],
        })
    }

    /// Probability of each model.
    pub fn probabilities(&self) -> &[f64] {
        &self.probabilities
    }

    /// The Gaussian of each model.
    pub fn modes(&self) -> &[Gaussian<D>] {
        &self.modes
    }

    /// The Gaussian of the same mean and covariance as the mixture.
    pub fn moment_matched(&self) -> Gaussian<D> {
        moments(self.probabilities.iter().copied().zip(&self.modes))
    }
}

/// The Gaussian with the moments of a mixture whose weights sum to one.
pub(crate) fn moments<'a, const D: usize>(parts: impl Iterator<Item = (f64, &'a Gaussian<D>)> + Clone) -> Gaussian<D> {
    moment_matched(parts.map(|(weight, part)| (weight, *part.mean(), *part.covariance())))
}

/// The models' beliefs may be so far apart that the covariance of all together overflows.
pub(crate) fn check_moments<const D: usize>(modes: &[Gaussian<D>]) -> Result<(), Error> {
    let size = |mode: &Gaussian<D>| mode.mean().norm_squared() + mode.covariance().trace();
    // No distance of two means is larger than twice the larger of their norms.
    let (total, what) = (4.0 * modes.iter().map(size).sum::<f64>(), "the moments of all models together");
    total.is_finite().then_some(()).ok_or(Error::NotANumber { what })
}

impl<const D: usize> Belief<D> for ImmBelief<D> {
    fn mean(&self) -> SVector<f64, D> {
        *self.moment_matched().mean()
    }

    fn covariance(&self) -> SMatrix<f64, D, D> {
        *self.moment_matched().covariance()
    }

    fn sample_columns<R: Rng + ?Sized>(&self, rng: &mut R, states: ColumnsMut<'_, D>) {
        let modes = Categorical::new(&self.probabilities);
        change_each(states, |_| self.modes[modes.draw(rng)].sample(rng));
    }
}
