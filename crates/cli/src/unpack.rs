//! `fewbits unpack` and `fewbits cat`: convert a recording to CSV or JSON lines.

use crate::arguments::{CatOptions, UnpackOptions};
use crate::clock::{self, End};
use crate::error::Error;
use crate::files::is_regular;
use crate::output::{Shape, Writer};
use crate::recording::same_unit;
use crate::say::{self, say};
use crate::{Ending, recording};
use fewbits_recipes::unpack::{self, Selection};
use fewbits_recipes::{Failure, words};
use fewbits_record::{Block, BlockReader, Playback, Schema, TimeBase, merged};
use std::ops::ControlFlow;
use std::path::Path;

impl UnpackOptions {
    /// All rows and columns.
    pub(crate) fn whole(self) -> CatOptions {
        CatOptions {
            files: self.files,
            from: None,
            to: None,
            columns: Vec::new(),
            every: None,
            mean: false,
            min: false,
            max: false,
            count: false,
            json: false,
            output: self.output,
        }
    }
}

fn end(text: Option<&String>, option: &'static str, time: TimeBase, end: End) -> Result<i64, Error> {
    match (text, end) {
        (Some(text), _) => clock::tick(text, time, end).map_err(|expected| Error::option(option, text, expected)),
        (None, End::From) => Ok(i64::MIN),
        (None, End::To) => Ok(i64::MAX),
    }
}

/// The selected rows and columns.
pub(crate) fn selection(options: &CatOptions, schema: &Schema, file: &str) -> Result<Selection, Error> {
    let mut selection = Selection::new(schema, &options.columns).map_err(Error::recording(file))?;
    selection.ticks = (
        end(options.from.as_ref(), "--from", schema.time(), End::From)?,
        end(options.to.as_ref(), "--to", schema.time(), End::To)?,
    );
    Ok(selection)
}

/// Writes the rows. Damaged parts are reported on standard error.
pub(crate) fn write_blocks(
    blocks: impl Iterator<Item = Result<Block, fewbits_record::Error>>,
    writer: &mut Writer,
    selection: &Selection,
    file: &str,
) -> Result<Ending, Error> {
    let mut ending = Ending::Good;
    let mut write = |tick: i64, values: &[Option<f64>]| -> Result<(), Failure> { Ok(writer.write(tick, values)?) };
    let mut damaged = |error: &fewbits_record::Error| {
        say!("warning: {file}: {error}; the rest is read");
        ending = Ending::Failed;
    };
    let mut go = |_| ControlFlow::Continue(());
    unpack::rows(blocks, selection, &mut write, &mut damaged, &mut go).map_err(Error::recipe(file))?;
    writer.flush()?;
    Ok(ending)
}

/// What is said of a recording without its end.
pub(crate) fn warn_of_end(file: &str) {
    say!("warning: {file}: the end is missing (not finished, or cut off): rows may be missing behind the last");
}

/// Runs the task.
pub(crate) fn run(options: &CatOptions) -> Result<Ending, Error> {
    let [file] = options.files.as_slice() else {
        return several(options);
    };
    let shape = Shape::of(options.json);
    // What is no file is read once, from front to end.
    if !is_regular(file) {
        let (source, file) = recording::stream(file)?;
        let blocks = BlockReader::new(source).map_err(Error::recording(file))?;
        let selection = selection(options, blocks.schema(), file)?;
        let mut writer = Writer::new(options.output.as_deref(), shape, blocks.schema(), &selection.names)?;
        let ending = write_blocks(blocks, &mut writer, &selection, file)?;
        return writer.finish().map(|()| ending);
    }
    let mut playback = Playback::open(file).map_err(Error::recording(file))?;
    let selection = selection(options, playback.schema(), file)?;
    let mut writer = Writer::new(options.output.as_deref(), shape, playback.schema(), &selection.names)?;
    let names: Vec<&str> = selection.names.iter().map(String::as_str).collect();
    playback.columns(&names).map_err(Error::recording(file))?;
    let is_finished = playback.is_finished();
    let blocks = playback.blocks_between(selection.ticks.0, selection.ticks.1);
    let ending = write_blocks(blocks, &mut writer, &selection, file)?;
    writer.finish()?;
    if !is_finished {
        warn_of_end(file);
        return Ok(Ending::Failed);
    }
    Ok(ending)
}

/// Several recordings as one table.
fn several(options: &CatOptions) -> Result<Ending, Error> {
    let open = |file: &String| recording::open(Path::new(file));
    let mut playbacks: Vec<_> = options.files.iter().map(open).collect::<Result<_, Error>>()?;
    let first = &options.files[0];
    let schema =
        finest(playbacks[0].schema(), playbacks.iter().map(Playback::schema)).map_err(Error::recording(first))?;
    let selection = selection(options, &schema, first)?;
    let names: Vec<&str> = selection.names.iter().map(String::as_str).collect();
    let unfinished: Vec<usize> = (0..playbacks.len()).filter(|i| !playbacks[*i].is_finished()).collect();
    let together = format!("{} recordings", options.files.len());
    words_agree(&schema, playbacks.iter().map(Playback::schema), &options.files)?;
    let rows = merged(&mut playbacks, &names, selection.ticks).map_err(Error::recording(&together))?;
    let mut writer = Writer::new(options.output.as_deref(), Shape::of(options.json), &schema, &selection.names)?;
    let mut ending = Ending::Good;
    for row in rows {
        match row {
            Ok(row) => writer.write(row.tick, &row.values)?,
            // Of a recording without its end more is said below.
            Err(error @ fewbits_record::Error::Block { .. }) => {
                say!("warning: {together}: {error}; the rest is read");
                ending = Ending::Failed;
            }
            Err(error) => return Err(Error::recording(&together)(error)),
        }
    }
    writer.finish()?;
    for i in unfinished {
        warn_of_end(&options.files[i]);
        ending = Ending::Failed;
    }
    Ok(ending)
}

/// The schema of the first recording, with ticks as fine as the finest.
fn finest<'a>(first: &Schema, all: impl Iterator<Item = &'a Schema>) -> Result<Schema, fewbits_record::Error> {
    let decimals = all.map(|schema| match schema.time() {
        TimeBase::Clock { decimals, .. } => decimals,
        _ => 0,
    });
    let finest = decimals.max().unwrap_or(0);
    match first.time() {
        TimeBase::Clock { format, tolerance, .. } => {
            let time = TimeBase::Clock {
                decimals: finest,
                tolerance,
                format,
            };
            Schema::new(first.columns().to_vec(), time)?.with_time_name(first.time_name())
        }
        _ => Ok(first.clone()),
    }
}

/// Refuses recordings whose words have other numbers, or whose columns have other units: the unit of a column of words lists them.
pub(crate) fn words_agree<'a>(
    first: &Schema,
    all: impl Iterator<Item = &'a Schema>,
    files: &[String],
) -> Result<(), Error> {
    for (schema, file) in all.zip(files) {
        for column in first.columns() {
            let unit = |schema: &Schema| {
                schema
                    .position(column.name())
                    .map(|i| schema.columns()[i].unit().to_owned())
            };
            if let Ok(unit) = unit(schema)
                && unit != column.unit()
                && (words::of(&unit).is_some() || words::of(column.unit()).is_some())
            {
                let name = say::name(column.name());
                return Err(Error::content(file, format!("column `{name}` has other words than in {}", files[0])));
            }
            if let Ok(unit) = unit(schema) {
                same_unit(column, &unit, &files[0]).map_err(|problem| Error::content(file, problem))?;
            }
        }
    }
    Ok(())
}
