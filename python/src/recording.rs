//! Recordings that are open: rows by time and column, lazily, and rows that are added one by one.

use crate::error::{Failure, Outcome, refused};
use crate::record::{MAX_DECIMALS, Stated, opened};
use crate::table::{Given, Table};
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{RecordBatch, RecordBatchReader};
use arrow_schema::{ArrowError, SchemaRef};
use fewbits_recipes::bounds;
use fewbits_record::{Block, Schema, TimeBase, TimeFormat};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex};

/// Blocks that are decoded ahead of the reader.
const AHEAD: usize = 4;

/// A recording of `write` or `Recorder`, of which only the head has been read.
///
/// It is a table for everything that reads Arrow streams: `pl.DataFrame(recording)`, `pa.table(recording)`.
///
/// >>> import numpy as np, polars as pl, fewbits as fb, tempfile, os
/// >>> path = os.path.join(tempfile.mkdtemp(), "room.fewb")
/// >>> _ = fb.write(pl.DataFrame({"t": np.arange(2000) * 0.5, "temp": np.sin(np.arange(2000) / 99)}), path, time="t", bounds=0.01)
/// >>> with fb.open(path) as recording:
/// ...     recording.rows, recording.bounds, len(pl.DataFrame(recording.select(start=10, end=20)))
/// (2000, {'temp': '±0.01'}, 20)
#[pyclass(frozen, module = "fewbits")]
pub(crate) struct Recording {
    path: PathBuf,
    schema: Schema,
    rows: u64,
    bytes: u64,
    finished: bool,
    damaged: Damaged,
}

/// What reading does at damaged bytes.
#[derive(Clone, Copy, PartialEq)]
enum Damaged {
    Raise,
    Skip,
}

impl Damaged {
    fn parsed(text: &str) -> Outcome<Self> {
        match text {
            "raise" => Ok(Self::Raise),
            "skip" => Ok(Self::Skip),
            other => refused("damage", format!("'{other}'"), "'raise' or 'skip'"),
        }
    }
}

/// Opens a recording. With `damage="skip"` what is damaged or missing is left out when rows are read, as in a recording that is still being
/// written.
///
/// Raises `fewbits.DecodeError` if the file is none.
///
/// >>> import fewbits as fb
/// >>> fb.open("no such file")
/// Traceback (most recent call last):
/// ...
/// FileNotFoundError: No such file or directory (os error 2)
#[pyfunction]
#[pyo3(signature = (path, *, damage="raise"))]
pub(crate) fn open(py: Python<'_>, path: PathBuf, damage: &str) -> Outcome<Recording> {
    let damaged = Damaged::parsed(damage)?;
    py.detach(|| {
        let mut playback = opened(&path)?;
        let rows = match playback.index() {
            Ok(blocks) => blocks.iter().map(|block| block.rows).sum(),
            Err(_) if damaged == Damaged::Skip => 0,
            Err(error) => return Err(error.into()),
        };
        Ok(Recording {
            schema: playback.schema().clone(),
            rows,
            bytes: playback.bytes(),
            finished: playback.is_finished(),
            damaged,
            path,
        })
    })
}

#[pymethods]
impl Recording {
    /// Number of rows, by the index: 0 if the recording was not finished.
    #[getter]
    fn rows(&self) -> u64 {
        self.rows
    }

    /// Size of the file.
    #[getter]
    fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Whether the recording was closed, and its end is there.
    #[getter]
    fn finished(&self) -> bool {
        self.finished
    }

