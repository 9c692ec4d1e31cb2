//! Noise of sensors that changes while rows come, as in rain or on a low battery.
//!
//! ```text
//! z      difference of a value from its forecast given the others of its row, in deviations
//! sums   of ln p(z | deviation 1.5) - ln p(z | 1), and of ln p(z | 1/1.5) - ln p(z | 1), never below 0
//! a sum is above its limit: which explains the rows since it was 0 best, another noise of these sensors, a larger change, or neither?
//! another noise: it is found again when there are twice as many rows
//! ```
//! While nothing changes, a sum reaches its limit once in some ten thousand values, and estimates are those without it.

use crate::level::estimator::LevelRow;
use crate::level::options::Model;
use crate::level::settings::Settings;
use crate::level::world::World;
use crate::rows::instant::Instant;
use crate::text::short;
use fewbits_filters::calibration::{Number, wrapped};
use fewbits_numerics::Runs;
use std::collections::VecDeque;

/// Factor of the deviations that are tried.
const FACTOR: f64 = 1.5;
/// Squares of `z` count at most so much: one wild value is no other noise.
const CLIP: f64 = 9.0;
/// A sum above this is looked at.
const LIMIT: f64 = 10.0;
/// Values since a sum was 0 from which a noise is found, at least.
const FEWEST: usize = 8;
/// Values from which it is found for the last time.
const MOST: usize = 256;
/// Repetitions of one value that are looked at, at most.
const MOST_REPEATED: u32 = 3;
/// Rows that are kept.
const KEPT: usize = 512;
/// Another noise, or change, explains the rows better by so many nats.
const LIKELIER: f64 = 6.0;
/// The same where it is known that something changed, and of each number.
const LIKELIER_AGAIN: f64 = 1.0;
const EACH: f64 = 1.5;
/// Values of which successive ones are more alike are moved by the level or an offset; they are no noise.
const ALIKE: f64 = 0.35;
/// The same of few values: what chance makes of a right model, in deviations.
const CHANCE: f64 = 2.0;
/// The last values of a sensor that is off are on one side by so many deviations of their mean.
const LAST: usize = 64;
const OFF: f64 = 4.0;
/// A noise is found that is at least this share of the one before.
const LEAST: f64 = 0.1;
/// A range of the level before the first of the rows, in deviations of the noise.
const WIDE: f64 = 10.0;
/// Changes of the noise that are told of a sensor.
const TOLD: usize = 3;

#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    sum: f64,
    /// Row after the last at which it was 0, and number of values since.
    begin: usize,
    values: usize,
}

#[derive(Debug, Clone, Default)]
struct Watch {
    /// For a larger noise, and a smaller one.
    sums: [Sum; 2],
    /// Rows, and differences from the others of the row, or from the forecast if there are none.
    recent: VecDeque<(usize, f64)>,
    /// Row from which its noise is another, and the number of values at which it is found again.
    changed: Option<(usize, usize)>,
    /// Its noise, if it has changed, and times and noises of all changes.
    noise: Option<f64>,
    told: Vec<(String, f64)>,
    runs: Runs,
}

impl Watch {
    fn add(&mut self, row: usize, z: f64, apart: f64) {
        let square = (z * z).min(CLIP);
        let gain = |factor: f64| -factor.ln() + 0.5 * square * (1.0 - 1.0 / (factor * factor));
        for (sum, factor) in self.sums.iter_mut().zip([FACTOR, 1.0 / FACTOR]) {
            if sum.sum <= 0.0 {
                *sum = Sum {
                    begin: row,
                    ..Sum::default()
                };
            }
            sum.sum += gain(factor);
            sum.values += 1;
        }
        self.recent.push_back((row, apart.clamp(-CLIP, CLIP)));
        if self.recent.len() > KEPT {
            self.recent.pop_front();
        }
    }

