//! Opening of tables: from options and files to tables of the crate `table`.

use crate::arguments::TableOptions;
use crate::clock;
use crate::error::Error;
use fewbits_table::{Scale, names};
use indicatif::{ProgressBar, ProgressStyle};
use std::fs::File;
use std::io::{IsTerminal, Read, Seek};

/// The first bytes of a Parquet file, and of a recording.
const PARQUET: [u8; 4] = *b"PAR1";
const RECORDING: [u8; 4] = *b"\x8bfew";

/// A progress bar that counts bytes; visible only on a terminal.
pub(crate) fn progress(bytes: Option<u64>) -> ProgressBar {
    match bytes {
        Some(bytes) if std::io::stderr().is_terminal() => {
            let style = ProgressStyle::with_template("{bar:40} {bytes} of {total_bytes}, {eta} left");
            ProgressBar::new(bytes).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        }
        _ => ProgressBar::hidden(),
    }
}

/// The table of a file or of standard input, all columns selected and without a time.
fn opened(options: &TableOptions, file: &str) -> Result<fewbits_table::Table, Error> {
    let said = options.dialect.said()?;
    // The time is chosen later: some tasks have none.
    let said = fewbits_table::Dialect {
        time_column: Vec::new(),
        ..said
    };
    if options.file == "-" {
        return fewbits_table::Table::open(std::io::stdin(), &said).map_err(Error::of_table(file));
    }
    let mut source = File::open(file).map_err(Error::io(file, "open"))?;
    if source.metadata().map_err(Error::io(file, "read"))?.is_file() {
        let mut first = Vec::new();
        let begin = source
            .by_ref()
            .take(4)
            .read_to_end(&mut first)
            .and_then(|_| source.rewind());
        begin.map_err(Error::io(file, "read"))?;
        if first == PARQUET {
            #[cfg(feature = "parquet")]
            return fewbits_table::Table::open_parquet(source, &said).map_err(Error::of_table(file));
            #[cfg(not(feature = "parquet"))]
            return Err(Error::NoParquet { file: file.to_owned() });
        }
        if first == RECORDING {
            return Err(Error::content(file, "this is a recording, not a table: fewbits unpack makes a table of it"));
        }
    }
    let bar = progress(source.metadata().ok().map(|data| data.len()));
    fewbits_table::Table::open(bar.wrap_read(source), &said).map_err(Error::of_table(file))
}

/// The name of the table in messages.
pub(crate) fn name_of(options: &TableOptions) -> &str {
    match options.file.as_str() {
        "-" => "standard input",
        name => name,
    }
}

/// A table with the time and the columns that the options choose.
pub(crate) fn chosen(options: &TableOptions) -> Result<fewbits_table::Table, Error> {
    let file = name_of(options);
    let mut table = opened(options, file)?;
    let failed = Error::of_table(file);
    let stored = options.dialect.said()?.time_column;
    match (&options.time_column, &options.time) {
        (Some(list), _) => table.set_time(&time_columns(&table, list)).map_err(&failed)?,
        (None, Some(_)) if !stored.is_empty() => table.set_time(&stored).map_err(&failed)?,
        (None, Some(_)) => table.require_time().map_err(&failed)?,
        (None, None) => {}
    }
    if let Some(text) = &options.time {
        table.allow_inexact_times(clock::tolerance(text)?);
    }
    if !options.columns.is_empty() {
        table.select(&options.columns).map_err(&failed)?;
    }
    table.leave_out(&options.without()).map_err(&failed)?;
    Ok(table)
}

/// The names of columns of the time: one that exists, or a list.
pub(crate) fn time_columns(table: &fewbits_table::Table, list: &str) -> Vec<String> {
    match table.position(list) {
        Ok(_) => vec![list.to_owned()],
        Err(_) => names::split(list),
    }
}

/// What `fewbits look` shows: columns with their kinds, the dialect, what times are measured from, and counts over all rows.
pub(crate) fn look(
    options: &TableOptions,
) -> Result<(Vec<fewbits_table::Column>, fewbits_table::Dialect, Option<Scale>, fewbits_table::Survey), Error> {
    let failed = Error::of_table(name_of(options));
    let mut table = chosen(options)?;
    if table.time().is_none() {
        table.find_certain_time().map_err(&failed)?;
    }
    let (columns, dialect) = (table.columns().to_vec(), table.dialect().clone());
    let scale = table.time().map(|(_, scale)| scale);
    let survey = table.survey().map_err(&failed)?;
    let with_kind = |(mut column, profile): (fewbits_table::Column, &fewbits_table::Profile)| {
        column.kind = survey.kind(&column, profile);
        column
    };
    let columns = columns.into_iter().zip(&survey.columns).map(with_kind).collect();
    Ok((columns, dialect, scale, survey))
}
