//! Opening of tables: from options and files to tables of the crate `table`.

use crate::arguments::TableOptions;
use crate::clock;
use crate::error::Error;
use crate::files::is_regular;
use crate::say::say;
use fewbits_table::{Kind, names};
use indicatif::{ProgressBar, ProgressStyle};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{IsTerminal, Read, Seek};
use std::sync::{Mutex, PoisonError};

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
    let mut said = fewbits_table::Dialect {
        // The time is chosen later: some tasks have none.
        time_column: Vec::new(),
        ..said
    };
    if options.by.is_some() {
        // Spellings of gaps of one column are those of a sensor, which is no column yet.
        said.missing.retain(|word| !word.contains('='));
    }
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
    let source = options.identity.read(bar.wrap_read(source));
    fewbits_table::Table::open(source, &said).map_err(Error::of_table(file))
}

/// The name of the table in messages.
pub(crate) fn name_of(options: &TableOptions) -> &str {
    match options.file.as_str() {
        "-" => "standard input",
        name => name,
    }
}

/// A table with the time and the columns that the options choose. If its first rows leave open whether day or month stands first, all rows
/// of a file decide.
pub(crate) fn chosen(options: &TableOptions) -> Result<fewbits_table::Table, Error> {
    decided(options, chosen_at_once)
}

/// A table, opened once more with the order of day and month that all of its dates decide, if it was refused for that.
pub(crate) fn decided<T>(options: &TableOptions, open: impl Fn(&TableOptions) -> Result<T, Error>) -> Result<T, Error> {
    let refused = match open(options) {
        Err(Error::Refusal { file, source }) if source.is_day_or_month() => Error::Refusal { file, source },
        other => return other,
    };
    match day_order(options)? {
        Some(said) => open(&said),
        None => Err(refused),
    }
}

/// The options with the order of day and month that all dates of a file decide; `None` if they do not, or it can be read once only.
pub(crate) fn day_order(options: &TableOptions) -> Result<Option<TableOptions>, Error> {
    if !is_regular(&options.file) {
        return Ok(None);
    }
    let file = name_of(options);
    let mut table = opened(options, file)?;
    table.select::<&str>(&[]).map_err(Error::of_table(file))?;
    let survey = table.survey().map_err(Error::of_table(file))?;
    let mut orders = survey.columns.iter().filter_map(fewbits_table::Profile::day_order);
    let (Some(order), None) = (orders.next(), orders.next()) else {
        return Ok(None);
    };
    let mut said = options.clone();
    said.dialect.time_format = Some(order.to_owned());
    Ok(Some(said))
}

fn chosen_at_once(options: &TableOptions) -> Result<fewbits_table::Table, Error> {
    let file = name_of(options);
    let failed = Error::of_table(file);
    let stored = options.dialect.said()?.time_column;
    let mut table = opened(options, file)?;
    match (&options.time_column, &options.time) {
        (Some(list), _) => table.set_time(&time_columns(&table, list)).map_err(&failed)?,
        (None, time) if !stored.is_empty() && (time.is_some() || options.by.is_some()) => {
            table.set_time(&stored).map_err(&failed)?;
        }
        (None, Some(_)) if table.find_time().map_err(&failed)? => {}
        (None, Some(_)) => {
            table.require_time().map_err(&failed)?;
            tell_first(&table, file);
        }
        (None, None) if options.by.is_some() => drop(table.find_time().map_err(&failed)?),
        (None, None) => {}
    }
    if let Some(text) = &options.time {
        table.allow_inexact_times(clock::tolerance(text)?);
    }
    if let Some(by) = &options.by {
        return wide(table, options, by, file);
    }
    select(&mut table, &options.columns, &options.without()).map_err(&failed)?;
    Ok(table)
}

/// Says a note of a file once, though the file is opened again.
fn tell_once(file: &str, note: &str) {
    static TOLD: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let note = format!("note: {file}: {note}");
    let mut told = TOLD.lock().unwrap_or_else(PoisonError::into_inner);
    if told.insert(note.clone()) {
        say!("{note}");
    }
}

