//! Resampling: replaces weighted particles by equally weighted ones.

use crate::Error;
use fewbits_densities::{Particles, systematic_into};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::kernels::{sum, vectorised};
use rand::{Rng, RngExt};
use rand_distr::Open01;
use serde::{Deserialize, Serialize};

/// A method that draws `M` ancestors from `N` weighted particles; `M` may differ from `N`.
///
/// In every method the expected number of copies of particle `i` is `M w_i`, a particle of weight zero is never chosen, and the
/// ancestors are in increasing order, so that copying reads memory in order. The methods differ in the variance they add
/// (Douc, Cappe and Moulines 2005): multinomial resampling adds the most; stratified and residual resampling add at most as much.
///
/// | method | uniform numbers drawn | copies of particle `i` |
/// |---|---|---|
/// | systematic | 1 | `floor(M w_i)` or `ceil(M w_i)` |
/// | stratified | `M` | within 1 of `M w_i` at both ends of its interval |
/// | residual | `M - sum floor(M w_i)` | at least `floor(M w_i)` |
/// | multinomial | `M` | binomial |
///
/// ```text
/// cumulative = running sum of the weights
/// for each point u_1 <= u_2 <= ... <= u_M of the method, as fractions of the total weight:
///     ancestor = first i with u < cumulative_i
/// systematic:  u_m = (m - 1 + U) / M, one U          stratified: u_m = (m - 1 + U_m) / M
/// multinomial: order statistics of M uniforms        residual:   floor(M w_i) copies, then multinomial for the remainders
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Resampling {
    /// Evenly spaced points with one uniform offset. The default: the fastest and, in practice, the least variance.
    #[default]
    Systematic,
    /// One uniform point in each of `M` equal strata.
    Stratified,
    /// `floor(M w_i)` copies first, then multinomial draws for the fractional parts.
    Residual,
    /// Independent draws.
    Multinomial,
}

impl Resampling {
    /// Fills `ancestors` with indices into `weights`, in increasing order. The weights need not be normalised.
    ///
    /// # Errors
    /// If a weight is negative or not finite, or the weights do not sum to a positive finite number. `ancestors` is then
    /// unchanged.
    pub fn ancestors<R: Rng + ?Sized>(
        self,
        rng: &mut R,
        weights: &[f64],
        ancestors: &mut [u32],
    ) -> Result<(), ArgumentError> {
        let (total, last) = check(weights)?;
        // Weights whose ratios to the total would overflow or underflow are scaled first.
        let range = 1e-290..1e290;
        if !range.contains(&total) {
            let largest = weights.iter().copied().fold(0.0, f64::max);
            let scaled: Vec<f64> = weights.iter().map(|w| w / largest).collect();
            return self.ancestors(rng, &scaled, ancestors);
        }
        self.ancestors_unchecked(rng, weights, total, last, ancestors);
        Ok(())
    }

    /// As [`ancestors`](Self::ancestors), for the weights of [`Particles`], which are checked and normalised
    /// already.
    fn ancestors_of_normalised<R: Rng + ?Sized>(self, rng: &mut R, weights: &[f64], ancestors: &mut [u32]) {
        if let Some(last) = weights.iter().rposition(|w| *w > 0.0) {
            self.ancestors_unchecked(rng, weights, sum(weights), last, ancestors);
        }
    }

    /// As [`ancestors`](Self::ancestors), for non-negative weights with the sum `total`, the last positive one at index `last`.
    fn ancestors_unchecked<R: Rng + ?Sized>(
        self,
        rng: &mut R,
        weights: &[f64],
        total: f64,
        last: usize,
        ancestors: &mut [u32],
    ) {
        let count = ancestors.len();
        let step = total / count as f64;
        match self {
            Self::Systematic => {
                let uniform: f64 = rng.sample(Open01);
                systematic_into(&weights[..=last], total, 1.0 - uniform, ancestors);
            }
            Self::Stratified => pick(weights, last, ancestors, |m| (m as f64 + rng.random::<f64>()) * step),
            Self::Multinomial => {
                let mut points = OrderedUniforms::new(count);
                pick(weights, last, ancestors, |_| points.next(rng) * total);
            }
            Self::Residual => residual(rng, weights, step, last, ancestors),
        }
    }
}

/// Sum of the weights and the index of the last positive one.
fn check(weights: &[f64]) -> Result<(f64, usize), ArgumentError> {
    let is_weight = |w: &f64| *w >= 0.0 && *w < f64::INFINITY;
    // One more in the exponent carries into the sign unless the number is finite. Without an early exit this runs in vector registers.
    let signs = vectorised(
        #[inline(always)]
        || {
            weights
                .iter()
                .fold(0, |all, w| all | w.to_bits() | w.to_bits().wrapping_add(1 << 52))
        },
    );
    // A sign may also be that of a zero.
    if signs >> 63 == 1
        && let Some(bad) = weights.iter().find(|w| !is_weight(w))
    {
        return Err(ArgumentError::new("weights", bad, "finite weights, 0 or above"));
    }
    let total = sum(weights);
    match weights.iter().rposition(|w| *w > 0.0) {
        Some(last) if total.is_finite() => Ok((total, last)),
        _ => Err(ArgumentError::new("weights", format!("a vector summing to {total}"), "a positive finite sum")),
    }
}

