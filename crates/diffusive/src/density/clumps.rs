//! A weighted cloud summed up by a few clumps, and Gaussian mixtures fitted to them.

use super::Error;
use fewbits_core::Columns;
use fewbits_densities::{Component, Mixture};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::eigen::symmetric_eigen;
use fewbits_numerics::error::{at_least_one, non_negative, within};
use nalgebra::{Cholesky, SMatrix, SVector};

/// Weight, mean and covariance of one part of a belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clump<const D: usize> {
    /// Share of the mass.
    pub weight: f64,
    /// Mean.
    pub mean: SVector<f64, D>,
    /// Covariance within the clump, possibly singular.
    pub covariance: SMatrix<f64, D, D>,
}

/// A belief as clumps: their moments together are exactly those of the points they were made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Clumps<const D: usize> {
    clumps: Vec<Clump<D>>,
    least: SVector<f64, D>,
}

/// How a mixture is fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct MixtureFit {
    /// The most components.
    pub components: usize,
    /// Components below this weight are dropped and the others fitted anew.
    pub least_weight: f64,
    /// The most steps of expectation-maximisation.
    pub iterations: usize,
    /// It stops when the mean log density rises by less than this, in nats.
    pub tolerance: f64,
}

impl MixtureFit {
    /// A fit of at most `components` Gaussians.
    ///
    /// # Errors
    /// If `components` is zero.
    pub fn new(components: usize) -> Result<Self, Error> {
        Ok(Self {
            components: at_least_one("components", components)?,
            least_weight: 0.02,
            iterations: 60,
            tolerance: 1e-4,
        })
    }

    /// The same, with another least weight.
    ///
    /// # Errors
    /// If it is outside `[0, 1]`.
    pub fn with_least_weight(self, least_weight: f64) -> Result<Self, Error> {
        within("least_weight", least_weight, 0.0, 1.0)?;
        Ok(Self { least_weight, ..self })
    }
}

