//! Encoding of blocks with [`Effort::Fast`](crate::Effort::Fast): one coding, chosen by its estimated length.

use crate::encode::raw;
use crate::grid::Grid;
use crate::head::Coding;
use crate::indices::{LEVEL, to_wrapped_pco, write_block};
use crate::sections::{LEAST_ROWS, sections};
use crate::stored::{self, Plan};
use crate::{BlockCodec, Effort, Error, levels};
use pco::DeltaSpec;

/// Bits of a row above which a list of levels is considered, pco on the indices, and codings of the samples themselves.
const FINE_FOR_LEVELS: f32 = 1.25;
pub(crate) const FINE: usize = 4;
const VERY_FINE: f32 = 12.0;
/// Bits of a level beside those of its distance to the one before.
const LEVEL_BITS: f32 = 4.0;
/// Bits of an exception.
const EXCEPTION_BITS: f32 = 72.0;

/// Bits per sample up to which counts are tried besides tables, whose own bytes count then.
const SPARSE: f32 = 0.25;

type Levels = (Vec<u64>, Vec<i64>);

/// A coding of the rows.
enum Choice {
    /// Tables, or counts in blocks of few rows.
    Symbols(Plan),
    Levels(Levels, Plan),
    /// pco on differences of this order.
    Pco(usize),
}

/// The list of levels, what is coded of their numbers, and bits of a row; `None` if there are too many levels.
fn few_levels(keys: impl ExactSizeIterator<Item = u64> + Clone) -> Option<(Levels, Plan, f32)> {
    let found = levels::levels(keys, Effort::Fast)?;
    let (list, numbers) = (&found.0, &found.1);
    let range = (list[list.len() - 1] - list[0]) as f32;
    let mean_distance = (range / list.len() as f32).max(1.0);
    let bits = fewbits_node::elementary::log2(mean_distance) + LEVEL_BITS;
    let plan = Plan::new(numbers);
    let bits = plan.bits + bits * list.len() as f32 / numbers.len() as f32;
    Some((found, plan, bits))
}

impl BlockCodec {
    /// As [`encode`](Self::encode), of at least one sample; in sections if it may have some.
    pub(crate) fn encode_fast(&self, samples: &[f64], may_have_sections: bool) -> Result<Vec<u8>, Error> {
        let grid = self.grids(samples).into_iter().next();
        let coded = grid.map(|grid| (grid, self.indices(&grid, samples)));
        if may_have_sections && samples.len() >= LEAST_ROWS {
            let key = |sample: &f64| levels::key_of_sample(*sample) as i64;
            let sections = match &coded {
                Some((_, (indices, exceptions))) if exceptions.is_empty() => sections(indices),
                _ => sections(&samples.iter().map(key).collect::<Vec<_>>()),
            };
            if sections.len() > 1 {
                return self.encode_sections(samples, &sections);
            }
        }
        let on_grid =
            coded.map(|(grid, (indices, exceptions))| self.encode_fast_on(&grid, samples, &indices, &exceptions));
        let bytes = match on_grid.transpose()?.flatten() {
            Some(bytes) => bytes,
            None => self.encode_samples(samples)?,
        };
        // The byte of the head is not counted.
        let is_longer = bytes.len() > 8 * samples.len();
        Ok(if is_longer { raw(samples) } else { bytes })
    }

    /// A list of levels behind the head of its coding.
    fn encode_levels(&self, head: impl Fn(Coding) -> Vec<u8>, found: &Levels, plan: &Plan) -> Result<Vec<u8>, Error> {
        Ok(if self.is_tabled(found.1.len()) {
            levels::write_tabled(head(Coding::StoredLevels), found, plan)?
        } else {
            levels::write(head(Coding::Levels), false, found, None)?
        })
    }

    /// The samples without a grid.
    fn encode_samples(&self, samples: &[f64]) -> Result<Vec<u8>, Error> {
        let keys = samples.iter().map(|sample| levels::key_of_sample(*sample));
        let found = few_levels(keys).map(|(found, plan, bits)| -> Result<_, Error> {
            let is_shorter = bits < FINE as f32 || bits < stored::sample_bits(samples)?;
            Ok(is_shorter.then_some((found, plan)))
        });
        if let Some((found, plan)) = found.transpose()?.flatten() {
            return self.encode_levels(|coding| self.head(None, coding, false, &[]), &found, &plan);
        }
        let numbers = to_wrapped_pco(samples, &DeltaSpec::default(), LEVEL)?;
        Ok(numbers
            .map_or_else(|| raw(samples), |numbers| [self.head(None, Coding::Wrapped, false, &[]), numbers].concat()))
    }

    /// The block on a grid; `None` if samples without one are shorter.
    fn encode_fast_on(
        &self,
        grid: &Grid,
        samples: &[f64],
        indices: &[i64],
        exceptions: &[(usize, f64)],
    ) -> Result<Option<Vec<u8>>, Error> {
        let is_tabled = self.is_tabled(samples.len());
        let plan = if is_tabled {
            Plan::new(indices)
        } else {
            Plan::of_differences(indices)
        };
        let (plain, mut least, mut choice) = (plan.bits, plan.bits, Choice::Symbols(plan));
        if plain > FINE_FOR_LEVELS {
            let keys = indices.iter().map(|index| levels::key_of_index(*index));
            if let Some((found, plan, bits)) = few_levels(keys).filter(|(.., bits)| *bits < least) {
                (least, choice) = (bits, Choice::Levels(found, plan));
            }
        }
        if plain > FINE as f32 {
            let (order, bits) = stored::pco_order(indices);
            if bits < least {
                (least, choice) = (bits, Choice::Pco(order));
            }
        }
        least += EXCEPTION_BITS * exceptions.len() as f32 / samples.len() as f32;
        if least > VERY_FINE && stored::sample_bits(samples)? < least {
            return Ok(None);
        }
        let head = |coding| self.head(Some(grid), coding, false, exceptions);
        let counted = || write_block(head(Coding::Counts), false, grid, indices, None);
        Ok(Some(match choice {
            Choice::Symbols(plan) if is_tabled => {
                let bytes = stored::write(indices, &plan, head(Coding::Stored))?;
                let bits = 8.0 * bytes.len() as f32 / samples.len() as f32;
                let other = if bits <= SPARSE { Some(counted()?) } else { None };
                other.filter(|other| other.len() < bytes.len()).unwrap_or(bytes)
            }
            Choice::Symbols(_) => counted()?,
            Choice::Levels(found, plan) => self.encode_levels(head, &found, &plan)?,
            Choice::Pco(order) => match to_wrapped_pco(indices, &DeltaSpec::TryConsecutive(order), LEVEL)? {
                Some(numbers) => [head(Coding::Wrapped), numbers].concat(),
                None => counted()?,
            },
        }))
    }
}
