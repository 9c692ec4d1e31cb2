//! The words of a column, and the place of each in their list.

use crate::missing;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// A fast hash of short texts. The maps that use it have few keys, so that texts chosen to collide cost little.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Quick(u64);

/// Builds [`Quick`].
pub(crate) type Hashing = BuildHasherDefault<Quick>;

impl Hasher for Quick {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.0 = (self.0.rotate_left(5) ^ u64::from_le_bytes(word)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        }
    }

    fn finish(&self) -> u64 {
        self.0 ^ (self.0 >> 32)
    }
}

/// Words in their order.
#[derive(Debug, Clone, Default)]
pub(crate) struct Words {
    list: Vec<String>,
    places: HashMap<String, u32, Hashing>,
    /// Whether no further words may come.
    pub(crate) is_fixed: bool,
}

impl Words {
    pub(crate) fn new(list: Vec<String>) -> Self {
        let mut places = HashMap::default();
        // What means a gap everywhere is no word, whoever lists it.
        for (word, place) in list.iter().zip(0..).filter(|(word, _)| !missing::is_usual(word, false)) {
            places.entry(word.clone()).or_insert(place);
        }
        Self {
            list,
            places,
            is_fixed: false,
        }
    }

    /// A list to which no words are added.
    pub(crate) fn fixed(list: Vec<String>) -> Self {
        Self {
            is_fixed: true,
            ..Self::new(list)
        }
    }

    pub(crate) fn as_slice(&self) -> &[String] {
        &self.list
    }

    pub(crate) fn place(&self, word: &str) -> Option<u32> {
        self.places.get(word).copied()
    }

    /// Adds a word that is not there, and returns its place.
    pub(crate) fn push(&mut self, word: &str) -> u32 {
        let place = self.list.len() as u32;
        self.list.push(word.to_owned());
        self.places.insert(word.to_owned(), place);
        place
    }
}
