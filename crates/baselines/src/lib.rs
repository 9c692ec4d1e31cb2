//! Printed variants of the papers' algorithms, and other people's algorithms, with which figures and tests compare.
//!
//! Nothing here is what a user needs: the crates below have the recommended algorithms. The crate is not published and promises
//! nothing of its names.
//!
//! | module | compares |
//! |---|---|
//! | [`binary_patterns`] | other ways to send one bit per sensor, bounds of all of them, and substitutes for a search |
//! | [`bussgang`] | signs of several sensors, by the linear estimator |
//! | [`cfwmd`] | silence ignored, a random trigger, and withheld measurements imputed; the information of a message or of silence |
//! | [`diffusive`] | polynomial Gaussians, particles and Laplace as messages; Tierney and Kadane's ratios, and cumulants |
//! | [`dymbo`] | the exact error of every scalar filter; how normal the posterior of one bit is; successive bits of one sample |
//! | [`handoff`] | bounds of the error after several hand-overs |
//! | [`mixture_codec`] | the paper's reductions |
//! | [`over_bits`] | published estimators of identical sensors, slot by slot, as receivers of `fewbits-protocol` |
//! | [`pf_mpa`] | particle message passing, as published and with its errata corrected |
//! | [`quantizer_design`] | algorithms of the publications for one sensor, and every assignment of words |
//! | [`sensor_assignment`] | all assignments, the most precise sensor for the coarsest bit, and noise of given moments |

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub mod binary_patterns;
pub mod bussgang;
pub mod cfwmd;
pub mod diffusive;
pub mod dymbo;
pub mod handoff;
pub mod mixture_codec;
pub mod over_bits;
pub mod pf_mpa;
pub mod quantizer_design;
pub mod sensor_assignment;
