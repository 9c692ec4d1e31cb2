//! Exact sizes of the search spaces, in 128-bit integers with overflow checks.

use crate::Error;
use crate::patterns::grid::bits_in_range;
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
#[doc(hidden)]
pub fn enough_sensors(bits: usize, sensors: usize) -> Result<(), Error> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patterns::linear::rank;

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
    fn overflow_and_bad_arguments_are_errors() {
        assert!(matches!(full_rank_multisets(3, 2), Err(Error::Argument(e)) if e.name == "sensors"));
        assert!(matches!(full_rank_multisets(16, 60), Err(Error::Argument(e)) if e.expected == "one below 2^128"));
        assert!(full_rank_multisets(0, 3).is_err() && full_rank_multisets(17, 20).is_err());
        assert!(multisets(u128::MAX, 2).is_err());
        assert_eq!(multisets(0, 0).unwrap(), 1);
    }
}
