//! The papers' experiments as functions: configuration in, tables out, with the claims that the tables must meet.
//!
//! A figure is a type that implements [`Figure`]: an id, a caption, a serde struct of parameters whose default is the
//! paper's setting, a `run` that fills [`Tables`], [`Claim`]s over them and a [`Plot`](plot::Plot) as data. [`all`] lists every one; `cargo xtask
//! figures` runs them, writes CSV, JSON and SVG, and fails where a claim fails.
//!
//! The central choice is that a figure is judged by its claims and not by its looks: each statement of the paper about it,
//! corrected where the paper errs, is code. The cost is that every figure needs an expected value from elsewhere.
//!
//! ```
//! use fewbits_experiments::plot::{Axis, Layer, Panel, Plot};
//! use fewbits_experiments::{column, row, About, AnyFigure, Claim, Context, Error, Figure, Table, Tables};
//! use serde::{Deserialize, Serialize};
//!
//! #[derive(Serialize, Deserialize)]
//! #[serde(deny_unknown_fields)]
//! struct Squares { up_to: u64 }
//! impl Default for Squares {
//!     fn default() -> Self { Self { up_to: 4 } }
//! }
//!
//! struct Demo;
//! impl Figure for Demo {
//!     type Parameters = Squares;
//!     fn about(&self) -> About {
//!         About { id: "demo-fig1", title: "Squares", caption: "n against its square.", source: "" }
//!     }
//!     fn run(&self, p: &Squares, _: &Context<'_>) -> Result<Tables, Error> {
//!         let mut table = Table::new([column("n", "", "a number"), column("square", "", "its square")]);
//!         for n in 0..=p.up_to {
//!             table.push(row![n, (n * n) as f64])?;
//!         }
//!         Ok(table.into())
//!     }
//!     fn claims(&self, _: &Squares, tables: &Tables) -> Result<Vec<Claim>, Error> {
//!         let squares = tables.main.numbers("square")?;
//!         Ok(vec![Claim::near("last", "four squared is sixteen", squares[squares.len() - 1], 16.0, 0.0).at_defaults()])
//!     }
//!     fn plot(&self, _: &Squares, tables: &Tables) -> Result<Plot, Error> {
//!         Ok(Plot::of(Panel::new("Squares", Axis::linear("n"), Axis::linear("n^2"))
//!             .with(Layer::line("n^2", tables.main.points("n", "square")?))))
//!     }
//! }
//!
//! let parameters = Demo.configure(&[("up_to".into(), "5".into())], false)?;
//! let outcome = Demo.produce(&parameters, &Context::new(1))?;
//! assert_eq!(outcome.tables.main.len(), 6);
//! assert!(Demo.configure(&[("upto".into(), "5".into())], false).is_err());
//! # Ok::<(), Error>(())
//! ```
//!
//! Not here: printing, files, the command line, drawing.

pub mod assign;
pub mod binary;
pub mod cfwmd;
pub mod claim;
pub mod dymbo;
mod error;
mod figure;
pub mod mi;
pub mod plot;
mod table;

pub use claim::{Claim, Expected, Verdict};
pub use error::Error;
pub use figure::{About, AnyFigure, Context, Figure, Outcome};
pub use table::{Column, Table, Tables, Value, column};

/// Every figure and table, in the order of the publications.
pub fn all() -> Vec<&'static dyn AnyFigure> {
    [
        dymbo::figures(),
        mi::figures(),
        binary::figures(),
        assign::figures(),
        cfwmd::figures(),
    ]
    .concat()
}
