//! All sets of linear patterns, by depth-first search over multisets.

use super::outcomes::{Outcomes, SEARCH_PANEL};
use crate::Error;
use crate::bank::{CountTable, IMPOSSIBLE, MAX_OUTCOMES};
use crate::count::{full_rank_multisets, multisets};
use crate::linear::{Span, check_mask, flips_under_reflection, grid_bits};
use crate::source::noise_in_range;
use crate::source::{Blur, Nodes};
use crate::{Bank, Grid, Mask, PatternSensor, Source, linear_pattern};
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::quadrature::gauss_legendre;
use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Candidates that are evaluated again on the fine nodes.
const FINALISTS: usize = 16;
/// Relative difference below which two sets are equally good, and the lower masks are preferred.
const TIE: f64 = 1e-12;
/// Most sets that a ranking may list.
const MAX_RANKED: u128 = 1 << 26;
/// Most sets that a search may visit: hours of work.
const MAX_SETS: u128 = 1 << 32;
/// Levels of the search tree whose branches are shared among threads.
const PARALLEL_LEVELS: usize = 2;

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

/// The best sets so far.
struct Top {
    keep: usize,
    sets: Vec<MaskSet>,
    /// Sets worse than this cannot enter.
    bar: f64,
}

impl Top {
    fn new(keep: usize) -> Self {
        Self {
            keep,
            sets: Vec::new(),
            bar: f64::INFINITY,
        }
    }

    fn push(&mut self, chosen: &[(Mask, usize)], last: (Mask, usize), mse: f64) {
        if mse > self.bar {
            return;
        }
        let masks = chosen
            .iter()
            .chain([&last])
            .flat_map(|&(mask, count)| std::iter::repeat_n(mask, count))
            .collect();
        self.sets.push(MaskSet { masks, mse });
        if self.sets.len() >= self.keep.saturating_mul(4) {
            self.finish();
        }
    }

    fn finish(&mut self) {
        self.sets
            .sort_by(|a, b| a.mse.total_cmp(&b.mse).then_with(|| a.masks.cmp(&b.masks)));
        if self.sets.len() >= self.keep {
            self.sets.truncate(self.keep);
            self.bar = self.sets.last().map_or(f64::INFINITY, |s| s.mse);
        }
    }

    fn merge(mut self, other: Self) -> Self {
        self.sets.extend(other.sets);
        self.finish();
        self
    }
}

struct Walk<'a> {
    search: &'a LinearSearch,
    keep: usize,
    nodes: Nodes,
    /// Only half of the nodes are there, and outcomes are paired with their mirror images.
    folded: bool,
    variance: f64,
    /// `tables[j][m - 1]`: probabilities of the counts of `m` sensors with mask `j + 1`.
    tables: Vec<Vec<CountTable>>,
    /// `leaves[r - 1]`: for every mask and count of `r` sensors the probability, and the same times `x`; a row each.
    leaves: Vec<DMatrix<f64>>,
    /// Sensors whose masks are forced, from mask `j + 1` on.
    forced_from: Vec<usize>,
}

impl<'a> Walk<'a> {
    fn new(search: &'a LinearSearch, keep: usize) -> Result<Self, Error> {
        let folded = search.grid.is_symmetric();
        let reach = search.source.reach();
        let blurs: Vec<Blur> = search
            .grid
            .breakpoints()
            .iter()
            .map(|&t| (t, search.noise_std))
            .collect();
        let from = if folded { 0.0 } else { -reach };
        let nodes = Nodes::adapted(&search.source, from, reach, &blurs, SEARCH_PANEL, gauss_legendre::<8>());
        let kinds = search.forced.len();
        let mut tables = Vec::with_capacity(kinds);
        for mask in 1..=kinds {
            let quantizer = linear_pattern(mask as Mask, search.bits)?.on(&search.grid)?;
            let p: Vec<[f64; 2]> = nodes
                .x
                .iter()
                .map(|&x| quantizer.probabilities(x, search.noise_std))
                .collect();
            tables.push(
                (1..=search.sensors)
                    .map(|count| CountTable::from_probabilities(&p, count))
                    .collect::<Vec<_>>(),
            );
        }
        let leaves = (1..=search.sensors)
            .map(|r| {
                DMatrix::from_fn(kinds * (r + 1) * 2, nodes.len(), |row, at| {
                    let (j, k, moment) = (row / 2 / (r + 1), row / 2 % (r + 1), row % 2);
                    let p = tables[j][r - 1].rows[k][at];
                    if moment == 0 { p } else { p * nodes.x[at] }
                })
            })
            .collect();
        let mut forced_from = vec![0; kinds + 1];
        for j in (0..kinds).rev() {
            forced_from[j] = forced_from[j + 1] + search.forced[j];
        }
        Ok(Self {
            search,
            keep,
            nodes,
            folded,
            variance: search.source.variance(),
            tables,
            leaves,
            forced_from,
        })
    }

