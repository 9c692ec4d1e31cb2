//! Values that a table lacks because they are large, or small.

use super::super::problem::Problem;
use super::super::readings::Told;
use super::{FEWEST, Fault, FaultKind};
use crate::calibration::{Instant, Reading};

/// Nats by which absent values that lie beyond the outermost one explain the readings better. The number of sensors that are tested is added as its
/// logarithm.
const CERTAIN: f64 = 6.0;
/// Absent values from which this is found, at least.
const FEWEST_ABSENT: usize = 4;
/// Share of the absent values that are absent by chance.
const BY_CHANCE: [f64; 2] = [0.02, 0.3];
/// Logarithm of the probability with which a value beyond the limit is kept.
const KEPT: f64 = -7.0;
/// A gap between rows is a multiple of the usual one, up to this share of it, in this share of all gaps.
const IRREGULAR: f64 = 0.1;
const MOSTLY: f64 = 0.9;

impl Problem<'_> {
    /// Finds the sensors whose absent values lie beyond the outermost one, and takes these values for such from now on: for readings that say only so.
    pub(in super::super) fn take_absent(&mut self, instants: &[Instant], bits: &[usize]) -> Vec<Fault> {
        let regular = self.regular(instants);
        let instants = regular.as_deref().unwrap_or(instants);
        let of_values = (0..self.model.sensors.len()).filter(|sensor| !bits.contains(sensor));
        let all: Vec<(usize, Gaps)> = of_values
            .filter_map(|sensor| Some((sensor, Gaps::of(instants, sensor)?)))
            .collect();
        let limit = CERTAIN + (all.len().max(1) as f64).ln();
        let best = |(sensor, gaps): &(usize, Gaps)| {
            let sides = [FaultKind::AbsentAbove, FaultKind::AbsentBelow];
            let found = sides.map(|kind| self.absent_beyond(instants, *sensor, gaps, kind));
            let certain = found.into_iter().flatten().filter(|one| one.0.evidence > limit);
            certain.max_by(|one, other| one.0.evidence.total_cmp(&other.0.evidence))
        };
        let (faults, absent): (Vec<Fault>, Vec<Vec<Told>>) = all.iter().filter_map(best).unzip();
        if !faults.is_empty() {
            self.replace(self.readings.with(absent.into_iter().flatten()));
        }
        faults
    }

    /// How well values beyond a limit explain those that are absent, and the readings that these are.
    fn absent_beyond(
        &self,
        instants: &[Instant],
        sensor: usize,
        gaps: &Gaps,
        kind: FaultKind,
    ) -> Option<(Fault, Vec<Told>)> {
        let mut values: Vec<f64> = gaps.values.iter().flatten().copied().collect();
        values.sort_by(f64::total_cmp);
        if kind == FaultKind::AbsentAbove {
            values.reverse();
        }
        let plain = self.log_likelihood_of(&self.readings, &self.model) + gaps.by_chance();
        let mut best: Option<(Fault, Vec<Told>)> = None;
        // The outermost value may be a wild one.
        for (beyond, limit) in values.iter().take(2).enumerate() {
            let (lower, upper) = match kind {
                FaultKind::AbsentAbove => (*limit, f64::INFINITY),
                _ => (f64::NEG_INFINITY, *limit),
            };
            let reading = Reading::Within { lower, upper };
            for share in BY_CHANCE {
                let absent = gaps.absent(instants, sensor, reading, share);
                let readings = self.readings.with(absent.iter().copied());
                let kept = beyond as f64 * KEPT;
                let evidence = self.log_likelihood_of(&readings, &self.model) + gaps.present(share) + kept - plain;
                if best.as_ref().is_none_or(|(best, _)| evidence > best.evidence) {
                    let size = *limit;
                    let fault = Fault {
                        sensor,
                        kind,
                        size,
                        evidence,
                    };
                    best = Some((fault, absent));
                }
            }
        }
        best
    }

    /// The instants with those that a regular table lacks; `None` if it lacks none, or is not regular.
    fn regular(&self, instants: &[Instant]) -> Option<Vec<Instant>> {
        let steps = |pair: &[Instant]| {
            let ratio = (pair[1].seconds - pair[0].seconds) / self.interval;
            let whole = ratio.round();
            ((ratio - whole).abs() < IRREGULAR).then_some(whole)
        };
        let all: Vec<Option<f64>> = instants.windows(2).map(steps).collect();
        let regular = all.iter().flatten().filter(|steps| **steps >= 1.0);
        let lacking: f64 = regular.clone().map(|steps| steps - 1.0).sum();
        let is_of_use = regular.count() as f64 >= MOSTLY * all.len() as f64;
        if !is_of_use || lacking == 0.0 || lacking > instants.len() as f64 {
            return None;
        }
        let mut more = Vec::with_capacity(instants.len() + lacking as usize);
        for (instant, steps) in instants.iter().zip(all.into_iter().chain([None])) {
            more.push(instant.clone());
            let between = (1..steps.unwrap_or(1.0) as usize).map(|step| Instant {
                seconds: instant.seconds + step as f64 * self.interval,
                values: Vec::new(),
            });
            more.extend(between);
        }
        Some(more)
    }
}

