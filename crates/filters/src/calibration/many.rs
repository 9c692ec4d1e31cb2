//! Noises of many sensors, each found from its own readings. The likelihood of all readings for each number by itself would take a time that grows
//! with the square of their number.

use super::search::Search;
use super::{Forecast, Instant, Level, Number, Reading, Steps, WILD, widen, wrapped};
use crate::{Error, assumed_density};
use fewbits_core::Evolution;

/// From more sensors on, what the others say of the level hardly depends on the noise of one.
const MANY: usize = 20;
/// The level has jumped if so large a share of the readings of an instant is wild, and there are three at least.
const MOST: f64 = 0.5;
const FEWEST: usize = 3;

/// A reading, with mean and variance of the level given all readings before it and the other ones of its instant.
pub(super) struct Beside {
    reading: Reading,
    mean: f64,
    variance: f64,
}

/// These of each sensor.
pub(super) type Others = Vec<Vec<Beside>>;

impl<W, E, const D: usize> Level<'_, W, D>
where
    W: Fn(f64) -> Result<E, Error>,
    E: Evolution<D>,
{
    /// What the others say of the level beside each reading; nothing if they are few.
    pub(super) fn others(&self, instants: &[Instant], range: f64, change: f64, noises: &[f64]) -> Option<Others> {
        if noises.len() <= MANY {
            return None;
        }
        let world = (self.world)(change).ok()?;
        let mut belief = *self.prior;
        let mut steps = Steps::new(&world, instants.first()?.seconds);
        let mut found: Others = noises.iter().map(|_| Vec::new()).collect();
        for instant in instants {
            if let Some(step) = steps.to(instant.seconds).ok()? {
                belief = assumed_density::predict(step, &belief);
            }
            let before = belief;
            let mut forecasts: Vec<Forecast> = Vec::with_capacity(instant.values.len());
            let said = self.updated(&mut belief, instant, range, noises, |one| forecasts.push(one))?;
            let wild = forecasts.iter().filter(|one| one.right < MOST).count();
            if forecasts.len() >= FEWEST && wild as f64 > MOST * forecasts.len() as f64 {
                belief = before;
                widen(&mut belief, said.farthest);
                forecasts.clear();
                self.updated(&mut belief, instant, range, noises, |one| forecasts.push(one))?;
            }
            // What the readings behind one say, as precision and mean: nothing is subtracted, which would leave rounding errors.
            let (mut precision, mut mean) = (0.0, 0.0);
            for ((sensor, reading), forecast) in instant.values.iter().zip(&forecasts).rev() {
                let variance = 1.0 / (1.0 / forecast.variance + precision);
                found[*sensor].push(Beside {
                    reading: *reading,
                    mean: forecast.mean + variance * precision * wrapped(mean - forecast.mean, self.period),
                    variance,
                });
                if let Some(value) = reading.middle() {
                    let width = reading.width(noises[*sensor]);
                    let own = forecast.right / (width * width);
                    if precision == 0.0 {
                        mean = value;
                    }
                    precision += own;
                    if precision > 0.0 {
                        mean += own / precision * wrapped(value - mean, self.period);
                    }
                }
            }
        }
        Some(found)
    }

    /// The search for the noise of one sensor, axis 1.
    pub(super) fn one<'a>(
        &'a self,
        others: &'a Others,
        noises: &'a [Number],
        axis: usize,
        range: f64,
        shift: f64,
    ) -> Search<'a, impl Fn(f64, &[f64]) -> f64 + 'a> {
        let log_density = move |one: &Beside, noise: f64| {
            let said = one.reading.said(one.mean, one.variance, noise, self.period)?;
            Some(said.doubted(WILD, one.reading.wild(WILD, range)).density.ln())
        };
        let own = &others[axis - 1];
        let log_likelihood = move |_: f64, noise: &[f64]| {
            let all: Option<f64> = own.iter().map(|one| log_density(one, noise[0])).sum();
            all.unwrap_or(f64::NEG_INFINITY)
        };
        let mut search = Search {
            change: Number::Known(1.0),
            noises: &noises[axis - 1..axis],
            shifts: vec![0.0, shift],
            best: f64::NEG_INFINITY,
            log_likelihood,
        };
        search.best = search.at(&search.shifts);
        search
    }
}
