//! Constants that follow from the covariances of the bank's models: predictive laws and gains, for one family of eight models at a time.

use crate::elementary::exp2;
use crate::math::sqrt_f32;

/// Number of models.
pub const MODELS: usize = 24;
/// Per-slot factors of the velocities; zero is the random walk.
pub(super) const DECAYS: [f32; 3] = [0.0, 0.6, 0.95];
/// Families of models.
pub(super) const FAMILIES: usize = DECAYS.len();
/// Models of one family, by increasing scale.
pub const SCALES: usize = MODELS / FAMILIES;
/// Standard deviation of the measurement noise, in steps, in addition to that of the cell.
const NOISE: f32 = 0.15;
/// Variance of an index as a measurement, in steps squared: noise and uniform cell.
const CELL: f32 = NOISE * NOISE + 1.0 / 12.0;
/// `pi / sqrt(3) log2 e`: doublings of the odds per standard deviation of the logistic law.
const DOUBLINGS: f32 = 2.6167593;

/// Standard deviation of the driving noise of a scale, in steps of `2 delta`.
fn noise_of(scale: usize) -> f32 {
    f32::from_bits((127 - 6 + 2 * scale as u32) << 23)
}

/// A covariance of position and velocity: `[xx, xv, vv]`.
pub(super) type Covariance = [f32; 3];

fn propagate([a, b, d]: Covariance, decay: f32, q: f32) -> Covariance {
    if decay == 0.0 {
        return [a + q, 0.0, 0.0];
    }
    let far = decay * b + decay * decay * d + q;
    [a + 2.0 * decay * b + decay * decay * d + q, far, decay * decay * d + q]
}

/// What follows from the predicted covariances of one family.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Family {
    /// Doublings of the odds of the predictive law per step.
    pub(super) sharpness: [f32; SCALES],
    /// `C - 1/C` and `C + 1/C`; `C` is the factor of the odds for half a step.
    pub(super) difference: [f32; SCALES],
    pub(super) sum: [f32; SCALES],
    /// `1/C^2`, the factor of the odds for one step.
    pub(super) beyond: [f32; SCALES],
    pub(super) gain_x: [f32; SCALES],
    pub(super) gain_v: [f32; SCALES],
}

impl Family {
    const EMPTY: Self = Self {
        sharpness: [0.0; SCALES],
        difference: [0.0; SCALES],
        sum: [0.0; SCALES],
        beyond: [0.0; SCALES],
        gain_x: [0.0; SCALES],
        gain_v: [0.0; SCALES],
    };

    fn set(&mut self, m: usize, [a, b, _]: Covariance) {
        let total = a + CELL;
        self.sharpness[m] = DOUBLINGS / sqrt_f32(a + NOISE * NOISE);
        let odds = exp2(0.5 * self.sharpness[m]);
        let inverse = 1.0 / odds;
        self.difference[m] = odds - inverse;
        self.sum[m] = odds + inverse;
        self.beyond[m] = inverse * inverse;
        self.gain_x[m] = a / total;
        self.gain_v[m] = b / total;
    }

    /// The family `slots` after the last update, from the covariances of all models after an update.
    pub(super) fn after(family: usize, slots: u32, updated: &[Covariance; MODELS]) -> Self {
        let mut ahead = Self::EMPTY;
        let decay = DECAYS.get(family).copied().unwrap_or(0.0);
        let updated = updated.chunks_exact(SCALES).nth(family).into_iter().flatten();
        for (m, updated) in updated.enumerate().take(SCALES) {
            let q = noise_of(m) * noise_of(m);
            ahead.set(m, (0..slots).fold(*updated, |p, _| propagate(p, decay, q)));
        }
        ahead
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adaptive::steady::{STEADY, UPDATED};

    /// Iterates the covariances of each model to their fixed point, in `f64`: the tables hold it.
    #[test]
    fn tables_are_the_fixed_point() {
        let is = |stored: f32, exact: f64| (f64::from(stored) - exact).abs() <= 6e-8 * exact.abs();
        let noise = 0.15 * 0.15;
        for (m, updated) in UPDATED.iter().enumerate() {
            let (decay, q) = ([0.0, 0.6, 0.95][m / SCALES], 4.0_f64.powi(2 * (m % SCALES) as i32 - 6));
            let cell = noise + 1.0 / 12.0;
            let mut p = [1.0, 0.0, if decay == 0.0 { 0.0 } else { q }];
            let mut ahead = p;
            for _ in 0..20_000 {
                let [a, b, d] = p;
                ahead = match decay {
                    0.0 => [a + q, 0.0, 0.0],
                    _ => {
                        let speed = decay * decay * d + q;
                        [a + 2.0 * decay * b + speed, decay * b + speed, speed]
                    }
                };
                let [a, b, d] = ahead;
                let (g0, g1) = (a / (a + cell), b / (a + cell));
                p = [a - g0 * a, b - g0 * b, d - g1 * b];
            }
            assert!(updated.iter().zip(p).all(|(stored, exact)| is(*stored, exact)), "model {m}");
            let (k, table) = (m % SCALES, &STEADY[m / SCALES]);
            let sharpness = std::f64::consts::PI / (3.0 * (ahead[0] + noise)).sqrt() * std::f64::consts::LOG2_E;
            assert!(is(table.sharpness[k], sharpness), "model {m}");
            let odds = (0.5 * sharpness).exp2();
            assert!(is(table.difference[k], odds - 1.0 / odds) && is(table.sum[k], odds + 1.0 / odds), "model {m}");
            assert!(is(table.beyond[k], (-sharpness).exp2()), "model {m}");
            assert!(is(table.gain_x[k], ahead[0] / (ahead[0] + cell)), "model {m}");
            assert!(is(table.gain_v[k], ahead[1] / (ahead[0] + cell)), "model {m}");
            // What is computed for gaps is the same within rounding.
            let mut shape = Family::EMPTY;
            shape.set(k, propagate(*updated, DECAYS[m / SCALES], noise_of(k) * noise_of(k)));
            assert!((f64::from(shape.sharpness[k]) / sharpness - 1.0).abs() < 1e-6, "model {m}");
            assert!((f64::from(shape.gain_x[k]) * (ahead[0] + cell) / ahead[0] - 1.0).abs() < 1e-6, "model {m}");
        }
    }
}
