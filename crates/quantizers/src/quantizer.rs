//! The scalar quantizer a sensor holds.

use crate::error::{Error, refuse};
use crate::lloyd_max::LloydMax;

/// Ordered breakpoints that part the line into cells, and the level each cell is reported as.
///
/// Cell `i` is `(breakpoints[i - 1], breakpoints[i]]`, the outer cells being unbounded. In a *contiguous* quantizer cell `i`
/// is level `i`; otherwise several cells may share a level ("labels"), as in a modulo or `|y| > c` quantizer.
///
/// ```
/// use fewbits_quantizers::Quantizer;
/// let folded = Quantizer::with_labels(vec![-1.4, 1.4], vec![1, 0, 1])?;
/// assert_eq!((folded.levels(), folded.encode(-3.0), folded.encode(0.2)), (2, 1, 0));
/// # Ok::<(), fewbits_quantizers::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Quantizer {
    breakpoints: Vec<f64>,
    labels: Vec<usize>,
    levels: usize,
}

impl Quantizer {
    /// A contiguous quantizer: `breakpoints.len() + 1` levels.
    ///
    /// # Errors
    /// If the breakpoints are empty, not finite or not strictly increasing.
    pub fn new(breakpoints: Vec<f64>) -> Result<Self, Error> {
        let labels = (0..=breakpoints.len()).collect();
        Self::with_labels(breakpoints, labels)
    }

    /// A quantizer whose cell `i` is reported as level `labels[i]`.
    ///
    /// # Errors
    /// If the breakpoints are empty, not finite or not strictly increasing, `labels` is not one longer than they are, or the
    /// labels are not `0..levels`, each used, with at least two levels.
    pub fn with_labels(breakpoints: Vec<f64>, labels: Vec<usize>) -> Result<Self, Error> {
        if breakpoints.is_empty() {
            return refuse("breakpoints", "empty", "at least one breakpoint (two levels)");
        }
        fewbits_numerics::error::all_finite("breakpoints", &breakpoints)?;
        if let Some(at) = breakpoints.windows(2).position(|w| w[0] >= w[1]) {
            let pair = format!("{}, {} at index {at}", breakpoints[at], breakpoints[at + 1]);
            return refuse("breakpoints", pair, "strictly increasing numbers");
        }
        if labels.len() != breakpoints.len() + 1 {
            return refuse("labels", format!("{} labels", labels.len()), format!("{} labels", breakpoints.len() + 1));
        }
        let levels = labels.iter().max().map_or(0, |m| m + 1);
        if levels < 2 {
            return refuse("labels", "a single level", "at least two levels");
        }
        if let Some(unused) = (0..levels).find(|l| !labels.contains(l)) {
            return refuse("labels", format!("without level {unused}"), format!("all of 0..{levels}"));
        }
        Ok(Self {
            breakpoints,
            labels,
            levels,
        })
    }

    /// The contiguous quantizer `{-outer, 0, outer}` of four levels.
    ///
    /// # Errors
    /// If `outer` is not a positive number.
    pub fn symmetric(outer: f64) -> Result<Self, Error> {
        fewbits_numerics::error::positive("outer", outer)?;
        Self::new(vec![-outer, 0.0, outer])
    }

    /// Finite breakpoints, strictly increasing.
    pub fn breakpoints(&self) -> &[f64] {
        &self.breakpoints
    }

    /// Level of each cell.
    pub fn labels(&self) -> &[usize] {
        &self.labels
    }

    /// Number of different levels.
    pub fn levels(&self) -> usize {
        self.levels
    }

    /// Number of cells, at least [`levels`](Self::levels).
    pub fn cells(&self) -> usize {
        self.labels.len()
    }

    /// Whether cell `i` is level `i` throughout.
    pub fn is_contiguous(&self) -> bool {
        self.cells() == self.levels && self.labels.iter().enumerate().all(|(i, l)| i == *l)
    }

    /// Level of the cell that holds `y`; a breakpoint belongs to the cell below it. Never allocates. Infinite samples fall
    /// into the outer cells and NaN into the first.
    #[inline]
    pub fn encode(&self, y: f64) -> usize {
        self.labels[self.breakpoints.partition_point(|b| *b < y)]
    }

    /// Lower and upper edge of cell `i`, infinite at the ends.
    pub fn edges(&self, cell: usize) -> (f64, f64) {
        let lower = cell.checked_sub(1).and_then(|i| self.breakpoints.get(i));
        (
            lower.copied().unwrap_or(f64::NEG_INFINITY),
            self.breakpoints.get(cell).copied().unwrap_or(f64::INFINITY),
        )
    }

    /// The same labels on other breakpoints.
    ///
    /// # Errors
    /// As [`Quantizer::with_labels`].
    pub fn with_breakpoints(&self, breakpoints: Vec<f64>) -> Result<Self, Error> {
        Self::with_labels(breakpoints, self.labels.clone())
    }

