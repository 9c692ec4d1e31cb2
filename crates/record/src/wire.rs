//! Encoding of integers and texts as bytes, a reader that cannot read beyond the end, and the checksum.

use crate::error::Damage;
use crc::{CRC_32_ISO_HDLC, Crc, Table};
use std::ops::RangeInclusive;

/// The checksum of headers, blocks and index: CRC-32 as in zip and PNG.
static CRC: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISO_HDLC);

/// Bytes of a checksum.
pub(crate) const CHECK_BYTES: usize = 4;

/// The checksum of the concatenated parts.
pub(crate) fn checksum(parts: &[&[u8]]) -> u32 {
    let mut digest = CRC.digest();
    for part in parts {
        digest.update(part);
    }
    digest.finalize()
}

/// A record as it is written: head, length of the content, content, and the checksum of `check` and all of it.
pub(crate) fn checked(check: u32, head: &[u8], content: &[u8]) -> Vec<u8> {
    let mut bytes = head.to_vec();
    push_varint(&mut bytes, content.len() as u64);
    bytes.extend_from_slice(content);
    let sum = checksum(&[&check.to_le_bytes(), &bytes]);
    bytes.extend(sum.to_le_bytes());
    bytes
}

/// Reads what [`checked`] wrote with a head of this length: the content, and the length of the whole record.
///
/// # Errors
/// [`Damage::CutOff`] if the slice ends before the record, [`Damage::NoBlock`] if its length is not one of `lengths`, and
/// [`Damage::Checksum`]. The length is verified first, so that damaged bytes never let a reader wait for a record without end.
pub(crate) fn read_checked(
    check: u32,
    bytes: &[u8],
    head: usize,
    lengths: RangeInclusive<usize>,
) -> Result<(&[u8], usize), Damage> {
    let mut reader = Bytes(bytes);
    reader.take(head)?;
    let length = reader.count(*lengths.end(), "length").map_err(|damage| match damage {
        Damage::CutOff => damage,
        _ => Damage::NoBlock,
    })?;
    if !lengths.contains(&length) {
        return Err(Damage::NoBlock);
    }
    let content = reader.take(length)?;
    let end = bytes.len() - reader.0.len();
    let sum = u32::from_le_bytes(reader.array::<CHECK_BYTES>()?);
    if sum != checksum(&[&check.to_le_bytes(), &bytes[..end]]) {
        return Err(Damage::Checksum);
    }
    Ok((content, end + CHECK_BYTES))
}

/// Appends an integer in groups of seven bits, lowest first; every byte but the last has its top bit set.
pub(crate) fn push_varint(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// Maps integers to non-negative ones, small sizes to small numbers: 0, -1, 1, -2, ... become 0, 1, 2, 3, ...
pub(crate) fn zigzag(value: i64) -> u64 {
    ((value << 1) ^ (value >> 63)) as u64
}

/// The inverse of [`zigzag`].
pub(crate) fn unzigzag(value: u64) -> i64 {
    (value >> 1) as i64 ^ -((value & 1) as i64)
}

/// Appends the length of a text and the text.
pub(crate) fn push_text(bytes: &mut Vec<u8>, text: &str) {
    push_varint(bytes, text.len() as u64);
    bytes.extend_from_slice(text.as_bytes());
}

/// Reads from the front of a slice. Every method fails at the end of the slice.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bytes<'a>(pub(crate) &'a [u8]);

impl<'a> Bytes<'a> {
    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8], Damage> {
        let (head, tail) = self.0.split_at_checked(count).ok_or(Damage::CutOff)?;
        self.0 = tail;
        Ok(head)
    }

    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N], Damage> {
        let (head, tail) = self.0.split_first_chunk::<N>().ok_or(Damage::CutOff)?;
        self.0 = tail;
        Ok(*head)
    }

    pub(crate) fn byte(&mut self) -> Result<u8, Damage> {
        Ok(self.array::<1>()?[0])
    }

    pub(crate) fn f64(&mut self) -> Result<f64, Damage> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    pub(crate) fn varint(&mut self) -> Result<u64, Damage> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            let group = u64::from(byte & 0x7f);
            if shift == 63 && group > 1 {
                return Err(Damage::Content("integer"));
            }
            value |= group << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(Damage::Content("integer"))
    }

    pub(crate) fn signed(&mut self) -> Result<i64, Damage> {
        Ok(unzigzag(self.varint()?))
    }

    /// Reads an integer that must not exceed `limit`.
    pub(crate) fn count(&mut self, limit: usize, what: &'static str) -> Result<usize, Damage> {
        let value = self.varint()?;
        usize::try_from(value)
            .ok()
            .filter(|count| *count <= limit)
            .ok_or(Damage::Content(what))
    }

    pub(crate) fn text(&mut self) -> Result<&'a str, Damage> {
        let length = self.count(self.0.len(), "length of a text")?;
        std::str::from_utf8(self.take(length)?).map_err(|_| Damage::Content("text"))
    }

    pub(crate) fn finish(self) -> Result<(), Damage> {
        if self.0.is_empty() {
            Ok(())
        } else {
            Err(Damage::Content("length"))
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn integers_return() {
        for value in [0, 1, 127, 128, 300, u64::from(u32::MAX), u64::MAX] {
            let mut bytes = Vec::new();
            push_varint(&mut bytes, value);
            let mut reader = Bytes(&bytes);
            assert_eq!(reader.varint().unwrap(), value);
            reader.finish().unwrap();
            assert!(Bytes(&bytes[..bytes.len() - 1]).varint().is_err());
        }
        for value in [0, -1, 1, i64::MIN, i64::MAX] {
            assert_eq!(unzigzag(zigzag(value)), value);
        }
        assert!(Bytes(&[0xff; 11]).varint().is_err());
    }

    #[test]
    fn checksum_is_the_published_one() {
        // The check value of CRC-32/ISO-HDLC in the catalogue of parametrised CRC algorithms.
        assert_eq!(checksum(&[b"1234", b"56789"]), 0xcbf4_3926);
    }
}
