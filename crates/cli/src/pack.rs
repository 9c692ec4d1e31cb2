//! `fewbits pack`: converts a table to a recording.

use crate::arguments::{BoundOptions, PackOptions, TableOptions};
use crate::error::Error;
use crate::input::{Survey, Table};
use crate::{Ending, bounds, output};
use fewbits_record::{Bound, Effort, Recorder, Schema};
use serde::Serialize;
use std::io::{Write, stderr};

/// Summary of what was packed.
#[derive(Serialize)]
struct Done {
    rows: u64,
    bytes: u64,
    bits_per_sample: f64,
}

/// The schema of a table, and the table at its first row. A file is read twice if ranges or the decimals of times are needed.
pub(crate) fn schema(table: &TableOptions, options: &BoundOptions) -> Result<(Table, Schema), Error> {
    let mut open = Table::open(table)?;
    let specs = bounds::parse(&options.bound, &open.names, open.file())?;
    let needs_range = specs.iter().any(|spec| matches!(spec.bound, Bound::ShareOfRange(_)));
    let has_time = table.time.is_some() || table.time_column.is_some();
    let survey: Option<Survey> = if table.file != "-" && (needs_range || has_time) {
        Some(Table::survey(table)?)
    } else {
        None
    };
    let unknown = vec![None; specs.len()];
    let ends = survey.as_ref().map_or(&unknown, |survey| &survey.ends);
    let columns = bounds::columns(&open.names, &specs, ends, open.file())?;
    let time = open.time_base(table, survey.as_ref())?;
    let schema = Schema::new(columns, time).and_then(|schema| schema.with_rows_per_block(options.rows_per_block));
    let schema = schema.map_err(Error::recording(open.file()))?;
    Ok((open, schema))
}

/// Packs all rows of the table.
fn fill<W: Write>(table: &mut Table, recorder: &mut Recorder<W>, file: &str) -> Result<u64, Error> {
    let (time, mut rows) = (recorder.schema().time(), 0);
    while let Some((tick, cells)) = table.next(time)? {
        let pushed = match tick {
            Some(tick) => recorder.push(tick, &cells),
            None => recorder.push_next(&cells),
        };
        pushed.map_err(Error::recording(file))?;
        rows += 1;
    }
    Ok(rows)
}

/// Runs the task.
pub(crate) fn run(options: &PackOptions) -> Result<Ending, Error> {
    let effort = if options.fast { Effort::Fast } else { Effort::Thorough };
    let (rows, bytes, columns) = match (&options.output, options.append) {
        (Some(path), true) => {
            let file = path.display().to_string();
            let mut recorder = Recorder::resume(path)
                .map_err(Error::recording(&file))?
                .with_effort(effort);
            let mut table = Table::open(&options.table)?;
            let columns = recorder.schema().columns();
            if !columns.iter().map(fewbits_record::Column::name).eq(table.names.iter()) {
                let names = table.names.join(", ");
                let problem =
                    format!("columns {names}: {file} has other columns, choose and order them with --columns");
                return Err(Error::content(table.file(), problem));
            }
            // The old index was removed and counts as written anew.
            let (columns, before) = (columns.len(), recorder.bytes());
            let rows = fill(&mut table, &mut recorder, &file)?;
            let bytes = recorder
                .finish()
                .and_then(|mut file| size_of(&mut file))
                .map_err(Error::recording(&file))?;
            (rows, bytes.saturating_sub(before), columns)
        }
        (path, _) => {
            let (mut table, schema) = schema(&options.table, &options.bounds)?;
            let (sink, file) = output::open_binary(path.as_deref())?;
            let columns = schema.columns().len();
            let mut recorder = Recorder::new(Counted { sink, bytes: 0 }, schema).with_effort(effort);
            let rows = fill(&mut table, &mut recorder, &file)?;
            let counted = recorder.finish().map_err(Error::recording(&file))?;
            (rows, counted.bytes, columns)
        }
    };
    let samples = (rows * columns as u64).max(1);
    let done = Done {
        rows,
        bytes,
        bits_per_sample: 8.0 * bytes as f64 / samples as f64,
    };
    if options.json {
        serde_json::to_writer(stderr(), &done)?;
        eprintln!();
    } else {
        eprint!("{rows} rows of {columns} columns in {bytes} bytes");
        match rows {
            0 => eprintln!(),
            _ => eprintln!(", {:.3} bits per sample", done.bits_per_sample),
        }
    }
    Ok(Ending::Good)
}

fn size_of(file: &mut std::fs::File) -> Result<u64, fewbits_record::Error> {
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
