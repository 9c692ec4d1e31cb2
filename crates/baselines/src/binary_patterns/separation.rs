//! Whether patterns distinguish all cells.

use fewbits_binary_patterns::{Error, Pattern};
use fewbits_numerics::error::refuse;

/// Checks that every two cells differ in the bit of at least one pattern, so that without noise each cell can be identified.
///
/// For linear patterns this is the condition of full rank. For others, linear independence over GF(2) is necessary but not sufficient
/// (erratum `binary-3`), so the columns themselves are compared.
///
/// # Errors
/// Names the first two cells that no pattern separates; if lengths differ.
pub fn check_separation(patterns: &[Pattern]) -> Result<(), Error> {
    let Some(first) = patterns.first() else {
        return refuse("patterns", "empty", "patterns that separate all cells");
    };
    if let Some(odd) = patterns.iter().find(|p| p.cells() != first.cells()) {
        return refuse("patterns", format!("of {} and {} cells", first.cells(), odd.cells()), "as many cells in each");
    }
    let mut columns: Vec<(Vec<bool>, usize)> = (0..first.cells())
        .map(|cell| (patterns.iter().map(|p| p.bits()[cell]).collect(), cell))
        .collect();
    // Two cells with the same bits of all sensors cannot be distinguished; sorting makes them neighbours.
    columns.sort();
    match columns.windows(2).find(|w| w[0].0 == w[1].0) {
        None => Ok(()),
        Some(w) => {
            let alike = format!("the same in cells {} and {}", w[0].1, w[1].1);
            refuse("patterns", alike, "patterns that separate all cells")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(text: &str) -> Pattern {
        text.parse().unwrap()
    }

    #[test]
    fn independent_patterns_need_not_separate() {
        // Independent over GF(2), yet cells 5 and 6 carry the same column.
        let patterns = [pattern("00001111"), pattern("00110000"), pattern("01000000")];
        assert!(
            matches!(check_separation(&patterns), Err(Error::Argument(e)) if e.value == "the same in cells 2 and 3")
        );
        let natural = [pattern("00001111"), pattern("00110011"), pattern("01010101")];
        assert_eq!(check_separation(&natural), Ok(()));
        assert!(check_separation(&[]).is_err());
    }
}
