//! The bank of models: 24 steady-state filters of the lattice index, weighted by the probabilities that they gave to past indices.
//!
//! Models are random walks and velocities that decay by 0.6 and 0.95 a slot, each driven by noise of `2^-6 .. 2^8` steps in
//! factors of 4. The cell of the index is taken as a measurement with variance `0.15^2 + 1/12` steps^2, so the gains are
//! constants; the predictive law is logistic with the variance of the Gaussian one (`s = sd sqrt(3) / pi`), which has the
//! heavier tails that recordings have, and costs one exponential for a cell:
//!
//! ```text
//! E = exp(-|d| / s),  C = exp(1 / 2s):   P(cell) = E (C - 1/C) / (1 + E (C + 1/C) + E^2)
//! w <- w P(cell) / sum;   (x, v) <- (x, v) + d (g0, g1);   w <- (1 - 0.005) w + 0.005 / 24
//! ```
//!
//! All numbers are `f32`, which small processors support in hardware. Positions are relative to the last index, so the precision suffices.
//! Only IEEE arithmetic, square roots and the power of [`elementary`](crate::elementary) are used, with sums in a fixed order. Therefore
//! two ends that see the same indices compute the same bits. The eight models of one family are processed at a time. That fills vector
//! registers if there are any, and needs little memory otherwise.

use super::family::{DECAYS, FAMILIES, Family, MODELS, SCALES};
use super::steady::{STEADY, UPDATED};
use crate::elementary::{greater, lesser, power};
use fewbits_numerics::kernels::vectorised;
#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// Share of the weight that is distributed evenly over all models after each slot.
const SWITCHING: f32 = 0.005;
/// Distance, in doublings of the odds, beyond which a tail is constant.
const FARTHEST: f32 = 60.0;
/// Smallest probability of an index under a model, so that an outlier does not decide the weights alone.
const LEAST: f32 = 1e-15;
/// Largest gap between samples in slots; longer gaps count as this many.
pub(super) const LONGEST_GAP: u32 = 64;

/// Positions relative to the last index, velocities and weights of the models. Unit: steps of the lattice.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize))]
pub struct Bank {
    x: [f32; MODELS],
    v: [f32; MODELS],
    w: [f32; MODELS],
}

/// One number for each of the eight models of a family.
type Eight = [f32; SCALES];

impl Bank {
    /// The bank before the first sample: all zeros, so that no image of it is needed in flash memory.
    pub(super) const UNSET: Self = Self {
        x: [0.0; MODELS],
        v: [0.0; MODELS],
        w: [0.0; MODELS],
    };

    /// Sets the bank to index 0. The model `believed`, if there is one, gets half of the weight.
    pub(super) fn restart(&mut self, believed: Option<usize>) {
        *self = Self::UNSET;
        let one = believed.filter(|best| *best < MODELS);
        self.w.fill(if one.is_some() { 0.5 } else { 1.0 } / MODELS as f32);
        if let Some(weight) = one.and_then(|best| self.w.get_mut(best)) {
            *weight += 0.5;
        }
    }

    /// Weights of the models.
    pub fn weights(&self) -> &[f32; MODELS] {
        &self.w
    }

    /// The model of the largest weight, the first of equals.
    pub(crate) fn best(&self) -> usize {
        let mut best = (0, self.w[0]);
        for (m, w) in self.w.iter().enumerate() {
            if *w > best.1 {
                best = (m, *w);
            }
        }
        best.0
    }

    /// Whether stored numbers can be those of a bank.
    pub(crate) fn is_valid(&self) -> bool {
        let finite = self.x.iter().chain(&self.v).all(|x| x.abs() < 1e30);
        finite && self.w.iter().all(|w| *w > 0.0 && *w < 1.0 + 1e-9)
    }

