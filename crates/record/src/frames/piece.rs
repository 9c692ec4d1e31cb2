//! A piece of the header as a frame.

use crate::error::{Damage, ensure};
use crate::wire::{Bytes, push_varint, read_checked};

const PIECE: u8 = b'P';
/// Largest number of bytes of a piece in addition to its part of the header: kind, length and checksum, head, and the number of frames.
pub(super) const PIECE_OVERHEAD: usize = 2 + 3 + 4 + 6 + MAX_COUNT_BYTES;
/// Bytes of the largest number of frames that a piece states, 2^35 - 1.
const MAX_COUNT_BYTES: usize = 5;
const MAX_COUNT: u64 = (1 << 35) - 1;

/// A piece of a header.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Piece<'a> {
    /// The header's checksum.
    pub(super) check: u32,
    /// Number of the last piece, counted from 0.
    pub(super) last: u8,
    pub(super) number: u8,
    /// Number of frames that were sent before.
    pub(super) frames: u64,
    pub(super) bytes: &'a [u8],
}

impl<'a> Piece<'a> {
    pub(super) fn to_frame(self) -> Vec<u8> {
        let mut content = self.check.to_le_bytes().to_vec();
        content.extend([self.last, self.number]);
        push_varint(&mut content, self.frames.min(MAX_COUNT));
        content.extend_from_slice(self.bytes);
        crate::index::special(0, PIECE, &content)
    }

    pub(super) fn is_one(frame: &[u8]) -> bool {
        frame.first() == Some(&0)
    }

    pub(super) fn of_frame(frame: &'a [u8]) -> Result<Self, Damage> {
        ensure!(frame.get(1) == Some(&PIECE), Damage::NoBlock);
        // The receiver of a piece has no header yet, so the checksum covers zeros in place of the header's.
        let (content, whole) = read_checked(0, frame, 2, 0..=frame.len())?;
        ensure!(whole == frame.len(), Damage::Content("length"));
        let mut content = Bytes(content);
        let check = u32::from_le_bytes(content.array()?);
        let [last, number] = content.array()?;
        ensure!(number <= last, Damage::Content("number of a piece"));
        let frames = content.varint()?;
        ensure!(frames <= MAX_COUNT, Damage::Content("number of frames"));
        let bytes = content.0;
        Ok(Self {
            check,
            last,
            number,
            frames,
            bytes,
        })
    }
}
