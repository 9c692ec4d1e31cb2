//! Adaptive quantization: the sensors report in turn, and each is told the earlier bits.

use super::even_nodes;
use fewbits_binary_patterns::Error;
use fewbits_binary_patterns::Nodes;
use fewbits_binary_patterns::Source;
use fewbits_binary_patterns::engine::{moments, squared_error};
use fewbits_numerics::error::{all_finite, at_least_one, positive, refuse};
use fewbits_numerics::golden::maximum;
use fewbits_numerics::newton;
use fewbits_numerics::normal::{cdf, inverse_mills, log_cdf, log_pdf};
use fewbits_numerics::quadrature::gauss_legendre;
use fewbits_quantizer_design::outcomes::IMPOSSIBLE;

/// Largest number of sensors: the tree of bits has `2^N` leaves.
const MAX_SENSORS: usize = 20;
/// Relative accuracy of the maximum-likelihood estimate.
const MLE_STOP: f64 = 1e-14;
/// Range of the search for the threshold of least variance, in posterior standard deviations to each side of the mean.
const GREEDY_REACH: f64 = 1.5;

/// Relative width at which the search for that threshold stops.
const THRESHOLD_STOP: f64 = 1e-10;

/// Rule for the next threshold, given the bits so far. The first threshold is 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AdaptiveRule {
    /// AQ-VS, adaptive delta modulation with one bit of memory. The threshold moves by the step in the direction of the last bit.
    /// The step is multiplied by `factor` if a bit equals the one before, and divided by it otherwise.
    ///
    /// The thesis gives no values; `factor = 1.5` and `step = V/2` are usual. Smaller ones give an error smaller by a tenth.
    VariableStep {
        /// First step, in units of the source.
        step: f64,
        /// Factor by which the step grows or shrinks, above 1.
        factor: f64,
    },
    /// AQ-ML: the maximum-likelihood estimate from the bits so far, restricted to the support.
    MaximumLikelihood,
    /// The posterior mean given the bits so far.
    PosteriorMean,
    /// The threshold that minimises the expected posterior variance after the next bit.
    LeastVariance,
}

/// Exact mean squared errors of an adaptive scheme.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdaptiveErrors {
    /// Error of the maximum-likelihood estimate from all bits, restricted to the support.
    pub mle: f64,
    /// Error of the posterior mean.
    pub mmse: f64,
}

/// Exact errors of `sensors` sensors that report in turn, by expanding the tree of all bit strings.
///
/// Each node of the tree carries `p(x) P(bits|x)` at the quadrature nodes; nothing is simulated.
///
/// # Errors
/// If the noise is below `1e-4` of the source's reach, a parameter of the rule is out of range, or `sensors` is not in `1..=20`.
pub fn adaptive(
    source: &Source,
    noise_deviation: f64,
    sensors: usize,
    rule: AdaptiveRule,
) -> Result<AdaptiveErrors, Error> {
    let noise_deviation = source.resolvable(noise_deviation)?;
    at_least_one("sensors", sensors)?;
    Error::at_most("the table of outcomes", 2u128.saturating_pow(sensors as u32), 1u128 << MAX_SENSORS)?;
    let mut step = 0.0;
    if let AdaptiveRule::VariableStep { step: first, factor } = rule {
        step = positive("step", first)?;
        if !(factor.is_finite() && factor >= 1.0) {
            return refuse("factor", factor, "a finite number, 1 or above");
        }
    }
    // The tree is expanded depth first; one buffer of node weights per depth is enough.
    let nodes = even_nodes(source, 2.0 * noise_deviation, gauss_legendre::<12>());
    let mut tree = Tree {
        source,
        noise_deviation,
        rule,
        levels: vec![nodes.weights.clone(); sensors + 1],
        nodes,
        history: Vec::with_capacity(sensors),
        errors: AdaptiveErrors { mle: 0.0, mmse: 0.0 },
    };
    tree.expand(sensors, 0.0, step);
    Ok(tree.errors)
}

struct Tree<'a> {
    source: &'a Source,
    noise_deviation: f64,
    rule: AdaptiveRule,
    nodes: Nodes,
    /// `w p(x) P(bits|x)` at each depth of the current branch.
    levels: Vec<Vec<f64>>,
    history: Vec<(f64, bool)>,
    errors: AdaptiveErrors,
}

