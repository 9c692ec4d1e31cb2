//! Schemes that compare a sample with thresholds: sign bit, word, bit of a binary pattern.

use crate::error::{Error, finite, positive};
use crate::sample::Sample;

/// Whether the sample is at or above the threshold. In the Dymbo filter the threshold is the broadcast prediction.
///
/// # Errors
/// If sample or threshold is not finite.
#[inline]
pub fn sign_bit<T: Sample>(sample: T, threshold: T) -> Result<bool, Error> {
    if !sample.is_finite() {
        return Err(Error::new("measurement", sample.to_f64(), "a finite number"));
    }
    if !threshold.is_finite() {
        return Err(Error::new("threshold", threshold.to_f64(), "a finite number"));
    }
    Ok(sample >= threshold)
}

/// Number of thresholds at or below the sample. If the thresholds increase, it is the index of the cell that contains the sample. A sample
/// at a threshold is in the cell above; infinite samples are in the outer cells.
///
/// # Errors
/// If the sample is NaN.
#[inline]
pub fn cell_of<T: Sample>(thresholds: &[T], sample: T) -> Result<usize, Error> {
    if sample.is_number() {
        Ok(thresholds.partition_point(|threshold| *threshold <= sample))
    } else {
        Err(Error::new("measurement", sample.to_f64(), "a number"))
    }
}

/// The bit of a binary pattern, which changes at every threshold: the parity of [`cell_of`].
///
/// # Errors
/// If the sample is NaN.
#[inline]
pub fn pattern_bit<T: Sample>(thresholds: &[T], sample: T) -> Result<bool, Error> {
    Ok(cell_of(thresholds, sample)? % 2 == 1)
}

/// Index of the cell of the innovation `(sample - mean) / deviation` among thresholds in standard deviations.
///
/// # Errors
/// If sample or mean is not finite, or the deviation is not positive.
#[inline]
pub fn innovation_cell(thresholds: &[f64], sample: f64, mean: f64, deviation: f64) -> Result<usize, Error> {
    let scale = positive("deviation", deviation)?;
    let innovation = finite("measurement", sample)? - finite("prediction", mean)?;
    // Products instead of a quotient, because a division in software needs much code.
    Ok(thresholds.partition_point(|threshold| threshold * scale <= innovation))
}

/// [`innovation_cell`] without floating point: sample, mean and deviation are integer codes, the thresholds multiples of `2^-16`
/// deviations.
#[inline]
pub fn innovation_cell_of_codes(thresholds: &[i32], sample: i32, mean: i32, deviation: u32) -> usize {
    // The sides are below 2^33 * 2^16 and 2^31 * 2^32, so neither overflows.
    let innovation = (i64::from(sample) - i64::from(mean)) << 16;
    thresholds.partition_point(|threshold| i64::from(*threshold) * i64::from(deviation) <= innovation)
}

/// A designed quantizer: thresholds and the word of each cell, as `Export::to_rust` of `quantizer-design` writes them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantizer<'a, T> {
    thresholds: &'a [T],
    words: &'a [u16],
    bits: u32,
}

impl<'a, T: Sample> Quantizer<'a, T> {
    /// A quantizer of `thresholds.len() + 1` cells whose words have `bits` bits. Cells may share a word.
    ///
    /// # Errors
    /// If `bits` is not in `1..=16`, there is not one word per cell, a word does not fit, or the thresholds are not finite and strictly
    /// increasing.
    pub fn new(thresholds: &'a [T], words: &'a [u16], bits: u32) -> Result<Self, Error> {
        if !(1..=16).contains(&bits) {
            return Err(Error::new("bits", f64::from(bits), "1 to 16"));
        }
        if words.len() != thresholds.len() + 1 {
            return Err(Error::new("words", words.len() as f64, "one word per cell"));
        }
        if let Some(word) = words.iter().find(|word| u32::from(**word) >> bits != 0) {
            return Err(Error::new("words", f64::from(*word), "words of so many bits"));
        }
        let mut before = None;
        for threshold in thresholds {
            if !threshold.is_finite() || before.is_some_and(|before| before >= *threshold) {
                return Err(Error::new("thresholds", threshold.to_f64(), "finite and strictly increasing"));
            }
            before = Some(*threshold);
        }
        Ok(Self {
            thresholds,
            words,
            bits,
        })
    }

    /// Length of a word in bits.
    pub fn bits(&self) -> u32 {
        self.bits
    }

    /// The word of a sample.
    ///
    /// # Errors
    /// If the sample is NaN.
    #[inline]
    pub fn word(&self, sample: T) -> Result<u16, Error> {
        let cell = cell_of(self.thresholds, sample)?;
        // There is a word for every cell.
        Ok(self.words.get(cell).copied().unwrap_or(0))
    }
}
