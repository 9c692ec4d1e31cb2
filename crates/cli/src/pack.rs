//! `fewbits pack`: converts a table to a recording.

use crate::arguments::{BoundOptions, PackOptions, TableOptions};
use crate::continuing::{check_clock, own_tolerance, tell_earlier};
use crate::error::Error;
use crate::files::is_regular;
use crate::identity::Identity;
use crate::input::{Survey, Table};
use crate::live;
use crate::recording::same_unit;
use crate::rows::TableRows;
use crate::say::{self, say};
use crate::single_pass::{is_written_beside, readable_once};
use crate::target::{self, Target};
use crate::{Ending, bounds};
use fewbits_recipes::bounds::exact;
use fewbits_recipes::words;
use fewbits_record::{Bound, Column, Effort, Playback, Recorder, Schema, TimeBase};
use fewbits_table::{Kind, names};
use serde::Serialize;
use std::fs::File;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;

/// Largest number of columns of a recording.
const MAX_COLUMNS: usize = 4096;

/// Summary of what was packed.
#[derive(Serialize)]
struct Done {
    rows: u64,
    bytes: u64,
    bits_per_sample: f64,
    bounds: Vec<(String, String)>,
    #[serde(skip)]
    summary: String,
}

/// What is known of a file before its rows are packed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Known {
    /// All of its rows were read.
    All,
    /// The first rows. If others are not like them, they are refused.
    First,
}

/// The schema of a table, and the table at its first row. A file is read twice, so that all rows tell ranges, kinds and decimals; what can
/// be read once only (a pipe) is read once.
pub(crate) fn schema(table: &TableOptions, options: &BoundOptions) -> Result<(Table, Schema), Error> {
    schema_of(Table::open(table)?, table, options, Known::All)
}

fn schema_of(
    mut open: Table,
    table: &TableOptions,
    options: &BoundOptions,
    known: Known,
) -> Result<(Table, Schema), Error> {
    if open.names.len() > MAX_COLUMNS {
        let problem = format!(
            "{} columns, and a recording has at most {MAX_COLUMNS}: pack some of them into each of several files with --columns",
            open.names.len()
        );
        return Err(Error::content(open.file(), problem));
    }
    if open.names.is_empty() {
        let problem = "no column of values beside the time: name what separates cells with --delimiter, or the time with --time-column";
        return Err(Error::content(open.file(), problem));
    }
    // All rows of a file tell what its columns are.
    let survey: Option<Survey> = match (is_regular(&table.file), known) {
        (true, Known::All) => Some(open.survey(table)?),
        (true, Known::First) => Some(open.first_survey()?),
        (false, _) => None,
    };
    check_words(&open)?;
    let mut specs = bounds::parse(&options.bound, &open.names, open.file())?;
    for (i, spec) in specs.iter_mut().enumerate() {
        // Between two words there is nothing, and whole numbers beyond doubles are kept as they are.
        if matches!(open.kind(i), Kind::Words | Kind::Boolean | Kind::Integer) {
            *spec = bounds::LOSSLESS;
        }
    }
    let needs_range = specs.iter().any(|spec| matches!(spec.bound, Bound::ShareOfRange(_)));
    let unknown = vec![None; specs.len()];
    let ends = survey.as_ref().map_or(&unknown, |survey| &survey.ends);
    let ends: Vec<_> = ends
        .iter()
        .zip(&specs)
        .map(|(ends, spec)| ends.filter(|_| spec.bound != Bound::Lossless))
        .collect();
    let columns = bounds::columns(&open.names, &specs, &ends, open.file())?;
    let columns: Result<Vec<_>, _> = columns
        .into_iter()
        .enumerate()
        .map(|(i, column)| with_unit(&mut open, i, column))
        .collect();
    let columns = columns?;
    let time = open.time_base(table, survey.as_ref())?;
    let schema = Schema::new(columns, time)
        .and_then(|schema| schema.with_rows_per_block(options.rows_per_block))
        .and_then(|schema| schema.with_time_name(open.time_name()));
    let schema = schema.map_err(Error::recording(open.file()))?;
    open.use_words(&schema.columns().iter().collect::<Vec<_>>())?;
    if let Some(survey) = survey.filter(|_| needs_range) {
        warn_of_few(&table.file, &schema, &survey);
    }
    Ok((open, schema))
}

/// The column with its unit, or with its words, or as one of whole numbers.
fn with_unit(table: &mut Table, index: usize, column: Column) -> Result<Column, Error> {
    let column = match table.origin(index)? {
        Some(origin) => Column::of_integers(column.name(), origin).map_err(Error::recording(table.file()))?,
        None => column,
    };
    column
        .with_unit(table.unit(index))
        .map_err(Error::recording(table.file()))
}