    /// Names of the columns; the first is the time, or the number of the row.
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.schema
            .to_arrow()
            .fields()
            .iter()
            .map(|field| field.name().clone())
            .collect()
    }

    /// The bound of each column.
    #[getter]
    fn bounds(&self) -> BTreeMap<String, String> {
        let columns = self.schema.columns().iter();
        columns
            .map(|one| (one.name().to_owned(), bounds::shown(one.bound(), one.period())))
            .collect()
    }

    /// The unit of each column; empty if none was stated.
    #[getter]
    fn units(&self) -> BTreeMap<String, String> {
        let columns = self.schema.columns().iter();
        columns
            .map(|one| (one.name().to_owned(), one.unit().to_owned()))
            .collect()
    }

    /// The rows between two times (`start` included, `end` excluded) in some columns, read when they are asked for.
    ///
    /// `start` and `end` are numbers of seconds, row numbers if the recording has no times, or what `numpy.datetime64` takes if its clock is
    /// UTC. Blocks outside are not decoded.
    #[pyo3(signature = (columns=None, *, start=None, end=None))]
    fn select(
        &self,
        columns: Option<Vec<String>>,
        start: Option<&Bound<'_, PyAny>>,
        end: Option<&Bound<'_, PyAny>>,
    ) -> Outcome<Rows> {
        let time = self.schema.time();
        let from = start.map_or(Ok(i64::MIN), |start| tick_of(start, "start", time))?;
        let to = match end {
            None => i64::MAX,
            Some(end) => match tick_of(end, "end", time)?.checked_sub(1) {
                Some(last) => last,
                None => return refused("end", end, "a time above the smallest"),
            },
        };
        let mut chosen = Vec::new();
        for name in columns.unwrap_or_else(|| self.columns().split_off(1)) {
            let at = self.schema.position(&name)?;
            if !chosen.contains(&at) {
                chosen.push(at);
            }
        }
        chosen.sort_unstable();
        Ok(Rows {
            path: self.path.clone(),
            schema: self.schema.clone(),
            chosen,
            ticks: (from, to),
            damaged: self.damaged,
        })
    }

    /// All rows as a stream of record batches.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> Outcome<Bound<'py, PyCapsule>> {
        self.select(None, None, None)?.__arrow_c_stream__(py, requested_schema)
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    /// Nothing is held open between reads.
    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, _exception: &Bound<'_, pyo3::types::PyTuple>) {}

    fn __repr__(&self) -> String {
        format!("Recording({} rows, {} bytes: {})", self.rows, self.bytes, self.columns().join(", "))
    }
}

/// Rows of a recording that have not been read yet: a table for everything that reads Arrow streams, as often as asked.
#[pyclass(frozen, module = "fewbits")]
pub(crate) struct Rows {
    path: PathBuf,
    schema: Schema,
    chosen: Vec<usize>,
    ticks: (i64, i64),
    damaged: Damaged,
}

#[pymethods]
impl Rows {
    /// The rows as a stream of record batches, a block each.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> Outcome<Bound<'py, PyCapsule>> {
        // A producer may ignore the request: consumers then cast.
        let _ = requested_schema;
        let batches: Box<dyn RecordBatchReader + Send> = Box::new(self.batches()?);
        Ok(PyCapsule::new_with_value(py, FFI_ArrowArrayStream::new(batches), c"arrow_array_stream")?)
    }

    /// The blocks, a table each.
    fn __iter__(&self) -> Outcome<Blocks> {
        Ok(Blocks(Mutex::new(self.batches()?)))
    }

    /// All of them, read now.
    fn read(&self, py: Python<'_>) -> Outcome<Table> {
        let reader = self.batches()?;
        let fields = reader.schema();
        let batches = py.detach(|| -> Outcome<Vec<RecordBatch>> {
            let mut batches = Vec::new();
            for (number, batch) in reader.enumerate() {
                if number % 16 == 15 {
                    Python::attach(|py| py.check_signals())?;
                }
                batches.push(batch?);
            }
            Ok(batches)
        })?;
        Ok(Table::of(arrow_select::concat::concat_batches(&fields, &batches)?))
    }
}

