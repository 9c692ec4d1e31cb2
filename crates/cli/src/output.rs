//! Output of tables: rows of recordings and of other results.

use crate::error::Error;
use crate::say;
use crate::target::Target;
pub(crate) use fewbits_recipes::unpack::Cell;
use fewbits_recipes::unpack::Cells;
use fewbits_record::Schema;
use std::io::{BufWriter, IsTerminal, Write};
use std::path::Path;

/// Writes a whole text to a file or standard output.
pub(crate) fn text(path: Option<&Path>, text: &str) -> Result<(), Error> {
    let mut target = Target::open(path)?;
    target
        .write_all(text.as_bytes())
        .map_err(Error::io(target.name(), "write"))?;
    target.finish()
}

/// Writes text for people to standard output.
pub(crate) fn print(text: &str) -> Result<(), Error> {
    if say::is_collected(text) {
        return Ok(());
    }
    self::text(None, &say::plain(text))
}

/// Writes one JSON value and a line end to standard output.
pub(crate) fn json(value: &impl serde::Serialize) -> Result<(), Error> {
    // Of several files each has a line.
    if say::is_collecting() {
        say::is_collected(&serde_json::to_string(value)?);
        return Ok(());
    }
    text(None, &(serde_json::to_string_pretty(value)? + "\n"))
}

fn json_of(cell: &Cell) -> serde_json::Value {
    match cell {
        Cell::Whole(number) => (*number).into(),
        Cell::Number(value) if value.is_none_or(f64::is_finite) => (*value).into(),
        // JSON has no NaN and no infinity.
        _ => cell.text().into(),
    }
}

/// Format of the rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    Csv,
    Json,
}

impl Shape {
    /// One JSON object per row if asked for.
    pub(crate) fn of(json: bool) -> Self {
        if json { Self::Json } else { Self::Csv }
    }
}

/// Rows as CSV or as lines of JSON.
enum Rows {
    Csv(Box<csv::Writer<Target>>),
    Json(BufWriter<Target>),
}

/// Writes rows of named cells.
pub(crate) struct Sheet {
    rows: Rows,
    names: Vec<String>,
    file: String,
}

impl Sheet {
    /// Writes the names, for CSV.
    pub(crate) fn new(path: Option<&Path>, shape: Shape, names: Vec<String>) -> Result<Self, Error> {
        let sink = Target::open(path)?.of_lines();
        let file = sink.name().to_owned();
        let rows = match shape {
            Shape::Csv => {
                // Names of a recording are another's text.
                let is_shown = path.is_none() && std::io::stdout().is_terminal();
                let shown = |name: &String| match is_shown {
                    true => say::name(name).into_owned(),
                    false => name.clone(),
                };
                let mut rows = csv::Writer::from_writer(sink);
                rows.write_record(names.iter().map(shown))
                    .map_err(Error::table(&file))?;
                Rows::Csv(Box::new(rows))
            }
            Shape::Json => Rows::Json(BufWriter::new(sink)),
        };
        Ok(Self { rows, names, file })
    }

    /// One row, with a cell per name.
    pub(crate) fn write(&mut self, cells: impl IntoIterator<Item = Cell>) -> Result<(), Error> {
        match &mut self.rows {
            Rows::Csv(rows) => rows
                .write_record(cells.into_iter().map(|cell| cell.text()))
                .map_err(Error::table(&self.file)),
            Rows::Json(sink) => {
                let cells = cells.into_iter().map(|cell| json_of(&cell));
                let object: serde_json::Map<_, _> = self.names.iter().cloned().zip(cells).collect();
                serde_json::to_writer(&mut *sink, &object)
                    .map_err(|error| Error::io(&self.file, "write")(error.into()))?;
                writeln!(sink).map_err(Error::io(&self.file, "write"))
            }
        }
    }

    pub(crate) fn flush(&mut self) -> Result<(), Error> {
        match &mut self.rows {
            Rows::Csv(rows) => rows.flush(),
            Rows::Json(sink) => sink.flush(),
        }
        .map_err(Error::io(&self.file, "write"))
    }

    /// Completes the file.
    pub(crate) fn finish(mut self) -> Result<(), Error> {
        self.flush()?;
        let failed = Error::io(&self.file, "write");
        let sink = match self.rows {
            Rows::Csv(rows) => rows.into_inner().map_err(|error| failed(error.into_error()))?,
            Rows::Json(rows) => rows.into_inner().map_err(|error| failed(error.into_error()))?,
        };
        sink.finish()
    }
}

/// Whether the file name has the extension of Parquet files.
fn is_parquet(path: &Path) -> bool {
    crate::naming::ending(path).as_deref() == Some("parquet")
}

/// Writes rows of a recording, as Parquet if the file name has that extension.
pub(crate) enum Writer {
    Sheet(Box<Texts>),
    #[cfg(feature = "parquet")]
    Parquet(Box<crate::parquet::Sink>),
}

/// Rows of a recording as text.
pub(crate) struct Texts {
    sheet: Sheet,
    cells: Cells,
}

impl Writer {
    /// A writer for these columns. For a recording without times, only JSON and Parquet contain row numbers.
    pub(crate) fn new(path: Option<&Path>, shape: Shape, schema: &Schema, names: &[String]) -> Result<Self, Error> {
        if let Some(path) = path.filter(|path| is_parquet(path)) {
            #[cfg(feature = "parquet")]
            return Ok(Self::Parquet(Box::new(crate::parquet::Sink::create(path, schema, names)?)));
            #[cfg(not(feature = "parquet"))]
            return Err(Error::NoParquet {
                file: path.display().to_string(),
            });
        }
        let cells = Cells::new(schema, names, shape == Shape::Json);
        Ok(Self::Sheet(Box::new(Texts {
            sheet: Sheet::new(path, shape, cells.names().to_vec())?,
            cells,
        })))
    }

    pub(crate) fn write(&mut self, tick: i64, values: &[Option<f64>]) -> Result<(), Error> {
        match self {
            Self::Sheet(texts) => texts.sheet.write(texts.cells.row(tick, values)),
            #[cfg(feature = "parquet")]
            Self::Parquet(sink) => sink.write(tick, values),
        }
    }

    /// Writes out all rows so far, if the format allows it.
    pub(crate) fn flush(&mut self) -> Result<(), Error> {
        match self {
            Self::Sheet(texts) => texts.sheet.flush(),
            #[cfg(feature = "parquet")]
            Self::Parquet(_) => Ok(()),
        }
    }

    /// Completes the file.
    pub(crate) fn finish(self) -> Result<(), Error> {
        match self {
            Self::Sheet(texts) => texts.sheet.finish(),
            #[cfg(feature = "parquet")]
            Self::Parquet(sink) => sink.finish(),
        }
    }
}
