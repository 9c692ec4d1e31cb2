//! The likelihood of readings under a model: one pass of the filter.

use super::filter::{Filter, Steady, Step, Wandering};
use super::model::{LevelModel, Scale};
use super::readings::{Readings, Told};
use crate::Error;
use crate::calibration::{Beliefs, Instant, InstantLikelihood};

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
        let scale = Scale::of(instants, &self.sensors)?;
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
        Some(self.pass(readings, scale, each)?.0)
    }

    /// Times at which the level jumps: where several readings in a row agree on another level than the one that was forecast.
    pub(super) fn jumps(&self, readings: &Readings, scale: &Scale) -> Vec<f64> {
        self.pass(readings, scale, |_, _| {})
            .map_or(Vec::new(), |found| found.1)
    }

    fn pass(&self, readings: &Readings, scale: &Scale, each: impl FnMut(usize, f64)) -> Option<(f64, Vec<f64>)> {
        if self.sensors.iter().any(|sensor| sensor.walk > 0.0) {
            self.through(readings, scale, Wandering::new(self, scale), each)
        } else {
            self.through(readings, scale, Steady::new(self, scale), each)
        }
    }

    fn through<F: Filter + Clone>(
        &self,
        readings: &Readings,
        scale: &Scale,
        filter: F,
        mut each: impl FnMut(usize, f64),
    ) -> Option<(f64, Vec<f64>)> {
        let mut beliefs = Beliefs::new(filter);
        let mut step = Step::new(self, 0.0);
        let (mut total, mut jumps) = (0.0, Vec::new());
        let mut now: Option<f64> = None;
        let mut take = |at: f64, group: &[Told]| {
            let seconds = at - now.replace(at).unwrap_or(at);
            if seconds > 0.0 {
                // Most steps are as long as the one before.
                if seconds != step.seconds {
                    step = Step::new(self, seconds);
                }
                let predict = |filter: &mut F| {
                    filter.predict(self.mean, &step);
                    Ok(())
                };
                beliefs.predict::<()>(predict).ok()?;
            }
            let mut is_first = true;
            let update = |filter: &mut F| {
                let scored = |sensor: usize, score: f64| {
                    if is_first {
                        each(sensor, score);
                    }
                };
                let said = self.updated(filter, group, scale, scored);
                is_first = false;
                said.ok_or(())
            };
            let widen = |filter: &mut F, distance: f64| {
                filter.widen(distance * distance);
                Ok(())
            };
            let (log_density, jump) = beliefs.update(at, update, widen).ok()?;
            total += log_density;
            jumps.extend(jump);
            Some(())
        };
        if self.sensors.iter().all(|sensor| sensor.delay == 0.0) {
            for group in readings.told.chunk_by(|one, other| one.seconds == other.seconds) {
                take(group[0].seconds, group)?;
            }
        } else {
            // The next reading of each sensor, by the time of the level that it is of.
            let mut next = vec![0; self.sensors.len()];
            let (mut group, mut time) = (Vec::new(), f64::NEG_INFINITY);
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
                if at > time && !group.is_empty() {
                    take(time, &group)?;
                    group.clear();
                }
                time = at;
                group.push(readings.told[place]);
            }
            take(time, &group)?;
        }
        (!total.is_nan() && !readings.told.is_empty()).then_some((total, jumps))
    }

    /// Takes in readings of the level at one time.
    fn updated(
        &self,
        filter: &mut impl Filter,
        group: &[Told],
        scale: &Scale,
        mut each: impl FnMut(usize, f64),
    ) -> Option<InstantLikelihood> {
        // Logarithms are taken of products of many densities.
        let (mut total, mut product) = (0.0, 1.0);
        let (mut farthest, mut doubt) = (0.0_f64, 0.0_f64);
        for one in group {
            let model = &self.sensors[one.sensor];
            let (expected, variance) = filter.expected(one.sensor, model);
            let expected = expected + model.bias + model.slope * (one.seconds - scale.begin);
            let said = one.reading.said(expected, variance.max(0.0), model.noise, None)?;
            let wild = || (WILD, one.reading.wild(WILD, scale.ranges[one.sensor]));
            let (share, density) = one.chance.unwrap_or_else(wild);
            let doubted = said.doubted(share, density);
            product *= doubted.density;
            let is_in_range = (TINY..HUGE).contains(&product);
            if !is_in_range {
                total += product.ln();
                product = 1.0;
            }
            if one.reading.value().is_some() {
                each(one.sensor, said.score);
            }
            doubt = doubt.max(1.0 - doubted.right);
            let deviation = said.variance.sqrt();
            let distance = (said.score * deviation / model.gain).abs();
            // Not with a gain of zero, which the search may try.
            farthest = if distance.is_finite() {
                farthest.max(distance)
            } else {
                farthest
            };
            filter.update(doubted.score / deviation, doubted.spread / said.variance);
        }
        Some(InstantLikelihood {
            log_density: total + product.ln(),
            farthest,
            doubt,
        })
    }
}
