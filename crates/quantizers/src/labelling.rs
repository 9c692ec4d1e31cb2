//! The binary word of each level, and the message that carries it.

use crate::error::{Error, refuse};
use fewbits_core::Message;
use fewbits_core::bits::{BitReader, BitWriter, CodecError};
use serde::{Deserialize, Serialize};

/// Largest number of bits of a word.
pub(crate) const MAX_WORD_BITS: u32 = 16;

/// An injective map from levels to words with a fixed number of bits.
///
/// Words without a level can still be received over a noisy link. They get the symbol numbers from `levels` on, in
/// increasing order of the word, so that every received word is a symbol in `0..2^bits`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct Labelling {
    bits: u32,
    levels: usize,
    /// Word of each symbol, levels first.
    words: Vec<u32>,
    /// Symbol of each word.
    symbols: Vec<u32>,
}

/// The stored form of [`Labelling`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    bits: u32,
    words: Vec<u32>,
}

impl From<Labelling> for Stored {
    fn from(labelling: Labelling) -> Self {
        Self {
            bits: labelling.bits,
            words: labelling.words[..labelling.levels].to_vec(),
        }
    }
}

impl TryFrom<Stored> for Labelling {
    type Error = Error;

    fn try_from(parts: Stored) -> Result<Self, Error> {
        Labelling::with_words(parts.bits, parts.words)
    }
}

impl Labelling {
    /// Level `z` is sent as the number `z` in `ceil(log2 levels)` bits.
    ///
    /// # Errors
    /// If `levels` is not in `2..=65536`.
    pub fn natural(levels: usize) -> Result<Self, Error> {
        Self::with_words(word_bits(levels)?, (0..levels as u32).collect())
    }

    /// Level `z` is sent as `z ^ (z >> 1)` (Gray code): words of neighbouring levels differ in one bit.
    ///
    /// # Errors
    /// If `levels` is not in `2..=65536`.
    pub fn gray(levels: usize) -> Result<Self, Error> {
        Self::with_words(word_bits(levels)?, (0..levels as u32).map(|z| z ^ (z >> 1)).collect())
    }

    /// Level `z` is sent as `words[z]`, with the smallest number of bits that is enough for the levels.
    ///
    /// # Errors
    /// As [`Labelling::with_words`].
    pub fn new(words: Vec<u32>) -> Result<Self, Error> {
        Self::with_words(word_bits(words.len())?, words)
    }

    /// Level `z` is sent as `words[z]` in `bits` bits.
    ///
    /// # Errors
    /// If `bits` is not in `1..=16`, there are fewer than two words, one does not fit, or two are equal.
    pub fn with_words(bits: u32, mut words: Vec<u32>) -> Result<Self, Error> {
        if !(1..=MAX_WORD_BITS).contains(&bits) {
            return refuse("bits", bits, format!("a word length from 1 to {MAX_WORD_BITS}"));
        }
        let levels = words.len();
        if levels < 2 {
            return refuse("words", format!("{levels} words"), "at least two words");
        }
        let mut symbols = vec![u32::MAX; 1 << bits];
        // Invert the map from levels to words; a word that is too large or used twice is an error.
        for (symbol, word) in words.iter().enumerate() {
            match symbols.get_mut(*word as usize) {
                Some(slot) if *slot == u32::MAX => *slot = symbol as u32,
                Some(_) => return refuse("words", format!("{word} twice"), "a permutation: every word at most once"),
                None => return refuse("words", word, format!("words below 2^{bits}")),
            }
        }
        // Words without a level become the symbols after the levels.
        for (word, slot) in symbols.iter_mut().enumerate() {
            if *slot == u32::MAX {
                *slot = words.len() as u32;
                words.push(word as u32);
            }
        }
        Ok(Self {
            bits,
            levels,
            words,
            symbols,
        })
    }

    /// Number of bits of a word.
    pub fn bits(&self) -> u32 {
        self.bits
    }

    /// Number of levels that can be sent.
    pub fn levels(&self) -> usize {
        self.levels
    }

