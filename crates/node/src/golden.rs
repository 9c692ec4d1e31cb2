//! Test vectors: inputs and messages of every scheme, to compare machines, compilers and other implementations.
//!
//! [`Vectors`] makes inputs by integer arithmetic from a fixed seed, runs one [`Scheme`] on them, and returns inputs and messages as bytes.
//! `tests/golden/v2` has the first [`RECORDS`] of each; [`hash`] is a checksum of any number of messages.
//!
//! A file is a header and records, all numbers little-endian:
//!
//! ```text
//! header   "fbgv", version (1 byte), number of the scheme (1 byte), bytes of an input (2), records (4)
//! record   the input, length of the message in bits (1 byte; 0 is silence), the message, most significant bit first
//! ```
//!
//! | scheme | input | parameters | message |
//! |---|---|---|---|
//! | `SignBit` | sample, threshold: f64 | | the bit |
//! | `SignBitCodes` | sample, threshold: i32 | | the bit |
//! | `InnovationWord` | sample, mean, deviation: f64 | thresholds -0.982, 0 and 0.982 | the cell, 2 bits |
//! | `InnovationWordCodes` | sample, mean: i32; deviation: u32 | these thresholds times 2^16, rounded | the cell, 2 bits |
//! | `QuantizerWord` | sample: f64 | thresholds -20, -5, 0, 5, 20; words 0, 1, 3, 2, 6, 7 | the word, 3 bits |
//! | `QuantizerWordCodes` | sample: u16 | thresholds 8000, 24000, 32768, 40000, 60000; the same words | the word, 3 bits |
//! | `PatternBit` | sample: f64 | thresholds -10, 0, 10 | the bit |
//! | `RangeLevel` | range, centre, half width: f64 | 8 levels | the level, 3 bits |
//! | `Censoring` | sample, prediction, half width: f64 | | the sample as f64 |
//! | `CensoringCodes` | sample, prediction: i32; half width: u32 | | the low 16 bits of the sample |
//! | `CensoringTold` | sample, prediction, 3 numbers of P: f64 | h = (1, .5), R = .25, threshold 2 | the sample as f64 |
//! | `CensoringOwn` | sample: f64 | F = (1 1; 0 .9), h = (1, 0), gain (.5, .2), half width 8 | the sample as f64 |
//! | `Trigger` | sample, prediction, uniform number: f64 | precision .01 | the sample as f64 |
//! | `Adaptive` | sample: f64 | delta .01, 4 bits of sequence, a refresh every 1000 slots | the packet |
//! | `AdaptiveCircle` | sample: f64 | delta .5, period 360 | the packet |
//! | `RangeLevelCodes` | range, centre: i32; half width: u32 | 8 levels | the level, 3 bits |

use crate::adaptive::{Config, Encoder};
use crate::{Error, Packet, Quantizer, censor, trigger};
use crate::{innovation_cell, innovation_cell_of_codes, pattern_bit, range_level, range_level_of_codes, sign_bit};

/// Version of the files with test vectors.
pub const VERSION: u8 = 2;
/// Number of records in a file.
pub const RECORDS: u32 = 300;
/// Thresholds of the words of the innovation: the four-level Lloyd-Max quantizer of the normal density, rounded to three decimals.
const THRESHOLDS: [f64; 3] = [-0.982, 0.0, 0.982];
const CODE_THRESHOLDS: [i32; 3] = [-64_356, 0, 64_356];
const QUANTIZER: [f64; 5] = [-20.0, -5.0, 0.0, 5.0, 20.0];
const QUANTIZER_CODES: [u16; 5] = [8_000, 24_000, 32_768, 40_000, 60_000];
const WORDS: [u16; 6] = [0, 1, 3, 2, 6, 7];
const PATTERN: [f64; 3] = [-10.0, 0.0, 10.0];

/// A scheme with its parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
#[allow(missing_docs)] // The table above says what they are.
pub enum Scheme {
    SignBit = 1,
    SignBitCodes,
    InnovationWord,
    InnovationWordCodes,
    QuantizerWord,
    QuantizerWordCodes,
    PatternBit,
    RangeLevel,
    Censoring,
    CensoringCodes,
    CensoringTold,
    CensoringOwn,
    Trigger,
    Adaptive,
    AdaptiveCircle,
    RangeLevelCodes,
}

impl Scheme {
    /// All schemes with the names of their files.
    pub const ALL: [(Self, &'static str); 16] = [
        (Self::SignBit, "sign-bit"),
        (Self::SignBitCodes, "sign-bit-codes"),
        (Self::InnovationWord, "innovation-word"),
        (Self::InnovationWordCodes, "innovation-word-codes"),
        (Self::QuantizerWord, "quantizer-word"),
        (Self::QuantizerWordCodes, "quantizer-word-codes"),
        (Self::PatternBit, "pattern-bit"),
        (Self::RangeLevel, "range-level"),
        (Self::Censoring, "censoring"),
        (Self::CensoringCodes, "censoring-codes"),
        (Self::CensoringTold, "censoring-told"),
        (Self::CensoringOwn, "censoring-own"),
        (Self::Trigger, "trigger"),
        (Self::Adaptive, "adaptive"),
        (Self::AdaptiveCircle, "adaptive-circle"),
        (Self::RangeLevelCodes, "range-level-codes"),
    ];
}

/// Inputs in the order of the table, as bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Input {
    bytes: [u8; 40],
    len: usize,
}

