//! Blocks: many samples of one column as bytes, decodable alone.
//!
//! A stream must code each sample before the next one is known; a block is known as a whole. [`BlockCodec`] chooses the grid of
//! reconstructions from all its samples and codes their indices by a mixture of models. Blocks are independent of each
//! other.
//!
//! ```
//! use fewbits_adaptive::{BlockCodec, Config};
//! let samples: Vec<f64> = (0..512).map(|n| (20.0 + 3.0 * (f64::from(n) * 0.01).sin() * 10.0).round() / 10.0).collect();
//! let codec = BlockCodec::new(Config::new(0.05)?);
//! let bytes = codec.encode(&samples)?;
//! assert!(bytes.len() < 64); // one bit per sample
//! let read = codec.decode(&bytes, samples.len())?;
//! assert!(read.iter().zip(&samples).all(|(value, sample)| (value - sample).abs() <= 0.05));
//! # Ok::<(), fewbits_adaptive::Error>(())
//! ```
//!
//! # Bytes
//!
//! | part | bytes | when |
//! |---|---|---|
//! | head | 1 | always: low 4 bits the grid (0 to 12: decimals of the samples; 13: line; 14: circle; 15: the samples themselves), then 2 bits the coding (0: models; 1: pco; 2: as they are; 3: counts), 1 bit joint, 1 bit whether a second byte follows |
//! | second | 1 | bit 0: exceptions; bit 1: steps; bit 2: anchor; bit 3: phase |
//! | steps | 2 varints | unit and origin (zigzag) in units of the last decimal |
//! | anchor | 8 | a point of the line, little-endian; otherwise zero is one |
//! | phase | 1 | the grid of a line, or of cells of several decimals, is moved by so many sixteenths of a cell (1 to 15; whole decimals, rounded up) |
//! | exceptions | varints and 8 each | number; rows since the last one; the sample |
//! | indices | the rest | models: 6 bits length and as many bits of the first index (zigzag), then decisions (`block/model.rs`), all arithmetic coded; counts: the same with a bit behind the first index (1: differences of differences) and other decisions (`block/counts.rs`); pco: its standalone format |
//!
//! There is no checksum, no length and no number of rows: the container must store all three. An arithmetic code has no redundancy, so most
//! truncated or damaged blocks decode to wrong samples. Trailing bytes are detected and refused.

pub mod coder;
mod counts;
mod experts;
mod grid;
mod head;
mod indices;
mod mixer;
mod model;
mod priors;
mod rows;
mod start;

use crate::{Config, Error};
use fewbits_core::CodecError;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::kernels::vectorised;
pub(crate) use grid::unzigzag;
use grid::{Bytes, DECIMALS, Grid, PHASES};
use head::{CIRCLE, Coding, Head, LINE, SAMPLES, write_head};
use indices::{from_pco_bytes, raw_samples, read_block, smallest_pco, write_block};
pub use rows::JOINT_COLUMNS;
use rows::Others;
pub use start::{Start, StartedBlock};

/// Smallest number of rows for which an anchor of eight bytes is stored.
const ANCHORED_ROWS: usize = 1024;
/// Bits per sample above which pco, and the samples themselves, are tried besides the models.
const FINE: usize = 4;
const VERY_FINE: usize = 16;
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
    Within(Config),
    Lossless,
}

/// Writes and reads blocks. Both ends must use the same accuracy; [`Effort`] matters only to the writer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockCodec {
    accuracy: Accuracy,
    effort: Effort,
}

