//! Packets: whole bits, at most 128.

/// What a sensor sends in one slot. Its length is known from its frame, so no bit is spent on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Packet {
    /// The bits, the last one lowest.
    word: u128,
    bits: u32,
}

impl Packet {
    /// Most bits of a packet.
    pub const MAX_BITS: u32 = 128;

    /// The low `bits` bits of `word`; `None` if there are more than 128, or the word has more.
    pub fn from_word(word: u128, bits: u32) -> Option<Self> {
        (bits <= Self::MAX_BITS && word.checked_shr(bits).unwrap_or(0) == 0).then_some(Self { word, bits })
    }

    /// Length.
    pub fn bits(&self) -> u32 {
        self.bits
    }

    /// The bits as a number, the last one lowest.
    pub fn word(&self) -> u128 {
        self.word
    }

    /// Appends the low `width` bits of `value`, most significant first. Nothing is appended if they are more than 64, or the packet would
    /// have more than 128.
    pub fn push(&mut self, value: u64, width: u32) {
        if (1..=64).contains(&width) && self.bits + width <= Self::MAX_BITS {
            let kept = value & (u64::MAX >> (64 - width));
            self.word = self.word << width | u128::from(kept);
            self.bits += width;
        }
    }

    /// The bits in bytes, most significant first, the last byte padded with zeros: [`byte_count`](Self::byte_count) of them count.
    pub fn to_bytes(&self) -> [u8; 16] {
        // A shift by all 128 bits is one of none: there is nothing to shift.
        (self.word.checked_shl(Self::MAX_BITS - self.bits).unwrap_or(0)).to_be_bytes()
    }

    /// Bytes that the bits fill.
    pub fn byte_count(&self) -> usize {
        self.bits.div_ceil(8) as usize
    }
}

/// Powers of ten that are whole doubles.
pub static TENS: [f64; 16] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
];

/// Appends any finite number exactly. Numbers of a few decimals, as instruments write them, take 12 bits and those of their
/// digits: `0`, sign, decimals (4 bits), length (6 bits), digits; all others `1` and 64 bits.
pub fn push_number(packet: &mut Packet, value: f64) {
    let size = value.abs();
    for (decimals, ten) in (0..).zip(TENS.iter().copied()) {
        // The shortest decimal that is exactly this number; otherwise all 64 bits.
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
