//! Which sets of patterns separate the cells.

use fewbits_baselines::binary_patterns::check_separation;
use fewbits_binary_patterns::{Pattern, gray_basis, linear_pattern, rank};
use proptest::prelude::*;

#[test]
fn neighbouring_cells_of_gray_patterns_differ_in_one_bit() {
    for bits in 1..=8 {
        let masks = gray_basis(bits).unwrap();
        let patterns: Vec<Pattern> = masks.iter().map(|mask| linear_pattern(*mask, bits).unwrap()).collect();
        for cell in 1..1 << bits {
            let changed = patterns.iter().filter(|p| p.bits()[cell] != p.bits()[cell - 1]);
            assert_eq!(changed.count(), 1, "{bits} bits");
        }
    }
}

/// Columns 5 to 7 of the thesis's generator matrix (5.6) beside the Gray basis.
#[test]
fn further_patterns_separate_with_the_gray_basis() {
    let masks = gray_basis(4).unwrap().into_iter().chain([14, 5, 11]);
    let patterns: Vec<Pattern> = masks.map(|mask| linear_pattern(mask, 4).unwrap()).collect();
    check_separation(&patterns).unwrap();
}

/// Independent over GF(2), yet two cells carry the same column: footnote 2 of the thesis holds for linear patterns only
/// (erratum binary-3).
#[test]
fn independent_patterns_that_are_not_linear_need_not_separate() {
    let patterns = ["00001111", "00110000", "01000000"].map(|text| text.parse::<Pattern>().unwrap());
    check_separation(&patterns).unwrap_err();
}

proptest! {
    #[test]
    fn full_rank_is_separation(masks in prop::collection::vec(1u32..16, 1..8)) {
        let patterns: Vec<Pattern> = masks.iter().map(|&m| linear_pattern(m, 4).unwrap()).collect();
        prop_assert_eq!(rank(&masks) == 4, check_separation(&patterns).is_ok());
    }
}
