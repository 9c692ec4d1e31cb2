//! The exact scalar filter on a grid: the referee of every approximate one.

use crate::Error;
use fewbits_models::Ar1;
use fewbits_numerics::error::{ArgumentError, finite, positive};
use fewbits_numerics::normal::{INV_SQRT_2PI, log_pdf_with};

/// Uniform nodes of a trapezoid rule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    lower: f64,
    spacing: f64,
    points: usize,
}

impl Grid {
    /// Nodes from `lower` to `upper` or just beyond, `spacing` apart.
    ///
    /// # Errors
    /// Bounds that are not finite or not increasing, a spacing that is not positive, more than a million nodes.
    pub fn new(lower: f64, upper: f64, spacing: f64) -> Result<Self, Error> {
        finite("lower", lower)?;
        finite("upper", upper)?;
        positive("spacing", spacing)?;
        let intervals = ((upper - lower) / spacing).ceil();
        if !(1.0..1e6).contains(&intervals) {
            let expected = "an interval that holds 1 to a million spacings";
            return Err(ArgumentError::new("grid", format!("[{lower}, {upper}] by {spacing}"), expected).into());
        }
        Ok(Self {
            lower,
            spacing,
            points: intervals as usize + 1,
        })
    }

    /// Nodes symmetric about zero, zero included, out to `half_width` or just beyond.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn symmetric(half_width: f64, spacing: f64) -> Result<Self, Error> {
        let half = (positive("half_width", half_width)? / positive("spacing", spacing)?).ceil() * spacing;
        let mut grid = Self::new(-half, half, spacing)?;
        // Rounding of the quotient must not cost the symmetry.
        grid.points = 2 * (half / spacing).round() as usize + 1;
        Ok(grid)
    }

    /// Number of nodes.
    pub fn points(&self) -> usize {
        self.points
    }

    /// Distance of neighbouring nodes.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Node `i`.
    #[inline]
    pub fn node(&self, i: usize) -> f64 {
        self.lower + i as f64 * self.spacing
    }

    /// All nodes, increasing.
    pub fn nodes(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.points).map(|i| self.node(i))
    }

    /// Indices of the nodes within `[lower, upper]`.
    #[inline]
    pub fn indices_within(&self, lower: f64, upper: f64) -> std::ops::Range<usize> {
        let from = ((lower - self.lower) / self.spacing).ceil().max(0.0) as usize;
        let to = ((upper - self.lower) / self.spacing).floor() + 1.0;
        let to = (to.max(0.0) as usize).min(self.points);
        from.min(to)..to
    }
}

/// A density held by its values at the nodes of a [`Grid`].
#[derive(Debug, Clone, PartialEq)]
pub struct PointMass {
    grid: Grid,
    density: Vec<f64>,
}

impl PointMass {
    /// The density proportional to `exp(log_density(x))`.
    ///
    /// # Errors
    /// [`Error::Impossible`] if that is zero at every node.
    pub fn new(grid: Grid, log_density: impl Fn(f64) -> f64) -> Result<Self, Error> {
        let mut mass = Self {
            grid,
            density: vec![1.0; grid.points],
        };
        mass.update(log_density)?;
        Ok(mass)
    }

    /// A normal density.
    ///
    /// # Errors
    /// A variance that is not positive; [`Error::Impossible`] if it lies off the grid.
    pub fn normal(grid: Grid, mean: f64, variance: f64) -> Result<Self, Error> {
        finite("mean", mean)?;
        positive("variance", variance)?;
        Self::new(grid, |x| log_pdf_with(x, mean, variance))
    }

    /// The nodes.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Density at the nodes; sums to one over the spacing.
    pub fn density(&self) -> &[f64] {
        &self.density
    }

    /// Mean.
    pub fn mean(&self) -> f64 {
        self.expectation(|x| x)
    }

    /// Variance.
    pub fn variance(&self) -> f64 {
        let mean = self.mean();
        self.expectation(|x| (x - mean) * (x - mean))
    }

    /// `E f(x)`.
    pub fn expectation(&self, f: impl Fn(f64) -> f64) -> f64 {
        let sum: f64 = self.grid.nodes().zip(&self.density).map(|(x, p)| p * f(x)).sum();
        sum * self.grid.spacing
    }

