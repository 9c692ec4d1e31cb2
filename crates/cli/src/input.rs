//! Tables: CSV from a file or standard input, Parquet from a file, row by row.

use crate::arguments::TableOptions;
use crate::clock;
use crate::error::Error;
use crate::numbers::widened;
use fewbits_record::{TimeBase, TimeFormat};
use indicatif::{ProgressBar, ProgressStyle};
use std::fs::File;
use std::io::{IsTerminal, Read, Seek};

/// A row: its tick (`None` if rows are numbered) and its cells.
pub(crate) type Row = (Option<i64>, Vec<Option<f64>>);

/// A column of cells for each name.
pub(crate) type Cells = Vec<Vec<Option<f64>>>;

/// Cells that mean a missing sample.
const GAPS: [&str; 8] = ["", "NA", "N/A", "n/a", "null", "NULL", "None", "?"];
/// Names of a first column that is taken as time.
const TIME_NAMES: [&str; 6] = ["time", "timestamp", "datetime", "date", "seconds", "t"];
/// Integers up to this size are exact doubles.
const MAX_WHOLE: u64 = 1 << 53;

/// Source of a table.
enum Source {
    Csv(Box<csv::Reader<Box<dyn Read + Send>>>),
    #[cfg(feature = "parquet")]
    Parquet(Box<crate::parquet::Rows>),
}

/// The first bytes of a Parquet file.
const PARQUET: [u8; 4] = *b"PAR1";

/// Whether a file is a Parquet file. The position is set back to the beginning.
fn is_parquet(file: &mut File) -> std::io::Result<bool> {
    let mut first = Vec::new();
    // A pipe cannot be rewound, and Parquet needs random access.
    if !file.metadata()?.is_file() {
        return Ok(false);
    }
    file.by_ref().take(PARQUET.len() as u64).read_to_end(&mut first)?;
    file.rewind()?;
    Ok(first == PARQUET)
}

impl Source {
    /// The table and the names of its columns.
    fn open(options: &TableOptions, file: &str) -> Result<(Self, Vec<String>), Error> {
        let source: Box<dyn Read + Send> = if options.file == "-" {
            Box::new(std::io::stdin())
        } else {
            let mut opened = File::open(file).map_err(Error::io(file, "open"))?;
            if is_parquet(&mut opened).map_err(Error::io(file, "read"))? {
                #[cfg(feature = "parquet")]
                {
                    let mut rows = crate::parquet::Rows::open(opened, file)?;
                    let names = std::mem::take(&mut rows.names);
                    return Ok((Self::Parquet(Box::new(rows)), names));
                }
                #[cfg(not(feature = "parquet"))]
                return Err(Error::NoParquet { file: file.to_owned() });
            }
            let bar = progress(opened.metadata().ok().map(|data| data.len()));
            Box::new(bar.wrap_read(opened))
        };
        let delimiter = options.delimiter;
        let delimiter = u8::try_from(delimiter)
            .map_err(|_| Error::option("--delimiter", &delimiter.to_string(), "one character of ASCII"))?;
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter)
            .trim(csv::Trim::All)
            .from_reader(source);
        let names = reader
            .headers()
            .map_err(Error::table(file))?
            .iter()
            .map(str::to_owned)
            .collect();
        Ok((Self::Csv(Box::new(reader)), names))
    }

    /// Reads the next row. Returns whether there was one.
    fn read(&mut self, record: &mut csv::StringRecord, file: &str) -> Result<bool, Error> {
        match self {
            Self::Csv(reader) => reader.read_record(record).map_err(Error::table(file)),
            #[cfg(feature = "parquet")]
            Self::Parquet(rows) => rows.read(record),
        }
    }
}

/// An open table.
pub(crate) struct Table {
    file: String,
    source: Source,
    record: csv::StringRecord,
    /// Indices of the column of times and of the columns of values.
    time_column: Option<usize>,
    columns: Vec<usize>,
    /// Index of the column of sensor names.
    label_column: Option<usize>,
    pub(crate) names: Vec<String>,
    all_names: Vec<String>,
    rows: u64,
    /// Whether the first row was read ahead.
    peeked: bool,
}

