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
//! | second | 1 | bit 0: exceptions; bit 1: steps; bit 2: anchor; bit 3: phase; bit 4: decimals are rounded to single precision; bit 5: pco is in its wrapped form; bit 6: counts, or the list of levels, are followed by tables that learn (read only); bit 7: stored tables are in place of the counts, or follow the list of levels (levels of samples have a second byte only with one of these) |
//! | steps | 2 varints | unit and origin (zigzag) in units of the last decimal |
//! | anchor | 8 | a point of the line, little-endian; otherwise zero is one |
//! | phase | 1 | the grid of a line, or of cells of several decimals, is moved by so many sixteenths of a cell (1 to 15; whole decimals, rounded up) |
//! | exceptions | varints and 8 each | number; rows since the last one; the sample |
//! | sections | the rest | in place of all others behind the bytes 8f c0, module `sections`: rows whose kind changes, written with [`Effort::Fast`] |
//! | indices | the rest | models: 6 bits length (48 more if contexts have the lengths of rests: of blocks of 1024 rows or more, where the length is below 16) and as many bits of the first index (zigzag), then decisions (`model.rs`), all arithmetic coded; counts: the same with a bit behind the first index (1: differences of differences) and other decisions (`counts.rs`); tables: module `stored`, or `learned`; levels: module `levels`; pco: its standalone or, as written since version 6 of recordings, its wrapped format with one chunk and one page |
//!
//! There is no checksum, no length and no number of rows: the container must store all three. An arithmetic code has no redundancy, so most
//! truncated or damaged blocks decode to wrong samples. Trailing bytes are detected and refused (behind tables, from eight on, nearly always).

pub mod arithmetic;
pub mod bytes;
mod counts;
mod decode;
mod encode;
mod error;
mod experts;
mod fast;
pub mod frame;
mod grid;
mod groups;
mod head;
mod indices;
mod lanes;
mod learned;
mod levels;
mod mixer;
mod model;
mod plain;
mod priors;
mod rows;
mod sections;
mod start;
mod stored;
mod vectors;

pub use error::{ArgumentError, Damaged, Error};
pub use rows::JOINT_COLUMNS;
pub use start::{Start, StartedBlock};

/// How much computing time the writer may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Effort {
    /// Mixed models, and pco if the bound is fine: the fewest bits.
    #[default]
    Thorough,
    /// Counts in few contexts, tables of symbols from 1024 rows on, a list of levels, or pco: one of them, chosen by an estimate from a part of
    /// the rows. Faster, with more bits (`docs/adaptive.md` has both).
    Fast,
}

/// Largest number of cells of a circle.
const MOST_CELLS: f64 = (1_u64 << 40) as f64;

/// Writes and reads blocks. Both ends must use the same accuracy; [`Effort`] matters only to the writer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockCodec {
    /// The error bound of finite samples; zero if they are exact.
    delta: f64,
    /// Circumference of the circle, of a codec with a bound.
    period: Option<f64>,
    effort: Effort,
}

impl BlockCodec {
    /// A codec that returns every finite sample within `bound`, in the units of the samples.
    ///
    /// # Errors
    /// If `bound` is not above 0 or `2 bound` not finite.
    pub fn new(bound: f64) -> Result<Self, Error> {
        ArgumentError::positive("bound", bound)?;
        ensure!((2.0 * bound).is_finite(), "bound", bound, "a number whose double is finite");
        Ok(Self {
            delta: bound,
            ..Self::lossless()
        })
    }

    /// The same codec for samples on a circle: they are taken modulo `period` (360 for degrees), values lie in `[0, period)`, and the
    /// bound holds around the circle. No effect on a lossless codec.
    ///
    /// # Errors
    /// If `period` is not positive and finite, or above `2^40` times the bound.
    pub fn on_circle(mut self, period: f64) -> Result<Self, Error> {
        ArgumentError::positive("period", period)?;
        if !self.is_lossless() {
            ensure!(period / self.delta <= MOST_CELLS, "period", period, "at most 2^40 times the bound");
            self.period = Some(period);
        }
        Ok(self)
    }

    /// A codec that returns every sample to the last bit.
    pub fn lossless() -> Self {
        Self {
            delta: 0.0,
            period: None,
            effort: Effort::default(),
        }
    }

    /// The same codec with another effort.
    #[must_use]
    pub fn with_effort(self, effort: Effort) -> Self {
        Self { effort, ..self }
    }

    fn is_lossless(&self) -> bool {
        self.delta == 0.0
    }
}
