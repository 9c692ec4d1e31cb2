//! The Bayesian Cramer-Rao bound with the best weight function.

use crate::binary::Bank;
use crate::binary::source::Kind;

/// Intervals a noise standard deviation on the coarsest grid.
const PER_NOISE: f64 = 4.0;
/// Fewest and most intervals of the coarsest grid.
const COARSEST: std::ops::RangeInclusive<usize> = 512..=262_144;
/// Doublings of the grid.
const LEVELS: usize = 7;
/// Relative change between extrapolated values at which the doubling stops.
const TOLERANCE: f64 = 1e-11;

/// The largest van Trees bound over all weight functions, for the sensors of `bank`.
///
/// For a weight `q(x)` that vanishes where the density does not, `MSE >= E[q]^2 / E[q^2 J + q'^2]`-type bounds hold; the
/// best weight solves a linear boundary-value problem, and its mean is the bound:
///
/// ```text
/// J(x)  = sum_n P1n'(x)^2 / (P0n(x) P1n(x))
/// uniform:   -q'' + J q = 1,                                  q(-V) = q(V) = 0
/// Gaussian:  -q'' + (x / sx^2) q' + (J + 1/sx^2) q = 1,       natural ends
/// bound = E[q(X)]
/// ```
///
/// Both are `-(p q')' + p r q = p` with the density `p` as weight, solved by finite volumes (tridiagonal) on grids of
/// doubling fineness with Romberg extrapolation. Without information the bound is `Var X`; as the noise vanishes the
/// information makes walls at the thresholds and the bound tends to `Delta^2/12`.
pub fn van_trees(bank: &Bank) -> f64 {
    let source = bank.source();
    let reach = source.reach();
    let (prior, clamped) = match source.kind() {
        Kind::Uniform { .. } => (0.0, true),
        Kind::Gaussian { std } => (1.0 / (std * std), false),
    };
    let wanted = (PER_NOISE * 2.0 * reach / bank.finest_noise()).min(1e9) as usize;
    let mut intervals = wanted.clamp(*COARSEST.start(), *COARSEST.end());
    let rate = |x: f64| bank.fisher_information(x) + prior;
    let at = |i: usize, n: usize| reach * (2.0 * i as f64 - n as f64) / n as f64;
    let mut rates: Vec<f64> = (0..=intervals).map(|i| rate(at(i, intervals))).collect();
    let mut extrapolated: Vec<f64> = Vec::with_capacity(LEVELS);
    for level in 0..LEVELS {
        if level > 0 {
            // The old nodes stay; only the midpoints are new.
            intervals *= 2;
            rates = (0..=intervals)
                .map(|i| {
                    if i % 2 == 0 {
                        rates[i / 2]
                    } else {
                        rate(at(i, intervals))
                    }
                })
                .collect();
        }
        let last = extrapolated.last().copied();
        let mut value = weighted_mean(&rates, reach, clamped, |x| source.density(x.clamp(-reach, reach)));
        // One row of the Romberg table, in place.
        let mut power = 1.0;
        for entry in &mut extrapolated {
            power *= 4.0;
            let next = value + (value - *entry) / (power - 1.0);
            *entry = value;
            value = next;
        }
        extrapolated.push(value);
        if let Some(last) = last
            && level > 1
            && (value - last).abs() <= TOLERANCE * value
        {
            break;
        }
    }
    extrapolated.last().copied().unwrap_or(source.variance())
}

/// `E[q]` for `-(p q')' + p r q = p` on a uniform grid, by elimination.
fn weighted_mean(rates: &[f64], reach: f64, clamped: bool, density: impl Fn(f64) -> f64) -> f64 {
    let n = rates.len() - 1;
    let h = 2.0 * reach / n as f64;
    let x = |i: f64| -reach + i * h;
    // Flux coefficient between node i and i + 1.
    let flux = |i: usize| density(x(i as f64 + 0.5)) / h;
    let mut ratio = vec![0.0; n + 1];
    let mut value = vec![0.0; n + 1];
    let (first, last) = if clamped { (1, n - 1) } else { (0, n) };
    for i in first..=last {
        let mass = density(x(i as f64)) * if i == 0 || i == n { 0.5 * h } else { h };
        let left = if i > 0 { flux(i - 1) } else { 0.0 };
        let right = if i < n { flux(i) } else { 0.0 };
        let (above_ratio, above_value) = if i > first {
            (ratio[i - 1], value[i - 1])
        } else {
            (0.0, 0.0)
        };
        let pivot = left + right + mass * rates[i] - left * above_ratio;
        ratio[i] = right / pivot;
        value[i] = (mass + left * above_value) / pivot;
    }
    let (mut q, mut mean) = (0.0, 0.0);
    for i in (first..=last).rev() {
        q = value[i] + ratio[i] * q;
        mean += q * density(x(i as f64)) * if i == 0 || i == n { 0.5 * h } else { h };
    }
    mean
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::binary::{BinaryQuantizer, Source};
    use approx::assert_relative_eq;

    fn bank(source: Source, noise: f64) -> Bank {
        Bank::homogeneous(source, vec![BinaryQuantizer::new(vec![0.0]).unwrap()], noise).unwrap()
    }

    #[test]
    fn without_information_the_bound_is_the_variance() {
        for source in [Source::uniform(2.0).unwrap(), Source::gaussian(0.3).unwrap()] {
            let bound = van_trees(&bank(source, 1e6));
            assert_relative_eq!(bound, source.variance(), max_relative = 1e-9);
        }
    }

    #[test]
    fn without_noise_the_walls_leave_cells() {
        let bound = van_trees(&bank(Source::uniform(1.0).unwrap(), 1e-4));
        assert!(bound <= 1.0 / 12.0);
        assert_relative_eq!(bound, 1.0 / 12.0, max_relative = 2e-3);
    }

    #[test]
    fn constant_information_has_a_closed_form() {
        // -q'' + a^2 q = 1 with q(+-1) = 0 has mean (1 - tanh(a)/a) / a^2.
        let rates = vec![9.0; 4097];
        let value = weighted_mean(&rates, 1.0, true, |_| 0.5);
        let exact = (1.0 - 3f64.tanh() / 3.0) / 9.0;
        assert_relative_eq!(value, exact, max_relative = 1e-6);
    }
}
