//! The papers' experiments as functions: parameters in, rows out, with the claims that the rows must meet.
//!
//! A figure is a type that implements [`Figure`]: an id and a caption; a struct of parameters whose default is the paper's
//! setting and whose fields carry their documentation and ranges; rows whose fields *are* the columns; [`Claims`] and a
//! [`Plot`](plot::Plot) over these rows. From the two structs follow `describe`, the refusal of wrong settings before any work, and
//! the CSV. [`all`] lists every figure; `cargo xtask figures` runs them, writes CSV, JSON and SVG, and fails where a claim fails.
//!
//! The central choice is that a figure is judged by its claims and not by its looks: each statement of the paper about it,
//! corrected where the paper errs, is code. The cost is that every figure needs an expected value from elsewhere; these stand in
//! `references/<system>.csv` and are found by key ([`mod@reference`]). `docs/architecture.md`, "How to add a figure", shows one whole.
//!
//! Not here: printing, files, the command line, drawing.

#[macro_use]
mod fields;

mod arguments;
pub mod assign;
pub mod binary;
pub mod cfwmd;
pub mod claim;
pub mod diffusive;
pub mod dymbo;
mod error;
mod figure;
pub mod handoff;
mod kept;
mod measured;
pub mod mi;
pub mod mpa;
pub mod network;
mod parameters;
pub mod plot;
mod prelude;
pub mod real;
pub mod reference;
pub mod schema;
mod sweep;
mod words;

#[doc(hidden)]
pub use arguments::Limits;
pub use arguments::{Argument, Parameter, Quick, Refusal, plain};
pub use claim::{Claim, Claims, Expected, Verdict};
pub use error::Error;
pub use figure::{About, AnyFigure, Context, Cost, Figure, Outcome};
pub use kept::Kept;
pub use measured::Measured;
pub use schema::{Column, Table, Value};
pub use sweep::Comparison;

/// Every figure and table, in the order of the publications.
pub fn all() -> Vec<&'static dyn AnyFigure> {
    [
        dymbo::figures(),
        mi::figures(),
        binary::figures(),
        assign::figures(),
        cfwmd::figures(),
        diffusive::figures(),
        handoff::figures(),
        network::figures(),
        real::figures(),
        mpa::figures(),
    ]
    .concat()
}
