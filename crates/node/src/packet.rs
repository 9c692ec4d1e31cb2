//! Packets: bit strings of at most 128 bits.

/// The bits that a sensor sends in one slot. The receiver knows their number from the frame, so it is not encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Packet {
    /// The bits as a number; the last bit is the lowest.
    word: u128,
    bits: u32,
}

impl Packet {
    /// Largest length of a packet in bits.
    const MAX_BITS: u32 = 128;

    /// The low `bits` bits of `word`. `None` if `bits` exceeds 128 or a higher bit of `word` is set.
    pub fn from_word(word: u128, bits: u32) -> Option<Self> {
        (bits <= Self::MAX_BITS && word.checked_shr(bits).unwrap_or(0) == 0).then_some(Self { word, bits })
    }

    /// Length in bits.
    pub fn bits(&self) -> u32 {
        self.bits
    }

    /// The bits as a number; the last bit is the lowest.
    pub fn word(&self) -> u128 {
        self.word
    }

    /// Appends the low `width` bits of `value`, most significant first. Appends nothing if `width` exceeds 64 or the packet would
    /// exceed 128 bits.
    pub fn push(&mut self, value: u64, width: u32) {
        if (1..=64).contains(&width) && self.bits + width <= Self::MAX_BITS {
            let kept = value & (u64::MAX >> (64 - width));
            self.word = self.word << width | u128::from(kept);
            self.bits += width;
        }
    }

    /// The bits as bytes, most significant first, padded with zeros. Only the first [`byte_count`](Self::byte_count) bytes are used.
    pub fn to_bytes(&self) -> [u8; 16] {
        // For an empty packet the shift would be by 128 bits, which is not allowed.
        (self.word.checked_shl(Self::MAX_BITS - self.bits).unwrap_or(0)).to_be_bytes()
    }

    /// Number of bytes that the bits need.
    pub fn byte_count(&self) -> usize {
        self.bits.div_ceil(8) as usize
    }
}

/// Powers of ten that doubles represent exactly.
pub static TENS: [f64; 16] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
];

/// Appends any finite number exactly. A number of few decimals, as instruments give, takes 12 bits and those of its
/// digits: `0`, sign, decimals (4 bits), length (6 bits), digits. Any other takes 65: `1` and the bits of the double.
pub fn push_number(packet: &mut Packet, value: f64) {
    let size = value.abs();
    for (decimals, ten) in (0..).zip(TENS.iter().copied()) {
        // Find the smallest number of decimals that represents this number exactly; otherwise send all 64 bits.
        let digits = crate::math::round(size * ten);
        if digits >= 9e15 || digits / ten != size {
            continue;
        }
        let digits = digits as u64;
        let length = u64::BITS - digits.leading_zeros();
        if length >= 53 {
            break;
        }
        packet.push(0, 1);
        packet.push(u64::from(value < 0.0), 1);
        packet.push(decimals, 4);
        packet.push(u64::from(length), 6);
        packet.push(digits, length);
        return;
    }
    packet.push(1, 1);
    packet.push(value.to_bits(), 64);
}
