//! Tables of the crate `table` for the tasks: files and standard input, times as ticks, cells as doubles.

use crate::arguments::TableOptions;
use crate::clock;
use crate::error::Error;
use crate::files::is_regular;
use crate::opening::{chosen, name_of, time_columns};
use crate::say::say;
use fewbits_record::{TimeBase, TimeFormat};
use fewbits_table::{Batch, Kind, Scale, Time};

/// A row: its tick (`None` if rows are numbered) and its cells.
pub(crate) type Row = (Option<i64>, Vec<Option<f64>>);

/// A column of cells for each name.
pub(crate) type Cells = Vec<Vec<Option<f64>>>;

/// Rows of a file that are read at once. Of anything else, one: a live row waits for no other.
const ROWS: usize = 512;
/// An open table.
pub(crate) struct Table {
    file: String,
    table: fewbits_table::Table,
    batch: Batch,
    /// The next row of the batch.
    next: usize,
    limit: usize,
    is_long: bool,
    /// Whether what was left out has been said.
    is_told: bool,
    row: u64,
    pub(crate) names: Vec<String>,
}

/// Results of reading a whole table once.
pub(crate) struct Survey {
    /// Smallest and largest finite value of each column.
    pub(crate) ends: Vec<Option<(f64, f64)>>,
    /// Largest number of decimals of a time.
    pub(crate) decimals: u8,
    /// Whether there are no rows.
    is_empty: bool,
}

impl Table {
    /// Opens the table and reads the names. A file whose columns are not all plain numbers is read once to learn what they are.
    pub(crate) fn open(options: &TableOptions) -> Result<Self, Error> {
        let mut table = chosen(options)?;
        let is_file = is_regular(&options.file);
        if is_file && !table.is_plain() {
            let survey = chosen(options)?.survey().map_err(Error::of_table(name_of(options)))?;
            table.use_survey(&survey);
        }
        let mut open = Self {
            names: Vec::new(),
            file: name_of(options).to_owned(),
            table,
            batch: Batch::default(),
            next: 0,
            limit: if is_file { ROWS } else { 1 },
            is_long: false,
            is_told: false,
            row: 0,
        };
        open.rename();
        Ok(open)
    }

    /// Takes the names of the selected columns.
    fn rename(&mut self) {
        let columns = self.table.columns();
        self.names = self.table.selected().iter().map(|i| columns[*i].name.clone()).collect();
    }

    /// The name of the table in messages.
    pub(crate) fn file(&self) -> &str {
        &self.file
    }

    /// Number of the last row read, counted from 1 after the line of names.
    pub(crate) fn row(&self) -> u64 {
        self.row
    }

    /// Uses the columns whose cells or names say that they are times, unless the user named some.
    pub(crate) fn find_time(&mut self, nanoseconds: u64) -> Result<(), Error> {
        if self.table.time().is_none() {
            self.table.find_certain_time().map_err(Error::of_table(&self.file))?;
            self.table.allow_inexact_times(nanoseconds);
            self.rename();
        }
        Ok(())
    }

    /// Takes these columns of values, by their indices among all columns, and the time from the columns of this list, from where the table
    /// has it, or from a column that is left over.
    pub(crate) fn choose(
        &mut self,
        list: Option<&str>,
        left_over: Option<usize>,
        columns: &[usize],
        base: TimeBase,
    ) -> Result<(), Error> {
        let failed = Error::of_table(&self.file);
        let all: Vec<String> = self.table.columns().iter().map(|column| column.name.clone()).collect();
        if let TimeBase::Clock {
            decimals, tolerance, ..
        } = base
        {
            let is_free = |table: &fewbits_table::Table| {
                table
                    .time()
                    .is_some_and(|(found, _)| !found.iter().any(|column| columns.contains(column)))
            };
            if let Some(list) = list {
                let names = time_columns(&self.table, list);
                self.table.set_time(&names).map_err(&failed)?;
            } else if !(self.table.find_time().map_err(&failed)? && is_free(&self.table)) {
                let name: Vec<&String> = left_over.iter().map(|i| &all[*i]).collect();
                self.table.set_time(&name).map_err(&failed)?;
            }
            let tick = 10_u64.pow(u32::from(clock::NANOSECONDS.saturating_sub(decimals)));
            // One tick was reserved for decimals beyond a tick.
            let ticks = if tolerance == 0 { 0 } else { tolerance.saturating_add(1) };
            self.table.allow_inexact_times(ticks.saturating_mul(tick));
        }
        let names: Vec<&String> = columns.iter().map(|i| &all[*i]).collect();
        self.table.select(&names).map_err(&failed)?;
        self.rename();
        Ok(())
    }

