//! A standard form in which equivalent designs are equal.

use crate::quantizer::Quantizer;
use std::cmp::Ordering;

/// The same set of quantizers in a standard form. Levels are numbered in the order in which their cells appear. Interchangeable sensors are
/// sorted. Of the design and its mirror image, the one that sorts last is taken. Two descriptions of one design over
/// ideal channels are equal in this form, up to `1e-6` of the largest breakpoint.
///
/// `interchangeable[n]` is the class of sensor `n`; sensors of one class may be swapped.
pub fn canonical(quantizers: &[Quantizer], interchangeable: &[usize]) -> Vec<Quantizer> {
    let scale = quantizers
        .iter()
        .flat_map(|q| &q.breakpoints)
        .fold(0.0, |m, b| f64::max(m, b.abs()));
    let order = |a: &Quantizer, b: &Quantizer| {
        (a.cells(), a.labels())
            .cmp(&(b.cells(), b.labels()))
            .then_with(|| compare(a.breakpoints(), b.breakpoints(), 1e-6 * scale))
    };
    // Selection by exchanges: only sensors of one class may change places, and they need not be neighbours.
    let sorted = |mut all: Vec<Quantizer>| {
        for i in 0..all.len() {
            for j in i + 1..all.len() {
                let same = interchangeable.get(i) == interchangeable.get(j);
                if same && order(&all[i], &all[j]) == Ordering::Greater {
                    all.swap(i, j);
                }
            }
        }
        all
    };
    let plain = sorted(quantizers.iter().map(Quantizer::renumbered).collect());
    let mirror = sorted(quantizers.iter().map(|q| q.mirrored().renumbered()).collect());
    // The first sensor in which the design and its mirror image differ decides.
    let first = plain.iter().zip(&mirror).map(|(p, m)| order(p, m)).find(|o| o.is_ne());
    if first == Some(Ordering::Less) { mirror } else { plain }
}

impl Quantizer {
    /// Levels numbered in the order in which their cells appear from the left.
    fn renumbered(&self) -> Self {
        let mut names = vec![None; self.levels];
        let mut next = 0;
        let labels = self.labels.iter().map(|label| {
            *names[*label].get_or_insert_with(|| {
                next += 1;
                next - 1
            })
        });
        Self {
            labels: labels.collect(),
            breakpoints: self.breakpoints.clone(),
            levels: self.levels,
        }
    }
}

/// Lexicographic comparison that treats numbers within `slack` of each other as equal.
fn compare(a: &[f64], b: &[f64], slack: f64) -> Ordering {
    a.iter()
        .zip(b)
        .find(|(x, y)| (*x - *y).abs() > slack)
        .map_or(Ordering::Equal, |(x, y)| x.total_cmp(y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirror_images_and_swaps_have_one_canonical_form() {
        let a = Quantizer::new(vec![-1.0, 0.3, 2.0]).unwrap();
        let b = a.mirrored();
        assert_eq!(b.breakpoints(), [-2.0, -0.3, 1.0]);
        let pairs = [[a.clone(), b.clone()], [b.clone(), a.clone()]];
        assert_eq!(canonical(&pairs[0], &[0, 0]), canonical(&pairs[1], &[0, 0]));
        assert_eq!(canonical(std::slice::from_ref(&a), &[0]), canonical(&[b], &[0]));
    }

    /// Labels 1, 0, 1 and their mirror image's 0, 1, 0 name one quantizer.
    #[test]
    fn folded_cells_and_their_mirror_image_have_one_canonical_form() {
        for (labels, b) in [
            (vec![1, 0, 1], vec![-1.4, 1.2]),
            (vec![0, 1, 2, 0], vec![-1.0, 0.2, 2.0]),
        ] {
            for scale in [1e-4, 1.0, 1e4] {
                let b = b.iter().map(|x| scale * x).collect();
                let folded = Quantizer::with_labels(b, labels.clone()).unwrap();
                let forms = [folded.clone(), folded.mirrored()].map(|q| canonical(&[q], &[0]));
                assert_eq!(forms[0], forms[1]);
            }
        }
    }
}
