//! The unscented and the cubature Kalman filter, with the user's dynamics and measurement as functions of all points at once.

use crate::array::{matrix, shown, vector};
use crate::callbacks::{Likelihoods, returned};
use crate::error::{Failure, Outcome, refused};
use crate::given::{key, named};
use crate::model::{square, with_dimension};
use crate::rows::Rows;
use crate::seat::Sends;
use crate::stored::{self, Reduced};
use crate::table::Table;
use fewbits_core::circle::nearest;
use fewbits_core::factor::{Scalar, Value};
use fewbits_core::{Gaussian, Link, Observation, Scheme};
use fewbits_dymbo::{InnovationWord, Prediction, SignBit};
use fewbits_filters::{RootGaussian, SigmaPointFilter as Filter};
use fewbits_monte_carlo::Stream;
use nalgebra::{SMatrix, SVector, Vector1};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use serde::{Deserialize, Serialize};

/// What is known of the sensor of a column.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Sensor {
    variance: f64,
    send: Sends,
    /// Measurements that differ by whole periods are equal.
    #[serde(default)]
    period: Option<f64>,
}

impl Sensor {
    /// Whether it can be a stored one.
    pub(crate) fn is_valid(&self) -> bool {
        let sends = match self.send {
            Sends::Word(bits) => (2..=4).contains(&bits),
            Sends::Silent(_) => false,
            _ => true,
        };
        let is_size = |number: f64| number > 0.0 && number.is_finite();
        sends && is_size(self.variance) && self.period.is_none_or(is_size)
    }

    /// Brings measurements on a circle next to the first of them.
    pub(crate) fn unwrap(&self, measured: &mut [f64]) {
        if let (Some(period), Some(first)) = (self.period, measured.first().copied()) {
            measured.iter_mut().for_each(|z| *z = nearest(*z, first, period));
        }
    }
}

/// The sensors of these columns: their noises, what they send, and periods of those that measure angles.
pub(crate) fn sensors(
    names: &[Option<&str>],
    noise: &Bound<'_, PyAny>,
    send: Option<&Bound<'_, PyAny>>,
    period: Option<&Bound<'_, PyAny>>,
) -> Outcome<Vec<Sensor>> {
    let variances = by_column("noise", noise, names, |given| match given.extract::<f64>() {
        Ok(noise) if noise > 0.0 && noise.is_finite() && noise * noise > 0.0 => Ok(noise * noise),
        Ok(noise) => refused("noise", noise, "a finite number above 0"),
        Err(_) => refused("noise", shown(given), "a number, or numbers by column"),
    })?;
    let expected = "'value', 'bit' or 'word:2' to 'word:4'";
    let sends = match send {
        None => vec![Sends::Value; names.len()],
        Some(send) => {
            by_column("send", send, names, |given| match given.extract::<String>().map(|text| Sends::parsed(&text)) {
                Ok(Ok(Sends::Silent(_))) | Err(_) => refused("send", shown(given), expected),
                Ok(sends) => sends,
            })?
        }
    };
    let periods = match period {
        None => vec![None; names.len()],
        Some(period) => by_column("period", period, names, |given| match given.extract::<Option<f64>>() {
            Ok(None) => Ok(None),
            Ok(Some(period)) if period > 0.0 && period.is_finite() => Ok(Some(period)),
            _ => refused("period", shown(given), "a finite number above 0, or None for a number on the line"),
        })?,
    };
    let sensors = variances.into_iter().zip(sends).zip(periods);
    let sensor = |((variance, send), period)| Sensor { variance, send, period };
    Ok(sensors.map(sensor).collect())
}

/// A filter of one dimension with its belief.
trait Rule: Send + Sync {
    fn copied(&self) -> Box<dyn Rule>;