impl Input {
    const EMPTY: Self = Self { bytes: [0; 40], len: 0 };

    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or(&[])
    }

    fn put(&mut self, bytes: &[u8]) {
        for (place, byte) in self.bytes.iter_mut().skip(self.len).zip(bytes) {
            *place = *byte;
        }
        self.len = (self.len + bytes.len()).min(self.bytes.len());
    }

    fn floats(values: &[f64]) -> Self {
        let mut input = Self::EMPTY;
        values.iter().for_each(|value| input.put(&value.to_le_bytes()));
        input
    }

    fn codes(values: &[i32]) -> Self {
        let mut input = Self::EMPTY;
        values.iter().for_each(|value| input.put(&value.to_le_bytes()));
        input
    }
}

/// A random signal in thousandths with constant parts, steps and rare outliers, by integer arithmetic.
#[derive(Debug, Clone)]
pub struct Signal {
    state: u64,
    place: i64,
    speed: i64,
}

impl Signal {
    /// The signal of a seed.
    pub const fn new(seed: u64) -> Self {
        Self {
            state: seed,
            place: 20_000,
            speed: 0,
        }
    }

    /// The next number of SplitMix64 (Steele and others 2014).
    pub fn random(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// The next sample in thousandths, without outliers.
    fn thousandths(&mut self) -> (u64, i64) {
        let r = self.random();
        match r & 0xff {
            0 => self.place += ((r >> 8) & 0xf_ffff) as i64 - 0x8_0000,
            1..=15 => self.speed = ((r >> 8) & 0x1f) as i64 - 16,
            16..=63 => self.speed = 0,
            _ => {}
        }
        self.place += self.speed + ((r >> 32) % 5) as i64 - 2;
        (r, self.place)
    }

    /// The next sample.
    pub fn sample(&mut self) -> f64 {
        let (r, place) = self.thousandths();
        if (r >> 40) & 0x1fff == 0 {
            return 3e12;
        }
        place as f64 / 1000.0
    }

    /// A random integer in `-2^(bits - 1)..2^(bits - 1)`.
    fn whole(&mut self, bits: u32) -> i32 {
        ((self.random() >> (64 - bits)) as i32) - (1 << (bits - 1))
    }

    /// A random multiple of `1/64` in `[-32, 32)`, so that ties with thresholds occur.
    fn multiple(&mut self) -> f64 {
        f64::from(self.whole(12)) / 64.0
    }
}

/// Generator of the test vectors of one scheme.
#[derive(Debug, Clone)]
pub struct Vectors {
    scheme: Scheme,
    signal: Signal,
    own: Option<censor::OwnFilter<2>>,
    encoder: Encoder,
}

/// A message of a few bits.
fn word(value: usize, bits: u32) -> Packet {
    let mut packet = Packet::default();
    packet.push(value as u64, bits);
    packet
}

fn bit(value: bool) -> Packet {
    word(usize::from(value), 1)
}

impl Vectors {
    /// The test vectors of a scheme, from the first.
    ///
    /// # Errors
    /// Never: the parameters are constants.
    pub fn new(scheme: Scheme) -> Result<Self, Error> {
        let config = match scheme {
            Scheme::AdaptiveCircle => Config::new(0.5)?.circular(360.0)?,
            _ => Config::new(0.01)?.resilient(4, Some(1000))?,
        };
        Ok(Self {
            scheme,
            signal: Signal::new(1),
            own: censor::OwnFilter::new([[1.0, 1.0], [0.0, 0.9]], [1.0, 0.0], [20.0, 0.0]).ok(),
            encoder: Encoder::new(config),
        })
    }