impl<const D: usize> Clumps<D> {
    /// Splits weighted points into at most `count` clumps: again and again the clump whose points spread most (weight times
    /// largest variance) is cut at its mean across that coordinate. `spread` is what each point adds to the variances, one
    /// column a coordinate or an empty one: a point may stand for a coordinate that was integrated out.
    ///
    /// # Errors
    /// If `count` is zero, lengths differ, or no weight is above zero.
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
            return Err(ArgumentError::new("columns", "of different lengths", "one number a weight").into());
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
            return Err(fewbits_core::Error::Impossible.into());
        }
        let mut cloud = Cloud {
            columns,
            spread,
            weights,
            total,
            scale: SVector::repeat(1.0),
        };
        // Coordinates may have different units: variances count in parts of the whole's.
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
                // Rounding left no point on one side.
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

    /// Mean of the whole.
    pub fn mean(&self) -> SVector<f64, D> {
        self.clumps.iter().map(|c| c.mean * c.weight).sum()
    }

    /// Covariance of the whole.
    pub fn covariance(&self) -> SMatrix<f64, D, D> {
        let mean = self.mean();
        self.clumps
            .iter()
            .map(|c| {
                let d = c.mean - mean;
                (c.covariance + d * d.transpose()) * c.weight
            })
            .sum()
    }

    /// The same, with least variances of fitted components: what the points resolve. Zero sets none.
    ///
    /// # Errors
    /// If a variance is negative or not finite.
    pub fn with_least_variances(self, least: SVector<f64, D>) -> Result<Self, Error> {
        for variance in &least {
            non_negative("least", *variance)?;
        }
        Ok(Self { least, ..self })
    }

    /// A Gaussian mixture of the same mean and covariance, by expectation-maximisation over the clumps.
    ///
    /// A clump counts with its covariance: the expected log density decides its shares, and its spread goes into the
    /// components. The start is the clumps' own coarsest splitting, so that the result is deterministic.
    ///
    /// # Errors
    /// If the whole has no spread in some direction.
    pub fn fit(&self, options: &MixtureFit) -> Result<Mixture<D>, Error> {
        let whole = self.covariance();
        let mut components = self.start(options.components);
        loop {
            let fitted = self.improve(components, &whole, options);
            let least = fitted
                .iter()
                .enumerate()
                .min_by(|a, b| a.1.weight.total_cmp(&b.1.weight))
                .map(|(at, c)| (at, c.weight));
            match least {
                Some((at, weight)) if weight < options.least_weight && fitted.len() > 1 => {
                    components = fitted;
                    components.swap_remove(at);
                }
                _ => {
                    let parts = fitted
                        .into_iter()
                        .map(|c| Component::new(c.weight, c.mean, c.covariance));
                    return Ok(Mixture::new(parts.collect::<Result<_, _>>()?)?);
                }
            }
        }
    }

    fn start(&self, count: usize) -> Vec<Clump<D>> {
        let column = |d: usize| self.clumps.iter().map(|c| c.mean[d]).collect::<Vec<_>>();
        let columns: [Vec<f64>; D] = std::array::from_fn(column);
        let weights: Vec<f64> = self.clumps.iter().map(|c| c.weight).collect();
        let none: Columns<'_, D> = [&[]; D];
        match Clumps::new(&columns.each_ref().map(Vec::as_slice), &none, &weights, count) {
            Ok(coarse) => coarse.clumps,
            Err(_) => self.clumps.clone(),
        }
    }

    fn improve(&self, start: Vec<Clump<D>>, whole: &SMatrix<f64, D, D>, options: &MixtureFit) -> Vec<Clump<D>> {
        // The floor keeps components from collapsing onto single clumps; it is below what the belief resolves.
        let floor = (whole.diagonal() * 1e-9).sup(&self.least);
        let mut components = start;
        for c in &mut components {
            c.covariance = raised(c.covariance, &floor);
        }
        let mut before = f64::NEG_INFINITY;
        let mut logs = vec![0.0; components.len()];
        for _ in 0..options.iterations {
            let prepared: Vec<_> = components.iter().map(Prepared::new).collect();
            let mut sums: Vec<Sums<D>> = components.iter().map(|_| Sums::default()).collect();
            let mut mean_log = 0.0;
            for clump in &self.clumps {
                let mut best = f64::NEG_INFINITY;
                for (log, p) in logs.iter_mut().zip(&prepared) {
                    *log = p.as_ref().map_or(f64::NEG_INFINITY, |p| p.expected_log(clump));
                    best = best.max(*log);
                }
                let mut total = 0.0;
                for log in &mut logs {
                    *log = if *log > best - 40.0 { (*log - best).exp() } else { 0.0 };
                    total += *log;
                }
                mean_log += clump.weight * (best + total.ln());
                for (share, s) in logs.iter().zip(&mut sums) {
                    if *share > 0.0 {
                        s.add(clump, clump.weight * share / total);
                    }
                }
            }
            components = sums.iter().filter_map(|s| s.clump(&floor)).collect();
            logs.truncate(components.len());
            let gained = mean_log - before;
            if gained <= options.tolerance || gained.is_nan() {
                break;
            }
            before = mean_log;
        }
        components
    }
}

/// A covariance whose eigenvalues, in coordinates where the given variances are one, are at least one.
fn raised<const D: usize>(covariance: SMatrix<f64, D, D>, least: &SVector<f64, D>) -> SMatrix<f64, D, D> {
    if least.iter().any(|v| *v <= 0.0) {
        return covariance;
    }
    let scale = least.map(f64::sqrt);
    let scaled = SMatrix::<f64, D, D>::from_fn(|i, j| covariance[(i, j)] / (scale[i] * scale[j]));
    let (values, vectors) = symmetric_eigen(scaled);
    if values.iter().all(|v| *v >= 1.0) {
        return covariance;
    }
    let lifted = vectors * SMatrix::from_diagonal(&values.map(|v| v.max(1.0))) * vectors.transpose();
    SMatrix::from_fn(|i, j| 0.5 * (lifted[(i, j)] + lifted[(j, i)]) * scale[i] * scale[j])
}

