//! Polynomial Gaussians over a plane and one more coordinate, beside beliefs that are cells over the plane.

use super::polynomials::HIGHEST_DEGREE;
use super::{Lpg, LpgFit, Term, gauss_hermite, row_of_polynomials};
use crate::density::{Cells, Error};
use fewbits_core::columns::state_at;
use fewbits_densities::Component;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::quadrature::gauss_legendre;
use nalgebra::{DVector, Vector2, Vector3};

/// A belief over three coordinates at one place of the first two: `s(t)^2` along the third, with
/// `s(t) = sum_l exp(height_l - u_l^2 / 4) sum_k d_lk h_k(u_l)`, `u_l = (t - centre_l) / deviation_l`.
///
/// Made to be used again for place after place: [`Lpg::slice`] overwrites it.
#[derive(Debug, Clone, Default)]
pub struct Slice {
    terms: Vec<SliceTerm>,
    degree: usize,
    /// Sums of absolute values, which bound `|s|`.
    absolute: bool,
}

#[derive(Debug, Clone, Copy)]
struct SliceTerm {
    height: f64,
    centre: f64,
    deviation: f64,
    coefficients: [f64; HIGHEST_DEGREE + 1],
}

/// Integral, mean and variance of a slice times a likelihood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SliceMoments {
    /// Logarithm of the integral.
    pub log_mass: f64,
    /// Mean.
    pub mean: f64,
    /// Variance.
    pub variance: f64,
}

/// A Gaussian times a polynomial of the degrees in use ends here, in standard deviations.
const ENDS: f64 = 8.5;
/// A panel of the quadrature along a slice is at most so many standard deviations wide, and a stretch has at least so many panels.
const PANEL: f64 = 2.5;
const LEAST_PANELS: usize = 6;
const MOST_PANELS: usize = 200;
/// Terms this many nats below the largest are left out.
const FAINT: f64 = 60.0;

impl Lpg<3> {
    /// The best approximation of a belief that is cells over the first two coordinates and, in each cell, a normal of the third
    /// with the given mean and variance: as [`Lpg::fit`], the third coordinate integrated in closed form.
    ///
    /// # Errors
    /// If there is no Gaussian, `degree` exceeds 20, the lengths differ, or the basis is singular (two equal Gaussians).
    pub fn fit_lifted(
        cells: &Cells<2>,
        means: &[f64],
        variances: &[f64],
        gaussians: &[Component<3>],
        degree: usize,
    ) -> Result<LpgFit<3>, Error> {
        let belief = Self::skeleton(gaussians, degree)?;
        if means.len() != cells.len() || variances.len() != cells.len() {
            return Err(ArgumentError::new("means", means.len(), format!("{}, one for each cell", cells.len())).into());
        }
        let gram = belief.gram()?;
        let size = belief.indices.len();
        let mut b = DVector::zeros(gram.nrows());
        // Exact for polynomials of this degree.
        let rule = gauss_hermite(degree / 2 + 1);
        let columns = cells.columns();
        let (mut first, mut second, mut third, mut row) =
            (vec![0.0; degree + 1], vec![0.0; degree + 1], vec![0.0; degree + 1], vec![0.0; degree + 1]);
        for (i, weight) in cells.weights().iter().enumerate() {
            let (mean, variance) = (means[i], variances[i]);
            if variance.is_nan() || variance <= 0.0 {
                // No width: no overlap.
                continue;
            }
            let place = state_at(&columns, i);
            for (l, term) in belief.terms.iter().enumerate() {
                let (u, centre, deviation) = term.at_place(&place);
                // The product of the two roots along the third coordinate: a Gaussian of variance 2 / precision.
                let precision = 1.0 / variance + 1.0 / (deviation * deviation);
                let gap = mean - centre;
                let log = term.half_log_peak
                    - 0.25 * (u.norm_squared() + gap * gap / (variance + deviation * deviation))
                    - 0.25 * (std::f64::consts::TAU * variance).ln()
                    + 0.5 * (2.0 * std::f64::consts::TAU / precision).ln();
                if log < -80.0 {
                    continue;
                }
                let factor = weight.sqrt() * cells.width() * log.exp();
                let middle = gap / (variance * precision);
                third.fill(0.0);
                for (node, share) in &rule {
                    row_of_polynomials((middle + node * (2.0 / precision).sqrt()) / deviation, &mut row);
                    third.iter_mut().zip(&row).for_each(|(sum, h)| *sum += share * h);
                }
                row_of_polynomials(u.x, &mut first);
                row_of_polynomials(u.y, &mut second);
                for (nu, [i, j, k]) in belief.indices.iter().enumerate() {
                    b[l * size + nu] += factor * first[*i] * second[*j] * third[*k];
                }
            }
        }
        belief.project(&gram, &b)
    }

