//! Comparisons of the publications that no filter needs.
//!
//! | comparison | module |
//! |---|---|
//! | the posterior of one bit beside the normal density of its moments (Proposition 1b) | [`skew_normal`] |
//! | successive bits about one sample beside one word | [`iterated`] |

pub mod iterated;
pub mod skew_normal;