    /// Reads a column as names instead of numbers: [`Table::label`].
    pub(crate) fn with_labels(mut self, name: &str) -> Result<Self, Error> {
        self.table.set_label(name).map_err(Error::of_table(&self.file))?;
        self.is_long = true;
        self.rename();
        Ok(self)
    }

    /// The name of the column of times; `time` if several give it, it is also one of the columns of values, or the table has no names.
    pub(crate) fn time_name(&self) -> String {
        let columns = self.table.columns();
        let name = match self.table.time() {
            Some(([only], _)) => {
                let made_up = format!("column_{}", only + 1);
                columns
                    .get(*only)
                    .map(|column| column.name.clone())
                    .filter(|name| *name != made_up)
            }
            _ => None,
        };
        name.filter(|name| !self.names.contains(name))
            .unwrap_or_else(|| "time".to_owned())
    }

    /// The name in the last row read.
    pub(crate) fn label(&self) -> &str {
        self.table.label()
    }

    /// What the column at an index of `names` holds.
    pub(crate) fn kind(&self, index: usize) -> Kind {
        let column = self
            .table
            .selected()
            .get(index)
            .and_then(|column| self.table.columns().get(*column));
        column.map_or(Kind::Number, |column| column.kind)
    }

    /// The unit of the column at an index of `names`, or the list of its words.
    pub(crate) fn unit(&self, index: usize) -> String {
        let Some(column) = self.table.selected().get(index) else {
            return String::new();
        };
        match self.kind(index) {
            Kind::Words => crate::words::unit(self.table.words(*column)),
            Kind::Time => "s since 1970".to_owned(),
            _ => self.table.columns()[*column].unit.clone(),
        }
    }

    /// Refuses columns of words, for tasks that compute with cells.
    pub(crate) fn require_numbers(&self) -> Result<(), Error> {
        match (0..self.names.len()).find(|i| matches!(self.kind(*i), Kind::Words | Kind::Text)) {
            None => Ok(()),
            Some(i) => {
                let problem = format!(
                    "column `{}` holds words, and numbers are expected: choose columns with --columns, or name gaps with --missing",
                    crate::say::name(&self.names[i])
                );
                Err(Error::content(&self.file, problem))
            }
        }
    }

    /// Whether there is no further row.
    pub(crate) fn is_at_end(&mut self) -> Result<bool, Error> {
        self.fill().map(|more| !more)
    }

    /// States the words of the columns of a recording, so that cells are the numbers that it has for them.
    pub(crate) fn use_words(&mut self, columns: &[&fewbits_record::Column]) {
        let selected = self.table.selected().to_vec();
        for (column, recorded) in selected.into_iter().zip(columns) {
            if let Some(words) = crate::words::of(recorded.unit()) {
                self.table.fix_words(column, words);
            }
        }
    }

    /// Loads rows if all were given out. Returns whether there are any.
    fn fill(&mut self) -> Result<bool, Error> {
        if self.next < self.batch.rows {
            return Ok(true);
        }
        self.next = 0;
        let limit = if self.is_long { 1 } else { self.limit };
        let count = self
            .table
            .read(&mut self.batch, limit)
            .map_err(Error::of_table(&self.file))?;
        if count == 0 && !std::mem::replace(&mut self.is_told, true) {
            self.tell();
        }
        Ok(count > 0)
    }

    /// Says what was left out.
    fn tell(&self) {
        let skipped = self.table.skipped();
        if skipped.bad > 0 {
            say!("{}: {} lines were left out", self.file, skipped.bad);
            skipped.faults.iter().for_each(|fault| say!("  {fault}"));
            if skipped.bad > skipped.faults.len() as u64 {
                say!("  and {} more", skipped.bad - skipped.faults.len() as u64);
            }
        }
        if skipped.repeated > 0 {
            say!(
                "{}: {} lines that repeat the names or the lines around them were left out",
                self.file,
                skipped.repeated
            );
        }
    }