    /// Writes the belief along the third coordinate at a place of the other two to `slice`. With a `half_width` above zero, about the
    /// most that it is anywhere within that of the place: Gaussians widened by the cell, polynomials by their absolute values.
    pub fn slice(&self, place: &Vector2<f64>, half_width: f64, slice: &mut Slice) {
        let degree = self.degree;
        slice.terms.clear();
        (slice.degree, slice.absolute) = (degree, half_width > 0.0);
        let (mut first, mut second) = ([0.0; HIGHEST_DEGREE + 1], [0.0; HIGHEST_DEGREE + 1]);
        for term in &self.terms {
            let (u, centre, deviation) = term.at_place(place);
            let w = &term.inverse;
            let reach = half_width * (2.0 * w.fixed_view::<2, 2>(0, 0).norm_squared()).sqrt();
            let near = (u.norm() - reach).max(0.0);
            // How far the centre moves within the cell.
            let shift = half_width * (w[(2, 0)].abs() + w[(2, 1)].abs()) * deviation;
            row_of_polynomials(u.x, &mut first[..=degree]);
            row_of_polynomials(u.y, &mut second[..=degree]);
            let mut coefficients = [0.0; HIGHEST_DEGREE + 1];
            for ([i, j, k], c) in self.indices.iter().zip(&term.coefficients) {
                let value = c * first[*i] * second[*j];
                coefficients[*k] += match slice.absolute {
                    false => value,
                    // A coarse cell: near the middle the polynomials are about one.
                    true if reach > 0.5 => value.abs().max(c.abs()),
                    true => value.abs(),
                };
            }
            slice.terms.push(SliceTerm {
                height: term.half_log_peak - 0.25 * near * near,
                centre,
                deviation: deviation.hypot(shift),
                coefficients,
            });
        }
    }
}

impl Term<3> {
    /// The first two whitened coordinates of a place, and centre and deviation of the Gaussian along the third there.
    fn at_place(&self, place: &Vector2<f64>) -> (Vector2<f64>, f64, f64) {
        let (w, mean) = (&self.inverse, self.gaussian.mean());
        let d = place - mean.xy();
        let deviation = w[(2, 2)].recip();
        let u = self.inverse * Vector3::new(d.x, d.y, 0.0);
        (u.xy(), mean.z - u.z * deviation, deviation)
    }
}

