//! Sizes of the thesis's search spaces, in 128-bit integers with overflow checks.

use fewbits_binary_patterns::Error;
use fewbits_binary_patterns::engine::bits_in_range;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::binomial::exact as binomial;
use fewbits_numerics::error::refuse;

fn overflow(what: &'static str) -> Error {
    ArgumentError::new(what, "too large a number", "one below 2^128").into()
}

/// Number of multisets of `size` elements of `kinds` kinds: `C(kinds + size - 1, size)`.
///
/// # Errors
/// If the number exceeds 128 bits.
pub fn multisets(kinds: u128, size: u128) -> Result<u128, Error> {
    if size == 0 {
        return Ok(1);
    }
    kinds
        .checked_add(size)
        .and_then(|n| if kinds == 0 { Some(0) } else { binomial(n - 1, size) })
        .ok_or(overflow("multisets"))
}

/// An error unless so many sensors can have masks of this rank.
fn enough_sensors(bits: usize, sensors: usize) -> Result<(), Error> {
    let bits = bits_in_range(bits)?;
    if sensors < bits {
        return refuse("sensors", sensors, format!("at least {bits}, the rank of the masks"));
    }
    Ok(())
}

/// Gaussian binomial coefficient: the number of `k`-dimensional subspaces of GF(2)^n.
fn subspaces(n: usize, k: usize) -> Option<u128> {
    // Pascal's rule avoids dividing two huge products.
    let mut row = vec![1u128];
    for i in 1..=n {
        let mut next = vec![1u128; i + 1];
        for j in 1..i {
            next[j] = row[j].checked_mul(1 << j)?.checked_add(row[j - 1])?;
        }
        row = next;
    }
    row.get(k).copied()
}

/// Number of multisets of `sensors` non-zero masks that span GF(2)^bits, by inclusion and exclusion over the span:
/// `sum_j (-1)^(B-j) 2^C(B-j,2) [B choose j]_2 C(2^j + N - 2, N)`.
///
/// Examples: 2702 for three bits and eight sensors, 277 755 for four bits and eight sensors.
///
/// # Errors
/// If `bits` is out of range, `sensors < bits`, or an intermediate number exceeds 128 bits.
pub fn full_rank_multisets(bits: usize, sensors: usize) -> Result<u128, Error> {
    enough_sensors(bits, sensors)?;
    let what = "full-rank multisets";
    let (mut plus, mut minus) = (0u128, 0u128);
    for j in 1..=bits {
        let codimension = bits - j;
        let term = 1u128
            .checked_shl((codimension * codimension.saturating_sub(1) / 2) as u32)
            .and_then(|sign| sign.checked_mul(subspaces(bits, j)?))
            .and_then(|c| c.checked_mul(multisets((1u128 << j) - 1, sensors as u128).ok()?))
            .ok_or(overflow(what))?;
        let side = if codimension.is_multiple_of(2) {
            &mut plus
        } else {
            &mut minus
        };
        *side = side.checked_add(term).ok_or(overflow(what))?;
    }
    plus.checked_sub(minus).ok_or(overflow(what))
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
/// That equation counts a multiset once for every basis that it contains. [`full_rank_multisets`] is correct (erratum `binary-2`).
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
    use fewbits_binary_patterns::rank;

    /// Counts multisets of masks by listing them.
    fn listed(bits: usize, sensors: usize) -> u128 {
        fn extend(masks: &mut Vec<u32>, top: u32, left: usize, bits: usize) -> u128 {
            if left == 0 {
                return u128::from(rank(masks) == bits);
            }
            let from = masks.last().copied().unwrap_or(1);
            (from..top)
                .map(|mask| {
                    masks.push(mask);
                    let count = extend(masks, top, left - 1, bits);
                    masks.pop();
                    count
                })
                .sum()
        }
        extend(&mut Vec::new(), 1 << bits, sensors, bits)
    }

    #[test]
    fn closed_forms_agree_with_listing() {
        for (bits, sensors) in [(1, 3), (2, 4), (3, 3), (3, 5), (3, 8), (4, 4), (4, 5)] {
            assert_eq!(full_rank_multisets(bits, sensors).unwrap(), listed(bits, sensors));
        }
    }

    #[test]
    fn sizes_of_full_rank_are_checked() {
        assert!(matches!(full_rank_multisets(3, 2), Err(Error::Argument(e)) if e.name == "sensors"));
        assert!(matches!(full_rank_multisets(16, 60), Err(Error::Argument(e)) if e.expected == "one below 2^128"));
        assert!(full_rank_multisets(0, 3).is_err() && full_rank_multisets(17, 20).is_err());
        assert!(multisets(u128::MAX, 2).is_err());
        assert_eq!(multisets(0, 0).unwrap(), 1);
    }

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
