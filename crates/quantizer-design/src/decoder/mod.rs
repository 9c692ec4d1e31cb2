//! Decoders at the fusion centre: estimates and tests.

mod mmse;
mod neyman_pearson;

pub use mmse::{Estimate, MmseDecoder};
pub use neyman_pearson::NeymanPearson;
