//! Texts as bytes, records with a length and a checksum. Integers and the byte reader are those of the block codec.

use crate::error::Damage;
use fewbits_block_codec::bytes::Unread;
pub(crate) use fewbits_block_codec::bytes::{Bytes, push_varint, unzigzag, zigzag};
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
    let length = reader.count(*lengths.end(), "length").map_err(|unread| match unread {
        Unread::CutOff => Damage::CutOff,
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

/// Appends the length of a text and the text.
pub(crate) fn push_text(bytes: &mut Vec<u8>, text: &str) {
    push_varint(bytes, text.len() as u64);
    bytes.extend_from_slice(text.as_bytes());
}

/// Reads a text of [`push_text`].
pub(crate) fn text<'a>(bytes: &mut Bytes<'a>) -> Result<&'a str, Damage> {
    let length = bytes.count(bytes.0.len(), "length of a text")?;
    std::str::from_utf8(bytes.take(length)?).map_err(|_| Damage::Content("text"))
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
