//! What a range says to the filters of a hypothesis.

use super::arrived::Arrived;
use super::bank::Hypothesis;
use super::columns::Columns;
use super::settings::Known;
use crate::Error;
use fewbits_numerics::kernels::vectorised;

/// Probability per range of an anchor that it starts, or ceases, to send ranges that do not depend on the distance.
pub(super) const ANCHOR_CHANGES: f64 = 1e-3;
/// Share of a range's score that stays in the sum of an anchor's scores.
const SCORE_KEPT: f64 = 0.9;

impl Columns {
    /// The moments of the noise-free range under "it is no outlier" and "it is one" together. The density becomes that of the first alone.
    fn doubt(&mut self, right_share: f64, stray: f64) {
        let count = self.mean.len();
        let (mean, variance) = (&self.mean[..count], &self.variance[..count]);
        let (density, after) = (&mut self.density[..count], &mut self.after[..count]);
        let (left, evidence) = (&mut self.left[..count], &mut self.evidence[..count]);
        vectorised(
            #[inline(always)]
            || {
                for k in 0..count {
                    let right = right_share * density[k];
                    evidence[k] = right + (1.0 - right_share) * stray;
                    let share = if evidence[k] > 0.0 { right / evidence[k] } else { 0.0 };
                    let off = after[k] - mean[k];
                    (density[k], after[k]) = (right, mean[k] + share * off);
                    left[k] = share * left[k] + (1.0 - share) * variance[k] + share * (1.0 - share) * off * off;
                }
            },
        );
    }
}

impl Hypothesis {
    /// Updates with what arrived from an anchor whose range was [expected](Self::expect). `holds_scale`: the error of scale is not estimated
    /// ([`condition`](super::gaussian::Normal::condition)). Returns `ln` of the evidence.
    pub(super) fn update(
        &mut self,
        known: &Known,
        anchor: usize,
        arrived: &Arrived,
        holds_scale: bool,
    ) -> Result<f64, Error> {
        let stray = arrived.stray(known.stray);
        arrived.right(&mut self.columns)?;
        let size = self.size();
        if matches!(arrived, Arrived::First(_)) {
            let columns = &self.columns;
            for (k, i) in self.alive.iter().enumerate() {
                let moments = (columns.after[k], columns.left[k]);
                self.filters[*i].condition(columns.expected(k, size), moments, holds_scale);
            }
            return Ok(0.0);
        }
        let (good, outliers) = (self.good[anchor], known.outliers);
        let right_share = good * (1.0 - outliers);
        self.columns.doubt(right_share, stray);
        let (mut total, mut agreeing, mut score) = (0.0, 0.0, 0.0);
        let old: f64 = self.alive.iter().map(|i| self.weights[*i]).sum();
        let columns = &self.columns;
        for (k, i) in self.alive.iter().copied().enumerate() {
            let weight = self.weights[i] / old;
            let moments = (columns.after[k], columns.left[k]);
            self.filters[i].condition(columns.expected(k, size), moments, holds_scale);
            score += weight * columns.score[k].clamp(-3.0, 3.0);
            self.weights[i] = weight * columns.evidence[k];
            total += self.weights[i];
            agreeing += weight * columns.density[k];
        }
        if total <= 0.0 {
            return Err(Error::Impossible);
        }
        let weights = &mut self.weights;
        let largest = self.alive.iter().fold(0.0_f64, |largest, i| largest.max(weights[*i]));
        let least = self.negligible.min(largest / total);
        self.alive.retain(|i| {
            let share = weights[*i] / total;
            weights[*i] = if share < least { 0.0 } else { share };
            weights[*i] > 0.0
        });
        // The anchor: with `density` the mean over the filters, `agreeing` is `good (1 - outliers) density`.
        let still_good = (agreeing + good * outliers * stray) / total;
        self.good[anchor] = ANCHOR_CHANGES + (1.0 - 2.0 * ANCHOR_CHANGES) * still_good.clamp(0.0, 1.0);
        let rate = 0.5 / self.good.len() as f64;
        self.agreement += rate * (agreeing / total - self.agreement);
        let (sum, variance) = &mut self.scores[anchor];
        *sum = SCORE_KEPT * *sum + score;
        *variance = SCORE_KEPT * SCORE_KEPT * *variance + 1.0;
        Ok(total.ln())
    }
}
