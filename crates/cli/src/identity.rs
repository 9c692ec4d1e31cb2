//! The identity of what is packed: it depends on the bytes of the table and on the schema, so that the same command gives the same bytes,
//! also after a kill.
//!
//! The bytes are hashed while a table is read. A header stands before the first block, so a table that is packed in a single pass is
//! hashed before.

use fewbits_record::Schema;
use std::fs::File;
use std::io::Read;
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes read at once.
const CHUNK: usize = 1 << 16;

/// A hash of bytes by words of eight, whatever the pieces in which they come.
#[derive(Debug, Clone, Default)]
struct Hash {
    state: u64,
    /// Bytes that are no whole word yet.
    rest: [u8; 8],
    length: usize,
    count: u64,
}

impl Hash {
    fn word(&mut self, word: u64) {
        // Both halves of a product, so that every bit of a word reaches all others.
        let product = u128::from(self.state ^ word) * 0x9e37_79b9_7f4a_7c15_u128;
        self.state = ((product ^ (product >> 64)) as u64).wrapping_add(0xd6e8_feb8_6659_fd93);
    }

    fn add(&mut self, mut bytes: &[u8]) {
        self.count += bytes.len() as u64;
        if self.length > 0 {
            let taken = bytes.len().min(8 - self.length);
            self.rest[self.length..self.length + taken].copy_from_slice(&bytes[..taken]);
            self.length += taken;
            bytes = &bytes[taken..];
            if self.length < 8 {
                return;
            }
            self.word(u64::from_le_bytes(self.rest));
            self.length = 0;
        }
        let (words, rest) = bytes.as_chunks::<8>();
        for word in words {
            self.word(u64::from_le_bytes(*word));
        }
        self.rest[..rest.len()].copy_from_slice(rest);
        self.length = rest.len();
    }

    fn finish(mut self) -> u64 {
        let mut rest = [0; 8];
        rest[..self.length].copy_from_slice(&self.rest[..self.length]);
        for word in [u64::from_le_bytes(rest), self.count, 0, 0] {
            self.word(word);
        }
        self.state
    }
}

/// The hash of a file, once a reader of it has come to its end. By default nothing is hashed.
#[derive(Debug, Clone, Default)]
pub(crate) struct Identity(Option<Arc<Mutex<Option<u64>>>>);

impl Identity {
    /// Hashes what is read from now on.
    pub(crate) fn wanted() -> Self {
        Self(Some(Arc::default()))
    }

    /// The source, hashed if wanted.
    pub(crate) fn read<R: Read>(&self, source: R) -> Hashed<R> {
        Hashed {
            source,
            hash: Hash::default(),
            identity: self.clone(),
        }
    }

    /// The identity of a file that is packed with this schema. The file is read if no reader came to its end.
    pub(crate) fn of(&self, file: &str, schema: &Schema) -> std::io::Result<u32> {
        let known = self.0.as_ref();
        let known = known.and_then(|known| *known.lock().unwrap_or_else(PoisonError::into_inner));
        let content = match known {
            Some(content) => content,
            None => {
                let (mut source, mut chunk, mut hash) = (File::open(file)?, vec![0; CHUNK], Hash::default());
                loop {
                    match source.read(&mut chunk)? {
                        0 => break hash.finish(),
                        count => hash.add(&chunk[..count]),
                    }
                }
            }
        };
        let mut hash = Hash::default();
        hash.add(format!("{schema:?}").as_bytes());
        hash.add(&content.to_le_bytes());
        Ok(hash.finish() as u32)
    }
}

/// A source whose bytes are hashed.
pub(crate) struct Hashed<R> {
    source: R,
    hash: Hash,
    identity: Identity,
}

impl<R: Read> Read for Hashed<R> {
    fn read(&mut self, target: &mut [u8]) -> std::io::Result<usize> {
        let count = self.source.read(target)?;
        if let Some(identity) = &self.identity.0 {
            self.hash.add(&target[..count]);
            if count == 0 && !target.is_empty() {
                let mut known = identity.lock().unwrap_or_else(PoisonError::into_inner);
                known.get_or_insert(self.hash.clone().finish());
            }
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::collections::HashSet;

    fn hash(pieces: &[&[u8]]) -> u64 {
        let mut hash = Hash::default();
        pieces.iter().for_each(|piece| hash.add(piece));
        hash.finish()
    }

    #[test]
    fn pieces_do_not_matter() {
        let bytes: Vec<u8> = (0..=255).collect();
        let whole = hash(&[&bytes]);
        for (a, b) in [(0, 1), (1, 2), (3, 20), (7, 8), (8, 16), (9, 255)] {
            assert_eq!(hash(&[&bytes[..a], &bytes[a..b], &bytes[b..]]), whole);
        }
        let mut source = Identity::wanted();
        let mut read = Vec::new();
        source.read(&bytes[..]).read_to_end(&mut read).unwrap();
        assert_eq!(*source.0.take().unwrap().lock().unwrap(), Some(whole));
        assert_eq!(read, bytes);
    }

    #[test]
    fn every_byte_and_every_length_matters() {
        let mut seen = HashSet::new();
        for length in 0..40 {
            let zeros = vec![0; length];
            assert!(seen.insert(hash(&[&zeros]) as u32), "{length}");
            for at in 0..length {
                for bit in 0..8 {
                    let mut bytes = zeros.clone();
                    bytes[at] = 1 << bit;
                    assert!(seen.insert(hash(&[&bytes]) as u32), "{length} {at} {bit}");
                }
            }
        }
    }
}
