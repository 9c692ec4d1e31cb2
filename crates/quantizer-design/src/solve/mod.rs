//! Design of quantizers from a description of the problem: the sensors, the bits of each, the links, and the criterion.
//!
//! [`Request`] is the problem and [`Solutions`] the results, best first. A [`Solution`] has the cells and words of
//! every sensor, the value of the criterion, a bound, the gap to it, and a certificate. It can be exported as thresholds of an
//! analogue-to-digital converter ([`Adc`]), tables, JSON, a C header or Rust constants ([`Export`]). [`Mismatch`] and
//! [`minimax`] are for priors and noise that are not known exactly.
//!
//! | file | contents |
//! |---|---|
//! | `request`, `solution` | problem and result |
//! | `pipeline`, `control` | the steps of a design; time limit and progress |
//! | `participant`, `landscape` | sensors with cells and words; the criterion on grids |
//! | `search`, `starts` | joint search of cells and words; its starts |
//! | `polish`, `share` | Newton's method; distribution of a total number of bits |
//! | `adc`, `export`, `additive` | export |
//! | `robust` | models that differ from that of the design |
//!
//! Cells and words are searched together, since over a link that inverts bits neither can be chosen first: the best cells
//! depend on which words are confused, and with a poor link some words should not be used. In Newton's method
//! alone such a word appears as a cell that becomes empty. Here the cells of a grid are assigned to words, so a cell without use is
//! merged with a neighbour.

mod adc;
mod additive;
mod control;
mod export;
mod landscape;
mod participant;
mod pipeline;
mod polish;
mod request;
mod robust;
mod search;
mod share;
mod solution;
mod starts;

pub use crate::deadline::Clock;
pub use adc::{Adc, Rounded};
pub use control::{Progress, Stage, Watch};
pub use export::{Export, JSON_SCHEMA};
pub use participant::{SensorDesign, WordedCells};
pub use request::{BitBudget, MAX_BITS, Request};
pub use robust::{Minimax, Mismatch, Sensitivity, minimax};
pub use solution::{Bound, BoundKind, Solution, Solutions};
