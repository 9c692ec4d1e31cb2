//! What the fusion centre does with the symbols: estimate, decide, or test.

mod mmse;
mod neyman_pearson;

pub use mmse::{Estimate, MmseDecoder};
pub use neyman_pearson::NeymanPearson;
