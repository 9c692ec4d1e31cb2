//! Several successive bits about the same sample. Each threshold is the estimate so far.
//!
//! Each bit can be processed as a Dymbo step, and a sensor could stop early. But after the first bit the density of the sample is half
//! a normal density. If it is taken as normal, the filter computes more information ([`IteratedInformation::claimed`]) than the bits
//! bring. A Lloyd-Max word of the same length is better at every length; successive bits should at least use the exact conditional
//! means ([`exact_tree_information`]).

use fewbits_dymbo::Error;
use fewbits_numerics::error::ArgumentError;
use fewbits_numerics::normal::{interval, truncated_moments};
use std::f64::consts::FRAC_2_PI;

/// Largest number of bits about one sample; the number of words doubles with each bit.
const MAX_BITS: usize = 16;

fn check_bits(bits: usize) -> Result<(), Error> {
    if (1..=MAX_BITS).contains(&bits) {
        Ok(())
    } else {
        Err(ArgumentError::new("bits", bits, format!("a word length from 1 to {MAX_BITS}")).into())
    }
}

/// Information coefficient `1 - E (z - y)^2` of successive bits about `z ~ N(0, 1)` with each threshold at the exact mean of
/// the cell so far.
///
/// # Errors
/// If `bits` is outside `1..=16`.
pub fn exact_tree_information(bits: usize) -> Result<f64, Error> {
    check_bits(bits)?;
    let mut cells = vec![(f64::NEG_INFINITY, f64::INFINITY)];
    for _ in 0..bits {
        let mut halves = Vec::with_capacity(2 * cells.len());
        for (low, high) in cells {
            let mean = truncated_moments(low, high)?.mean;
            halves.extend([(low, mean), (mean, high)]);
        }
        cells = halves;
    }
    cells.iter().try_fold(0.0, |sum, &(low, high)| {
        let mean = truncated_moments(low, high)?.mean;
        Ok(sum + interval(low, high) * mean * mean)
    })
}

/// Information coefficients of successive bits if each step assumes a normal density.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IteratedInformation {
    /// The coefficient that follows from the assumption: `1 - (1 - 2/pi)^m` for `m` bits.
    pub claimed: f64,
    /// The true coefficient if a word is reconstructed by the sum of its steps.
    pub with_own_levels: f64,
    /// The true coefficient if a word is reconstructed by the mean of its cell.
    pub with_centroids: f64,
    /// Number of words that no sample causes.
    pub empty_words: usize,
}

/// Evaluates the usual iterated quantization, with steps `+- sqrt(2/pi) (1 - 2/pi)^(k/2)`.
///
/// # Errors
/// If `bits` is outside `1..=16`.
pub fn normal_assumption_information(bits: usize) -> Result<IteratedInformation, Error> {
    check_bits(bits)?;
    // Lower end, upper end and reconstruction level of each word's cell.
    let mut words = vec![(f64::NEG_INFINITY, f64::INFINITY, 0.0)];
    let mut variance = 1.0;
    for _ in 0..bits {
        let step = (FRAC_2_PI * variance).sqrt();
        variance *= 1.0 - FRAC_2_PI;
        words = words
            .iter()
            .flat_map(|&(low, high, level)| {
                [
                    (low, f64::min(high, level), level - step),
                    (f64::max(low, level), high, level + step),
                ]
            })
            .collect();
    }
    let mut result = IteratedInformation {
        claimed: 1.0 - variance,
        with_own_levels: 0.0,
        with_centroids: 0.0,
        empty_words: 0,
    };
    for (low, high, level) in words {
        if low >= high {
            result.empty_words += 1;
            continue;
        }
        let (probability, mean) = (interval(low, high), truncated_moments(low, high)?.mean);
        result.with_own_levels += probability * level * (2.0 * mean - level);
        result.with_centroids += probability * mean * mean;
    }
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::{exact_tree_information, normal_assumption_information};
    use fewbits_quantizers::lloyd_max::gaussian_table;
    use std::f64::consts::FRAC_2_PI;

    #[test]
    fn one_bit_is_one_bit_and_batches_win() {
        let one = normal_assumption_information(1).unwrap();
        for c in [
            one.claimed,
            one.with_own_levels,
            one.with_centroids,
            exact_tree_information(1).unwrap(),
        ] {
            assert!((c - FRAC_2_PI).abs() < 1e-14);
        }
        for bits in 2..=5 {
            let batch = 1.0 - gaussian_table(bits).unwrap().mean_squared_error();
            let exact = exact_tree_information(bits).unwrap();
            let assumed = normal_assumption_information(bits).unwrap();
            assert!(batch > exact && exact >= assumed.with_centroids - 1e-14);
            assert!(assumed.with_centroids > assumed.with_own_levels);
            assert_eq!(assumed.empty_words > 0, bits >= 5, "{bits}");
        }
        assert!(exact_tree_information(0).is_err() && normal_assumption_information(17).is_err());
    }
}
