//! Calibration: what a table of recorded readings says about its sensors and its level.

use crate::centre::FusionCentre;
use crate::error::{Called, Outcome, refused};
use crate::given::named;
use crate::instants::{self, Long};
use crate::model::Model;
use crate::parts::{Parts, Tests};
use crate::seat::{Missing, Reads, Seat, Sends};
use crate::stored::{self, Reduced};
use crate::table::{Given, Table, doubles};
use arrow_array::{ArrayRef, BooleanArray, Int64Array, StringArray};
use fewbits_filters::calibration::{Instant, Reading};
use fewbits_filters::fit::{self as library, Quantity, Request};
use fewbits_models::ContinuousLinear;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};

/// What `fit` found.
#[pyclass(frozen, module = "fewbits")]
#[derive(Serialize, Deserialize)]
pub(crate) struct Fit {
    found: library::Fit,
    names: Vec<String>,
    /// Which sensors send bits.
    bits: Vec<bool>,
    /// Mean and deviation of the level at the first time.
    first: (f64, f64),
}

/// Calibration by maximum likelihood: noises, offsets and the change of the level, from recorded readings.
///
/// Each column is a sensor of one level, which wanders; or with `by` and `value` each row is a reading, the sensor's name in column `by`.
/// `sensors` are the columns to use (all of numbers if left out). A sensor reads `gain * level(t - delay) + offset + slope * t + walk(t) + noise`.
/// `find` has what is looked for beside noises, offsets and change: "gain", "slope", "walk", "delay", and "time_constant" of a level that
/// returns to its mean. `reference` is a sensor that is right; without it all is relative to one of the others, and what all have in common
/// cannot be found. `bits` are sensors whose readings are 1 above an unknown threshold, otherwise 0 or -1. `noise` has deviations that are
/// known.
///
/// Raises `fewbits.ArgumentError` if there are fewer than 12 readings of every sensor of values.
///
/// >>> import numpy as np, polars as pl, fewbits as fb
/// >>> rng = np.random.default_rng(2)
/// >>> level = np.cumsum(0.3 * rng.standard_normal(500))
/// >>> table = pl.DataFrame({
/// ...     "t": np.arange(500.0), "a": level + 0.2 * rng.standard_normal(500), "b": level + 2.0 + 0.4 * rng.standard_normal(500),
/// ... })
/// >>> found = fb.fit(table, time="t", reference="a")
/// >>> found.parameters["quantity"].tolist(), found.parameters["sensor"].tolist()
/// (['change', 'noise', 'noise', 'offset'], ['', 'a', 'b', 'b'])
/// >>> bool((abs(found.parameters["value"] - [0.3, 0.2, 0.4, 2.0]) < 4 * found.parameters["standard_error"]).all())
/// True
/// >>> result = found.centre(send="word:3").run(table, time="t")
/// >>> bool(np.sqrt(np.mean((result["x0"] - level)[20:] ** 2)) < 0.3)
/// True
#[pyfunction]
#[pyo3(signature = (table, *, time, by=None, value=None, sensors=None, reference=None, find=Vec::new(), bits=Vec::new(), noise=BTreeMap::new()))]
#[allow(clippy::too_many_arguments)]
pub(crate) fn fit(
    py: Python<'_>,
    table: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = named)] time: &str,
    #[pyo3(from_py_with = named)] by: Option<&str>,
    #[pyo3(from_py_with = named)] value: Option<&str>,
    #[pyo3(from_py_with = named)] sensors: Option<Vec<String>>,
    #[pyo3(from_py_with = named)] reference: Option<String>,
    #[pyo3(from_py_with = named)] find: Vec<String>,
    #[pyo3(from_py_with = named)] bits: Vec<String>,
    #[pyo3(from_py_with = named)] noise: BTreeMap<String, f64>,
) -> Outcome<Fit> {
    let given = Given::read(table)?;
    let long = match (by, value) {
        (Some(by), Some(value)) => Some(Long { by, value }),
        (None, None) => None,
        _ => return refused("by", "given without `value`, or that without it", "both, or neither"),
    };
    let names = match (sensors, by) {
        (Some(sensors), _) => sensors,
        (None, None) => given.numeric(time)?,
        (None, Some(by)) => {
            let mut names = given.texts(by)?;
            names.sort();
            names.dedup();
            names
        }
    };
    let at = |argument: &'static str, name: &String| match names.iter().position(|known| known == name) {
        Some(at) => Ok(at),
        None => refused(argument, format!("'{name}'"), format!("one of {}", names.join(", "))),
    };
    let mut request = Request {
        reference: reference.as_ref().map(|name| at("reference", name)).transpose()?,
        noises: vec![None; names.len()],
        ..Request::default()
    };
    for (name, deviation) in &noise {
        request.noises[at("noise", name)?] = Some(*deviation);
    }
    for word in &find {
        *match word.as_str() {
            "gain" => &mut request.gain,
            "slope" => &mut request.slope,
            "walk" => &mut request.walk,
            "delay" => &mut request.delay,
            "time_constant" => &mut request.time_constant,
            other => {
                let expected = "'gain', 'slope', 'walk', 'delay' or 'time_constant'";
                return refused("find", format!("'{other}'"), expected);
            }
        } = true;
    }
    let mut is_bits = vec![false; names.len()];
    for name in &bits {
        is_bits[at("bits", name)?] = true;
    }
    let seats: Vec<Seat> = names.iter().map(|name| seat(name, 1.0)).collect();
    let (rows, _) = instants::of(&given, time, long, &seats, None)?;
    let rows = rows
        .iter()
        .map(|row| readings(&row, &is_bits, &names))
        .collect::<Outcome<Vec<_>>>()?;
    let interrupted = Mutex::new(None);
    let watch = || match Python::attach(|py| py.check_signals()) {
        Ok(()) => ControlFlow::Continue(()),
        Err(error) => {
            if let Ok(mut kept) = interrupted.lock() {
                *kept = Some(error);
            }
            ControlFlow::Break(())
        }
    };
    let found = py
        .detach(|| library::fit_watched(&rows, names.len(), &request, &watch))
        .called(&[("noises", "noise")])?;
    let Some(found) = found else {
        let error = interrupted.into_inner().ok().flatten();
        return Err(error.unwrap_or_else(|| PyKeyboardInterrupt::new_err(())).into());
    };
    let first = found.model.first_level(&rows)?;
    Ok(Fit {
        found,
        names,
        bits: is_bits,
        first,
    })
}

