//! Blocks: many samples of one column as bytes, decodable alone.
//!
//! A stream must code each sample before the next one is known; a block is known as a whole. [`BlockCodec`] chooses the grid of
//! reconstructions from all its samples and codes their indices by a mixture of models. Blocks are independent of each
//! other.
//!
//! ```
//! use fewbits_block_codec::BlockCodec;
//! let samples: Vec<f64> = (0..512).map(|n| (20.0 + 3.0 * (f64::from(n) * 0.01).sin() * 10.0).round() / 10.0).collect();
//! let codec = BlockCodec::new(0.05)?;
//! let bytes = codec.encode(&samples)?;
//! assert!(bytes.len() < 64); // one bit per sample
//! let read = codec.decode(&bytes, samples.len())?;
//! assert!(read.iter().zip(&samples).all(|(value, sample)| (value - sample).abs() <= 0.05));
//! # Ok::<(), fewbits_block_codec::Error>(())
//! ```
//!
//! # Bytes
//!
//! | part | bytes | when |
//! |---|---|---|
//! | head | 1 | always: low 4 bits the grid (0 to 12: decimals of the samples; 13: line; 14: circle; 15: the samples themselves), then 2 bits the coding (0: models, of samples levels; 1: pco; 2: levels, of samples as they are; 3: counts, of samples wrapped pco), 1 bit joint, 1 bit whether a second byte follows |
//! | second | 1 | bit 0: exceptions; bit 1: steps; bit 2: anchor; bit 3: phase; bit 4: decimals are rounded to single precision; bit 5: pco is in its wrapped form |
//! | steps | 2 varints | unit and origin (zigzag) in units of the last decimal |
//! | anchor | 8 | a point of the line, little-endian; otherwise zero is one |
//! | phase | 1 | the grid of a line, or of cells of several decimals, is moved by so many sixteenths of a cell (1 to 15; whole decimals, rounded up) |
//! | exceptions | varints and 8 each | number; rows since the last one; the sample |
//! | indices | the rest | models: 6 bits length and as many bits of the first index (zigzag), then decisions (`block/model.rs`), all arithmetic coded; counts: the same with a bit behind the first index (1: differences of differences) and other decisions (`block/counts.rs`); levels: module `levels`; pco: its standalone or, as written since version 6 of recordings, its wrapped format with one chunk and one page |
//!
//! There is no checksum, no length and no number of rows: the container must store all three. An arithmetic code has no redundancy, so most
//! truncated or damaged blocks decode to wrong samples. Trailing bytes are detected and refused.

pub mod arithmetic;
pub mod bytes;
mod counts;
mod error;
mod experts;
mod grid;
mod head;
mod indices;
mod levels;
mod mixer;
mod model;
mod priors;
mod rows;
mod start;
mod vectors;

use bytes::{Bytes, unzigzag};
pub use error::{ArgumentError, Damaged, Error};
use grid::{DECIMALS, Grid, PHASES};
use head::{CIRCLE, Coding, Head, LINE, SAMPLES, SINGLE, WRAPPED, write_head};
use indices::{from_pco_bytes, from_wrapped_pco, raw_samples, read_block, smallest_pco, write_block};
pub use rows::JOINT_COLUMNS;
use rows::Others;
pub use start::{Start, StartedBlock};
use vectors::vectorised;

/// Smallest number of rows for which an anchor of eight bytes is stored.
const ANCHORED_ROWS: usize = 1024;
/// Bits per sample above which pco, and the samples themselves, are tried besides the models.
const FINE: usize = 2;
const FINE_IF_FAST: usize = 4;
const VERY_FINE: usize = 6;
/// Bits per sample up to which only the first grid is tried.
const FEW: usize = 1;
/// How much computing time the writer may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Effort {
    /// Mixed models, and pco if the bound is fine: the fewest bits.
    #[default]
    Thorough,
    /// Counts in few contexts, and pco if the bound is fine: faster, with more bits (`docs/adaptive.md` has both).
    Fast,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Accuracy {
    Within { delta: f64, period: Option<f64> },
    Lossless,
}

/// Largest number of cells of a circle.
const MOST_CELLS: f64 = (1_u64 << 40) as f64;

