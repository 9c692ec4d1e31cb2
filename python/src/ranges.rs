//! A target from the ranges of fixed anchors, over a table.

use crate::error::{Called, Outcome, refused};
use crate::given::named;
use crate::stored::{Reduced, maker};
use crate::table::{Given, Table};
use arrow_array::{ArrayRef, BooleanArray, Float64Array};
use fewbits_pf_mpa::{RangeEstimate, RangeSettings, Travel};
use nalgebra::Vector3;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A tracker of one target in a plane from ranges of fixed anchors, one range at a time.
///
/// `anchors` are their places by name, in metres. `send` is "value" (32 bits a range) or "word:1" to "word:8". Bias, error of scale, noise and
/// speed of the target are estimated too: `noise` is the largest deviation of a range's error, `noise_factor` and `speed_factor` say how
/// uncertain noise and speed are, `outliers` is the share of ranges that have nothing to do with the distance, and `bias` is the deviation of
/// the common bias. After `silence` seconds without a range the tracker starts again.
///
/// >>> import numpy as np, polars as pl, fewbits as fb
/// >>> anchors = {"A": (0.0, 0.0), "B": (9.0, 0.0), "C": (0.0, 9.0), "D": (9.0, 9.0)}
/// >>> names = np.array(list(anchors))[np.arange(160) % 4]
/// >>> noise = 0.1 * np.random.default_rng(1).standard_normal(160)
/// >>> ranges = [np.hypot(4 - anchors[n][0], 5 - anchors[n][1]) for n in names] + noise
/// >>> walk = pl.DataFrame({"t": np.arange(160) * 0.1, "anchor": names, "range": ranges})
/// >>> tracker = fb.RangeTracker(anchors, send="word:3", bias=0.1, noise=0.3)
/// >>> path = tracker.run(walk, time="t", by="anchor", value="range")
/// >>> bool(abs(path["x"][-1] - 4) < 0.5), bool(abs(path["y"][-1] - 5) < 0.5)
/// (True, True)
#[pyclass(frozen, module = "fewbits")]
pub(crate) struct RangeTracker {
    anchors: BTreeMap<String, (f64, f64)>,
    travel: Travel,
    settings: RangeSettings,
    /// What `send` said.
    send: String,
}

/// Anchors, what is sent, and the numbers, as in the constructor.
type Parts = (BTreeMap<String, (f64, f64)>, String, [f64; 8]);

