//! What a person does with a table of sensor values, as functions: look, state bounds, plan, pack, unpack, verify, design.
//!
//! The command line, Python and the page call the same functions, so that the same table gives the same bytes in all three. A recipe
//! takes rows from a [`Source`] in batches, reports its [`Progress`] to a callback between batches, and stops when the callback breaks.
//!
//! ```
//! use fewbits_record::{Recorder, Schema, TimeBase};
//! use fewbits_recipes::{Batch, bounds, names, pack, plan, source::Columns, verify};
//! use std::io::Cursor;
//! use std::ops::ControlFlow;
//!
//! let table = names::list("temp,\"flow, l/min\"")?;
//! let cells = |f: fn(f64) -> f64| (0..2000).map(|i| Some(f(0.01 * f64::from(i)))).collect::<Vec<_>>();
//! let batch = Batch { ticks: None, columns: vec![cells(f64::sin), cells(f64::cos)] };
//! let mut go = |_| ControlFlow::Continue(());
//!
//! // Bits per sample at several bounds.
//! let planned = plan::plan(&table, &batch, TimeBase::Numbered, 512, &mut go)?;
//! assert!(planned.columns[0].lossless_bits > planned.columns[0].bounds[6].2);
//!
//! // A bound for one column; all others are lossless.
//! let specs = bounds::parse("temp=±0.1", &table)?;
//! let schema = Schema::new(bounds::columns(&table, &specs, &[None, None])?, TimeBase::Numbered)?;
//! let mut recorder = Recorder::new(Vec::new(), schema);
//! let mut source = Columns::new(batch.clone());
//! assert_eq!(pack::fill(&mut source, &mut recorder, &mut go)?, 2000);
//! let bytes = recorder.finish()?;
//!
//! let mut playback = fewbits_record::Playback::new(Cursor::new(bytes))?;
//! let verdict = verify::verify(&mut playback, &mut Columns::new(batch), &[0, 1], &mut go)?;
//! assert!(verdict.holds && verdict.rows == 2000);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | part | where |
//! |---|---|
//! | rows in batches | [`Source`], [`Batch`] |
//! | how a table is understood | [`look`] |
//! | a table as rows: ticks, cells as doubles, units | [`table`], [`times`], [`words`] |
//! | lists of names, quoted where they contain commas | [`names`] |
//! | bounds and their language | [`bounds`] |
//! | bits that a table would need | [`plan`] |
//! | rows into a recording | [`pack`] |
//! | rows out of a recording | [`unpack`] |
//! | a recording against its table | [`verify`] |
//! | quantizers for an unknown that several sensors measure | [`design`] |
//!
//! Not here: files, printing and options (`fewbits-cli`), the format (`fewbits-record`), how values are predicted and coded
//! (`fewbits-adaptive`).

pub mod bounds;
pub mod design;
mod error;
pub mod look;
pub mod names;
pub mod pack;
pub mod plan;
pub mod source;
pub mod table;
pub mod times;
pub mod unpack;
pub mod verify;
pub mod words;

pub use error::{Error, Failure};
pub use source::{Batch, Progress, Source, Watch};
