//! The exact posterior of one update, over cells.

use crate::belief::Prior;
use crate::density::{CellOptions, Cells};
use crate::fit::Fit;
use crate::likelihood::SourceLikelihood;
use crate::search_box::SearchBox;
use crate::target::Target;
use fewbits_core::{Belief, Error, Gaussian};
use fewbits_mixture_codec::Clumps;
use nalgebra::{Vector2, Vector3};

/// Posterior over cells. If the rate is unknown and part of the belief, it has the rate's moments in each cell.
#[derive(Debug, Clone)]
pub struct Posterior {
    /// The posterior of the position.
    pub cells: Cells<2>,
    /// Mean and variance of the rate in each cell.
    pub rates: Option<(Vec<f64>, Vec<f64>)>,
    /// How the samples of the update fit.
    pub fit: Fit,
}

/// Cells along the longer side of the box for a wide prior, and for a belief that was sent on.
const WIDE: usize = 90;
const NARROW: usize = 44;

impl Posterior {
    /// Multiplies a prior by the likelihood of records and covers the product with cells. `near` is a box that is known to contain
    /// the posterior, for example the cells of the step before.
    ///
    /// # Errors
    /// As [`Cells::cover`]; [`Error::Impossible`] if the records have probability zero under the belief.
    pub fn new(
        prior: &Prior,
        likelihood: &SourceLikelihood,
        search: &SearchBox,
        near: Option<SearchBox>,
        options: &CellOptions,
    ) -> Result<Self, Error> {
        // Region of the first cells: the whole search box at first, later the surroundings of the received belief.
        let (around, per_axis) = match (prior, near) {
            (Prior::Exact(_), None) => (*search, WIDE),
            (Prior::Exact(_), Some(near)) => (near, NARROW),
            (Prior::Position(belief), _) => (belief.bounds(), NARROW),
            (Prior::WithRate(belief, _), _) => (belief.bounds(), NARROW),
        };
        let around = around.within(search);
        // A region of more than half the box needs as many cells as the whole box.
        let wide = around.upper[0] - around.lower[0] > 0.5 * (search.upper[0] - search.lower[0]);
        let per_axis = if wide { WIDE } else { per_axis };
        let target = Target::new(prior, likelihood)?;
        let cells = Cells::cover(&target, around.lower, around.upper, per_axis, options)?;
        let (rates, chi_squared) = target.rates_and_fit(&cells);
        let (moved, coordinates) = target.conflict(&cells);
        let fit = Fit {
            chi_squared: chi_squared + moved,
            samples: likelihood.samples() + coordinates,
        };
        Ok(Self { cells, rates, fit })
    }

    /// Mean and covariance of the position.
    pub fn gaussian(&self) -> Gaussian<2> {
        Gaussian::from_trusted_parts(self.cells.mean(), self.cells.covariance())
    }

    /// The position as clumps.
    ///
    /// # Errors
    /// If `count` is zero.
    pub fn clumps(&self, count: usize) -> Result<Clumps<2>, Error> {
        let clumps = Clumps::new(&self.cells.columns(), &[&[], &[]], self.cells.weights(), count)?;
        let least = self.min_variance();
        clumps.with_min_variances(Vector2::new(least, least))
    }

    /// Position and rate as clumps. If the rate is known, its variance is zero.
    ///
    /// # Errors
    /// If `count` is zero.
    #[doc(hidden)]
    pub fn clumps_with_rate(&self, known: f64, count: usize) -> Result<Clumps<3>, Error> {
        let [x, y] = self.cells.columns();
        let fixed;
        let (mean, spread): (&[f64], &[f64]) = match &self.rates {
            Some((mean, variance)) => (mean, variance),
            None => {
                fixed = vec![known; x.len()];
                (&fixed, &[])
            }
        };
        let clumps = Clumps::new(&[x, y, mean], &[&[], &[], spread], self.cells.weights(), count)?;
        let least = self.min_variance();
        clumps.with_min_variances(Vector3::new(least, least, 0.0))
    }

    /// The square of half a cell. A narrower ridge would not have let the evidence converge. For Gaussians at least this wide, sums
    /// over cells exceed integrals by at most 3 per cent.
    fn min_variance(&self) -> f64 {
        0.25 * self.cells.width() * self.cells.width()
    }

    /// Share of the mass within one cell or two standard deviations of the border of the search box. It is large if the source is outside.
    pub(crate) fn mass_at_border(&self, search: &SearchBox) -> f64 {
        let [x, y] = self.cells.columns();
        let edge = self
            .cells
            .covariance()
            .diagonal()
            .map(|v| self.cells.width().max(2.0 * v.sqrt()));
        let outside = |v: f64, d: usize| v < search.lower[d] + edge[d] || v > search.upper[d] - edge[d];
        let masses = x.iter().zip(y).zip(self.cells.weights());
        masses
            .filter(|((x, y), _)| outside(**x, 0) || outside(**y, 1))
            .map(|(_, w)| w)
            .sum()
    }

    /// The box of the cells with a margin. It contains the next posterior if all records stay in use.
    pub fn around(&self, search: &SearchBox) -> SearchBox {
        let (lower, upper) = self.cells.bounds();
        let margin = |d: usize| 0.1 * (upper[d] - lower[d]) + 4.0 * self.cells.width();
        SearchBox {
            lower: [lower[0] - margin(0), lower[1] - margin(1)],
            upper: [upper[0] + margin(0), upper[1] + margin(1)],
        }
        .within(search)
    }
}
