//! All sets of linear patterns, by depth-first search over multisets.

mod walk;

use self::walk::Walk;
use super::outcomes::Outcomes;
use crate::Error;
use crate::bank::MAX_OUTCOMES;
use crate::count::{full_rank_multisets, multisets};
use crate::linear::{Span, check_mask, grid_bits};
use crate::source::noise_in_range;
use crate::{Bank, Grid, Mask, PatternSensor, Source, linear_pattern};
use fewbits_numerics::error::at_least_one;
use serde::{Deserialize, Serialize};

/// Candidates that are evaluated again on the fine nodes.
const FINALISTS: usize = 16;
/// Relative difference below which two sets are equally good, and the lower masks are preferred.
const TIE: f64 = 1e-12;
/// Most sets that a ranking may list.
const MAX_RANKED: u128 = 1 << 26;
/// Most sets that a search may visit: hours of work.
const MAX_SETS: u128 = 1 << 32;
/// A set of masks, one a sensor, in increasing order, with the error it achieves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MaskSet {
    /// The masks.
    pub masks: Vec<Mask>,
    /// Mean squared error of the posterior mean.
    #[serde(deserialize_with = "crate::error::stored_size")]
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
/// A mask that `m` sensors share has `m + 1` outcomes, not `2^m`. On a symmetric grid `x -> -x` flips the bit of masks of odd
/// weight and keeps the others, so that half of the nodes carry everything: the integral over the other half is that of
/// the mirrored outcome. The first levels of the tree are shared among the threads of the current rayon pool; the result
/// does not depend on their number.
#[derive(Debug, Clone)]
pub struct LinearSearch {
    source: Source,
    grid: Grid,
    bits: usize,
    noise_std: f64,
    sensors: usize,
    full_rank: bool,
    forced: Vec<usize>,
}

impl LinearSearch {
    /// A search for masks of full rank.
    ///
    /// # Errors
    /// If the grid has not `2^B` cells, the noise is not positive and finite, or there is no sensor.
    pub fn with_deviation(source: Source, grid: Grid, noise_std: f64, sensors: usize) -> Result<Self, Error> {
        let bits = grid_bits(&grid)?;
        at_least_one("sensors", sensors)?;
        Ok(Self {
            source,
            bits,
            noise_std: noise_in_range(noise_std)?,
            sensors,
            full_rank: true,
            forced: vec![0; (1 << bits) - 1],
            grid,
        })
    }

    /// Drops the constraint that the masks separate all cells. In noise it costs up to a third of the error.
    #[must_use]
    pub fn any_rank(mut self) -> Self {
        self.full_rank = false;
        self
    }

    /// Requires these masks to be in the set, as often as they are listed. With the Gray basis: strategy 1.
    ///
    /// # Errors
    /// If a mask is out of range or there are more of them than sensors.
    pub fn with_forced(mut self, masks: &[Mask]) -> Result<Self, Error> {
        self.forced.fill(0);
        for &mask in masks {
            self.forced[check_mask(mask, self.bits)? as usize - 1] += 1;
        }
        at_least_one("sensors", (self.sensors + 1).saturating_sub(masks.len()))?;
        Ok(self)
    }

    /// Number of sets without regard to forced masks.
    ///
    /// # Errors
    /// If full rank is required of fewer sensors than bits, or the number exceeds 128 bits.
    pub fn sets(&self) -> Result<u128, Error> {
        if self.full_rank {
            full_rank_multisets(self.bits, self.sensors)
        } else {
            multisets((1 << self.bits) - 1, self.sensors as u128)
        }
    }

    /// The bank that a set of masks makes with this source, grid and noise.
    ///
    /// # Errors
    /// If a mask is out of range or there is none.
    pub fn bank(&self, masks: &[Mask]) -> Result<Bank, Error> {
        let sensors = masks
            .iter()
            .map(|&mask| {
                PatternSensor::with_deviation(linear_pattern(mask, self.bits)?.on(&self.grid)?, self.noise_std)
            })
            .collect::<Result<_, _>>()?;
        Bank::new(self.source, sensors)
    }

    /// The best set. Its error is exact to `1e-12`; among equals the lowest masks win.
    ///
    /// # Errors
    /// If full rank is required of fewer sensors than bits, there are too many outcomes to enumerate, or more than `2^32` sets;
    /// [`Descent`](super::Descent) is for those.
    pub fn best(&self) -> Result<MaskSet, Error> {
        let mut finalists = self.run(FINALISTS)?;
        for set in &mut finalists {
            set.mse = self.bank(&set.masks)?.mmse()?;
        }
        let least = finalists.iter().map(|s| s.mse).fold(f64::INFINITY, f64::min);
        finalists
            .into_iter()
            .filter(|s| s.mse <= least * (1.0 + TIE))
            .min_by(|a, b| a.masks.cmp(&b.masks))
            .ok_or(Error::RankDeficient {
                sensors: self.sensors,
                rank: self.sensors.min(self.bits),
                expected: self.bits,
            })
    }

