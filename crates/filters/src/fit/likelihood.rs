//! The likelihood of readings under a model: one pass of the filter.

use super::filter::{Filter, Steady, Step, Wandering};
use super::model::{LevelModel, Scale};
use super::readings::{Readings, Told};
use crate::Error;
use crate::calibration::Instant;

/// Assumed share of wild values, which keeps one of them from moving everything.
const WILD: f64 = 1e-3;
/// Products of densities stay between these.
const TINY: f64 = 1e-100;
const HUGE: f64 = 1e100;

impl LevelModel {
    /// `ln p` of all readings, with their standardised innovations by sensor.
    ///
    /// # Errors
    /// If an instant names a sensor that the model does not have, a reading or a number of the model is not finite or out of range.
    pub fn log_likelihood(&self, instants: &[Instant]) -> Result<(f64, Vec<Vec<f64>>), Error> {
        self.check()?;
        let scale = Scale::of(instants, self.sensors.len())?;
        let mut residuals = vec![Vec::new(); self.sensors.len()];
        let readings = Readings::of(instants, self.sensors.len());
        let total = self.run(&readings, &scale, |sensor, score| residuals[sensor].push(score));
        match total.filter(|total| total.is_finite()) {
            Some(total) => Ok((total, residuals)),
            None => Err(Error::NotANumber {
                what: "the likelihood of the readings",
            }),
        }
    }

    /// The same without checks; `None` if numbers run out of range.
    pub(super) fn run(&self, readings: &Readings, scale: &Scale, each: impl FnMut(usize, f64)) -> Option<f64> {
        if self.sensors.iter().any(|sensor| sensor.walk > 0.0) {
            self.through(readings, scale, Wandering::new(self, scale), each)
        } else {
            self.through(readings, scale, Steady::new(self, scale), each)
        }
    }

    fn through(
        &self,
        readings: &Readings,
        scale: &Scale,
        mut filter: impl Filter,
        mut each: impl FnMut(usize, f64),
    ) -> Option<f64> {
        let mut now: Option<f64> = None;
        // Most steps are as long as the one before.
        let mut step = Step::new(self, 0.0);
        // Logarithms are taken of products of many densities.
        let (mut total, mut product) = (0.0, 1.0);
        let mut take = |one: &Told, at: f64| {
            let seconds = at - *now.get_or_insert(at);
            if seconds > 0.0 {
                now = Some(at);
                if seconds != step.seconds {
                    step = Step::new(self, seconds);
                }
                filter.predict(self.mean, &step);
            }
            let model = &self.sensors[one.sensor];
            let (expected, variance) = filter.expected(one.sensor, model);
            let expected = expected + model.bias + model.slope * (one.seconds - scale.begin);
            let said = one.reading.said(expected, variance.max(0.0), model.noise, None)?;
            let (right, wild) = ((1.0 - WILD) * said.density, one.reading.wild(WILD, scale.range));
            let both = right + wild;
            product *= both;
            let is_in_range = (TINY..HUGE).contains(&product);
            if !is_in_range {
                total += product.ln();
                product = 1.0;
            }
            if one.reading.value().is_some() {
                each(one.sensor, said.score);
            }
            let weight = right / both;
            let spread = weight * ((1.0 - said.left) - (1.0 - weight) * said.score * said.score);
            filter.update(weight * said.score / said.variance.sqrt(), spread / said.variance);
            Some(())
        };
        if self.sensors.iter().all(|sensor| sensor.delay == 0.0) {
            for one in &readings.told {
                take(one, one.seconds)?;
            }
        } else {
            // The next reading of each sensor, by the time of the level that it is of.
            let mut next = vec![0; self.sensors.len()];
            for _ in 0..readings.told.len() {
                let mut first: Option<(f64, usize, usize)> = None;
                for (sensor, own) in readings.by_sensor.iter().enumerate() {
                    let Some(place) = own.get(next[sensor]) else { continue };
                    let at = readings.told[*place].seconds - self.sensors[sensor].delay;
                    if first.is_none_or(|(time, before, _)| at < time || (at == time && *place < before)) {
                        first = Some((at, *place, sensor));
                    }
                }
                let (at, place, sensor) = first?;
                next[sensor] += 1;
                take(&readings.told[place], at)?;
            }
        }
        let total = total + product.ln();
        (!total.is_nan() && !readings.told.is_empty()).then_some(total)
    }
}
