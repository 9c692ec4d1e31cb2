//! What the values of a table say against the noise that is stated, and against noise that does not last.

use crate::first::groups::groups;
use crate::first::lags::lags;
use crate::first::lasting::{Parts, lasting};
use crate::first::stuck::without_stuck;
use crate::first::values::values_of;
use crate::level::options::{LevelOptions, Model};
use crate::level::report::Report;
use crate::level::settings::Settings;
use crate::rows::instant::Instant;
use crate::text;
use crate::text::short;
use fewbits_filters::calibration::{Number, Reading, median};

/// The stated noise is doubted if another explains the rows better by so many nats, and is so many times as large or small.
const FAR_LIKELIER: f64 = 20.0;
const FAR: f64 = 1.25;
/// Accuracies are multiplied by it so many times at most.
const MOST_STEPS: i32 = 12;
/// Share of values that equal the one before them, above which a sensor may hold its values.
const HELD: f64 = 0.25;

impl Settings {
    /// A line for each sensor whose values have another noise than the stated one. Of reports of few bits nothing else would tell it: those whose
    /// threshold is the prediction are as likely under any noise.
    pub(crate) fn doubts(&self, rows: &[Instant], names: &[String]) -> Vec<String> {
        let stated: Vec<f64> = (0..names.len()).map(|i| self.seat(i, &names[i]).noise).collect();
        let known: Vec<Number> = stated.iter().map(|noise| Number::Known(*noise)).collect();
        let free = stated.iter().map(|noise| Number::Unknown {
            guess: *noise,
            least: 0.0,
        });
        let free: Vec<Number> = free.collect();
        let (change, readings) = (self.world.change, self.readings(rows, names));
        let found = |noises: &[Number]| self.world.calibrate(&readings, Number::Known(change), change, noises);
        let (Ok(stated_fit), Ok(found)) = (found(&known), found(&free)) else {
            return Vec::new();
        };
        if found.log_likelihood - stated_fit.log_likelihood < FAR_LIKELIER {
            return Vec::new();
        }
        let is_far = |ratio: f64| ratio.max(1.0 / ratio) > FAR;
        let sensors = names.iter().zip(&stated).zip(&found.noises);
        // Repeated values are no measurements, and say nothing of the noise.
        let is_held = |sensor: usize| {
            let values = values_of(rows, sensor);
            let equal = values.windows(2).filter(|pair| pair[0] == pair[1]).count();
            equal as f64 > HELD * values.len() as f64
        };
        sensors
            .enumerate()
            .filter(|(sensor, ((_, stated), found))| is_far(*found / *stated) && !is_held(*sensor))
            .map(|(_, ((name, stated), found))| {
                format!(
                    "{name}: under the supposed change its values are far likelier with a noise of {} than with the stated {}: bands are too {}",
                    short(*found),
                    short(*stated),
                    if found > stated { "narrow" } else { "wide" }
                )
            })
            .collect()
    }

    /// A line if other accuracies explain the values far better than those that rows state. `options`: what else is stated.
    pub(crate) fn doubted_accuracies(
        &self,
        rows: &[Instant],
        names: &[String],
        options: &LevelOptions,
    ) -> Option<String> {
        let readings = self.readings(rows, names);
        let change = match options.change {
            Some(_) => Number::Known(self.world.change),
            None => Number::Unknown {
                guess: self.world.change,
                least: 0.0,
            },
        };
        let noises: Vec<Number> = (0..names.len())
            .map(|i| Number::Known(self.seat(i, &names[i]).noise))
            .collect();
        let explained = |factor: f64| {
            let mut readings = readings.clone();
            for (_, reading) in readings.iter_mut().flat_map(|instant| &mut instant.values) {
                if let Reading::Value {
                    deviation: Some(deviation),
                    ..
                } = reading
                {
                    *deviation *= factor;
                }
            }
            let found = self.world.calibrate(&readings, change, self.world.change, &noises);
            found.map_or(f64::NEG_INFINITY, |found| found.log_likelihood)
        };
        let stated = explained(1.0);
        let climb = |step: f64| {
            let mut best = (1.0, stated);
            for power in 1..=MOST_STEPS {
                let factor = step.powi(power);
                let found = explained(factor);
                if found <= best.1 {
                    break;
                }
                best = (factor, found);
            }
            best
        };
        let (factor, found) = [climb(FAR), climb(1.0 / FAR)]
            .into_iter()
            .max_by(|one, other| one.1.total_cmp(&other.1))?;
        (found >= stated + FAR_LIKELIER).then(|| {
            format!(
                "the accuracies that rows state: values are far likelier if they are multiplied by {}: bands are too {}; if they are bands of 95 %, or \
                 variances, give deviations",
                short(factor),
                if factor > 1.0 { "narrow" } else { "wide" }
            )
        })
    }

    /// Looks at the differences of sensors: groups of them that measure different levels, those that come late, and errors that last.
    pub(crate) fn find_differences(&mut self, rows: &[Instant], names: &[String], options: &LevelOptions) {
        let rows = &without_stuck(rows);
        let is_plain = self.world.period.is_none() && self.meaning.silent_within.is_none() && !self.is_single;
        if is_plain {
            let noises: Vec<f64> = (0..names.len()).map(|i| self.seat(i, &names[i]).noise).collect();
            self.hints.extend(groups(rows, names));
            let change = self.world.change * (self.world.interval / self.world.within).sqrt();
            self.hints.extend(lags(rows, names, &noises, change));
        }
        if !options.noise.is_stated() && options.change.is_none() {
            self.find_lasting(rows, names);
        }
    }

    /// Finds errors of sensors that last from row to row, and the change and noises under them, as far as they may be found. Whether there are any.
    pub(crate) fn find_lasting(&mut self, rows: &[Instant], names: &[String]) -> bool {
        let is_plain = |(sensor, name): (usize, &String)| {
            let seat = self.seat(sensor, name);
            seat.sends == Report::Value && !seat.is_stated()
        };
        let is_walk = self.world.model == Model::Walk && self.world.period.is_none() && !self.world.is_on_grid;
        if !is_walk || !names.iter().enumerate().all(is_plain) {
            return false;
        }
        let Some(found) = lasting(rows, names.len()) else {
            return false;
        };
        self.found = found
            .parts
            .iter()
            .map(|parts| (parts.lasting + parts.plain).sqrt())
            .collect();
        self.noise = median(self.found.clone());
        self.world.change = (found.change * self.world.within / self.world.interval).sqrt();
        (self.world.is_learning, self.world.is_lasting, self.world.is_followed) = (false, true, false);
        (self.lasting, self.world.open) = (Some(found), None);
        true
    }

    /// A line for each sensor whose errors last.
    pub(crate) fn lasting_lines(&self, names: &[String]) -> Vec<String> {
        let parts = self.lasting.iter().flat_map(|found| &found.parts);
        let lasting = names.iter().zip(parts).filter(|(_, parts)| parts.lasting > 0.0);
        let line = |(name, parts): (&String, &Parts)| {
            format!(
                "{}: its errors last for several rows (the correlation of {} of their variance with the next row is {}): bands allow for it",
                text::name(name),
                short(parts.lasting / (parts.lasting + parts.plain)),
                short(parts.rho)
            )
        };
        lasting.map(line).collect()
    }
}
