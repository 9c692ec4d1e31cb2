//! Calibration: what a table of recorded readings says about its sensors and its level, by maximum likelihood over the filter.
//!
//! ```text
//! level     random walk, or Ornstein-Uhlenbeck (a time constant)
//! sensor    gain * level(t - delay) + bias + slope * t + walk(t) + noise; a bit says whether that is above zero: its threshold is -bias
//! p(all readings | parameters) by the moment filter; a reading is wild with probability 1/1000,
//!           and if several in a row are, the level has jumped
//! maximum   by quasi-Newton steps; standard errors from the second derivatives there (observed information)
//! test      standardised innovations must have mean square one and must not repeat
//! ```
//! What the readings cannot tell is refused with the reason, never guessed: nothing says what all sensors have in common, so without a reference
//! faults are relative to one of the sensors.

mod correlations;
mod errors;
mod faults;
mod filter;
mod intervals;
mod likelihood;
mod model;
mod parameters;
mod posterior;
mod problem;
mod readings;
mod search;
mod start;
mod tests_of_fit;
mod wander;

pub use correlations::Correlation;
pub use faults::{Fault, FaultKind};
pub use model::{LevelModel, SensorModel};
pub use parameters::{Estimate, Quantity, Refusal};
pub use posterior::WeightedModel;
pub use tests_of_fit::SensorTest;

use crate::Error;
use crate::calibration::Instant;
use fewbits_numerics::error::refuse;
use model::Scale;
use problem::Problem;
use serde::{Deserialize, Serialize};
use std::cell::Cell;
use std::ops::ControlFlow;

/// Readings of a sensor from which anything is found, at least.
const MIN_READINGS: usize = 12;

/// What is looked for, beside change, noises and biases.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Request {
    /// The sensor that is right: its bias, gain, slope, walk and delay are none.
    pub reference: Option<usize>,
    /// Gains.
    pub gain: bool,
    /// Linear drifts of the offsets.
    pub slope: bool,
    /// Random walks of the offsets.
    pub walk: bool,
    /// Delays.
    pub delay: bool,
    /// The time in which the level returns to its mean.
    pub time_constant: bool,
    /// Noises that are known, by sensor.
    pub noises: Vec<Option<f64>>,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Fit {
    /// The model that fits best.
    pub model: LevelModel,
    /// What else the readings leave possible, as a sample: the errors of the parameters, and faults that may be there or not.
    pub posterior: Vec<WeightedModel>,
    /// The sensor to which biases, gains, slopes and delays are relative: the reference, or one that was chosen.
    pub relative_to: usize,
    /// Every parameter that was found.
    pub estimates: Vec<Estimate>,
    /// Every parameter that was asked for and not found.
    pub refused: Vec<Refusal>,
    /// `ln p` of all readings. Absent values, also those that lie beyond a limit, count nothing.
    pub log_likelihood: f64,
    /// Seconds at which the level jumped.
    pub jumps: Vec<f64>,
    /// Tests of the sensors of values.
    pub tests: Vec<SensorTest>,
    /// Correlations between the noises of two sensors, less what both share with the one to which they are relative.
    pub correlations: Vec<Correlation>,
    /// Faults of sensors that are no parameters, and explain the readings far better.
    #[serde(default)]
    pub faults: Vec<Fault>,
    /// Seconds in which the level returns to a mean, if that was not looked for and makes the readings likelier by 11 nats than a return in ten
    /// times the table's length: walks are seldom.
    pub returns: Option<f64>,
}

impl Fit {
    /// `ln p` of the instants from `begin` on, given those before, averaged over the [`posterior`](Self::posterior): what a forecaster reaches who
    /// allows for the errors of the parameters. The instants before are those that were fitted.
    ///
    /// # Errors
    /// As [`LevelModel::log_likelihood`].
    pub fn log_predictive(&self, instants: &[Instant], begin: usize) -> Result<f64, Error> {
        let before = &instants[..begin.min(instants.len())];
        let of = |one: &WeightedModel| {
            let past = one.model.log_likelihood(before)?.0;
            Ok(one.weight.ln() + one.model.log_likelihood(instants)?.0 - past)
        };
        let all = self.posterior.iter().map(of).collect::<Result<Vec<f64>, Error>>()?;
        let largest = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Ok(largest + all.iter().map(|one| (one - largest).exp()).sum::<f64>().ln())
    }
}

