//! `fewbits unpack` and `fewbits cat`: convert a recording to CSV or JSON lines.

use crate::arguments::{CatOptions, UnpackOptions};
use crate::error::Error;
use crate::files::is_regular;
use crate::output::{Shape, Writer};
use crate::say::say;
use crate::{Ending, clock, recording};
use fewbits_record::{Block, BlockReader, Column, Playback, Schema, TimeBase};

impl UnpackOptions {
    /// All rows and columns.
    pub(crate) fn whole(self) -> CatOptions {
        CatOptions {
            file: self.file,
            from: None,
            to: None,
            columns: Vec::new(),
            json: false,
            output: self.output,
        }
    }
}

/// The selected rows and columns.
struct Selection {
    from: i64,
    to: i64,
    columns: Vec<usize>,
    names: Vec<String>,
}

fn end(text: Option<&String>, option: &'static str, time: TimeBase, otherwise: i64) -> Result<i64, Error> {
    let Some(text) = text else { return Ok(otherwise) };
    let expected = match time {
        TimeBase::Numbered => "a row number, since this recording has no times",
        _ => "a time as the recording writes it",
    };
    clock::tick(text, time).map_err(|_| Error::option(option, text, expected))
}

fn selection(options: &CatOptions, schema: &Schema) -> Result<Selection, Error> {
    let all = || schema.columns().iter().map(|column| column.name().to_owned()).collect();
    let names: Vec<String> = if options.columns.is_empty() {
        all()
    } else {
        options.columns.clone()
    };
    let columns = names.iter().map(|name| schema.position(name)).collect::<Result<_, _>>();
    Ok(Selection {
        from: end(options.from.as_ref(), "--from", schema.time(), i64::MIN)?,
        to: end(options.to.as_ref(), "--to", schema.time(), i64::MAX)?,
        columns: columns.map_err(Error::recording(&options.file))?,
        names,
    })
}

/// Writes the rows. Damaged parts are reported on standard error.
pub(crate) fn write_blocks(
    blocks: impl Iterator<Item = Result<Block, fewbits_record::Error>>,
    writer: &mut Writer,
    ticks: (i64, i64),
    columns: &[usize],
    file: &str,
) -> Result<Ending, Error> {
    let mut ending = Ending::Good;
    for block in blocks {
        let block = match block {
            Ok(block) => block,
            Err(error @ fewbits_record::Error::Block { .. }) => {
                say!("warning: {file}: {error}; the rest is read");
                ending = Ending::Failed;
                continue;
            }
            Err(error) => return Err(Error::recording(file)(error)),
        };
        let mut values = Vec::with_capacity(columns.len());
        for (row, tick) in block.ticks.iter().enumerate() {
            if *tick < ticks.0 || *tick > ticks.1 {
                continue;
            }
            values.clear();
            values.extend(columns.iter().map(|column| block.columns[*column][row]));
            writer.write(*tick, &values)?;
        }
    }
    writer.flush()?;
    Ok(ending)
}

/// Runs the task.
pub(crate) fn run(options: &CatOptions) -> Result<Ending, Error> {
    let shape = Shape::of(options.json);
    // What is no file is read once, from front to end.
    if !is_regular(&options.file) {
        let (source, file) = recording::stream(&options.file)?;
        let blocks = BlockReader::new(source).map_err(Error::recording(file))?;
        let selection = selection(options, blocks.schema())?;
        let mut writer = Writer::new(options.output.as_deref(), shape, blocks.schema(), &selection.names)?;
        let ticks = (selection.from, selection.to);
        let ending = write_blocks(blocks, &mut writer, ticks, &selection.columns, file)?;
        return writer.finish().map(|()| ending);
    }
    let file = options.file.as_str();
    let mut playback = Playback::open(file).map_err(Error::recording(file))?;
    let selection = selection(options, playback.schema())?;
    let mut writer = Writer::new(options.output.as_deref(), shape, playback.schema(), &selection.names)?;
    let names: Vec<&str> = selection.names.iter().map(String::as_str).collect();
    playback.columns(&names).map_err(Error::recording(file))?;
    let is_finished = playback.has_index();
    let ticks = (selection.from, selection.to);
    let blocks = playback.blocks_between(ticks.0, ticks.1);
    let ending = write_blocks(blocks, &mut writer, ticks, &selection.columns, file)?;
    writer.finish()?;
    if !is_finished {
        say!("warning: {file}: the end is missing (not finished, or cut off): rows may be missing behind the last");
        return Ok(Ending::Failed);
    }
    Ok(ending)
}

/// All columns of a schema.
pub(crate) fn all_columns(schema: &Schema) -> (Vec<usize>, Vec<String>) {
    let names = schema.columns().iter().map(Column::name).map(str::to_owned);
    ((0..schema.columns().len()).collect(), names.collect())
}
