//! Recordings of many columns, each within a stated error bound, in blocks that can be read independently.
//!
//! ```
//! use fewbits_record::{Bound, Column, Playback, Recorder, Schema, TimeBase};
//! use std::io::Cursor;
//!
//! let columns = vec![
//!     Column::new("temp", Bound::Absolute(0.1))?.with_unit("degC")?,
//!     Column::new("flow", Bound::ShareOfRange(0.01))?,
//!     Column::new("count", Bound::Lossless)?,
//! ];
//! let mut recorder = Recorder::new(Vec::new(), Schema::new(columns, TimeBase::Numbered)?);
//! for i in 0..2000 {
//!     let angle = 0.01 * f64::from(i);
//!     let flow = (i % 100 != 17).then(|| 40.0 + 9.0 * angle.cos()); // now and then a gap
//!     recorder.push_next(&[Some(20.0 + angle.sin()), flow, Some(f64::from(i / 7))])?;
//! }
//! let bytes = recorder.finish()?;
//! assert!(bytes.len() < 2000 * 24 / 20);
//!
//! let mut playback = Playback::new(Cursor::new(bytes))?;
//! for row in playback.columns(&["count", "temp"])?.range(1000, 1099) {
//!     let row = row?;
//!     let i = row.tick as f64;
//!     assert_eq!(row.values[0], Some((i / 7.0).floor()));
//!     assert!(row.values[1].is_some_and(|temp| (temp - 20.0 - (0.01 * i).sin()).abs() <= 0.1));
//! }
//! # Ok::<(), fewbits_record::Error>(())
//! ```
//!
//! **A block is also a frame.** A block holds 512 rows by default. It needs only the header to be decoded, and
//! its checksum includes the header's. Truncated files, inverted bits, blocks of another recording and frames lost on a link are
//! therefore handled alike: what cannot be read gives an error, and everything else is
//! read. The cost: the models of each block start anew.
//!
//! **Bounds are verified.** The recorder decodes every block that it writes and compares each
//! sample with its restored value in exact arithmetic ([`is_within`]). A sample whose restored value is outside the bound is stored in
//! full. The bound therefore holds for very large and very small numbers too, whatever a codec does.
//!
//! | part | where |
//! |---|---|
//! | columns, error bounds, time | [`Schema`], [`Column`], [`Bound`], [`TimeBase`] |
//! | writing | [`Recorder`] |
//! | reading with random access | [`Playback`] |
//! | reading from front to end, for example from a pipe | [`BlockReader`] |
//! | several recordings as one table | [`merged`] |
//! | a recording under wider bounds | [`Playback::widened`], [`Playback::repack`] |
//! | minimum, maximum and mean over stretches of time | [`Playback::aggregates`] |
//! | frames for a link that loses some | [`FrameWriter`], [`HeaderRepeats`], [`FrameReader`] |
//!
//! Not here: how values are predicted and coded (`fewbits-block-codec`), text formats and the command line (`fewbits-cli`). The format
//! is described byte by byte in `docs/record.md`.

mod aggregate;
mod append;
#[cfg(feature = "arrow")]
pub mod arrow;
mod block;
mod blocks;
mod bound;
mod codec;
mod column;
mod error;
mod frames;
mod header;
mod header_bytes;
mod header_column;
mod index;
mod integers;
mod merged;
mod playback;
mod ranges;
mod recorder;
mod related;
mod repack;
mod resume;
mod rolling;
mod scan;
mod schema;
mod specials;
mod stretches;
mod time;
mod waiting;
mod whole;
mod wire;

pub use aggregate::Aggregate;
pub use block::{Block, Cells};
pub use blocks::{Blocks, Rows};
pub use bound::{Bound, MAX_DECIMALS, MIN_SHARE, is_within, is_within_on_circle};
pub use column::Column;
pub use error::{Damage, Error};
pub use fewbits_block_codec::{ArgumentError, Effort};
pub use frames::{FrameReader, FrameWriter, HeaderRepeats, MIN_FRAME_BYTES};
pub use index::BlockInfo;
pub use integers::Integers;
pub use merged::{Merged, merged};
pub use playback::{Playback, Row};
pub use recorder::Recorder;
pub use scan::BlockReader;
pub use schema::{MAX_CELLS, ROWS_PER_BLOCK, Schema, TimeBase, TimeFormat};
pub use stretches::Stretch;
pub use whole::WholeAggregate;

/// The programs of `docs/record.md`, which are run as tests.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/record.md")]
mod page {}