/// Results of reading a whole table once.
pub(crate) struct Survey {
    /// Smallest and largest finite value of each column.
    pub(crate) ends: Vec<Option<(f64, f64)>>,
    /// Largest number of decimals of a time.
    pub(crate) decimals: u8,
}

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

/// Index of a column.
fn position(names: &[String], name: &str, file: &str) -> Result<usize, Error> {
    let found = names.iter().position(|known| known == name);
    found.ok_or_else(|| Error::no_column(file, name, names))
}

impl Table {
    /// Opens the table and reads the names.
    pub(crate) fn open(options: &TableOptions) -> Result<Self, Error> {
        let file = match options.file.as_str() {
            "-" => "standard input",
            name => name,
        };
        let (source, names) = Source::open(options, file)?;
        if names.is_empty() {
            return Err(Error::empty(file, "columns"));
        }
        let position = |name: &String| position(&names, name, file);
        let time_column = match (&options.time_column, &options.time) {
            (Some(name), _) => Some(position(name)?),
            (None, Some(_)) => Some(0),
            (None, None) => None,
        };
        let columns: Vec<usize> = if options.columns.is_empty() {
            (0..names.len()).filter(|i| Some(*i) != time_column).collect()
        } else {
            options.columns.iter().map(position).collect::<Result<_, _>>()?
        };
        Ok(Self {
            names: columns.iter().map(|i| names[*i].clone()).collect(),
            all_names: names,
            file: file.to_owned(),
            source,
            record: csv::StringRecord::new(),
            time_column,
            columns,
            label_column: None,
            rows: 0,
            peeked: false,
        })
    }

    /// The name of the table in messages.
    pub(crate) fn file(&self) -> &str {
        &self.file
    }

    /// Number of the last row read, counted from 1 after the line of names.
    pub(crate) fn row(&self) -> u64 {
        self.rows
    }

    /// Uses a first column whose name says that it is a time as the column of times, unless the user named one.
    pub(crate) fn find_time(&mut self) {
        let first = self.all_names[0].to_lowercase();
        if self.time_column.is_none() && TIME_NAMES.contains(&first.as_str()) {
            self.time_column = Some(0);
            self.without(0);
        }
    }

    /// Takes these columns of values and this column of times, by their indices among all columns.
    pub(crate) fn choose(&mut self, time: Option<usize>, columns: Vec<usize>) {
        self.names = columns.iter().map(|i| self.all_names[*i].clone()).collect();
        (self.time_column, self.columns) = (time, columns);
    }

    /// Reads a column as names instead of numbers: [`Table::label`].
    pub(crate) fn with_labels(mut self, name: &str) -> Result<Self, Error> {
        let column = position(&self.all_names, name, &self.file)?;
        self.label_column = Some(column);
        self.without(column);
        Ok(self)
    }

    /// Excludes a column from the columns of numbers.
    fn without(&mut self, column: usize) {
        self.columns.retain(|other| *other != column);
        self.names = self.columns.iter().map(|i| self.all_names[*i].clone()).collect();
    }

    /// The name in the last row read.
    pub(crate) fn label(&self) -> &str {
        let column = self.label_column.and_then(|column| self.record.get(column));
        column.unwrap_or_default()
    }

    fn read_record(&mut self) -> Result<bool, Error> {
        if std::mem::take(&mut self.peeked) {
            return Ok(true);
        }
        let more = self.source.read(&mut self.record, &self.file)?;
        self.rows += u64::from(more);
        Ok(more)
    }

    fn cell_error(&self, column: usize, (problem, mend): (&'static str, &'static str)) -> Error {
        Error::Cell {
            file: self.file.clone(),
            row: self.rows,
            column: self.all_names[column].clone(),
            cell: self.record.get(column).unwrap_or_default().to_owned(),
            problem,
            mend,
        }
    }

