//! Mass and moments of independent normal variables in a ball, one dimension at a time.

use fewbits_numerics::quadrature::gauss_legendre;
use fewbits_numerics::{kernels, normal};
use nalgebra::{SMatrix, SVector};
use std::f64::consts::FRAC_PI_2;
use std::sync::OnceLock;

/// A variance below this share of the ball's squared radius is a known number.
pub(super) const KNOWN: f64 = 1e-16;
/// Means up to this many deviations need 24 nodes, up to the next 40; beyond them the quadrature is adaptive ...
const NEAR: f64 = 4.0;
const FAR: f64 = 8.0;
/// ... and so it is for radii beyond this many deviations.
const RADIUS: f64 = 5.0;
/// Fall of the log integrand at which the bulk ends.
const FALL: f64 = 40.0;
/// Panels are halved until two rules agree to this share of the whole, or to what rounding leaves of a far tail ...
const TOLERANCE: f64 = 1e-10;
/// ... per unit of the logarithm of the integrand, or this often.
const ROUNDING: f64 = 4e-15;
const HALVINGS: u32 = 40;

/// Nodes of a panel.
pub(super) fn panel(a: f64, b: f64) -> impl Iterator<Item = (f64, f64)> {
    gauss_legendre::<24>().on(a, b)
}

/// Whether all means and the radius are within so many deviations.
fn tame(variances: &[f64], means: &[f64], eta: f64, reach: f64) -> bool {
    let tame = |(w, b): (&f64, &f64)| b * b <= reach * reach * w && eta <= RADIUS * RADIUS * w;
    variances.iter().zip(means).all(tame)
}

/// Visits nodes and weights of a quadrature over `theta` in `[-pi/2, pi/2]` that integrates `exp(f)`, a function with one mode,
/// for independent components `q_j ~ N(b_j, w_j)` in a ball of squared radius `eta`.
fn integrate(variances: &[f64], means: &[f64], eta: f64, f: impl Fn(f64) -> f64, mut visit: impl FnMut(f64, f64)) {
    let mut node = |(theta, w): (f64, f64)| visit(theta, w);
    if tame(variances, means, eta, NEAR) {
        return panel(-FRAC_PI_2, FRAC_PI_2).for_each(node);
    }
    if tame(variances, means, eta, FAR) {
        return gauss_legendre::<40>().on(-FRAC_PI_2, FRAC_PI_2).for_each(node);
    }
    let (cuts, peak) = bulk(&f);
    let mass = |a: f64, b: f64| panel(a, b).map(|(theta, w)| w * (f(theta) - peak).exp()).sum::<f64>();
    let tolerance = TOLERANCE.max(ROUNDING * peak.abs());
    let whole = mass(cuts[0], cuts[1]) + mass(cuts[1], cuts[2]);
    // Halving a panel that is no number would never end.
    if !whole.is_finite() {
        return;
    }
    // Depth first, left to right: at most one waiting panel for each halving.
    let mut waiting = [(0.0, 0.0, 0.0, 0_u32); HALVINGS as usize + 4];
    waiting[0] = (cuts[1], cuts[2], mass(cuts[1], cuts[2]), 0);
    waiting[1] = (cuts[0], cuts[1], mass(cuts[0], cuts[1]), 0);
    let mut count = 2;
    while count > 0 {
        count -= 1;
        let (a, b, coarse, depth) = waiting[count];
        let middle = 0.5 * (a + b);
        let (left, right) = (mass(a, middle), mass(middle, b));
        if (left + right - coarse).abs() <= tolerance * whole || depth == HALVINGS {
            panel(a, middle).chain(panel(middle, b)).for_each(&mut node);
        } else {
            waiting[count] = (middle, b, right, depth + 1);
            waiting[count + 1] = (a, middle, left, depth + 1);
            count += 2;
        }
    }
}

/// Where a function of `theta` with one mode has its bulk, with the mode in the middle, and its value there.
fn bulk(f: impl Fn(f64) -> f64) -> ([f64; 3], f64) {
    const RATIO: f64 = 0.618_033_988_749_894_8;
    let (mut low, mut high) = (-FRAC_PI_2, FRAC_PI_2);
    let (mut left, mut right) = (high - RATIO * (high - low), low + RATIO * (high - low));
    let (mut at_left, mut at_right) = (f(left), f(right));
    for _ in 0..60 {
        if at_left < at_right {
            low = left;
            (left, at_left) = (right, at_right);
            right = low + RATIO * (high - low);
            at_right = f(right);
        } else {
            high = right;
            (right, at_right) = (left, at_left);
            left = high - RATIO * (high - low);
            at_left = f(left);
        }
    }
    let mode = 0.5 * (low + high);
    let peak = at_left.max(at_right);
    let end = |outer: f64| {
        let (mut inside, mut outside) = (mode, outer);
        for _ in 0..30 {
            let middle = 0.5 * (inside + outside);
            if f(middle) > peak - FALL {
                inside = middle
            } else {
                outside = middle
            }
        }
        outside
    };
    ([end(-FRAC_PI_2), mode, end(FRAC_PI_2)], peak)
}

