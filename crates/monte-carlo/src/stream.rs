//! Random streams: one for each logical unit of work, not one per thread.
//!
//! A [`Stream`] is a 128-bit key. It is the hash of a path: seed, experiment, sweep point, trial, purpose. The same path
//! gives the same numbers on every machine, in any order and on any number of threads. Different paths give
//! independent numbers. Schemes can therefore be compared on common random numbers (the same path for truth and noise), while their
//! own draws are independent (another purpose).
//!
//! ```
//! use fewbits_monte_carlo::Stream;
//! use rand::RngExt;
//! let trial = Stream::new(1).named("dymbo-fig5").indexed(7);
//! let truth: f64 = trial.named("truth").rng().random();
//! let again: f64 = Stream::new(1).named("dymbo-fig5").indexed(7).named("truth").rng().random();
//! assert_eq!(truth, again);
//! assert_ne!(truth, trial.named("filter").rng().random::<f64>());
//! ```

use rand_pcg::{Pcg64Dxsm, Pcg64Mcg};
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// A node in the tree of random streams.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Stream {
    key: [u64; 2],
}

const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// A bijection of 64-bit numbers in which every output bit depends on every input bit (the SplitMix64 finaliser).
fn scramble(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Stream {
    /// The root of all streams of one seed.
    pub fn new(seed: u64) -> Self {
        Self {
            key: [scramble(seed.wrapping_add(GOLDEN)), scramble(!seed)],
        }
    }

    /// The substream of a name: an experiment, a purpose.
    pub fn named(self, name: &str) -> Self {
        let labelled = self.absorb(name.len() as u64 ^ 0x6e61_6d65);
        name.as_bytes().chunks(8).fold(labelled, |stream, chunk| {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            stream.absorb(u64::from_le_bytes(word))
        })
    }

    /// The substream of an index: a sweep point, a trial, a sensor.
    pub fn indexed(self, index: u64) -> Self {
        self.absorb(0x0069_6e64_6578).absorb(index)
    }

    fn absorb(self, word: u64) -> Self {
        let [a, b] = self.key;
        let a = scramble(a ^ word.wrapping_add(GOLDEN));
        let b = scramble(b.rotate_left(23).wrapping_add(word) ^ a);
        Self { key: [a, b] }
    }

    /// A generator for statistics: PCG-64 DXSM.
    pub fn rng(self) -> Pcg64Dxsm {
        Pcg64Dxsm::new(self.wide(), u128::from(scramble(self.key[0] ^ self.key[1])))
    }

    /// A faster generator for inner loops such as particle filters: PCG-64 MCG.
    pub fn fast_rng(self) -> Pcg64Mcg {
        Pcg64Mcg::new(self.wide())
    }

    fn wide(self) -> u128 {
        u128::from(self.key[0]) << 64 | u128::from(self.key[1])
    }
}