impl Tree<'_> {
    fn expand(&mut self, left: usize, threshold: f64, step: f64) {
        let depth = self.history.len();
        if left == 0 {
            let w = &self.levels[depth];
            let (mass, first) = moments(w, &self.nodes.points);
            if mass > IMPOSSIBLE {
                self.errors.mmse += squared_error(w, &self.nodes.points, first / mass);
                let mle = maximum_likelihood(&self.history, self.noise_deviation, self.source.reach());
                self.errors.mle += squared_error(w, &self.nodes.points, mle);
            }
            return;
        }
        for bit in [false, true] {
            let sign = if bit { 1.0 } else { -1.0 };
            let (above, below) = self.levels.split_at_mut(depth + 1);
            // Joint density of the unknown and the bits so far, at the nodes.
            for ((child, w), x) in below[0].iter_mut().zip(&above[depth]).zip(&self.nodes.points) {
                *child = w * cdf(sign * (x - threshold) / self.noise_deviation);
            }
            let repeated = self.history.last().is_some_and(|last| last.1 == bit);
            self.history.push((threshold, bit));
            if left == 1 {
                self.expand(0, threshold, step);
            } else {
                let (next, next_step) = self.next_threshold(threshold, sign, repeated, step);
                self.expand(left - 1, next, next_step);
            }
            self.history.pop();
        }
    }

    fn next_threshold(&self, threshold: f64, sign: f64, repeated: bool, step: f64) -> (f64, f64) {
        let reach = self.source.reach();
        let w = &self.levels[self.history.len()];
        match self.rule {
            AdaptiveRule::VariableStep { factor, .. } => {
                // Adaptive delta modulation: equal bits lengthen the step, different bits shorten it.
                let step = match (self.history.len(), repeated) {
                    (1, _) => step,
                    (_, true) => step * factor,
                    (_, false) => step / factor,
                };
                ((threshold + sign * step).clamp(-reach, reach), step)
            }
            AdaptiveRule::MaximumLikelihood => (maximum_likelihood(&self.history, self.noise_deviation, reach), step),
            AdaptiveRule::PosteriorMean => (self.posterior(w).map_or(threshold, |(mean, _)| mean), step),
            AdaptiveRule::LeastVariance => {
                let next = self.posterior(w).map_or(threshold, |(mean, variance)| {
                    let spread = GREEDY_REACH * variance.sqrt();
                    maximum(|t| self.explained(w, t), mean - spread, mean + spread, THRESHOLD_STOP).0
                });
                (next, step)
            }
        }
    }

    fn posterior(&self, w: &[f64]) -> Option<(f64, f64)> {
        let (mass, first) = moments(w, &self.nodes.points);
        (mass > IMPOSSIBLE).then(|| (first / mass, squared_error(w, &self.nodes.points, first / mass) / mass))
    }

    /// `sum_bit M1^2/M0` after a bit with threshold `t`. The threshold that maximises it minimises the expected posterior variance.
    fn explained(&self, w: &[f64], t: f64) -> f64 {
        let mut sums = [(0.0, 0.0); 2];
        for (w, x) in w.iter().zip(&self.nodes.points) {
            let u = (x - t) / self.noise_deviation;
            for (sum, p) in sums.iter_mut().zip([cdf(-u), cdf(u)]) {
                sum.0 += w * p;
                sum.1 += w * p * x;
            }
        }
        sums.iter()
            .map(|&(mass, first)| if mass > IMPOSSIBLE { first * first / mass } else { 0.0 })
            .sum()
    }
}

/// Maximum-likelihood estimate of `x` in `[-bound, bound]` from bits `Y > threshold` in normal noise.
///
/// The log likelihood is concave, so the sign of its derivative brackets the maximum and Newton's method is safe. If all bits
/// are equal, the estimate is an end of the interval.
///
/// # Errors
/// If there is no bit, a threshold is not finite, or the noise or the bound is not positive and finite.
pub fn bounded_mle(bits: &[(f64, bool)], noise_deviation: f64, bound: f64) -> Result<f64, Error> {
    at_least_one("bits", bits.len())?;
    let thresholds: Vec<f64> = bits.iter().map(|b| b.0).collect();
    all_finite("thresholds", &thresholds)?;
    Ok(maximum_likelihood(bits, positive("noise_deviation", noise_deviation)?, positive("bound", bound)?))
}

fn maximum_likelihood(bits: &[(f64, bool)], noise_deviation: f64, bound: f64) -> f64 {
    if balance(bits, noise_deviation, -bound).0 <= 0.0 {
        return -bound;
    }
    if balance(bits, noise_deviation, bound).0 >= 0.0 {
        return bound;
    }
    let falling = |x: f64| {
        let (value, slope) = balance(bits, noise_deviation, x);
        (-value, -slope)
    };
    newton::increasing(falling, -bound, bound, 0.0, MLE_STOP * bound)
}

