//! Tables of the crate `table` for the tasks: files and standard input, times as ticks, cells as doubles.

use crate::arguments::TableOptions;
use crate::clock;
use crate::error::Error;
use crate::files::is_regular;
use crate::opening::{chosen, decided, name_of, tell_texts, time_columns};
use crate::say::say;
use fewbits_recipes::{table as recipe, times, words};
use fewbits_record::{Integers, TimeBase};
use fewbits_table::{Batch, FewCells, Kind, Scale, Side, Time, names};

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
    /// What reading the table once has shown, if that was done.
    learned: Option<fewbits_table::Survey>,
    pub(crate) names: Vec<String>,
    /// How the recording's columns code whole numbers.
    integers: Vec<Option<Integers>>,
}

/// Results of reading a whole table once.
pub(crate) struct Survey {
    /// Smallest and largest finite value of each column.
    pub(crate) ends: Vec<Option<(f64, f64)>>,
    /// Few cells that make most of the range of each column.
    pub(crate) few: Vec<Option<FewCells>>,
    /// Largest number of decimals of a time.
    pub(crate) decimals: u8,
}

impl Table {
    /// Opens the table and reads the names. A file whose columns are not all plain numbers is read once to learn what they are.
    pub(crate) fn open(options: &TableOptions) -> Result<Self, Error> {
        let mut table = chosen(options)?;
        let is_file = is_regular(&options.file);
        let mut learned = None;
        if is_file && !table.is_plain() {
            let survey = chosen(options)?.survey().map_err(Error::of_table(name_of(options)))?;
            table.use_survey(&survey);
            learned = Some(survey);
        }
        tell_texts(&table, name_of(options));
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
            learned,
            integers: Vec::new(),
        };
        open.rename();
        Ok(open)
    }

    /// Takes the names of the selected columns.
    fn rename(&mut self) {
        let columns = self.table.columns();
        self.names = self.table.selected().iter().map(|i| columns[*i].name.clone()).collect();
    }

    /// Whether the first rows are plain numbers, and no other rows were read.
    pub(crate) fn is_plain(&self) -> bool {
        self.learned.is_none() && self.table.is_plain()
    }

    /// What the first rows show, if all others are like them: no ranges, and the decimals of the finest time.
    pub(crate) fn first_survey(&mut self) -> Result<Survey, Error> {
        self.fill()?;
        let times = self.batch.times.iter();
        Ok(Survey {
            ends: vec![None; self.names.len()],
            few: vec![None; self.names.len()],
            decimals: times.map(|time| time.decimals()).max().unwrap_or(0),
        })
    }

    /// The name of the table in messages.
    pub(crate) fn file(&self) -> &str {
        &self.file
    }

    /// Whether rows may come one by one, as from a pipe: what is made of a row must not wait for the next.
    pub(crate) fn is_live(&self) -> bool {
        self.limit == 1
    }

    /// Number of the last row read, counted from 1 after the line of names.
    pub(crate) fn row(&self) -> u64 {
        self.row
    }

    /// As [`open`](Self::open), with the columns whose cells or names say that they are times, unless the user named some. If the first rows
    /// leave open whether day or month stands first, all rows of a file decide.
    pub(crate) fn open_with_time(options: &TableOptions, nanoseconds: u64) -> Result<Self, Error> {
        decided(options, |options| {
            let mut table = Self::open(options)?;
            table.find_time(nanoseconds)?;
            Ok(table)
        })
    }

    fn find_time(&mut self, nanoseconds: u64) -> Result<(), Error> {
        if self.table.time().is_none() {
            self.table.find_certain_time().map_err(Error::of_table(&self.file))?;
            self.table.allow_inexact_times(nanoseconds);
            self.rename();
        }
        Ok(())
    }

    /// Takes these columns of values, by index, and the time from those of a list, from where the table has it, or from one left over.
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

    /// Learns anew what columns are if lines are left out: those without a time, which was chosen since, tell nothing.
    pub(crate) fn learn_with_time(&mut self, options: &TableOptions, time: Option<String>) -> Result<(), Error> {
        let skips = self.learned.is_some() && options.dialect.said()?.skip_bad > 0;
        let Some((columns, _)) = self.table.time().filter(|_| skips) else {
            return Ok(());
        };
        let list = columns.iter().map(|i| names::quoted(&self.table.columns()[*i].name));
        let again = TableOptions {
            time,
            time_column: Some(list.collect::<Vec<_>>().join(",")),
            columns: Vec::new(),
            without: None,
            ..options.clone()
        };
        let survey = chosen(&again)?.survey().map_err(Error::of_table(&self.file))?;
        self.table.use_survey(&survey);
        self.learned = Some(survey);
        Ok(())
    }

    /// Reads a column as names instead of numbers: [`Table::label`].
    pub(crate) fn with_labels(mut self, name: &str) -> Result<Self, Error> {
        self.table.set_label(name).map_err(Error::of_table(&self.file))?;
        self.is_long = true;
        self.rename();
        Ok(self)
    }

    /// Whether times are those of a day, without a date.
    pub(crate) fn is_of_day(&self) -> bool {
        self.table.is_of_day()
    }

    /// [`fewbits_recipes::times::name`] of the columns of values.
    pub(crate) fn time_name(&self) -> String {
        times::name(&self.table, &self.names)
    }

    /// The name in the last row read.
    pub(crate) fn label(&self) -> &str {
        self.table.label()
    }

    /// What the column at an index of `names` holds.
    pub(crate) fn kind(&self, index: usize) -> Kind {
        let place = self.table.selected().get(index);
        let column = place.and_then(|column| self.table.columns().get(*column));
        column.map_or(Kind::Number, |column| column.kind)
    }

    /// The unit of the column at an index of `names`, or the list of its words.
    pub(crate) fn unit(&self, index: usize) -> String {
        let column = self.table.selected().get(index);
        column.map_or(String::new(), |column| recipe::unit(&self.table, *column))
    }

    /// Refuses columns of words where `has_numbers` holds of their index, for tasks that compute with cells.
    pub(crate) fn require_numbers(&self, has_numbers: impl Fn(usize) -> bool) -> Result<(), Error> {
        let has_words = |i: &usize| has_numbers(*i) && matches!(self.kind(*i), Kind::Words | Kind::Text);
        let Some(i) = (0..self.names.len()).find(has_words) else {
            return Ok(());
        };
        let problem = format!(
            "column `{}` holds words, and numbers are expected: choose columns with --columns, or name gaps with --missing",
            crate::say::name(&self.names[i])
        );
        Err(Error::content(&self.file, problem))
    }

    /// Takes cells as `<0.25` for limits. Returns whether any column has them.
    pub(crate) fn take_limits(&mut self) -> bool {
        self.table.take_limits(self.learned.as_ref())
    }

    /// The side of a cell of the last row that is a limit.
    pub(crate) fn limit(&self, index: usize) -> Option<Side> {
        let is_it = |limit: &&(usize, usize, Side)| limit.0 == index && limit.1 + 1 == self.next;
        self.batch.limits.iter().find(is_it).map(|limit| limit.2)
    }

    /// Whether there is no further row.
    pub(crate) fn is_at_end(&mut self) -> Result<bool, Error> {
        self.fill().map(|more| !more)
    }

    /// The number that codes of whole numbers of the column at an index of `names` count from; `None` if it has other cells.
    pub(crate) fn origin(&mut self, index: usize) -> Result<Option<i64>, Error> {
        if self.kind(index) != Kind::Integer {
            return Ok(None);
        }
        self.fill()?;
        Ok(recipe::origin(&self.table, self.learned.as_ref(), &self.batch, index))
    }

    /// Codes whole numbers that no double holds from now on, and says how.
    pub(crate) fn code_integers(&mut self) -> Result<Vec<Option<Integers>>, Error> {
        let origins: Vec<Option<i64>> = (0..self.names.len())
            .map(|index| self.origin(index))
            .collect::<Result<_, _>>()?;
        let code = |origin: Option<i64>| origin.map(Integers::from_origin);
        self.integers = origins.into_iter().map(code).collect();
        Ok(self.integers.clone())
    }

    /// States the words and the codes of the columns of a recording, so that cells are the numbers that it has for them.
    ///
    /// # Errors
    /// If rows that were read ahead have other words, or a column has words where the recording has numbers.
    pub(crate) fn use_words(&mut self, columns: &[&fewbits_record::Column]) -> Result<(), Error> {
        self.require_numbers(|i| columns.get(i).is_some_and(|column| words::of(column.unit()).is_none()))?;
        self.integers = columns.iter().map(|column| column.integers()).collect();
        recipe::use_words(&mut self.table, &self.batch, columns).map_err(Error::of_table(&self.file))
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
            let (file, count) = (&self.file, skipped.repeated);
            say!("{file}: {count} lines that repeat the names or the lines around them were left out");
        }
    }

    /// What times are measured from, and that of the first row.
    pub(crate) fn first_time(&mut self) -> Result<Option<(Scale, Option<Time>)>, Error> {
        let Some((_, scale)) = self.table.time() else {
            return Ok(None);
        };
        self.fill()?;
        Ok(Some((scale, self.batch.times.first().copied())))
    }

    /// The time base for the times of the table, from its first row.
    pub(crate) fn time_base(&mut self, options: &TableOptions, survey: Option<&Survey>) -> Result<TimeBase, Error> {
        let Some((scale, first)) = self.first_time()? else {
            return Ok(TimeBase::Numbered);
        };
        let nanoseconds = clock::tolerance(options.time.as_deref().unwrap_or("exact"))?;
        Ok(times::base(scale, first, survey.map(|survey| survey.decimals), nanoseconds))
    }

    /// The next row; `None` after the last.
    pub(crate) fn next(&mut self, time: TimeBase) -> Result<Option<Row>, Error> {
        if !self.fill()? {
            return Ok(None);
        }
        let row = self.next;
        self.row = self.batch.places[row].row;
        let failed = Error::of_table(&self.file);
        let tick = match self.batch.times.get(row) {
            Some(found) => times::of_row(*found, time)
                .map_err(|problem| failed(recipe::time_refused(&self.table, &self.batch, row, *found, problem)))?,
            None => None,
        };
        let cell = |index: usize| {
            let integers = self.integers.get(index).copied().flatten();
            recipe::cell(&self.table, &self.batch, index, row, integers)
        };
        let cells = (0..self.batch.columns.len())
            .map(cell)
            .collect::<Result<_, _>>()
            .map_err(failed)?;
        self.next += 1;
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

    /// What reading the whole table once shows of the selected columns. `options` are those with which it was opened.
    pub(crate) fn survey(&mut self, options: &TableOptions) -> Result<Survey, Error> {
        let survey = match self.learned.take() {
            Some(survey) => survey,
            None => {
                let survey = chosen(options)?.survey().map_err(Error::of_table(&self.file))?;
                // Rows behind the first may show another kind.
                self.table.use_survey(&survey);
                survey
            }
        };
        let survey = self.learned.insert(survey);
        let columns = self.table.selected().iter().map(|i| &survey.columns[*i]);
        Ok(Survey {
            ends: columns.clone().map(|column| column.range).collect(),
            few: columns.map(fewbits_table::Profile::few).collect(),
            decimals: survey.times.decimals,
        })
    }
}
