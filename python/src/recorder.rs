//! Recordings that are written row by row, and the times of their rows.

use crate::clock::{MAX_DECIMALS, ticked};
use crate::error::{Failure, Outcome, refused};
use crate::given::{named, of_class_or_none};
use crate::record::Stated;
use crate::table::Given;
use fewbits_recipes::bounds;
use fewbits_record::{Schema, TimeBase, TimeFormat};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::PathBuf;

/// Writes a recording row by row. After a crash the rows up to the last `sync` can be read, with `damage="skip"`.
///
/// `bounds` has the bound of each column, as in `write`. `decimals` are those of the seconds of times (3: milliseconds); None numbers the
/// rows instead. `time` names their column ("time" if left out). With `resume` an existing recording is continued, with its own columns and bounds.
///
/// >>> import fewbits as fb, tempfile, os
/// >>> path = os.path.join(tempfile.mkdtemp(), "live.fewb")
/// >>> with fb.Recorder(path, {"temp": "±0.1", "door": "lossless"}, decimals=1) as recorder:
/// ...     recorder.push(0.0, {"temp": 20.14, "door": 1})
/// ...     recorder.push(0.5, {"temp": 20.21})
/// >>> fb.read(path)
/// Table(2 rows: time, temp, door)
#[pyclass(module = "fewbits")]
pub(crate) struct Recorder {
    recorder: Option<fewbits_record::Recorder<File>>,
}

