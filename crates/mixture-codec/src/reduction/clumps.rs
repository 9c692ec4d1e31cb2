//! A weighted cloud of points summarised by a few clumps: weight, mean and covariance of groups of points.

use crate::Error;
use fewbits_core::{Columns, Gaussian};
use fewbits_densities::moment_matched;
use fewbits_numerics::error::{at_least_one, non_negative, refuse};
use nalgebra::{SMatrix, SVector};

/// Weight, mean and covariance of one part of a belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clump<const D: usize> {
    /// Share of the total mass.
    pub weight: f64,
    /// Mean.
    pub mean: SVector<f64, D>,
    /// Covariance within the clump, possibly singular.
    pub covariance: SMatrix<f64, D, D>,
}

/// A belief as clumps. Their mean and covariance together are exactly those of the points.
#[derive(Debug, Clone, PartialEq)]
pub struct Clumps<const D: usize> {
    pub(super) clumps: Vec<Clump<D>>,
    pub(super) least: SVector<f64, D>,
}

impl<const D: usize> Clumps<D> {
    /// Groups weighted points into at most `count` clumps and stores weight, mean and covariance of each.
    ///
    /// Starts with one clump. Repeatedly splits the clump with the largest weight times variance (largest over the coordinates,
    /// each relative to its variance over all points) at its mean along that coordinate.
    ///
    /// * `columns`: `D` columns of `n` coordinates.
    /// * `spread`: per coordinate `n` variances that are added to the clump's, or an empty slice for none. Use it if a point stands
    ///   for a distribution over that coordinate.
    /// * `weights`: `n` numbers, zero or positive, of any sum.
    ///
    /// # Errors
    /// If `count` is zero, lengths differ, a weight is negative or not finite, or no weight is above zero.
    pub fn new(
        columns: &Columns<'_, D>,
        spread: &Columns<'_, D>,
        weights: &[f64],
        count: usize,
    ) -> Result<Self, Error> {
        at_least_one("count", count)?;
        if columns.iter().any(|c| c.len() != weights.len())
            || spread.iter().any(|c| !c.is_empty() && c.len() != weights.len())
        {
            return refuse("columns", "of different lengths", "columns of equal length, one entry per weight");
        }
        let mut order: Vec<u32> = Vec::with_capacity(weights.len());
        let mut total = 0.0;
        for (i, weight) in weights.iter().enumerate() {
            if non_negative("weights", *weight)? > 0.0 {
                order.push(i as u32);
                total += weight;
            }
        }
        if order.is_empty() {
            return Err(Error::Impossible);
        }
        let mut cloud = Cloud {
            columns,
            spread,
            weights,
            total,
            scale: SVector::repeat(1.0),
        };
        // Coordinates may have different units: divide each variance by that of all points.
        let whole = cloud.part(&order, 0, order.len()).clump.covariance.diagonal();
        cloud.scale = whole.map(|v| if v > 0.0 { v.recip() } else { 0.0 });
        let mut parts = vec![cloud.part(&order, 0, order.len())];
        while parts.len() < count {
            let widest = (0..parts.len()).max_by(|a, b| parts[*a].urgency.total_cmp(&parts[*b].urgency));
            let Some(chosen) = widest.filter(|at| parts[*at].urgency > 0.0) else {
                break;
            };
            let (from, to, axis) = (parts[chosen].from, parts[chosen].to, parts[chosen].axis);
            let cut = parts[chosen].clump.mean[axis];
            let middle = from + partition(&mut order[from..to], |i| columns[axis][i as usize] < cut);
            if middle == from || middle == to {
                // Rounding put all points on one side: do not try this part again.
                parts[chosen].urgency = 0.0;
                continue;
            }
            parts[chosen] = cloud.part(&order, from, middle);
            parts.push(cloud.part(&order, middle, to));
        }
        Ok(Self {
            clumps: parts.into_iter().map(|part| part.clump).collect(),
            least: SVector::zeros(),
        })
    }

    /// The clumps.
    pub fn clumps(&self) -> &[Clump<D>] {
        &self.clumps
    }

    /// The same clumps with other weights, one for each, of any positive sum.
    pub fn reweighted(&self, weights: &[f64]) -> Self {
        let (mut other, total) = (self.clone(), weights.iter().sum::<f64>());
        let pairs = other.clumps.iter_mut().zip(weights);
        pairs.for_each(|(clump, weight)| clump.weight = weight / total);
        other
    }

    /// Mean and covariance of the whole.
    pub fn gaussian(&self) -> Gaussian<D> {
        moment_matched(self.clumps.iter().map(|c| (c.weight, c.mean, c.covariance)))
    }

    /// Sets the smallest variance of fitted components along each coordinate, the resolution of the points. Zero sets none.
    ///
    /// # Errors
    /// If a variance is negative or not finite.
    pub fn with_min_variances(self, least: SVector<f64, D>) -> Result<Self, Error> {
        for variance in &least {
            non_negative("least", *variance)?;
        }
        Ok(Self { least, ..self })
    }
}

struct Cloud<'a, const D: usize> {
    columns: &'a Columns<'a, D>,
    spread: &'a Columns<'a, D>,
    weights: &'a [f64],
    total: f64,
    /// Reciprocal variances of all points, which make variances of different coordinates comparable.
    scale: SVector<f64, D>,
}

struct Part<const D: usize> {
    clump: Clump<D>,
    from: usize,
    to: usize,
    axis: usize,
    urgency: f64,
}

impl<const D: usize> Cloud<'_, D> {
    fn part(&self, order: &[u32], from: usize, to: usize) -> Part<D> {
        let members = &order[from..to];
        // Coordinates relative to a member: sums of squares about the origin would cancel.
        let origin = SVector::<f64, D>::from_fn(|d, _| self.columns[d][members[0] as usize]);
        let (mut weight, mut first, mut second) = (0.0, SVector::<f64, D>::zeros(), SMatrix::<f64, D, D>::zeros());
        let mut own = SVector::<f64, D>::zeros();
        for &i in members {
            let i = i as usize;
            let w = self.weights[i];
            let d = SVector::<f64, D>::from_fn(|k, _| self.columns[k][i] - origin[k]);
            weight += w;
            first += d * w;
            second += d * (d * w).transpose();
            for k in 0..D {
                own[k] += w * self.spread[k].get(i).copied().unwrap_or(0.0);
            }
        }
        let mean = first / weight;
        let between = second / weight - mean * mean.transpose();
        let (axis, variance) = between.diagonal().component_mul(&self.scale).argmax();
        Part {
            clump: Clump {
                weight: weight / self.total,
                mean: origin + mean,
                covariance: between + SMatrix::from_diagonal(&(own / weight)),
            },
            from,
            to,
            axis,
            // The part with the largest weighted variance along its axis is split next.
            urgency: if members.len() > 1 {
                weight * variance.max(0.0)
            } else {
                0.0
            },
        }
    }
}

/// Moves the indices that satisfy `left` to the front and returns their number.
fn partition(order: &mut [u32], left: impl Fn(u32) -> bool) -> usize {
    let mut boundary = 0;
    for i in 0..order.len() {
        if left(order[i]) {
            order.swap(i, boundary);
            boundary += 1;
        }
    }
    boundary
}