/// The leading component along its axis, `q_1 = sqrt(eta) sin(theta)`: its value, the squared radius that is left, and the
/// logarithm of its density times `dq_1/dtheta`.
pub(super) fn leading(variance: f64, mean: f64, eta: f64) -> impl Fn(f64) -> (f64, f64, f64) {
    let (radius, deviation) = (eta.sqrt(), variance.sqrt());
    let log_scale = (radius / deviation).ln();
    move |theta: f64| {
        let (sine, cosine) = theta.sin_cos();
        let q = radius * sine;
        (q, eta * cosine * cosine, normal::log_pdf((q - mean) / deviation) + cosine.ln() + log_scale)
    }
}

/// `ln P(|q|^2 < eta)` for independent `q_j ~ N(means_j, variances_j)`, the variances in decreasing order.
pub(super) fn log_mass(variances: &[f64], means: &[f64], eta: f64) -> f64 {
    if eta <= 0.0 {
        return f64::NEG_INFINITY;
    }
    let (Some((w, inner_variances)), Some((b, inner_means))) = (variances.split_first(), means.split_first()) else {
        return 0.0;
    };
    if let (Some((last_w, rest_w)), Some((last_b, rest_b))) = (variances.split_last(), means.split_last())
        && *last_w <= KNOWN * eta
    {
        return log_mass(rest_w, rest_b, eta - last_b * last_b);
    }
    if inner_variances.is_empty() {
        let (radius, deviation) = (eta.sqrt(), w.sqrt());
        return normal::log_interval((-radius - b) / deviation, (radius - b) / deviation);
    }
    if let ([inner_w], [inner_b]) = (inner_variances, inner_means)
        && tame(variances, means, eta, NEAR)
    {
        return tame_plane([*w, *inner_w], [*b, *inner_b], eta);
    }
    let leading = leading(*w, *b, eta);
    let integrand = |theta: f64| {
        let (_, left, log_density) = leading(theta);
        log_density + log_mass(inner_variances, inner_means, left)
    };
    let mut sum = LogSum::default();
    integrate(variances, means, eta, integrand, |theta, weight| {
        sum.add(integrand(theta) + weight.ln());
    });
    sum.value()
}

/// [`log_mass`] in two dimensions on 24 nodes: all chords at once, in vector registers.
fn tame_plane(variances: [f64; 2], means: [f64; 2], eta: f64) -> f64 {
    /// Sines and cosines of the nodes, and the logarithms of weights times cosines.
    static NODES: OnceLock<[[f64; 24]; 3]> = OnceLock::new();
    let [sines, cosines, log_weights] = NODES.get_or_init(|| {
        let mut nodes = [[0.0; 24]; 3];
        for (i, (theta, w)) in panel(-FRAC_PI_2, FRAC_PI_2).enumerate() {
            (nodes[0][i], nodes[1][i]) = theta.sin_cos();
            nodes[2][i] = (w * nodes[1][i]).ln();
        }
        nodes
    });
    let (radius, deviations) = (eta.sqrt(), variances.map(f64::sqrt));
    let (mut lower, mut upper, mut logs) = ([0.0; 24], [0.0; 24], [0.0; 24]);
    for i in 0..24 {
        let along = (radius * sines[i] - means[0]) / deviations[0];
        logs[i] = log_weights[i] - 0.5 * along * along;
        lower[i] = (-radius * cosines[i] - means[1]) / deviations[1];
        upper[i] = (radius * cosines[i] - means[1]) / deviations[1];
    }
    kernels::log_interval(&mut lower, &upper);
    logs.iter_mut().zip(lower).for_each(|(log, inside)| *log += inside);
    kernels::log_sum_exp(&logs) + (radius / deviations[0]).ln() - normal::LN_SQRT_2PI
}

/// `ln sum exp` of terms that arrive one after the other.
#[derive(Default)]
pub(super) struct LogSum {
    /// Largest term and the sum of all relative to it.
    terms: Option<(f64, f64)>,
}

