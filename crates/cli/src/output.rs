//! Tables and recordings as output.

use crate::clock;
use crate::error::Error;
use fewbits_record::{Schema, TimeBase};
use std::fs::File;
use std::io::{BufWriter, IsTerminal, Write};
use std::path::Path;

/// What messages call standard output.
pub(crate) const STANDARD_OUTPUT: &str = "standard output";

/// A file, or standard output; its name for messages.
pub(crate) fn open(path: Option<&Path>) -> Result<(Box<dyn Write>, String), Error> {
    match path {
        Some(path) => {
            let name = path.display().to_string();
            let file = File::create(path).map_err(Error::file(&name, "create"))?;
            Ok((Box::new(file), name))
        }
        None => Ok((Box::new(std::io::stdout()), STANDARD_OUTPUT.to_owned())),
    }
}

/// As [`open`], but refuses to write binary data to a terminal.
pub(crate) fn open_binary(path: Option<&Path>) -> Result<(Box<dyn Write>, String), Error> {
    if path.is_none() && std::io::stdout().is_terminal() {
        return Err(Error::Terminal);
    }
    open(path)
}

/// Writes one JSON value and a line end to standard output.
pub(crate) fn json(value: &impl serde::Serialize) -> Result<(), Error> {
    let mut out = std::io::stdout().lock();
    serde_json::to_writer_pretty(&mut out, value)?;
    writeln!(out).map_err(Error::file(STANDARD_OUTPUT, "write"))
}

/// A cell as text: the shortest that reads back as the same number; empty for a gap.
fn cell(value: Option<f64>) -> String {
    match value {
        None => String::new(),
        Some(value) if value.is_nan() => "NaN".to_owned(),
        Some(value) if value != 0.0 && (value.abs() < 1e-5 || value.abs() >= 1e16) => format!("{value:e}"),
        Some(value) => format!("{value}"),
    }
}

/// Rows as CSV or as lines of JSON.
pub(crate) enum Rows {
    Csv(Box<csv::Writer<Box<dyn Write>>>),
    Json(BufWriter<Box<dyn Write>>),
}

/// What rows look like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    Csv,
    Json,
}

/// Writes rows of a recording.
pub(crate) struct Writer {
    rows: Rows,
    time: TimeBase,
    names: Vec<String>,
    file: String,
}

impl Writer {
    /// Writes the names, for CSV.
    pub(crate) fn new(path: Option<&Path>, shape: Shape, schema: &Schema, names: &[String]) -> Result<Self, Error> {
        let (sink, file) = open(path)?;
        let mut writer = Self {
            rows: match shape {
                Shape::Csv => Rows::Csv(Box::new(csv::Writer::from_writer(sink))),
                Shape::Json => Rows::Json(BufWriter::new(sink)),
            },
            time: schema.time(),
            names: names.to_vec(),
            file,
        };
        if let Rows::Csv(rows) = &mut writer.rows {
            let time = (schema.time() != TimeBase::Numbered).then_some("time");
            let head = time.into_iter().chain(names.iter().map(String::as_str));
            rows.write_record(head).map_err(Error::table(&writer.file))?;
        }
        Ok(writer)
    }

    pub(crate) fn write(&mut self, tick: i64, values: &[Option<f64>]) -> Result<(), Error> {
        let numbered = self.time == TimeBase::Numbered;
        match &mut self.rows {
            Rows::Csv(rows) => {
                let time = (!numbered).then(|| clock::shown(tick, self.time));
                let cells = values.iter().map(|value| cell(*value));
                rows.write_record(time.into_iter().chain(cells))
                    .map_err(Error::table(&self.file))
            }
            Rows::Json(sink) => {
                let key = if numbered { "row" } else { "time" };
                let time = if numbered {
                    tick.into()
                } else {
                    clock::shown(tick, self.time).into()
                };
                let mut object = serde_json::Map::new();
                object.insert(key.to_owned(), time);
                for (name, value) in self.names.iter().zip(values) {
                    let value = match value {
                        Some(value) if !value.is_finite() => cell(Some(*value)).into(),
                        value => (*value).into(),
                    };
                    object.insert(name.clone(), value);
                }
                serde_json::to_writer(&mut *sink, &object)?;
                writeln!(sink).map_err(Error::file(&self.file, "write"))
            }
        }
    }

    pub(crate) fn flush(&mut self) -> Result<(), Error> {
        match &mut self.rows {
            Rows::Csv(rows) => rows.flush(),
            Rows::Json(sink) => sink.flush(),
        }
        .map_err(Error::file(&self.file, "write"))
    }
}
