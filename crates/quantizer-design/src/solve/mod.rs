//! Designs on request: who measures what, how many bits each may send, over which links, and to what end.
//!
//! [`Request`] takes the question and [`Solutions`] holds the answers, best first. A [`Solution`] has the cells and the words of
//! every sensor, its value, a bound, the gap to it, and a certificate; it leaves the library as thresholds of an
//! analogue-to-digital converter ([`Adc`]), tables, JSON, a C header or Rust constants ([`Export`]). [`Mismatch`] and
//! [`minimax`] are about priors and noise that are not known exactly.
//!
//! | file | what it holds |
//! |---|---|
//! | `request`, `solution` | question and answer |
//! | `pipeline`, `control` | from the question to the answer; time limit and progress |
//! | `participant`, `landscape` | sensors with cells and words; the criterion on grids |
//! | `search`, `starts` | cells and words searched together; from which starts |
//! | `polish`, `share` | Newton's method; shares of a total |
//! | `adc`, `export`, `additive` | what leaves the library |
//! | `robust` | other models than the one of the design |
//!
//! Cells and words are searched together because over a link that inverts bits neither can be chosen first: which cells are
//! worth having depends on which words are confused, and behind a poor link some words are better not used. Newton's method
//! alone meets that as a cell that vanishes. Here the cells of a grid are given to words, so that a cell without use is
//! merged by the way.

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

pub use adc::{Adc, Rounded};
pub use additive::AdditiveDecoder;
pub use control::{Progress, Stage};
pub use export::{Export, JSON_SCHEMA};
pub use request::{BitBudget, MAX_BITS, Request};
pub use robust::{Minimax, Mismatch, Sensitivity, minimax};
pub use solution::{Bound, BoundKind, SensorDesign, Solution, Solutions};
