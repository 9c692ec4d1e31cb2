//! Forms of the messages between nodes, and what another crate implements to add one.

pub use crate::added_density::{AddedDensity, SliceMoments};

use crate::belief::Travelling;
use crate::packed::AddedNumbers;
use crate::posterior::Posterior;
use crate::rate::RateModel;
use crate::record::Record;
use fewbits_core::{Error, Gaussian};
use fewbits_numerics::error::{at_least_one, refuse};
use serde::{Deserialize, Serialize};
use std::fmt::Debug;

/// Bits of the number of components, and of another form's own number.
pub(crate) const COUNT_BITS: u32 = 5;

/// What an update multiplied, beside its posterior.
#[derive(Debug, Clone, Copy)]
pub struct Update<'a> {
    /// The record of the node's samples.
    pub record: &'a Record,
    /// Moments of the position before them.
    pub prior: Gaussian<2>,
}

/// A form of beliefs: how it is fitted to a posterior and read from a message.
pub trait AddedForm: Debug + Send + Sync {
    /// Whether messages can hold this form with this rate.
    ///
    /// # Errors
    /// If not.
    fn check(&self, rate: &RateModel) -> Result<(), Error>;

    /// Largest number of numbers in one message, besides the two of the fit.
    fn scalars(&self, rate: &RateModel) -> usize;

    /// Approximates a posterior. `update` is unknown outside a search.
    ///
    /// # Errors
    /// If the posterior has no such approximation.
    fn project(
        &self,
        posterior: &Posterior,
        rate: &RateModel,
        update: Option<&Update<'_>>,
    ) -> Result<Travelling, Error>;

    /// How many numbers a message with these two numbers of five bits has; the second is below 31 and the form's own. Zero if the form
    /// sends mixtures.
    fn numbers(&self, _components: usize, _code: usize, _with_rate: bool) -> usize {
        0
    }

    /// The belief of a message that is no mixture.
    ///
    /// # Errors
    /// If the numbers are no belief of this form.
    fn read(&self, numbers: &AddedNumbers) -> Result<Travelling, Error> {
        refuse("message", format!("code {}", numbers.code), "a mixture")
    }
}

/// An added form in [`Form::Other`]. Two are equal if they are printed alike.
#[derive(Debug, Clone, Copy)]
pub struct Added(pub &'static dyn AddedForm);

impl PartialEq for Added {
    fn eq(&self, other: &Self) -> bool {
        format!("{self:?}") == format!("{other:?}")
    }
}

impl Eq for Added {}

/// Form of the messages between nodes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Form {
    /// The samples of every node visited. Nothing is lost.
    Raw,
    /// A Gaussian: mean and covariance.
    Gaussian,
    /// A Gaussian mixture of at most this many components.
    Mixture(usize),
    /// A form that another crate adds. It is not stored.
    #[serde(skip)]
    Other(Added),
}

impl Form {
    /// Whether messages can hold this form with this rate.
    pub(crate) fn check(&self, rate: &RateModel) -> Result<(), Error> {
        match *self {
            Self::Mixture(n) if n > MAX_COUNT => {
                refuse("components", n, format!("at most {MAX_COUNT}, the largest number in a message"))
            }
            Self::Mixture(n) => Ok(at_least_one("components", n).map(|_| ())?),
            Self::Other(form) => form.0.check(rate),
            Self::Raw | Self::Gaussian => Ok(()),
        }
    }

    /// Largest number of numbers in one message of this form, besides the two of the fit; `None` for raw records. Fewer are sent if the
    /// posterior needs fewer components.
    pub fn scalars(&self, rate: &RateModel) -> Option<usize> {
        let carried = matches!(rate, RateModel::Joint(_));
        match *self {
            Self::Raw => None,
            Self::Gaussian => Some(gaussian_scalars(carried)),
            // The first weight is not sent: they sum to one.
            Self::Mixture(n) => Some((n * (1 + gaussian_scalars(carried))).saturating_sub(1)),
            Self::Other(form) => Some(form.0.scalars(rate)),
        }
    }
}

/// Largest number of components, and the code of a mixture, in a message.
pub(crate) const MAX_COUNT: usize = (1 << COUNT_BITS) - 1;

/// Numbers of one Gaussian over the position, or over position and rate: its mean and the lower triangle of its Cholesky factor.
pub(crate) fn gaussian_scalars(with_rate: bool) -> usize {
    if with_rate { 3 + 6 } else { 2 + 3 }
}
