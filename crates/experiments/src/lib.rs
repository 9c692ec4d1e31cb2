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

/// Every figure and table, in the order of the publications.
pub fn all() -> Vec<&'static dyn AnyFigure> {
    vec![
        &dymbo::fig3::KalmanVariance,
        &dymbo::fig4::Loss,
        &dymbo::fig5::Convergence,
        &dymbo::prop1b::PosteriorShape,
        &dymbo::prop2::FirstMessage,
        &dymbo::threshold::ThresholdPlace,
        &dymbo::gap::GapToExact,
        &dymbo::bits::WordLength,
        &dymbo::selftuning::SelfTuning,
        &mi::iterations::FIGURE42,
        &mi::iterations::FIGURE43,
        &mi::table4_1::Table41,
        &mi::table4_2::Table42,
        &mi::table4_3::Table43,
        &mi::table4_4::Table44,
        &mi::table4_5::Table45,
        &mi::table4_5::Mismatch,
        &mi::iterations::FIGURE44,
        &mi::iterations::FIGURE45,
        &binary::patterns::Clipping,
        &binary::patterns::NATURAL,
        &binary::patterns::GRAY,
        &binary::patterns::EXTRA,
        &binary::patterns::Response,
        &binary::crlb::PrintedBounds,
        &binary::table5_1::Table,
        &binary::optimum::Optimum,
        &binary::decoders::Decoders,
        &binary::gaussian::GaussianSource,
        &binary::table5_2::Table,
        &binary::feedback::Feedback,
        &assign::shapes::Landings,
        &assign::table6_1::Table,
        &assign::networks::SPREAD,
        &assign::networks::MEAN,
        &assign::shapes::BitErrors,
        &cfwmd::scalar::FIG1,
        &cfwmd::scalar::FIG2,
        &cfwmd::no_feedback::FIG3,
        &cfwmd::vector::FIG4,
        &cfwmd::vector::FIG5,
        &cfwmd::vector::FIG6,
        &cfwmd::field::Fig7,
        &cfwmd::field::FIG8,
        &cfwmd::field::FIG9,
        &cfwmd::field::FIG10,
        &cfwmd::scalar::TABLE1,
        &cfwmd::vector::TABLE2,
        &cfwmd::field::TABLE3,
        &cfwmd::beyond::LOSSY,
        &cfwmd::beyond::SCHEDULED,
        &cfwmd::no_feedback::NO_FEEDBACK,
        &diffusive::route::Trace,
        &diffusive::route::Route,
        &diffusive::chains::FIG3,
        &diffusive::chains::FIG4,
        &diffusive::beliefs::FIG5,
        &diffusive::beliefs::FIG6,
        &diffusive::chains::FIG7,
        &diffusive::chains::FIG8,
        &diffusive::chains::FIG9,
        &diffusive::chains::FIG10,
        &diffusive::table1::Table1,
        &diffusive::bytes::Bytes,
        &diffusive::envelope::Envelope,
        &diffusive::unknowns::Unknowns,
        &diffusive::rooms::Rooms,
        &diffusive::ranks::Ranks,
        &handoff::fig2::Fig2,
        &handoff::fig3::Fig3,
        &handoff::fig4::Fig4,
        &handoff::fig5::Fig5,
        &handoff::fig6::FIG6A,
        &handoff::fig6::FIG6B,
        &handoff::fig6c::Fig6c,
        &handoff::reduction::Reductions,
        &handoff::rate::Rate,
        &network::frontier::Frontier,
        &network::faults::Faulty,
        &real::bits::Bits,
        &real::packets::Packets,
        &real::loss::Loss,
        &real::codecs::Codecs,
        &mpa::fig3_3::Fig33,
        &mpa::sweeps::Mse,
        &mpa::sweeps::Fig34,
        &mpa::sweeps::Fig35,
        &mpa::sweeps::Low,
        &mpa::association::Fig37,
        &mpa::association::Table,
        &mpa::ablation::Ablation,
        &mpa::bound::Bounds,
        &mpa::encoder::Encoders,
        &mpa::leader::Leaders,
        &problems::filters::Filters,
        &problems::bussgang::Bussgang,
        &targets::gospa::Targets,
    ]
}
