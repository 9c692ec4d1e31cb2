//! Recordings: any table into a file within stated bounds, and back.

use crate::clock::clock;
use crate::error::{Outcome, refused};
use crate::given::named;
use crate::table::{Cells, Given, Table, doubles};
use arrow_array::{ArrayRef, StringArray};
use arrow_schema::DataType;
use fewbits_recipes::bounds::{self, Spec};
use fewbits_recipes::source::{Batch, Columns};
use fewbits_recipes::{Error as RecipeError, Progress};
use fewbits_record::{Column, Integers, Playback, Recorder, Schema, TimeBase};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Looks at signals such as Ctrl-C between batches; the first exception is kept for the caller.
fn watch(stopped: &mut Option<PyErr>) -> impl FnMut(Progress) -> ControlFlow<()> {
    |_| match Python::attach(|py| py.check_signals()) {
        Ok(()) => ControlFlow::Continue(()),
        Err(error) => {
            *stopped = Some(error);
            ControlFlow::Break(())
        }
    }
}

/// What the exception of a callback becomes: itself.
fn heard<T>(result: Result<T, RecipeError>, stopped: Option<PyErr>) -> Outcome<T> {
    match (result, stopped) {
        (Err(RecipeError::Stopped), Some(error)) => Err(error.into()),
        (result, _) => Ok(result?),
    }
}

/// Bounds as Python states them: one text for all columns, a number, or a dictionary of either by column.
#[derive(FromPyObject)]
pub(crate) enum Stated {
    Number(f64),
    Text(String),
    ByColumn(BTreeMap<String, Each>),
}

#[derive(FromPyObject)]
pub(crate) enum Each {
    Number(f64),
    Text(String),
}

impl Each {
    fn parsed(&self) -> Result<Spec, RecipeError> {
        match self {
            Self::Number(bound) => bounds::parse_one(&format!("±{bound}")),
            Self::Text(text) => bounds::parse_one(text),
        }
    }
}

impl Stated {
    pub(crate) fn of(&self, names: &[String]) -> Result<Vec<Spec>, RecipeError> {
        match self {
            Self::Number(bound) => Ok(vec![Each::Number(*bound).parsed()?; names.len()]),
            Self::Text(text) => bounds::parse(text, names),
            Self::ByColumn(stated) => {
                let others = stated.get("*").map_or(Ok(Spec::LOSSLESS), Each::parsed)?;
                for name in stated.keys().filter(|name| *name != "*") {
                    fewbits_recipes::names::position(names, name)?;
                }
                let of = |name: &String| stated.get(name).map_or(Ok(others), Each::parsed);
                names.iter().map(of).collect()
            }
        }
    }
}

/// A table as a recording takes it.
struct Taken {
    names: Vec<String>,
    /// Numbers; of whole numbers that no double holds their codes, which count from the smallest.
    columns: Vec<Cells>,
    /// These whole numbers.
    whole: Vec<Option<Vec<Option<i64>>>>,
    time: TimeBase,
    ticks: Option<Vec<i64>>,
}

impl Taken {
    fn of(given: &Given, time: Option<&str>) -> Outcome<Self> {
        if let Some(time) = time {
            given.kind(time)?;
        }
        let names: Vec<String> = given
            .names()
            .into_iter()
            .filter(|name| Some(name.as_str()) != time)
            .collect();
        if let Some(stamps) = names
            .iter()
            .find(|name| matches!(given.kind(name), Ok(DataType::Timestamp(..) | DataType::Date32 | DataType::Date64)))
        {
            let expected = match stamps.starts_with("__index_level_") {
                true => {
                    "numbers: name the column of times in `time`; `frame.rename_axis(\"time\")` gives pandas' index a name"
                }
                false => "numbers: name the column of times in `time`, and leave out others",
            };
            return refused("column", format!("'{stamps}' of times"), expected);
        }
        let (mut columns, mut whole) = (Vec::with_capacity(names.len()), Vec::with_capacity(names.len()));
        for name in &names {
            let numbers = given.whole(name)?;
            columns.push(match &numbers {
                Some(numbers) => codes(numbers, from_least(numbers)),
                None => given.numbers(name)?,
            });
            whole.push(numbers);
        }
        let (time, ticks) = match time {
            Some(name) => {
                let (base, ticks) = clock(given, name)?;
                (base, Some(ticks))
            }
            None => (TimeBase::Numbered, None),
        };
        Ok(Self {
            names,
            columns,
            whole,
            time,
            ticks,
        })
    }