impl Rows {
    /// The fields of the result, and a reader whose blocks another thread decodes ahead.
    fn batches(&self) -> Outcome<Batches> {
        let places: Vec<usize> = std::iter::once(0).chain(self.chosen.iter().map(|at| at + 1)).collect();
        let fields = Arc::new(self.schema.to_arrow().project(&places)?);
        let mut playback = opened(&self.path)?;
        if *playback.schema() != self.schema {
            return refused("path", self.path.display(), "the recording that was opened: another is there now");
        }
        let (schema, (from, to)) = (self.schema.clone(), self.ticks);
        let names: Vec<&str> = self.chosen.iter().map(|at| schema.columns()[*at].name()).collect();
        playback.columns(&names)?;
        let (sender, receiver) = sync_channel(AHEAD);
        let (none, damaged) = (self.chosen.is_empty(), self.damaged);
        let work = move || {
            for block in playback.blocks_between(from, to) {
                let batch = block.and_then(|mut block| {
                    keep_between(&mut block, from, to);
                    if none {
                        block.columns.iter_mut().for_each(Vec::clear);
                    }
                    block.to_record_batch(&schema)
                });
                if batch.is_err() && damaged == Damaged::Skip {
                    continue;
                }
                // Nobody reads on: the stream was dropped.
                if sender.send(batch).is_err() {
                    return;
                }
            }
        };
        std::thread::Builder::new().name("fewbits".to_owned()).spawn(work)?;
        Ok(Batches { fields, receiver })
    }
}

/// The blocks of `Rows`, read when they are asked for.
#[pyclass(frozen, module = "fewbits")]
pub(crate) struct Blocks(Mutex<Batches>);

#[pymethods]
impl Blocks {
    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> Outcome<Option<Table>> {
        let batch = py.detach(|| self.0.lock().map_or(None, |mut batches| batches.next()));
        py.check_signals()?;
        Ok(batch.transpose()?.map(Table::of))
    }
}

/// Record batches that come from another thread.
struct Batches {
    fields: SchemaRef,
    receiver: Receiver<Result<RecordBatch, fewbits_record::Error>>,
}

impl Iterator for Batches {
    type Item = Result<RecordBatch, ArrowError>;

    fn next(&mut self) -> Option<Self::Item> {
        let batch = self.receiver.recv().ok()?;
        Some(batch.map_err(|error| ArrowError::from_external_error(Box::new(error))))
    }
}

impl RecordBatchReader for Batches {
    fn schema(&self) -> SchemaRef {
        self.fields.clone()
    }
}

/// Leaves only the rows whose ticks are in `from..=to`.
fn keep_between(block: &mut Block, from: i64, to: i64) {
    let kept: Vec<bool> = block.ticks.iter().map(|tick| (from..=to).contains(tick)).collect();
    if kept.iter().all(|kept| *kept) {
        return;
    }
    let mut rows = kept.iter();
    block.ticks.retain(|_| rows.next().copied().unwrap_or(false));
    for cells in &mut block.columns {
        let mut rows = kept.iter();
        cells.retain(|_| rows.next().copied().unwrap_or(false));
    }
}

/// Reads a recording, whole or some columns between two times (`start` included, `end` excluded), as a table.
///
/// `start` and `end` are numbers of seconds, row numbers if the recording has no times, or what `numpy.datetime64` takes if its clock is UTC.
/// Blocks outside are not decoded.
///
/// Raises `fewbits.DecodeError` if the file is no recording, or is damaged or not finished; with `damage="skip"` what can be read is returned.
///
/// >>> import polars as pl, fewbits as fb, tempfile, os
/// >>> path = os.path.join(tempfile.mkdtemp(), "room.fewb")
/// >>> _ = fb.write(pl.DataFrame({"a": [1.5, None, 2.5], "b": [1, 2, 3]}), path)
/// >>> fb.read(path, columns=["a"], start=1)
/// Table(2 rows: row, a)
#[pyfunction]
#[pyo3(signature = (path, *, columns=None, start=None, end=None, damage="raise"))]
pub(crate) fn read(
    py: Python<'_>,
    path: PathBuf,
    columns: Option<Vec<String>>,
    start: Option<&Bound<'_, PyAny>>,
    end: Option<&Bound<'_, PyAny>>,
    damage: &str,
) -> Outcome<Table> {
    open(py, path, damage)?.select(columns, start, end)?.read(py)
}