    /// The quantizer of `-y` with the order of the levels reversed: the same design seen in a mirror.
    pub fn mirrored(&self) -> Self {
        Self {
            breakpoints: self.breakpoints.iter().rev().map(|b| -b).collect(),
            labels: self.labels.iter().rev().map(|l| self.levels - 1 - l).collect(),
            levels: self.levels,
        }
    }

    /// The quantizer of `mean + scale * y`.
    ///
    /// # Errors
    /// If `mean` is not finite or `scale` is not a positive number.
    pub fn affine(&self, mean: f64, scale: f64) -> Result<Self, Error> {
        fewbits_numerics::error::finite("mean", mean)?;
        fewbits_numerics::error::positive("scale", scale)?;
        self.with_breakpoints(self.breakpoints.iter().map(|b| mean + scale * b).collect())
    }
}

impl From<&LloydMax> for Quantizer {
    fn from(design: &LloydMax) -> Self {
        Self {
            breakpoints: design.breakpoints().to_vec(),
            labels: (0..design.centroids().len()).collect(),
            levels: design.centroids().len(),
        }
    }
}

/// The same set of quantizers in a fixed orientation: of the design and its mirror image, each with identical sensors sorted,
/// the lexicographically larger one. Two descriptions of one optimum compare equal after this.
///
/// `interchangeable[n]` names the class of sensor `n`; sensors of one class may be swapped.
pub fn canonical(quantizers: &[Quantizer], interchangeable: &[usize]) -> Vec<Quantizer> {
    let order = |a: &Quantizer, b: &Quantizer| {
        let key = |q: &Quantizer| (q.cells(), q.labels().to_vec());
        key(a)
            .cmp(&key(b))
            .then_with(|| compare(a.breakpoints(), b.breakpoints()))
    };
    let sorted = |mut all: Vec<Quantizer>| {
        for i in 0..all.len() {
            for j in i + 1..all.len() {
                let same = interchangeable.get(i) == interchangeable.get(j);
                if same && order(&all[i], &all[j]) == std::cmp::Ordering::Greater {
                    all.swap(i, j);
                }
            }
        }
        all
    };
    let plain = sorted(quantizers.to_vec());
    let mirror = sorted(quantizers.iter().map(Quantizer::mirrored).collect());
    let flat = |all: &[Quantizer]| -> Vec<f64> { all.iter().flat_map(|q| q.breakpoints().to_vec()).collect() };
    if compare(&flat(&plain), &flat(&mirror)) == std::cmp::Ordering::Less {
        mirror
    } else {
        plain
    }
}

/// Lexicographic order that takes numbers within rounding of each other as equal.
fn compare(a: &[f64], b: &[f64]) -> std::cmp::Ordering {
    a.iter()
        .zip(b)
        .find(|(x, y)| (*x - *y).abs() > 1e-6)
        .map_or(std::cmp::Ordering::Equal, |(x, y)| x.total_cmp(y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn breakpoints_belong_to_the_cell_below() {
        let q = Quantizer::new(vec![-1.0, 0.0, 1.0]).unwrap();
        assert_eq!([-1.0, -0.999, 0.0, 1.0, 1.001].map(|y| q.encode(y)), [0, 1, 1, 2, 3]);
        assert_eq!((q.encode(f64::NEG_INFINITY), q.encode(f64::INFINITY), q.encode(f64::NAN)), (0, 3, 0));
        assert_eq!(q.edges(0), (f64::NEG_INFINITY, -1.0));
        assert_eq!(q.edges(3), (1.0, f64::INFINITY));
    }

    #[test]
    fn what_is_not_a_quantizer_is_refused_by_name() {
        for bad in [
            vec![],
            vec![0.0, 0.0],
            vec![1.0, 0.0],
            vec![f64::NAN],
            vec![f64::INFINITY],
        ] {
            assert!(Quantizer::new(bad).unwrap_err().to_string().contains("breakpoints"));
        }
        for labels in [vec![0, 0], vec![0, 2], vec![0], vec![0, 1, 2]] {
            assert!(
                Quantizer::with_labels(vec![0.0], labels)
                    .unwrap_err()
                    .to_string()
                    .contains("labels")
            );
        }
        assert!(Quantizer::symmetric(-1.0).is_err());
    }

    #[test]
    fn mirror_images_and_swaps_have_one_canonical_form() {
        let a = Quantizer::new(vec![-1.0, 0.3, 2.0]).unwrap();
        let b = a.mirrored();
        assert_eq!(b.breakpoints(), [-2.0, -0.3, 1.0]);
        let pairs = [[a.clone(), b.clone()], [b.clone(), a.clone()]];
        assert_eq!(canonical(&pairs[0], &[0, 0]), canonical(&pairs[1], &[0, 0]));
        assert_eq!(canonical(std::slice::from_ref(&a), &[0]), canonical(&[b], &[0]));
    }
}
