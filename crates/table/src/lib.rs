//! Tables as loggers write them, read into columns of numbers, words and times.
//!
//! ```
//! use fewbits_table::{Batch, Cells, Dialect, Table};
//!
//! let text = "sep=;\nDatum;Zeit;Temp;Tür\n14.11.2023;9:42;19,75;auf\n14.11.2023;9:52;---;zu\n";
//! let mut table = Table::open(text.as_bytes(), &Dialect::default())?;
//! assert_eq!(table.dialect().as_options(), "--delimiter ';' --quote '\"' --comment '#' --skip 1 --decimal ,");
//! table.set_time(&["Datum", "Zeit"])?;
//!
//! let mut batch = Batch::default();
//! assert_eq!(table.read(&mut batch, 1000)?, 2);
//! assert_eq!(batch.columns[0], Cells::Numbers(vec![Some(19.75), None]));
//! assert_eq!(batch.columns[1], Cells::Words(vec![Some(0), Some(1)]));
//! assert_eq!(table.words(3), ["auf", "zu"]);
//! let (_, scale) = table.time().ok_or("no time")?;
//! assert_eq!(batch.times[1].shown(scale, 0), "2023-11-14T09:52:00"); // a local time: no zone is stated
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! **Detected, shown, said.** What is not said of the [`Dialect`] is detected from the first lines: what separates cells, lines before and
//! behind the names, units, decimal commas, formats of loggers (TOA5, HOBO, RDB, EPW, annotated CSV). The whole can be shown as options
//! ([`Dialect::as_options`]), stored ([`Dialect::to_toml`]) and said instead. Where two readings are possible, as of `1/2/2023`, the table
//! is refused with the option that decides.
//!
//! **Exact or refused.** A number is the double nearest to its text, a whole number is itself ([`Kind::Integer`] beyond doubles), a time has
//! all its decimals ([`Time`]: 18 of them, leap seconds are refused). `1e400` is no infinity, and `23:59:60` no other second.
//!
//! **One bad line costs one line.** Errors say the file's own line, the row, the column and the cell, and what would mend it.
//! [`Dialect::skip_bad`] leaves so many out; [`Table::skipped`] counts and names them. Memory is bounded, whatever a line holds.
//!
//! | part | where |
//! |---|---|
//! | reading in batches of columns | [`Table`], [`Batch`], [`Cells`] |
//! | how a table is written | [`Dialect`] |
//! | a row per reading, made a column per sensor | [`Table::widened`] |
//! | what is in it: kinds, ranges, gaps by spelling, sentinels, steps of time | [`Table::survey`], [`Profile`] |
//! | lists of names in options | [`names`] |
//!
//! The features `gzip` and `zstd` read packed text, `parquet` reads Parquet through Arrow arrays (`Table::open_parquet`). Without features the
//! crate builds for WebAssembly; it opens no files. Not here: files and options (`fewbits-cli`), recordings (`fewbits-record`), estimation.

mod above;
#[cfg(feature = "parquet")]
mod arrow;
mod calendar;
mod cell;
mod civil;
mod clock;
mod codes;
mod column;
mod days;
mod delimiter;
mod detect;
mod dialect;
mod doubts;
mod early;
mod ends;
mod error;
mod extent;
mod framed;
mod guess;
mod head;
mod hint;
mod influx;
mod interval;
mod json;
mod known;
mod labelled;
mod limits;
mod lines;
mod logs;
mod marks;
mod missing;
mod named;
pub mod names;
mod number;
mod open;
#[cfg(feature = "parquet")]
mod parquet;
mod parts;
mod plain;
mod profile;
mod quick;
mod read;
mod readings;
mod rows;
mod sample;
mod seen;
mod source;
mod stated;
mod survey;
mod table;
mod time;
mod timing;
mod wide;
mod worded;
mod words;
mod written;
mod zones;

pub use column::{Batch, Cells, Column, Kind, MAX_WORDS, Side};
pub use dialect::Dialect;
pub use ends::Sentinel;
pub use error::{Error, Place, printable};
pub use extent::FewCells;
pub use profile::Profile;
pub use readings::Readings;
pub use survey::{Survey, Times};
pub use table::{Skipped, Table};
pub use time::{DECIMALS, Scale, Time, Unit};