/// A tick of a recording's clock: a number of seconds, or with a UTC clock a text or a NumPy datetime.
fn tick_of(value: &Bound<'_, PyAny>, name: &'static str, time: TimeBase) -> Outcome<i64> {
    let TimeBase::Clock { decimals, format, .. } = time else {
        return value.extract().or_else(|_| refused(name, value, "the number of a row"));
    };
    let scale = 10_f64.powi(decimals.into());
    if let Ok(seconds) = value.extract::<f64>() {
        let tick = (seconds * scale).round();
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
    // An aware datetime is taken to UTC first: NumPy knows no zones.
    let given = match value.getattr("tzinfo") {
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
    if nanoseconds == i64::MIN {
        return refused(name, value, "a time");
    }
    match MAX_DECIMALS.checked_sub(decimals) {
        Some(fewer) => Ok(nanoseconds.div_euclid(10_i64.pow(fewer.into()))),
        None => nanoseconds
            .checked_mul(10_i64.pow((decimals - MAX_DECIMALS).into()))
            .map_or_else(|| refused(name, value, "a time within the clock's range"), Ok),
    }
}

/// Writes a recording row by row. After a crash the rows up to the last `sync` can be read, with `damage="skip"`.
///
/// `bounds` has the bound of each column, as in `write`. `decimals` are those of the seconds of times (3: milliseconds); None numbers the
/// rows instead. With `resume` an existing recording is continued, with its own columns and bounds.
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
    #[pyo3(signature = (path, bounds=None, *, decimals=None, utc=false, effort="thorough", resume=false))]
    fn new(
        path: PathBuf,
        bounds: Option<&Bound<'_, PyDict>>,
        decimals: Option<u8>,
        utc: bool,
        effort: &str,
        resume: bool,
    ) -> Outcome<Self> {
        let effort = crate::codec::effort(effort)?;
        let recorder = match (bounds, resume) {
            (None, true) => fewbits_record::Recorder::resume(&path)?,
            (Some(bounds), false) => {
                let names: Vec<String> = bounds
                    .keys()
                    .iter()
                    .map(|name| name.extract())
                    .collect::<PyResult<_>>()?;
                let stated: Stated = bounds.extract()?;
                let ranges = vec![None; names.len()];
                let columns = bounds::columns(&names, &stated.of(&names)?, &ranges)?;
                let time = match decimals {
                    None => TimeBase::Numbered,
                    Some(decimals) if decimals <= MAX_DECIMALS => TimeBase::Clock {
                        decimals,
                        format: if utc { TimeFormat::Utc } else { TimeFormat::Seconds },
                        tolerance: 0,
                    },
                    Some(decimals) => return refused("decimals", decimals, format!("0 to {MAX_DECIMALS}, or None")),
                };
                fewbits_record::Recorder::create(&path, Schema::new(columns, time)?)?
            }
            _ => return refused("bounds", "given with `resume`, or neither is", "one of the two"),
        };
        Ok(Self {
            recorder: Some(recorder.with_effort(effort)),
        })
    }

    /// Adds a row: its time (seconds, or what `numpy.datetime64` takes; the number of the row, or None for the next, if rows are numbered)
    /// and its cells by column. Cells that are None or left out are gaps.
    fn push(&mut self, time: &Bound<'_, PyAny>, cells: BTreeMap<String, Option<f64>>) -> Outcome<()> {
        let recorder = self.open()?;
        let schema = recorder.schema().clone();
        for name in cells.keys() {
            schema.position(name)?;
        }
        let tick = match (time.is_none(), schema.time()) {
            (true, TimeBase::Numbered) => recorder.next_tick(),
            _ => tick_of(time, "time", schema.time())?,
        };
        let row: Vec<Option<f64>> = schema
            .columns()
            .iter()
            .map(|one| cells.get(one.name()).copied().flatten())
            .collect();
        Ok(recorder.push(tick, &row)?)
    }

    /// Adds the rows of a table: every column of the recording, and `time` (timestamps, or whole ticks) unless rows are numbered.
    fn push_table(&mut self, py: Python<'_>, table: &Bound<'_, PyAny>) -> Outcome<()> {
        let given = Given::read(table)?;
        let recorder = self.open()?;
        py.detach(|| {
            for batch in given.batches() {
                recorder.push_batch(batch)?;
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