impl Slice {
    /// Moments over `low <= t <= high` of the slice times `exp(-(energy - 2 correlation t + response t^2) / 2)`, to about eight
    /// digits: Gauss-Legendre panels over where each term's product with the likelihood has its mass.
    ///
    /// The logarithm of the mass is `-inf` where there is none.
    pub fn tilted(&self, [response, correlation, energy]: [f64; 3], [low, high]: [f64; 2]) -> SliceMoments {
        let likelihood = |t: f64| -0.5 * (energy - t * (2.0 * correlation - t * response));
        let mut stretches: Vec<Stretch> = Vec::with_capacity(self.terms.len());
        let mut peak = f64::NEG_INFINITY;
        for term in &self.terms {
            let precision = 1.0 / (term.deviation * term.deviation) + response;
            let centre = term.centre + (correlation - response * term.centre) / precision;
            let inside = centre.clamp(low, high);
            let off = (inside - term.centre) / term.deviation;
            let height = 2.0 * term.height - 0.5 * off * off + likelihood(inside);
            if height.is_finite() {
                peak = peak.max(height);
                stretches.push(Stretch::around(centre, precision, height, [low, high]));
            }
        }
        let none = SliceMoments {
            log_mass: f64::NEG_INFINITY,
            mean: 0.5 * (low + high),
            variance: 0.0,
        };
        stretches.retain(|s| s.height > peak - FAINT && s.from < s.to);
        stretches.sort_by(|a, b| a.from.total_cmp(&b.from));
        let origin = none.mean;
        let (mut mass, mut first, mut second) = (0.0, 0.0, 0.0);
        let mut row = [0.0; HIGHEST_DEGREE + 1];
        let mut rest = stretches.as_slice();
        while let Some((head, tail)) = rest.split_first() {
            // Stretches that overlap are integrated as one.
            let mut whole = *head;
            let mut others = tail;
            while let Some((next, further)) = others.split_first().filter(|(next, _)| next.from < whole.to) {
                whole.to = whole.to.max(next.to);
                whole.step = whole.step.min(next.step);
                others = further;
            }
            rest = others;
            let panels = (((whole.to - whole.from) / whole.step).ceil() as usize).clamp(LEAST_PANELS, MOST_PANELS);
            for (t, weight) in gauss_legendre::<8>().panels(whole.from, whole.to, panels) {
                let root = self.root(t, 0.5 * (likelihood(t) - peak), &mut row[..=self.degree]);
                let share = weight * root * root;
                let d = t - origin;
                mass += share;
                first += share * d;
                second += share * d * d;
            }
        }
        if !(mass > 0.0 && mass.is_finite()) {
            return none;
        }
        let mean = first / mass;
        SliceMoments {
            log_mass: peak + mass.ln(),
            mean: origin + mean,
            variance: (second / mass - mean * mean).max(0.0),
        }
    }

    /// `s(t) exp(log)`.
    fn root(&self, t: f64, log: f64, row: &mut [f64]) -> f64 {
        let mut sum = 0.0;
        for term in &self.terms {
            let u = (t - term.centre) / term.deviation;
            let exponent = term.height - 0.25 * u * u + log;
            if exponent < -FAINT {
                continue;
            }
            row_of_polynomials(u, row);
            let parts = row.iter().zip(&term.coefficients);
            let polynomial: f64 = if self.absolute {
                parts.map(|(h, c)| (h * c).abs()).sum()
            } else {
                parts.map(|(h, c)| h * c).sum()
            };
            sum += polynomial * exponent.exp();
        }
        sum
    }
}

/// Where one term's product with a likelihood has its mass.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    from: f64,
    to: f64,
    step: f64,
    height: f64,
}