    /// Whether successive values since a row are alike.
    fn is_alike(&self, begin: usize) -> bool {
        let own: Vec<f64> = self
            .recent
            .iter()
            .filter(|one| one.0 >= begin)
            .map(|one| one.1)
            .collect();
        let products: f64 = own.windows(2).map(|pair| pair[0] * pair[1]).sum();
        let chance = CHANCE / (own.len() as f64).sqrt();
        products > ALIKE.max(chance) * own.iter().map(|z| z * z).sum::<f64>()
    }

    /// Whether the last values are on one side.
    fn is_off(&self) -> bool {
        let (count, sum) = self
            .recent
            .iter()
            .rev()
            .take(LAST)
            .fold((0.0_f64, 0.0), |(count, sum), one| (count + 1.0, sum + one.1));
        sum.abs() > OFF * count.sqrt()
    }

    fn values_since(&self, begin: usize) -> usize {
        self.recent.iter().rev().take_while(|one| one.0 >= begin).count()
    }

    /// Whether a sum is that high that its noise may be another too, if that of another sensor is.
    fn is_suspect(&self) -> bool {
        self.due().is_some() || self.sums.iter().any(|sum| sum.sum > 0.25 * LIMIT)
    }

    /// The row from which its noise may be another, if it is time to look.
    fn due(&self) -> Option<usize> {
        let over = self.sums.iter().filter(|sum| sum.sum > LIMIT && sum.values >= FEWEST);
        let over = over.map(|sum| sum.begin).min();
        over.or_else(|| {
            let (begin, next) = self.changed?;
            (self.values_since(begin) >= next).then_some(begin)
        })
    }
}

/// What a centre shall suppose from a row on.
pub(crate) struct Shift {
    /// Rows from there on.
    pub(crate) rows: Vec<Instant>,
    /// Sensors whose noise is another.
    pub(crate) noises: Vec<(usize, f64)>,
    pub(crate) scale: Option<f64>,
}

/// The noise of each sensor as the last rows show it.
#[derive(Debug, Default)]
pub(crate) struct Followed {
    rows: VecDeque<Instant>,
    /// Number of rows before those that are kept.
    dropped: usize,
    watches: Vec<Watch>,
}

impl Followed {
    /// Adds a row and what a centre made of it. `noises`: of each sensor; none of those that are not looked at.
    pub(crate) fn add(&mut self, instant: &Instant, step: &LevelRow, settings: &Settings, noises: &[Option<f64>]) {
        let row = self.dropped + self.rows.len();
        self.rows.push_back(instant.clone());
        if self.rows.len() > KEPT {
            self.rows.pop_front();
            self.dropped += 1;
        }
        let (mean, variance) = step.forecast;
        let is_out = |sensor: usize| step.events.contains(&("rejected", Some(sensor)));
        let values = instant.reports.iter().enumerate().filter_map(|(i, (sensor, cell))| {
            let qualifier = instant.qualifiers.get(i).copied().unwrap_or_default();
            let value =
                cell.filter(|cell| cell.is_finite() && qualifier.limit.is_none() && qualifier.accuracy.is_none())?;
            let offset = settings.offsets.get(*sensor).copied().unwrap_or(0.0);
            Some((
                *sensor,
                wrapped(value - offset - mean, settings.world.period),
                noises.get(*sensor).copied().flatten()?,
                value,
            ))
        });
        let values: Vec<(usize, f64, f64, f64)> = values.collect();
        let weight = |one: &(usize, f64, f64, f64)| if is_out(one.0) { 0.0 } else { 1.0 / (one.2 * one.2) };
        let (all, pull) = values
            .iter()
            .fold((1.0 / variance, 0.0), |(all, pull), one| (all + weight(one), pull + weight(one) * one.1));
        self.watches
            .resize(self.watches.len().max(noises.len()), Watch::default());
        for one in &values {
            let (others, pull) = (all - weight(one), pull - weight(one) * one.1);
            let z = (one.1 - pull / others) / (1.0 / others + one.2 * one.2).sqrt();
            let beside = values.iter().filter(|other| other.0 != one.0);
            let (count, sum) = beside.fold((0.0, 0.0), |(count, sum), other| {
                (count + 1.0 / (other.2 * other.2), sum + other.1 / (other.2 * other.2))
            });
            let apart = if count > 0.0 {
                (one.1 - sum / count) / (1.0 / count + one.2 * one.2).sqrt()
            } else {
                z
            };
            let watch = &mut self.watches[one.0];
            watch.runs.add(one.3);
            // A sensor that is stuck has no noise.
            if z.is_finite() && watch.runs.repetitions <= MOST_REPEATED {
                watch.add(row, z, apart);
            }
        }
    }