/// Refuses columns whose words do not fit a header.
fn check_words(table: &Table) -> Result<(), Error> {
    let is_too_long = |i: &usize| table.kind(*i) == Kind::Words && table.unit(*i).is_empty();
    let found: Vec<_> = (0..table.names.len())
        .filter(is_too_long)
        .map(|i| say::name(&table.names[i]))
        .collect();
    if found.is_empty() {
        return Ok(());
    }
    let problem = format!(
        "words of a column may have 1024 bytes together, and those of a pipe must stand in its first lines: leave such columns out \
         with --without {}",
        names::as_argument(found)
    );
    Err(Error::content(table.file(), problem))
}

/// Warns if a bound is a share of a range that few cells make.
fn warn_of_few(file: &str, schema: &Schema, survey: &Survey) {
    for (column, few) in schema.columns().iter().zip(&survey.few) {
        let (Bound::ShareOfRange(share), None, Some(few)) = (column.bound(), column.period(), few) else {
            continue;
        };
        let (low, high) = few.ends;
        say!(
            "warning: {}: column `{}`: few cells ({:.2}%) make most of the range {} to {}, all others lie within {} to {}: {} is ±{}; if \
             they mean gaps, mend them or name them with --missing, or write the bound as ±SIZE",
            file,
            column.name(),
            100.0 * few.share_outside,
            exact(low),
            exact(high),
            exact(few.most.0),
            exact(few.most.1),
            bounds::shown(column.bound(), None),
            crate::numbers::short(share * (high - low)),
        );
    }
}

/// Packs all rows of the table and finishes the recording. Of a live table all rows before an error are kept, and the error comes second;
/// `spare`: a handle of the same file.
fn fill<W: Write>(
    table: Table,
    recorder: Recorder<W>,
    options: &PackOptions,
    spare: Option<File>,
    file: &str,
) -> Result<(W, u64, Option<Error>), Error> {
    if target::is_live() {
        return live::fill(table, recorder, options.deadline, spare, file);
    }
    let time = recorder.schema().time();
    let (mut rows, mut recorder) = (TableRows::new(table, time), recorder);
    let mut go = |_| ControlFlow::Continue(());
    let count = fewbits_recipes::pack::fill(&mut rows, &mut recorder, &mut go).map_err(Error::recipe(file))?;
    let sink = recorder.finish().map_err(Error::recording(file))?;
    Ok((sink, count, None))
}

/// The options with which a table continues a recording: its columns in their order, and its times.
fn continued(options: &TableOptions, schema: &Schema, file: &str) -> Result<TableOptions, Error> {
    let has_time = schema.time() != TimeBase::Numbered;
    if !has_time && (options.time.is_some() || options.time_column.is_some()) {
        let problem =
            "its rows have no times: leave out --time and --time-column, or pack the table into a file of its own";
        return Err(Error::content(file, problem));
    }
    Ok(TableOptions {
        // The recording's own tolerance holds.
        time: has_time.then(|| own_tolerance(schema.time())),
        ..options.clone()
    })
}

/// Continues a recording. A table that is refused, a kill and a full disk leave it as it was, and of two commands the second is refused.
fn append(options: &PackOptions, path: &Path, effort: Effort) -> Result<(Done, Option<Error>), Error> {
    let file = path.display().to_string();
    if std::fs::metadata(path).is_ok_and(|found| !found.is_file()) {
        return Err(Error::content(&file, "this is no file: a recording that is continued is read first"));
    }
    let playback = Playback::open(path).map_err(Error::recording(&file))?;
    let schema = playback.schema().clone();
    let (begin, end) = playback.ticks().map_err(Error::recording(&file))?.unzip();
    drop(playback);
    let table_options = continued(&options.table, &schema, &file)?;
    let open = || -> Result<Table, Error> {
        let mut table = Table::open(&table_options)?;
        table.use_words(&schema.columns().iter().collect::<Vec<_>>())?;
        if !schema.columns().iter().map(Column::name).eq(table.names.iter()) {
            let names = table.names.join(", ");
            let problem = format!("columns {names}: {file} has other columns, choose and order them with --columns");
            return Err(Error::content(table.file(), problem));
        }
        for (i, column) in schema.columns().iter().enumerate() {
            if words::of(column.unit()).is_none() {
                same_unit(column, &table.unit(i), &file).map_err(|problem| Error::content(table.file(), problem))?;
            }
        }
        Ok(table)
    };
    let mut table = open()?;
    check_clock(&mut table, schema.time(), begin, &file, "pack the table into a file of its own")?;
    tell_earlier(&mut table, schema.time(), end, &file)?;
    // A live table is appended as it comes: its rows cannot be read again.
    if !target::is_live() {
        TableRows::new(open()?, schema.time()).check()?;
    }
    let recorder = Recorder::resume(path).map_err(Error::recording(&file))?;
    appended(table, recorder.with_effort(effort), options, &file)
}