#[pymethods]
impl Recorder {
    #[new]
    #[pyo3(signature = (path, bounds=None, *, time=None, decimals=None, utc=false, effort="thorough", resume=false))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        #[pyo3(from_py_with = named)] path: PathBuf,
        #[pyo3(from_py_with = of_class_or_none)] bounds: Option<&Bound<'_, PyDict>>,
        #[pyo3(from_py_with = named)] time: Option<&str>,
        #[pyo3(from_py_with = named)] decimals: Option<u8>,
        #[pyo3(from_py_with = named)] utc: bool,
        #[pyo3(from_py_with = named)] effort: &str,
        #[pyo3(from_py_with = named)] resume: bool,
    ) -> Outcome<Self> {
        let effort = crate::codec::effort(effort)?;
        let recorder = match (bounds, resume) {
            (None, true) => {
                let recorder = fewbits_record::Recorder::resume(&path)?;
                if let Some(time) = time.filter(|time| *time != recorder.schema().time_name()) {
                    let expected = format!("'{}', as in the recording", recorder.schema().time_name());
                    return refused("time", format!("'{time}'"), expected);
                }
                recorder
            }
            (Some(bounds), false) => {
                let names: Vec<String> = bounds
                    .keys()
                    .iter()
                    .map(|name| name.extract())
                    .collect::<PyResult<_>>()?;
                let stated: Stated = bounds.extract()?;
                let ranges = vec![None; names.len()];
                let columns = bounds::columns(&names, &stated.of(&names)?, &ranges)?;
                let base = match decimals {
                    None if time.is_some() => {
                        return refused(
                            "time",
                            "given without `decimals`",
                            "both: rows that are numbered have no times",
                        );
                    }
                    None => TimeBase::Numbered,
                    Some(decimals) if decimals <= MAX_DECIMALS => TimeBase::Clock {
                        decimals,
                        format: if utc { TimeFormat::Utc } else { TimeFormat::Seconds },
                        tolerance: 0,
                    },
                    Some(decimals) => return refused("decimals", decimals, format!("0 to {MAX_DECIMALS}, or None")),
                };
                let schema = Schema::new(columns, base)?.with_time_name(time.unwrap_or_default())?;
                fewbits_record::Recorder::create(&path, schema)?
            }
            _ => return refused("bounds", "given with `resume`, or neither is", "one of the two"),
        };
        Ok(Self {
            recorder: Some(recorder.with_effort(effort)),
        })
    }

    /// Adds a row: its time (seconds, or what `numpy.datetime64` takes; the number of the row, or None for the next, if rows are numbered)
    /// and its cells by column. Cells that are None or left out are gaps.
    fn push(
        &mut self,
        time: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = named)] cells: BTreeMap<String, Option<f64>>,
    ) -> Outcome<()> {
        let recorder = self.open()?;
        let schema = recorder.schema().clone();
        for name in cells.keys() {
            schema.position(name)?;
        }
        let tick = match (time.is_none(), schema.time()) {
            (true, TimeBase::Numbered) => recorder.next_tick(),
            _ => tick_of(time, "time", schema.time(), Rounding::Nearest)?,
        };
        let row: Vec<Option<f64>> = schema
            .columns()
            .iter()
            .map(|one| match (cells.get(one.name()).copied().flatten(), one.integers()) {
                (Some(number), Some(integers)) => match integers.code_of(number) {
                    Some(code) => Ok(Some(code)),
                    None => refused("cells", format!("{number} of '{}'", one.name()), "a whole number of 64 bits"),
                },
                (cell, _) => Ok(cell),
            })
            .collect::<Outcome<_>>()?;
        Ok(recorder.push(tick, &row)?)
    }

    /// Adds the rows of a table: every column of the recording, and the times (timestamps, or numbers of seconds) unless rows are numbered.
    ///
    /// >>> import os, tempfile, fewbits as fb
    /// >>> path = os.path.join(tempfile.mkdtemp(), "live.fewb")
    /// >>> recorder = fb.Recorder(path, {"temp": "0.1"})
    /// >>> recorder.push_table(fb.Table({"time": [0.0, 1.0, 2.0], "temp": [20.0, 20.1, 20.3]}))
    /// >>> recorder.sync()
    /// >>> recorder.close() > 0, len(fb.read(path))
    /// (True, 3)
    fn push_table(&mut self, py: Python<'_>, table: &Bound<'_, PyAny>) -> Outcome<()> {
        let given = Given::read(table)?;
        let recorder = self.open()?;
        py.detach(|| {
            let schema = recorder.schema().clone();
            for batch in given.batches() {
                recorder.push_batch(&ticked(batch, &schema)?)?;
                Python::attach(|py| py.check_signals())?;
            }
            Ok::<(), Failure>(())
        })
    }

    /// Writes the rows so far as a block and waits until the disk has them.
    fn sync(&mut self, py: Python<'_>) -> Outcome<()> {
        let recorder = self.open()?;
        Ok(py.detach(|| recorder.sync())?)
    }

    /// Writes what is left, and the index. Returns the number of bytes. A second call does nothing.
    fn close(&mut self, py: Python<'_>) -> Outcome<Option<u64>> {
        let Some(recorder) = self.recorder.take() else {
            return Ok(None);
        };
        py.detach(|| Ok(Some(recorder.finish()?.metadata()?.len())))
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&mut self, py: Python<'_>, _exception: &Bound<'_, pyo3::types::PyTuple>) -> Outcome<()> {
        self.close(py).map(drop)
    }
}

impl Recorder {
    fn open(&mut self) -> Outcome<&mut fewbits_record::Recorder<File>> {
        match &mut self.recorder {
            Some(recorder) => Ok(recorder),
            None => refused("recorder", "closed", "one that is open: `Recorder(path, resume=True)` continues"),
        }
    }
}

/// Which tick stands for a time between two.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rounding {
    /// The time of a row.
    Nearest,
    /// The first that is not before the time: an end of a range.
    Up,
}