impl LogSum {
    /// Adds `exp(term)` and returns its share of the sum so far.
    pub(super) fn add(&mut self, term: f64) -> f64 {
        if term == f64::NEG_INFINITY {
            return 0.0;
        }
        let (largest, sum) = match self.terms {
            None => (term, 1.0),
            Some((largest, sum)) if term <= largest => (largest, sum + (term - largest).exp()),
            Some((largest, sum)) => (term, sum * (largest - term).exp() + 1.0),
        };
        self.terms = Some((largest, sum));
        (term - largest).exp() / sum
    }

    pub(super) fn value(&self) -> f64 {
        self.terms
            .map_or(f64::NEG_INFINITY, |(largest, sum)| largest + sum.ln())
    }
}

/// Mass, mean and covariance, in the coordinates from `first` on; zero in those before.
pub(super) struct Moments<const M: usize> {
    pub(super) log_mass: f64,
    pub(super) mean: SVector<f64, M>,
    pub(super) covariance: SMatrix<f64, M, M>,
}

impl<const M: usize> Moments<M> {
    pub(super) fn with_mass(log_mass: f64) -> Self {
        Self {
            log_mass,
            mean: SVector::zeros(),
            covariance: SMatrix::zeros(),
        }
    }
}

/// As [`log_mass`], with the moments.
pub(super) fn moments<const M: usize>(
    variances: &[f64],
    means: &SVector<f64, M>,
    first: usize,
    eta: f64,
) -> Moments<M> {
    let tail = &means.as_slice()[first..first + variances.len()];
    let (Some((w, inner)), Some(b)) = (variances.split_first(), tail.first()) else {
        return Moments::with_mass(if eta > 0.0 { 0.0 } else { f64::NEG_INFINITY });
    };
    if eta <= 0.0 {
        return Moments::with_mass(f64::NEG_INFINITY);
    }
    if let (Some((last_w, rest)), Some(last_b)) = (variances.split_last(), tail.last())
        && *last_w <= KNOWN * eta
    {
        let mut known = moments(rest, means, first, eta - last_b * last_b);
        known.mean[first + rest.len()] = *last_b;
        return known;
    }
    if inner.is_empty() {
        let (radius, deviation) = (eta.sqrt(), w.sqrt());
        let (low, high) = ((-radius - b) / deviation, (radius - b) / deviation);
        let Ok(cut) = normal::truncated_moments(low, high) else {
            return Moments::with_mass(f64::NEG_INFINITY);
        };
        let mut interval = Moments::with_mass(cut.log_probability);
        interval.mean[first] = b + deviation * cut.mean;
        interval.covariance[(first, first)] = w * cut.variance;
        return interval;
    }
    let leading = leading(*w, *b, eta);
    let integrand = |theta: f64| {
        let (_, left, log_density) = leading(theta);
        log_density + log_mass(inner, &tail[1..], left)
    };
    let mut sum = LogSum::default();
    let mut total = Moments::with_mass(0.0);
    integrate(variances, tail, eta, integrand, |theta, weight| {
        let (q, left, log_density) = leading(theta);
        let mut slice: Moments<M> = moments(inner, means, first + 1, left);
        let share = sum.add(slice.log_mass + log_density + weight.ln());
        if share > 0.0 {
            slice.mean[first] = q;
            // The mixture of what was there and the slice, free of the cancellation of raw moments.
            let step = slice.mean - total.mean;
            total.mean += step * share;
            total.covariance =
                (total.covariance + step * step.transpose() * share) * (1.0 - share) + slice.covariance * share;
        }
    });
    total.log_mass = sum.value();
    total
}

#[cfg(test)]
mod tests {
    use super::LogSum;

    /// Terms whose exponentials are no numbers, in either order.
    #[test]
    fn logarithms_are_summed_whatever_their_size() {
        for terms in [
            [1000.0, 999.0, -1000.0],
            [-1000.0, 999.0, 1000.0],
            [999.0, 1000.0, f64::NEG_INFINITY],
        ] {
            let mut sum = LogSum::default();
            let shares = terms.map(|term| sum.add(term));
            assert!((sum.value() - 1000.0 - (-1.0_f64).exp().ln_1p()).abs() < 1e-12);
            let last = if terms[2] == 1000.0 {
                1.0 / (1.0 + (-1.0_f64).exp())
            } else {
                0.0
            };
            assert!((shares[2] - last).abs() < 1e-12 && shares[0] == 1.0);
        }
        assert_eq!(LogSum::default().value(), f64::NEG_INFINITY);
    }
}
