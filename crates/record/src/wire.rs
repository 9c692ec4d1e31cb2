//! Records with a length and a checksum. Integers, fields and the byte reader are those of the block codec.

use crate::error::{Damage, ensure};
use fewbits_block_codec::bytes::Unread;
pub(crate) use fewbits_block_codec::bytes::{Bytes, Fields, push_varint, unzigzag, zigzag};
use std::ops::RangeInclusive;

/// The oldest version of the format that is read.
pub(crate) const VERSION_5: u8 = 5;

/// Bytes of a checksum.
pub(crate) const CHECK_BYTES: usize = 4;

/// The checksum of the concatenated parts, of headers, blocks and index: CRC-32 as in zip and PNG.
pub(crate) fn checksum(parts: &[&[u8]]) -> u32 {
    let mut digest = crc32fast::Hasher::new();
    for part in parts {
        digest.update(part);
    }
    digest.finalize()
}

/// The bytes with their checksum behind them.
pub(crate) fn with_checksum(mut bytes: Vec<u8>) -> Vec<u8> {
    let sum = checksum(&[&bytes]);
    bytes.extend(sum.to_le_bytes());
    bytes
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

/// Reads what [`checked`] wrote with a head of this length: the content, and the length of the whole record. `sum` gives the checksum of the first
/// bytes.
///
/// # Errors
/// [`Damage::CutOff`] if the slice ends before the record, [`Damage::NoBlock`] if its length is not one of `lengths`, and
/// [`Damage::Checksum`]. The length is verified first, so that damaged bytes never let a reader wait for a record without end.
pub(crate) fn read_checked(
    bytes: &[u8],
    head: usize,
    lengths: RangeInclusive<usize>,
    sum: impl FnOnce(&[u8]) -> u32,
) -> Result<(&[u8], usize), Damage> {
    let mut reader = Bytes(bytes);
    reader.take(head)?;
    let length = reader.count(*lengths.end(), "length").map_err(|unread| match unread {
        Unread::CutOff => Damage::CutOff,
        _ => Damage::NoBlock,
    })?;
    ensure!(lengths.contains(&length), Damage::NoBlock);
    let content = reader.take(length)?;
    let end = bytes.len() - reader.0.len();
    let stored = u32::from_le_bytes(reader.array::<CHECK_BYTES>()?);
    ensure!(stored == sum(&bytes[..end]), Damage::Checksum);
    Ok((content, end + CHECK_BYTES))
}

/// A flag that is given, or none.
pub(crate) fn flag<T: Default>(given: bool, flag: T) -> T {
    if given { flag } else { T::default() }
}

/// The first three bytes of a bound, highest first.
pub(crate) fn short_bound<F: Fields>(fields: &mut F, own: f64) -> Result<f64, Damage> {
    let [a, b, c, ..] = own.to_be_bytes();
    let [a, b, c] = fields.bytes([a, b, c])?;
    let bound = f64::from_be_bytes([a, b, c, 0, 0, 0, 0, 0]);
    let is_bound = bound >= 0.0 && (2.0 * bound).is_finite();
    is_bound.then_some(bound).ok_or(Damage::Content("bound"))
}

/// What a description writes.
pub(crate) fn written<T>(describe: impl FnOnce(&mut Vec<u8>) -> Result<T, Damage>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let _ = describe(&mut bytes);
    bytes
}

/// All that these bytes hold by this description.
pub(crate) fn read<'a, T>(
    content: &'a [u8],
    describe: impl FnOnce(&mut Bytes<'a>) -> Result<T, Damage>,
) -> Result<T, Damage> {
    let mut reader = Bytes(content);
    let found = describe(&mut reader)?;
    reader.finish()?;
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksum_is_the_published_one() {
        // The check value of CRC-32/ISO-HDLC in the catalogue of parametrised CRC algorithms.
        assert_eq!(checksum(&[b"1234", b"56789"]), 0xcbf4_3926);
    }
}
