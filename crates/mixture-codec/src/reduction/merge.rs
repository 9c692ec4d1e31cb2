//! Reduction of mixtures by merging pairs of components; mean and covariance are kept.

use crate::Error;
use fewbits_core::Belief;
use fewbits_densities::{Component, Mixture};
use fewbits_numerics::error::{at_least_one, refuse};
use fewbits_numerics::factored::{Factored, half_log_det};
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// The cost of merging a pair of components. The cheapest pair is merged first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum MergeCost {
    /// `(w ln det S_ij - w_i ln det S_i - w_j ln det S_j)/2`, an upper bound of the lost KL (Runnalls 2007).
    Runnalls,
    /// `w_i w_j/(w_i + w_j) (m_i - m_j)' C^-1 (m_i - m_j)` with `C` the covariance of the whole (Salmond 1990).
    Salmond,
    /// The integrated squared error between the merged and the original mixture (Williams and Maybeck 2003).
    /// `O(n^4)`, so only for a few dozen components.
    Williams,
}

/// A mixture after merging, and the cost.
#[derive(Debug, Clone, PartialEq)]
pub struct Merged<const D: usize> {
    /// The smaller mixture, with the same mean and covariance.
    pub mixture: Mixture<D>,
    /// Sum of the merges' costs. For [`MergeCost::Runnalls`] an upper bound of the lost KL; for [`MergeCost::Williams`] the
    /// integrated squared error of the result.
    pub cost: f64,
}

#[derive(Clone, Copy)]
struct Part<const D: usize> {
    weight: f64,
    mean: SVector<f64, D>,
    covariance: SMatrix<f64, D, D>,
    half_log_det: f64,
}

impl<const D: usize> Part<D> {
    fn new(weight: f64, mean: SVector<f64, D>, covariance: SMatrix<f64, D, D>) -> Self {
        Self {
            weight,
            mean,
            covariance,
            half_log_det: half_log_det(&covariance),
        }
    }

    fn joined(&self, other: &Self) -> Self {
        let weight = self.weight + other.weight;
        let (a, b) = (self.weight / weight, other.weight / weight);
        let gap = other.mean - self.mean;
        let covariance = self.covariance * a + other.covariance * b + gap * gap.transpose() * (a * b);
        Self::new(weight, self.mean + gap * b, covariance)
    }
}

/// Merges the cheapest pair repeatedly until at most `components` components are left.
///
/// # Errors
/// If `components` is 0, the joint covariance of two components overflows, or that of the whole mixture is singular to
/// working precision ([`MergeCost::Salmond`]).
pub fn merge<const D: usize>(mixture: &Mixture<D>, components: usize, cost: MergeCost) -> Result<Merged<D>, Error> {
    at_least_one("components", components)?;
    let parts: Vec<Part<D>> = mixture
        .components()
        .iter()
        .filter(|c| c.weight() > 0.0)
        .map(|c| Part::new(c.weight(), *c.mean(), *c.covariance()))
        .collect();
    let (parts, cost) = match cost {
        MergeCost::Runnalls => pairwise(parts, components, |a, b| {
            let joined = a.joined(b);
            let lost = joined.weight * joined.half_log_det - a.weight * a.half_log_det - b.weight * b.half_log_det;
            lost.max(0.0)
        }),
        MergeCost::Salmond => {
            let whole = Factored::new("covariance", &mixture.covariance())?;
            pairwise(parts, components, move |a, b| {
                a.weight * b.weight / (a.weight + b.weight) * whole.squared(&(a.mean - b.mean))
            })
        }
        MergeCost::Williams => williams(parts, components),
    };
    if parts.len() > components {
        // No remaining pair has a finite cost.
        let given = format!("{} components that cannot be joined", parts.len());
        return refuse("mixture", given, "components whose joint covariances are finite");
    }
    let merged = parts.iter().map(|p| Component::new(p.weight, p.mean, p.covariance));
    Ok(Merged {
        mixture: Mixture::new(merged.collect::<Result<_, _>>()?)?,
        cost,
    })
}

