//! Polynomial Gaussians over position and rate, together with beliefs that are cells over the position.

use super::basis::{LANES, gauss_hermite, row_of_polynomials, sums_of_polynomials};
use super::fit::{LpgFit, NEGLIGIBLE};
use super::polynomials::{MAX_DEGREE, check_degree};
use super::{Lpg, Term};
use fewbits_core::columns::state_at;
use fewbits_densities::Component;
use fewbits_diffusive::Error;
use fewbits_diffusive::density::Cells;
use fewbits_diffusive::form::SliceMoments;
use fewbits_numerics::error::refuse;
use fewbits_numerics::kernels::vectorised;
use fewbits_numerics::quadrature::gauss_legendre;
use nalgebra::{Vector2, Vector3};

/// A belief over three coordinates at a fixed place of the first two: `s(t)^2` along the third, with
/// `s(t) = sum_l exp(height_l - u_l^2 / 4) sum_k d_lk h_k(u_l)`, `u_l = (t - centre_l) / deviation_l`.
///
/// One value is reused for many places: [`Lpg::slice`] overwrites it.
#[derive(Debug, Clone, Default)]
pub struct Slice {
    terms: Vec<SliceTerm>,
    degree: usize,
    /// If set, the sums are of absolute values, which bound `|s|`.
    absolute: bool,
}

#[derive(Debug, Clone, Copy)]
struct SliceTerm {
    height: f64,
    centre: f64,
    deviation: f64,
    coefficients: [f64; MAX_DEGREE + 1],
}

/// Half width, in standard deviations, beyond which a Gaussian times a polynomial is negligible.
const ENDS: f64 = 8.5;
/// Largest width of a quadrature panel, in standard deviations; also the smallest number of panels of an interval.
const PANEL: f64 = 2.5;
const MIN_PANELS: usize = 6;
const MAX_PANELS: usize = 200;
/// Terms this many nats below the largest are omitted.
const FAINT: f64 = 60.0;

impl Lpg<3> {
    /// The best approximation of a belief that has cells over the first two coordinates and, in each cell, a normal density of the third
    /// with the given mean and variance. As [`Lpg::fit`]; the third coordinate is integrated in closed form.
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
        if means.len() != cells.len() || variances.len() != cells.len() {
            return refuse("means", means.len(), format!("{}, one for each cell", cells.len()));
        }
        check_degree(degree)?;
        // The rule is exact for polynomials of this degree.
        let rule = gauss_hermite(degree / 2 + 1);
        let columns = cells.columns();
        let (mut first, mut second, mut third, mut row) =
            (vec![0.0; degree + 1], vec![0.0; degree + 1], vec![0.0; degree + 1], vec![0.0; degree + 1]);
        Self::galerkin(gaussians, degree, cells.weights(), |belief, term, i, weight, out| {
            let (mean, variance) = (means[i], variances[i]);
            if variance.is_nan() || variance <= 0.0 {
                // A normal of variance zero does not overlap the series.
                return false;
            }
            let (u, centre, deviation) = term.at_place(&state_at(&columns, i));
            // The product of the two roots along the third coordinate: a Gaussian of variance 2 / precision.
            let precision = 1.0 / variance + 1.0 / (deviation * deviation);
            let gap = mean - centre;
            let log = term.half_log_peak
                - 0.25 * (u.norm_squared() + gap * gap / (variance + deviation * deviation))
                - 0.25 * (std::f64::consts::TAU * variance).ln()
                + 0.5 * (2.0 * std::f64::consts::TAU / precision).ln();
            if log < NEGLIGIBLE {
                return false;
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
            for (value, [i, j, k]) in out.iter_mut().zip(&belief.indices) {
                *value = factor * first[*i] * second[*j] * third[*k];
            }
            true
        })
    }