    /// The columns of the recording: whole numbers that no double holds are exact, whatever bound is stated.
    fn with_whole(&self, columns: Vec<Column>) -> Outcome<Vec<Column>> {
        let columns = columns.into_iter().zip(&self.whole);
        let column = |(column, whole): (Column, &Option<Vec<Option<i64>>>)| match whole {
            Some(numbers) => Ok(Column::of_integers(column.name(), from_least(numbers).origin())?),
            None => Ok(column),
        };
        columns.map(column).collect()
    }

    fn ranges(&self) -> Vec<Option<(f64, f64)>> {
        let range = |cells: &Cells| {
            let finite = cells.iter().flatten().copied().filter(|x| x.is_finite());
            finite.fold(None, |range: Option<(f64, f64)>, x| {
                Some(range.map_or((x, x), |(from, to)| (from.min(x), to.max(x))))
            })
        };
        self.columns.iter().map(range).collect()
    }

    fn source(self) -> Columns {
        Columns::new(Batch {
            ticks: self.ticks,
            columns: self.columns,
        })
    }
}

/// Writes a table into a recording, each cell within the bound of its column. Returns the number of bytes.
///
/// `table` is anything with `__arrow_c_stream__`. `time` names its column of times: timestamps, or numbers of seconds; without it rows are
/// numbered. The recording keeps its name, and whether timestamps have a zone. `bounds` is a number, a text such as "±0.1", "1%", "decimals:3" or "temp=±0.1,*=lossless", or a dictionary of these by column,
/// with "*" for all others. Nulls and NaN return as they are; whole numbers that no
/// double holds are exact. The file is complete or, after an error, as it was before.
///
/// >>> import pyarrow as pa, fewbits as fb, tempfile, os
/// >>> path = os.path.join(tempfile.mkdtemp(), "room.fewb")
/// >>> table = pa.table({"t": [0.0, 0.5, 1.0], "temp": [20.11, None, 20.32], "door": [0, 1, 1]})
/// >>> size = fb.write(table, path, time="t", bounds={"temp": 0.05})
/// >>> back = fb.read(path)
/// >>> back.columns, len(back), bool(abs(back["temp"][0] - 20.11) <= 0.05)
/// (['t', 'temp', 'door'], 3, True)
/// >>> fb.verify(table, path, time="t")["holds"]
/// True
#[pyfunction]
#[pyo3(signature = (table, path, *, time=None, bounds=Stated::Text("lossless".to_owned()), effort="thorough"))]
pub(crate) fn write(
    py: Python<'_>,
    table: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = named)] path: PathBuf,
    #[pyo3(from_py_with = named)] time: Option<&str>,
    #[pyo3(from_py_with = named)] bounds: Stated,
    #[pyo3(from_py_with = named)] effort: &str,
) -> Outcome<u64> {
    let effort = crate::codec::effort(effort)?;
    let taken = Taken::of(&Given::read(table)?, time)?;
    let specs = bounds.of(&taken.names)?;
    let columns = taken.with_whole(bounds::columns(&taken.names, &specs, &taken.ranges())?)?;
    let schema = Schema::new(columns, taken.time)?.with_time_name(time.unwrap_or_default())?;
    py.detach(|| {
        // A link stays a link.
        let path = path.canonicalize().unwrap_or(path);
        let earlier = std::fs::metadata(&path).ok();
        // What may not be written to is not replaced.
        let open = earlier
            .as_ref()
            .map(|_| std::fs::OpenOptions::new().write(true).open(&path));
        let open = open.transpose()?;
        let is_file = earlier.as_ref().is_none_or(std::fs::Metadata::is_file);
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let beside = match (folder, is_file) {
            (_, false) => new_file().tempfile()?,
            (folder, true) => new_file().tempfile_in(folder.unwrap_or(Path::new(".")))?,
        };
        let mut recorder = Recorder::new(BufWriter::new(beside), schema).with_effort(effort);
        let mut stopped = None;
        let filled = fewbits_recipes::pack::fill(&mut taken.source(), &mut recorder, &mut watch(&mut stopped));
        heard(filled, stopped)?;
        let mut written = recorder.finish()?;
        written.flush()?;
        let beside = written.into_inner().map_err(std::io::IntoInnerError::into_error)?;
        let bytes = beside.as_file().metadata()?.len();
        match (open, earlier) {
            // A pipe or a device is written to.
            (Some(mut device), _) if !is_file => {
                std::io::copy(&mut beside.reopen()?, &mut device)?;
            }
            (_, earlier) => {
                if let Some(earlier) = earlier {
                    beside.as_file().set_permissions(earlier.permissions())?;
                }
                beside.persist(&path).map_err(|error| error.error)?;
            }
        }
        Ok(bytes)
    })
}

