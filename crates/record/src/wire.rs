//! Fields of records, records with a length and a checksum. Integers and the byte reader are those of the block codec.

use crate::codec::{Target, adaptive};
use crate::error::Damage;
use fewbits_block_codec::Start;
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

/// Fields of a record, described once for writer and reader: a writer appends the values that it is given, a reader returns those of its
/// bytes. Only a reader can fail.
pub(crate) trait Fields {
    /// Bytes as they are.
    fn bytes<const N: usize>(&mut self, own: [u8; N]) -> Result<[u8; N], Damage>;
    fn varint(&mut self, own: u64) -> Result<u64, Damage>;
    /// A text behind its length.
    fn text(&mut self, own: &str) -> Result<String, Damage>;
    /// The start of a column's blocks within this bound.
    fn start(&mut self, own: Option<&Start>, target: &Target) -> Result<Start, Damage>;

    fn byte(&mut self, own: u8) -> Result<u8, Damage> {
        Ok(self.bytes([own])?[0])
    }

    fn signed(&mut self, own: i64) -> Result<i64, Damage> {
        Ok(unzigzag(self.varint(zigzag(own))?))
    }

    fn f64(&mut self, own: f64) -> Result<f64, Damage> {
        Ok(f64::from_le_bytes(self.bytes(own.to_le_bytes())?))
    }

    /// The first three bytes of a bound, highest first.
    fn short_bound(&mut self, own: f64) -> Result<f64, Damage> {
        let [a, b, c, ..] = own.to_be_bytes();
        let [a, b, c] = self.bytes([a, b, c])?;
        let bound = f64::from_be_bytes([a, b, c, 0, 0, 0, 0, 0]);
        let is_bound = bound >= 0.0 && (2.0 * bound).is_finite();
        is_bound.then_some(bound).ok_or(Damage::Content("bound"))
    }

    /// An integer that must not exceed `limit`.
    fn count(&mut self, own: usize, limit: usize, what: &'static str) -> Result<usize, Damage> {
        let count = usize::try_from(self.varint(own as u64)?).ok();
        count.filter(|count| *count <= limit).ok_or(Damage::Content(what))
    }
}

impl Fields for Vec<u8> {
    fn bytes<const N: usize>(&mut self, own: [u8; N]) -> Result<[u8; N], Damage> {
        self.extend(own);
        Ok(own)
    }

    fn varint(&mut self, own: u64) -> Result<u64, Damage> {
        push_varint(self, own);
        Ok(own)
    }

    fn text(&mut self, own: &str) -> Result<String, Damage> {
        push_varint(self, own.len() as u64);
        self.extend_from_slice(own.as_bytes());
        Ok(own.to_owned())
    }

    fn start(&mut self, own: Option<&Start>, _: &Target) -> Result<Start, Damage> {
        let own = *own.ok_or(Damage::Content("start of blocks"))?;
        self.extend(own.to_bytes());
        Ok(own)
    }
}

impl Fields for Bytes<'_> {
    fn bytes<const N: usize>(&mut self, _: [u8; N]) -> Result<[u8; N], Damage> {
        Ok(self.array()?)
    }

    fn varint(&mut self, _: u64) -> Result<u64, Damage> {
        Ok(Bytes::varint(self)?)
    }

    fn text(&mut self, _: &str) -> Result<String, Damage> {
        let length = Bytes::count(self, self.0.len(), "length of a text")?;
        let text = std::str::from_utf8(self.take(length)?);
        text.map(str::to_owned).map_err(|_| Damage::Content("text"))
    }

    fn start(&mut self, _: Option<&Start>, target: &Target) -> Result<Start, Damage> {
        adaptive::read_start(&mut self.0, target)
    }
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