/// Writes and reads blocks. Both ends must use the same accuracy; [`Effort`] matters only to the writer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockCodec {
    accuracy: Accuracy,
    effort: Effort,
}

impl BlockCodec {
    /// A codec that returns every finite sample within `delta`, in the units of the samples.
    ///
    /// # Errors
    /// If `delta` is not above 0 or `2 delta` not finite.
    pub fn new(delta: f64) -> Result<Self, Error> {
        ArgumentError::positive("delta", delta)?;
        if !(2.0 * delta).is_finite() {
            return Err(ArgumentError::new("delta", delta, "a number whose double is finite").into());
        }
        Ok(Self {
            accuracy: Accuracy::Within { delta, period: None },
            effort: Effort::default(),
        })
    }

    /// The same codec for samples on a circle: they are taken modulo `period` (360 for degrees), values lie in `[0, period)`, and the
    /// bound holds around the circle. No effect on a lossless codec.
    ///
    /// # Errors
    /// If `period` is not positive and finite, or above `2^40 delta`.
    pub fn on_circle(self, period: f64) -> Result<Self, Error> {
        ArgumentError::positive("period", period)?;
        let Accuracy::Within { delta, .. } = self.accuracy else {
            return Ok(self);
        };
        if period / delta > MOST_CELLS {
            return Err(ArgumentError::new("period", period, "at most 2^40 times `delta`").into());
        }
        let period = Some(period);
        Ok(Self {
            accuracy: Accuracy::Within { delta, period },
            ..self
        })
    }

    /// A codec that returns every sample to the last bit.
    pub fn lossless() -> Self {
        Self {
            accuracy: Accuracy::Lossless,
            effort: Effort::default(),
        }
    }

    /// The same codec with another effort.
    #[must_use]
    pub fn with_effort(self, effort: Effort) -> Self {
        Self { effort, ..self }
    }

    /// The error bound of finite samples; zero if they are exact.
    fn delta(&self) -> f64 {
        match self.accuracy {
            Accuracy::Within { delta, .. } => delta,
            Accuracy::Lossless => 0.0,
        }
    }

    /// The samples of a column as one block. Samples that are not finite, and those without a grid point within the bound, return
    /// to the last bit; each costs about nine bytes.
    ///
    /// # Errors
    /// If pco fails, which no samples are known to cause.
    pub fn encode(&self, samples: &[f64]) -> Result<Vec<u8>, Error> {
        self.encode_with(samples, &[])
    }

