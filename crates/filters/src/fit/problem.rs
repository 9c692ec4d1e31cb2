//! The search for the parameters.

use super::model::{LevelModel, Scale};
use super::parameters::{Quantity, Refusal};
use super::readings::Readings;
use super::search::{Maximum, maximum};
use crate::calibration::{Instant, median};
use nalgebra::{DMatrix, DVector};

/// A time constant or a drift is kept if it raises the likelihood by so many nats: one in twenty tests of a parameter that is zero does.
pub(super) const WORTH: f64 = 2.0;
/// The same of a level that returns, if nobody asked, beside one that returns in so many times the table's length: a walk stays within the readings
/// by chance.
const CERTAIN: f64 = 11.0;
pub(super) const LONG: f64 = 10.0;
/// Deviation of the logarithm of a change or a noise about the first guess: nothing may be taken for zero only because the readings do not
/// tell it from zero.
const VAGUE: f64 = 2.0;
/// Starts from which the search climbs.
const CLIMBS: usize = 3;
/// A step that raises the likelihood by less ends a search: by a part, and where only the sizes of two maxima are compared.
const LITTLE: f64 = 1e-6;
pub(super) const ENOUGH: f64 = 1e-2;
/// Half of the delays that are tried, in half intervals between readings.
const DELAYS: i32 = 12;
/// How often they are tried at the end of a climb.
const ROUNDS: usize = 3;
/// The same of a first search, in whole intervals.
const FAR_DELAYS: i32 = 64;

/// Which parameters are there, with the values that fit best.
pub(super) struct Hypothesis {
    pub(super) model: LevelModel,
    pub(super) free: Vec<Quantity>,
    /// The likelihood of the readings.
    pub(super) worth: f64,
}

/// The search, in units in which every parameter is about as uncertain.
pub(super) struct Problem<'a> {
    pub(super) readings: Readings,
    /// Stretches of a long table, by which the search begins, and whether it is about these now.
    pub(super) part: Option<Readings>,
    is_rough: bool,
    pub(super) scale: Scale,
    pub(super) model: LevelModel,
    /// The first guess.
    guess: LevelModel,
    starts: Vec<LevelModel>,
    pub(super) free: Vec<Quantity>,
    /// What explains the readings as well, or nearly.
    pub(super) left_out: Vec<Hypothesis>,
    /// Seconds of all readings, and between two.
    pub(super) length: f64,
    pub(super) interval: f64,
    /// Whether the search goes on; otherwise no point is better than another.
    goes_on: &'a dyn Fn() -> bool,
}

impl<'a> Problem<'a> {
    /// `starts`: first guesses, at least one.
    pub(super) fn new(instants: &'a [Instant], scale: Scale, starts: Vec<LevelModel>, free: Vec<Quantity>) -> Self {
        let model = starts[0].clone();
        let gaps = instants
            .windows(2)
            .map(|pair| pair[1].seconds - pair[0].seconds)
            .filter(|gap| *gap > 0.0);
        let interval = median(gaps.collect());
        let readings = Readings::of(instants, model.sensors.len());
        let length = instants.last().map_or(0.0, |last| last.seconds - scale.begin);
        Self {
            part: readings.part(),
            readings,
            is_rough: false,
            scale,
            guess: model.clone(),
            starts,
            model,
            free,
            left_out: Vec::new(),
            length: if length > 0.0 { length } else { 1.0 },
            interval: if interval > 0.0 { interval } else { 1.0 },
            goes_on: &|| true,
        }
    }

    /// The same search, which asks before every evaluation whether to go on.
    pub(super) fn asking(self, goes_on: &'a dyn Fn() -> bool) -> Self {
        Self { goes_on, ..self }
    }

