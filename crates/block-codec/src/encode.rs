//! Encoding of blocks: the grids and codings that are tried.

use crate::error::Damaged;
use crate::grid::Grid;
use crate::head::{Coding, SAMPLES};
use crate::indices::{smallest_pco, write_block};
use crate::rows::Others;
use crate::stored::STORED_ROWS;
use crate::vectors::wide;
use crate::{BlockCodec, Effort, Error, levels};
use std::borrow::Cow;

/// Smallest number of rows for which an anchor of eight bytes is stored.
const ANCHORED_ROWS: usize = 1024;
/// Bits per sample above which pco, and the samples themselves, are tried besides the models.
pub(crate) const FINE: usize = 2;
const VERY_FINE: usize = 6;
/// Bits per sample up to which only the first grid is tried.
const FEW: usize = 1;

/// The shortest block so far.
#[derive(Default)]
struct Shortest(Option<Vec<u8>>);

impl Shortest {
    fn length(&self) -> usize {
        self.0.as_ref().map_or(usize::MAX, Vec::len)
    }

    fn keep(&mut self, bytes: Vec<u8>) {
        if bytes.len() < self.length() {
            self.0 = Some(bytes);
        }
    }

    /// Keeps a block without other columns and, if there are any, one with them: they may mislead the models.
    fn keep_both(
        &mut self,
        others: Option<&Others<'_>>,
        write: impl Fn(Option<&Others<'_>>) -> Result<Vec<u8>, Damaged>,
    ) -> Result<(), Damaged> {
        self.keep(write(None)?);
        if others.is_some() {
            self.keep(write(others)?);
        }
        Ok(())
    }
}

/// The samples as they are.
pub(crate) fn raw(samples: &[f64]) -> Vec<u8> {
    let numbers = samples.iter().flat_map(|x| x.to_le_bytes());
    [SAMPLES | 2 << 4].into_iter().chain(numbers).collect()
}

impl BlockCodec {
    /// The samples of a column as one block. Samples that are not finite, and those without a grid point within the bound, return
    /// to the last bit; each costs about nine bytes.
    ///
    /// # Errors
    /// If pco fails, which no samples are known to cause.
    pub fn encode(&self, samples: &[f64]) -> Result<Vec<u8>, Error> {
        self.encode_with(samples, &[])
    }

    /// As [`encode`](Self::encode), with the same rows of other columns as regressors (at most `JOINT_COLUMNS` of them are
    /// used, the first ones). `others` must be their reconstructions, which the reader has. If they do not help, the block is
    /// the same as without them.
    ///
    /// # Errors
    /// If a column has another number of rows, and as [`encode`](Self::encode).
    pub fn encode_with(&self, samples: &[f64], others: &[&[f64]]) -> Result<Vec<u8>, Error> {
        self.encode_beside(samples, Others::new(others, samples.len())?.as_ref())
    }

    /// As [`encode_with`](Self::encode_with).
    pub(crate) fn encode_beside(&self, samples: &[f64], others: Option<&Others<'_>>) -> Result<Vec<u8>, Error> {
        if samples.is_empty() {
            return Ok(Vec::new());
        }
        if self.effort == Effort::Fast {
            return self.encode_fast(samples, true);
        }
        let mut best = Shortest::default();
        let few = |best: &Shortest| best.length() <= FEW * samples.len() / 8;
        for (i, grid) in self.grids(samples).into_iter().enumerate() {
            if i > 0 && few(&best) {
                break;
            }
            self.encode_on(&grid, samples, others, &mut best)?;
        }
        if best.length() > VERY_FINE * samples.len() / 8 {
            if let Some(numbers) = smallest_pco(samples, best.length())? {
                best.keep([self.head(None, Coding::Wrapped, false, &[]), numbers].concat());
            }
            let keys = samples.iter().map(|sample| levels::key_of_sample(*sample));
            if let Some(found) = levels::levels(keys, self.effort) {
                let head = |joint| self.head(None, Coding::Levels, joint, &[]);
                best.keep_both(others, |others| levels::write(head(others.is_some()), true, &found, others))?;
            }
            best.keep(raw(samples));
        }
        Ok(best.0.unwrap_or_default())
    }