fn seat(name: &str, variance: f64) -> Seat {
    Seat {
        name: name.to_owned(),
        reads: Reads::Axis(0),
        variance,
        send: Sends::Value,
        loss: 0.0,
        offset: 0.0,
        missing: Missing::Unknown,
    }
}

fn readings(row: &instants::Instant, bits: &[bool], names: &[String]) -> Outcome<Instant> {
    let reading = |(sensor, cell): &(usize, Option<f64>)| {
        let reading = match (bits[*sensor], (*cell)?) {
            (false, cell) => Ok(Reading::from(cell)),
            (true, 1.0) => Ok(Reading::bit(true)),
            (true, 0.0 | -1.0) => Ok(Reading::bit(false)),
            (true, cell) => refused("bits", format!("{cell} in '{}'", names[*sensor]), "1, or 0 or -1"),
        };
        Some(reading.map(|reading| (*sensor, reading)))
    };
    Ok(Instant {
        seconds: row.seconds,
        values: row.samples.iter().filter_map(reading).collect::<Outcome<_>>()?,
    })
}

#[pymethods]
impl Fit {
    #[staticmethod]
    fn _restored(state: &Bound<'_, PyAny>) -> Outcome<Self> {
        let state: Self = stored::state(state)?;
        if !state.is_valid() {
            return refused("state", format!("{} sensors", state.names.len()), "that of a fit");
        }
        Ok(state)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> Outcome<Reduced<'py, (Bound<'py, PyBytes>,)>> {
        Ok((stored::maker::<Self>(py)?, (stored::bytes(py, self)?,)))
    }

    /// Every parameter that was found: quantity, sensor (empty of the level), value and standard error. Of a sensor of bits the threshold is
    /// found instead of an offset.
    #[getter]
    fn parameters(&self) -> Outcome<Table> {
        let estimates = &self.found.estimates;
        let (quantities, sensors) = self.titles(estimates.iter().map(|one| one.quantity));
        let signed = |one: &library::Estimate| {
            if self.is_threshold(one.quantity) {
                -one.value
            } else {
                one.value
            }
        };
        Table::new(vec![
            ("quantity".to_owned(), quantities),
            ("sensor".to_owned(), sensors),
            ("value".to_owned(), doubles(estimates.iter().map(signed).collect())),
            ("standard_error".to_owned(), doubles(estimates.iter().map(|one| one.standard_error).collect())),
        ])
    }