/// Says that the first column is taken for the time though nothing but its numbers says so.
fn tell_first(table: &fewbits_table::Table, file: &str) {
    if let Some(first) = table.columns().first() {
        let name = crate::say::name(&first.name);
        tell_once(
            file,
            &format!(
                "the first column, `{name}`, is taken for the time, as its numbers increase: --time-column names another"
            ),
        );
    }
}

/// Says of columns of numbers that zeros in front of digits are not kept, as of `007`, and of columns that begin with digits that they are words.
pub(crate) fn tell_texts(table: &fewbits_table::Table, file: &str) {
    for (column, cell) in table.lost_zeros() {
        let lost = if cell.starts_with('+') { "its plus" } else { "its zeros" };
        tell_once(
            file,
            &format!(
                "`{cell}` of the column `{}` is taken for a number, without {lost} in front: --words {} keeps up to 256 different texts",
                crate::say::name(&column.name),
                names::as_argument([fewbits_table::printable(&column.name)])
            ),
        );
    }
    let is_amount = |word: &String| {
        let digits = word.trim_start_matches(['+', '-', '~', '[', '{', '(', '<', '>']);
        digits.starts_with(|c: char| c.is_ascii_digit())
            && !word.bytes().all(|c| c.is_ascii_alphanumeric() || c == b'.')
    };
    for i in table.selected().iter().copied() {
        let words = if table.columns()[i].kind == Kind::Words {
            table.words(i)
        } else {
            &[]
        };
        if let (Some(word), true) = (words.first(), words.iter().all(is_amount)) {
            let (name, word) = (crate::say::name(&table.columns()[i].name), fewbits_table::printable(word));
            tell_once(
                file,
                &format!("the column `{name}` is kept as words, as `{word}`: if these are numbers, convert them"),
            );
        }
    }
}

fn select(
    table: &mut fewbits_table::Table,
    columns: &[String],
    without: &[String],
) -> Result<(), fewbits_table::Error> {
    if !columns.is_empty() {
        table.select(columns)?;
    }
    table.leave_out(without)
}

/// A long table as a wide one. Columns are chosen there; names of the long table choose among its columns of values.
fn wide(
    mut long: fewbits_table::Table,
    options: &TableOptions,
    by: &str,
    file: &str,
) -> Result<fewbits_table::Table, Error> {
    let failed = Error::of_table(file);
    let is_long = |name: &String| long.position(name).is_ok() && !name.starts_with('#');
    let (values, columns): (Vec<_>, Vec<_>) = options.columns.iter().cloned().partition(is_long);
    let (out, without): (Vec<_>, Vec<_>) = options.without().into_iter().partition(is_long);
    select(&mut long, &values, &out).map_err(&failed)?;
    let mut table = long.widened(by, &options.dialect.said()?.missing).map_err(&failed)?;
    if options.time.is_some() || options.time_column.is_some() {
        table.set_time(&["#1"]).map_err(&failed)?;
        if let Some(text) = &options.time {
            table.allow_inexact_times(clock::tolerance(text)?);
        }
    }
    select(&mut table, &columns, &without).map_err(&failed)?;
    Ok(table)
}

/// The names of columns of the time: one that exists, or a list.
pub(crate) fn time_columns(table: &fewbits_table::Table, list: &str) -> Vec<String> {
    match table.position(list) {
        Ok(_) => vec![list.to_owned()],
        Err(_) => names::split(list),
    }
}

/// A table with the time that the options choose, or that it certainly has.
pub(crate) fn with_time(options: &TableOptions) -> Result<fewbits_table::Table, Error> {
    decided(options, with_time_at_once)
}

fn with_time_at_once(options: &TableOptions) -> Result<fewbits_table::Table, Error> {
    let failed = Error::of_table(name_of(options));
    let mut table = chosen_at_once(options)?;
    match options.by {
        Some(_) => table.set_time(&["#1"]).map_err(&failed)?,
        None if table.time().is_none() => drop(table.find_certain_time().map_err(&failed)?),
        None => {}
    }
    Ok(table)
}