    /// The unit of a parameter that may have either sign.
    pub(super) fn unit(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Bias(sensor) => self.model.sensors[sensor].noise,
            Quantity::Slope(sensor) => self.model.sensors[sensor].noise / self.length,
            Quantity::Gain(sensor) => 0.1 * self.scale.spreads[sensor] / self.scale.spread,
            Quantity::Delay(_) => self.interval,
            _ => self.scale.spread,
        }
    }

    pub(super) fn value(&self, quantity: Quantity) -> f64 {
        quantity.of(&self.model).unwrap_or(0.1 * self.length)
    }

    /// The model at a point of the search, which is zero at the present one.
    pub(super) fn at(&self, point: &DVector<f64>) -> LevelModel {
        let mut model = self.model.clone();
        for (quantity, off) in self.free.iter().zip(point.iter()) {
            let before = self.value(*quantity);
            let value = if quantity.is_positive() {
                before * off.exp()
            } else {
                before + off * self.unit(*quantity)
            };
            quantity.set(&mut model, value);
            if let Quantity::Gain(sensor) = *quantity {
                // The coordinate of the offset is what the sensor reads at the middle of all values: a gain alone turns about that.
                model.sensors[sensor].bias -= (value - before) * self.scale.middle;
            }
        }
        model
    }

    pub(super) fn log_likelihood(&self, model: &LevelModel) -> f64 {
        let part = self.part.as_ref().filter(|_| self.is_rough);
        self.log_likelihood_of(part.unwrap_or(&self.readings), model)
    }

    /// The same of other readings.
    pub(super) fn log_likelihood_of(&self, readings: &Readings, model: &LevelModel) -> f64 {
        let found = if (self.goes_on)() && model.check().is_ok() {
            model.run(readings, &self.scale, |_, _| {})
        } else {
            None
        };
        found.unwrap_or(f64::NEG_INFINITY)
    }

    /// The likelihood, less what changes and noises far from the first guess cost.
    pub(super) fn worth(&self, model: &LevelModel) -> f64 {
        self.log_likelihood(model) - self.vagueness(model)
    }

    /// What changes and noises far from the first guess cost.
    pub(super) fn vagueness(&self, model: &LevelModel) -> f64 {
        let far = |quantity: &Quantity| {
            let pair = match *quantity {
                Quantity::Change => (model.change, self.guess.change),
                Quantity::Noise(sensor) => (model.sensors[sensor].noise, self.guess.sensors[sensor].noise),
                _ => return 0.0,
            };
            0.5 * ((pair.0 / pair.1).ln() / VAGUE).powi(2)
        };
        self.free.iter().map(far).sum()
    }

    /// Climbs from several changes, each with the delays that fit best and without. Of a long table all but the last climb is about a part.
    pub(super) fn solve(&mut self) {
        self.is_rough = self.part.is_some();
        let mut starts = Vec::new();
        for guess in &self.starts {
            // Readings that have none beside them say nothing of a delay.
            let far = FAR_DELAYS.min((0.5 * self.length / self.interval) as i32);
            let (_, late) = self.with_best_delays(guess.clone(), -far..=far, 1.0);
            for factor in [1e-2, 0.1, 1.0, 3.0, 10.0] {
                let change = factor * guess.change;
                let with_change = |model: &LevelModel| LevelModel {
                    change,
                    ..model.clone()
                };
                starts.push(self.with_best_delays(with_change(&late), -DELAYS..=DELAYS, 0.5));
                if late != *guess {
                    let prompt = with_change(guess);
                    starts.push((self.worth(&prompt), prompt));
                }
            }
        }
        starts.sort_by(|one, other| other.0.total_cmp(&one.0));
        // Delays that suit a poor guess of the other parameters may be far off, and no climb comes back.
        let is_prompt = |model: &LevelModel| model.sensors.iter().all(|one| one.delay.abs() <= self.interval);
        let prompt = starts.iter().skip(CLIMBS).find(|(_, model)| is_prompt(model)).cloned();
        let has_prompt = starts.iter().take(CLIMBS).any(|(_, model)| is_prompt(model));
        starts.truncate(CLIMBS);
        starts.extend(prompt.filter(|_| !has_prompt));
        let mut best: Option<(f64, LevelModel)> = None;
        for (_, start) in starts {
            self.model = start;
            // Units follow the noises, so the second climb begins in better ones.
            self.step_up(None, LITTLE);
            let mut found = self.step_up(None, LITTLE).value;
            if self.free.iter().any(|one| matches!(one, Quantity::Delay(_))) {
                found = self.leave_kinks(found);
            }
            if best.as_ref().is_none_or(|(most, _)| found > *most) {
                best = Some((found, self.model.clone()));
            }
        }
        if let Some((_, model)) = best {
            self.model = model;
        }
        if self.is_rough {
            self.is_rough = false;
            self.climb();
        }
    }

    /// Takes other readings, and climbs.
    pub(super) fn replace(&mut self, readings: Readings) {
        self.part = readings.part();
        self.readings = readings;
        self.climb();
    }

    /// The likelihood has kinks in a delay, at which a climb may end: tries other delays, and climbs from these. `found`: the present value.
    fn leave_kinks(&mut self, mut found: f64) -> f64 {
        for _ in 0..ROUNDS {
            let (_, far) = self.with_common_delay(self.model.clone(), -DELAYS..=DELAYS, 0.5);
            let (finer, model) = self.with_best_delays(far, -DELAYS..=DELAYS, 0.125);
            if finer <= found + ENOUGH {
                break;
            }
            self.model = model;
            found = self.step_up(None, LITTLE).value;
        }
        found
    }

    /// A model whose delays are all longer by the best of several times: where the reference is noisy, the others say far more of the differences between
    /// their delays than it says of each.
    fn with_common_delay(
        &self,
        model: LevelModel,
        range: std::ops::RangeInclusive<i32>,
        step: f64,
    ) -> (f64, LevelModel) {
        let delays = self.free.iter().filter(|one| matches!(one, Quantity::Delay(_)));
        let mut best = (self.worth(&model), model);
        if delays.clone().count() < 2 {
            return best;
        }
        let middle = best.1.clone();
        for steps in range.filter(|steps| *steps != 0) {
            let mut model = middle.clone();
            for quantity in delays.clone() {
                let later = quantity.of(&middle).unwrap_or(0.0) + step * f64::from(steps) * self.interval;
                quantity.set(&mut model, later);
            }
            let found = self.worth(&model);
            if found > best.0 {
                best = (found, model);
            }
        }
        best
    }

    /// A model with the best of several delays about its own, one sensor after the other, and all together.
    fn with_best_delays(
        &self,
        model: LevelModel,
        range: std::ops::RangeInclusive<i32>,
        step: f64,
    ) -> (f64, LevelModel) {
        let mut best = (self.worth(&model), model);
        for quantity in &self.free {
            let Quantity::Delay(sensor) = *quantity else {
                continue;
            };
            let middle = best.1.clone();
            for steps in range.clone() {
                let mut model = middle.clone();
                model.sensors[sensor].delay += step * f64::from(steps) * self.interval;
                let found = self.worth(&model);
                if found > best.0 {
                    best = (found, model);
                }
            }
        }
        self.with_common_delay(best.1, range, step)
    }

    pub(super) fn take_best(&mut self, models: impl Iterator<Item = LevelModel>) {
        let scored = models.map(|model| (self.worth(&model), model));
        if let Some((_, best)) = scored.max_by(|one, other| one.0.total_cmp(&other.0)) {
            self.model = best;
        }
    }

    /// Climbs, of a long table first by its part; the value at the maximum.
    fn climb(&mut self) -> f64 {
        let known = self.climb_by_part();
        self.step_up(known, LITTLE).value
    }

    /// The same up to what a comparison needs. Of a long table the end of the climb is left out.
    pub(super) fn climb_nearly(&mut self) -> f64 {
        let known = self.climb_by_part();
        let little = if self.part.is_some() { ENOUGH } else { LITTLE };
        self.step_up(known, little).value
    }

    /// What the climb to the maximum of the part of a long table finds out of its shape.
    fn climb_by_part(&mut self) -> Option<DMatrix<f64>> {
        let share = self.part.as_ref()?.told.len() as f64 / self.readings.told.len() as f64;
        self.is_rough = true;
        let found = self.step_up(None, LITTLE);
        self.is_rough = false;
        found.inverse.map(|inverse| inverse * share)
    }

    fn step_up(&mut self, known: Option<DMatrix<f64>>, little: f64) -> Maximum {
        let found = maximum(|point| self.worth(&self.at(point)), self.free.len(), known, little);
        self.model = self.at(&found.point);
        found
    }

    /// Looks for the time in which the level returns to its mean. Returns what the readings are worth then, if it is shorter than they last.
    fn let_return(&mut self) -> (f64, bool) {
        let before = self.model.clone();
        self.free.extend([Quantity::TimeConstant, Quantity::Mean]);
        let returning = [0.01, 0.03, 0.1, 0.3].map(|share| LevelModel {
            time_constant: Some(share * self.length),
            ..before.clone()
        });
        self.take_best(returning.into_iter());
        let found = self.climb_nearly();
        (found, self.model.time_constant.is_some_and(|seconds| seconds < self.length))
    }

    /// The time in which the level returns to its mean, if that is certain. What was found before is lost.
    pub(super) fn returns(&mut self) -> Option<f64> {
        let before = self.model.clone();
        let (found, is_short) = self.let_return();
        let seconds = self.model.time_constant.filter(|_| is_short)?;
        // Beside a walk it would gain by what is supposed of the first level.
        let time_constant = Some(LONG * self.length);
        self.free.retain(|one| *one != Quantity::TimeConstant);
        let mean = self.model.mean;
        let long = [self.model.clone(), before].map(|model| LevelModel {
            time_constant,
            mean,
            ..model
        });
        self.take_best(long.into_iter());
        (found > self.climb_nearly() + CERTAIN).then_some(seconds)
    }

    /// Whether the level returns to its mean.
    pub(super) fn try_time_constant(&mut self, refused: &mut Vec<Refusal>) {
        let (before, free) = (self.model.clone(), self.free.clone());
        let wandering = self.worth(&before);
        let (found, is_short) = self.let_return();
        if !is_short || found < wandering + WORTH {
            self.leave_out(before, free, found);
            refused.push(Refusal {
                quantity: Quantity::TimeConstant,
                reason: "a level that only wanders explains the readings as well".to_owned(),
            });
        } else {
            self.keep(before, free, wandering);
        }
    }

    /// Goes back to a model, and keeps the present one for the posterior.
    pub(super) fn leave_out(&mut self, model: LevelModel, free: Vec<Quantity>, worth: f64) {
        let (model, free) = (std::mem::replace(&mut self.model, model), std::mem::replace(&mut self.free, free));
        self.left_out.push(Hypothesis { model, free, worth });
    }

    /// Ends the climb of the present model, and keeps another one for the posterior.
    pub(super) fn keep(&mut self, model: LevelModel, free: Vec<Quantity>, worth: f64) {
        self.left_out.push(Hypothesis { model, free, worth });
        if self.part.is_some() {
            self.climb();
        }
    }
}