/// A tick of a recording's clock: a number of seconds, or with a UTC clock a text or a NumPy datetime.
pub(crate) fn tick_of(
    value: &Bound<'_, PyAny>,
    name: &'static str,
    time: TimeBase,
    rounding: Rounding,
) -> Outcome<i64> {
    let TimeBase::Clock { decimals, format, .. } = time else {
        return value.extract().or_else(|_| refused(name, value, "the number of a row"));
    };
    let scale = 10_f64.powi(decimals.into());
    if let Ok(seconds) = value.extract::<f64>() {
        let exact = seconds * scale;
        let nearest = exact.round();
        // A product of doubles is off by its last bits.
        let is_tick = (exact - nearest).abs() <= 4.0 * f64::EPSILON * nearest.abs();
        let tick = if is_tick || rounding == Rounding::Nearest {
            nearest
        } else {
            exact.ceil()
        };
        return if tick.abs() < i64::MAX as f64 {
            Ok(tick as i64)
        } else {
            refused(name, seconds, "a time within the clock's range")
        };
    }
    if matches!(format, TimeFormat::Seconds) {
        return refused(name, value, "a number of seconds");
    }
    let numpy = value.py().import("numpy")?;
    // An aware datetime is taken to UTC first: NumPy knows no zones. Of a text the offset is cut off.
    let text: Option<String> = value.extract().ok();
    let zoned = text.as_deref().and_then(offset_of);
    if zoned.is_some() && matches!(format, TimeFormat::Local) {
        return refused(name, value, "a time without a zone, as those of the recording");
    }
    let (value, shift) = match zoned {
        Some((plain, offset)) => {
            let datetime = value.py().import("datetime")?.getattr("datetime")?;
            let shift = datetime
                .call_method1("fromisoformat", (format!("2000-01-01T00:00:00{offset}"),))
                .and_then(|any| {
                    any.call_method0("utcoffset")?
                        .call_method0("total_seconds")?
                        .extract::<f64>()
                });
            let Ok(shift) = shift else {
                return refused(name, value, "a time with an offset as `+01:00`");
            };
            (plain.into_pyobject(value.py()).map_err(PyErr::from)?.into_any(), (shift * 1e9).round() as i64)
        }
        None => (value.clone(), 0),
    };
    let value = &value;
    let given = match value.getattr("tzinfo") {
        Ok(zone) if !zone.is_none() && matches!(format, TimeFormat::Local) => {
            return refused(name, value, "a time without a zone, as those of the recording");
        }
        Ok(zone) if !zone.is_none() => {
            let utc = value.py().import("datetime")?.getattr("timezone")?.getattr("utc")?;
            let plain = value.call_method1("astimezone", (utc,))?;
            let arguments = PyDict::new(value.py());
            arguments.set_item("tzinfo", value.py().None())?;
            plain.call_method("replace", (), Some(&arguments))?
        }
        _ => value.clone(),
    };
    let stamp = numpy.call_method1("datetime64", (&given, "ns"));
    let Ok(nanoseconds) = stamp.and_then(|stamp| stamp.call_method1("astype", ("int64",))?.extract::<i64>()) else {
        return refused(name, value, "seconds since 1970, or a time that numpy.datetime64 takes");
    };
    let shifted = Some(nanoseconds).filter(|stamp| *stamp != i64::MIN);
    let Some(nanoseconds) = shifted.and_then(|stamp| stamp.checked_sub(shift)) else {
        return refused(name, value, "a time");
    };
    match MAX_DECIMALS.checked_sub(decimals) {
        Some(fewer) => {
            let tick = 10_i64.pow(fewer.into());
            let is_between = rounding == Rounding::Up && nanoseconds.rem_euclid(tick) != 0;
            Ok(nanoseconds.div_euclid(tick) + i64::from(is_between))
        }
        None => nanoseconds
            .checked_mul(10_i64.pow((decimals - MAX_DECIMALS).into()))
            .map_or_else(|| refused(name, value, "a time within the clock's range"), Ok),
    }
}

/// A text of date and time without its offset from UTC, and the offset: `Z`, or as `+01:00`. Nothing if it has none.
fn offset_of(text: &str) -> Option<(&str, &str)> {
    let clock = text.find(['T', 't', ' ', ':'])?;
    let sign = text.get(clock..)?.find(['Z', 'z', '+', '-'])?;
    let (plain, offset) = text.split_at_checked(clock + sign)?;
    Some((plain.trim_end(), offset))
}