    /// Number of symbols that can be received, `2^bits`. Symbols from `levels` on are words that are never sent.
    pub fn symbols(&self) -> usize {
        self.words.len()
    }

    /// Word of symbol `symbol`; `None` if there is no such symbol.
    pub fn word(&self, symbol: usize) -> Option<u32> {
        self.words.get(symbol).copied()
    }

    /// Symbol of a received word; bits above the word length are ignored.
    pub(crate) fn symbol(&self, word: u32) -> usize {
        self.symbols[word as usize & (self.symbols.len() - 1)] as usize
    }

    /// Word of a symbol that may be received.
    ///
    /// # Errors
    /// If there is no such symbol.
    pub fn word_of(&self, symbol: Symbol) -> Result<u64, fewbits_core::Error> {
        match self.word(symbol.0) {
            Some(word) => Ok(word.into()),
            None => refuse("symbol", symbol.0, format!("a symbol below {}", self.symbols())),
        }
    }

    /// Words of the levels.
    pub fn level_words(&self) -> impl Iterator<Item = u64> + '_ {
        self.words[..self.levels].iter().copied().map(u64::from)
    }
}

fn word_bits(levels: usize) -> Result<u32, Error> {
    if !(2..=1 << MAX_WORD_BITS).contains(&levels) {
        return refuse("levels", levels, format!("2 to {} levels", 1 << MAX_WORD_BITS));
    }
    Ok(usize::BITS - (levels - 1).leading_zeros())
}

/// A quantizer level as a message, or the symbol that was received.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Symbol(pub usize);

impl Message for Symbol {
    type Format = Labelling;

    fn encode(&self, labelling: &Labelling, writer: &mut BitWriter) -> Result<(), CodecError> {
        let word = labelling.word(self.0).ok_or_else(|| CodecError::Invalid {
            what: "symbol",
            value: self.0.to_string(),
            expected: "a symbol of the labelling",
        })?;
        writer.write(u64::from(word), labelling.bits)
    }

    fn decode(labelling: &Labelling, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        Ok(Self(labelling.symbol(reader.read(labelling.bits)? as u32)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::laws::message as laws;

    #[test]
    fn every_symbol_survives_its_bits() {
        for labelling in [
            Labelling::natural(5).unwrap(),
            Labelling::gray(8).unwrap(),
            Labelling::new(vec![0, 3, 1, 2]).unwrap(),
            Labelling::with_words(2, vec![0, 1, 3]).unwrap(),
        ] {
            for symbol in 0..labelling.symbols() {
                assert_eq!(laws::round_trip(&Symbol(symbol), &labelling), Ok(labelling.bits() as usize));
            }
            assert!(Symbol(labelling.symbols()).to_bits(&labelling).is_err());
        }
    }

    #[test]
    fn neighbours_in_gray_code_differ_in_one_bit() {
        let gray = Labelling::gray(16).unwrap();
        for z in 0..15 {
            assert_eq!((gray.word(z).unwrap() ^ gray.word(z + 1).unwrap()).count_ones(), 1);
        }
    }

    #[test]
    fn unused_words_come_behind_the_levels() {
        let three = Labelling::with_words(2, vec![0, 1, 3]).unwrap();
        assert_eq!((three.levels(), three.symbols(), three.symbol(2), three.symbol(3)), (3, 4, 3, 2));
    }

    #[test]
    fn bad_words_are_refused() {
        assert!(
            Labelling::new(vec![0, 1, 1, 2])
                .unwrap_err()
                .to_string()
                .contains("permutation")
        );
        assert!(Labelling::new(vec![0, 4, 1, 2]).is_err());
        assert!(Labelling::natural(1).is_err());
        assert!(Labelling::with_words(17, vec![0, 1]).is_err());
        assert!(Labelling::natural(1 << 40).is_err());
        let gaps = Labelling::with_words(2, vec![0, 1, 3]).unwrap();
        let json = serde_json::to_string(&gaps).unwrap();
        assert_eq!(serde_json::from_str::<Labelling>(&json).unwrap(), gaps);
        assert!(serde_json::from_str::<Labelling>(r#"{"bits":2,"words":[0,0]}"#).is_err());
    }
}
