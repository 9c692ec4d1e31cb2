//! Offsets that wander or drift: whether the readings show it.

use super::parameters::{Quantity, Refusal};
use super::problem::{Problem, WORTH};

/// A walk is kept if it raises the likelihood by so many nats: it cannot be negative, so this is as much evidence as [`WORTH`].
const WORTH_OF_WALK: f64 = 1.35;
/// A drift is kept beside a walk, or in place of one, if it raises the likelihood by so many: a drift of several deviations of the noise that is there loses more than ten by being taken for
/// a walk.
const WORTH_BESIDE_WALK: f64 = 6.0;

impl Problem<'_> {
    /// Which offsets wander, and which of them drift beside: a drift that is not certain would be extended beyond the readings.
    pub(super) fn try_walks(&mut self, anchor: usize, refused: &mut Vec<Refusal>) {
        for sensor in (0..self.model.sensors.len()).filter(|sensor| *sensor != anchor) {
            if !self.free.contains(&Quantity::Bias(sensor)) {
                continue;
            }
            let (before, free) = (self.model.clone(), self.free.clone());
            let steady = self.worth(&before);
            self.let_wander(sensor);
            let found = self.climb_nearly();
            if found < steady + WORTH_OF_WALK {
                self.leave_out(before, free, found);
                refused.push(Refusal {
                    quantity: Quantity::Walk(sensor),
                    reason: "an offset that does not wander explains the readings as well".to_owned(),
                });
            } else {
                self.keep(before, free, steady);
            }
        }
    }

    /// Gives the offset of a sensor a walk to begin with.
    fn let_wander(&mut self, sensor: usize) {
        let whole = self.model.sensors[sensor].noise / self.length.sqrt();
        self.free.push(Quantity::Walk(sensor));
        let wandering = [0.5, 2.0, 8.0].map(|factor| {
            let mut model = self.model.clone();
            model.sensors[sensor].walk = factor * whole;
            model
        });
        self.take_best(wandering.into_iter());
    }

    /// Leaves out the drifts without which the readings are explained as well, and, if `may_wander`, nearly as well by an offset that wanders: a walk
    /// looks like a drift, and a drift is extended beyond the readings.
    pub(super) fn try_without_slopes(&mut self, may_wander: bool, refused: &mut Vec<Refusal>) {
        for sensor in 0..self.model.sensors.len() {
            let slope = Quantity::Slope(sensor);
            if !self.free.contains(&slope) {
                continue;
            }
            let (before, free) = (self.model.clone(), self.free.clone());
            let drifting = self.worth(&before);
            self.free.retain(|quantity| *quantity != slope);
            // The offset in the middle of the readings stays.
            let model = &mut self.model.sensors[sensor];
            model.bias += 0.5 * model.slope * self.length;
            model.slope = 0.0;
            let is_wandering = self.free.contains(&Quantity::Walk(sensor));
            let most = if is_wandering { WORTH_BESIDE_WALK } else { WORTH };
            let mut found = self.climb_nearly();
            let mut is_left = found + most >= drifting;
            if !is_left && may_wander && !is_wandering {
                self.let_wander(sensor);
                found = self.climb_nearly();
                is_left = found + WORTH_BESIDE_WALK >= drifting;
                if is_left {
                    refused.retain(|one| one.quantity != Quantity::Walk(sensor));
                }
            }
            if !is_left {
                self.leave_out(before, free, found);
            } else {
                self.keep(before, free, drifting);
                refused.push(Refusal {
                    quantity: slope,
                    reason: "an offset that does not drift explains the readings as well".to_owned(),
                });
            }
        }
    }
}
