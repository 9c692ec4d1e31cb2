//! Gauss-Legendre quadrature rules, computed once per process, and an adaptive rule.

use gauss_quad::GaussLegendre;
use std::num::NonZeroUsize;
use std::sync::OnceLock;

/// A Gauss-Legendre rule of `n` nodes on `[-1, 1]`: exact for polynomials up to degree `2 n - 1`.
#[derive(Debug, Clone, PartialEq)]
pub struct Rule {
    nodes: Vec<f64>,
    weights: Vec<f64>,
}

impl Rule {
    /// The rule with `points` nodes, in increasing order. `points = 0` is read as 1.
    pub fn gauss_legendre(points: usize) -> Self {
        let rule = GaussLegendre::new(NonZeroUsize::new(points).unwrap_or(NonZeroUsize::MIN));
        let mut pairs: Vec<(f64, f64)> = rule.iter().copied().collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self {
            nodes: pairs.iter().map(|p| p.0).collect(),
            weights: pairs.iter().map(|p| p.1).collect(),
        }
    }

    /// Nodes on `[-1, 1]`, increasing.
    pub fn nodes(&self) -> &[f64] {
        &self.nodes
    }

    /// Weights, summing to 2.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Nodes and weights for the interval `[a, b]`.
    pub fn on(&self, a: f64, b: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
        let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
        self.nodes
            .iter()
            .zip(&self.weights)
            .map(move |(x, w)| (middle + half * x, half * w))
    }

    /// Integral of `f` over `[a, b]` by this rule: `sum w f(x)`.
    #[inline]
    pub fn sum(&self, a: f64, b: f64, f: impl Fn(f64) -> f64) -> f64 {
        self.on(a, b).map(|(x, w)| w * f(x)).sum()
    }

    /// Integral of `f` over `[a, b]`, split into `panels` equal parts with this rule on each.
    pub fn composite(&self, a: f64, b: f64, panels: usize, f: impl Fn(f64) -> f64) -> f64 {
        self.panels(a, b, panels).map(|(x, w)| w * f(x)).sum()
    }

    /// Nodes and weights of this rule on each of `panels` equal parts of `[a, b]`, in increasing order.
    pub fn panels(&self, a: f64, b: f64, panels: usize) -> impl Iterator<Item = (f64, f64)> + '_ {
        let width = (b - a) / panels.max(1) as f64;
        (0..panels.max(1)).flat_map(move |i| {
            let left = a + i as f64 * width;
            self.on(left, left + width)
        })
    }
}

/// The largest rule that is kept for the life of the process.
const CACHED: usize = 128;

/// The `N`-point Gauss-Legendre rule, computed at first use and kept. `N` is at most 128.
pub fn gauss_legendre<const N: usize>() -> &'static Rule {
    const { assert!(N >= 1 && N <= CACHED) };
    static RULES: [OnceLock<Rule>; CACHED + 1] = [const { OnceLock::new() }; CACHED + 1];
    RULES[N].get_or_init(|| Rule::gauss_legendre(N))
}

/// When [`by_halves`] stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// A panel is kept if its sum and the sum of its halves differ by at most this.
    pub tolerance: f64,
    /// Largest number of times that a panel is halved.
    pub halvings: u32,
}

/// Integrates over `[a, b]` by a rule `sum(from, to)`, in panels that are halved until the sum over a panel agrees with the sums over its
/// halves; `whole` is `sum(a, b)`. `kept` is called with each half that was kept, from left to right. A panel whose sum is NaN is not
/// halved.
///
/// The difference is far above the error of the two halves, which are kept.
///
/// ```
/// use fewbits_numerics::quadrature::{Stop, by_halves, gauss_legendre};
/// let sum = |a: f64, b: f64| gauss_legendre::<8>().sum(a, b, f64::sqrt);
/// let stop = Stop { tolerance: 1e-12, halvings: 40 };
/// let integral = by_halves([0.0, 1.0], sum(0.0, 1.0), stop, &sum, &mut |_, _| {});
/// assert!((integral - 2.0 / 3.0).abs() < 1e-12);
/// ```
pub fn by_halves(
    [a, b]: [f64; 2],
    whole: f64,
    stop: Stop,
    sum: &impl Fn(f64, f64) -> f64,
    kept: &mut impl FnMut(f64, f64),
) -> f64 {
    let middle = 0.5 * (a + b);
    let (left, right) = (sum(a, middle), sum(middle, b));
    let apart = (left + right - whole).abs();
    let Some(halvings) = stop.halvings.checked_sub(1).filter(|_| apart > stop.tolerance) else {
        kept(a, middle);
        kept(middle, b);
        return left + right;
    };
    let stop = Stop { halvings, ..stop };
    by_halves([a, middle], left, stop, sum, kept) + by_halves([middle, b], right, stop, sum, kept)
}