    /// The noise of a sensor, which was `first` in the first rows.
    pub(crate) fn noise(&self, sensor: usize, first: f64) -> f64 {
        self.watches.get(sensor).and_then(|watch| watch.noise).unwrap_or(first)
    }

    /// Whether the noise of a sensor has changed.
    pub(crate) fn has_changed(&self, sensor: usize) -> bool {
        self.watches.get(sensor).is_some_and(|watch| !watch.told.is_empty())
    }

    /// Takes another noise of sensors.
    pub(crate) fn take(&mut self, noises: &[(usize, f64)]) {
        noises
            .iter()
            .for_each(|(sensor, noise)| self.watches[*sensor].noise = Some(*noise));
    }

    /// Tells no longer that the noise of sensors has changed.
    pub(crate) fn forget(&mut self, noises: &[(usize, f64)]) {
        for (sensor, _) in noises {
            let watch = &mut self.watches[*sensor];
            watch.told.pop();
            watch.changed = None;
        }
    }

    /// The last rows.
    pub(crate) fn last(&self) -> impl Iterator<Item = &Instant> {
        self.rows.iter()
    }

    /// What shall be supposed, if it is something else. `noises`: of all sensors; `scale`: the factor of the change's variance.
    /// `used`: whether a sensor's values count.
    pub(crate) fn shift(
        &mut self,
        settings: &Settings,
        names: &[String],
        noises: &[f64],
        used: &[bool],
        scale: f64,
    ) -> Option<Shift> {
        let begin = self.watches.iter().filter_map(Watch::due).min()?.max(self.dropped);
        let rows: Vec<Instant> = self.rows.iter().skip(begin - self.dropped).cloned().collect();
        let of_rows = self.watches.iter().filter(|watch| watch.values_since(begin) > 0);
        let alike = of_rows
            .clone()
            .filter(|watch| watch.is_alike(begin) || watch.is_off())
            .count();
        // Where sensors differ for long, one of them is wrong, which says nothing of noise and change.
        if alike > 0 && of_rows.count() > 1 {
            self.watches
                .iter_mut()
                .for_each(|watch| watch.sums = Default::default());
            return None;
        }
        let is_noise = |sensor: &usize| !self.watches[*sensor].is_alike(begin);
        let all: Vec<usize> = (0..self.watches.len())
            .filter(|sensor| self.watches[*sensor].values_since(begin) > 0)
            .filter(is_noise)
            .collect();
        let suspect: Vec<usize> = all
            .iter()
            .copied()
            .filter(|sensor| self.watches[*sensor].is_suspect())
            .collect();
        let is_again = self
            .watches
            .iter()
            .all(|watch| watch.sums.iter().all(|sum| sum.sum <= LIMIT));
        let least = if is_again { LIKELIER_AGAIN } else { LIKELIER };
        let found = settings.explained(&rows, names, [&suspect, &all], (noises, used, scale), least);
        let time = rows.first().map(|row| row.time.clone()).unwrap_or_default();
        for (sensor, watch) in self.watches.iter_mut().enumerate() {
            let found = found
                .as_ref()
                .and_then(|(noises, _)| noises.iter().find(|one| one.0 == sensor));
            if let Some((_, noise)) = found {
                if watch.changed.is_some_and(|(known, _)| known == begin) {
                    watch.told.pop();
                }
                watch.told.push((time.clone(), *noise));
                watch.changed = Some((begin, 0));
            }
            if found.is_some() || watch.due().is_some() {
                watch.sums = Default::default();
                watch.changed = watch.changed.and_then(|(begin, _)| {
                    let values = watch.values_since(begin);
                    (values < MOST).then_some((begin, 2 * values.max(FEWEST)))
                });
            }
        }
        found.map(|(noises, scale)| Shift { rows, noises, scale })
    }