    /// All sets that continue `chosen` with `left` sensors of masks from `first` on.
    fn branch(&self, first: usize, left: usize, span: Span, chosen: &[(Mask, usize)], level: Outcomes) -> Top {
        let mut found = Top::new(self.keep);
        self.close(first, left, span, chosen, &level, &mut found);
        let mut steps = Vec::new();
        for j in first..self.tables.len() {
            let needed = self.search.forced[j].max(1);
            for m in needed..left {
                let next = span.with(j as Mask + 1);
                let possible = !self.search.full_rank || next.rank() + (left - m) >= self.search.bits;
                if possible && left - m >= self.forced_from[j + 1] && j + 1 < self.tables.len() {
                    steps.push((j, m, next));
                }
            }
            if self.search.forced[j] > 0 {
                break;
            }
        }
        let descend = |&(j, m, next): &(usize, usize, Span)| {
            let mut chosen = chosen.to_vec();
            chosen.push((j as Mask + 1, m));
            self.branch(j + 1, left - m, next, &chosen, self.extend(&level, j, m))
        };
        if chosen.len() < PARALLEL_LEVELS {
            let parts: Vec<Top> = steps.par_iter().map(descend).collect();
            parts.into_iter().fold(found, Top::merge)
        } else {
            steps.iter().map(descend).fold(found, Top::merge)
        }
    }

    /// One group of `m` sensors with mask `j + 1` more.
    fn extend(&self, level: &Outcomes, j: usize, m: usize) -> Outcomes {
        level.with(&self.tables[j][m - 1], self.folded && flips_under_reflection(j as Mask + 1))
    }

    /// Evaluates all sets in which the `left` sensors share one last mask.
    fn close(
        &self,
        first: usize,
        left: usize,
        span: Span,
        chosen: &[(Mask, usize)],
        level: &Outcomes,
        found: &mut Top,
    ) {
        let allowed = |j: usize| {
            self.forced_from[j + 1] == 0
                && left >= self.search.forced[j]
                && (!self.search.full_rank || span.with(j as Mask + 1).rank() == self.search.bits)
        };
        let until = (first..self.tables.len())
            .find(|&j| self.search.forced[j] > 0)
            .map_or(self.tables.len(), |j| j + 1);
        let Some(from) = (first..until).find(|&j| allowed(j)) else {
            return;
        };
        let rows_each = (left + 1) * 2;
        let rows = (until - from) * rows_each;
        let sums = level.integrals(&self.leaves[left - 1].rows(from * rows_each, rows));
        for j in (from..until).filter(|&j| allowed(j)) {
            let mask = j as Mask + 1;
            let flips = flips_under_reflection(mask);
            let mut explained = 0.0;
            for (outcome, &image) in level.mirror.iter().enumerate() {
                for k in 0..=left {
                    let at = |outcome: usize, k: usize| outcome * rows + (j - from) * rows_each + 2 * k;
                    let here = at(outcome, k);
                    let (mut mass, mut moment) = (sums[here], sums[here + 1]);
                    if self.folded {
                        let there = at(image, if flips { left - k } else { k });
                        mass += sums[there];
                        moment -= sums[there + 1];
                    }
                    if mass > IMPOSSIBLE {
                        explained += moment * moment / mass;
                    }
                }
            }
            found.push(chosen, (mask, left), self.variance - explained);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::{gray_basis, rank};
    use super::*;
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
