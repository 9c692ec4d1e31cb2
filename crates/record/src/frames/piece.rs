//! A piece of the header as a frame.

use crate::error::{Damage, ensure};
use crate::wire::{Bytes, Fields, checksum, read_checked, written};

const PIECE: u8 = b'P';
/// Largest number of bytes of a piece in addition to its part of the header: kind, length and checksum, head, and the number of frames.
pub(super) const PIECE_OVERHEAD: usize = 2 + 3 + 4 + 6 + MAX_COUNT_BYTES;
/// Bytes of the largest number of frames that a piece states, 2^35 - 1.
const MAX_COUNT_BYTES: usize = 5;
const MAX_COUNT: u64 = (1 << 35) - 1;

/// A piece of a header.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
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
    /// The fields in front of its bytes; a reader may be given any.
    fn code<F: Fields>(self, fields: &mut F) -> Result<Self, Damage> {
        let check = u32::from_le_bytes(fields.bytes(self.check.to_le_bytes())?);
        let [last, number] = fields.bytes([self.last, self.number])?;
        ensure!(number <= last, Damage::Content("number of a piece"));
        let frames = fields.varint(self.frames.min(MAX_COUNT))?;
        ensure!(frames <= MAX_COUNT, Damage::Content("number of frames"));
        Ok(Self {
            check,
            last,
            number,
            frames,
            ..self
        })
    }

    pub(super) fn to_frame(self) -> Vec<u8> {
        let content = written(|fields| self.code(fields));
        crate::index::special(0, PIECE, &[&content, self.bytes].concat())
    }

    pub(super) fn is_one(frame: &[u8]) -> bool {
        frame.first() == Some(&0)
    }

    pub(super) fn of_frame(frame: &'a [u8]) -> Result<Self, Damage> {
        ensure!(frame.get(1) == Some(&PIECE), Damage::NoBlock);
        // The receiver of a piece has no header yet, so the checksum covers zeros in place of the header's.
        let (content, whole) = read_checked(frame, 2, 0..=frame.len(), |bytes| checksum(&[&[0; 4], bytes]))?;
        ensure!(whole == frame.len(), Damage::Content("length"));
        let mut content = Bytes(content);
        let piece = Self::default().code(&mut content)?;
        Ok(Self {
            bytes: content.0,
            ..piece
        })
    }
}