    /// Bayes' rule with any log-likelihood; returns the log-evidence `ln p(heard | past)`.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the product with the belief is zero at every node; the belief is then as before.
    pub fn update(&mut self, log_likelihood: impl Fn(f64) -> f64) -> Result<f64, Error> {
        let logs: Vec<f64> = self.grid.nodes().map(log_likelihood).collect();
        let reachable = logs.iter().zip(&self.density).filter(|(_, p)| **p > 0.0);
        let peak = reachable.map(|(l, _)| *l).fold(f64::NEG_INFINITY, f64::max);
        if !peak.is_finite() {
            return Err(Error::Impossible);
        }
        let product = |(l, p): (&f64, &f64)| p * (l - peak).exp();
        let evidence = logs.iter().zip(&self.density).map(product).sum::<f64>() * self.grid.spacing;
        if !(evidence > 0.0 && evidence.is_finite()) {
            return Err(Error::Impossible);
        }
        for (p, l) in self.density.iter_mut().zip(&logs) {
            *p *= (l - peak).exp() / evidence;
        }
        Ok(evidence.ln() + peak)
    }

    /// The same with the likelihood tabulated at the nodes, up to a factor, and without allocation; returns the evidence in
    /// units of that factor. Prefer [`PointMass::update`] where the likelihood may underflow.
    ///
    /// # Errors
    /// A table of wrong length; [`Error::Impossible`], which leaves the belief as it was.
    pub fn reweight(&mut self, likelihood: &[f64]) -> Result<f64, Error> {
        if likelihood.len() != self.density.len() {
            let expected = "one value a node";
            return Err(ArgumentError::new("likelihood", format!("{} values", likelihood.len()), expected).into());
        }
        let sum: f64 = self.density.iter().zip(likelihood).map(|(p, l)| p * l).sum();
        let evidence = sum * self.grid.spacing;
        if !(evidence > 0.0 && evidence.is_finite()) {
            return Err(Error::Impossible);
        }
        for (p, l) in self.density.iter_mut().zip(likelihood) {
            *p *= l / evidence;
        }
        Ok(evidence)
    }

    /// Scales the density to integrate to one.
    fn normalise(&mut self) -> Result<(), Error> {
        let total = self.density.iter().sum::<f64>() * self.grid.spacing;
        if !(total > 0.0 && total.is_finite()) {
            return Err(Error::Impossible);
        }
        for p in &mut self.density {
            *p /= total;
        }
        Ok(())
    }
}

/// Standard deviations beyond which a kernel row is below rounding.
const REACH: f64 = 8.6;
/// Widest spacing, in standard deviations of the process noise, at which the trapezoid rule is still exact to about 1e-8.
const COARSEST: f64 = 1.0;

/// The exact filter of an autoregression observed through any likelihood, on a fixed grid.
///
/// The transition density is smooth, so the trapezoid rule converges spectrally: a spacing of 0.4 standard deviations of the
/// process noise (or of the sensing noise, if that is smaller) is exact to rounding as long as the grid holds the density.
///
/// ```text
/// predict:  p(x) <- h sum_y N(x; a y, q) p(y)
/// update:   p(x) <- p(x) p(heard | x) / evidence
/// smooth:   p(x) <- p(x) sum over the future of p(heard later | x)
/// ```
///
/// ```
/// use fewbits_numerics::normal::log_cdf;
/// use fewbits_filters::{Grid, PointMass, PointMassFilter};
/// use fewbits_models::Ar1;
/// let filter = PointMassFilter::new(&Ar1::new(0.9, 0.5)?, Grid::symmetric(14.0, 0.25)?)?;
/// let mut belief = filter.predict(&PointMass::normal(*filter.grid(), 0.0, 1.0)?)?;
/// belief.update(|x| log_cdf(x - 0.3))?;          // a sign bit at threshold 0.3 in unit noise
/// assert!(belief.mean() > 0.3);
/// # Ok::<(), fewbits_filters::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct PointMassFilter {
    grid: Grid,
    /// First column of each kernel row that is not negligible, and where the row starts in `weights`.
    rows: Vec<(usize, usize)>,
    weights: Vec<f64>,
}

