//! The papers' experiments as functions: parameters in, rows out, with the claims that the rows must meet.
//!
//! A figure is a type that implements [`Figure`]: an id and a caption; a struct of parameters whose default is the paper's
//! setting and whose fields carry their documentation and ranges; rows whose fields *are* the columns; [`Claims`] and a
//! [`Plot`](fewbits_plot::Plot) over these rows. From the two structs follow `describe`, the refusal of wrong settings before any work, and
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
mod picture;
mod prelude;
pub mod problems;
pub mod real;
pub mod reference;
pub mod schema;
mod sweep;
pub mod targets;
mod words;

#[doc(hidden)]
pub use arguments::Limits;
pub use arguments::{Argument, Cost, Parameter, Quick, Refusal, plain};
pub use claim::{Claim, Claims, Expected, Verdict};
pub use error::Error;
/// Plots as data.
pub use fewbits_plot as plot;
pub use figure::{About, AnyFigure, Context, Figure, Outcome, Run};
pub use kept::Kept;
pub use measured::Measured;
pub use picture::plotted;
pub use schema::{Column, Table, Value};

/// The ids of all figures, in their order.
pub fn ids() -> Vec<&'static str> {
    all().iter().map(|figure| figure.about().id).collect()
}

macro_rules! figures {
    ($($system:ident: $($module:ident::$figure:ident),+;)+) => {
        /// Every figure and table, in the order of the publications.
        pub fn all() -> Vec<&'static dyn AnyFigure> {
            vec![$($(&$system::$module::$figure),+),+]
        }
    };
}

figures! {
    dymbo: fig3::KalmanVariance, fig4::Loss, fig5::Convergence, prop1b::PosteriorShape, prop2::FirstMessage,
        threshold::ThresholdPlace, gap::GapToExact, bits::WordLength, selftuning::SelfTuning;
    mi: iterations::FIGURE42, iterations::FIGURE43, table4_1::Table41, table4_2::Table42, table4_3::Table43,
        table4_4::Table44, table4_5::Table45, table4_5::Mismatch, iterations::FIGURE44, iterations::FIGURE45;
    binary: patterns::Clipping, patterns::NATURAL, patterns::GRAY, patterns::EXTRA, patterns::Response,
        crlb::PrintedBounds, table5_1::Table, optimum::Optimum, decoders::Decoders, gaussian::GaussianSource,
        table5_2::Table, feedback::Feedback;
    assign: shapes::Landings, table6_1::Table, networks::SPREAD, networks::MEAN, shapes::BitErrors;
    cfwmd: scalar::FIG1, scalar::FIG2, no_feedback::FIG3, vector::FIG4, vector::FIG5, vector::FIG6, field::Fig7,
        field::FIG8, field::FIG9, field::FIG10, scalar::TABLE1, vector::TABLE2, field::TABLE3, beyond::LOSSY,
        beyond::SCHEDULED, no_feedback::NO_FEEDBACK;
    diffusive: route::Trace, route::Route, chains::FIG3, chains::FIG4, beliefs::FIG5, beliefs::FIG6, chains::FIG7,
        chains::FIG8, chains::FIG9, chains::FIG10, table1::Table1, bytes::Bytes, envelope::Envelope,
        unknowns::Unknowns, rooms::Rooms, ranks::Ranks;
    handoff: fig2::Fig2, fig3::Fig3, fig4::Fig4, fig5::Fig5, fig6::FIG6A, fig6::FIG6B, fig6c::Fig6c,
        reduction::Reductions, rate::Rate;
    network: frontier::Frontier, faults::Faulty;
    real: bits::Bits, packets::Packets, loss::Loss, codecs::Codecs;
    mpa: fig3_3::Fig33, sweeps::Mse, sweeps::Fig34, sweeps::Fig35, sweeps::Low, association::Fig37,
        association::Table, ablation::Ablation, bound::Bounds, encoder::Encoders, leader::Leaders;
    problems: filters::Filters, bussgang::Bussgang;
    targets: gospa::Targets;
}