/// Merges by a cost that depends on the pair alone. Each component stores its cheapest partner among those after it, so a merge takes
/// `O(n)` steps on average.
fn pairwise<const D: usize>(
    mut parts: Vec<Part<D>>,
    components: usize,
    cost: impl Fn(&Part<D>, &Part<D>) -> f64,
) -> (Vec<Part<D>>, f64) {
    let n = parts.len();
    let mut costs = vec![f64::INFINITY; n * n];
    for i in 0..n {
        for j in i + 1..n {
            costs[i * n + j] = cost(&parts[i], &parts[j]);
        }
    }
    let mut alive = vec![true; n];
    // For each part the cheapest partner after it. A merge changes few of these, so that a step costs O(n), not O(n^2).
    let cheapest = |i: usize, costs: &[f64], alive: &[bool]| -> (f64, usize) {
        let mut best = (f64::INFINITY, usize::MAX);
        for j in i + 1..n {
            if alive[j] && costs[i * n + j] < best.0 {
                best = (costs[i * n + j], j);
            }
        }
        best
    };
    let mut best: Vec<(f64, usize)> = (0..n).map(|i| cheapest(i, &costs, &alive)).collect();
    let mut total = 0.0;
    for _ in components..n {
        let chosen = (0..n)
            .filter(|i| alive[*i] && best[*i].1 < n)
            .min_by(|a, b| best[*a].0.total_cmp(&best[*b].0));
        let Some(i) = chosen else { break };
        let (price, j) = best[i];
        total += price;
        parts[i] = parts[i].joined(&parts[j]);
        alive[j] = false;
        for k in (0..n).filter(|k| alive[*k] && *k != i) {
            let (low, high) = (k.min(i), k.max(i));
            costs[low * n + high] = cost(&parts[low], &parts[high]);
        }
        for k in (0..n).filter(|k| alive[*k]) {
            // If the cheapest partner has changed or is gone, search again. Otherwise only the merged component can have become cheaper.
            let stale = k == i || best[k].1 == i || best[k].1 == j;
            if stale {
                best[k] = cheapest(k, &costs, &alive);
            } else if k < i && costs[k * n + i] < best[k].0 {
                best[k] = (costs[k * n + i], i);
            }
        }
    }
    let kept = parts
        .into_iter()
        .zip(alive)
        .filter(|(_, alive)| *alive)
        .map(|(part, _)| part);
    (kept.collect(), total)
}

/// `ln N(a.mean; b.mean, a.covariance + b.covariance)`.
fn log_overlap<const D: usize>(a: &Part<D>, b: &Part<D>) -> f64 {
    match Factored::new("covariance", &(a.covariance + b.covariance)) {
        Ok(f) => -0.5 * f.squared(&(a.mean - b.mean)) - f.half_log_det - D as f64 * LN_SQRT_2PI,
        Err(_) => f64::NEG_INFINITY,
    }
}

