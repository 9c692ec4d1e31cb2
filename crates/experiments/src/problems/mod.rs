//! Twelve problems with curved models and reports of two bits, for every filter of the contract.

pub(crate) mod bussgang;
pub(crate) mod filters;
mod models;
mod settings;