    /// The next input and its message; `None` is silence.
    ///
    /// # Errors
    /// Never: the inputs are valid.
    pub fn next_record(&mut self) -> Result<(Input, Option<Packet>), Error> {
        let signal = &mut self.signal;
        let codes = |signal: &mut Signal| [signal.whole(16), signal.whole(14)];
        Ok(match self.scheme {
            Scheme::SignBit => {
                let [x, threshold] = [signal.multiple(), signal.multiple()];
                (Input::floats(&[x, threshold]), Some(bit(sign_bit(x, threshold)?)))
            }
            Scheme::SignBitCodes => {
                let [x, threshold] = codes(signal);
                (Input::codes(&[x, threshold]), Some(bit(sign_bit(x, threshold)?)))
            }
            Scheme::InnovationWord => {
                let [x, mean] = [signal.multiple(), signal.multiple()];
                let deviation = signal.multiple().abs() + 0.25;
                let cell = innovation_cell(&THRESHOLDS, x, mean, deviation)?;
                (Input::floats(&[x, mean, deviation]), Some(word(cell, 2)))
            }
            Scheme::InnovationWordCodes => {
                let [x, mean] = codes(signal);
                let deviation = signal.whole(12).unsigned_abs() + 1;
                let cell = innovation_cell_of_codes(&CODE_THRESHOLDS, x, mean, deviation);
                (Input::codes(&[x, mean, deviation as i32]), Some(word(cell, 2)))
            }
            Scheme::QuantizerWord => {
                let x = signal.multiple();
                let said = Quantizer::new(&QUANTIZER, &WORDS, 3)?.word(x)?;
                (Input::floats(&[x]), Some(word(said.into(), 3)))
            }
            Scheme::QuantizerWordCodes => {
                let x = (signal.whole(16) + 0x8000) as u16;
                let said = Quantizer::new(&QUANTIZER_CODES, &WORDS, 3)?.word(x)?;
                let mut input = Input::EMPTY;
                input.put(&x.to_le_bytes());
                (input, Some(word(said.into(), 3)))
            }
            Scheme::PatternBit => {
                let x = signal.multiple();
                (Input::floats(&[x]), Some(bit(pattern_bit(&PATTERN, x)?)))
            }
            Scheme::RangeLevel => {
                let [range, centre] = [signal.multiple(), signal.multiple()];
                let half_width = signal.multiple().abs() + 0.125;
                let level = range_level(range, centre, half_width, 8)?;
                (Input::floats(&[range, centre, half_width]), Some(word(level as usize, 3)))
            }
            Scheme::RangeLevelCodes => {
                let [range, centre] = codes(signal);
                let half_width = signal.whole(15).unsigned_abs();
                let level = range_level_of_codes(range, centre, half_width, 8);
                let input = Input::codes(&[range, centre, half_width as i32]);
                (input, Some(word(level as usize, 3)))
            }
            Scheme::Censoring => {
                let [x, prediction] = [signal.multiple(), signal.multiple()];
                let half_width = signal.multiple().abs();
                let said = censor::speaks(x, prediction, half_width)?;
                (Input::floats(&[x, prediction, half_width]), said.then(|| double(x)))
            }
            Scheme::CensoringCodes => {
                let [x, prediction] = codes(signal);
                let half_width = signal.whole(15).unsigned_abs();
                let said = censor::speaks_of_codes(x, prediction, half_width);
                let input = Input::codes(&[x, prediction, half_width as i32]);
                (input, said.then(|| word(usize::from(x as u16), 16)))
            }
            Scheme::CensoringTold => {
                let [x, prediction] = [signal.multiple(), signal.multiple()];
                let [a, b, d] = [
                    signal.multiple().abs(),
                    signal.multiple() / 64.0,
                    signal.multiple().abs(),
                ];
                let half_width = censor::half_width(&[1.0, 0.5], &[[a + 1.0, b], [b, d + 1.0]], 0.25, 2.0)?;
                let said = censor::speaks(x, prediction, half_width)?;
                (Input::floats(&[x, prediction, a + 1.0, b, d + 1.0]), said.then(|| double(x)))
            }
            Scheme::CensoringOwn => {
                let x = 20.0 + signal.multiple() / 2.0;
                let said = match &mut self.own {
                    Some(own) => own.speaks(x, &[0.5, 0.2], 8.0)?,
                    None => false,
                };
                (Input::floats(&[x]), said.then(|| double(x)))
            }
            Scheme::Trigger => {
                let [x, prediction] = [signal.multiple(), signal.multiple()];
                let uniform = (signal.random() >> 11) as f64 / (1_u64 << 53) as f64;
                let said = trigger::speaks(x, prediction, 0.01, uniform)?;
                (Input::floats(&[x, prediction, uniform]), said.then(|| double(x)))
            }
            Scheme::Adaptive => {
                let x = signal.sample();
                (Input::floats(&[x]), self.encoder.encode(x)?.map(|report| report.packet))
            }
            Scheme::AdaptiveCircle => {
                let x = signal.thousandths().1 as f64 / 100.0;
                (Input::floats(&[x]), self.encoder.encode(x)?.map(|report| report.packet))
            }
        })
    }
}

fn double(x: f64) -> Packet {
    let mut packet = Packet::default();
    packet.push(x.to_bits(), 64);
    packet
}

/// FNV-1a of 64 bits over lengths and bytes of the first `count` messages of a scheme.
///
/// # Errors
/// Never: parameters and inputs are valid.
pub fn hash(scheme: Scheme, count: u32) -> Result<u64, Error> {
    let mut hash = Hash::START;
    let mut vectors = Vectors::new(scheme)?;
    for _ in 0..count {
        hash.add(vectors.next_record()?.1);
    }
    Ok(hash.0)
}

/// Running checksum of messages (FNV-1a of 64 bits).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Hash(pub u64);

impl Hash {
    /// The checksum before the first message.
    pub(crate) const START: Self = Self(0xcbf2_9ce4_8422_2325);

    /// Adds one message, or silence, to the checksum.
    pub(crate) fn add(&mut self, message: Option<Packet>) {
        let packet = message.unwrap_or_default();
        self.byte(packet.bits() as u8);
        for byte in packet.to_bytes().iter().take(packet.byte_count()) {
            self.byte(*byte);
        }
    }

    fn byte(&mut self, byte: u8) {
        self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    }
}
