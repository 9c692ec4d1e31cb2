//! A diffusive source, found by a belief that walks the network: figures and tables.

mod beliefs;
mod building;
mod bytes;
mod chain_claims;
mod chains;
mod common;
mod envelope;
mod plan_belief;
mod rooms;
mod route;
mod summary;
mod table1;
mod unknowns;

use crate::AnyFigure;

/// The figures of this system, in the order of the publication.
pub fn figures() -> Vec<&'static dyn AnyFigure> {
    vec![
        &route::Trace,
        &route::Route,
        &chains::FIG3,
        &chains::FIG4,
        &beliefs::FIG5,
        &beliefs::FIG6,
        &chains::FIG7,
        &chains::FIG8,
        &chains::FIG9,
        &chains::FIG10,
        &table1::Table1,
        &bytes::Bytes,
        &envelope::Envelope,
        &unknowns::Unknowns,
        &rooms::Rooms,
    ]
}