    /// A line for each sensor whose noise has changed.
    pub(crate) fn hints(&self, settings: &Settings, names: &[String]) -> Vec<String> {
        let line = |(sensor, (watch, name)): (usize, (&Watch, &String))| {
            let told = watch
                .told
                .iter()
                .take(TOLD)
                .map(|(time, noise)| format!("{} from {time} on", short(*noise)));
            let told: Vec<String> = told.collect();
            let more = watch.told.len().saturating_sub(TOLD);
            let more = if more > 0 {
                format!(", and {more} more changes")
            } else {
                String::new()
            };
            let (first, end) = match settings.noises.of(name) {
                Some(stated) => (*stated, "the stated one is kept, and bands are too narrow or too wide"),
                None => (settings.seat(sensor, name).noise, "bands follow it"),
            };
            (!told.is_empty()).then(|| {
                format!("{name}: its noise changes: {} at first, {}{more}; {end}", short(first), told.join(", "))
            })
        };
        self.watches.iter().zip(names).enumerate().filter_map(line).collect()
    }
}

/// Noises of sensors, and the factor of the change's variance, where they are others than before.
type Found = (Vec<(usize, f64)>, Option<f64>);

impl Settings {
    /// What explains the rows better than what is supposed by `least` nats and `EACH` more for each number: other noises of some sensors, another
    /// change, or both.
    fn explained(
        &self,
        rows: &[Instant],
        names: &[String],
        sets: [&[usize]; 2],
        (noises, used, scale): (&[f64], &[bool], f64),
        least: f64,
    ) -> Option<Found> {
        let mut readings = self.readings(rows, names);
        for instant in &mut readings {
            instant.values.retain(|(sensor, _)| used[*sensor]);
        }
        let values = || {
            let all = readings.iter().flat_map(|instant| &instant.values);
            all.filter_map(|(_, one)| one.value())
        };
        let origin = values().next()?;
        let off = |value: f64| wrapped(value - origin, self.world.period).abs();
        let range = values().map(off).fold(0.0, f64::max);
        let largest = noises.iter().copied().fold(0.0, f64::max);
        let world = World {
            prior: (origin, WIDE * largest + range),
            ..self.world
        };
        let supposed = self.world.change * scale.sqrt();
        let may_change = self.world.is_learning && self.world.model != Model::Returning;
        let unknown = |guess: f64, least: f64| Number::Unknown { guess, least };
        let found = |set: &[usize], change: Number| {
            let noise = |(sensor, noise): (usize, &f64)| match set.contains(&sensor) {
                true => unknown(*noise, LEAST * noise),
                false => Number::Known(*noise),
            };
            let all: Vec<Number> = noises.iter().enumerate().map(noise).collect();
            let found = world.calibrate(&readings, change, supposed, &all).ok()?;
            let numbers = set.len() + usize::from(matches!(change, Number::Unknown { .. }));
            let scale = (found.change != supposed).then(|| (found.change / self.world.change).powi(2));
            let noises = set.iter().map(|sensor| (*sensor, found.noises[*sensor])).collect();
            Some((found.log_likelihood - EACH * numbers as f64, (noises, scale)))
        };
        let known = Number::Known(supposed);
        let (now, _): (f64, Found) = found(&[], known)?;
        let mut changes = vec![known];
        if may_change {
            changes.extend([
                Number::Known(self.world.change),
                unknown(supposed, LEAST * self.world.change),
            ]);
        }
        let ways = changes.iter().flat_map(|change| {
            let nothing: &[usize] = &[];
            [nothing, sets[0], sets[1]].map(|set| (set, *change))
        });
        let best = ways
            .filter_map(|(set, change)| found(set, change))
            .max_by(|one, other| one.0.total_cmp(&other.0))?;
        (best.0 > now + least).then_some(best.1)
    }
}
