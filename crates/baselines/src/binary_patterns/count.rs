//! Sizes of the thesis's search spaces, in 128-bit integers with overflow checks.

use fewbits_binary_patterns::Error;
use fewbits_binary_patterns::count::multisets;
use fewbits_binary_patterns::engine::{bits_in_range, enough_sensors};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::binomial::exact as binomial;

fn overflow(what: &'static str) -> Error {
    ArgumentError::new(what, "too large a number", "one below 2^128").into()
}

/// Number of unordered bases of GF(2)^bits, `prod_{i=1..B} (2^B - 2^(i-1)) / B!` (equation 5.5): 3, 28, 840, ...
///
/// # Errors
/// If `bits` is not in `1..=16` or the number exceeds 128 bits.
pub fn unordered_bases(bits: usize) -> Result<u128, Error> {
    let bits = bits_in_range(bits)?;
    let mut factorial = 1u128;
    let mut count = 1u128;
    for i in 1..=bits {
        factorial *= i as u128;
        count = count
            .checked_mul((1u128 << bits) - (1u128 << (i - 1)))
            .ok_or(overflow("bases"))?;
    }
    Ok(count / factorial)
}

/// Number of sets of `sensors` linear patterns by equation 5.7 of the thesis.
///
/// That equation counts a multiset once for every basis that it contains. [`full_rank_multisets`](fewbits_binary_patterns::count::full_rank_multisets) is correct (erratum `binary-2`).
///
/// # Errors
/// If `bits` is out of range, `sensors < bits`, or the number exceeds 128 bits.
pub fn printed_pattern_sets(bits: usize, sensors: usize) -> Result<u128, Error> {
    enough_sensors(bits, sensors)?;
    let kinds = (1u128 << bits) - 1;
    unordered_bases(bits)?
        .checked_mul(multisets(kinds, (sensors - bits) as u128)?)
        .ok_or(overflow("pattern sets"))
}

/// Number of sets in strategy 1: the Gray basis is fixed, the other `N - B` masks are free.
///
/// # Errors
/// As [`printed_pattern_sets`].
pub fn forced_basis_sets(bits: usize, sensors: usize) -> Result<u128, Error> {
    enough_sensors(bits, sensors)?;
    multisets((1u128 << bits) - 1, (sensors - bits) as u128)
}

/// `n!`, or `None` on overflow.
fn factorial(n: u128) -> Option<u128> {
    (2..=n).try_fold(1u128, |f, i| f.checked_mul(i))
}

/// Number of one-to-one labelings of `2^bits` cells by `bits` bits, up to bit order and complements: `L! / (B! 2^B)`.
///
/// # Errors
/// If `bits` is out of range or the number exceeds 128 bits (six bits and more).
pub fn bijective_labelings(bits: usize) -> Result<u128, Error> {
    let bits = bits_in_range(bits)?;
    let symmetries = factorial(bits as u128).and_then(|f| f.checked_shl(bits as u32));
    factorial(1u128 << bits)
        .zip(symmetries)
        .map(|(all, same)| all / same)
        .ok_or(overflow("labelings"))
}

/// As [`bijective_labelings`], also up to mirror images: 472 for three bits.
///
/// Burnside: half of all labelings plus those equal to their mirror image. A labeling is its own mirror image if reflecting
/// the cells acts on the labels as an involution of the cube without fixed vertices; one with `k` transposed pairs of bits
/// exists for `2^(B-k) - 2^k` complements, and each belongs to `2^(L/2) (L/2)!` labelings.
///
/// # Errors
/// As [`bijective_labelings`].
pub fn bijective_labelings_up_to_reflection(bits: usize) -> Result<u128, Error> {
    let what = "labelings";
    let all = bijective_labelings(bits)?;
    let b = bits as u128;
    let half = 1u128 << (bits - 1);
    let mut involutions = 0u128;
    for k in 0..=bits / 2 {
        // Ways to choose k disjoint pairs out of B bits.
        let pairs = binomial(b, 2 * k as u128)
            .zip(factorial(2 * k as u128))
            .zip(factorial(k as u128))
            .map(|((choose, double), single)| choose * (double / (single << k)))
            .ok_or(overflow(what))?;
        involutions += pairs * ((1u128 << (bits - k)) - (1u128 << k));
    }
    let symmetries = factorial(b).map(|f| f << bits).ok_or(overflow(what))?;
    let own_mirror = factorial(half)
        .and_then(|f| f.checked_mul(1u128.checked_shl(half as u32)?))
        .and_then(|f| f.checked_mul(involutions))
        .ok_or(overflow(what))?
        / symmetries;
    Ok((all + own_mirror) / 2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_binary_patterns::count::full_rank_multisets;

    #[test]
    fn bases_are_full_rank_sets_of_as_many_masks_as_bits() {
        for bits in 1..=6 {
            assert_eq!(unordered_bases(bits).unwrap(), full_rank_multisets(bits, bits).unwrap());
        }
    }

    #[test]
    fn labelings_agree_with_listing() {
        // Two bits: the three cyclic arrangements of a square's labels, all their own mirror images but none lost.
        assert_eq!(bijective_labelings(2).unwrap(), 3);
        assert_eq!(bijective_labelings_up_to_reflection(1).unwrap(), 1);
        assert_eq!(bijective_labelings_up_to_reflection(2).unwrap(), 3);
        assert_eq!(bijective_labelings_up_to_reflection(3).unwrap(), 472);
    }

    #[test]
    fn overflow_and_bad_arguments_are_errors() {
        assert!(matches!(bijective_labelings(8), Err(Error::Argument(e)) if e.expected == "one below 2^128"));
        assert!(matches!(unordered_bases(16), Err(Error::Argument(e)) if e.expected == "one below 2^128"));
        assert!(unordered_bases(0).is_err());
        assert!(unordered_bases(17).is_err());
    }
}