    /// Writes the belief along the third coordinate, at a place of the other two, to `slice`. If `half_width` is positive, it writes an
    /// approximate upper bound within that distance of the place: Gaussians widened by the cell, absolute values of the polynomials.
    pub fn slice(&self, place: &Vector2<f64>, half_width: f64, slice: &mut Slice) {
        let degree = self.degree;
        slice.terms.clear();
        (slice.degree, slice.absolute) = (degree, half_width > 0.0);
        let (mut first, mut second) = ([0.0; MAX_DEGREE + 1], [0.0; MAX_DEGREE + 1]);
        for term in &self.terms {
            let (u, centre, deviation) = term.at_place(place);
            let w = &term.gaussian.factor().whitener;
            let reach = half_width * (2.0 * w.fixed_view::<2, 2>(0, 0).norm_squared()).sqrt();
            let near = (u.norm() - reach).max(0.0);
            // How far the centre moves within the cell.
            let shift = half_width * (w[(2, 0)].abs() + w[(2, 1)].abs()) * deviation;
            row_of_polynomials(u.x, &mut first[..=degree]);
            row_of_polynomials(u.y, &mut second[..=degree]);
            let mut coefficients = [0.0; MAX_DEGREE + 1];
            for ([i, j, k], c) in self.indices.iter().zip(&term.coefficients) {
                let value = c * first[*i] * second[*j];
                coefficients[*k] += match slice.absolute {
                    false => value,
                    // For a coarse cell: near the centre the polynomials are about one.
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
        let (w, mean) = (&self.gaussian.factor().whitener, self.gaussian.mean());
        let d = place - mean.xy();
        let deviation = w[(2, 2)].recip();
        let u = self.gaussian.factor().whitener * Vector3::new(d.x, d.y, 0.0);
        (u.xy(), mean.z - u.z * deviation, deviation)
    }
}

impl Slice {
    /// Moments over `low <= t <= high` of the slice times `exp(-(energy - 2 correlation t + response t^2) / 2)`, to about eight
    /// digits, by Gauss-Legendre panels over the intervals where the product of a term and the likelihood is not negligible.
    ///
    /// The logarithm of the mass is `-inf` if the product is zero everywhere.
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
        let mut rest = stretches.as_slice();
        while let Some((head, tail)) = rest.split_first() {
            // Intervals that overlap are joined.
            let mut whole = *head;
            let mut others = tail;
            while let Some((next, further)) = others.split_first().filter(|(next, _)| next.from < whole.to) {
                whole.to = whole.to.max(next.to);
                whole.step = whole.step.min(next.step);
                others = further;
            }
            rest = others;
            let panels = (((whole.to - whole.from) / whole.step).ceil() as usize).clamp(MIN_PANELS, MAX_PANELS);
            let mut nodes = gauss_legendre::<LANES>().panels(whole.from, whole.to, panels);
            while let Some(node) = nodes.next() {
                // One panel.
                let panel: [_; LANES] = std::array::from_fn(|i| {
                    if i == 0 {
                        node
                    } else {
                        nodes.next().unwrap_or((node.0, 0.0))
                    }
                });
                let (at, logs) = (panel.map(|(t, _)| t), panel.map(|(t, _)| 0.5 * (likelihood(t) - peak)));
                let roots = vectorised(
                    #[inline(always)]
                    || self.roots(&at, &logs),
                );
                for ((t, weight), root) in panel.into_iter().zip(roots) {
                    let share = weight * root * root;
                    let d = t - origin;
                    mass += share;
                    first += share * d;
                    second += share * d * d;
                }
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
    #[inline(always)]
    fn roots(&self, t: &[f64; LANES], logs: &[f64; LANES]) -> [f64; LANES] {
        let mut sums = [0.0; LANES];
        for term in &self.terms {
            let u = t.map(|t| (t - term.centre) / term.deviation);
            let exponents: [f64; LANES] =
                std::array::from_fn(|lane| term.height - 0.25 * u[lane] * u[lane] + logs[lane]);
            if exponents.iter().all(|exponent| *exponent < -FAINT) {
                continue;
            }
            let polynomials = sums_of_polynomials(&u, &term.coefficients[..=self.degree], self.absolute);
            for lane in 0..LANES {
                if exponents[lane] >= -FAINT {
                    sums[lane] += polynomials[lane] * exponents[lane].exp();
                }
            }
        }
        sums
    }
}

/// Interval outside which the product of one term with the likelihood is negligible.
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
        // The exponent is `-(t - centre)^2 / (2 deviation^2)`. Keep the part of [low, high] where it is within `ENDS^2 / 2` of its
        // largest value there. If the centre is outside at a distance d, that value is at the nearer end, and the part ends at
        // hypot(d, ENDS deviation) from the centre.
        let (below, above) = ((low - centre).max(0.0), (centre - high).max(0.0));
        Self {
            from: low.max(centre - above.hypot(reach)),
            to: high.min(centre + below.hypot(reach)),
            step: PANEL * deviation,
            height,
        }
    }
}