    /// `noise` by columns.
    fn predict(&mut self, noise: &[f64], change: Change<'_>) -> Outcome<()>;

    /// Log likelihood, and bits that were sent.
    fn update(&mut self, measure: Measure<'_>, sensor: &Sensor, sample: f64) -> Outcome<(f64, i64)>;

    fn moments(&self) -> (Vec<f64>, Vec<Vec<f64>>);

    /// The belief as bytes.
    fn stored(&self) -> Outcome<Vec<u8>>;
}

type Change<'a> = &'a mut dyn FnMut(&mut [&mut [f64]]) -> Outcome<()>;
type Measure<'a> = &'a mut dyn FnMut(&[&[f64]], &mut [f64]) -> Outcome<()>;

#[derive(Clone)]
struct Points<const D: usize> {
    filter: Filter<D>,
    belief: RootGaussian<D>,
}

impl<const D: usize> Points<D> {
    fn new(filter: Filter<D>, mean: &[f64], covariance: &[f64]) -> Outcome<Self> {
        let prior = Gaussian::new(SVector::from_column_slice(mean), SMatrix::from_column_slice(covariance))?;
        Ok(Self {
            filter,
            belief: RootGaussian::from_gaussian(&prior)?,
        })
    }
}

impl<const D: usize> Rule for Points<D> {
    fn copied(&self) -> Box<dyn Rule> {
        Box::new(self.clone())
    }

    fn predict(&mut self, noise: &[f64], change: Change<'_>) -> Outcome<()> {
        let noise = SMatrix::from_column_slice(noise);
        self.filter
            .predict_by(&mut self.belief, &noise, |mut points| change(&mut points))
    }

    fn update(&mut self, measure: Measure<'_>, sensor: &Sensor, sample: f64) -> Outcome<(f64, i64)> {
        let mut bits = 0;
        let info = self.filter.update_by(
            &mut self.belief,
            |points, [measured]| measure(points, measured),
            |predicted| {
                let (factor, sent) = said(sensor, sample, predicted)?;
                bits = sent;
                Ok::<Scalar, Failure>(factor)
            },
        )?;
        Ok((info.log_likelihood, bits))
    }

    fn moments(&self) -> (Vec<f64>, Vec<Vec<f64>>) {
        let belief = self.belief.gaussian();
        let covariance = belief.covariance();
        let rows = (0..D).map(|i| (0..D).map(|j| covariance[(i, j)]).collect()).collect();
        (belief.mean().as_slice().to_vec(), rows)
    }

    fn stored(&self) -> Outcome<Vec<u8>> {
        let mut bytes = Vec::new();
        match ciborium::into_writer(&self.belief, &mut bytes) {
            Ok(()) => Ok(bytes),
            Err(error) => refused("state", error, "a belief that can be stored"),
        }
    }
}

/// What the receiver learns of a sample under the predicted noise-free measurement, and the bits that it takes.
pub(crate) fn said(sensor: &Sensor, sample: f64, predicted: &Gaussian<1>) -> Outcome<(Scalar, i64)> {
    fn through<S: Scheme<1, State = (), Factor = Scalar>>(
        scheme: &S,
        feedback: &S::Feedback,
        sample: f64,
    ) -> Outcome<Scalar> {
        // These schemes draw nothing.
        let mut rng = Stream::new(0).fast_rng();
        let report = scheme.encode(&mut rng, &mut (), &Vector1::new(sample), feedback)?;
        Ok(scheme.factor(feedback, &Observation::from(report), &Link::PERFECT)?)
    }
    let sample = sensor
        .period
        .map_or(sample, |period| nearest(sample, predicted.mean()[0], period));
    Ok(match sensor.send {
        Sends::Bit => (through(&SignBit::new(sensor.variance)?, &predicted.mean()[0], sample)?, 1),
        Sends::Word(bits) => {
            let variance = predicted.covariance()[(0, 0)] + sensor.variance;
            let told = Prediction::from(&Gaussian::scalar(predicted.mean()[0], variance)?);
            (through(&InnovationWord::new(sensor.variance, bits)?, &told, sample)?, bits as i64)
        }
        _ => (Value::scalar(sample, sensor.variance)?.into(), 64),
    })
}

/// The unscented and the cubature Kalman filter: a Gaussian belief whose models are evaluated at points, not linearised.
///
/// `move(x, dt)` changes the points in place to the means of the next states, or returns them. `measure(x)` returns the noise-free
/// measurements of the points; a dictionary has one such function per column. In `x` each row is a coordinate and each column a point.
/// `process` is the covariance of the process noise after a second, which grows with time, or a function of `dt` that returns it. `noise` is
/// the deviation of the measurements, and `send` what their sensors send: "value", "bit" (is the sample at or above the prediction?) or
/// "word:2" to "word:4"; a dictionary has them by column. `period` is that of measurements on a circle, as 360 of bearings in degrees: they are
/// compared the shorter way around. `rule` is "unscented", whose middle point has the weight `kappa / (d + kappa)`
/// (3 - d if left out, at least 0), or "cubature". The belief at the start has `mean` and `deviation` or `covariance`.
///
/// >>> import numpy as np, fewbits as fb
/// >>> def move(x, dt):
/// ...     x[0] += dt * x[1]
/// >>> ukf = fb.SigmaPointFilter(
/// ...     move, lambda x: np.hypot(x[0], 3.0), process=0.1 * np.eye(2), noise=0.1, mean=[3.0, 0.0], deviation=[2.0, 1.0],
/// ... )
/// >>> for z in [5.0, 5.1, 5.2]:
/// ...     _ = ukf.step(z)
/// >>> bool(abs(np.hypot(ukf.mean[0], 3.0) - 5.2) < 0.2), ukf.covariance.shape
/// (True, (2, 2))
#[pyclass(module = "fewbits")]
pub(crate) struct SigmaPointFilter {
    transition: Py<PyAny>,
    measures: Likelihoods,
    sensors: Vec<Sensor>,
    process: Process,
    dimension: usize,
    kappa: f64,
    rule: Box<dyn Rule>,
}

/// What a filter is besides its functions, to be stored.
#[derive(Serialize, Deserialize)]
struct State {
    sensors: Vec<Sensor>,
    /// Of a process that is no function.
    density: Option<Vec<f64>>,
    dimension: usize,
    kappa: f64,
    belief: Vec<u8>,
}

/// The functions, one of them perhaps `None`, and the state.
type Parts<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Option<Bound<'py, PyAny>>, Bound<'py, PyBytes>);

enum Process {
    /// After a second, by columns.
    Density(Vec<f64>),
    Function(Py<PyAny>),
}

#[pymethods]
impl SigmaPointFilter {
    #[new]
    #[pyo3(signature = (r#move, measure, *, process, noise, mean, deviation=None, covariance=None, rule="unscented", kappa=None, send=None, period=None))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        r#move: &Bound<'_, PyAny>,
        measure: &Bound<'_, PyAny>,
        process: &Bound<'_, PyAny>,
        noise: &Bound<'_, PyAny>,
        mean: &Bound<'_, PyAny>,
        deviation: Option<&Bound<'_, PyAny>>,
        covariance: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = named)] rule: &str,
        #[pyo3(from_py_with = named)] kappa: Option<f64>,
        send: Option<&Bound<'_, PyAny>>,
        period: Option<&Bound<'_, PyAny>>,
    ) -> Outcome<Self> {
        if !r#move.is_callable() {
            return refused("move", r#move.get_type().name()?, "a function of the points and seconds");
        }
        let mean = vector("mean", mean)?;
        let dimension = mean.len();
        let covariance = crate::model::covariance(deviation, covariance, dimension)?;
        let measures = Likelihoods::parsed("measure", measure)?;
        let sensors = sensors(&measures.names(), noise, send, period)?;
        let process = if process.is_callable() {
            Process::Function(process.clone().unbind())
        } else {
            Process::Density(square("process", process, dimension)?)
        };
        let kappa = match (rule, kappa) {
            ("unscented", kappa) => kappa.unwrap_or((3.0 - dimension as f64).max(0.0)),
            ("cubature", None) => 0.0,
            ("cubature", Some(kappa)) => return refused("kappa", kappa, "none with the rule 'cubature'"),
            _ => return refused("rule", format!("'{rule}'"), "'unscented' or 'cubature'"),
        };
        let rule: Box<dyn Rule> = with_dimension!(dimension, D => {
            Ok::<Box<dyn Rule>, Failure>(Box::new(Points::<D>::new(Filter::unscented(kappa)?, &mean, &covariance)?))
        })?;
        Ok(Self {
            transition: r#move.clone().unbind(),
            measures,
            sensors,
            process,
            dimension,
            kappa,
            rule,
        })
    }

    #[staticmethod]
    fn _restored(
        r#move: Py<PyAny>,
        measure: &Bound<'_, PyAny>,
        process: Option<Py<PyAny>>,
        state: &Bound<'_, PyAny>,
    ) -> Outcome<Self> {
        let State {
            sensors,
            density,
            dimension,
            kappa,
            belief,
        } = stored::state(state)?;
        let measures = Likelihoods::parsed("measure", measure)?;
        let process = match (process, density) {
            (Some(function), None) => Process::Function(function),
            (None, Some(density)) if density.len() == dimension * dimension => Process::Density(density),
            _ => return refused("state", "without a process", "that of a sigma point filter"),
        };
        if sensors.len() != measures.names().len() || !sensors.iter().all(Sensor::is_valid) {
            return refused("state", format!("{} sensors", sensors.len()), "that of a sigma point filter");
        }
        let rule: Box<dyn Rule> = with_dimension!(dimension, D => {
            let belief: RootGaussian<D> = match ciborium::from_reader(&belief[..]) {
                Ok(belief) => belief,
                Err(error) => return refused("state", error, "that of a sigma point filter"),
            };
            Ok::<Box<dyn Rule>, Failure>(Box::new(Points::<D> { filter: Filter::unscented(kappa)?, belief }))
        })?;
        Ok(Self {
            transition: r#move,
            measures,
            sensors,
            process,
            dimension,
            kappa,
            rule,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> Outcome<Reduced<'py, Parts<'py>>> {
        let (density, function) = match &self.process {
            Process::Density(density) => (Some(density.clone()), None),
            Process::Function(function) => (None, Some(function.bind(py).clone())),
        };
        let state = State {
            sensors: self.sensors.clone(),
            density,
            dimension: self.dimension,
            kappa: self.kappa,
            belief: self.rule.stored()?,
        };
        let parts = (self.transition.bind(py).clone(), self.measures.given(py)?, function, stored::bytes(py, &state)?);
        Ok((stored::maker::<Self>(py)?, parts))
    }

    /// Moves the belief by `dt` seconds (not if 0) and updates it by the observation (not if None or NaN). Returns the log likelihood. With
    /// measurements by name the observation is a dictionary. A step that fails, in a function of yours too, leaves the belief as it was.
    #[pyo3(signature = (observation=None, *, dt=1.0))]
    fn step(
        &mut self,
        py: Python<'_>,
        observation: Option<Bound<'_, PyAny>>,
        #[pyo3(from_py_with = named)] dt: f64,
    ) -> Outcome<f64> {
        Ok(self.advanced(py, observation.as_ref(), dt)?.0)
    }

    /// One step per row of a table, its column `time` in seconds or timestamps; null and NaN are missing. The first row is the time of the
    /// start.
    ///
    /// >>> import polars as pl, fewbits as fb
    /// >>> level = fb.SigmaPointFilter(
    /// ...     lambda x, dt: x, {"a": lambda x: x[0] ** 3}, process=[[0.1]], noise={"a": 0.5}, mean=1.0, deviation=0.5, rule="cubature", send="bit",
    /// ... )
    /// >>> level.run(pl.DataFrame({"t": [0.0, 1.0, 3.0], "a": [1.2, None, 1.5]}), time="t").columns
    /// ['t', 'x0', 'x0_sd', 'log_likelihood', 'bits']
    #[pyo3(signature = (table, *, time))]
    fn run(
        &mut self,
        py: Python<'_>,
        table: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named)] time: &str,
    ) -> Outcome<Table> {
        let (mut rows, mut sent) = (Rows::read(table, time, &self.measures, self.dimension)?, Vec::new());
        while let Some((observation, [before, now])) = rows.next(py)? {
            let (log, bits) = self.advanced(py, Some(&observation), now - before)?;
            let (mean, covariance) = self.rule.moments();
            rows.push(
                log,
                mean.into_iter()
                    .enumerate()
                    .map(|(i, mean)| (mean, covariance[i][i].sqrt())),
            );
            sent.push(bits);
        }
        rows.table(Some(sent))
    }

    /// Mean of the belief.
    #[getter]
    fn mean<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.rule.moments().0)
    }

    /// Its covariance, (d, d).
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyArray2<f64>>> {
        Ok(PyArray2::from_vec2(py, &self.rule.moments().1).map_err(PyErr::from)?)
    }
}

