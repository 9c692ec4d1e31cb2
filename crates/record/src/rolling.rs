//! The checksum of any stretch of a buffer in time that does not depend on its length.
//!
//! After damage a reader asks at every byte whether a record with a right checksum begins there. A record's stated length may be as long
//! as the file, so checksums over the bytes themselves would take time quadratic in the damaged bytes. A CRC is linear: that of a stretch
//! follows from those of the two prefixes at its ends.

/// The polynomial of CRC-32/ISO-HDLC, lowest power in the highest bit.
const POLYNOMIAL: u32 = 0xedb8_8320;
/// The polynomial 1.
const ONE: u32 = 1 << 31;

/// The polynomial times x.
const fn times_x(a: u32) -> u32 {
    (a >> 1) ^ if a & 1 == 1 { POLYNOMIAL } else { 0 }
}

const fn product(a: u32, b: u32) -> u32 {
    let (mut sum, mut power, mut bit) = (0, b, 32);
    while bit > 0 {
        bit -= 1;
        if a >> bit & 1 == 1 {
            sum ^= power;
        }
        power = times_x(power);
    }
    sum
}

/// `x^(8 * 2^k)`.
const POWERS: [u32; 40] = {
    let mut powers = [0; 40];
    let mut power = ONE;
    let mut i = 0;
    while i < 8 {
        power = times_x(power);
        i += 1;
    }
    let mut k = 0;
    while k < powers.len() {
        powers[k] = power;
        power = product(power, power);
        k += 1;
    }
    powers
};

/// What the register becomes by one byte.
const TABLE: [u32; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < table.len() {
        let mut register = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            register = times_x(register);
            bit += 1;
        }
        table[byte] = register;
        byte += 1;
    }
    table
};

/// Registers after each prefix of a buffer, from a register of zero.
#[derive(Debug, Default)]
pub(crate) struct Prefixes(Vec<u32>);

impl Prefixes {
    /// Covers all of the buffer; known prefixes are kept.
    pub(crate) fn extend(&mut self, buffer: &[u8]) {
        if self.0.is_empty() {
            self.0.push(0);
        }
        let mut register = self.0.last().copied().unwrap_or(0);
        self.0.reserve(buffer.len() + 1 - self.0.len());
        for byte in &buffer[self.0.len() - 1..] {
            register = (register >> 8) ^ TABLE[(register as u8 ^ byte) as usize];
            self.0.push(register);
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
        let mut register = !before ^ first;
        let mut length = end.checked_sub(start)?;
        for power in POWERS {
            if length & 1 == 1 {
                register = product(register, power);
            }
            length >>= 1;
        }
        Some(!(register ^ last))
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