/// Finds the parameters of a level and `sensors` sensors.
///
/// # Errors
/// If instants are out of order, name a sensor outside `0..sensors`, or have a reading that is not finite; if a known noise is not positive or
/// the reference no sensor; if there are fewer than 12 readings, or only bits: they leave unit and zero of the level unknown.
pub fn fit(instants: &[Instant], sensors: usize, request: &Request) -> Result<Fit, Error> {
    fitted(instants, sensors, request, &|| true)
}

/// As [`fit`], and `watch` is asked before every evaluation of the likelihood whether to go on. `None` if it broke.
///
/// # Errors
/// As [`fit`].
pub fn fit_watched(
    instants: &[Instant],
    sensors: usize,
    request: &Request,
    watch: &dyn Fn() -> ControlFlow<()>,
) -> Result<Option<Fit>, Error> {
    let goes_on = Cell::new(true);
    let found = fitted(instants, sensors, request, &|| {
        goes_on.set(goes_on.get() && watch().is_continue());
        goes_on.get()
    });
    if goes_on.get() { found.map(Some) } else { Ok(None) }
}

fn fitted(instants: &[Instant], sensors: usize, request: &Request, goes_on: &dyn Fn() -> bool) -> Result<Fit, Error> {
    Scale::of(instants, &vec![SensorModel::exact(1.0); sensors])?;
    // What does not vary says nothing of the level, and would be taken for it.
    let useless: Vec<Option<Refusal>> = (0..sensors)
        .map(|sensor| {
            let reason = useless(instants, sensor).or_else(|| copied(instants, sensor, sensors, request.reference));
            reason.filter(|_| request.reference != Some(sensor))
        })
        .collect();
    let of_use = |instant: &Instant| Instant {
        seconds: instant.seconds,
        values: instant
            .values
            .iter()
            .filter(|(sensor, _)| useless[*sensor].is_none())
            .copied()
            .collect(),
    };
    let all = instants;
    let kept: Vec<Instant> = all.iter().map(of_use).collect();
    let instants = kept.as_slice();
    let series: Vec<Vec<(f64, f64)>> = (0..sensors).map(|sensor| values_of(instants, sensor)).collect();
    let (relative_to, mut refused) = anchor(&series, all, request)?;
    let starts = start::starts(&series, instants, relative_to, request)?;
    let scale = Scale::of(instants, &starts[0].sensors)?;
    let mut free = vec![Quantity::Change];
    let reason = |quantity, reason: &str| Refusal {
        quantity,
        reason: reason.to_owned(),
    };
    for sensor in 0..sensors {
        if let Some(reason) = &useless[sensor] {
            refused.push(reason.clone());
            continue;
        }
        if request.noises.get(sensor).copied().flatten().is_none() {
            free.push(Quantity::Noise(sensor));
        }
        if sensor == relative_to {
            continue;
        }
        free.push(Quantity::Bias(sensor));
        let is_bits = series[sensor].is_empty();
        for (is_asked, quantity) in [
            (request.gain, Quantity::Gain(sensor)),
            (request.slope, Quantity::Slope(sensor)),
            (request.delay, Quantity::Delay(sensor)),
        ] {
            if is_asked && is_bits && matches!(quantity, Quantity::Gain(_)) {
                refused.push(reason(quantity, "bits tell only the ratio of gain and noise: the gain is taken as 1"));
            } else if is_asked {
                free.push(quantity);
            }
        }
    }
    let mut problem = Problem::new(instants, scale, starts, free).asking(goes_on);
    problem.solve();
    let bits: Vec<usize> = (0..sensors)
        .filter(|sensor| useless[*sensor].is_none() && series[*sensor].is_empty())
        .collect();
    let mut faults = problem.take_absent(instants, &bits);
    if request.time_constant {
        problem.try_time_constant(&mut refused);
    }
    if request.walk {
        problem.try_walks(relative_to, &mut refused);
    }
    if request.slope {
        problem.try_without_slopes(request.walk, &mut refused);
    }
    let spread = problem.spread();
    let mut estimates = problem.errors(&spread, &mut refused);
    let posterior = problem.posterior(&spread);
    // Of a long table the likelihood is a parabola, and the sample small.
    if problem.part.is_none() {
        estimates.iter_mut().for_each(|one| posterior::widen(one, &posterior));
    }
    problem.limits(&spread, &mut estimates);
    let log_likelihood = problem.model.log_likelihood(instants)?.0;
    let mut residuals = vec![Vec::new(); sensors];
    let scored = |sensor: usize, score: f64| residuals[sensor].push(score);
    problem.model.run(&problem.readings, &problem.scale, scored);
    let jumps = problem.model.jumps(&problem.readings, &problem.scale);
    let counts: Vec<usize> = problem.readings.by_sensor.iter().map(Vec::len).collect();
    let tests = tests_of_fit::of(&residuals, &counts);
    let correlations = correlations::of(instants, &problem.model, relative_to);
    faults.extend(problem.faults(instants, &bits, relative_to));
    let model = problem.model.clone();
    let returns = if request.time_constant { None } else { problem.returns() };
    Ok(Fit {
        model,
        posterior,
        relative_to,
        estimates,
        refused,
        log_likelihood,
        jumps,
        tests,
        correlations,
        faults,
        returns,
    })
}

