//! A range coder for symbols, which ends with the smallest possible number of bits.

use super::table::{Found, Table};
use constriction::UnwrapInfallible;
use constriction::stream::queue::{EncoderSituation, RangeDecoder, RangeEncoder};
use constriction::stream::{Decode, Encode};
use fewbits_core::{BitReader, BitWriter, CodecError};

/// Number of bits of one uniform digit.
const DIGIT: u32 = 12;
/// If the scale exceeds this many steps, an integer is coded in two parts, the lower bits uniformly.
const MAX_SCALE: f64 = 64.0;
/// Integers of at most this absolute value can be coded.
pub(super) const MAX_SYMBOL: f64 = 2_147_483_648.0;

/// Distribution of one integer, in steps of its quantiser.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Law {
    /// Uniform on `0..count`.
    Uniform { count: u64 },
    /// Logistic around `location` with the given scale; any integer below 2^31 in absolute value is possible.
    Logistic { location: f64, scale: f64 },
}

impl Law {
    /// The logistic distribution's table, and the number of low bits that are coded uniformly; `None` if the numbers are out of range.
    fn table(location: f64, scale: f64) -> Option<(Table, u32)> {
        let in_range = location.abs() < MAX_SYMBOL && scale > 0.0 && scale < MAX_SYMBOL;
        let mut low = 0;
        let (mut location, mut scale) = (location, scale.max(0.01));
        while in_range && scale > MAX_SCALE {
            // `n = 2 h + l` with a uniform bit `l`: the distribution of `h` has half the location, less a quarter, and half the scale.
            (location, scale) = (0.5 * location - 0.25, 0.5 * scale);
            low += 1;
        }
        in_range.then(|| (Table::logistic(location, scale), low))
    }
}

pub(super) fn out_of_range(what: &'static str, value: impl std::fmt::Display) -> CodecError {
    CodecError::invalid(what, value, "a number within the range of the format")
}

/// The operations that writer and reader share: code symbols by tables.
pub(super) trait Coder {
    /// Codes one symbol and returns it. A writer is given it as `wanted`; a reader decodes it.
    fn digit(&mut self, table: Table, wanted: Option<u32>) -> Result<u32, CodecError>;

    /// Codes the lowest `bits` bits of a number uniformly.
    fn uniform(&mut self, bits: u32, wanted: Option<u64>) -> Result<u64, CodecError> {
        let (mut value, mut left) = (0, bits);
        while left > 0 {
            let width = left.min(DIGIT);
            left -= width;
            let digit = wanted.map(|value| (value >> left & ((1 << width) - 1)) as u32);
            value = (value << width) + u64::from(self.digit(Table::Uniform { count: 1 << width }, digit)?);
        }
        Ok(value)
    }

    /// Codes one integer with the distribution `law`.
    fn integer(&mut self, law: &Law, wanted: Option<i64>) -> Result<i64, CodecError> {
        match *law {
            Law::Uniform { count } => {
                let (top, low) = digits(count);
                let check = |n| {
                    let value = u64::try_from(n).ok().filter(|value| *value < count);
                    value.ok_or_else(|| out_of_range("symbol", n))
                };
                let wanted = wanted.map(check).transpose()?;
                let head = if top > 1 {
                    self.digit(Table::Uniform { count: top }, wanted.map(|value| (value >> low) as u32))?
                } else {
                    0
                };
                let value = (u64::from(head) << low) + self.uniform(low, wanted)?;
                check(value as i64).map(|value| value as i64)
            }
            Law::Logistic { location, scale } => {
                let refuse = || out_of_range("scale", scale);
                let (table, low) = Law::table(location, scale).ok_or_else(refuse)?;
                let (Table::Logistic { centre, half, .. }, Some(escape)) = (table, table.escape()) else {
                    return Err(refuse());
                };
                let first = centre - i64::from(half);
                // Numbers outside the table take the escape symbol and follow as 32 plain bits.
                let index = wanted.map(|n| u32::try_from((n >> low) - first).map_or(escape, |index| index.min(escape)));
                let index = self.digit(table, index)?;
                if index < escape {
                    return Ok(
                        ((first + i64::from(index)) << low) + self.uniform(low, wanted.map(|n| n as u64))? as i64
                    );
                }
                let raw = |n| u32::try_from(n + (MAX_SYMBOL as i64)).map_err(|_| out_of_range("symbol", n));
                let raw = wanted.map(raw).transpose()?;
                Ok(self.uniform(32, raw.map(u64::from))? as i64 - MAX_SYMBOL as i64)
            }
        }
    }
}

/// Encodes integers.
pub(super) struct Writer {
    encoder: RangeEncoder<u32, u64>,
}

