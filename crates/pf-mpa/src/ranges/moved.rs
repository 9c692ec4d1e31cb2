//! Odometry: what the target moved between ranges.

use super::RangeTracker;
use super::bank::Hypothesis;
use super::estimate::RangeEstimate;
use super::settings::Known;
use super::step::Step;
use crate::Error;
use fewbits_numerics::error::{finite, refuse};
use nalgebra::Vector3;

impl RangeTracker {
    pub(super) fn check_time(&self, time: f64) -> Result<(), Error> {
        let earliest = self.last.max(self.at);
        if finite("time", time)? < earliest {
            return refuse("time", time, format!("{earliest} or later"));
        }
        Ok(())
    }

    /// Moves the target by what odometry says that it moved until `time` since the last call, along the axes of the anchors' coordinates. The
    /// third coordinate counts only if the height is estimated. With odometry, `speed` of the settings is the deviation of its error per second,
    /// which lasts for `persistence` and is estimated. Returns the estimate; `None` during acquisition.
    ///
    /// # Errors
    /// If a number is not finite or moves a place to where it is not, or `time` is before the last range's or displacement's.
    pub fn moved(&mut self, time: f64, by: &Vector3<f64>) -> Result<Option<RangeEstimate>, Error> {
        self.check_time(time)?;
        by.iter().try_for_each(|x| finite("by", *x).map(|_| ()))?;
        let mut whole = [by.x, by.y, by.z];
        if self.known.axes < 3 {
            whole[2] = 0.0;
        }
        let mut next = self.hypotheses.clone();
        if !next.is_empty() {
            let step = Step::over(time - self.at, self.known.persistence, self.known.drift);
            next.iter_mut().for_each(|one| one.carry(&self.known, &step, &whole));
            if !next.iter().all(Hypothesis::is_finite) {
                return refuse("by", format!("{by:?}"), "a displacement after which places are finite");
            }
            (self.hypotheses, self.at) = (next, time);
        }
        if self.known.has_rest && whole != [0.0; 3] {
            // What odometry leaves open lasts: it is no rest.
            let noises = self.known.noises.len();
            self.hypotheses.iter_mut().for_each(|one| one.leave_rest_out(noises));
            self.known.leave_rest_out();
        }
        for latest in self.collected.values_mut() {
            latest.moved.iter_mut().zip(&whole).for_each(|(sum, x)| *sum += x);
        }
        self.latest = self.estimate(false);
        Ok(self.latest.clone())
    }
}

impl Hypothesis {
    /// Gives the weights of the slowest speed's filters to those of the next one.
    fn leave_rest_out(&mut self, noises: usize) {
        for i in 0..noises {
            if self.weights[noises + i] == 0.0 {
                self.filters.swap(i, noises + i);
            }
            self.weights[noises + i] += self.weights[i];
        }
        self.filters.drain(..noises);
        self.weights.drain(..noises);
        self.alive = (0..self.weights.len()).filter(|i| self.weights[*i] > 0.0).collect();
    }

    /// Whether the error of scale is not to be estimated: from one place, ranges to anchors with biases of their own, or from an unknown clock, do
    /// not tell it from these, and a filter that linearises them again and again would believe that they do. `is_short`: the anchors without biases
    /// of their own are fewer than position, bias and error of scale have coordinates.
    pub(super) fn rests(&mut self, known: &Known, is_short: bool) -> bool {
        let heaviest = self
            .alive
            .iter()
            .max_by(|i, j| self.weights[**i].total_cmp(&self.weights[**j]));
        let Some(heaviest) = heaviest.copied() else {
            return false;
        };
        let state = &self.filters[heaviest];
        let is_slowest = heaviest < known.noises.len() * (1 + usize::from(known.has_rest));
        let has_own = state.mean.len() > 2 * state.axes + 2;
        // One anchor's own bias is told from the rest at one place if the others are enough.
        let is_blind = known.clock.is_some() || has_own && (state.only.is_none() || is_short);
        self.rest.observe(state) && is_slowest && is_blind && known.scale > 0.0
    }
}