/// A new file with the rights that a program's files have.
fn new_file() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder
}

/// The codes of whole numbers that count from the smallest.
fn from_least(numbers: &[Option<i64>]) -> Integers {
    Integers::from_origin(numbers.iter().flatten().min().copied().unwrap_or(0))
}

fn codes(numbers: &[Option<i64>], integers: Integers) -> Cells {
    numbers
        .iter()
        .map(|number| number.map(|number| integers.code(number)))
        .collect()
}

pub(crate) fn opened(path: &Path) -> Outcome<Playback<BufReader<File>>> {
    let named = |error: std::io::Error| std::io::Error::new(error.kind(), format!("{}: {error}", path.display()));
    Ok(Playback::opened(BufReader::new(File::open(path).map_err(named)?), path)?)
}

/// Bits per sample that each column would need, at several bounds.
///
/// The result has a row per column and bound: the bound as a share of the column's range and in its unit (0 is lossless), bits per sample.
///
/// >>> import numpy as np, polars as pl, fewbits as fb
/// >>> planned = fb.plan(pl.DataFrame({"t": np.arange(500.0), "temp": np.sin(np.arange(500) / 40)}), time="t")
/// >>> planned.columns, len(planned)
/// (['column', 'share', 'bound', 'bits'], 8)
#[pyfunction]
#[pyo3(signature = (table, *, time=None))]
pub(crate) fn plan(
    py: Python<'_>,
    table: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = named)] time: Option<&str>,
) -> Outcome<Table> {
    let taken = Taken::of(&Given::read(table)?, time)?;
    let (names, base) = (taken.names.clone(), taken.time);
    // Codes are distances from the smallest number where these are doubles.
    let near = |numbers: &Option<Vec<Option<i64>>>| {
        numbers.as_ref().is_none_or(|numbers| {
            let integers = from_least(numbers);
            let largest = numbers.iter().flatten().max().copied().unwrap_or(0);
            largest
                .checked_sub(integers.origin())
                .is_some_and(|width| width <= 1 << 53)
        })
    };
    if let Some((name, _)) = names.iter().zip(&taken.whole).find(|(_, numbers)| !near(numbers)) {
        return refused("column", format!("'{name}'"), "whole numbers within 53 bits of each other: leave it out");
    }
    let planned = py.detach(|| {
        let mut stopped = None;
        let batch = Batch {
            ticks: taken.ticks,
            columns: taken.columns,
        };
        let rows = fewbits_record::ROWS_PER_BLOCK;
        let planned = fewbits_recipes::plan::plan(&names, &batch, base, rows, &mut watch(&mut stopped));
        heard(planned, stopped)
    })?;
    let (mut columns, mut shares, mut bounds, mut bits) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for column in planned.columns {
        let lossless = (0.0, 0.0, column.lossless_bits);
        for (percent, bound, size) in std::iter::once(lossless).chain(column.bounds) {
            columns.push(column.name.clone());
            shares.push(percent / 100.0);
            bounds.push(bound);
            bits.push(size);
        }
    }
    Table::new(vec![
        ("column".to_owned(), Arc::new(StringArray::from(columns)) as ArrayRef),
        ("share".to_owned(), doubles(shares)),
        ("bound".to_owned(), doubles(bounds)),
        ("bits".to_owned(), doubles(bits)),
    ])
}