impl PointMassFilter {
    /// The filter for one autoregression on one grid.
    ///
    /// # Errors
    /// Process noise too small for the spacing (its standard deviation must be at least one spacing).
    pub fn new(dynamics: &Ar1, grid: Grid) -> Result<Self, Error> {
        let deviation = dynamics.noise_variance().sqrt();
        if deviation < COARSEST * grid.spacing {
            let expected = "a spacing of at most one standard deviation of the process noise";
            return Err(ArgumentError::new("grid", format!("spacing {}", grid.spacing), expected).into());
        }
        let a = dynamics.coefficient();
        let scale = grid.spacing * INV_SQRT_2PI / deviation;
        let (mut rows, mut weights) = (Vec::with_capacity(grid.points + 1), Vec::new());
        for x in grid.nodes() {
            let centre = x / a;
            let half = REACH * deviation / a.abs();
            let columns = if half.is_finite() && centre.is_finite() {
                grid.indices_within(centre - half, centre + half)
            } else {
                0..grid.points
            };
            rows.push((columns.start, weights.len()));
            weights.extend(columns.map(|j| {
                let z = (x - a * grid.node(j)) / deviation;
                scale * (-0.5 * z * z).exp()
            }));
        }
        rows.push((0, weights.len()));
        Ok(Self { grid, rows, weights })
    }

    /// The nodes.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Row `i` of the kernel and the column it starts at.
    fn row(&self, i: usize) -> (usize, &[f64]) {
        let (column, start) = self.rows[i];
        (column, &self.weights[start..self.rows[i + 1].1])
    }

    fn check(&self, belief: &PointMass) -> Result<(), Error> {
        if belief.grid == self.grid {
            Ok(())
        } else {
            Err(ArgumentError::new("belief", format!("on {:?}", belief.grid), "a density on the filter's grid").into())
        }
    }

    /// Time update.
    ///
    /// # Errors
    /// A belief on another grid; [`Error::Impossible`] if the density has left the grid.
    pub fn predict(&self, belief: &PointMass) -> Result<PointMass, Error> {
        let mut predicted = belief.clone();
        self.predict_into(belief, &mut predicted)?;
        Ok(predicted)
    }

    /// Time update into a density that exists already, without allocation. What leaves the grid is lost and the rest scaled.
    ///
    /// # Errors
    /// As [`PointMassFilter::predict`].
    pub fn predict_into(&self, belief: &PointMass, predicted: &mut PointMass) -> Result<(), Error> {
        self.check(belief)?;
        self.check(predicted)?;
        for (i, p) in predicted.density.iter_mut().enumerate() {
            let (column, row) = self.row(i);
            let from = &belief.density[column..column + row.len()];
            *p = row.iter().zip(from).map(|(w, q)| w * q).sum();
        }
        predicted.normalise()
    }

    /// The belief given what was heard later: multiplies a filtered density with the likelihood of the future.
    ///
    /// `likelihoods[k]` holds `p(heard at step k + 1 after the belief | x)` at the nodes, up to a factor.
    ///
    /// # Errors
    /// A belief on another grid, a likelihood of wrong length; [`Error::Impossible`].
    pub fn smooth<L: AsRef<[f64]>>(&self, filtered: &PointMass, likelihoods: &[L]) -> Result<PointMass, Error> {
        self.check(filtered)?;
        let mut message = vec![1.0; self.grid.points];
        let mut weighted = message.clone();
        for likelihood in likelihoods.iter().rev() {
            let likelihood = likelihood.as_ref();
            if likelihood.len() != self.grid.points {
                let expected = "one value a node";
                return Err(ArgumentError::new("likelihoods", format!("{} values", likelihood.len()), expected).into());
            }
            for ((w, m), l) in weighted.iter_mut().zip(&message).zip(likelihood) {
                *w = m * l;
            }
            message.fill(0.0);
            for (i, w) in weighted.iter().enumerate() {
                let (column, row) = self.row(i);
                for (m, k) in message[column..].iter_mut().zip(row) {
                    *m += k * w;
                }
            }
            // Only the shape counts; scaling keeps a long future from underflowing.
            let peak = message.iter().copied().fold(0.0, f64::max);
            if !(peak > 0.0 && peak.is_finite()) {
                return Err(Error::Impossible);
            }
            message.iter_mut().for_each(|m| *m /= peak);
        }
        let mut smoothed = filtered.clone();
        smoothed.reweight(&message)?;
        Ok(smoothed)
    }
}

#[cfg(test)]
mod tests {
    use super::{Grid, PointMass, PointMassFilter};
    use crate::{Error, kalman, smoother};
    use fewbits_core::Gaussian;
    use fewbits_models::{Ar1, LinearSensor};
    use fewbits_numerics::normal::log_pdf_with;
    use nalgebra::Vector1;

