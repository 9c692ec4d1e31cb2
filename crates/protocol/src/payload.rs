//! Borrowed bit strings.

/// A borrowed bit string, packed with the most significant bit first. Unused bits of the last byte are zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Payload<'a> {
    bytes: &'a [u8],
    bits: usize,
}

impl<'a> Payload<'a> {
    /// The empty bit string.
    pub const EMPTY: Payload<'static> = Payload { bytes: &[], bits: 0 };

    /// The first `bits` bits of `bytes`. `None` if there are fewer, or if an unused bit of the last byte is one.
    pub fn new(bytes: &'a [u8], bits: usize) -> Option<Self> {
        let bytes = bytes.get(..bits.div_ceil(8))?;
        let padding = 8 * bytes.len() - bits;
        let unused = bytes.last().map_or(0, |last| last & !(0xff_u8 << padding));
        (unused == 0).then_some(Self { bytes, bits })
    }

    /// Length in bits.
    pub fn bits(&self) -> usize {
        self.bits
    }

    /// The packed bytes, `bits / 8` rounded up.
    pub fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// Number of unused bits of the last byte, 0 to 7.
    pub(crate) fn padding(&self) -> u8 {
        (8 * self.bytes.len() - self.bits) as u8
    }
}

#[cfg(feature = "std")]
impl<'a> From<&'a fewbits_core::BitString> for Payload<'a> {
    fn from(bits: &'a fewbits_core::BitString) -> Self {
        Self {
            bytes: bits.bytes(),
            bits: bits.bits(),
        }
    }
}

#[cfg(feature = "std")]
impl From<Payload<'_>> for fewbits_core::BitString {
    fn from(payload: Payload<'_>) -> Self {
        // The bytes contain that many bits by construction.
        Self::from_bytes(payload.bytes.to_vec(), payload.bits).unwrap_or_default()
    }
}