impl SigmaPointFilter {
    /// Log likelihood and bits of a step.
    fn advanced(&mut self, py: Python<'_>, observation: Option<&Bound<'_, PyAny>>, dt: f64) -> Outcome<(f64, i64)> {
        if !(dt >= 0.0 && dt.is_finite()) {
            return refused("dt", dt, "a finite number, 0 or above");
        }
        let observed = self.measures.of(observation)?;
        let mut next = self.rule.copied();
        if dt > 0.0 {
            let noise = match &self.process {
                Process::Density(density) => density.iter().map(|q| q * dt).collect(),
                Process::Function(process) => square("process", &process.bind(py).call1((dt,))?, self.dimension)?,
            };
            next.predict(&noise, &mut |points| {
                let given = of_columns(py, points.iter().map(|column| column.to_vec()).collect())?;
                let returned = self.transition.bind(py).call1((&given, dt))?;
                moved("points", given, returned, points)
            })?;
        }
        let (mut log_likelihood, mut bits) = (0.0, 0);
        for (at, function, sample) in observed {
            let Ok(sample) = sample.extract::<f64>() else {
                return refused("observation", shown(&sample), "a number");
            };
            let mut measure = |points: &[&[f64]], measured: &mut [f64]| {
                let given = of_columns(py, points.iter().map(|column| column.to_vec()).collect())?;
                let found = function.bind(py).call1((given,))?;
                let found = returned("measure", "point", &found, measured.len())?;
                measured
                    .iter_mut()
                    .zip(found.as_array())
                    .for_each(|(z, found)| *z = *found);
                self.sensors[at].unwrap(measured);
                Ok(())
            };
            let (log, sent) = next.update(&mut measure, &self.sensors[at], sample)?;
            (log_likelihood, bits) = (log_likelihood + log, bits + sent);
        }
        self.rule = next;
        Ok((log_likelihood, bits))
    }
}

