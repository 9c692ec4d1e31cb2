//! The checksum of any stretch of a buffer in time that does not depend on its length.
//!
//! After damage a reader asks at every byte whether a record with a right checksum begins there. A record's stated length may be as long
//! as the file, so checksums over the bytes themselves would take time quadratic in the damaged bytes. A CRC is linear: that of a stretch
//! follows from those of the two prefixes at its ends.

use crc32fast::Hasher;

/// Checksums of each prefix of a buffer.
#[derive(Debug, Default)]
pub(crate) struct Prefixes(Vec<u32>);

impl Prefixes {
    /// Covers all of the buffer; known prefixes are kept.
    pub(crate) fn extend(&mut self, buffer: &[u8]) {
        if self.0.is_empty() {
            self.0.push(0);
        }
        let mut sum = Hasher::new_with_initial(self.0.last().copied().unwrap_or(0));
        self.0.reserve(buffer.len() + 1 - self.0.len());
        for byte in &buffer[self.0.len() - 1..] {
            sum.update(&[*byte]);
            self.0.push(sum.clone().finalize());
        }
    }

    /// Forgets the prefixes of the first bytes, which left the buffer.
    pub(crate) fn forget(&mut self, bytes: usize) {
        self.0.drain(..bytes.min(self.0.len()));
    }

    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    /// The checksum of `before` (itself given by its checksum) and the bytes from `start` to `end`; `None` beyond what is covered.
    pub(crate) fn checksum(&self, before: u32, start: usize, end: usize) -> Option<u32> {
        let (first, last) = (self.0.get(start)?, self.0.get(end)?);
        // The stretch behind `before` differs from the stretch behind the first prefix as far as these two do.
        let mut sum = Hasher::new_with_initial(before ^ first);
        sum.combine(&Hasher::new_with_initial_len(*last, end.checked_sub(start)? as u64));
        Some(sum.finalize())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::checksum;

    #[test]
    fn stretches_have_the_checksum_of_their_bytes() {
        let bytes: Vec<u8> = (0..3000_u32)
            .map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8)
            .collect();
        let mut prefixes = Prefixes::default();
        prefixes.extend(&bytes[..1000]);
        prefixes.extend(&bytes);
        let before = checksum(&[b"before"]);
        for (start, end) in [(0, 0), (0, 1), (0, 3000), (5, 6), (17, 1999), (999, 1001), (2999, 3000)] {
            let expected = checksum(&[b"before", &bytes[start..end]]);
            assert_eq!(prefixes.checksum(before, start, end), Some(expected), "{start} {end}");
        }
        prefixes.forget(100);
        assert_eq!(prefixes.checksum(before, 5, 50), Some(checksum(&[b"before", &bytes[105..150]])));
        assert_eq!(prefixes.checksum(before, 5, 3000), None);
    }
}
