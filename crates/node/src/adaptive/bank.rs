//! The bank of models: 24 steady-state filters of the index, weighted by what they predicted.
//!
//! Models are random walks and velocities that decay by 0.6 and 0.95 a slot, each driven by noise of `2^-6 .. 2^8` steps in
//! factors of 4. The cell of the index is taken as a measurement with variance `0.15^2 + 1/12` steps^2, so the gains are
//! constants; the predictive law is logistic with the variance of the Gaussian one (`s = sd sqrt(3) / pi`), which has the
//! heavier tails that recordings have, and costs one exponential for a cell:
//!
//! ```text
//! E = exp(-|d| / s),  C = exp(1 / 2s):   P(cell) = E (C - 1/C) / ((1 + E C)(1 + E / C))
//! w <- w P(cell) / sum;   (x, v) <- (x, v) + d (g0, g1);   w <- (1 - 0.005) w + 0.005 / 24 before the next slot
//! ```
//!
//! Only IEEE arithmetic, square roots and the exponential of `numerics` (the same bits on every machine) are used, sums in a
//! fixed order: two ends that see the same indices hold the same bits. Models are taken eight at a time, one family, which fills vector
//! registers where there are any and needs little memory where there are none.

use super::steady::{STEADY, UPDATED};
use crate::math::{exp, sqrt};
use fewbits_numerics::kernels::vectorised;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Number of models.
pub const MODELS: usize = 24;
/// Share of the weights that is spread evenly before each slot.
const SWITCHING: f64 = 0.005;
/// Standard deviation of the sensing noise, in steps, beyond that of the cell.
pub(super) const NOISE: f64 = 0.15;
/// Variance of an index as a measurement.
pub(super) const CELL: f64 = NOISE * NOISE + 1.0 / 12.0;
/// `sqrt(3) / pi`: scale of the logistic law with standard deviation one.
const LOGISTIC: f64 = 0.551_328_895_421_792_1;
/// Per-slot factors of the velocities; zero is the random walk.
pub const DECAYS: [f64; 3] = [0.0, 0.6, 0.95];
/// Models of one family, by increasing scale.
pub const SCALES: usize = MODELS / DECAYS.len();
/// Beyond this many scales the tails are flat.
const FARTHEST: f64 = 50.0;
/// The least evidence, so that a wild value does not decide everything.
const LEAST: f64 = 1e-15;
/// Longer gaps between samples count as this many slots.
pub(super) const LONGEST_GAP: u32 = 64;

/// Standard deviation of the driving noise of a scale, in steps of `2 delta`.
pub(super) fn noise_of(scale: usize) -> f64 {
    f64::from_bits((1023 - 6 + 2 * scale as u64) << 52)
}

/// A covariance of position and velocity: `[xx, xv, vv]`.
pub(super) type Covariance = [f64; 3];

pub(super) fn propagate([a, b, d]: Covariance, decay: f64, q: f64) -> Covariance {
    if decay == 0.0 {
        return [a + q, 0.0, 0.0];
    }
    let far = decay * b + decay * decay * d + q;
    [a + 2.0 * decay * b + decay * decay * d + q, far, decay * decay * d + q]
}

/// What follows from the predicted covariances of one family.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Family {
    /// One over the scale of the predictive law.
    pub(super) sharpness: [f64; SCALES],
    /// `exp(1 / 2s)` and its inverse.
    pub(super) widening: [f64; SCALES],
    pub(super) narrowing: [f64; SCALES],
    pub(super) gain_x: [f64; SCALES],
    pub(super) gain_v: [f64; SCALES],
}

impl Family {
    const EMPTY: Self = Self {
        sharpness: [0.0; SCALES],
        widening: [0.0; SCALES],
        narrowing: [0.0; SCALES],
        gain_x: [0.0; SCALES],
        gain_v: [0.0; SCALES],
    };

    pub(super) fn set(&mut self, m: usize, [a, b, _]: Covariance) {
        let total = a + CELL;
        let s = sqrt(a + NOISE * NOISE) * LOGISTIC;
        self.sharpness[m] = 1.0 / s;
        self.widening[m] = exp(0.5 / s);
        self.narrowing[m] = 1.0 / self.widening[m];
        self.gain_x[m] = a / total;
        self.gain_v[m] = b / total;
    }

