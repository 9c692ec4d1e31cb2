//! When the pieces of a header are sent.

use super::writer::FrameWriter;
use crate::error::Error;
use fewbits_block_codec::ensure;

/// Whole headers that may be sent in addition to the stated share of the bytes: the first, three more soon after it, and two at the end.
const FREE: usize = 4;
const AT_END: usize = 2;

#[derive(Debug, Clone, Copy)]
enum Pace {
    Share(f64),
    Every(u64),
}

/// Puts pieces of the header between the frames of a link that may lose them.
///
/// ```text
/// before the first frame: the whole header
/// behind each frame:      the next piece, while pieces take no more than their share of the bytes and three headers
/// at the end:             the whole header twice
/// ```
/// A header of `h` bytes takes at most `share * bytes + 6 h` bytes.
#[derive(Debug, Clone)]
pub struct HeaderRepeats {
    pace: Pace,
    /// Number of frames that were sent.
    frames: u64,
    /// Bytes of all frames, and those of pieces.
    bytes: (usize, usize),
    /// Number of the piece that is sent next.
    next: usize,
}

impl HeaderRepeats {
    /// Repeats that take this share of all bytes.
    ///
    /// # Errors
    /// If `share` is not from 0 to 0.5.
    pub fn share(share: f64) -> Result<Self, Error> {
        ensure!((0.0..=0.5).contains(&share), "share of the header", share, "0 to 0.5");
        Ok(Self::new(Pace::Share(share)))
    }

    /// The whole header before every group of so many frames.
    ///
    /// # Errors
    /// If `frames` is 0.
    pub fn every(frames: u64) -> Result<Self, Error> {
        ensure!(frames > 0, "frames between headers", frames, "1 or more");
        Ok(Self::new(Pace::Every(frames)))
    }

    fn new(pace: Pace) -> Self {
        Self {
            pace,
            frames: 0,
            bytes: (0, 0),
            next: 0,
        }
    }

    /// What is sent in place of this frame of the writer: the frame, with pieces before or behind it.
    pub fn around(&mut self, writer: &FrameWriter, frame: Vec<u8>) -> Vec<Vec<u8>> {
        let is_whole = match self.pace {
            Pace::Share(_) => self.frames == 0,
            Pace::Every(every) => self.frames.is_multiple_of(every),
        };
        let mut all = Vec::new();
        if is_whole {
            all = writer.header_frames_after(self.frames);
            self.spend(&all);
        }
        self.bytes.0 += frame.len();
        self.frames += 1;
        all.push(frame);
        if let Pace::Share(share) = self.pace {
            let pieces = writer.header_frames_after(self.frames);
            let header: usize = pieces.iter().map(Vec::len).sum();
            let budget = share * self.bytes.0 as f64 + (FREE * header) as f64;
            if let Some(piece) = pieces.get(self.next % pieces.len().max(1))
                && (self.bytes.1 + piece.len()) as f64 <= budget
            {
                self.spend(std::slice::from_ref(piece));
                self.next = (self.next + 1) % pieces.len();
                all.push(piece.clone());
            }
        }
        all
    }

    /// What is sent after the last frame. A reader then knows how many frames there were.
    pub fn at_end(&mut self, writer: &FrameWriter) -> Vec<Vec<u8>> {
        let whole = writer.header_frames_after(self.frames);
        let all: Vec<_> = std::iter::repeat_n(whole, AT_END).flatten().collect();
        self.spend(&all);
        all
    }

    fn spend(&mut self, pieces: &[Vec<u8>]) {
        let bytes: usize = pieces.iter().map(Vec::len).sum();
        self.bytes.0 += bytes;
        self.bytes.1 += bytes;
    }
}
