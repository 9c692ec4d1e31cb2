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
//! fixed order: two ends that see the same indices hold the same bits.

use fewbits_numerics::kernels::scalar::exp;
use fewbits_numerics::kernels::vectorised;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// Number of models.
pub const MODELS: usize = 24;
/// Share of the weights that is spread evenly before each slot.
const SWITCHING: f64 = 0.005;
/// Standard deviation of the sensing noise, in steps, beyond that of the cell.
const NOISE: f64 = 0.15;
/// `sqrt(3) / pi`: scale of the logistic law with standard deviation one.
const LOGISTIC: f64 = 0.551_328_895_421_792_1;
/// Per-slot factors of the velocities; zero is the random walk.
pub(crate) const DECAYS: [f64; 3] = [0.0, 0.6, 0.95];
/// Models of one family, by increasing scale.
pub const SCALES: usize = MODELS / DECAYS.len();
/// Beyond this many scales the tails are flat.
const FARTHEST: f64 = 50.0;
/// The least evidence, so that a wild value does not decide everything.
const LEAST: f64 = 1e-15;
/// Longer gaps between samples count as this many slots.
pub(crate) const LONGEST_GAP: u32 = 64;

/// Standard deviation of the driving noise of a scale, in steps of `2 delta`.
fn noise_of(scale: usize) -> f64 {
    f64::from_bits((1023 - 6 + 2 * scale as u64) << 52)
}

/// A covariance of position and velocity: `[xx, xv, vv]`.
type Covariance = [f64; 3];

fn propagate([a, b, d]: Covariance, decay: f64, q: f64) -> Covariance {
    if decay == 0.0 {
        return [a + q, 0.0, 0.0];
    }
    let far = decay * b + decay * decay * d + q;
    [a + 2.0 * decay * b + decay * decay * d + q, far, decay * decay * d + q]
}

const CELL: f64 = NOISE * NOISE + 1.0 / 12.0;

/// What follows from the predicted covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shape {
    /// One over the scale of the predictive law.
    sharpness: [f64; MODELS],
    /// `exp(1 / 2s)` and its inverse.
    widening: [f64; MODELS],
    narrowing: [f64; MODELS],
    gain_x: [f64; MODELS],
    gain_v: [f64; MODELS],
}

impl Shape {
    const EMPTY: Self = Self {
        sharpness: [0.0; MODELS],
        widening: [0.0; MODELS],
        narrowing: [0.0; MODELS],
        gain_x: [0.0; MODELS],
        gain_v: [0.0; MODELS],
    };

    fn set(&mut self, m: usize, [a, b, _]: Covariance) {
        let total = a + CELL;
        let s = (a + NOISE * NOISE).sqrt() * LOGISTIC;
        self.sharpness[m] = 1.0 / s;
        self.widening[m] = exp(0.5 / s);
        self.narrowing[m] = 1.0 / self.widening[m];
        self.gain_x[m] = a / total;
        self.gain_v[m] = b / total;
    }
}

/// Shapes one slot ahead, and the covariances after an update, of the steady state.
struct Steady {
    shape: Shape,
    updated: [Covariance; MODELS],
}

static STEADY: LazyLock<Steady> = LazyLock::new(|| {
    let mut steady = Steady {
        shape: Shape::EMPTY,
        updated: [[0.0; 3]; MODELS],
    };
    for m in 0..MODELS {
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
        steady.updated[m] = p;
        steady.shape.set(m, predicted);
    }
    steady
});

/// Of a model one slot ahead: one over the scale of its predictive law, and its gains of position and velocity.
pub(crate) fn steady_gains(model: usize) -> [f64; 3] {
    let shape = &STEADY.shape;
    [shape.sharpness[model], shape.gain_x[model], shape.gain_v[model]]
}

/// Positions, velocities and weights of the models, in steps of the lattice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Bank {
    x: [f64; MODELS],
    v: [f64; MODELS],
    w: [f64; MODELS],
}

impl Bank {
    /// All models at index 0; `believed` has half of the weight, if any does.
    pub(crate) fn new(believed: Option<usize>) -> Self {
        let mut w = [1.0 / MODELS as f64; MODELS];
        if let Some(best) = believed.filter(|best| *best < MODELS) {
            w = [0.5 / MODELS as f64; MODELS];
            w[best] += 0.5;
        }
        Self {
            x: [0.0; MODELS],
            v: [0.0; MODELS],
            w,
        }
    }

