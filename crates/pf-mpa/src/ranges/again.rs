//! Acquisition, and the start of another one.

use super::acquisition::hypotheses;
use super::odds::{calibration_of, drop_improbable};
use super::residuals::Residuals;
use super::rows::{Collected, Latest};
use super::spare::Spare;
use super::{RangeTracker, Travel};
use nalgebra::Vector3;

/// Added to the variances of bias and scale over a silence, as a share of those before the first range.
const SILENT_SHARE: f64 = 0.04;
/// Deviation of the position before the first range after a loss, at most, in spreads of the anchors.
const FARTHEST: f64 = 4.0;

impl RangeTracker {
    /// Starts acquisition again after a silence. What all hypotheses together say of bias and scale is kept, with larger variances.
    pub(super) fn pause(&mut self) {
        let priors = [self.known.bias, self.known.scale].map(|deviation| deviation * deviation);
        if let Some(found) = calibration_of(&self.hypotheses, self.known.axes) {
            for ((known, (mean, variance)), prior) in self.calibration.iter_mut().zip(found).zip(priors) {
                let variance = variance + SILENT_SHARE * prior;
                *known = if variance.is_finite() && mean * mean < 9.0 * prior {
                    (mean, variance.min(prior))
                } else {
                    (0.0, prior)
                };
            }
        }
        self.begin();
    }

    /// Starts acquisition again after the ranges have shown that no hypothesis is right: none of them says what bias and scale are.
    pub(super) fn forget(&mut self) {
        self.calibration = [self.known.bias, self.known.scale].map(|deviation| (0.0, deviation * deviation));
        self.begin();
    }

    fn begin(&mut self) {
        // The target may be as far from the anchors as it was.
        if let Some(found) = self.latest.take() {
            let (spread, middle) = (self.known.anchors_spread, Vector3::from(self.known.middle));
            let far = (found.position - middle).xy().norm();
            self.known.spreads[..2].fill(far.clamp(spread, FARTHEST * spread));
        }
        self.hypotheses.clear();
        self.tried = 0;
        if self.travel != Travel::Full {
            self.collected.clear();
        }
    }

    /// Collects a range, and looks for places once there are enough.
    pub(super) fn search(&mut self, time: f64, is_new: bool, anchor: usize, found: Latest) {
        let least = self.known.axes + 1;
        if self.known.clock.is_some() && is_new {
            // The ranges of one time are complete.
            if self.collected.len() >= least {
                self.acquire(self.last);
            }
            self.collected.clear();
            if !self.hypotheses.is_empty() {
                let (mut next, mut spare) = (self.hypotheses.clone(), Spare::default());
                let range = (found.range, found.share);
                if let Ok((taken, ..)) = self.track((&mut next, &mut spare), time - self.at, true, anchor, range) {
                    self.hypotheses = next;
                    self.at = time;
                    self.evidence += taken;
                }
                return;
            }
        }
        let silence = self.known.silence;
        self.collected.retain(|_, latest| time - latest.time <= silence);
        self.collected.insert(anchor, found);
        self.tried += 1;
        // An anchor that never answers is not waited for.
        let is_enough = self.collected.len() >= self.needed();
        let has_waited = self.collected.len() >= least && self.tried >= 2 * self.places.len();
        if is_enough || has_waited && self.known.clock.is_none() {
            self.acquire(time);
        }
    }

    /// Looks for places that explain the latest range of each anchor.
    pub(super) fn acquire(&mut self, time: f64) {
        let rows: Vec<Collected> = self
            .collected
            .iter()
            .map(|(anchor, latest)| latest.seen_at(time, *anchor, &self.places[*anchor], self.known.measured))
            .collect();
        self.residuals.iter_mut().for_each(Residuals::interrupt);
        self.hypotheses = hypotheses(&self.known, self.places.len(), self.calibration, &rows);
        self.tried = 0;
        let mut found = std::mem::take(&mut self.hypotheses);
        self.evidence = drop_improbable(&mut found, self.known.negligible, &mut self.spare);
        self.hypotheses = found;
        self.at = time;
    }
}