fn appended(
    table: Table,
    recorder: Recorder<File>,
    options: &PackOptions,
    file: &str,
) -> Result<(Done, Option<Error>), Error> {
    // The old index was removed and counts as written anew.
    let (schema, before) = (recorder.schema().clone(), recorder.bytes());
    let (mut sink, rows, error) = fill(table, recorder, options, None, file)?;
    let bytes = size_of(&mut sink).map_err(Error::recording(file))?;
    Ok((Done::of(rows, bytes.saturating_sub(before), &schema), error))
}

fn create(options: &PackOptions, effort: Effort) -> Result<(Done, Option<Error>), Error> {
    let mut options = options.clone();
    options.table.identity = Identity::wanted();
    let options = &options;
    // If no range is needed and all rows are like the first ones, reading them once gives the same bytes as reading them twice.
    if options.output.as_deref().is_some_and(is_written_beside)
        && let Some(table) = readable_once(&options.table, &options.bounds)?
        && let Ok((table, schema)) = schema_of(table, &options.table, &options.bounds, Known::First)
        && let Ok(done) = created(options, effort, table, schema)
    {
        return Ok(done);
    }
    let (table, schema) = schema(&options.table, &options.bounds)?;
    created(options, effort, table, schema)
}

fn created(
    options: &PackOptions,
    effort: Effort,
    table: Table,
    schema: Schema,
) -> Result<(Done, Option<Error>), Error> {
    let sink = Target::open_binary(options.output.as_deref())?;
    let (file, spare) = (sink.name().to_owned(), sink.spare());
    let mut recorder = Recorder::new(Counted { sink, bytes: 0 }, schema.clone()).with_effort(effort);
    if is_regular(&options.table.file) {
        let file = &options.table.file;
        let identity = options
            .table
            .identity
            .of(file, &schema)
            .map_err(Error::io(file, "read"))?;
        recorder = recorder.with_identity(identity);
    }
    let (counted, rows, error) = fill(table, recorder, options, spare, &file)?;
    if error.is_none() {
        counted.sink.finish()?;
    }
    Ok((Done::of(rows, counted.bytes, &schema), error))
}

/// Runs the task.
pub(crate) fn run(options: &PackOptions) -> Result<Ending, Error> {
    let effort = if options.fast { Effort::Fast } else { Effort::Thorough };
    let (done, error) = match (&options.output, options.append) {
        (Some(path), true) => append(options, path, effort)?,
        _ => create(options, effort)?,
    };
    if options.json {
        say::data(&serde_json::to_string(&done)?);
    } else {
        let (rows, columns, bytes) = (done.rows, done.bounds.len(), done.bytes);
        let bits = match rows {
            0 => String::new(),
            _ => format!(", {:.3} bits per sample", done.bits_per_sample),
        };
        say!("{rows} rows of {columns} columns in {bytes} bytes{bits}; bounds: {}", done.summary);
    }
    match error {
        None => Ok(Ending::Good),
        Some(error) => {
            say!("{} rows before the error were packed", done.rows);
            Err(error)
        }
    }
}

impl Done {
    fn of(rows: u64, bytes: u64, schema: &Schema) -> Self {
        let columns = schema.columns();
        let samples = (rows * columns.len() as u64).max(1);
        let bound = |column: &Column| {
            let bound = bounds::of_column(column);
            (column.name().to_owned(), bound)
        };
        Self {
            rows,
            bytes,
            bits_per_sample: 8.0 * bytes as f64 / samples as f64,
            bounds: columns.iter().map(bound).collect(),
            summary: bounds::summary(columns),
        }
    }
}

fn size_of(file: &mut File) -> Result<u64, fewbits_record::Error> {
    let size = file.metadata().map(|data| data.len());
    size.map_err(|source| fewbits_record::Error::Io { action: "read", source })
}

/// A sink that counts the bytes written.
struct Counted<W> {
    sink: W,
    bytes: u64,
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.sink.write(bytes)?;
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.sink.flush()
    }
}