    /// Tries the codings of the samples' indices on a grid.
    fn encode_on(
        &self,
        grid: &Grid,
        samples: &[f64],
        others: Option<&Others<'_>>,
        best: &mut Shortest,
    ) -> Result<(), Error> {
        let (indices, exceptions) = self.indices(grid, samples);
        let head = |coding, joint| self.head(Some(grid), coding, joint, &exceptions);
        let mut shortest = Shortest::default();
        shortest.keep_both(others, |others| {
            write_block(head(Coding::Models, others.is_some()), true, grid, &indices, others)
        })?;
        // On coarse grids the models need far fewer bits. Try the general coder only if a sample takes many bits.
        let is_fine = shortest.length() > FINE * samples.len() / 8;
        let keys = indices.iter().map(|index| levels::key_of_index(*index));
        if let Some(found) = levels::levels(keys, self.effort) {
            let head = |joint| head(Coding::Levels, joint);
            shortest.keep_both(others, |others| levels::write(head(others.is_some()), true, &found, others))?;
        }
        if is_fine && let Some(numbers) = smallest_pco(&indices, shortest.length().min(best.length()))? {
            shortest.keep([head(Coding::Wrapped, false), numbers].concat());
        }
        shortest.0.into_iter().for_each(|bytes| best.keep(bytes));
        Ok(())
    }

    /// Whether blocks of so many rows are coded by tables.
    pub(crate) fn is_tabled(&self, rows: usize) -> bool {
        self.effort == Effort::Fast && rows >= STORED_ROWS
    }

    /// The grids that are tried; none if only the samples' own bits fit.
    pub(crate) fn grids(&self, samples: &[f64]) -> Vec<Grid> {
        let mut grids: Vec<Grid> = self.grid(samples).into_iter().collect();
        // Directions with few decimals have their own grid, which is better for fine bounds.
        if let Some(period) = self.period
            && samples.iter().all(|x| (0.0..period).contains(x))
        {
            grids.extend(Grid::decimal(samples, self.delta, false));
        }
        grids.iter().map(|grid| grid.fitted(samples, self.effort)).collect()
    }

    /// The grid that fits the samples; `None` if only their own bits do.
    pub(crate) fn grid(&self, samples: &[f64]) -> Option<Grid> {
        let first = samples.iter().copied().find(|x| x.is_finite())?;
        if let Some(period) = self.period {
            return Some(Grid::circle(self.delta, period));
        }
        let lossless = self.is_lossless();
        // Only a lossless block distinguishes the two zeros.
        let is_ordinary = |x: &f64| x.is_finite() & (!lossless | (x.to_bits() != (-0.0_f64).to_bits()));
        let ordinary: Cow<'_, [f64]> = if samples.iter().fold(true, |all, x| all & is_ordinary(x)) {
            samples.into()
        } else {
            samples.iter().copied().filter(is_ordinary).collect()
        };
        let anchor = if samples.len() >= ANCHORED_ROWS { first } else { 0.0 };
        Grid::decimal(&ordinary, self.delta, false).or_else(|| match lossless {
            true => Grid::decimal(&ordinary, 0.0, true),
            false => Some(Grid::line(self.delta, anchor)),
        })
    }

    /// Whether a reconstruction is within the bound of its sample.
    #[inline(always)]
    fn is_within(&self, value: f64, sample: f64) -> bool {
        match self.period {
            None if self.is_lossless() => value.to_bits() == sample.to_bits(),
            None => (value - sample).abs() <= self.delta,
            Some(period) => {
                let turned = sample.rem_euclid(period);
                let straight = (value - turned).abs();
                (0.0..period).contains(&value) && straight.min((period - straight).abs()) <= self.delta
            }
        }
    }

    /// The indices (an exception repeats the last one), and the exceptions with their rows.
    pub(crate) fn indices(&self, grid: &Grid, samples: &[f64]) -> (Vec<i64>, Vec<(usize, f64)>) {
        let delta = self.delta;
        // Without a circle the loop has no branch and is vectorised.
        let plain = if self.period.is_none() && !self.is_lossless() {
            grid.plain_indices(samples, |value, sample| (value - sample).abs() <= delta)
        } else {
            grid.plain_indices(samples, |value, sample| self.is_within(value, sample))
        };
        if let Some(indices) = plain {
            return (indices, Vec::new());
        }
        let mut exceptions = Vec::new();
        let mut indices = Vec::with_capacity(samples.len());
        let mut last = None;
        // Instructions that round are among the vector instructions.
        wide!({
            for (row, sample) in samples.iter().enumerate() {
                let near = last.unwrap_or(0);
                let index = grid.index(*sample, near);
                match index {
                    Some(index) if self.is_within(grid.value(index), *sample) => last = Some(index),
                    _ => exceptions.push((row, *sample)),
                }
                // Exceptions before the first ordinary sample: its index is not known yet.
                indices.push(last);
            }
        });
        let first = indices.iter().find_map(|index| *index).unwrap_or(0);
        (indices.into_iter().map(|index| index.unwrap_or(first)).collect(), exceptions)
    }
}
