//! Algorithms of the publications, for reproducing their tables, and searches with which a request is compared. To design
//! quantizers, use [`Request`](fewbits_quantizer_design::Request).
//!
//! | item | source |
//! |---|---|
//! | [`alternate`], [`alternating_step`] | Algorithm 7: one sensor, with its stop rule corrected |
//! | [`best_contiguous`] | the best intervals of one sensor on a grid, by dynamic programming |
//! | [`greedy`] | section 4.4: one sensor after the other |
//! | [`separate`], [`Separation`] | quantizers with the largest distance between two hypotheses (Poor and Thomas) |
//! | [`assign_words`] | Table 4.5 for every assignment of words |
//! | [`multi_start`] | the best of joint designs from random starts |
//! | [`NeymanPearson`] | the most powerful test between two values |
//! | [`bayesian_cramer_rao`] | the van Trees bound of given quantizers, with a constant weight |
//! | [`symmetry_breaking`] | the noise at which equal quantizers stop being an optimum |

mod alternating;
mod dynamic_programme;
mod fisher;
mod gains;
mod greedy;
mod index_assignment;
mod neyman_pearson;
mod separation;
mod starts;
mod symmetry;

pub use alternating::{Alternated, Alternating, alternate, alternating_step};
pub use dynamic_programme::best_contiguous;
pub use fisher::{bayesian_cramer_rao, mean_fisher_information};
pub use greedy::greedy;
pub use index_assignment::{Words, WordsDesign, assign_words};
pub use neyman_pearson::NeymanPearson;
pub use separation::{Separation, separate};
pub use starts::{multi_start, random_starts};
pub use symmetry::symmetry_breaking;
