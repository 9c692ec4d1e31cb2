//! Frames for a link that may lose, repeat and reorder them. A frame contains one block, or a piece of the header.
//!
//! [`FrameWriter`] converts rows to frames and [`FrameReader`] frames to rows; neither uses a socket or a clock. [`HeaderRepeats`] says when
//! pieces of the header are sent between the frames, so that a reader that lost one, or began later, needs to wait a few frames only.
//! The reader needs each piece of the header once, in any order. Frames that arrive before the header is complete are kept, up to a limit.
//! A frame that arrives twice gives its rows once. Pieces state how many frames were sent before them, so a reader counts those that did
//! not arrive.
//!
//! ```text
//! frame    := block | piece
//! piece    := 0, kind `P`, length varint, content, CRC-32 of 0, 0, 0, 0 and all of it
//! content  := header's checksum (4 bytes), number of pieces - 1, number of this piece, frames before it (varint), bytes
//! ```
//!
//! A frame of few bytes may hold many rows, so a header whose blocks may have more than 2^17 cells is refused: a stranger's datagrams then
//! never demand more than some megabytes.

mod piece;
mod reader;
mod repeats;
mod writer;

pub use reader::FrameReader;
pub use repeats::HeaderRepeats;
pub use writer::{FrameWriter, MIN_FRAME_BYTES};

/// Largest number of pieces of a header.
const MAX_PIECES: usize = 256;
/// Largest number of cells, times included, of a frame.
const MAX_CELLS: usize = 1 << 17;

/// Largest number of rows of a frame with this number of columns.
fn max_rows(columns: usize) -> usize {
    (MAX_CELLS / (columns + 1)).max(1)
}