    /// Every parameter that was found, with the limits of an interval that has it in 95 of a hundred tables: 1.96 standard errors to either side, or
    /// farther to one side.
    #[getter]
    fn limits(&self) -> Outcome<Table> {
        let estimates = &self.found.estimates;
        let (quantities, sensors) = self.titles(estimates.iter().map(|one| one.quantity));
        let limits = |one: &library::Estimate| match one.interval() {
            (low, high) if self.is_threshold(one.quantity) => (-high, -low),
            limits => limits,
        };
        let (low, high): (Vec<f64>, Vec<f64>) = estimates.iter().map(limits).unzip();
        Table::new(vec![
            ("quantity".to_owned(), quantities),
            ("sensor".to_owned(), sensors),
            ("low".to_owned(), doubles(low)),
            ("high".to_owned(), doubles(high)),
        ])
    }

    /// Every parameter that was looked for and not found, and why.
    #[getter]
    fn refused(&self) -> Outcome<Table> {
        let refused = &self.found.refused;
        let (quantities, sensors) = self.titles(refused.iter().map(|one| one.quantity));
        Table::new(vec![
            ("quantity".to_owned(), quantities),
            ("sensor".to_owned(), sensors),
            ("reason".to_owned(), texts(refused.iter().map(|one| one.reason.clone()))),
        ])
    }

    /// Whether the model explains each sensor of values: its innovations, divided by their predicted deviations, have mean square one and do
    /// not repeat. `size` and `repetition` say by how many deviations they fail; each test fails once in a thousand right tables.
    #[getter]
    fn tests(&self) -> Outcome<Table> {
        let tests = &self.found.tests;
        let whole = |of: fn(&library::SensorTest) -> usize| -> ArrayRef {
            Arc::new(Int64Array::from(tests.iter().map(|test| of(test) as i64).collect::<Vec<i64>>()))
        };
        let number = |of: fn(&library::SensorTest) -> f64| doubles(tests.iter().map(of).collect());
        let passed: Vec<bool> = tests.iter().map(library::SensorTest::is_passed).collect();
        Table::new(vec![
            ("sensor".to_owned(), texts(tests.iter().map(|test| self.names[test.sensor].clone()))),
            ("values".to_owned(), whole(|test| test.values)),
            ("mean_square".to_owned(), number(|test| test.mean_square)),
            ("size".to_owned(), number(|test| test.size)),
            ("repetition".to_owned(), number(|test| test.repetition)),
            ("wild".to_owned(), whole(|test| test.wild)),
            ("passed".to_owned(), Arc::new(BooleanArray::from(passed))),
        ])
    }

    /// Correlations between the noises of two sensors; only with a reference.
    #[getter]
    fn correlations(&self) -> Outcome<Table> {
        let all = &self.found.correlations;
        Table::new(vec![
            ("first".to_owned(), texts(all.iter().map(|one| self.names[one.sensors.0].clone()))),
            ("second".to_owned(), texts(all.iter().map(|one| self.names[one.sensors.1].clone()))),
            ("value".to_owned(), doubles(all.iter().map(|one| one.value).collect())),
            ("standard_error".to_owned(), doubles(all.iter().map(|one| one.standard_error).collect())),
        ])
    }

    /// Faults of sensors that are no parameters, and explain the readings far better: sensor, kind (`inverted-bits`, `hysteresis`, `lag`, `absent-above`
    /// or `absent-below`), size, and evidence in nats.
    #[getter]
    fn faults(&self) -> Outcome<Table> {
        let all = &self.found.faults;
        Table::new(vec![
            ("sensor".to_owned(), texts(all.iter().map(|one| self.names[one.sensor].clone()))),
            ("kind".to_owned(), texts(all.iter().map(|one| one.kind.name().to_owned()))),
            ("size".to_owned(), doubles(all.iter().map(|one| one.size).collect())),
            ("evidence".to_owned(), doubles(all.iter().map(|one| one.evidence).collect())),
        ])
    }

    /// The sensor to which offsets, gains, slopes and delays are relative: the reference, or one that was chosen.
    #[getter]
    fn relative_to(&self) -> &str {
        &self.names[self.found.relative_to]
    }

    /// Logarithm of the likelihood of all readings.
    #[getter]
    fn log_likelihood(&self) -> f64 {
        self.found.log_likelihood
    }

    /// Mean and deviation of the level at the first time, before any reading.
    #[getter]
    fn first(&self) -> (f64, f64) {
        self.first
    }

    /// The level: a random walk, or one that returns to its mean.
    #[getter]
    fn model(&self) -> Outcome<Model> {
        let level = &self.found.model;
        let density = level.change * level.change;
        Ok(Model::of(match level.time_constant {
            None => ContinuousLinear::random_walk(density)?,
            Some(seconds) => ContinuousLinear::ornstein_uhlenbeck(level.mean, seconds, 0.5 * density * seconds)?,
        }))
    }