impl Coder for Writer {
    fn digit(&mut self, table: Table, wanted: Option<u32>) -> Result<u32, CodecError> {
        let index = wanted.ok_or_else(|| out_of_range("symbol", "missing"))?;
        let coded = self.encoder.encode_symbol(index, table);
        coded.map(|()| index).map_err(|_| out_of_range("symbol", index))
    }
}

impl Writer {
    pub(super) fn new() -> Self {
        Self {
            encoder: RangeEncoder::new(),
        }
    }

    /// Ends the code with the fewest bits that decode to the same symbols whatever bits follow. These are at most two more than the
    /// information of the symbols.
    pub(super) fn finish(self, writer: &mut BitWriter) -> Result<(), CodecError> {
        const WHOLE: u128 = 1 << 64;
        let (bulk, state, situation) = self.encoder.into_raw_parts();
        let low = u128::from(state.lower());
        let high = low + u128::from(state.range().get());
        let mut length = 0;
        let mut point = 0;
        // The shortest binary fraction whose whole interval is inside the coder's interval, so that any bits may follow it.
        for bits in 0..=64 {
            let unit = WHOLE >> bits;
            point = low.div_ceil(unit) * unit;
            length = bits;
            if point + unit <= high {
                break;
            }
        }
        for word in bulk {
            writer.write(u64::from(word), 32)?;
        }
        // The coder holds back words that a carry may still change: with a carry the first rises by one and the others become zero.
        if let EncoderSituation::Inverted(count, first) = situation {
            let (first, rest) = if point >= WHOLE {
                (first.wrapping_add(1), 0)
            } else {
                (first, u32::MAX)
            };
            writer.write(u64::from(first), 32)?;
            for _ in 1..count.get() {
                writer.write(u64::from(rest), 32)?;
            }
        }
        writer.write(((point % WHOLE) >> (64 - length)) as u64, length)
    }
}

/// Number of values of the leading digit, and number of bits below it, for a uniform distribution of `count` values, at least one.
fn digits(count: u64) -> (u32, u32) {
    let mut low = 0;
    while (count - 1) >> low >= 1 << DIGIT {
        low += 1;
    }
    ((((count - 1) >> low) + 1) as u32, low)
}

/// Decodes integers.
pub(super) struct Reader {
    decoder: RangeDecoder<u32, u64, constriction::backends::Cursor<u32, Vec<u32>>>,
    available: usize,
    /// Lower bound of the number of bits that the symbols so far took.
    spent: usize,
}

impl Coder for Reader {
    fn digit(&mut self, table: Table, _: Option<u32>) -> Result<u32, CodecError> {
        let found = Found::of(&table);
        let index = self
            .decoder
            .decode_symbol(&found)
            .map_err(|_| out_of_range("code word", "past the last symbol"))?;
        // A symbol of frequency 2^k to 2^(k+1) takes more than 15 - k bits. If more bits are spent than there are, decoding stops with an
        // error.
        self.spent += 15_usize.saturating_sub(found.frequency.get().ilog2() as usize);
        if self.spent > self.available {
            let requested = (self.spent - self.available) as u32;
            return Err(CodecError::EndOfMessage {
                requested,
                available: 0,
            });
        }
        Ok(index)
    }
}