    /// With Gaussian measurements the Kalman filter and smoother are exact, so the grid must agree with them.
    #[test]
    fn agrees_with_kalman_and_smoother() {
        for a in [0.9, -0.7, 0.0, 1.0] {
            let dynamics = Ar1::new(a, 0.5).unwrap();
            let sensing = LinearSensor::direct(1.3).unwrap();
            let filter = PointMassFilter::new(&dynamics, Grid::symmetric(16.0, 0.25).unwrap()).unwrap();
            let mut grid_belief = PointMass::normal(*filter.grid(), 0.4, 2.0).unwrap();
            let mut belief = Gaussian::scalar(0.4, 2.0).unwrap();
            let data = [1.0, -0.5, 2.5, 0.1, -1.2];
            let (mut beliefs, mut grid_beliefs, mut likelihoods) = (vec![], vec![], vec![]);
            for z in data {
                grid_belief = filter.predict(&grid_belief).unwrap();
                let evidence = grid_belief.update(|x| log_pdf_with(z, x, 1.3)).unwrap();
                let (next, info) = kalman::step(&dynamics, &sensing, &belief, &Vector1::new(z)).unwrap();
                belief = next;
                assert!((evidence - info.log_likelihood).abs() < 1e-11);
                assert!((grid_belief.mean() - belief.mean()[0]).abs() < 1e-11);
                assert!((grid_belief.variance() - belief.covariance()[0]).abs() < 1e-11);
                beliefs.push(belief);
                grid_beliefs.push(grid_belief.clone());
                likelihoods.push(
                    filter
                        .grid()
                        .nodes()
                        .map(|x| log_pdf_with(z, x, 1.3).exp())
                        .collect::<Vec<_>>(),
                );
            }
            let smoothed = smoother::smooth(&dynamics, &beliefs).unwrap();
            for n in 0..data.len() {
                let exact = filter.smooth(&grid_beliefs[n], &likelihoods[n + 1..]).unwrap();
                assert!((exact.mean() - smoothed[n].mean()[0]).abs() < 1e-11);
                assert!((exact.variance() - smoothed[n].covariance()[0]).abs() < 1e-11);
            }
        }
    }

    #[test]
    fn impossible_news_leave_the_belief_intact() {
        let grid = Grid::symmetric(5.0, 0.25).unwrap();
        let mut belief = PointMass::normal(grid, 0.0, 1.0).unwrap();
        let before = belief.clone();
        assert_eq!(belief.update(|_| f64::NEG_INFINITY), Err(Error::Impossible));
        assert_eq!(belief.update(|_| f64::NAN), Err(Error::Impossible));
        assert_eq!(belief, before);
        // A likelihood far below the smallest double is no obstacle.
        assert!(belief.update(|x| -1e5 - x * x).is_ok());
        assert!((belief.variance() - 1.0 / 3.0).abs() < 1e-12);
        let mut tabulated = belief.clone();
        let table: Vec<f64> = grid.nodes().map(|x| (-x).exp()).collect();
        let evidence = tabulated.reweight(&table).unwrap();
        assert!((evidence.ln() - belief.update(|x| -x).unwrap()).abs() < 1e-12);
        assert!((tabulated.mean() - belief.mean()).abs() < 1e-12);
        assert_eq!(tabulated.reweight(&vec![0.0; table.len()]), Err(Error::Impossible));
        assert!(tabulated.reweight(&[1.0]).is_err());
    }

    #[test]
    fn refuses_what_a_grid_cannot_resolve() {
        assert!(Grid::new(1.0, 0.0, 0.1).is_err());
        assert!(Grid::new(0.0, 1.0, 1e-9).is_err());
        assert!(Grid::symmetric(f64::NAN, 1.0).is_err());
        let grid = Grid::symmetric(5.0, 0.25).unwrap();
        assert_eq!((grid.points(), grid.node(20)), (41, 0.0));
        assert!(PointMassFilter::new(&Ar1::new(0.9, 0.0).unwrap(), grid).is_err());
        let filter = PointMassFilter::new(&Ar1::new(0.9, 1.0).unwrap(), grid).unwrap();
        let elsewhere = PointMass::normal(Grid::symmetric(6.0, 0.25).unwrap(), 0.0, 1.0).unwrap();
        assert!(filter.predict(&elsewhere).is_err());
        let here = PointMass::normal(grid, 0.0, 1.0).unwrap();
        assert!(filter.smooth(&here, &[vec![1.0; 3]]).is_err());
    }
}