    /// The family `slots` after the last update.
    fn after(family: usize, slots: u32) -> Self {
        let mut ahead = Self::EMPTY;
        let decay = DECAYS.get(family).copied().unwrap_or(0.0);
        let updated = UPDATED.chunks_exact(SCALES).nth(family).into_iter().flatten();
        for (m, updated) in updated.enumerate().take(SCALES) {
            let q = noise_of(m) * noise_of(m);
            ahead.set(m, (0..slots).fold(*updated, |p, _| propagate(p, decay, q)));
        }
        ahead
    }
}

/// Of a model one slot ahead: one over the scale of its predictive law, and its gains of position and velocity. Zeros beyond the last.
pub fn steady_gains(model: usize) -> [f64; 3] {
    let scale = model % SCALES;
    STEADY
        .get(model / SCALES)
        .map_or([0.0; 3], |family| [family.sharpness[scale], family.gain_x[scale], family.gain_v[scale]])
}

/// Positions, velocities and weights of the models, in steps of the lattice.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Bank {
    #[cfg_attr(feature = "serde", serde(with = "fewbits_numerics::stored"))]
    x: [f64; MODELS],
    #[cfg_attr(feature = "serde", serde(with = "fewbits_numerics::stored"))]
    v: [f64; MODELS],
    #[cfg_attr(feature = "serde", serde(with = "fewbits_numerics::stored"))]
    w: [f64; MODELS],
}

/// Eight models in place.
type Eight = [f64; SCALES];

impl Bank {
    /// Zeros, so that memory before the first sample is cleared and not copied from flash.
    pub(super) const UNSET: Self = Self {
        x: [0.0; MODELS],
        v: [0.0; MODELS],
        w: [0.0; MODELS],
    };

    /// Back to index 0; `believed` has half of the weight, if any does.
    pub(super) fn restart(&mut self, believed: Option<usize>) {
        *self = Self::UNSET;
        let one = believed.filter(|best| *best < MODELS);
        self.w.fill(if one.is_some() { 0.5 } else { 1.0 } / MODELS as f64);
        if let Some(weight) = one.and_then(|best| self.w.get_mut(best)) {
            *weight += 0.5;
        }
    }

    /// Weights of the models.
    pub fn weights(&self) -> &[f64; MODELS] {
        &self.w
    }

    /// The model of the largest weight, the first of equals.
    pub fn best(&self) -> usize {
        let mut best = (0, self.w[0]);
        for (m, w) in self.w.iter().enumerate() {
            if *w > best.1 {
                best = (m, *w);
            }
        }
        best.0
    }

    /// Whether numbers that were stored are those of a bank.
    pub fn is_valid(&self) -> bool {
        let finite = self.x.iter().chain(&self.v).all(|x| x.abs() < 1e30);
        finite && self.w.iter().all(|w| *w > 0.0 && *w < 1.0 + 1e-9)
    }

    /// The time update over `elapsed` slots.
    pub(super) fn predict(&mut self, elapsed: u32) -> Ahead {
        let slots = elapsed.clamp(1, LONGEST_GAP);
        for w in &mut self.w {
            *w = *w * (1.0 - SWITCHING) + SWITCHING / MODELS as f64;
        }
        let families = self.x.chunks_exact_mut(SCALES).zip(self.v.chunks_exact_mut(SCALES));
        for ((x, v), decay) in families.zip(DECAYS).skip(1) {
            for _ in 0..slots {
                for (x, v) in x.iter_mut().zip(v.iter_mut()) {
                    *v *= decay;
                    *x += *v;
                }
            }
        }
        let mean = self.x.iter().zip(&self.w).map(|(x, w)| x * w).sum();
        Ahead { slots, mean }
    }

    /// Moves the origin of the indices.
    pub(super) fn shift(&mut self, by: i64) {
        self.x.iter_mut().for_each(|x| *x -= by as f64);
    }

    /// The measurement update with index `j`; returns the probability of its cell.
    pub(super) fn update(&mut self, ahead: &Ahead, j: i64) -> f64 {
        let at = j as f64;
        let (x, v, w) = (self.x.as_chunks_mut().0, self.v.as_chunks_mut().0, self.w.as_chunks_mut().0);
        for (family, ((x, v), w)) in x.iter_mut().zip(v).zip(w).enumerate() {
            ahead.with_family(family, |shape| update_family(shape, at, x, v, w));
        }
        let mut total = 0.0;
        for w in &self.w {
            total += w;
        }
        let inverse = 1.0 / total;
        for w in &mut self.w {
            // Never zero: the next switching is relative to a positive number, however unlikely.
            *w = (*w * inverse).max(f64::MIN_POSITIVE);
        }
        total
    }

    /// Probability below `edge`, accurate relative to itself.
    pub fn below(&self, ahead: &Ahead, edge: f64) -> f64 {
        self.tail(ahead, edge, 1.0)
    }