impl BlockCodec {
    /// A codec that returns every finite sample within [`Config::delta`], around the circle if there is one. Samples of
    /// [`Config::exact`] return exactly. The settings for lost packets have no effect.
    pub fn new(config: Config) -> Self {
        Self {
            accuracy: Accuracy::Within(config),
            effort: Effort::default(),
        }
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
            Accuracy::Within(config) if config.resolution().is_none() => config.delta(),
            _ => 0.0,
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
        let mut best: Option<Vec<u8>> = None;
        let keep = |bytes: Vec<u8>, best: &mut Option<Vec<u8>>| {
            if best.as_ref().is_none_or(|b| bytes.len() < b.len()) {
                *best = Some(bytes);
            }
        };
        if let Some(grid) = self.grid(samples).map(|grid| grid.fitted(samples)) {
            let (indices, exceptions) = self.indices(&grid, samples);
            let thorough = self.effort == Effort::Thorough;
            // Other columns may mislead the models: the shorter of both blocks is kept.
            keep(write_block(thorough, &grid, &indices, &exceptions, None)?, &mut best);
            if thorough && !others.is_empty() {
                let others = Others::new(others);
                keep(write_block(true, &grid, &indices, &exceptions, Some(&others))?, &mut best);
            }
            // On coarse grids the models need far fewer bits. Try the general coder only if a sample takes many bits.
            if best.as_ref().is_none_or(|b| b.len() > FINE * samples.len() / 8) {
                let mut bytes = Vec::new();
                write_head(&grid, Coding::Pco, false, &exceptions, &mut bytes);
                bytes.extend(smallest_pco(&indices)?);
                keep(bytes, &mut best);
            }
        }
        if best.as_ref().is_none_or(|b| b.len() > VERY_FINE * samples.len() / 8) {
            let mut bytes = vec![SAMPLES | 1 << 4];
            bytes.extend(smallest_pco(samples)?);
            keep(bytes, &mut best);
            let mut bytes = vec![SAMPLES | 2 << 4];
            bytes.extend(samples.iter().flat_map(|x| x.to_le_bytes()));
            keep(bytes, &mut best);
        }
        Ok(best.unwrap_or_default())
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
                left => Err(CodecError::TrailingBits { left: 8 * left }.into()),
            };
        }
        let mut bytes = Bytes(bytes);
        let head = self.read_head(&mut bytes, rows)?;
        let rest = bytes.0;
        let Some(grid) = head.grid else {
            return Ok(match head.coding {
                Coding::Raw => raw_samples(rest, rows)?,
                _ => from_pco_bytes::<f64>(rest, rows)?,
            });
        };
        let indices = match head.coding {
            Coding::Models => {
                if head.joint && others.is_empty() {
                    return Err(
                        CodecError::invalid("block", "joint", "the other columns that it was written with").into()
                    );
                }
                let others = head.joint.then(|| Others::new(others));
                read_block(rest, true, &grid, rows, others.as_ref())?
            }
            Coding::Counts => read_block(rest, false, &grid, rows, None)?,
            _ => from_pco_bytes::<i64>(rest, rows)?,
        };
        let mut samples = grid.values(&indices);
        for (row, sample) in head.exceptions {
            samples[row] = sample;
        }
        Ok(samples)
    }

    /// The grid that fits the samples; `None` if only their own bits do.
    fn grid(&self, samples: &[f64]) -> Option<Grid> {
        let finite = || samples.iter().copied().filter(|x| x.is_finite());
        let first = finite().next()?;
        if let Accuracy::Within(config) = self.accuracy
            && let Some(period) = config.period()
        {
            return Some(Grid::circle(&config, period));
        }
        let lossless = self.accuracy == Accuracy::Lossless;
        // Only a lossless block distinguishes the two zeros.
        let ordinary: Vec<f64> = finite()
            .filter(|x| !lossless || x.to_bits() != (-0.0_f64).to_bits())
            .map(|x| x + 0.0)
            .collect();
        Grid::decimal(&ordinary, self.delta()).or_else(|| match self.accuracy {
            Accuracy::Lossless => None,
            Accuracy::Within(config) => {
                let anchor = if samples.len() >= ANCHORED_ROWS { first } else { 0.0 };
                Some(Grid::line(config.delta(), anchor))
            }
        })
    }

    /// Whether a reconstruction is within the bound of its sample.
    #[inline(always)]
    fn is_within(&self, value: f64, sample: f64) -> bool {
        match self.accuracy {
            Accuracy::Lossless => value.to_bits() == sample.to_bits(),
            Accuracy::Within(config) => match config.period() {
                None => (value - sample).abs() <= config.delta(),
                Some(period) => {
                    let turned = sample.rem_euclid(period);
                    let straight = (value - turned).abs();
                    straight.min((period - straight).abs()) <= config.delta()
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
    fn decimal_grid(&self, decimals: u8, stepped: bool, bytes: &mut Bytes<'_>) -> Result<Grid, CodecError> {
        if stepped {
            return Ok(Grid::Stepped {
                decimals,
                unit: match i64::try_from(bytes.varint()?) {
                    Ok(unit @ 1..) => unit,
                    _ => return Err(CodecError::invalid("unit", "too large", "1 to 2^63")),
                },
                origin: unzigzag(bytes.varint()?),
            });
        }
        let width = Grid::width(self.delta(), fewbits_node::adaptive::TENS[usize::from(decimals)]);
        let width =
            width.ok_or_else(|| CodecError::invalid("decimals", decimals, "a grid not finer than the samples"))?;
        Ok(Grid::Decimal {
            decimals,
            width,
            phase: 0,
        })
    }

    fn circle(&self, config: &Config) -> Result<Grid, CodecError> {
        match config.period() {
            Some(period) => Ok(Grid::circle(config, period)),
            None => Err(CodecError::invalid("grid", "circle", "the grid of a line")),
        }
    }

    fn read_head(&self, bytes: &mut Bytes<'_>, rows: usize) -> Result<Head, CodecError> {
        let [head] = bytes.array()?;
        let kind = head & 15;
        let coding = match (head >> 4 & 3, kind) {
            (0, 0..SAMPLES) => Coding::Models,
            (1, _) => Coding::Pco,
            (2, SAMPLES) => Coding::Raw,
            (3, 0..SAMPLES) => Coding::Counts,
            _ => return Err(CodecError::invalid("head", head, "a grid and a coding that belong together")),
        };
        let [second] = if head & 128 == 0 { [0] } else { bytes.array()? };
        if second > 15 || (head & 128 != 0 && second == 0) || (kind == SAMPLES && head & 192 != 0) {
            return Err(CodecError::invalid(
                "second byte",
                second,
                "exceptions, steps, an anchor or a phase, and a grid that has them",
            ));
        }
        let grid = match (kind, self.accuracy) {
            (SAMPLES, _) => None,
            (decimals @ 0..DECIMALS, _) => Some(self.decimal_grid(decimals, second & 2 != 0, bytes)?),
            (LINE, Accuracy::Within(config)) => {
                let anchor = if second & 4 == 0 {
                    0.0
                } else {
                    f64::from_le_bytes(bytes.array()?)
                };
                if !anchor.is_finite() {
                    return Err(CodecError::invalid("anchor", anchor, "a finite number"));
                }
                Some(Grid::line(config.delta(), anchor))
            }
            (CIRCLE, Accuracy::Within(config)) => Some(self.circle(&config)?),
            _ => return Err(CodecError::invalid("grid", kind, "one of the agreed accuracy")),
        };
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
                    return Err(CodecError::invalid("exception", row, "a row of the block"));
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

/// The grid moved by the phase in the next byte.
fn read_phase(grid: Grid, bytes: &mut Bytes<'_>) -> Result<Grid, CodecError> {
    let [phase] = bytes.array()?;
    match grid {
        Grid::Decimal { .. } | Grid::Line { .. } if (1..PHASES).contains(&phase) => Ok(grid.with_phase(phase)),
        _ => Err(CodecError::invalid("phase", phase, "1 to 15, of a grid of cells on a line")),
    }
}

fn check_rows(rows: usize, others: &[&[f64]]) -> Result<(), ArgumentError> {
    match others.iter().find(|other| other.len() != rows) {
        Some(other) => Err(ArgumentError::new("others", other.len(), format!("{rows} rows"))),
        None => Ok(()),
    }
}
