//! The grid of positions on which places are looked for.

use super::fit::{Calibration, Search};
use super::rows::Collected;
use super::settings::Known;
use fewbits_numerics::kernels::{scalar, vectorised};

/// Nodes to either side of the middle, and from one to the next in deviations of the prior, for two coordinates and for three.
const NODES: [(i32, f64); 2] = [(12, 0.25), (6, 0.4)];
/// Local maxima that are refined, for each set of anchors.
const MAXIMA: usize = 4;
/// By how many nats one may be worse than the best: the grid's noise is large, with that of the ranges it is worse by more.
const NEGLIGIBLE_MAXIMUM: f64 = 14.0;

/// Positions, and what is measured at each of them: the same for all sets of ranges.
pub(super) struct Grid<'a> {
    known: &'a Known,
    ranges: &'a [Collected],
    points: Vec<[f64; 3]>,
    /// Of each point which it is along each axis.
    numbers: Vec<[i32; 3]>,
    /// Half of the squared distance from the middle, in deviations of the prior.
    priors: Vec<f64>,
    /// Range by range, for each the points.
    measured: Vec<Vec<f64>>,
    /// Sums over all ranges.
    sums: Sums,
    /// What is measured where no range is left out.
    nothing: Vec<f64>,
    /// The middle of the ranges.
    centre: f64,
    /// Variance of a range's error on the grid.
    variance: f64,
}

/// Sums over ranges at each point: of what is measured there, of its squares, and of its products with the ranges about their middle.
#[derive(Clone, Default)]
struct Sums {
    distances: Vec<f64>,
    squares: Vec<f64>,
    products: Vec<f64>,
}

impl<'a> Grid<'a> {
    pub(super) fn new(search: &Search<'a>, ranges: &'a [Collected]) -> Self {
        let (known, axes) = (search.known, search.axes());
        let (nodes, step) = NODES[axes - 2];
        let width = 2 * nodes + 1;
        let count = width.pow(axes as u32);
        let numbers: Vec<[i32; 3]> = (0..count)
            .map(|index| [index % width, index / width % width, index / width / width])
            .collect();
        let (mut points, mut priors) = (Vec::new(), Vec::new());
        for numbers in &numbers {
            let (mut point, mut prior) = ([0.0; 3], 0.0);
            for (i, number) in numbers.iter().enumerate().take(axes) {
                let off = f64::from(number - nodes) * step;
                point[i] = known.middle[i] + off * known.spreads[i];
                prior += 0.5 * off * off;
            }
            points.push(point);
            priors.push(prior);
        }
        let of = |one: &Collected| points.iter().map(|point| search.measured(point, one)).collect();
        let measured: Vec<Vec<f64>> = ranges.iter().map(of).collect();
        let centre = ranges.iter().map(|one| one.range).sum::<f64>() / ranges.len().max(1) as f64;
        let nothing = vec![0.0; points.len()];
        let mut sums = Sums {
            distances: nothing.clone(),
            squares: nothing.clone(),
            products: nothing.clone(),
        };
        for (one, measured) in ranges.iter().zip(&measured) {
            for (point, d) in measured.iter().enumerate() {
                sums.distances[point] += d;
                sums.squares[point] += d * d;
                sums.products[point] += (one.range - centre) * d;
            }
        }
        // Half a step: between two nodes the likelihood must not vanish.
        let smooth = 0.5 * step * known.spreads[0] * known.size / known.anchors_spread;
        let largest = known.noises.iter().fold(0.0_f64, |most, noise| most.max(*noise));
        Self {
            measured,
            sums,
            nothing,
            centre,
            known,
            ranges,
            points,
            numbers,
            priors,
            variance: smooth * smooth + (0.25 * largest).powi(2).min(smooth * smooth),
        }
    }

    /// `ln p(position, ranges)` at all points, up to a constant. Bias and scale are integrated out: ranges are linear in them, so the density
    /// depends on sums over the ranges only, and that of all but one range on the sums less one term.
    fn values(&self, calibration: &Calibration, without: Option<usize>) -> Vec<f64> {
        let [(bias, bias_variance), (scale, scale_variance)] = *calibration;
        let relative = 1.0 / self.variance;
        let factor = 1.0 + scale;
        let own =
            without.and_then(|number| Some((self.ranges.get(number)?.range - self.centre, &self.measured[number])));
        let (range, measured) = own.unwrap_or((0.0, &self.nothing));
        let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for (_, one) in self
            .ranges
            .iter()
            .enumerate()
            .filter(|(number, _)| Some(*number) != without)
        {
            // What the mean bias leaves of the range.
            let off = one.range - bias;
            (count, sum, squares) = (count + 1.0, sum + off, squares + off * off);
        }
        // What the mean bias adds to the products of ranges about their middle and distances.
        let beyond = self.centre - bias;
        let points = self.points.len();
        let (priors, measured) = (&self.priors[..points], &measured[..points]);
        let (distances, all_squares) = (&self.sums.distances[..points], &self.sums.squares[..points]);
        let all_products = &self.sums.products[..points];
        let mut values = vec![0.0; points];
        vectorised(
            #[inline(always)]
            || {
                for (point, found) in values.iter_mut().enumerate() {
                    let d = measured[point];
                    let (distances, squares_of_distances) = (distances[point] - d, all_squares[point] - d * d);
                    let products = all_products[point] - range * d + beyond * distances;
                    // Sums of what ranges are off at the means of bias and scale: of squares, alone, and times the distance.
                    let off = [
                        squares - factor * (2.0 * products - factor * squares_of_distances),
                        sum - factor * distances,
                        products - factor * squares_of_distances,
                    ];
                    // Information about bias and scale in their deviations, of which the prior is one each.
                    let information = [
                        1.0 + bias_variance * relative * count,
                        relative * distances,
                        1.0 + scale_variance * relative * squares_of_distances,
                    ];
                    let both = bias_variance * scale_variance * information[1] * information[1];
                    let determinant = information[0] * information[2] - both;
                    let explained = bias_variance * off[1] * off[1] * information[2]
                        + scale_variance * off[2] * off[2] * information[0]
                        - 2.0 * bias_variance * scale_variance * off[1] * off[2] * information[1];
                    *found = -priors[point]
                        - 0.5 * (relative * (off[0] - relative * explained / determinant) + scalar::ln(determinant));
                }
            },
        );
        values
    }