    /// All sets, the best first, with errors good to `1e-9` of the source's variance.
    ///
    /// # Errors
    /// As [`Self::best`], or if there are more than `2^26` sets.
    pub fn ranking(&self) -> Result<Vec<MaskSet>, Error> {
        let sets = self.sets()?;
        if sets > MAX_RANKED {
            return Err(Error::TooManyOutcomes {
                outcomes: sets,
                limit: MAX_RANKED,
            });
        }
        self.run(usize::MAX)
    }

    fn run(&self, keep: usize) -> Result<Vec<MaskSet>, Error> {
        let sets = self.sets()?;
        if sets > MAX_SETS {
            return Err(Error::TooManyOutcomes {
                outcomes: sets,
                limit: MAX_SETS,
            });
        }
        // Distinct masks give the most outcomes.
        let distinct = self.sensors.min((1 << self.bits) - 1) as u32;
        let repeats = (self.sensors as u128 / u128::from(distinct)).saturating_add(1);
        let outcomes = repeats.saturating_add(1).checked_pow(distinct).unwrap_or(u128::MAX);
        if outcomes.min(1u128.checked_shl(self.sensors as u32).unwrap_or(u128::MAX)) > MAX_OUTCOMES {
            return Err(Error::TooManyOutcomes {
                outcomes,
                limit: MAX_OUTCOMES,
            });
        }
        let walk = Walk::new(self, keep)?;
        let root = Outcomes::new(&walk.nodes.w);
        let mut found = walk.branch(0, self.sensors, Span::default(), &[], root);
        found.finish();
        Ok(found.sets)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{gray_basis, rank};
    use approx::assert_relative_eq;

    fn search(bits: usize, sensors: usize, snr: f64) -> LinearSearch {
        let source = Source::uniform(1.0).unwrap();
        let noise = source.noise_std(snr).unwrap();
        LinearSearch::with_deviation(source, Grid::uniform(1.0, bits).unwrap(), noise, sensors).unwrap()
    }

    #[test]
    fn every_set_is_met_once_with_its_exact_error() {
        for (search, sets) in [(search(3, 4, 12.0), 120), (search(3, 4, 12.0).any_rank(), 210)] {
            let ranking = search.ranking().unwrap();
            assert_eq!(ranking.len() as u128, search.sets().unwrap());
            let mut masks: Vec<_> = ranking.iter().map(|s| s.masks.clone()).collect();
            masks.sort();
            masks.dedup();
            assert_eq!(masks.len(), ranking.len());
            assert!(ranking.len() <= sets);
            for set in ranking.iter().step_by(17) {
                assert_relative_eq!(set.mse, search.bank(&set.masks).unwrap().mmse().unwrap(), max_relative = 1e-8);
            }
        }
    }

    #[test]
    fn an_asymmetric_grid_gives_the_same_as_direct_evaluation() {
        let source = Source::gaussian_with_deviation(0.4).unwrap();
        let grid = Grid::from_breakpoints(vec![-0.5, 0.1, 0.3]).unwrap();
        let search = LinearSearch::with_deviation(source, grid, 0.2, 3).unwrap();
        for set in search.ranking().unwrap() {
            assert_relative_eq!(set.mse, search.bank(&set.masks).unwrap().mmse().unwrap(), max_relative = 1e-8);
        }
    }

    #[test]
    fn forced_masks_are_kept() {
        let gray = gray_basis(3).unwrap();
        let all = search(3, 5, 4.0).ranking().unwrap();
        let forced = search(3, 5, 4.0).with_forced(&gray).unwrap().ranking().unwrap();
        assert_eq!(forced.len() as u128, crate::count::forced_basis_sets(3, 5).unwrap());
        let expected = all.iter().find(|s| gray.iter().all(|g| s.masks.contains(g))).unwrap();
        assert_eq!(forced[0].masks, expected.masks);
        assert_relative_eq!(forced[0].mse, expected.mse, max_relative = 1e-12);
    }

    #[test]
    fn too_few_sensors_for_full_rank_is_an_error() {
        assert!(matches!(search(3, 2, 10.0).best(), Err(Error::RankDeficient { .. })));
        assert_eq!(search(3, 2, 10.0).any_rank().best().unwrap().masks.len(), 2);
        assert!(search(3, 2, 10.0).with_forced(&[1, 2, 3]).is_err());
        assert!(search(3, 2, 10.0).with_forced(&[8]).is_err());
        let grid = Grid::from_breakpoints(vec![0.0, 1.0]).unwrap();
        assert!(LinearSearch::with_deviation(Source::uniform(1.0).unwrap(), grid, 0.1, 3).is_err());
        assert!(matches!(search(10, 12, 10.0).best(), Err(Error::TooManyOutcomes { .. })));
        assert!(matches!(
            search(6, 40, 10.0).best(),
            Err(Error::TooManyOutcomes { .. } | Error::CountOverflow { .. })
        ));
    }

    #[test]
    fn the_best_set_has_full_rank() {
        let best = search(3, 3, 0.0).best().unwrap();
        assert_eq!((rank(&best.masks), best.masks), (3, vec![1, 2, 4]));
    }
}