    pub(crate) fn weights(&self) -> &[f64; MODELS] {
        &self.w
    }

    /// The model of the largest weight, the first of equals.
    pub(crate) fn best(&self) -> usize {
        (1..MODELS).fold(0, |best, m| if self.w[m] > self.w[best] { m } else { best })
    }

    pub(crate) fn is_valid(&self) -> bool {
        let finite = self.x.iter().chain(&self.v).all(|x| x.abs() < 1e30);
        finite && self.w.iter().all(|w| *w > 0.0 && *w < 1.0 + 1e-9)
    }

    /// The time update over `elapsed` slots.
    pub(crate) fn predict(&mut self, elapsed: u32) -> Ahead {
        let slots = elapsed.clamp(1, LONGEST_GAP);
        for w in &mut self.w {
            *w = *w * (1.0 - SWITCHING) + SWITCHING / MODELS as f64;
        }
        for _ in 0..slots {
            for m in SCALES..MODELS {
                self.v[m] *= DECAYS[m / SCALES];
                self.x[m] += self.v[m];
            }
        }
        let mean = self.x.iter().zip(&self.w).map(|(x, w)| x * w).sum();
        Ahead { slots, mean }
    }

    /// Moves the origin of the indices.
    pub(crate) fn shift(&mut self, by: i64) {
        self.x.iter_mut().for_each(|x| *x -= by as f64);
    }

    /// The measurement update with index `j`; returns the probability of its cell.
    pub(crate) fn update(&mut self, ahead: &Ahead, j: i64) -> f64 {
        ahead.with_shape(|shape| {
            let (at, mut evidence, mut total) = (j as f64, [0.0; MODELS], 0.0);
            let (x, v) = (&mut self.x, &mut self.v);
            vectorised(
                #[inline(always)]
                || {
                    for m in 0..MODELS {
                        let d = at - x[m];
                        let e = exp(-(d.abs() * shape.sharpness[m]).min(FARTHEST));
                        let (wide, narrow) = (shape.widening[m], shape.narrowing[m]);
                        evidence[m] = e * (wide - narrow) / ((1.0 + e * wide) * (1.0 + e * narrow));
                        x[m] += shape.gain_x[m] * d;
                        v[m] += shape.gain_v[m] * d;
                    }
                },
            );
            for m in 0..MODELS {
                self.w[m] *= evidence[m].max(LEAST);
                total += self.w[m];
            }
            let inverse = 1.0 / total;
            for w in &mut self.w {
                // Never zero: the next switching is relative to a positive number, however unlikely.
                *w = (*w * inverse).max(f64::MIN_POSITIVE);
            }
            total
        })
    }

    /// Probability below `edge`, accurate relative to itself.
    pub(crate) fn below(&self, ahead: &Ahead, edge: f64) -> f64 {
        self.tail(ahead, edge, 1.0)
    }

    /// Probability above `edge`, accurate relative to itself.
    pub(crate) fn above(&self, ahead: &Ahead, edge: f64) -> f64 {
        self.tail(ahead, edge, -1.0)
    }

    fn tail(&self, ahead: &Ahead, edge: f64, side: f64) -> f64 {
        ahead.with_shape(|shape| {
            let mut terms = [0.0; MODELS];
            vectorised(
                #[inline(always)]
                || {
                    for m in 0..MODELS {
                        let z = side * (self.x[m] - edge) * shape.sharpness[m];
                        terms[m] = self.w[m] / (1.0 + exp(z.clamp(-FARTHEST, FARTHEST)));
                    }
                },
            );
            terms.iter().sum()
        })
    }
}

/// A slot ahead of the last update.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Ahead {
    pub(crate) slots: u32,
    /// Mean of the bank.
    pub(crate) mean: f64,
}

impl Ahead {
    fn with_shape<T>(&self, work: impl FnOnce(&Shape) -> T) -> T {
        let steady = &*STEADY;
        if self.slots == 1 {
            return work(&steady.shape);
        }
        let mut shape = Shape::EMPTY;
        for m in 0..MODELS {
            let (decay, q) = (DECAYS[m / SCALES], noise_of(m % SCALES) * noise_of(m % SCALES));
            let ahead = (0..self.slots).fold(steady.updated[m], |p, _| propagate(p, decay, q));
            shape.set(m, ahead);
        }
        work(&shape)
    }
}