/// Where a sensor has values, between its first and its last, and how often it has none by chance: after a value, and after none.
struct Gaps {
    /// The first of the instants.
    begin: usize,
    values: Vec<Option<f64>>,
    after_value: f64,
    after_none: f64,
}

impl Gaps {
    /// `None` of a sensor that has nearly all of its values, or few.
    fn of(instants: &[Instant], sensor: usize) -> Option<Self> {
        let value = |instant: &Instant| {
            let own = instant.values.iter().find(|one| one.0 == sensor)?;
            Some(own.1.value())
        };
        let all: Vec<Option<Option<f64>>> = instants.iter().map(value).collect();
        let begin = all.iter().position(Option::is_some)?;
        let end = all.iter().rposition(Option::is_some)?;
        // A reading that is no value is none that is absent.
        let all = &all[begin..=end];
        let absent = all.iter().filter(|one| one.is_none()).count();
        if absent < FEWEST_ABSENT || all.len() < FEWEST || 2 * absent > all.len() || all.contains(&Some(None)) {
            return None;
        }
        let values: Vec<Option<f64>> = all.iter().map(|one| one.flatten()).collect();
        let share = |is_after: fn(&Option<f64>) -> bool| {
            let after = values.windows(2).filter(|pair| is_after(&pair[0]));
            let absent = after.clone().filter(|pair| pair[1].is_none()).count();
            absent as f64 / (after.count() as f64).max(1.0)
        };
        Some(Self {
            begin,
            after_value: share(Option::is_some),
            after_none: share(Option::is_none),
            values,
        })
    }

    /// Of each instant but the first: whether there is a value, and the probability of none by chance.
    fn chances(&self) -> impl Iterator<Item = (bool, f64)> {
        self.values.windows(2).map(|pair| {
            let chance = if pair[0].is_some() {
                self.after_value
            } else {
                self.after_none
            };
            (pair[1].is_some(), chance)
        })
    }

    /// Logarithm of the probability that values are absent where they are, by chance.
    fn by_chance(&self) -> f64 {
        let absent = self.chances().filter(|one| !one.0).map(|one| one.1.ln());
        self.present(1.0) + absent.sum::<f64>()
    }

    /// The same of the values that are there, if only this share of the others is absent by chance.
    fn present(&self, share: f64) -> f64 {
        let present = self.chances().filter(|one| one.0);
        present.map(|one| (-share * one.1).ln_1p()).sum()
    }

    /// A reading in place of each absent value, unless that is absent by chance.
    fn absent(&self, instants: &[Instant], sensor: usize, reading: Reading, share: f64) -> Vec<Told> {
        let after = &instants[self.begin + 1..];
        let absent = after.iter().zip(self.chances()).filter(|(_, chance)| !chance.0);
        let told = absent.map(|(instant, (_, chance))| Told {
            seconds: instant.seconds,
            sensor,
            reading,
            chance: Some((share * chance, share * chance)),
        });
        told.collect()
    }
}