/// A component ready to be evaluated.
struct Prepared<const D: usize> {
    mean: SVector<f64, D>,
    precision: SMatrix<f64, D, D>,
    log_scale: f64,
}

impl<const D: usize> Prepared<D> {
    fn new(c: &Clump<D>) -> Option<Self> {
        let factor = Cholesky::new(c.covariance)?;
        let half_log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum();
        Some(Self {
            mean: c.mean,
            precision: factor.inverse(),
            log_scale: c.weight.ln() - half_log_determinant,
        })
    }

    /// Expected log density over the clump, up to a constant.
    #[inline]
    fn expected_log(&self, clump: &Clump<D>) -> f64 {
        let d = clump.mean - self.mean;
        self.log_scale - 0.5 * (d.dot(&(self.precision * d)) + self.precision.dot(&clump.covariance))
    }
}

struct Sums<const D: usize> {
    weight: f64,
    first: SVector<f64, D>,
    second: SMatrix<f64, D, D>,
    origin: Option<SVector<f64, D>>,
}

impl<const D: usize> Default for Sums<D> {
    fn default() -> Self {
        Self {
            weight: 0.0,
            first: SVector::zeros(),
            second: SMatrix::zeros(),
            origin: None,
        }
    }
}

impl<const D: usize> Sums<D> {
    #[inline]
    fn add(&mut self, clump: &Clump<D>, weight: f64) {
        // Second moments about the first clump met, which is near: no cancellation against a far origin.
        let d = clump.mean - *self.origin.get_or_insert(clump.mean);
        self.weight += weight;
        self.first += d * weight;
        self.second += (d * d.transpose() + clump.covariance) * weight;
    }

    fn clump(&self, floor: &SVector<f64, D>) -> Option<Clump<D>> {
        let origin = self.origin?;
        let mean = self.first / self.weight;
        (self.weight > 1e-12).then(|| Clump {
            weight: self.weight,
            mean: origin + mean,
            covariance: raised(self.second / self.weight - mean * mean.transpose(), floor),
        })
    }
}