#[pymethods]
impl RangeTracker {
    #[new]
    #[pyo3(signature = (anchors, *, send="value", noise=1.8, noise_factor=4.0, speed=1.0, speed_factor=4.0, persistence=6.0, outliers=0.02, bias=5.0, silence=30.0))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        #[pyo3(from_py_with = named)] anchors: BTreeMap<String, (f64, f64)>,
        #[pyo3(from_py_with = named)] send: &str,
        #[pyo3(from_py_with = named)] noise: f64,
        #[pyo3(from_py_with = named)] noise_factor: f64,
        #[pyo3(from_py_with = named)] speed: f64,
        #[pyo3(from_py_with = named)] speed_factor: f64,
        #[pyo3(from_py_with = named)] persistence: f64,
        #[pyo3(from_py_with = named)] outliers: f64,
        #[pyo3(from_py_with = named)] bias: f64,
        #[pyo3(from_py_with = named)] silence: f64,
    ) -> Outcome<Self> {
        let bits = send.strip_prefix("word:").and_then(|bits| bits.parse().ok());
        let travel = match (send, bits) {
            ("value", _) => Travel::Full,
            (_, Some(bits @ 1..=8)) => Travel::Bits(bits),
            _ => return refused("send", format!("'{send}'"), "'value', or 'word:1' to 'word:8'"),
        };
        let settings = RangeSettings {
            noise: Some(noise),
            noise_factor: Some(noise_factor),
            speed: Some(speed),
            speed_factor: Some(speed_factor),
            persistence,
            outliers,
            bias: Some(bias),
            silence,
            ..RangeSettings::default()
        };
        let made = Self {
            anchors,
            travel,
            settings,
            send: send.to_owned(),
        };
        made.tracker().called(&[("drift", "bias")])?;
        Ok(made)
    }

    #[staticmethod]
    fn _restored(anchors: BTreeMap<String, (f64, f64)>, send: &str, numbers: [f64; 8]) -> Outcome<Self> {
        let [
            noise,
            noise_factor,
            speed,
            speed_factor,
            persistence,
            outliers,
            bias,
            silence,
        ] = numbers;
        Self::new(anchors, send, noise, noise_factor, speed, speed_factor, persistence, outliers, bias, silence)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py, Parts>> {
        let of = &self.settings;
        let set = |number: Option<f64>| number.unwrap_or(f64::NAN);
        let numbers = [
            set(of.noise),
            set(of.noise_factor),
            set(of.speed),
            set(of.speed_factor),
            of.persistence,
            of.outliers,
            set(of.bias),
            of.silence,
        ];
        Ok((maker::<Self>(py)?, (self.anchors.clone(), self.send.clone(), numbers)))
    }

    /// The path over a table of one range a row: its time, the anchor's name in column `by`, the range in metres in column `value`. A range
    /// that is null or NaN is left out.
    ///
    /// The result has a row per range: position, deviations, covariance of x and y, bias, noise and speed, which are null while there are too few
    /// ranges for a position, and whether the track was lost at that row. Each run begins anew.
    fn run(
        &self,
        py: Python<'_>,
        table: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named)] time: &str,
        #[pyo3(from_py_with = named)] by: &str,
        #[pyo3(from_py_with = named)] value: &str,
    ) -> Outcome<Table> {
        let given = Given::read(table)?;
        let seconds = crate::callbacks::rising(&given.times(time)?)?;
        let (names, cells) = (given.texts(by)?, given.numbers(value)?);
        let (rows, found, bits) = py.detach(|| {
            let mut tracker = self.tracker()?;
            let (mut rows, mut found, mut bits) = (Vec::new(), Vec::new(), Vec::new());
            for (row, ((second, name), cell)) in seconds.iter().zip(&names).zip(&cells).enumerate() {
                if row % 256 == 255 {
                    Python::attach(|py| py.check_signals())?;
                }
                let Some(range) = cell.filter(|range| range.is_finite()) else {
                    continue;
                };
                let before = tracker.bits();
                found.push(tracker.push(*second, name, range)?);
                bits.push((tracker.bits() - before) as i64);
                rows.push(row);
            }
            Ok::<_, crate::error::Failure>((rows, found, bits))
        })?;
        let column = |of: fn(&RangeEstimate) -> f64| -> ArrayRef {
            Arc::new(Float64Array::from_iter(found.iter().map(|one| one.as_ref().map(of))))
        };
        let lost: Vec<bool> = found
            .iter()
            .map(|one| one.as_ref().is_some_and(|one| one.lost))
            .collect();
        Table::new(vec![
            (time.to_owned(), given.taken(time, &rows)?),
            ("x".to_owned(), column(|one| one.position.x)),
            ("y".to_owned(), column(|one| one.position.y)),
            ("x_sd".to_owned(), column(|one| one.covariance[(0, 0)].sqrt())),
            ("y_sd".to_owned(), column(|one| one.covariance[(1, 1)].sqrt())),
            ("xy".to_owned(), column(|one| one.covariance[(0, 1)])),
            ("bias".to_owned(), column(|one| one.bias)),
            ("noise".to_owned(), column(|one| one.noise)),
            ("speed".to_owned(), column(|one| one.speed)),
            ("lost".to_owned(), Arc::new(BooleanArray::from(lost))),
            ("bits".to_owned(), Arc::new(arrow_array::Int64Array::from(bits))),
        ])
    }
}

impl RangeTracker {
    fn tracker(&self) -> Outcome<fewbits_pf_mpa::RangeTracker> {
        let places = self
            .anchors
            .iter()
            .map(|(name, (x, y))| (name.clone(), Vector3::new(*x, *y, 0.0)));
        Ok(fewbits_pf_mpa::RangeTracker::new(places, self.travel, self.settings)?)
    }
}