    /// Probability above `edge`, accurate relative to itself.
    pub fn above(&self, ahead: &Ahead, edge: f64) -> f64 {
        self.tail(ahead, edge, -1.0)
    }

    fn tail(&self, ahead: &Ahead, edge: f64, side: f64) -> f64 {
        let mut sum = 0.0;
        let (x, w) = (self.x.as_chunks().0, self.w.as_chunks().0);
        for (family, (x, w)) in x.iter().zip(w).enumerate() {
            ahead.with_family(family, |shape| add_tail(&mut sum, &shape.sharpness, edge, side, x, w));
        }
        sum
    }
}

/// Moves eight models to index `at`, and multiplies their weights by what they predicted.
fn update_family(shape: &Family, at: f64, x: &mut Eight, v: &mut Eight, w: &mut Eight) {
    vectorised(
        #[inline(always)]
        || {
            for m in 0..SCALES {
                let d = at - x[m];
                let e = exp(-(d.abs() * shape.sharpness[m]).min(FARTHEST));
                let (wide, narrow) = (shape.widening[m], shape.narrowing[m]);
                let evidence = e * (wide - narrow) / ((1.0 + e * wide) * (1.0 + e * narrow));
                x[m] += shape.gain_x[m] * d;
                v[m] += shape.gain_v[m] * d;
                w[m] *= evidence.max(LEAST);
            }
        },
    );
}

/// Tail of one model, `z` scales from its edge.
#[inline(always)]
fn tail_of(z: f64, weight: f64) -> f64 {
    weight / (1.0 + exp(z.clamp(-FARTHEST, FARTHEST)))
}

/// Adds the tails of eight models, the first first.
fn add_tail(sum: &mut f64, sharpness: &Eight, edge: f64, side: f64, x: &Eight, w: &Eight) {
    // Where there are vector registers, all terms first.
    if cfg!(feature = "std") {
        let mut terms = [0.0; SCALES];
        vectorised(
            #[inline(always)]
            || {
                for m in 0..SCALES {
                    terms[m] = tail_of(side * (x[m] - edge) * sharpness[m], w[m]);
                }
            },
        );
        for term in terms {
            *sum += term;
        }
    } else {
        for m in 0..SCALES {
            *sum += tail_of(side * (x[m] - edge) * sharpness[m], w[m]);
        }
    }
}

/// A slot ahead of the last update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ahead {
    pub(super) slots: u32,
    /// Mean of the bank.
    pub(super) mean: f64,
}

impl Ahead {
    fn with_family<T>(&self, family: usize, work: impl FnOnce(&Family) -> T) -> Option<T> {
        if self.slots == 1 {
            STEADY.get(family).map(work)
        } else {
            Some(self.with_computed(family, work))
        }
    }

    /// Apart from the steady state, so that its memory on the stack is taken only where samples are irregular.
    #[cold]
    #[inline(never)]
    fn with_computed<T>(&self, family: usize, work: impl FnOnce(&Family) -> T) -> T {
        work(&Family::after(family, self.slots))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Iterates the covariances of each model to their fixed point: the tables hold the same bits.
    #[test]
    fn tables_are_the_fixed_point() {
        for (m, updated) in UPDATED.iter().enumerate() {
            let (decay, q) = (DECAYS[m / SCALES], noise_of(m % SCALES) * noise_of(m % SCALES));
            let mut p = [1.0, 0.0, if decay == 0.0 { 0.0 } else { q }];
            let mut predicted = p;
            for _ in 0..20_000 {
                predicted = propagate(p, decay, q);
                let [a, b, d] = predicted;
                let (g0, g1) = (a / (a + CELL), b / (a + CELL));
                let next = [a - g0 * a, b - g0 * b, d - g1 * b];
                let settled = next.iter().zip(&p).all(|(n, o)| (n - o).abs() <= 1e-14 * o.abs());
                p = next;
                if settled {
                    break;
                }
            }
            assert_eq!(p, *updated, "model {m}");
            let mut shape = Family::EMPTY;
            shape.set(m % SCALES, predicted);
            let (k, table) = (m % SCALES, &STEADY[m / SCALES]);
            assert_eq!((shape.sharpness[k], shape.widening[k]), (table.sharpness[k], table.widening[k]), "model {m}");
            assert_eq!((shape.narrowing[k], shape.gain_x[k]), (table.narrowing[k], table.gain_x[k]), "model {m}");
            assert_eq!(shape.gain_v[k], table.gain_v[k], "model {m}");
        }
    }
}
