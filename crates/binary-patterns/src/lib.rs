//! One-bit quantizers at many sensors: patterns, exact decoding, search for good patterns, and error bounds.
//!
//! `N` sensors measure a scalar `X` in independent normal noise; each sends one bit. The measurement axis is divided into
//! `2^B` cells, those of a [`Quantizer`](fewbits_quantizers::Quantizer) ([`uniform_cells`]), and a sensor's [`Pattern`] lists the bit for
//! each cell. Patterns differ between sensors, so that together they distinguish the cells. Linear patterns are XORs of the binary digits
//! of the cell's index and are given by masks ([`linear_pattern`]). A [`Bank`] is a source with its sensors; its errors are computed exactly.
//!
//! Errors are computed by integration, not by simulation. Given `X` the bits are independent, so the error of any decoder is a sum over
//! outcomes of one-dimensional integrals; of equal sensors only the count of ones matters. A search over thousands of sets of patterns then
//! ranks them correctly, while a simulation of a thousand trials has an error of six per cent. The cost is the number of outcomes, `prod
//! (m_i + 1)` over groups of `m_i` equal sensors, limited to `2^26`.
//!
//! ```
//! use fewbits_binary_patterns::search::LinearSearch;
//! use fewbits_binary_patterns::{Source, bounds, uniform_cells};
//! let source = Source::uniform(1.0)?;
//! let noise = source.noise_deviation(18.2)?;
//! let search = LinearSearch::with_deviation(source, uniform_cells(1.0, 3)?, noise, 8)?;
//! let best = search.best()?;                                   // of 2702 sets
//! assert_eq!(best.masks, [2, 2, 3, 3, 3, 3, 4, 6]);
//! let bank = search.bank(&best.masks)?;
//! assert!(bounds::optimal_weight_van_trees(&bank)? < best.mse);
//! let table = bank.table()?;                                    // what the fusion centre stores
//! assert!(table.estimate(&[true; 8])?.abs() < 1.0);
//! # Ok::<(), fewbits_binary_patterns::Error>(())
//! ```
//!
//! Source: Movaghati, thesis, section 2.3, chapter 5 and appendix B; errata are numbered as in `docs/errata.md`. Searches draw
//! additional starts from fixed random streams, so the same call gives the same design. Not in this crate: other random
//! numbers, sources that are not symmetric about zero.

#![cfg_attr(test, allow(clippy::unwrap_used))]

#[doc(hidden)]
pub mod engine;

pub mod bounds;
mod decoding;
mod observation;
mod patterns;
pub mod search;

pub use decoding::table::LookupTable;
pub use fewbits_quantizers::Error;
pub use observation::bank::Bank;
pub use observation::sensor::PatternSensor;
pub use observation::source::{Nodes, Source, Threshold};
pub use patterns::grid::uniform_cells;
pub use patterns::linear::{Mask, gray_basis, linear_pattern, mask_of, natural_basis, rank};
pub use patterns::pattern::Pattern;
pub use patterns::quantizer::BinaryQuantizer;
