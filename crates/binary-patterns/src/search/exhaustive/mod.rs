//! Exhaustive search over sets of linear patterns, depth first over multisets.

mod setting;
mod walk;

pub use setting::{LinearSearch, MaskSet};

use super::outcomes::Outcomes;
use crate::Error;
use crate::observation::bank::MAX_OUTCOMES;
use crate::patterns::linear::Span;
use fewbits_numerics::ArgumentError;
use walk::Walk;

/// Number of candidates that are evaluated again on the fine nodes.
const FINALISTS: usize = 16;
/// Relative difference below which two sets are equally good; the one with lower masks is taken.
const TIE: f64 = 1e-12;
/// Largest number of sets of a ranking.
const MAX_RANKED: u64 = 1 << 26;
/// Largest number of sets of a search, which takes hours.
const MAX_SETS: u64 = 1 << 32;

impl LinearSearch {
    /// The best set. Its error is exact to `1e-12`; among equally good sets the one with the lowest masks is returned.
    ///
    /// # Errors
    /// If full rank is required with fewer sensors than bits, there are too many outcomes to enumerate, or more than `2^32` sets
    /// (use [`Descent`](super::Descent) for these).
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
            .ok_or_else(|| self.too_few())
    }

    fn too_few(&self) -> Error {
        let expected = format!("at least {}, the rank of the masks", self.bits);
        ArgumentError::new("sensors", self.sensors, expected).into()
    }

    /// All sets, best first, with errors accurate to `1e-9` of the source's variance.
    ///
    /// # Errors
    /// As [`Self::best`], or if there are more than `2^26` sets.
    pub fn ranking(&self) -> Result<Vec<MaskSet>, Error> {
        Error::at_most("the list of sets of masks", self.sets(), MAX_RANKED)?;
        self.run(usize::MAX)
    }

    fn run(&self, keep: usize) -> Result<Vec<MaskSet>, Error> {
        if self.full_rank && self.sensors < self.bits {
            return Err(self.too_few());
        }
        Error::at_most("the list of sets of masks", self.sets(), MAX_SETS)?;
        // Distinct masks give the largest number of outcomes.
        let distinct = self.sensors.min((1 << self.bits) - 1) as u32;
        let repeats = (self.sensors as u128 / u128::from(distinct)).saturating_add(1);
        let outcomes = repeats.saturating_add(1).saturating_pow(distinct);
        Error::at_most("the table of outcomes", outcomes.min(2u128.saturating_pow(self.sensors as u32)), MAX_OUTCOMES)?;
        let walk = Walk::new(self, keep)?;
        let root = Outcomes::new(&walk.candidates.nodes.weights);
        let mut found = walk.branch(0, self.sensors, Span::default(), &[], root);
        found.finish();
        Ok(found.sets)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Source, uniform_cells};
    use approx::assert_relative_eq;
    use fewbits_quantizers::Quantizer;

    fn search(bits: usize, sensors: usize, snr: f64) -> LinearSearch {
        let source = Source::uniform(1.0).unwrap();
        let noise = source.noise_deviation(snr).unwrap();
        LinearSearch::with_deviation(source, uniform_cells(1.0, bits).unwrap(), noise, sensors).unwrap()
    }

    #[test]
    fn every_set_is_met_once_with_its_exact_error() {
        // Of 210 multisets of four masks 119 have rank 3 (`baselines::binary_patterns::count::full_rank_multisets`).
        for (search, sets) in [(search(3, 4, 12.0), 119), (search(3, 4, 12.0).any_rank(), 210)] {
            let ranking = search.ranking().unwrap();
            assert_eq!((ranking.len(), search.sets()), (sets, 210));
            let mut masks: Vec<_> = ranking.iter().map(|s| s.masks.clone()).collect();
            masks.sort();
            masks.dedup();
            assert_eq!(masks.len(), ranking.len());
            for set in ranking.iter().step_by(17) {
                assert_relative_eq!(set.mse, search.bank(&set.masks).unwrap().mmse().unwrap(), max_relative = 1e-8);
            }
        }
    }

    #[test]
    fn an_asymmetric_grid_gives_the_same_as_direct_evaluation() {
        let source = Source::gaussian_with_deviation(0.4).unwrap();
        let grid = Quantizer::new(vec![-0.5, 0.1, 0.3]).unwrap();
        let search = LinearSearch::with_deviation(source, grid, 0.2, 3).unwrap();
        for set in search.ranking().unwrap() {
            assert_relative_eq!(set.mse, search.bank(&set.masks).unwrap().mmse().unwrap(), max_relative = 1e-8);
        }
    }

    #[test]
    fn too_few_sensors_for_full_rank_is_an_error() {
        assert!(matches!(search(3, 2, 10.0).best(), Err(Error::Argument(e)) if e.name == "sensors"));
        assert_eq!(search(3, 2, 10.0).any_rank().best().unwrap().masks.len(), 2);
        // Two masks do not tell eight cells apart.
        for refused in [
            search(3, 2, 10.0).best().map(|set| vec![set]),
            search(3, 2, 10.0).ranking(),
        ] {
            assert!(refused.unwrap_err().to_string().contains("sensors"));
        }
        let grid = Quantizer::new(vec![0.0, 1.0]).unwrap();
        assert!(LinearSearch::with_deviation(Source::uniform(1.0).unwrap(), grid, 0.1, 3).is_err());
        assert!(matches!(search(10, 12, 10.0).best(), Err(Error::TooLarge { .. })));
        assert!(matches!(search(6, 40, 10.0).best(), Err(Error::TooLarge { .. } | Error::Argument(_))));
    }
}