fn values_of(instants: &[Instant], sensor: usize) -> Vec<(f64, f64)> {
    let of = |instant: &Instant| -> Vec<(f64, f64)> {
        let own = instant.values.iter().filter(|(other, _)| *other == sensor);
        own.filter_map(|(_, reading)| Some((instant.seconds, reading.middle()?)))
            .collect()
    };
    instants.iter().flat_map(of).collect()
}

/// Why nothing is found from a sensor's readings, if so: they are left out.
fn useless(instants: &[Instant], sensor: usize) -> Option<Refusal> {
    let mut own = instants
        .iter()
        .flat_map(|instant| &instant.values)
        .filter(|(other, _)| *other == sensor);
    let count = own.clone().count();
    let first = own.next();
    let (quantity, reason) = if count < MIN_READINGS {
        (Quantity::Noise(sensor), "it has fewer than 12 readings, which are left out")
    } else if own.all(|one| Some(one) == first) {
        (Quantity::Bias(sensor), "its readings are all alike, and left out")
    } else {
        return None;
    };
    Some(Refusal {
        quantity,
        reason: reason.to_owned(),
    })
}

/// Whether a sensor repeats another one to the last digit: such readings are no second measurement.
fn copied(instants: &[Instant], sensor: usize, sensors: usize, reference: Option<usize>) -> Option<Refusal> {
    let repeats = |other: &usize| {
        instants.iter().all(|instant| {
            let of = |sensor: usize| instant.values.iter().filter(move |one| one.0 == sensor);
            let own = of(sensor).map(|one| one.1.middle());
            own.clone().next().is_none()
                || (own.clone().all(|one| one.is_some()) && own.eq(of(*other).map(|one| one.1.middle())))
        })
    };
    // Of sensors that repeat each other the first is kept.
    let before = (0..sensors).filter(|other| *other < sensor || reference == Some(*other));
    before
        .filter(|other| *other != sensor)
        .find(repeats)
        .map(|other| Refusal {
            quantity: Quantity::Bias(sensor),
            reason: format!("its readings repeat those of sensor {other}, and are left out"),
        })
}

/// The sensor to which all else is relative, and what cannot be found therefore.
/// `all`: with the readings that are left out.
fn anchor(series: &[Vec<(f64, f64)>], all: &[Instant], request: &Request) -> Result<(usize, Vec<Refusal>), Error> {
    let of_values = |sensor: &usize| series[*sensor].len() >= MIN_READINGS;
    if let Some(reference) = request.reference {
        if reference >= series.len() || !of_values(&reference) {
            return refuse("reference", reference, "a sensor of at least 12 values");
        }
        return Ok((reference, Vec::new()));
    }
    let Some(first) = (0..series.len())
        .rev()
        .filter(of_values)
        .max_by_key(|sensor| series[*sensor].len())
    else {
        let mut readings = all.iter().flat_map(|instant| &instant.values).peekable();
        if readings.peek().is_some() && readings.all(|(_, reading)| reading.middle().is_none()) {
            return refuse(
                "readings",
                "bits",
                "a reference, or a sensor of values: bits alone leave unit and zero of the level unknown",
            );
        }
        return refuse("readings", "too few", "at least 12 values of a sensor that vary");
    };
    let mut refused = vec![(true, Quantity::Bias(first))];
    refused.extend([
        (request.gain, Quantity::Gain(first)),
        (request.slope, Quantity::Slope(first)),
        (request.walk, Quantity::Walk(first)),
        (request.delay, Quantity::Delay(first)),
    ]);
    let reason = if series.len() == 1 {
        "with one sensor and no reference it cannot be told from the level"
    } else {
        "nothing says what all sensors have in common: those of the others are relative to this one"
    };
    let refused = refused
        .into_iter()
        .filter(|(is_asked, _)| *is_asked)
        .map(|(_, quantity)| Refusal {
            quantity,
            reason: reason.to_owned(),
        });
    Ok((first, refused.collect()))
}