impl Reader {
    /// A decoder for the remaining bits of `reader`, at most `most` of them, followed by zeros.
    pub(super) fn new(reader: &BitReader<'_>, most: usize) -> Result<Self, CodecError> {
        let mut reader = reader.clone();
        let bits = reader.remaining().min(most);
        let mut words = Vec::with_capacity(bits.div_ceil(32));
        for from in (0..bits).step_by(32) {
            let width = (bits - from).min(32) as u32;
            words.push((reader.read(width)? << (32 - width)) as u32);
        }
        Ok(Self {
            decoder: RangeDecoder::from_compressed(words).unwrap_infallible(),
            available: bits,
            spent: 0,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use rand::RngExt;
    use rand::SeedableRng;

    #[test]
    fn laws_and_symbols_out_of_range_are_refused_and_the_last_within_are_not() {
        let write = |law: Law, n: i64| {
            let mut writer = Writer::new();
            writer.integer(&law, Some(n))?;
            let mut bits = BitWriter::new();
            writer.finish(&mut bits)?;
            let message = bits.finish();
            let mut reader = Reader::new(&BitReader::new(&message), 1 << 10)?;
            assert_eq!(reader.integer(&law, None)?, n, "{law:?}");
            Ok::<usize, CodecError>(message.bits())
        };
        let law = |location, scale| Law::Logistic { location, scale };
        for bad in [
            law(MAX_SYMBOL, 1.0),
            law(-MAX_SYMBOL, 1.0),
            law(0.0, MAX_SYMBOL),
            law(0.0, 0.0),
            law(0.0, -1.0),
            law(0.0, f64::NAN),
            law(f64::NAN, 1.0),
            law(f64::INFINITY, 1.0),
            law(0.0, f64::INFINITY),
        ] {
            assert!(write(bad, 0).is_err(), "{bad:?}");
            let empty = fewbits_core::BitString::default();
            assert!(
                Reader::new(&BitReader::new(&empty), 99)
                    .unwrap()
                    .integer(&bad, None)
                    .is_err(),
                "{bad:?}"
            );
        }
        for good in [
            law(MAX_SYMBOL - 1.0, 1e-9),
            law(-3.7, 0.9 * MAX_SYMBOL),
            law(0.3, 64.0),
            law(0.3, 64.1),
            law(-900.0, 7e5),
        ] {
            for n in [0, 7, -8, 123_456, (1 << 31) - 1, -1 << 31] {
                write(good, n).unwrap();
            }
        }
        assert!(write(law(0.3, 64.0), 1 << 31).is_err() && write(law(0.3, 64.0), -1 - (1 << 31)).is_err());
        let uniform = |count| Law::Uniform { count };
        for count in [
            1,
            2,
            3,
            4095,
            4096,
            4097,
            8193,
            1 << 24,
            (1 << 24) + 1,
            1 << 40,
            (1 << 50) - 3,
        ] {
            for n in [0, count / 3, count - 1] {
                let bits = write(uniform(count), n as i64).unwrap();
                assert!((bits as f64) < (count as f64).log2() + 2.01, "{bits} bits for one of {count}");
            }
            assert!(write(uniform(count), count as i64).is_err() && write(uniform(count), -1).is_err());
            // The leading digit is as long as a table allows.
            let (top, low) = digits(count);
            assert_eq!((u64::from(top), low), {
                let low = (0..).find(|low| (count - 1) >> low < 4096).unwrap();
                (((count - 1) >> low) + 1, low)
            });
        }
        assert_eq!((digits(4096), digits(4097), digits(8193)), ((4096, 0), (2049, 1), (2049, 2)));
    }

    /// Beyond its end a message is zeros, but no more symbols come from it than it has bits for.
    #[test]
    fn nothing_is_read_past_the_end() {
        let law = Law::Uniform { count: 1024 };
        for bytes in [0, 1, 3, 8, 9] {
            let message = fewbits_core::BitString::from_bytes(vec![0; bytes], 8 * bytes).unwrap();
            let mut reader = Reader::new(&BitReader::new(&message), 1 << 10).unwrap();
            let read = (0..1000).take_while(|_| reader.integer(&law, None).is_ok()).count();
            // A symbol of ten bits counts for nine at least.
            assert_eq!(read, 8 * bytes / 9);
            let mut few = Reader::new(&BitReader::new(&message), 10).unwrap();
            assert_eq!((0..1000).take_while(|_| few.integer(&law, None).is_ok()).count(), (8 * bytes).min(10) / 9);
        }
    }

    #[test]
    fn integers_of_every_size_come_back_and_the_length_is_near_the_information() {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(4);
        for round in 0..2000 {
            let mut symbols = Vec::new();
            let mut information = 0.0;
            for _ in 0..rng.random_range(1..30) {
                let law = if rng.random() {
                    let width = rng.random_range(1..40);
                    Law::Uniform {
                        count: rng.random_range(1..1 << width),
                    }
                } else {
                    let scale = 10.0_f64.powf(rng.random_range(-2.0..6.0));
                    Law::Logistic {
                        location: rng.random_range(-3.0..3.0) * scale,
                        scale,
                    }
                };
                let n = match law {
                    Law::Uniform { count } => {
                        information += (count as f64).log2() + 0.1;
                        rng.random_range(0..count) as i64
                    }
                    Law::Logistic { location, scale } => {
                        let u: f64 = rng.random_range(0.001..0.999);
                        let n = (location + scale * (u / (1.0 - u)).ln()).round();
                        let cdf = |x: f64| 1.0 / (1.0 + (-(x - location) / scale).exp());
                        information += -(cdf(n + 0.5) - cdf(n - 0.5)).log2() + 0.3;
                        if round % 7 == 0 {
                            rng.random_range(-1 << 31..1 << 31)
                        } else {
                            n as i64
                        }
                    }
                };
                symbols.push((law, n));
            }
            let mut writer = Writer::new();
            for (law, n) in &symbols {
                writer.integer(law, Some(*n)).unwrap();
            }
            let mut bits = BitWriter::new();
            writer.finish(&mut bits).unwrap();
            let length = bits.bits();
            if round % 7 != 0 {
                assert!((length as f64) < information + 2.5, "{length} bits for {information}");
            }
            // Whatever follows does not matter.
            for _ in 0..40 {
                bits.write(rng.random_range(0..2), 1).unwrap();
            }
            let message = bits.finish();
            let mut reader = Reader::new(&BitReader::new(&message), 1 << 20).unwrap();
            for (law, n) in &symbols {
                assert_eq!(reader.integer(law, None).unwrap(), *n, "{law:?}");
            }
        }
    }
}