    /// A fusion centre of this level and these sensors, at the time of the first row, which `send` as in `FusionCentre.join`.
    ///
    /// Raises `fewbits.ArgumentError` if a sensor has what a centre does not know: a slope, a walk, a delay, or bits of its own.
    #[pyo3(signature = (*, send="value", learn_noise=true, health="exclude", failures=1e-4, window=0.0))]
    fn centre(
        &self,
        #[pyo3(from_py_with = named)] send: &str,
        #[pyo3(from_py_with = named)] learn_noise: bool,
        #[pyo3(from_py_with = named)] health: &str,
        #[pyo3(from_py_with = named)] failures: f64,
        #[pyo3(from_py_with = named)] window: f64,
    ) -> Outcome<FusionCentre> {
        let send = Sends::parsed(send)?;
        let sensors = self.names.iter().zip(&self.found.model.sensors).zip(&self.bits);
        let seats = sensors.map(|((name, sensor), bits)| {
            for (is_there, what) in [
                (sensor.slope != 0.0, "a slope"),
                (sensor.walk != 0.0, "a walk"),
                (sensor.delay != 0.0, "a delay"),
                (*bits, "bits of a threshold of its own"),
            ] {
                if is_there {
                    let expected = "sensors of values with noise, offset and gain alone";
                    return refused("sensors", format!("'{name}' with {what}"), expected);
                }
            }
            Ok(Seat {
                reads: Reads::Sum(vec![sensor.gain]),
                send,
                offset: sensor.bias,
                ..seat(name, sensor.noise * sensor.noise)
            })
        });
        FusionCentre::of(Parts {
            mean: vec![self.first.0],
            covariance: vec![self.first.1 * self.first.1],
            model: self.model()?,
            learn_noise,
            tests: Tests::parsed(health)?,
            failures,
            window,
            seats: seats.collect::<Outcome<_>>()?,
            origin: None,
            state: None,
        })
    }

    fn __repr__(&self) -> String {
        format!("Fit({} parameters of {})", self.found.estimates.len(), self.names.join(", "))
    }
}

impl Fit {
    /// Whether every number of a sensor is that of one.
    fn is_valid(&self) -> bool {
        let (found, count) = (&self.found, self.names.len());
        let of_sensor = |quantity: Quantity| parts(quantity).1.is_none_or(|sensor| sensor < count);
        [self.bits.len(), found.model.sensors.len()] == [count; 2]
            && found.relative_to < count
            && found.estimates.iter().all(|one| of_sensor(one.quantity))
            && found.refused.iter().all(|one| of_sensor(one.quantity))
            && found.tests.iter().all(|test| test.sensor < count)
            && found
                .correlations
                .iter()
                .all(|one| one.sensors.0.max(one.sensors.1) < count)
            && found.faults.iter().all(|one| one.sensor < count)
    }

    fn is_threshold(&self, quantity: Quantity) -> bool {
        matches!(quantity, Quantity::Bias(sensor) if self.bits[sensor])
    }

    fn titles(&self, quantities: impl Iterator<Item = Quantity>) -> (ArrayRef, ArrayRef) {
        let of = |quantity: Quantity| match parts(quantity) {
            (_, sensor) if self.is_threshold(quantity) => ("threshold", sensor),
            parts => parts,
        };
        let name = |sensor: Option<usize>| sensor.map_or(String::new(), |sensor| self.names[sensor].clone());
        let (words, sensors): (Vec<_>, Vec<_>) = quantities.map(of).unzip();
        (texts(words.into_iter().map(str::to_owned)), texts(sensors.into_iter().map(name)))
    }
}

/// Its name, and the sensor it is of.
fn parts(quantity: Quantity) -> (&'static str, Option<usize>) {
    match quantity {
        Quantity::Change => ("change", None),
        Quantity::TimeConstant => ("time_constant", None),
        Quantity::Mean => ("mean", None),
        Quantity::Noise(sensor) => ("noise", Some(sensor)),
        Quantity::Bias(sensor) => ("offset", Some(sensor)),
        Quantity::Gain(sensor) => ("gain", Some(sensor)),
        Quantity::Slope(sensor) => ("slope", Some(sensor)),
        Quantity::Walk(sensor) => ("walk", Some(sensor)),
        Quantity::Delay(sensor) => ("delay", Some(sensor)),
        _ => ("other", None),
    }
}

fn texts(all: impl Iterator<Item = String>) -> ArrayRef {
    Arc::new(StringArray::from_iter_values(all))
}