    /// As [`encode`](Self::encode), with the same rows of other columns as regressors (at most [`JOINT_COLUMNS`] of them are
    /// used, the first ones). `others` must be their reconstructions, which the reader has. If they do not help, the block is
    /// the same as without them.
    ///
    /// # Errors
    /// If a column has another number of rows, and as [`encode`](Self::encode).
    pub fn encode_with(&self, samples: &[f64], others: &[&[f64]]) -> Result<Vec<u8>, Error> {
        check_rows(samples.len(), others)?;
        if samples.is_empty() {
            return Ok(Vec::new());
        }
        let mut best = Shortest::default();
        let thorough = self.effort == Effort::Thorough;
        // Other columns may mislead the models: the shorter of both blocks is kept.
        let others = (thorough && !others.is_empty()).then(|| Others::new(others));
        let few = |best: &Shortest| best.0.as_ref().is_some_and(|b| b.len() <= FEW * samples.len() / 8);
        for (i, grid) in self.grids(samples).into_iter().enumerate() {
            if i > 0 && (!thorough || few(&best)) {
                break;
            }
            self.encode_on(&grid, samples, others.as_ref(), &mut best)?;
        }
        if best.0.as_ref().is_none_or(|b| b.len() > VERY_FINE * samples.len() / 8) {
            if let Some(numbers) = smallest_pco(samples, thorough)? {
                best.keep([&[SAMPLES | 3 << 4], numbers.as_slice()].concat());
            }
            let keys: Vec<u64> = samples.iter().map(|sample| levels::key_of_sample(*sample)).collect();
            if let Some(found) = levels::levels(&keys) {
                best.keep(levels::write(vec![SAMPLES], thorough, &found, None)?);
                if others.is_some() {
                    best.keep(levels::write(vec![SAMPLES | 64], thorough, &found, others.as_ref())?);
                }
            }
            let mut bytes = vec![SAMPLES | 2 << 4];
            bytes.extend(samples.iter().flat_map(|x| x.to_le_bytes()));
            best.keep(bytes);
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
        let thorough = self.effort == Effort::Thorough;
        let head = |coding, joint| {
            let mut bytes = Vec::new();
            write_head(grid, coding, joint, &exceptions, &mut bytes);
            bytes
        };
        let mut shortest = Shortest::default();
        shortest.keep(write_block(thorough, grid, &indices, &exceptions, None)?);
        if others.is_some() {
            shortest.keep(write_block(true, grid, &indices, &exceptions, others)?);
        }
        let is_above =
            |bits: usize, best: &Shortest| best.0.as_ref().is_none_or(|b| b.len() > bits * samples.len() / 8);
        // On coarse grids the models need far fewer bits. Try the general coder only if a sample takes many bits.
        let is_fine = is_above(if thorough { FINE } else { FINE_IF_FAST }, &shortest);
        if thorough || is_fine {
            let keys: Vec<u64> = indices.iter().map(|index| levels::key_of_index(*index)).collect();
            if let Some(found) = levels::levels(&keys) {
                shortest.keep(levels::write(head(Coding::Levels, false), thorough, &found, None)?);
                if others.is_some() {
                    shortest.keep(levels::write(head(Coding::Levels, true), thorough, &found, others)?);
                }
            }
        }
        if is_fine && let Some(numbers) = smallest_pco(&indices, thorough)? {
            let mut bytes = head(Coding::Wrapped, false);
            bytes.extend(numbers);
            shortest.keep(bytes);
        }
        shortest.0.into_iter().for_each(|bytes| best.keep(bytes));
        Ok(())
    }

    /// The samples of a block of `rows` rows.
    ///
    /// # Errors
    /// If it is detectable that no writer of this accuracy and number of rows wrote the bytes.
    pub fn decode(&self, bytes: &[u8], rows: usize) -> Result<Vec<f64>, Error> {
        self.decode_with(bytes, rows, &[])
    }

    /// As [`decode`](Self::decode), for a block of [`encode_with`](Self::encode_with) with the same other columns.
    ///
    /// # Errors
    /// As [`decode`](Self::decode), or if a column has another number of rows.
    pub fn decode_with(&self, bytes: &[u8], rows: usize, others: &[&[f64]]) -> Result<Vec<f64>, Error> {
        check_rows(rows, others)?;
        if rows == 0 {
            return match bytes.len() {
                0 => Ok(Vec::new()),
                left => Err(Damaged::new("block", format!("{left} bytes"), "none for no rows").into()),
            };
        }
        let mut bytes = Bytes(bytes);
        let head = self.read_head(&mut bytes, rows)?;
        let rest = bytes.0;
        let Some(grid) = head.grid else {
            return Ok(match head.coding {
                Coding::Raw => raw_samples(rest, rows)?,
                Coding::Wrapped => from_wrapped_pco::<f64>(rest, rows)?,
                Coding::Levels => {
                    let others = joint_columns(&head, others)?;
                    let keys = levels::read(rest, rows, others.as_ref())?;
                    keys.into_iter().map(levels::sample_of_key).collect()
                }
                _ => from_pco_bytes::<f64>(rest, rows)?,
            });
        };
        let indices = match head.coding {
            Coding::Models => {
                let others = joint_columns(&head, others)?;
                read_block(rest, true, &grid, rows, others.as_ref())?
            }
            Coding::Levels => {
                let others = joint_columns(&head, others)?;
                let keys = levels::read(rest, rows, others.as_ref())?;
                keys.into_iter().map(levels::index_of_key).collect()
            }
            Coding::Wrapped => from_wrapped_pco::<i64>(rest, rows)?,
            Coding::Counts => read_block(rest, false, &grid, rows, None)?,
            _ => from_pco_bytes::<i64>(rest, rows)?,
        };
        let mut samples = grid.values(&indices);
        for (row, sample) in head.exceptions {
            samples[row] = sample;
        }
        Ok(samples)
    }

    /// The grids that are tried; none if only the samples' own bits fit.
    fn grids(&self, samples: &[f64]) -> Vec<Grid> {
        let mut grids: Vec<Grid> = self.grid(samples).into_iter().collect();
        // Directions with few decimals have their own grid, which is better for fine bounds.
        if let Accuracy::Within {
            delta,
            period: Some(period),
        } = self.accuracy
            && samples.iter().all(|x| (0.0..period).contains(x))
        {
            grids.extend(Grid::decimal(samples, delta));
        }
        grids.iter().map(|grid| grid.fitted(samples)).collect()
    }

    /// The grid that fits the samples; `None` if only their own bits do.
    fn grid(&self, samples: &[f64]) -> Option<Grid> {
        let finite = || samples.iter().copied().filter(|x| x.is_finite());
        let first = finite().next()?;
        if let Accuracy::Within {
            delta,
            period: Some(period),
        } = self.accuracy
        {
            return Some(Grid::circle(delta, period));
        }
        let lossless = self.accuracy == Accuracy::Lossless;
        // Only a lossless block distinguishes the two zeros.
        let ordinary: Vec<f64> = finite()
            .filter(|x| !lossless || x.to_bits() != (-0.0_f64).to_bits())
            .map(|x| x + 0.0)
            .collect();
        Grid::decimal(&ordinary, self.delta()).or_else(|| match self.accuracy {
            Accuracy::Lossless => Grid::single(&ordinary),
            Accuracy::Within { delta, .. } => {
                let anchor = if samples.len() >= ANCHORED_ROWS { first } else { 0.0 };
                Some(Grid::line(delta, anchor))
            }
        })
    }

    /// Whether a reconstruction is within the bound of its sample.
    #[inline(always)]
    fn is_within(&self, value: f64, sample: f64) -> bool {
        match self.accuracy {
            Accuracy::Lossless => value.to_bits() == sample.to_bits(),
            Accuracy::Within { delta, period } => match period {
                None => (value - sample).abs() <= delta,
                Some(period) => {
                    let turned = sample.rem_euclid(period);
                    let straight = (value - turned).abs();
                    (0.0..period).contains(&value) && straight.min((period - straight).abs()) <= delta
                }
            },
        }
    }

    /// The indices (an exception repeats the last one), and the exceptions with their rows.
    fn indices(&self, grid: &Grid, samples: &[f64]) -> (Vec<i64>, Vec<(usize, f64)>) {
        let mut exceptions = Vec::new();
        let mut indices = Vec::with_capacity(samples.len());
        let mut last = None;
        // Instructions that round are among the vector instructions.
        vectorised(
            #[inline(always)]
            || {
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
            },
        );
        let first = indices.iter().find_map(|index| *index).unwrap_or(0);
        (indices.into_iter().map(|index| index.unwrap_or(first)).collect(), exceptions)
    }

    /// The grid of samples with `decimals` decimals; its steps are read if `stepped`.
    fn decimal_grid(&self, decimals: u8, stepped: bool, bytes: &mut Bytes<'_>) -> Result<Grid, Damaged> {
        if stepped {
            return Ok(Grid::Stepped {
                decimals,
                unit: match i64::try_from(bytes.varint()?) {
                    Ok(unit @ 1..) => unit,
                    _ => return Err(Damaged::new("unit", "too large", "1 to 2^63")),
                },
                origin: unzigzag(bytes.varint()?),
            });
        }
        let width = Grid::width(self.delta(), fewbits_node::adaptive::TENS[usize::from(decimals)]);
        let width = width.ok_or_else(|| Damaged::new("decimals", decimals, "a grid not finer than the samples"))?;
        Ok(Grid::Decimal {
            decimals,
            width,
            phase: 0,
        })
    }

    fn circle(&self) -> Result<Grid, Damaged> {
        match self.accuracy {
            Accuracy::Within {
                delta,
                period: Some(period),
            } => Ok(Grid::circle(delta, period)),
            _ => Err(Damaged::new("grid", "circle", "the grid of a line")),
        }
    }

    fn read_head(&self, bytes: &mut Bytes<'_>, rows: usize) -> Result<Head, Damaged> {
        let [head] = bytes.array()?;
        let kind = head & 15;
        let coding = match (head >> 4 & 3, kind) {
            (0, 0..SAMPLES) => Coding::Models,
            (1, _) => Coding::Pco,
            (2, SAMPLES) => Coding::Raw,
            (3, SAMPLES) => Coding::Wrapped,
            (2, _) | (0, SAMPLES) => Coding::Levels,
            (3, 0..SAMPLES) => Coding::Counts,
            _ => return Err(Damaged::new("head", head, "a grid and a coding that belong together")),
        };
        let [second] = if head & 128 == 0 { [0] } else { bytes.array()? };
        let (is_single, is_wrapped) = (second & SINGLE != 0, second & WRAPPED != 0);
        if second > 63
            || (head & 128 != 0 && second == 0)
            || (kind == SAMPLES && head & 128 != 0)
            || (kind == SAMPLES && head & 64 != 0 && coding != Coding::Levels)
            || (is_single && (second & 2 == 0 || kind >= DECIMALS))
            || (is_wrapped && coding != Coding::Pco)
        {
            return Err(Damaged::new(
                "second byte",
                second,
                "exceptions, steps, an anchor or a phase, and a grid that has them",
            ));
        }
        let grid = match (kind, self.accuracy) {
            (SAMPLES, _) => None,
            (decimals @ 0..DECIMALS, _) => Some(self.decimal_grid(decimals, second & 2 != 0, bytes)?),
            (LINE, Accuracy::Within { delta, .. }) => {
                let anchor = if second & 4 == 0 {
                    0.0
                } else {
                    f64::from_le_bytes(bytes.array()?)
                };
                if !anchor.is_finite() {
                    return Err(Damaged::new("anchor", anchor, "a finite number"));
                }
                Some(Grid::line(delta, anchor))
            }
            (CIRCLE, Accuracy::Within { .. }) => Some(self.circle()?),
            _ => return Err(Damaged::new("grid", kind, "one of the agreed accuracy")),
        };
        let coding = if is_wrapped { Coding::Wrapped } else { coding };
        let grid = grid.map(|grid| if is_single { grid.rounded_to_single() } else { grid });
        let grid = match grid {
            Some(grid) if second & 8 != 0 => Some(read_phase(grid, bytes)?),
            grid => grid,
        };
        let mut exceptions = Vec::new();
        if second & 1 == 1 {
            let count = bytes.varint()?;
            let mut row = 0_u64;
            for i in 0..count {
                row = row.saturating_add(bytes.varint()?).saturating_add(u64::from(i > 0));
                if row >= rows as u64 {
                    return Err(Damaged::new("exception", row, "a row of the block"));
                }
                exceptions.push((row as usize, f64::from_le_bytes(bytes.array()?)));
            }
        }
        Ok(Head {
            grid,
            coding,
            joint: head & 64 != 0,
            exceptions,
        })
    }
}

/// The shortest block so far.
#[derive(Default)]
struct Shortest(Option<Vec<u8>>);

impl Shortest {
    fn keep(&mut self, bytes: Vec<u8>) {
        if self.0.as_ref().is_none_or(|best| bytes.len() < best.len()) {
            self.0 = Some(bytes);
        }
    }
}

/// The other columns of a joint block.
fn joint_columns<'a>(head: &Head, others: &[&'a [f64]]) -> Result<Option<Others<'a>>, Damaged> {
    if head.joint && others.is_empty() {
        return Err(Damaged::new("block", "joint", "the other columns that it was written with"));
    }
    Ok(head.joint.then(|| Others::new(others)))
}

/// The grid moved by the phase in the next byte.
fn read_phase(grid: Grid, bytes: &mut Bytes<'_>) -> Result<Grid, Damaged> {
    let [phase] = bytes.array()?;
    match grid {
        Grid::Decimal { .. } | Grid::Line { .. } if (1..PHASES).contains(&phase) => Ok(grid.with_phase(phase)),
        _ => Err(Damaged::new("phase", phase, "1 to 15, of a grid of cells on a line")),
    }
}

fn check_rows(rows: usize, others: &[&[f64]]) -> Result<(), ArgumentError> {
    match others.iter().find(|other| other.len() != rows) {
        Some(other) => Err(ArgumentError::new("others", other.len(), format!("{rows} rows"))),
        None => Ok(()),
    }
}
