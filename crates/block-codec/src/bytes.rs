//! Integers as bytes, and a reader that cannot read beyond the end.

use crate::ensure;

/// Why a value could not be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Unread {
    /// The bytes end before the value does.
    #[error("cut off")]
    CutOff,
    /// A value that no writer writes.
    #[error("`{0}` is not what a writer writes")]
    Content(&'static str),
}

/// Appends an integer in groups of seven bits, lowest first; every byte but the last has its top bit set.
pub fn push_varint(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// Maps integers to non-negative ones, small sizes to small numbers: 0, -1, 1, -2, ... become 0, 1, 2, 3, ...
pub fn zigzag(value: i64) -> u64 {
    ((value << 1) ^ (value >> 63)) as u64
}

/// The inverse of [`zigzag`].
pub fn unzigzag(value: u64) -> i64 {
    (value >> 1) as i64 ^ -((value & 1) as i64)
}

/// Reads from the front of a slice. Every method fails at the end of the slice.
#[derive(Debug, Clone, Copy)]
pub struct Bytes<'a>(pub &'a [u8]);

impl<'a> Bytes<'a> {
    /// The next `count` bytes.
    ///
    /// # Errors
    /// If there are fewer.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], Unread> {
        let (head, tail) = self.0.split_at_checked(count).ok_or(Unread::CutOff)?;
        self.0 = tail;
        Ok(head)
    }

    /// The next `N` bytes.
    ///
    /// # Errors
    /// If there are fewer.
    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], Unread> {
        let (head, tail) = self.0.split_first_chunk::<N>().ok_or(Unread::CutOff)?;
        self.0 = tail;
        Ok(*head)
    }

    /// The next byte.
    ///
    /// # Errors
    /// If there is none.
    pub fn byte(&mut self) -> Result<u8, Unread> {
        Ok(self.array::<1>()?[0])
    }

    /// A little-endian double.
    ///
    /// # Errors
    /// If there are fewer than eight bytes.
    pub fn f64(&mut self) -> Result<f64, Unread> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    /// An integer of [`push_varint`].
    ///
    /// # Errors
    /// If the bytes end, or the integer has more than 64 bits.
    pub fn varint(&mut self) -> Result<u64, Unread> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            let group = u64::from(byte & 0x7f);
            ensure!(shift < 63 || group <= 1, Unread::Content("integer"));
            value |= group << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(Unread::Content("integer"))
    }

    /// An integer of [`push_varint`] after [`zigzag`].
    ///
    /// # Errors
    /// As [`varint`](Self::varint).
    pub fn signed(&mut self) -> Result<i64, Unread> {
        Ok(unzigzag(self.varint()?))
    }

    /// An integer that must not exceed `limit`; `what` names it in the error.
    ///
    /// # Errors
    /// As [`varint`](Self::varint), or if the integer is larger.
    pub fn count(&mut self, limit: usize, what: &'static str) -> Result<usize, Unread> {
        Fields::count(self, 0, limit, what)
    }

    /// Checks that nothing is left.
    ///
    /// # Errors
    /// If bytes are left.
    pub fn finish(self) -> Result<(), Unread> {
        ensure!(self.0.is_empty(), Unread::Content("length"));
        Ok(())
    }
}

/// Fields of a record, described once for writer and reader: a writer (bytes that grow) appends the values that it is given, a reader
/// ([`Bytes`]) returns those that it finds. Only a reader can fail.
pub trait Fields {
    /// Bytes as they are.
    ///
    /// # Errors
    /// If there are fewer.
    fn bytes<const N: usize>(&mut self, own: [u8; N]) -> Result<[u8; N], Unread>;

    /// An integer of [`push_varint`].
    ///
    /// # Errors
    /// If there is none.
    fn varint(&mut self, own: u64) -> Result<u64, Unread>;

    /// A text behind its length.
    ///
    /// # Errors
    /// If there is none.
    fn text(&mut self, own: &str) -> Result<String, Unread>;

    /// A byte.
    ///
    /// # Errors
    /// If there is none.
    fn byte(&mut self, own: u8) -> Result<u8, Unread> {
        Ok(self.bytes([own])?[0])
    }

    /// An integer of [`push_varint`] after [`zigzag`].
    ///
    /// # Errors
    /// If there is none.
    fn signed(&mut self, own: i64) -> Result<i64, Unread> {
        Ok(unzigzag(self.varint(zigzag(own))?))
    }

    /// A little-endian double.
    ///
    /// # Errors
    /// If there is none.
    fn f64(&mut self, own: f64) -> Result<f64, Unread> {
        Ok(f64::from_le_bytes(self.bytes(own.to_le_bytes())?))
    }

    /// An integer that must not exceed `limit`; `what` names it in the error.
    ///
    /// # Errors
    /// If there is none, or it is larger.
    fn count(&mut self, own: usize, limit: usize, what: &'static str) -> Result<usize, Unread> {
        let count = usize::try_from(self.varint(own as u64)?).ok();
        count.filter(|count| *count <= limit).ok_or(Unread::Content(what))
    }
}

impl Fields for Vec<u8> {
    fn bytes<const N: usize>(&mut self, own: [u8; N]) -> Result<[u8; N], Unread> {
        self.extend(own);
        Ok(own)
    }

    fn varint(&mut self, own: u64) -> Result<u64, Unread> {
        push_varint(self, own);
        Ok(own)
    }

    fn text(&mut self, own: &str) -> Result<String, Unread> {
        push_varint(self, own.len() as u64);
        self.extend_from_slice(own.as_bytes());
        Ok(own.to_owned())
    }
}

impl Fields for Bytes<'_> {
    fn bytes<const N: usize>(&mut self, _: [u8; N]) -> Result<[u8; N], Unread> {
        self.array()
    }

    fn varint(&mut self, _: u64) -> Result<u64, Unread> {
        Bytes::varint(self)
    }

    fn text(&mut self, _: &str) -> Result<String, Unread> {
        let length = Bytes::count(self, self.0.len(), "length of a text")?;
        let text = std::str::from_utf8(self.take(length)?);
        text.map(str::to_owned).map_err(|_| Unread::Content("text"))
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
}