fn williams<const D: usize>(original: Vec<Part<D>>, components: usize) -> (Vec<Part<D>>, f64) {
    let mut parts = original.clone();
    // Overlaps vary over many orders of magnitude in small units, so the largest is factored out.
    let scale = original
        .iter()
        .map(|p| log_overlap(p, p))
        .fold(f64::NEG_INFINITY, f64::max);
    let overlap = |a: &Part<D>, b: &Part<D>| (log_overlap(a, b) - scale).exp();
    let inner = |a: &Part<D>, all: &[Part<D>]| -> f64 { all.iter().map(|b| b.weight * overlap(a, b)).sum() };
    let own: f64 = original.iter().map(|p| p.weight * inner(p, &original)).sum();
    let mut error = 0.0;
    while parts.len() > components {
        let n = parts.len();
        let within: Vec<Vec<f64>> = parts
            .iter()
            .map(|a| parts.iter().map(|b| overlap(a, b)).collect())
            .collect();
        let against: Vec<f64> = parts.iter().map(|p| inner(p, &original)).collect();
        let rows: Vec<f64> = (0..n)
            .map(|i| (0..n).map(|j| parts[j].weight * within[i][j]).sum())
            .collect();
        let reduced: f64 = (0..n).map(|i| parts[i].weight * rows[i]).sum();
        let crossed: f64 = (0..n).map(|i| parts[i].weight * against[i]).sum();
        let mut best: Option<(f64, usize, usize, Part<D>)> = None;
        for i in 0..n {
            for j in i + 1..n {
                let (wi, wj) = (parts[i].weight, parts[j].weight);
                let joined = parts[i].joined(&parts[j]);
                // The terms of the pair are taken out of the sums, then those of the joined component are added.
                let without = reduced - 2.0 * (wi * rows[i] + wj * rows[j])
                    + wi * wi * within[i][i]
                    + wj * wj * within[j][j]
                    + 2.0 * wi * wj * within[i][j];
                let others: f64 = (0..n)
                    .filter(|k| *k != i && *k != j)
                    .map(|k| parts[k].weight * overlap(&joined, &parts[k]))
                    .sum();
                let w = joined.weight;
                let hh = without + 2.0 * w * others + w * w * overlap(&joined, &joined);
                let fh = crossed - wi * against[i] - wj * against[j] + w * inner(&joined, &original);
                let ise = own - 2.0 * fh + hh;
                if best.as_ref().is_none_or(|b| ise < b.0) {
                    best = Some((ise, i, j, joined));
                }
            }
        }
        let Some((ise, i, j, joined)) = best else { break };
        error = ise.max(0.0);
        parts[i] = joined;
        parts.remove(j);
    }
    (parts, error * scale.exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_monte_carlo::Stream;
    use nalgebra::Vector2;
    use rand::RngExt;

    /// All pairs priced anew before every merge.
    fn plainly(
        mut parts: Vec<Part<2>>,
        components: usize,
        cost: impl Fn(&Part<2>, &Part<2>) -> f64,
    ) -> (Vec<Part<2>>, f64) {
        let mut total = 0.0;
        while parts.len() > components {
            let pairs = (0..parts.len()).flat_map(|i| (i + 1..parts.len()).map(move |j| (i, j)));
            let priced = pairs.map(|(i, j)| (cost(&parts[i], &parts[j]), i, j));
            let (price, i, j) = priced.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
            total += price;
            parts[i] = parts[i].joined(&parts[j]);
            parts.remove(j);
        }
        (parts, total)
    }

    #[test]
    fn remembered_partners_are_the_cheapest() {
        for seed in 0..40 {
            let mut rng = Stream::new(seed).rng();
            let parts: Vec<Part<2>> = (0..14)
                .map(|_| {
                    let mean = Vector2::from_fn(|_, _| rng.random_range(-3.0..3.0));
                    let covariance = SMatrix::from_diagonal(&Vector2::from_fn(|_, _| rng.random_range(0.1..2.0)));
                    Part::new(rng.random_range(0.1..1.0), mean, covariance)
                })
                .collect();
            // Not symmetric in its arguments, and as likely to fall as to rise under merging.
            let cost = |a: &Part<2>, b: &Part<2>| {
                let mixed = a.mean.dot(&Vector2::new(12.9898, 78.233)) + b.mean.dot(&Vector2::new(-37.1, 9.7));
                (mixed.sin() * 43_758.545_3).fract().abs()
            };
            for components in 1..14 {
                let (fast, slow) =
                    (pairwise(parts.clone(), components, cost), plainly(parts.clone(), components, cost));
                assert!((fast.1 - slow.1).abs() < 1e-12 * slow.1.max(1.0), "{} {}", fast.1, slow.1);
                let pairs = fast.0.iter().zip(&slow.0);
                assert!(fast.0.len() == slow.0.len() && pairs.clone().all(|(a, b)| a.mean == b.mean));
            }
            // A pair whose merging costs infinity is not merged.
            let (kept, total) = pairwise(parts, 3, |_, _| f64::INFINITY);
            assert_eq!((kept.len(), total), (14, 0.0));
        }
    }
}