    /// The time base for the times of the table, from its first row.
    pub(crate) fn time_base(&mut self, options: &TableOptions, survey: Option<&Survey>) -> Result<TimeBase, Error> {
        let Some(column) = self.time_column else {
            return Ok(TimeBase::Numbered);
        };
        if !self.read_record()? {
            return Err(Error::empty(&self.file, "rows"));
        }
        self.peeked = true;
        let first = self.record.get(column).unwrap_or_default();
        let Some(format) = clock::format_of(first) else {
            return Err(self.cell_error(column, clock::NO_TIME));
        };
        let nanoseconds = clock::tolerance(options.time.as_deref().unwrap_or("exact"))?;
        let decimals = match (format, survey) {
            // Exact times: a tick is as fine as the finest time of the table.
            (TimeFormat::Seconds, Some(survey)) if nanoseconds == 0 => survey.decimals,
            // Times in milliseconds or microseconds since 1970 are too large for nanoseconds.
            (TimeFormat::Seconds, _) if first.parse::<f64>().is_ok_and(|first| first.abs() > 4e9) => 0,
            _ => clock::NANOSECONDS,
        };
        let scale = 10_u64.pow(u32::from(clock::NANOSECONDS.saturating_sub(decimals)));
        Ok(TimeBase::Clock {
            decimals,
            // One tick of the tolerance is reserved for decimals beyond a tick, which are cut off.
            tolerance: (nanoseconds / scale).saturating_sub(1),
            format,
        })
    }

    /// The next row; `None` after the last.
    pub(crate) fn next(&mut self, time: TimeBase) -> Result<Option<Row>, Error> {
        if !self.read_record()? {
            return Ok(None);
        }
        let tick = match self.time_column {
            Some(column) => {
                let text = self.record.get(column).unwrap_or_default();
                Some(clock::tick(text, time).map_err(|problem| self.cell_error(column, problem))?)
            }
            None => None,
        };
        let cells = self
            .columns
            .iter()
            .map(|column| self.cell(*column))
            .collect::<Result<_, _>>()?;
        Ok(Some((tick, cells)))
    }

    /// The next rows, at least one and at most `limit`: their ticks (or numbers), and a column of cells for each name.
    pub(crate) fn rows(&mut self, time: TimeBase, limit: usize) -> Result<(Vec<i64>, Cells), Error> {
        let (mut ticks, mut columns) = (Vec::new(), vec![Vec::new(); self.names.len()]);
        while ticks.len() < limit
            && let Some((tick, cells)) = self.next(time)?
        {
            ticks.push(tick.unwrap_or(ticks.len() as i64));
            for (column, cell) in columns.iter_mut().zip(cells) {
                column.push(cell);
            }
        }
        if ticks.is_empty() {
            return Err(Error::empty(&self.file, "rows"));
        }
        Ok((ticks, columns))
    }

    fn cell(&self, column: usize) -> Result<Option<f64>, Error> {
        let text = self.record.get(column).unwrap_or_default();
        if GAPS.contains(&text) {
            return Ok(None);
        }
        let Ok(value) = text.parse::<f64>() else {
            let mend = if self.all_names.len() == 1 && text.contains([';', '\t', '|']) {
                "name what separates cells with --delimiter"
            } else if clock::format_of(text).is_some() {
                "if this is the time of the row, add --time exact"
            } else {
                "mend the cell, leave it empty for a gap, or choose columns with --columns"
            };
            return Err(self.cell_error(column, ("is not a number", mend)));
        };
        let size = text.trim_start_matches(['-', '+']);
        // Whole numbers of at most 15 digits are below 2^53, so they are exact doubles.
        if size.len() > 15
            && size.bytes().all(|byte| byte.is_ascii_digit())
            && !size.parse::<u64>().is_ok_and(|whole| whole <= MAX_WHOLE)
        {
            return Err(self.cell_error(
                column,
                ("is a whole number of more than 53 bits", "split the column, or leave it out with --columns"),
            ));
        }
        Ok(Some(value))
    }

    /// Reads the whole table once.
    pub(crate) fn survey(options: &TableOptions) -> Result<Survey, Error> {
        let mut table = Self::open(options)?;
        let mut survey = Survey {
            ends: vec![None; table.columns.len()],
            decimals: 0,
        };
        while table.read_record()? {
            for (i, column) in table.columns.iter().enumerate() {
                if let Some(value) = table.cell(*column)?.filter(|value| value.is_finite()) {
                    survey.ends[i] = widened(survey.ends[i], value);
                }
            }
            if let Some(column) = table.time_column {
                let text = table.record.get(column).unwrap_or_default();
                survey.decimals = survey.decimals.max(clock::decimals_of(text).unwrap_or(0).min(18));
            }
        }
        Ok(survey)
    }
}
