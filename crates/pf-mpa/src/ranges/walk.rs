//! The law of biases of single anchors that walk: each is forgotten after a while (Ornstein-Uhlenbeck).

use super::gaussian::Normal;
use super::step::Step;

/// The law of the walk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Walk {
    /// Of the bias of an anchor.
    pub(super) deviation: f64,
    /// After which it is forgotten.
    pub(super) seconds: f64,
}

impl Walk {
    /// Moves the biases of a law on.
    pub(super) fn carry(&self, state: &mut Normal, step: &Step) {
        let share = step.seconds / self.seconds;
        let variance = self.deviation * self.deviation;
        // What is common to the biases walks in the common one.
        state.walk((-share).exp(), -variance * (-2.0 * share).exp_m1(), 2.0 * variance * share);
    }
}

impl Normal {
    /// Moves biases of single anchors: they keep a share, and get a variance. `common`: the variance that the common bias gets.
    pub(super) fn walk(&mut self, kept: f64, added: f64, common: f64) {
        let (n, bias) = (self.mean.len(), self.bias());
        self.covariance[bias * n + bias] += common;
        for own in bias + 2..n {
            self.mean[own] *= kept;
            for i in 0..n {
                self.covariance[own * n + i] *= kept;
                self.covariance[i * n + own] *= kept;
            }
            self.covariance[own * n + own] += added;
        }
    }

    /// Gives each anchor a bias of its own: that which it has, or none that is known, of this variance. What they are is unknown to the common one too.
    pub(super) fn give_biases(&mut self, anchors: usize, variance: f64) {
        let (n, bias) = (self.mean.len(), self.bias());
        let first = bias + 2;
        self.covariance[bias * n + bias] += variance;
        if self.only.is_none() && n > first {
            (first..n).for_each(|own| self.covariance[own * n + own] += variance);
            return;
        }
        let place = |i: usize| if i < first { i } else { first + self.only.unwrap_or(0) };
        let size = first + anchors;
        let (mut mean, mut covariance) = (vec![0.0; size], vec![0.0; size * size]);
        for i in 0..n {
            mean[place(i)] = self.mean[i];
            for j in 0..n {
                covariance[place(i) * size + place(j)] = self.covariance[i * n + j];
            }
        }
        (first..size).for_each(|own| covariance[own * size + own] += variance);
        (self.mean, self.covariance, self.only) = (mean, covariance, None);
    }
}