struct Cloud<'a, const D: usize> {
    columns: &'a Columns<'a, D>,
    spread: &'a Columns<'a, D>,
    weights: &'a [f64],
    total: f64,
    /// What makes variances of different coordinates comparable.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn two_lobes() -> ([Vec<f64>; 2], Vec<f64>) {
        let (mut x, mut y, mut w) = (Vec::new(), Vec::new(), Vec::new());
        for (mx, my, mass) in [(0.0_f64, 0.0_f64, 0.3), (10.0, 2.0, 0.7)] {
            for i in -20_i32..=20 {
                for j in -20_i32..=20 {
                    let (a, b) = (f64::from(i) * 0.2, f64::from(j) * 0.2);
                    x.push(mx + a);
                    y.push(my + b);
                    w.push(mass * (-0.5 * (a * a + b * b)).exp());
                }
            }
        }
        ([x, y], w)
    }

    #[test]
    fn two_lobes_are_found_and_moments_kept() {
        let (columns, weights) = two_lobes();
        let view = columns.each_ref().map(Vec::as_slice);
        let clumps = Clumps::new(&view, &[&[], &[]], &weights, 200).unwrap();
        let whole = Clumps::new(&view, &[&[], &[]], &weights, 1).unwrap();
        assert!((clumps.mean() - whole.mean()).amax() < 1e-12);
        assert!((clumps.covariance() - whole.covariance()).amax() < 1e-11);
        let mixture = clumps.fit(&MixtureFit::new(2).unwrap()).unwrap();
        let mut means: Vec<f64> = mixture.components().iter().map(|c| c.mean()[0]).collect();
        means.sort_by(f64::total_cmp);
        assert!((means[0]).abs() < 0.02 && (means[1] - 10.0).abs() < 0.02, "{means:?}");
        assert!(
            mixture
                .components()
                .iter()
                .all(|c| (c.covariance()[(0, 0)] - 1.0).abs() < 0.02)
        );
        // The step floor only adds 1e-9 of the spread.
        assert!((mixture.covariance() - whole.covariance()).amax() < 1e-6);
    }

    #[test]
    fn spread_goes_into_the_covariance() {
        let clumps = Clumps::new(&[&[0.0, 1.0]], &[&[2.0, 4.0]], &[1.0, 1.0], 8).unwrap();
        assert_eq!(clumps.covariance()[0], 3.25);
        let clumps = Clumps::new(&[&[0.0, 1.0]], &[&[2.0, 4.0]], &[1.0, 3.0], 1).unwrap();
        assert!((clumps.covariance()[0] - 3.0 / 16.0 - 3.5).abs() < 1e-15 && clumps.clumps().len() == 1);
        assert!(Clumps::<1>::new(&[&[0.0, 1.0]], &[&[1.0]], &[1.0, 1.0], 3).is_err());
        assert!(Clumps::<1>::new(&[&[0.0, 1.0]], &[&[]], &[1.0, -1.0], 3).is_err());
        assert!(Clumps::<1>::new(&[&[0.0]], &[&[]], &[0.0], 3).is_err());
        assert!(Clumps::<1>::new(&[&[0.0]], &[&[]], &[1.0, 1.0], 3).is_err());
    }

    /// Two loose pairs and a heavier tight one, in coordinates of very different units, with a point of no weight.
    #[test]
    fn what_spreads_most_is_cut_at_its_mean() {
        let x = [0.0, 4.0, 100.0, 103.0, 50.0, 0.0, 0.0];
        let y = [3e6, 3e6, 3e6, 3e6, 9e9, -3e6, -3e6];
        let weights = [1.0, 1.0, 5.0, 5.0, 0.0, 2.0, 3.0];
        let means = |count| {
            let clumps = Clumps::new(&[&x, &y], &[&[], &[]], &weights, count).unwrap();
            let whole = Clumps::new(&[&x, &y], &[&[], &[]], &weights, 1).unwrap();
            assert!(
                (clumps.mean() - whole.mean())
                    .component_div(&SVector::from([1.0, 1e6]))
                    .amax()
                    < 1e-12
            );
            let gap =
                (clumps.covariance() - whole.covariance()).component_div(&SMatrix::from([[1.0, 1e6], [1e6, 1e12]]));
            assert!(gap.amax() < 1e-10);
            let mut means: Vec<_> = clumps
                .clumps()
                .iter()
                .map(|c| (c.mean.x, c.mean.y, c.weight * 17.0))
                .collect();
            means.sort_by(|a, b| a.partial_cmp(b).unwrap());
            means
        };
        let near = |found: Vec<(f64, f64, f64)>, exact: &[(f64, f64, f64)]| {
            assert_eq!(found.len(), exact.len(), "{found:?}");
            for (a, b) in found.iter().zip(exact) {
                assert!((a.0 - b.0).abs() < 1e-9 && (a.1 - b.1).abs() < 1e-3 && (a.2 - b.2).abs() < 1e-12, "{found:?}");
            }
        };
        let (low, left, right) = ((0.0, -3e6, 5.0), (2.0, 3e6, 2.0), (101.5, 3e6, 10.0));
        near(means(2), &[(4.0 / 7.0, -9e6 / 7.0, 7.0), right]);
        near(means(3), &[low, left, right]);
        near(means(4), &[low, left, (100.0, 3e6, 5.0), (103.0, 3e6, 5.0)]);
        let all = [
            low,
            (0.0, 3e6, 1.0),
            (4.0, 3e6, 1.0),
            (100.0, 3e6, 5.0),
            (103.0, 3e6, 5.0),
        ];
        near(means(5), &all);
        // Equal points stay together.
        near(means(6), &all);
    }

    #[test]
    fn eigenvalues_are_raised_in_the_units_of_the_least_variances() {
        let turn = SMatrix::<f64, 2, 2>::new(0.8, -0.6, 0.6, 0.8);
        let unit = SMatrix::<f64, 2, 2>::new(2.0, 0.0, 0.0, 0.25);
        let of =
            |a: f64, b: f64| unit * turn * SMatrix::from_diagonal(&SVector::from([a, b])) * turn.transpose() * unit;
        let least = SVector::from([4.0, 0.0625]);
        for (a, b) in [(0.3, 2.0), (3.0, 0.2), (0.1, 0.4), (1.5, 2.5)] {
            assert!((raised(of(a, b), &least) - of(a.max(1.0), b.max(1.0))).amax() < 1e-14, "{a} {b}");
        }
        for none in [[0.0, 0.0625], [4.0, 0.0]] {
            assert_eq!(raised(of(0.3, 0.2), &SVector::from(none)), of(0.3, 0.2));
        }
    }

    /// One step of expectation-maximisation as the textbooks have it, and the mean log density before it.
    fn step(clumps: &[Clump<2>], components: &[Clump<2>]) -> (Vec<Clump<2>>, f64) {
        let density = |k: &Clump<2>, c: &Clump<2>| {
            let precision = k.covariance.try_inverse().unwrap();
            let d = c.mean - k.mean;
            let square = d.dot(&(precision * d)) + (precision * c.covariance).trace();
            k.weight * (-0.5 * square).exp() / k.covariance.determinant().sqrt()
        };
        let total = |c: &Clump<2>| components.iter().map(|k| density(k, c)).sum::<f64>();
        let fitted = components.iter().map(|k| {
            let shares: Vec<f64> = clumps.iter().map(|c| c.weight * density(k, c) / total(c)).collect();
            let weight: f64 = shares.iter().sum();
            let mean = shares
                .iter()
                .zip(clumps)
                .map(|(s, c)| c.mean * *s)
                .sum::<SVector<f64, 2>>()
                / weight;
            let spread = |c: &Clump<2>| c.covariance + (c.mean - mean) * (c.mean - mean).transpose();
            let second: SMatrix<f64, 2, 2> = shares.iter().zip(clumps).map(|(s, c)| spread(c) * *s).sum();
            Clump {
                weight,
                mean,
                covariance: second / weight,
            }
        });
        (fitted.collect(), clumps.iter().map(|c| c.weight * total(c).ln()).sum())
    }

    #[test]
    fn fits_are_expectation_maximisation_until_it_gains_too_little() {
        // A bent band of points.
        let at = |i: i32| f64::from(i) * 0.05;
        let x: Vec<f64> = (0..120).map(|i| at(i) + 0.3 * (7.0 * at(i)).sin()).collect();
        let y: Vec<f64> = (0..120)
            .map(|i| 1e3 * ((at(i) - 2.0).powi(2) + (11.3 * at(i)).cos()))
            .collect();
        let weights: Vec<f64> = (0..120).map(|i| 1.2 + (1.7 * at(i)).sin()).collect();
        let clumps = Clumps::new(&[&x, &y], &[&[], &[]], &weights, 40).unwrap();
        let close = |found: &Mixture<2>, exact: &[Clump<2>]| {
            assert_eq!(found.len(), exact.len());
            let unit = SVector::from([1.0, 1e3]);
            for (a, b) in found.components().iter().zip(exact) {
                let gap = (a.covariance() - b.covariance).component_div(&(unit * unit.transpose()));
                let off = (a.mean() - b.mean).component_div(&unit);
                assert!((a.weight() - b.weight).abs() < 1e-8 && off.amax() < 1e-8 && gap.amax() < 1e-7, "{off} {gap}");
            }
        };
        let options = |iterations, tolerance, least_weight| MixtureFit {
            components: 3,
            least_weight,
            iterations,
            tolerance,
        };
        let mut exact = vec![clumps.start(3)];
        let mut heights = Vec::new();
        for k in 0..9 {
            let (next, height) = step(clumps.clumps(), &exact[k]);
            close(&clumps.fit(&options(k + 1, -1.0, 0.0)).unwrap(), &next);
            exact.push(next);
            heights.push(height);
        }
        // It ends after the first step before which the height rose by less than the tolerance.
        for k in [2, 5, 8] {
            let gain = heights[k] - heights[k - 1];
            assert!(gain < heights[k - 1] - heights[k - 2] || k == 2);
            let tolerance = 1.0001 * gain;
            let ends = (1..9).find(|k| heights[*k] - heights[*k - 1] <= tolerance).unwrap();
            close(&clumps.fit(&options(60, tolerance, 0.0)).unwrap(), &exact[ends + 1]);
        }
        // What is too light is dropped, one after the other, and the rest fitted on from where it was.
        let fitted = |least| clumps.fit(&options(9, -1.0, least)).unwrap();
        let lightest = (0..3)
            .min_by(|a, b| exact[9][*a].weight.total_cmp(&exact[9][*b].weight))
            .unwrap();
        let least = 1.0001 * exact[9][lightest].weight;
        let mut left = exact[9].clone();
        left.swap_remove(lightest);
        for _ in 0..9 {
            left = step(clumps.clumps(), &left).0;
        }
        assert!(left.iter().all(|c| c.weight > least));
        close(&fitted(least), &left);
        close(&fitted(0.9999 * exact[9][lightest].weight), &exact[9]);
        let one = fitted(1.0);
        assert!(
            one.len() == 1
                && (one.mean() - clumps.mean())
                    .component_div(&SVector::from([1.0, 1e3]))
                    .amax()
                    < 1e-12
        );
        assert!(MixtureFit::new(0).is_err() && MixtureFit::new(3).unwrap().with_least_weight(1.1).is_err());
        assert_eq!(MixtureFit::new(3).unwrap().with_least_weight(0.3).unwrap().least_weight, 0.3);
    }

    #[test]
    fn components_are_no_narrower_than_what_the_points_resolve() {
        // Cells of side one under a Gaussian of deviation one: as many clumps as cells, and a component could shrink onto one.
        let (mut x, mut y, mut weights) = (Vec::new(), Vec::new(), Vec::new());
        for i in -5..=5 {
            for j in -5..=5 {
                let (a, b) = (f64::from(i), f64::from(j));
                x.push(a);
                y.push(b);
                weights.push((-0.5 * (a * a + b * b)).exp() / std::f64::consts::TAU);
            }
        }
        let least = 0.25;
        let clumps = Clumps::new(&[&x, &y], &[&[], &[]], &weights, 200).unwrap();
        let clumps = clumps.with_least_variances(SVector::from([least; 2])).unwrap();
        let fit = clumps.fit(&MixtureFit::new(8).unwrap()).unwrap();
        for c in fit.components() {
            let (values, _) = symmetric_eigen(*c.covariance());
            assert!(values.iter().all(|v| *v > least * (1.0 - 1e-9)), "{values:?}");
        }
        let kl: f64 = (0..weights.len())
            .map(|i| weights[i] * (weights[i].ln() - fit.log_pdf(&SVector::from([x[i], y[i]]))))
            .sum();
        // Sums over cells of a Gaussian this narrow are up to 3 per cent above one.
        assert!(kl > -0.03, "{kl}");
        let bad = Clumps::<1>::new(&[&[0.0, 1.0]], &[&[]], &[1.0, 1.0], 3).unwrap();
        assert!(bad.with_least_variances(SVector::from([-1.0])).is_err());
    }
}