/// Logarithm of the ratio between the score's positive part (from the 1s) and negative part (from the 0s), and its derivative. It is
/// decreasing, and zero where the score is.
///
/// The score is a difference of sums of inverse Mills ratios. Between thresholds many deviations apart all ratios
/// underflow, and only their logarithms can be compared.
fn balance(bits: &[(f64, bool)], noise_deviation: f64, x: f64) -> (f64, f64) {
    // For each side the largest log ratio, the sum relative to it, and the sum weighted with the derivative of the logarithm.
    let mut sides = [(f64::NEG_INFINITY, 0.0, 0.0); 2];
    for &(t, bit) in bits {
        let sign = if bit { 1.0 } else { -1.0 };
        let u = sign * (x - t) / noise_deviation;
        let log_cdf = log_cdf(u);
        let log_ratio = log_pdf(u) - log_cdf;
        // d/dx ln(phi/Phi)(u) = -(u + phi/Phi) du/dx.
        let derivative = -sign * (u + inverse_mills(u)) / noise_deviation;
        let side = &mut sides[usize::from(bit)];
        if log_ratio > side.0 {
            let shrink = (side.0 - log_ratio).exp();
            *side = (log_ratio, side.1 * shrink + 1.0, side.2 * shrink + derivative);
        } else {
            let share = (log_ratio - side.0).exp();
            side.1 += share;
            side.2 += share * derivative;
        }
    }
    let [zeros, ones] = sides;
    if zeros.1 == 0.0 {
        return (f64::INFINITY, -1.0);
    }
    if ones.1 == 0.0 {
        return (f64::NEG_INFINITY, -1.0);
    }
    (ones.0 + ones.1.ln() - zeros.0 - zeros.1.ln(), ones.2 / ones.1 - zeros.2 / zeros.1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn likelihood_is_largest_between_disagreeing_bits() {
        assert_relative_eq!(bounded_mle(&[(0.0, true), (0.4, false)], 0.3, 1.0).unwrap(), 0.2, epsilon = 1e-12);
        // A hundred deviations from both thresholds, where no density is left.
        let far = bounded_mle(&[(0.0, true), (0.5, true), (1.0, false)], 0.0025, 2.0).unwrap();
        assert_relative_eq!(far, 0.75, epsilon = 1e-6);
        assert_eq!(bounded_mle(&[(0.0, true), (0.5, true)], 0.3, 1.0).unwrap(), 1.0);
        assert_eq!(bounded_mle(&[(0.0, false)], 0.3, 1.0).unwrap(), -1.0);
        assert!(bounded_mle(&[(f64::NAN, false)], 0.3, 1.0).is_err());
        assert!(bounded_mle(&[], 0.3, 1.0).unwrap_err().to_string().contains("bits"));
    }

    #[test]
    fn one_bit_is_the_sign_and_feedback_helps() {
        let source = Source::uniform(1.0).unwrap();
        let noise = source.noise_deviation(10.0).unwrap();
        let alone = super::super::fixed_threshold(source, noise, 1).unwrap().mmse().unwrap();
        for rule in [
            AdaptiveRule::VariableStep { step: 0.5, factor: 1.5 },
            AdaptiveRule::MaximumLikelihood,
            AdaptiveRule::PosteriorMean,
        ] {
            let one = adaptive(&source, noise, 1, rule).unwrap();
            assert_relative_eq!(one.mmse, alone, max_relative = 1e-12);
            assert!(one.mmse <= one.mle);
        }
        let mean = adaptive(&source, noise, 5, AdaptiveRule::PosteriorMean).unwrap().mmse;
        let greedy = adaptive(&source, noise, 5, AdaptiveRule::LeastVariance).unwrap().mmse;
        assert!(mean < alone && greedy <= mean * 1.001);
    }

    #[test]
    fn parameters_are_checked() {
        let source = Source::uniform(1.0).unwrap();
        let rule = AdaptiveRule::PosteriorMean;
        assert!(adaptive(&source, 0.1, 0, rule).is_err());
        assert!(adaptive(&source, 0.1, 21, rule).is_err());
        assert!(adaptive(&source, -0.1, 3, rule).is_err());
        for (step, factor) in [(0.0, 1.5), (0.5, f64::NAN), (0.5, 0.9)] {
            assert!(adaptive(&source, 0.1, 3, AdaptiveRule::VariableStep { step, factor }).is_err());
        }
    }
}
