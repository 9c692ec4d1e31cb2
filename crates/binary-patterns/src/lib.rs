//! One-bit quantizers at many sensors: patterns, exact decoding, search and bounds.
//!
//! A scalar `X` is seen by `N` sensors in independent normal noise; each sends one bit. The measurement axis is divided into
//! `2^B` cells ([`CellGrid`]) and a sensor's [`Pattern`] says which bit it sends from which cell. Patterns differ between sensors,
//! so that together they tell the cells apart; linear patterns, XORs of the binary digits of the cell's index, are named by
//! masks ([`linear_pattern`]). A [`Bank`] puts sensors and source together and gives everything about them exactly.
//!
//! The central choice is to integrate, not to simulate. Given `X` the bits are independent, so the error of any decoder is a sum
//! over outcomes of one-dimensional integrals, and equal sensors are counted instead of enumerated. A search over thousands
//! of sets then ranks them truly, where a simulation of a thousand trials has six per cent of noise. The cost is the number of
//! outcomes, `prod (m_i + 1)` over groups of equal sensors, limited to `2^26`.
//!
//! ```
//! use fewbits_binary_patterns::search::LinearSearch;
//! use fewbits_binary_patterns::{Decoder, CellGrid, Source, bounds};
//! let source = Source::uniform(1.0)?;
//! let noise = source.noise_deviation(18.2)?;
//! let search = LinearSearch::with_deviation(source, CellGrid::uniform(1.0, 3)?, noise, 8)?;
//! let best = search.best()?;                                   // of 2702 sets
//! assert_eq!(best.masks, [2, 2, 3, 3, 3, 3, 4, 6]);
//! let bank = search.bank(&best.masks)?;
//! assert!(bounds::optimal_weight_van_trees(&bank)? < best.mse);
//! let table = bank.table(Decoder::Mmse)?;                      // what the fusion centre stores
//! assert!(table.estimate(&[true; 8])?.abs() < 1.0);
//! # Ok::<(), fewbits_binary_patterns::Error>(())
//! ```
//!
//! Source: Movaghati, thesis, section 2.3, chapter 5 and appendix B; errata are numbered as in `docs/errata.md`. Searches draw their
//! further starts from fixed streams: the same call gives the same design. Not here: other random
//! numbers, sources that are not symmetric about zero.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod bounds;
mod decoding;
mod observation;
mod patterns;
pub mod published;
pub mod search;

pub use decoding::decoder::Decoder;
pub use decoding::table::LookupTable;
pub use fewbits_quantizers::Error;
pub use observation::bank::{Bank, IMPOSSIBLE};
pub use observation::sensor::PatternSensor;
pub use observation::source::{Nodes, Source, Threshold};
pub use patterns::count;
pub use patterns::grid::CellGrid;
pub use patterns::linear::{Mask, generator_matrix, gray_basis, linear_pattern, mask_of, natural_basis, rank};
pub use patterns::pattern::{Pattern, check_separation};
pub use patterns::quantizer::BinaryQuantizer;