    /// Predicts `elapsed` slots ahead.
    pub(super) fn predict(&mut self, elapsed: u32) -> Ahead {
        let slots = elapsed.clamp(1, LONGEST_GAP);
        let (x, v) = (self.x.as_chunks_mut::<SCALES>().0, self.v.as_chunks_mut::<SCALES>().0);
        // The first family's velocities are 0.
        for ((x, v), decay) in x.iter_mut().zip(v).zip(&DECAYS).skip(1) {
            // Written in the width in which it is read next: otherwise the read waits until both halves are in memory.
            vectorised(
                #[inline(always)]
                || {
                    let (mut at, mut speed) = (*x, *v);
                    for _ in 0..slots {
                        for (at, speed) in at.iter_mut().zip(&mut speed) {
                            *speed *= decay;
                            *at += *speed;
                        }
                    }
                    (*x, *v) = (at, speed);
                },
            );
        }
        let mean = self.x.iter().zip(&self.w).fold(0.0, |mean, (x, w)| mean + x * w);
        Ahead { slots, mean }
    }

    /// Updates with the index `step` from the last; positions are then relative to the new index. Returns the probability that the bank
    /// gave to its cell.
    pub(super) fn update(&mut self, ahead: &Ahead, step: f32) -> f32 {
        let mut total = 0.0;
        let eights = self
            .x
            .as_chunks_mut()
            .0
            .iter_mut()
            .zip(self.v.as_chunks_mut().0)
            .zip(self.w.as_chunks_mut().0);
        if VECTORS {
            ahead.with_families(|shapes| update_families(shapes, step, eights));
            self.w.iter().for_each(|w| total += w);
        } else {
            for (family, ((x, v), w)) in eights.enumerate() {
                ahead.with_family(family, |shape| update_each(shape, step, [x, v, w], |w| total += w));
            }
        }
        // Each model keeps a smallest share, so that its weight can grow again.
        let inverse = (1.0 - SWITCHING) / total;
        for w in &mut self.w {
            *w = *w * inverse + SWITCHING / MODELS as f32;
        }
        total
    }

    /// The probabilities below `at - 1/2` and above `at + 1/2`; `at` is in steps from the last index. Each has a small relative error, even
    /// if it is tiny.
    pub(super) fn outside(&self, ahead: &Ahead, at: f32) -> [f32; 2] {
        let mut sums = [0.0; 2];
        let (x, w) = (self.x.as_chunks().0, self.w.as_chunks().0);
        for (family, (x, w)) in x.iter().zip(w).enumerate() {
            ahead.with_family(family, |shape| add_both_tails(&mut sums, shape, at, x, w));
        }
        sums
    }

    /// The probability below `edge` (above it, if `side` is -1). Each model's share is multiplied by `scale` and rounded to an integer
    /// before the sum, so the sum is monotonic in `edge` if each share is.
    pub(super) fn counted(&self, ahead: &Ahead, edge: f32, side: f32, scale: f32) -> u32 {
        let mut sum = 0_u32;
        let (x, w) = (self.x.as_chunks().0, self.w.as_chunks().0);
        for (family, (x, w)) in x.iter().zip(w).enumerate() {
            ahead.with_family(family, |shape| {
                sum = sum.wrapping_add(counted_tails(&shape.sharpness, [edge, side, scale], x, w));
            });
        }
        sum
    }
}

/// With vector registers, eight models are first copied to local memory, so that the compiler can process them at once, and the terms of
/// sums are computed apart from the sums.
const VECTORS: bool = cfg!(feature = "std");

/// [`update_each`] of all models.
fn update_families<'a>(
    shapes: &[Family; FAMILIES],
    step: f32,
    eights: impl Iterator<Item = ((&'a mut Eight, &'a mut Eight), &'a mut Eight)>,
) {
    vectorised(
        #[inline(always)]
        || {
            for (shape, ((x, v), w)) in shapes.iter().zip(eights) {
                let [mut at, mut speed, mut weight] = [*x, *v, *w];
                update_each(shape, step, [&mut at, &mut speed, &mut weight], |_| ());
                (*x, *v, *w) = (at, speed, weight);
            }
        },
    );
}