impl Stretch {
    fn around(centre: f64, precision: f64, height: f64, [low, high]: [f64; 2]) -> Self {
        let deviation = precision.sqrt().recip();
        let reach = ENDS * deviation;
        // Beyond an end only a tail is inside, and what counts of it is short: as far as the exponent falls by `ENDS^2 / 2`.
        let (below, above) = ((low - centre).max(0.0), (centre - high).max(0.0));
        Self {
            from: low.max(centre - above.hypot(reach)),
            to: high.min(centre + below.hypot(reach)),
            step: PANEL * deviation,
            height,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::density::{CellOptions, CellTarget};
    use fewbits_core::{Belief, Columns, Density};
    use fewbits_numerics::quadrature::Rule;
    use nalgebra::Matrix3;

    fn gaussians() -> [Component<3>; 2] {
        let tilted = Matrix3::new(4.0, 1.0, 0.3, 1.0, 2.0, -0.2, 0.3, -0.2, 0.1);
        let round = Matrix3::new(1.0, -0.3, 0.0, -0.3, 1.5, 0.05, 0.0, 0.05, 0.02);
        [
            Component::new(0.6, Vector3::new(1.0, -2.0, 1.0), tilted).unwrap(),
            Component::new(0.4, Vector3::new(4.0, 1.0, 0.8), round).unwrap(),
        ]
    }

    fn belief() -> Lpg<3> {
        let lists = [0.9, -0.3].map(|scale| (0..10).map(|i| scale * (0.7 + f64::from(i)).cos()).collect());
        Lpg::new(&gaussians(), 2, &lists).unwrap()
    }

    #[test]
    fn slices_are_integrals_of_the_density() {
        let (belief, mut slice) = (belief(), Slice::default());
        for (x, y) in [(1.0, -2.0), (3.0, 0.5), (-4.0, -6.0), (12.0, 3.0)] {
            let place = Vector2::new(x, y);
            for (sums, range) in [
                ([0.0, 0.0, 0.0], [-3.0, 4.0]),
                ([50.0, 45.0, 41.0], [0.5, 1.5]),
                ([4e4, 3.9e4, 3.81e4], [0.5, 1.5]),
                ([900.0, 200.0, 60.0], [0.5, 1.5]),
            ] {
                belief.slice(&place, 0.0, &mut slice);
                let got = slice.tilted(sums, range);
                let log = |t: f64| {
                    belief.log_density(&Vector3::new(x, y, t)) - 0.5 * (sums[2] - t * (2.0 * sums[1] - t * sums[0]))
                };
                let rule = Rule::gauss_legendre(20);
                let peak = rule
                    .panels(range[0], range[1], 500)
                    .fold(f64::NEG_INFINITY, |m, (t, _)| m.max(log(t)));
                let moment = |k: i32| rule.composite(range[0], range[1], 500, |t| t.powi(k) * (log(t) - peak).exp());
                let (mass, mean) = (moment(0), moment(1) / moment(0));
                assert!(
                    (got.log_mass - peak - mass.ln()).abs() < 1e-6,
                    "{place} {sums:?}: {got:?} {}",
                    peak + mass.ln()
                );
                assert!((got.mean - mean).abs() < 1e-6, "{got:?} {mean}");
                assert!((got.variance / (moment(2) / mass - mean * mean) - 1.0).abs() < 1e-4, "{got:?}");
                belief.slice(&(place + Vector2::new(0.2, -0.2)), 0.2, &mut slice);
                // Half a nat is what a widened Gaussian may lack of a moved one.
                assert!(slice.tilted(sums, range).log_mass > got.log_mass - 0.51, "{place} {sums:?}");
            }
        }
        belief.slice(&Vector2::new(1e200, 0.0), 0.0, &mut slice);
        assert_eq!(slice.tilted([1.0, 1.0, 1.0], [0.5, 1.5]).log_mass, f64::NEG_INFINITY);
    }

    /// `exp(-(energy - 2 correlation t + response t^2)/2)` of a measurement `t = place` of the given precision.
    fn measured(place: f64, precision: f64) -> [f64; 3] {
        [precision, precision * place, precision * place * place]
    }

    /// One Gaussian without a polynomial, where everything has a closed form: also a hundred deviations off, where only what is
    /// scaled by the right peak is a number, and in a range a million times as wide as the mass.
    #[test]
    fn of_a_gaussian_slices_are_conditionals() {
        let gaussian = gaussians()[0];
        let (m, s) = (*gaussian.mean(), *gaussian.covariance());
        let (plane, cross) = (s.fixed_view::<2, 2>(0, 0).into_owned(), s.fixed_view::<2, 1>(0, 2).into_owned());
        let precision = plane.try_inverse().unwrap();
        let gain = precision * cross;
        let own = s[(2, 2)] - gain.dot(&cross);
        let belief = Lpg::new(&[gaussian], 0, &[vec![-1.7]]).unwrap();
        let mut slice = Slice::default();
        let log_normal = |square: f64, variance: f64| -0.5 * (square + (std::f64::consts::TAU * variance).ln());
        for (x, y) in [(1.0, -2.0), (2.9, -0.3), (-3.0, 1.0)] {
            let place = Vector2::new(x, y);
            let d = place - m.xy();
            let (square, centre) = (d.dot(&(precision * d)), m.z + gain.dot(&d));
            let log_marginal = log_normal(square, std::f64::consts::TAU * plane.determinant());
            belief.slice(&place, 0.0, &mut slice);
            let reach = 100.0 * own.sqrt();
            for (at, accuracy, range) in [
                (centre + 0.3, 7.0, [-1e5, 1e5]),
                (centre - reach, 1e4, [-200.0, 200.0]),
                (centre + reach, 1e4, [-200.0, 200.0]),
                (centre + 30.0 * reach, 0.9, [-1e6, 1e6]),
            ] {
                let got = slice.tilted(measured(at, accuracy), range);
                let variance = 1.0 / (accuracy + 1.0 / own);
                let mean = variance * (accuracy * at + centre / own);
                let gap = at - centre;
                let log_mass =
                    log_marginal - 0.5 * (1.0 + own * accuracy).ln() - 0.5 * gap * gap / (own + 1.0 / accuracy);
                assert!((got.log_mass - log_mass).abs() < 1e-7 * log_mass.abs().max(1.0), "{got:?} {log_mass}");
                assert!((got.mean - mean).abs() < 1e-7 * mean.abs().max(1.0), "{got:?} {mean}");
                assert!((got.variance / variance - 1.0).abs() < 1e-6, "{got:?} {variance}");
            }
            // Only a tail is inside: `E(-t)` of an exponential beyond an end far from the centre.
            for (side, range) in [
                (1.0, [centre + 0.4 * reach, centre + reach]),
                (-1.0, [centre - reach, centre - 0.4 * reach]),
            ] {
                let got = slice.tilted([0.0; 3], range);
                let log = |t: f64| log_marginal + log_normal((t - centre) * (t - centre) / own, own);
                let end = centre + side * 0.4 * reach;
                // Mills' ratio at 40 deviations, to its third term.
                let mills = own.sqrt() / 40.0 * (1.0 - 1.0 / 1600.0 + 3.0 / 2.56e6);
                assert!((got.log_mass - log(end) - mills.ln()).abs() < 1e-7, "{got:?}");
                assert!((got.mean - end - side * own.sqrt() / 40.0 * (1.0 - 2.0 / 1600.0)).abs() < 1e-6, "{got:?}");
            }
            // Cells: the centre may move along the third coordinate, and the plane's part is the most within the cell, about.
            for half in [1e-3, 0.05, 0.4] {
                belief.slice(&place, half, &mut slice);
                let got = slice.tilted([0.0; 3], [-60.0, 60.0]);
                let shift = half * (gain.x.abs() + gain.y.abs());
                assert!((got.variance / (own + shift * shift) - 1.0).abs() < 1e-7, "{got:?}");
                let widened = 0.5 * ((own + shift * shift) / own).ln();
                let most = |reach: f64| {
                    let grid =
                        (-10..=10).flat_map(|i| (-10..=10).map(move |j| Vector2::new(f64::from(i), f64::from(j))));
                    let squares = grid.map(|g| d + g * (0.1 * reach)).map(|d| d.dot(&(precision * d)));
                    log_normal(squares.fold(f64::INFINITY, f64::min), std::f64::consts::TAU * plane.determinant())
                };
                let log = got.log_mass - widened;
                assert!(
                    log > most(half) - 1e-7 && log < most(3.0 * half).max(log_marginal + 1e-7) + 3.0 * half,
                    "{half}"
                );
            }
        }
    }

    /// Steep along the diagonal of the cell, in any unit.
    #[test]
    fn slices_of_cells_bound_ridges_in_every_unit() {
        for unit in [1e-3, 1.0, 1e3] {
            let scale = Matrix3::from_diagonal(&Vector3::new(unit, unit, 1.0));
            let ridge = scale * Matrix3::new(1.0, -0.98, 0.0, -0.98, 1.0, 0.0, 0.0, 0.0, 0.5) * scale;
            let ridge = Component::new(1.0, Vector3::zeros(), ridge).unwrap();
            let belief = Lpg::new(&[ridge], 0, &[vec![1.0]]).unwrap();
            let (mut slice, place) = (Slice::default(), |x: f64| Vector2::new(x, x) * unit);
            let mut mass = |x: f64, half: f64| {
                belief.slice(&place(x), half * unit, &mut slice);
                slice.tilted([0.0; 3], [-9.0, 9.0]).log_mass
            };
            let (bound, corner, beyond) = (mass(1.0, 0.2), mass(0.8, 0.0), mass(0.6, 0.0));
            assert!(bound >= corner - 1e-9 && bound < beyond, "{unit}: {corner} {bound} {beyond}");
        }
    }

    /// Absolute polynomials, as the bound of the whole has them at the same places; a coarse cell takes them for one at least.
    #[test]
    fn slices_of_cells_bound_as_the_whole_does() {
        let (belief, mut slice, mut scratch) = (belief(), Slice::default(), Vec::new());
        let rule = Rule::gauss_legendre(20);
        for (x, y) in [(1.0, -2.0), (3.0, 0.5), (-2.0, -3.0)] {
            belief.slice(&Vector2::new(x, y), 1e-13, &mut slice);
            let got = slice.tilted([0.0; 3], [-3.0, 4.0]);
            let mut bound = |t: f64| {
                belief
                    .log_density_and_bound(&Vector3::new(x, y, t), 1e-13, &mut scratch)
                    .1
                    .exp()
            };
            let mass: f64 = rule.panels(-3.0, 4.0, 500).map(|(t, w)| w * bound(t)).sum();
            // Absolute values have kinks.
            assert!((got.log_mass - mass.ln()).abs() < 0.01, "{got:?} {}", mass.ln());
        }
        let gaussian = gaussians()[1];
        let odd = Lpg::new(&[gaussian], 1, &[vec![0.0, -1.7, 0.0, 0.0]]).unwrap();
        let peak = -0.5 * (std::f64::consts::TAU.powi(2) * (1.5 - 0.09)).ln();
        odd.slice(&gaussian.mean().xy(), 1.0, &mut slice);
        let coarse = slice.tilted([0.0; 3], [-3.0, 4.0]).log_mass;
        let shift: f64 = 0.05 / 1.41 * (0.3 + 1.0);
        let own: f64 = 0.02 - 0.05 * 0.05 / 1.41;
        assert!((coarse - peak - 0.5 * ((own + shift * shift) / own).ln()).abs() < 1e-7, "{coarse} {peak}");
        odd.slice(&gaussian.mean().xy(), 1e-3, &mut slice);
        assert_eq!(slice.tilted([0.0; 3], [-3.0, 4.0]).log_mass, f64::NEG_INFINITY);
    }

    /// The marginal over the plane of a tilted Gaussian.
    struct Plane;

    impl CellTarget<2> for Plane {
        fn evaluate(&self, centres: &Columns<'_, 2>, _: f64, logs: &mut [f64], scores: &mut [f64]) {
            let s = gaussians()[0].covariance().fixed_view::<2, 2>(0, 0).into_owned();
            let precision = s.try_inverse().unwrap();
            for i in 0..logs.len() {
                let d = Vector2::new(centres[0][i] - 1.0, centres[1][i] + 2.0);
                logs[i] = -0.5 * d.dot(&(precision * d));
                scores[i] = logs[i];
            }
        }
    }

    #[test]
    fn a_gaussian_is_fitted_without_loss() {
        let cells = Cells::cover(&Plane, [-12.0; 2], [12.0; 2], 40, &CellOptions::default()).unwrap();
        let exact = gaussians()[0];
        let s = exact.covariance();
        let gain = s.fixed_view::<2, 2>(0, 0).try_inverse().unwrap() * s.fixed_view::<2, 1>(0, 2);
        let variance = s[(2, 2)] - gain.dot(&s.fixed_view::<2, 1>(0, 2));
        let [x, y] = cells.columns();
        let means: Vec<f64> = x
            .iter()
            .zip(y)
            .map(|(x, y)| 1.0 + gain.dot(&Vector2::new(x - 1.0, y + 2.0)))
            .collect();
        let variances = vec![variance; means.len()];
        // About another Gaussian, so that the polynomials have something to do.
        let other = Component::new(1.0, exact.mean().add_scalar(0.05), s * 1.3).unwrap();
        let fit = Lpg::fit_lifted(&cells, &means, &variances, &[other], 6).unwrap();
        assert!(fit.affinity > 1.0 - 1e-4, "{}", fit.affinity);
        assert!((fit.belief.mean() - exact.mean()).amax() < 1e-2, "{}", fit.belief.mean());
        assert!((fit.belief.covariance() - s).amax() < 0.02 * s.amax(), "{}", fit.belief.covariance());
        assert!(Lpg::fit_lifted(&cells, &means[1..], &variances, &[other], 6).is_err());
        assert!(Lpg::fit_lifted(&cells, &means, &variances, &[other, other], 2).is_err());
        assert!(Lpg::fit_lifted(&cells, &means, &variances, &[other], 21).is_err());
    }
}