/// The law of resampling and when it is applied.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResamplingRule {
    /// The law that draws ancestors.
    pub resampling: Resampling,
    /// When to resample.
    pub schedule: Schedule,
}

impl ResamplingRule {
    /// Resamples if the schedule says so. Returns whether it did. `ancestors` is a buffer, of any length.
    ///
    /// # Errors
    /// Not in practice: the weights of [`Particles`] are always normalised.
    pub fn resample<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        belief: &mut Particles<D>,
        ancestors: &mut Vec<u32>,
    ) -> Result<bool, Error> {
        let is_due = self.draw_ancestors(rng, belief, ancestors);
        if is_due {
            belief.select(ancestors)?;
        }
        Ok(is_due)
    }

    /// Draws an ancestor of each particle if the schedule says so. Returns whether it did.
    pub(crate) fn draw_ancestors<const D: usize, R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        belief: &Particles<D>,
        ancestors: &mut Vec<u32>,
    ) -> bool {
        let is_due = self.schedule.is_due(belief.effective_sample_size(), belief.len());
        if is_due {
            ancestors.resize(belief.len(), 0);
            self.resampling
                .ancestors_of_normalised(rng, belief.weights(), ancestors);
        }
        is_due
    }
}

/// For each point of an increasing sequence the first particle whose cumulative weight exceeds it. Rounding may leave the
/// last points at or above the total; they go to the last particle of positive weight.
fn pick(weights: &[f64], last: usize, ancestors: &mut [u32], mut point: impl FnMut(usize) -> f64) {
    let mut at = 0;
    let mut cumulative = weights[0];
    for (m, ancestor) in ancestors.iter_mut().enumerate() {
        let u = point(m);
        while u >= cumulative && at < last {
            at += 1;
            cumulative += weights[at];
        }
        *ancestor = at as u32;
    }
}

/// `floor(w / step)` copies, then multinomial draws from the fractional parts, merged in one pass.
fn residual<R: Rng + ?Sized>(rng: &mut R, weights: &[f64], step: f64, last: usize, ancestors: &mut [u32]) {
    // An exact multiple of 1/M must not lose a copy to rounding.
    let whole = |w: f64| (w / step + 1e-9).floor();
    let fraction = |w: f64| (w / step - whole(w)).max(0.0);
    let copies: f64 = weights.iter().map(|w| whole(*w)).sum();
    let left = ancestors.len().saturating_sub(copies as usize);
    let rest: f64 = weights.iter().map(|w| fraction(*w)).sum();
    let last_fraction = weights.iter().rposition(|w| fraction(*w) > 0.0).unwrap_or(last);
    let mut points = OrderedUniforms::new(left);
    let mut pending = (left > 0).then(|| points.next(rng) * rest);
    let mut drawn = 0;
    let (mut filled, mut cumulative) = (0, 0.0);
    for (i, w) in weights.iter().enumerate().take(last + 1) {
        let mut count = whole(*w) as usize;
        cumulative += fraction(*w);
        while let Some(u) = pending {
            if u >= cumulative && i < last_fraction {
                break;
            }
            count += 1;
            drawn += 1;
            pending = (drawn < left).then(|| points.next(rng) * rest);
        }
        let end = (filled + count).min(ancestors.len());
        ancestors[filled..end].fill(i as u32);
        filled = end;
    }
    ancestors[filled..].fill(last as u32);
}

/// Order statistics of independent uniform numbers, smallest first, without storing them: the largest of `k` uniforms is `U^(1/k)`,
/// and the others are uniform below it.
struct OrderedUniforms {
    left: usize,
    above: f64,
}

impl OrderedUniforms {
    fn new(count: usize) -> Self {
        Self {
            left: count,
            above: 1.0,
        }
    }

    fn next<R: Rng + ?Sized>(&mut self, rng: &mut R) -> f64 {
        // 1 - U lies in (0, 1], so that the logarithm exists.
        let u = 1.0 - rng.random::<f64>();
        self.above *= (u.ln() / self.left.max(1) as f64).exp();
        self.left = self.left.saturating_sub(1);
        1.0 - self.above
    }
}

/// When to resample.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Schedule {
    /// After every update.
    #[default]
    Always,
    /// When the effective sample size falls below this fraction of the number of particles; NaN is always due.
    Below(f64),
    /// Never: sequential importance sampling.
    Never,
}

impl Schedule {
    /// Whether to resample at this effective sample size.
    #[expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must be due")]
    pub fn is_due(self, effective_sample_size: f64, particles: usize) -> bool {
        match self {
            Self::Always => true,
            // Not `<`: a threshold of NaN must not switch resampling off.
            Self::Below(fraction) => !(effective_sample_size >= fraction * particles as f64),
            Self::Never => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::pick;

    #[test]
    fn points_at_the_total_go_to_the_last_particle_with_weight() {
        let mut ancestors = [9; 5];
        let points = [0.0, 0.25, 0.5, 1.0, 1.0 + 1e-9];
        pick(&[0.25, 0.0, 0.75, 0.0, 0.0], 2, &mut ancestors, |m| points[m]);
        assert_eq!(ancestors, [0, 2, 2, 2, 2]);
    }
}
