//! Manoeuvres: the acceleration of a target along one axis.

use fewbits_numerics::error::{non_negative, probabilities};
use fewbits_pf_mpa::Error;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// The acceleration of one axis: an independent Markov chain on `(0, +g, -g)`, in this order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredChain")]
pub struct AccelerationChain {
    magnitude: f64,
    initial: [f64; 3],
    transition: [[f64; 3]; 3],
}

/// The stored form of [`AccelerationChain`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredChain {
    magnitude: f64,
    initial: [f64; 3],
    transition: [[f64; 3]; 3],
}

impl TryFrom<StoredChain> for AccelerationChain {
    type Error = Error;

    fn try_from(parts: StoredChain) -> Result<Self, Error> {
        AccelerationChain::new(parts.magnitude, parts.initial, parts.transition)
    }
}

impl AccelerationChain {
    /// A chain with accelerations `0`, `+magnitude`, `-magnitude` (length per time squared). `initial` has the probabilities of the first
    /// step's acceleration. Row `i` of `transition` has the probabilities of the next acceleration after the `i`-th.
    ///
    /// # Errors
    /// If the magnitude is negative, or probabilities do not sum to one within `1e-9`.
    pub fn new(magnitude: f64, initial: [f64; 3], transition: [[f64; 3]; 3]) -> Result<Self, Error> {
        non_negative("magnitude", magnitude)?;
        probabilities("initial", &initial)?;
        for row in &transition {
            probabilities("transition", row)?;
        }
        Ok(Self {
            magnitude,
            initial,
            transition,
        })
    }

    /// The thesis's chain for accelerations of the given magnitude.
    ///
    /// # Errors
    /// If the magnitude is negative.
    pub fn printed(magnitude: f64) -> Result<Self, Error> {
        Self::new(magnitude, [0.7, 0.15, 0.15], [[0.6, 0.2, 0.2], [0.4, 0.5, 0.1], [0.4, 0.1, 0.5]])
    }

    /// Magnitude `g` of the accelerations.
    pub fn magnitude(&self) -> f64 {
        self.magnitude
    }

    /// The three accelerations `(0, +g, -g)`.
    pub fn values(&self) -> [f64; 3] {
        [0.0, self.magnitude, -self.magnitude]
    }

    /// Probabilities of the acceleration in step `k`, counted from zero: `Pr_0 Tr^k`, in `O(log k)`.
    pub fn law(&self, k: usize) -> [f64; 3] {
        // The bits of `k`, lowest first: at bit `b` the transition is `Tr^(2^b)`.
        let (mut law, mut transition, mut left) = (self.initial, self.transition, k);
        while left > 0 {
            if left & 1 == 1 {
                law = times(&law, &transition);
            }
            transition = transition.map(|row| times(&row, &transition));
            left >>= 1;
        }
        law
    }

    /// Mean and variance of the acceleration in step `k`.
    pub fn moments(&self, k: usize) -> (f64, f64) {
        let [_, up, down] = self.law(k);
        let mean = self.magnitude * (up - down);
        // A sum of non-negative terms: the variance cannot become negative.
        let rest = (1.0 - up - down).max(0.0);
        let (over, under) = (self.magnitude - mean, self.magnitude + mean);
        (mean, rest * mean * mean + up * over * over + down * under * under)
    }

    /// Probabilities of the acceleration in step `k` given the one before: rows for `0`, `+g`, `-g`. In the first step there is none
    /// before, and all rows are equal.
    pub fn transition(&self, k: usize) -> [[f64; 3]; 3] {
        if k == 0 { [self.initial; 3] } else { self.transition }
    }

    /// A random acceleration with the probabilities of step `k`.
    pub fn sample<R: Rng + ?Sized>(&self, rng: &mut R, k: usize) -> f64 {
        draw(rng, &self.law(k), &self.values())
    }

    /// A random acceleration after `now`, one of the three accelerations. Any other `now` counts as the nearest of them.
    pub fn next<R: Rng + ?Sized>(&self, rng: &mut R, now: f64) -> f64 {
        let from = if now > 0.5 * self.magnitude {
            1
        } else if now < -0.5 * self.magnitude {
            2
        } else {
            0
        };
        draw(rng, &self.transition[from], &self.values())
    }
}

/// `row matrix`, normalised as far as its factors are: repeated squaring would otherwise accumulate rounding errors in the sum.
fn times(row: &[f64; 3], matrix: &[[f64; 3]; 3]) -> [f64; 3] {
    let product: [f64; 3] = std::array::from_fn(|j| (0..3).map(|i| row[i] * matrix[i][j]).sum());
    let total: f64 = product.iter().sum();
    product.map(|p| p / total)
}

/// One of three values, with the probabilities `law`.
pub(crate) fn draw<R: Rng + ?Sized>(rng: &mut R, law: &[f64; 3], values: &[f64; 3]) -> f64 {
    let u: f64 = rng.random();
    if u < law[0] {
        values[0]
    } else if u < law[0] + law[1] {
        values[1]
    } else {
        values[2]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Defect: `law(k)` took `k` products; at 1e8 that is most of a second.
    #[test]
    fn laws_of_any_step_are_powers_of_the_transition() {
        let chain = AccelerationChain::printed(0.1).unwrap();
        let mut naive = chain.law(0);
        for k in 0..40 {
            let law = chain.law(k);
            assert!((0..3).all(|i| (law[i] - naive[i]).abs() < 1e-14), "{k}: {law:?} {naive:?}");
            naive = std::array::from_fn(|j| (0..3).map(|i| naive[i] * chain.transition[i][j]).sum());
        }
        // A chain that alternates has no fixed point: 1, 0, 1, 0 ...
        let swap = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let swapping = AccelerationChain::new(1.0, [1.0, 0.0, 0.0], swap).unwrap();
        assert_eq!((swapping.law(usize::MAX), swapping.law(1 << 60)), ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0]));
    }
}