/// Compares every cell of a recording with the table that it was made of. Columns are matched by name.
///
/// Returns a dictionary: whether all promises hold (`holds`), the rows compared, and the failed cells and the largest error by column.
///
/// >>> import polars as pl, fewbits as fb, tempfile, os
/// >>> path = os.path.join(tempfile.mkdtemp(), "room.fewb")
/// >>> _ = fb.write(pl.DataFrame({"temp": [20.11, 20.32]}), path, bounds=0.1)
/// >>> fb.verify(pl.DataFrame({"temp": [20.11, 20.92]}), path)["failed"]
/// {'temp': 1}
#[pyfunction]
#[pyo3(signature = (table, path, *, time=None))]
pub(crate) fn verify<'py>(
    py: Python<'py>,
    table: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = named)] path: PathBuf,
    #[pyo3(from_py_with = named)] time: Option<&str>,
) -> Outcome<Bound<'py, PyDict>> {
    let mut playback = opened(&path)?;
    let mut taken = Taken::of(&Given::read(table)?, time)?;
    if let (TimeBase::Clock { decimals, .. }, TimeBase::Clock { decimals: given, .. }, Some(ticks)) =
        (playback.schema().time(), taken.time, &mut taken.ticks)
    {
        rescale(ticks, given, decimals)?;
    }
    let matches = taken
        .names
        .iter()
        .map(|name| playback.schema().position(name))
        .collect::<Result<Vec<_>, _>>()?;
    for ((cells, whole), index) in taken.columns.iter_mut().zip(&taken.whole).zip(&matches) {
        let column = &playback.schema().columns()[*index];
        // A column of whole numbers has codes of these.
        match (column.integers(), whole) {
            (Some(integers), Some(numbers)) => *cells = codes(numbers, integers),
            (Some(integers), None) => {
                let code = |number: f64| integers.code_of(number).unwrap_or(f64::NAN);
                cells.iter_mut().flatten().for_each(|cell| *cell = code(*cell));
            }
            (None, Some(_)) => {
                let given = format!("'{}' of whole numbers of more than 53 bits", column.name());
                return refused("column", given, "numbers that doubles hold, as the recording's");
            }
            (None, None) => {}
        }
    }
    let verdict = py.detach(|| {
        let mut stopped = None;
        let verdict =
            fewbits_recipes::verify::verify(&mut playback, &mut taken.source(), &matches, &mut watch(&mut stopped));
        heard(verdict, stopped)
    })?;
    let found = PyDict::new(py);
    found.set_item("holds", verdict.holds)?;
    found.set_item("rows", verdict.rows)?;
    found.set_item("missing_rows", verdict.missing_rows)?;
    found.set_item("extra_rows", verdict.extra_rows)?;
    found.set_item("times_failed", verdict.ticks_failed)?;
    found.set_item("damage", verdict.damage)?;
    let failed = PyDict::new(py);
    let largest = PyDict::new(py);
    for column in &verdict.columns {
        failed.set_item(&column.name, column.failed)?;
        largest.set_item(&column.name, column.largest_error)?;
    }
    found.set_item("failed", failed)?;
    found.set_item("largest_error", largest)?;
    found.set_item("not_compared", verdict.not_compared)?;
    Ok(found)
}

/// Ticks of one number of decimals as ticks of another.
fn rescale(ticks: &mut [i64], from: u8, to: u8) -> Outcome<()> {
    let scale = 10_i64.pow(u32::from(from.abs_diff(to)));
    for tick in ticks {
        let scaled = if to >= from {
            tick.checked_mul(scale)
        } else {
            (*tick % scale == 0).then(|| *tick / scale)
        };
        match scaled {
            Some(scaled) => *tick = scaled,
            None => return refused("time", *tick, "times that are ticks of the recording"),
        }
    }
    Ok(())
}
