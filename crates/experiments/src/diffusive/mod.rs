//! A diffusive source, found by a belief that walks the network: figures and tables.

pub(crate) mod beliefs;
mod building;
pub(crate) mod bytes;
mod chain_claims;
pub(crate) mod chains;
mod common;
pub(crate) mod envelope;
mod plan_belief;
pub(crate) mod ranks;
pub(crate) mod rooms;
pub(crate) mod route;
mod summary;
pub(crate) mod table1;
pub(crate) mod unknowns;
