//! The search space of an exhaustive search.

use crate::patterns::linear::{grid_bits, sensors_of};
use crate::{Bank, Error, Mask, PatternSensor, Source};
use fewbits_numerics::binomial;
use fewbits_numerics::error::{at_least_one, positive};
use fewbits_quantizers::Quantizer;

/// A set of masks, one per sensor, in increasing order, with its error.
#[derive(Debug, Clone, PartialEq)]
pub struct MaskSet {
    /// The masks.
    pub masks: Vec<Mask>,
    /// Mean squared error of the posterior mean.
    pub mse: f64,
}

/// The search for `N` linear patterns on a grid of `2^B` cells that minimise the posterior mean's error.
///
/// ```text
/// search(last mask, sensors left r, W(outcome, x)):
///     for each later mask j:                              # all leaves of this prefix are one matrix product
///         (M0, M1) <- int W(outcome, x) C(r,k) P1j^k P0j^(r-k) (1, x) dx
///         mse      <- Var X - sum M1^2 / M0
///     for each later mask j and multiplicity m < r:
///         search(j, r - m, W x [C(m,k) P1j^k P0j^(m-k)])
/// ```
///
/// `m` sensors with the same mask have `m + 1` outcomes, not `2^m`. On a symmetric grid the reflection `x -> -x` inverts the bit of masks
/// of odd weight and keeps the others, so half of the nodes are enough: the integral over the other half is that of the mirrored outcome.
/// The first levels of the tree are distributed over the threads of the current rayon pool; the result does not depend on their number.
#[derive(Debug, Clone)]
pub struct LinearSearch {
    pub(super) source: Source,
    pub(super) grid: Quantizer,
    pub(super) bits: usize,
    pub(super) noise_deviation: f64,
    pub(super) sensors: usize,
    pub(super) full_rank: bool,
}

impl LinearSearch {
    /// A search for sets of masks with full rank.
    ///
    /// # Errors
    /// If the grid does not have `2^B` cells, the noise is not positive and finite, or there is no sensor.
    pub fn with_deviation(
        source: Source,
        grid: Quantizer,
        noise_deviation: f64,
        sensors: usize,
    ) -> Result<Self, Error> {
        let bits = grid_bits(&grid)?;
        at_least_one("sensors", sensors)?;
        Ok(Self {
            source,
            bits,
            noise_deviation: positive("noise_deviation", noise_deviation)?,
            sensors,
            full_rank: true,
            grid,
        })
    }

    /// Removes the condition that the masks distinguish all cells. With noise this condition can increase the error by up to a third.
    #[must_use]
    pub fn any_rank(mut self) -> Self {
        self.full_rank = false;
        self
    }

    /// Number of sets of any rank: an upper bound of those that are searched.
    pub(crate) fn sets(&self) -> u64 {
        binomial::saturating((1 << self.bits) - 2 + self.sensors, self.sensors)
    }

    /// The sensors of a set of masks.
    ///
    /// # Errors
    /// If a mask is out of range.
    pub fn sensors(&self, masks: &[Mask]) -> Result<Vec<PatternSensor>, Error> {
        sensors_of(masks, &self.grid, self.noise_deviation)
    }

    /// The bank of a set of masks with this source, grid and noise.
    ///
    /// # Errors
    /// If a mask is out of range or there is no mask.
    pub fn bank(&self, masks: &[Mask]) -> Result<Bank, Error> {
        Bank::new(self.source, self.sensors(masks)?)
    }
}