    /// Local maxima of the density of positions, given all ranges or all but one, the best first.
    pub(super) fn maxima(&self, calibration: &Calibration, without: Option<usize>) -> Vec<[f64; 3]> {
        let axes = self.known.axes;
        let last = 2 * NODES[axes - 2].0;
        let values = self.values(calibration, without);
        let is_highest = |index: usize| {
            let mut stride = 1;
            for at in &self.numbers[index][..axes] {
                if *at > 0 && values[index - stride] > values[index]
                    || *at < last && values[index + stride] > values[index]
                {
                    return false;
                }
                stride *= last as usize + 1;
            }
            true
        };
        let mut found: Vec<usize> = (0..values.len())
            .filter(|index| values[*index].is_finite() && is_highest(*index))
            .collect();
        found.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
        found.truncate(MAXIMA);
        if let Some(highest) = found.first().map(|index| values[*index]) {
            found.retain(|index| values[*index] > highest - NEGLIGIBLE_MAXIMUM);
        }
        // The grid is coarse beside the prior of a height, and anchors of like heights have a second place on their other side.
        let heights: &[f64] = if axes == 3 { &[0.0, -1.0, 1.0] } else { &[0.0] };
        let beside = |index: usize| {
            heights.iter().map(move |off| {
                let [x, y, z] = self.points[index];
                [x, y, z + off * self.known.spreads[2]]
            })
        };
        found.into_iter().flat_map(beside).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ranges::settings::RangeSettings;
    use nalgebra::{DMatrix, DVector, Vector3};

    /// The density is that of ranges with a common covariance: noise, and what bias and scale do to all of them.
    #[test]
    fn values_are_the_density_of_ranges_with_bias_and_scale() {
        let places =
            [[0.0, 0.0], [9.0, 1.0], [8.0, 7.0], [-1.0, 6.0], [4.0, 9.0]].map(|[x, y]| Vector3::new(x, y, 0.0));
        let known = RangeSettings::default().known(&places).unwrap();
        let calibration = [(0.3, 1.7), (-0.02, 0.01)];
        let search = Search {
            known: &known,
            calibration,
            anchors: places.len(),
        };
        let collected = |(anchor, place): (usize, &Vector3<f64>)| Collected {
            anchor,
            place: [place.x, place.y, place.z],
            range: 4.0 + (place - Vector3::new(3.0, 4.0, 0.0)).norm() + 0.1 * anchor as f64,
            age: 0.0,
            share: 1.0,
            slope: 1.0,
        };
        let ranges: Vec<Collected> = places.iter().enumerate().map(collected).collect();
        let grid = Grid::new(&search, &ranges);
        for without in [None, Some(0), Some(3)] {
            let used: Vec<&Collected> = (0..ranges.len())
                .filter(|i| Some(*i) != without)
                .map(|i| &ranges[i])
                .collect();
            let density = |point: usize| {
                let far = DVector::from_iterator(
                    used.len(),
                    used.iter().map(|one| search.measured(&grid.points[point], one)),
                );
                let [(bias, of_bias), (scale, of_scale)] = calibration;
                let off = DVector::from_fn(used.len(), |i, _| used[i].range - bias - (1.0 + scale) * far[i]);
                let covariance = of_scale * &far * far.transpose()
                    + DMatrix::from_element(used.len(), used.len(), of_bias)
                    + DMatrix::identity(used.len(), used.len()) * grid.variance;
                let root = covariance.cholesky().unwrap();
                -grid.priors[point] - 0.5 * (off.dot(&root.solve(&off)) + root.determinant().ln())
            };
            let values = grid.values(&calibration, without);
            // Up to a constant of all points.
            let points = [0, 17, 312, 400, 624];
            let constant = values[312] - density(312);
            for point in points {
                let error = values[point] - density(point) - constant;
                assert!(error.abs() < 1e-8 * (1.0 + values[point].abs()), "{without:?}, {point}: {error}");
            }
        }
    }
}