/// Moves eight models to the index `step` from the last, and multiplies their weights by the probabilities that they gave to it. Passes the
/// weights to `take` in order.
#[inline(always)]
fn update_each(shape: &Family, step: f32, [x, v, w]: [&mut Eight; 3], mut take: impl FnMut(f32)) {
    for m in 0..SCALES {
        let d = step - x[m];
        let e = power(-lesser(d.abs() * shape.sharpness[m], FARTHEST));
        let evidence = e * shape.difference[m] / (1.0 + e * shape.sum[m] + e * e);
        x[m] += shape.gain_x[m] * d - step;
        v[m] += shape.gain_v[m] * d;
        w[m] *= greater(evidence, LEAST);
        take(w[m]);
    }
}

/// Adds the tails of eight models, below and above the cell at `at`, to the two sums in order.
fn add_both_tails([lower, upper]: &mut [f32; 2], shape: &Family, at: f32, x: &Eight, w: &Eight) {
    if !VECTORS {
        for m in 0..SCALES {
            let [below, above] = both_tails(shape, m, at, x, w);
            (*lower, *upper) = (*lower + below, *upper + above);
        }
        return;
    }
    let (below, above) = vectorised(
        #[inline(always)]
        || {
            let (mut below, mut above) = ([0.0; SCALES], [0.0; SCALES]);
            for m in 0..SCALES {
                [below[m], above[m]] = both_tails(shape, m, at, x, w);
            }
            (below, above)
        },
    );
    below.iter().for_each(|tail| *lower += tail);
    above.iter().for_each(|tail| *upper += tail);
}

#[inline(always)]
fn both_tails(shape: &Family, m: usize, at: f32, x: &Eight, w: &Eight) -> [f32; 2] {
    let z = (x[m] - (at - 0.5)) * shape.sharpness[m];
    let low = power(greater(lesser(z, FARTHEST), -FARTHEST));
    // The odds one step further.
    let high = low * shape.beyond[m];
    [w[m] / (1.0 + low), w[m] * high / (1.0 + high)]
}

/// Sum of the tails of eight models below `edge` (above it, if `side` is -1), each multiplied by `scale` and rounded to an integer.
fn counted_tails(sharpness: &Eight, [edge, side, scale]: [f32; 3], x: &Eight, w: &Eight) -> u32 {
    vectorised(
        #[inline(always)]
        || {
            let mut sum = 0_u32;
            for m in 0..SCALES {
                let z = side * (x[m] - edge) * sharpness[m];
                let tail = w[m] / (1.0 + power(greater(lesser(z, FARTHEST), -FARTHEST)));
                sum = sum.wrapping_add((tail * scale) as u32);
            }
            sum
        },
    )
}

/// Predictions of the bank for the next slot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ahead {
    pub(super) slots: u32,
    /// Mean of the bank, in steps from the last index.
    pub(super) mean: f32,
}

impl Ahead {
    fn with_family<T>(&self, family: usize, work: impl FnOnce(&Family) -> T) -> Option<T> {
        if self.slots == 1 {
            STEADY.get(family).map(work)
        } else {
            Some(self.with_computed(family, work))
        }
    }

    /// Of all families at once.
    fn with_families<T>(&self, work: impl FnOnce(&[Family; FAMILIES]) -> T) -> T {
        if self.slots == 1 {
            work(&STEADY)
        } else {
            work(&core::array::from_fn(|family| Family::after(family, self.slots, &UPDATED)))
        }
    }

    /// A function of its own, so that its stack memory is used only if samples are irregular.
    #[cold]
    #[inline(never)]
    fn with_computed<T>(&self, family: usize, work: impl FnOnce(&Family) -> T) -> T {
        work(&Family::after(family, self.slots, &UPDATED))
    }
}