    fn time_error(&self, time: Time, (problem, mend): clock::Problem) -> Error {
        let scale = self.table.time().map_or(Scale::Seconds, |(_, scale)| scale);
        let column = self
            .table
            .time()
            .map(|(columns, _)| self.table.columns()[columns[0]].name.clone());
        Error::of_table(&self.file)(fewbits_table::Error::Cell {
            place: self.batch.places[self.next],
            column: column.unwrap_or_default(),
            cell: time.shown(scale, time.decimals()),
            problem,
            mend: mend.to_owned(),
        })
    }

    /// The time base for the times of the table, from its first row.
    pub(crate) fn time_base(&mut self, options: &TableOptions, survey: Option<&Survey>) -> Result<TimeBase, Error> {
        let Some((_, scale)) = self.table.time() else {
            return Ok(TimeBase::Numbered);
        };
        let format = match scale {
            Scale::Utc => TimeFormat::Utc,
            Scale::Local => TimeFormat::Local,
            _ => TimeFormat::Seconds,
        };
        let nanoseconds = clock::tolerance(options.time.as_deref().unwrap_or("exact"))?;
        let first = match survey {
            Some(survey) if survey.is_empty => None,
            _ => self.fill()?.then(|| self.batch.times.first().copied()).flatten(),
        };
        let decimals = match (format, survey) {
            // Exact times: a tick is as fine as the finest time of the table.
            (TimeFormat::Seconds, Some(survey)) if nanoseconds == 0 => survey.decimals,
            // Units that timestamps of other programs have.
            (_, Some(survey)) if nanoseconds == 0 => survey.decimals.next_multiple_of(3),
            _ => clock::NANOSECONDS,
        };
        // Ticks of 64 bits: the first time tells how fine they can be.
        let fits = |decimals: &u8| {
            first.is_none_or(|first| {
                first
                    .ticks(*decimals)
                    .is_some_and(|(tick, _)| tick.abs() < i64::MAX / 4)
            })
        };
        let is_exact = nanoseconds == 0 && survey.is_some();
        let decimals = if is_exact {
            decimals.min(18)
        } else {
            (0..=decimals).rev().find(fits).unwrap_or(0)
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
        if !self.fill()? {
            return Ok(None);
        }
        let row = self.next;
        self.row = self.batch.places[row].row;
        let tick = match (self.batch.times.get(row), time) {
            (
                Some(found),
                TimeBase::Clock {
                    decimals, tolerance, ..
                },
            ) => match found.ticks(decimals) {
                None => return Err(self.time_error(*found, clock::TOO_LARGE)),
                Some((_, false)) if tolerance == 0 => return Err(self.time_error(*found, clock::TOO_FINE)),
                Some((tick, _)) => Some(tick),
            },
            _ => None,
        };
        let mut cells = Vec::with_capacity(self.batch.columns.len());
        for (i, column) in self.batch.columns.iter().enumerate() {
            if let fewbits_table::Cells::Times(times) = column
                && let Some(time) = times[row].filter(|_| self.batch.times.is_empty())
            {
                return Err(self.cell_error(i, time.shown(Scale::Local, time.decimals())));
            }
            cells.push(column.number(row).map_err(|cell| self.cell_error(i, cell))?);
        }
        self.next += 1;
        Ok(Some((tick, cells)))
    }

    fn cell_error(&self, index: usize, cell: String) -> Error {
        let (problem, mend) = match self.kind(index) {
            Kind::Time if self.batch.times.is_empty() => (
                "is a time",
                "if this is the time of the row, add --time exact; otherwise leave the column out with --without",
            ),
            Kind::Time => ("is a time, and its seconds are no double", "leave the column out with --without"),
            _ => (
                "is a whole number of more than 53 bits, which no double holds",
                "split the column, or leave it out with --without",
            ),
        };
        Error::of_table(&self.file)(fewbits_table::Error::Cell {
            place: self.batch.places[self.next],
            column: self.names[index].clone(),
            cell,
            problem,
            mend: mend.replace("--without", &format!("--without {}", fewbits_table::names::quoted(&self.names[index]))),
        })
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

    /// Reads the whole table once.
    pub(crate) fn survey(options: &TableOptions) -> Result<Survey, Error> {
        let table = chosen(options)?;
        let selected = table.selected().to_vec();
        let survey = table.survey().map_err(Error::of_table(name_of(options)))?;
        Ok(Survey {
            ends: selected.iter().map(|i| survey.columns[*i].range).collect(),
            decimals: survey.times.decimals,
            is_empty: survey.rows == 0,
        })
    }
}
