//! Bit patterns over the cells of a grid.

use crate::BinaryQuantizer;
use crate::Error;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::refuse;
use fewbits_quantizers::Quantizer;
use std::fmt;
use std::str::FromStr;

/// One bit per cell: the sensor sends bit `l` if its measurement is in cell `l`.
///
/// A pattern and its complement are the same quantizer with its outputs renamed, so the constructor keeps the one
/// that starts with 0. As text it is a string of digits, the lowest cell first.
///
/// ```
/// use fewbits_binary_patterns::Pattern;
/// let pattern: Pattern = "11000011".parse()?;
/// assert_eq!(pattern.to_string(), "00111100");
/// # Ok::<(), fewbits_binary_patterns::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Pattern {
    bits: Vec<bool>,
}

impl Pattern {
    /// A pattern from one bit per cell, the lowest cell first.
    ///
    /// # Errors
    /// If all bits are equal (or there are none).
    pub fn new(mut bits: Vec<bool>) -> Result<Self, Error> {
        if bits.iter().all(|&b| b == bits[0]) {
            return refuse("bits", format!("the same in all {} cells", bits.len()), "at least one 0 and one 1");
        }
        if bits[0] {
            bits.iter_mut().for_each(|b| *b = !*b);
        }
        Ok(Self { bits })
    }

    /// The bits, the first of them 0.
    pub fn bits(&self) -> &[bool] {
        &self.bits
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.bits.len()
    }

    /// The quantizer that sends this pattern over `grid`; successive cells of equal bit are joined.
    ///
    /// # Errors
    /// If the number of bits is not the number of cells of the grid.
    pub fn on(&self, grid: &Quantizer) -> Result<BinaryQuantizer, Error> {
        if self.cells() != grid.cells() {
            return refuse("grid", format!("of {} cells", grid.cells()), format!("{}, one a bit", self.cells()));
        }
        let thresholds = self
            .bits
            .windows(2)
            .zip(grid.breakpoints())
            .filter(|(pair, _)| pair[0] != pair[1])
            .map(|(_, &edge)| edge)
            .collect();
        BinaryQuantizer::new(thresholds)
    }

    /// All `2^(cells-1) - 1` patterns over `cells` cells, in the order of their strings.
    ///
    /// # Errors
    /// If `cells` is not in `2..=20`.
    pub fn all(cells: usize) -> Result<Vec<Self>, Error> {
        if !(2..=20).contains(&cells) {
            return refuse("cells", cells, "a number of cells in 2..=20");
        }
        Ok((1u32..1 << (cells - 1))
            .map(|word| Self {
                bits: (0..cells).rev().map(|at| word >> at & 1 == 1).collect(),
            })
            .collect())
    }
}

impl fmt::Display for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.bits
            .iter()
            .try_for_each(|&b| f.write_str(if b { "1" } else { "0" }))
    }
}

impl FromStr for Pattern {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let bits = text
            .chars()
            .map(|c| match c {
                '0' => Ok(false),
                '1' => Ok(true),
                other => Err(ArgumentError::new("pattern", format!("{other:?} in {text:?}"), "digits 0 and 1 only")),
            })
            .collect::<Result<_, _>>()?;
        Self::new(bits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uniform_cells;

    fn pattern(text: &str) -> Pattern {
        text.parse().unwrap()
    }

    #[test]
    fn complements_are_one_pattern() {
        assert_eq!(pattern("1001"), pattern("0110"));
        assert!(matches!("0000".parse::<Pattern>(), Err(Error::Argument(e)) if e.value.contains("all 4 cells")));
        assert!("".parse::<Pattern>().is_err());
        assert!("01x0".parse::<Pattern>().is_err());
    }

    #[test]
    fn runs_merge_into_thresholds() {
        let grid = uniform_cells(1.0, 2).unwrap();
        assert_eq!(pattern("0110").on(&grid).unwrap().breakpoints(), [-0.5, 0.5]);
        let long = pattern("01100110").on(&grid);
        assert!(matches!(long, Err(Error::Argument(e)) if e.value == "of 4 cells" && e.expected == "8, one a bit"));
    }

    #[test]
    fn there_are_127_patterns_over_eight_cells() {
        let all = Pattern::all(8).unwrap();
        assert_eq!(all.len(), 127);
        assert!(all.iter().all(|p| !p.bits()[0]));
        assert!(all.windows(2).all(|w| w[0] < w[1]));
    }
}
