//! Linear patterns: XORs of the binary digits of the cell index, given by masks over GF(2).

use crate::Error;
use crate::patterns::grid::bits_in_range;
use crate::{Pattern, PatternSensor};
use fewbits_numerics::error::refuse;
use fewbits_quantizers::Quantizer;

/// Selects the digits that are XORed: the most significant of the `bits` binary digits selects pattern 1.
///
/// With three bits, `4` is the sign bit `00001111`, `6` its XOR with the second, `00111100`, and so on.
pub type Mask = u32;

/// Checks that `mask` is in `1..2^bits`.
pub(crate) fn check_mask(mask: Mask, bits: usize) -> Result<Mask, Error> {
    let bits = bits_in_range(bits)?;
    if mask != 0 && mask < 1 << bits {
        Ok(mask)
    } else {
        refuse("mask", mask, format!("a mask in 1..{}", 1u32 << bits))
    }
}

/// The pattern of a mask over `2^bits` cells: bit `l` is the parity of `mask & l`. Inverse of [`mask_of`].
///
/// # Errors
/// If `bits` is not in `1..=16`, or the mask is 0 or has a digit beyond `bits`.
pub fn linear_pattern(mask: Mask, bits: usize) -> Result<Pattern, Error> {
    check_mask(mask, bits)?;
    Pattern::new((0..1u32 << bits).map(|l| (l & mask).count_ones() % 2 == 1).collect())
}

/// Masks of the natural binary code, most significant digit first: `{4, 2, 1}` for three bits.
///
/// # Errors
/// If `bits` is not in `1..=16`.
pub fn natural_basis(bits: usize) -> Result<Vec<Mask>, Error> {
    let bits = bits_in_range(bits)?;
    Ok((0..bits).rev().map(|at| 1 << at).collect())
}

/// Masks of the reflected Gray code, most significant bit first: `{4, 6, 3}` for three bits.
///
/// # Errors
/// If `bits` is not in `1..=16`.
pub fn gray_basis(bits: usize) -> Result<Vec<Mask>, Error> {
    let natural = natural_basis(bits)?;
    Ok((0..natural.len())
        .map(|b| {
            if b == 0 {
                natural[0]
            } else {
                natural[b - 1] | natural[b]
            }
        })
        .collect())
}

/// A set of vectors over GF(2) in echelon form.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Span {
    leading: [Mask; 32],
    rank: usize,
}

impl Span {
    pub(crate) fn rank(&self) -> usize {
        self.rank
    }

    /// The span with one more vector.
    #[must_use]
    pub(crate) fn with(mut self, mut mask: Mask) -> Self {
        while mask != 0 {
            let top = mask.ilog2() as usize;
            if self.leading[top] == 0 {
                self.leading[top] = mask;
                self.rank += 1;
                break;
            }
            mask ^= self.leading[top];
        }
        self
    }
}

/// Rank over GF(2) of a set of masks. Their patterns distinguish all `2^bits` cells if and only if it is `bits`.
pub fn rank(masks: &[Mask]) -> usize {
    masks.iter().fold(Span::default(), |span, &mask| span.with(mask)).rank()
}

/// The mask of a pattern over `2^bits` cells, if it is linear.
pub fn mask_of(pattern: &Pattern) -> Option<Mask> {
    let cells = pattern.cells();
    if !cells.is_power_of_two() || cells > 1 << crate::patterns::grid::MAX_BITS {
        return None;
    }
    let bits = cells.trailing_zeros() as usize;
    // A linear pattern is determined by its bits at the powers of two.
    let mask = (0..bits)
        .filter(|&at| pattern.bits()[1 << at])
        .fold(0, |m, at| m | 1 << at);
    (linear_pattern(mask, bits).as_ref() == Ok(pattern)).then_some(mask)
}

/// Sensors of equal noise with the patterns of these masks.
pub fn sensors_of(masks: &[Mask], grid: &Quantizer, noise_deviation: f64) -> Result<Vec<PatternSensor>, Error> {
    let bits = grid_bits(grid)?;
    let sensor = |mask: &Mask| PatternSensor::with_deviation(linear_pattern(*mask, bits)?.on(grid)?, noise_deviation);
    masks.iter().map(sensor).collect()
}

/// Number of bits of the grid's cell index; an error if its number of cells is not a power of two.
pub fn grid_bits(grid: &Quantizer) -> Result<usize, Error> {
    match grid.cells() {
        cells if cells.is_power_of_two() => bits_in_range(cells.trailing_zeros() as usize),
        cells => refuse("grid", format!("{cells} cells"), "a power of two of cells"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strings(masks: &[Mask], bits: usize) -> Vec<String> {
        masks
            .iter()
            .map(|&m| linear_pattern(m, bits).unwrap().to_string())
            .collect()
    }

    #[test]
    fn bases_of_three_bits() {
        assert_eq!(natural_basis(3).unwrap(), [4, 2, 1]);
        assert_eq!(gray_basis(3).unwrap(), [4, 6, 3]);
        assert_eq!(gray_basis(4).unwrap(), [8, 12, 6, 3]);
        assert_eq!(strings(&[4, 2, 1], 3), ["00001111", "00110011", "01010101"]);
        assert_eq!(strings(&[14, 5, 11], 4), ["0011110011000011", "0101101001011010", "0110011010011001"]);
    }

    #[test]
    fn only_linear_patterns_have_masks() {
        assert_eq!(mask_of(&"00111100".parse().unwrap()), Some(6));
        // Table 5.2 prints this one, which is no XOR of natural patterns.
        assert_eq!(mask_of(&"10001110".parse().unwrap()), None);
        assert_eq!(mask_of(&"010".parse().unwrap()), None);
        for mask in 1..16 {
            assert_eq!(mask_of(&linear_pattern(mask, 4).unwrap()), Some(mask));
        }
    }

    #[test]
    fn bad_masks_are_refused() {
        assert!(linear_pattern(0, 3).is_err());
        assert!(linear_pattern(8, 3).is_err());
        assert!(linear_pattern(1, 0).is_err());
        assert!(linear_pattern(1, 17).is_err());
        assert!(gray_basis(0).is_err());
    }
}
