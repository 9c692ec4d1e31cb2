//! Recordings that are open: rows by time and column, read when they are asked for.

use crate::clock;
use crate::error::{Outcome, refused};
use crate::given::named;
use crate::record::opened;
use crate::recorder::{Rounding, tick_of};
use crate::table::{Table, joined};
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{Array, RecordBatch, RecordBatchReader};
use arrow_schema::{ArrowError, Field, SchemaRef};
use fewbits_recipes::bounds;
use fewbits_record::{Block, Schema, TimeBase};
use pyo3::prelude::*;
use pyo3::types::PyCapsule;
use std::collections::BTreeMap;
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
pub(crate) fn open(
    py: Python<'_>,
    #[pyo3(from_py_with = named)] path: PathBuf,
    #[pyo3(from_py_with = named)] damage: &str,
) -> Outcome<Recording> {
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

    /// Whether rows have numbers in place of times.
    #[getter]
    fn numbered(&self) -> bool {
        self.schema.time() == TimeBase::Numbered
    }

    /// Names of the columns; the first is the time, or the number of the row.
    #[getter]
    fn columns(&self) -> Vec<String> {
        clock::fields(&self.schema)
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
    /// `start` and `end` are numbers of seconds, row numbers if the recording has no times, or what `numpy.datetime64` takes if its times
    /// are timestamps. Blocks outside are not decoded.
    #[pyo3(signature = (columns=None, *, start=None, end=None))]
    fn select(
        &self,
        #[pyo3(from_py_with = named)] columns: Option<Vec<String>>,
        start: Option<&Bound<'_, PyAny>>,
        end: Option<&Bound<'_, PyAny>>,
    ) -> Outcome<Rows> {
        let time = self.schema.time();
        let from = start.map_or(Ok(i64::MIN), |start| tick_of(start, "start", time, Rounding::Up))?;
        let to = match end {
            None => i64::MAX,
            Some(end) => match tick_of(end, "end", time, Rounding::Up)?.checked_sub(1) {
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
    ///
    /// >>> import polars as pl, fewbits as fb, tempfile, os
    /// >>> path = os.path.join(tempfile.mkdtemp(), "room.fewb")
    /// >>> _ = fb.write(pl.DataFrame({"a": [1.5, None, 2.5], "b": [1, 2, 3]}), path)
    /// >>> with fb.open(path) as recording:
    /// ...     recording.select(columns=["b"]).read()["b"]
    /// array([1., 2., 3.])
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
        let column = |(i, field): (usize, &Arc<Field>)| {
            let parts: Vec<&dyn Array> = batches.iter().map(|batch| &**batch.column(i)).collect();
            joined(field.data_type(), &parts)
        };
        let columns = fields.fields().iter().enumerate().map(column);
        let columns = columns.collect::<Result<_, _>>()?;
        Ok(Table::of(RecordBatch::try_new(fields.clone(), columns)?))
    }
}

impl Rows {
    /// The fields of the result, and a reader whose blocks another thread decodes ahead.
    fn batches(&self) -> Outcome<Batches> {
        let places: Vec<usize> = std::iter::once(0).chain(self.chosen.iter().map(|at| at + 1)).collect();
        let fields = Arc::new(clock::fields(&self.schema).project(&places)?);
        let mut playback = opened(&self.path)?;
        if *playback.schema() != self.schema {
            return refused("path", self.path.display(), "the recording that was opened: another is there now");
        }
        let (schema, (from, to)) = (self.schema.clone(), self.ticks);
        let names: Vec<&str> = self.chosen.iter().map(|at| schema.columns()[*at].name()).collect();
        playback.columns(&names)?;
        let (sender, receiver) = sync_channel(AHEAD);
        let (none, damaged, own) = (self.chosen.is_empty(), self.damaged, fields.clone());
        let work = move || {
            for block in playback.blocks_between(from, to) {
                let batch = block.and_then(|mut block| {
                    keep_between(&mut block, from, to);
                    if block.ticks.is_empty() {
                        return Ok(None);
                    }
                    if none {
                        block.columns.iter_mut().for_each(Vec::clear);
                    }
                    let batch = block.to_record_batch(&schema)?;
                    Ok(Some(clock::shown(&batch, &block.ticks, &schema, own.clone())?))
                });
                let Some(batch) = batch.transpose() else {
                    continue;
                };
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
/// `start` and `end` are numbers of seconds, row numbers if the recording has no times, or what `numpy.datetime64` takes if its times are timestamps.
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
    #[pyo3(from_py_with = named)] path: PathBuf,
    #[pyo3(from_py_with = named)] columns: Option<Vec<String>>,
    start: Option<&Bound<'_, PyAny>>,
    end: Option<&Bound<'_, PyAny>>,
    #[pyo3(from_py_with = named)] damage: &str,
) -> Outcome<Table> {
    open(py, path, damage)?.select(columns, start, end)?.read(py)
}