/// Replaces columns by what a function of the user made of them in place, or returned.
pub(crate) fn moved<'py, C: AsMut<[f64]>>(
    what: &str,
    given: Bound<'py, PyArray2<f64>>,
    returned: Bound<'py, PyAny>,
    columns: &mut [C],
) -> Outcome<()> {
    let returned = if returned.is_none() { given.into_any() } else { returned };
    let (rows, own, numbers) = matrix("move", &returned)?;
    let count = columns.first_mut().map_or(0, |column| column.as_mut().len());
    if (rows, own) != (columns.len(), count) {
        let expected = format!("an array of shape ({}, {count}), as the {what}", columns.len());
        return refused("move", shown(&returned), expected);
    }
    for (column, moved) in columns.iter_mut().zip(numbers.chunks_exact(count)) {
        column.as_mut().copy_from_slice(moved);
    }
    Ok(())
}

pub(crate) fn of_columns(py: Python<'_>, columns: Vec<Vec<f64>>) -> Outcome<Bound<'_, PyArray2<f64>>> {
    Ok(PyArray2::from_vec2(py, &columns).map_err(PyErr::from)?)
}

/// A setting of each column: one for all, or a dictionary with one for each.
fn by_column<T>(
    name: &'static str,
    given: &Bound<'_, PyAny>,
    names: &[Option<&str>],
    parsed: impl Fn(&Bound<'_, PyAny>) -> Outcome<T>,
) -> Outcome<Vec<T>> {
    let Ok(each) = given.cast::<PyDict>() else {
        return names.iter().map(|_| parsed(given)).collect();
    };
    let known: Vec<&str> = names.iter().copied().flatten().collect();
    for given in each.keys() {
        let key = key(name, &given)?;
        if !known.contains(&key.as_str()) {
            return refused(name, format!("'{key}'"), format!("one of {}", known.join(", ")));
        }
    }
    names
        .iter()
        .map(|column| match column.map(|column| each.get_item(column)).transpose()?.flatten() {
            Some(given) => parsed(&given),
            None => refused(name, "without a column", format!("one for each of {}", known.join(", "))),
        })
        .collect()
}
