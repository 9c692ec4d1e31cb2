//! Reading a table: rows of text become cells of columns.

use crate::clock;
use crate::column::{Batch, Cells, Column, Kind, MAX_WORDS};
use crate::dialect::Dialect;
use crate::error::{Error, Place, listed, printable};
use crate::lines::Row;
use crate::missing::{self, Spellings};
use crate::names;
use crate::number::{self, Number};
use crate::open::Rows;
use crate::profile::{Profile, boolean};
use crate::time::{Clock, Scale, Time};

/// Largest number of lines that were left out and whose faults are kept.
const MAX_FAULTS: usize = 10;

/// A table that is read from front to end.
pub struct Table {
    pub(crate) rows: Rows,
    #[cfg(feature = "parquet")]
    pub(crate) arrow: Option<crate::parquet::ArrowRows>,
    pub(crate) dialect: Dialect,
    pub(crate) syntax: number::Syntax,
    pub(crate) columns: Vec<Column>,
    pub(crate) gaps: Vec<Spellings>,
    /// Profiles of the columns over the first lines.
    pub(crate) profiles: Vec<Profile>,
    /// Words of each column, by their indices, and the clocks of columns of times.
    pub(crate) words: Vec<Vec<String>>,
    pub(crate) clocks: Vec<Option<Clock>>,
    pub(crate) selected: Vec<usize>,
    pub(crate) time: Option<(Vec<usize>, Clock)>,
    pub(crate) label: Option<usize>,
    row: Row,
    pub(crate) count: u64,
    pub(crate) skipped: Skipped,
    /// An error that came behind rows that were handed out first.
    late_error: Option<Error>,
}

/// Lines that were left out.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Skipped {
    /// Lines that could not be read, as [`Dialect::skip_bad`] allows.
    pub bad: u64,
    /// What was wrong with the first of them.
    pub faults: Vec<String>,
    /// Lines that repeat the names or the lines around them.
    pub repeated: u64,
    /// Rows without any cell.
    pub blank: u64,
}

impl Table {
    pub(crate) fn new(
        rows: Rows,
        dialect: Dialect,
        columns: Vec<Column>,
        profiles: Vec<Profile>,
    ) -> Result<Self, Error> {
        let byte = |mark: char| mark as u32 as u8;
        let syntax = number::Syntax {
            decimal: dialect.decimal.map_or(b'.', byte),
            thousands: dialect.thousands.map(byte),
        };
        let count = columns.len();
        let mut table = Self {
            gaps: columns
                .iter()
                .map(|column| dialect.missing_of(&column.name, &column.own_name))
                .collect(),
            rows,
            #[cfg(feature = "parquet")]
            arrow: None,
            dialect,
            syntax,
            words: vec![Vec::new(); count],
            clocks: vec![None; count],
            selected: (0..count).collect(),
            time: None,
            label: None,
            row: Row::default(),
            count: 0,
            skipped: Skipped::default(),
            late_error: None,
            profiles,
            columns,
        };
        for word in &table.dialect.missing {
            if let Some((name, _)) = word.rsplit_once('=').filter(|(name, _)| *name != "*") {
                table.position(&names::unquoted(name.trim()))?;
            }
        }
        let kinds: Vec<Kind> = table.profiles.iter().map(Profile::kind).collect();
        table.set_kinds(&kinds);
        table.set_said_time()?;
        Ok(table)
    }

    /// A table of Arrow arrays.
    #[cfg(feature = "parquet")]
    pub(crate) fn of_arrow(
        arrow: crate::parquet::ArrowRows,
        mut dialect: Dialect,
        columns: Vec<Column>,
        profiles: Vec<Profile>,
    ) -> Result<Self, Error> {
        let said = std::mem::take(&mut dialect.time_column);
        let mut table = Self::new(Rows::none(), dialect, columns, profiles)?;
        table.arrow = Some(arrow);
        let profiles = std::mem::take(&mut table.profiles);
        table.set_arrow_kinds(&profiles);
        table.profiles = profiles;
        table.dialect.time_column = said;
        table.set_said_time()?;
        Ok(table)
    }

    #[cfg(feature = "parquet")]
    fn set_arrow_kinds(&mut self, profiles: &[Profile]) {
        if let Some(rows) = &self.arrow {
            let kinds = profiles
                .iter()
                .enumerate()
                .map(|(i, profile)| Self::arrow_kind(rows, i, profile));
            let kinds: Vec<Kind> = kinds.collect();
            self.set_kinds(&kinds);
        }
    }

    fn set_said_time(&mut self) -> Result<(), Error> {
        let table = self;
        if !table.dialect.time_column.is_empty() {
            let names = table.dialect.time_column.clone();
            table.set_time(&names)?;
        }
        Ok(())
    }

    fn set_kinds(&mut self, kinds: &[Kind]) {
        for (i, kind) in kinds.iter().enumerate().take(self.columns.len()) {
            self.columns[i].kind = *kind;
            if *kind == Kind::Time && self.clocks[i].is_none() {
                let mut own = Dialect {
                    time_format: None,
                    ..self.dialect.clone()
                };
                let name = self.columns[i].own_name.clone();
                self.clocks[i] = clock::clock(&[&name], &self.profiles[i].sample, &mut own).ok();
            }
        }
    }

    /// Uses what a [`survey`](Self::survey) of the same table found: the kinds of columns over all rows.
    pub fn use_survey(&mut self, survey: &Survey) {
        #[cfg(feature = "parquet")]
        if self.arrow.is_some() {
            self.set_arrow_kinds(&survey.columns);
            return;
        }
        let kinds: Vec<Kind> = survey.columns.iter().map(Profile::kind).collect();
        self.set_kinds(&kinds);
    }

    /// How the table is written, completed by what was detected.
    pub fn dialect(&self) -> &Dialect {
        &self.dialect
    }

    /// All columns of the table.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Indices of the columns that are read, in their order.
    pub fn selected(&self) -> &[usize] {
        &self.selected
    }

    /// Words of a column, to which its cells refer.
    pub fn words(&self, column: usize) -> &[String] {
        self.words.get(column).map_or(&[], Vec::as_slice)
    }

    /// Lines that were left out so far.
    pub fn skipped(&self) -> &Skipped {
        &self.skipped
    }

    /// Index of a column by its name, its name in the file, or its number as `#3`.
    ///
    /// # Errors
    /// If there is none.
    pub fn position(&self, name: &str) -> Result<usize, Error> {
        let known: Vec<String> = self.columns.iter().map(|column| column.name.clone()).collect();
        let own: Vec<String> = self.columns.iter().map(|column| column.own_name.clone()).collect();
        names::find(&known, &own, name).ok_or_else(|| Error::NoColumn {
            column: printable(name),
            existing: listed(known.iter().map(String::as_str)),
        })
    }

    /// Reads these columns only, in this order. The columns of the time are none of them unless they are named.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn select<S: AsRef<str>>(&mut self, names: &[S]) -> Result<(), Error> {
        self.selected = names
            .iter()
            .map(|name| self.position(name.as_ref()))
            .collect::<Result<_, _>>()?;
        Ok(())
    }

    /// Leaves columns out.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn leave_out<S: AsRef<str>>(&mut self, names: &[S]) -> Result<(), Error> {
        let out: Vec<usize> = names
            .iter()
            .map(|name| self.position(name.as_ref()))
            .collect::<Result<_, _>>()?;
        self.selected.retain(|column| !out.contains(column));
        Ok(())
    }

    /// Takes the times of rows from these columns, which are then no columns of values.
    ///
    /// # Errors
    /// If there is no such column, or its cells are no times.
    pub fn set_time<S: AsRef<str>>(&mut self, names: &[S]) -> Result<(), Error> {
        let columns: Vec<usize> = names
            .iter()
            .map(|name| self.position(name.as_ref()))
            .collect::<Result<_, _>>()?;
        self.set_time_columns(columns)
    }

    /// Takes the times of rows from the columns whose cells or names say so. Returns whether there are such columns.
    ///
    /// # Errors
    /// If the cells are no times, or may have the day or the month first.
    pub fn find_time(&mut self) -> Result<bool, Error> {
        match clock::guess(&self.columns, &self.dialect) {
            Some(columns) => self.set_time_columns(columns).map(|()| true),
            None => Ok(false),
        }
    }

    fn set_time_columns(&mut self, columns: Vec<usize>) -> Result<(), Error> {
        #[cfg(feature = "parquet")]
        if let (Some(rows), [column]) = (&self.arrow, columns.as_slice())
            && let Some(scale) = rows.scale(*column)
        {
            let zone = self
                .dialect
                .time_zone
                .as_deref()
                .filter(|_| scale == Scale::Local)
                .and_then(crate::time::zone);
            let scale = if zone.is_some() { Scale::Utc } else { scale };
            self.dialect.time_column = vec![self.columns[*column].name.clone()];
            self.selected.retain(|other| other != column);
            self.time = Some((columns, Clock::typed(scale, zone)));
            return Ok(());
        }
        let own: Vec<String> = columns.iter().map(|i| self.columns[*i].own_name.clone()).collect();
        let own: Vec<&str> = own.iter().map(String::as_str).collect();
        let length = columns
            .iter()
            .map(|i| self.profiles[*i].sample.len())
            .min()
            .unwrap_or(0);
        let joined = |row: usize| {
            columns
                .iter()
                .map(|i| self.profiles[*i].sample[row].as_str())
                .collect::<Vec<_>>()
                .join(" ")
        };
        let sample: Vec<String> = (0..length).map(joined).collect();
        let found = clock::clock(&own, &sample, &mut self.dialect).map_err(|refused| match refused {
            Ok(error) => error,
            Err((row, (problem, mend))) => Error::Cell {
                place: self.profiles[columns[0]].first_text.as_ref().map_or(
                    Place {
                        line: self.rows.line() + 1,
                        row: 1,
                    },
                    |(place, _)| *place,
                ),
                column: own.join(", "),
                cell: printable(&sample[row]),
                problem,
                mend: mend.to_owned(),
            },
        })?;
        self.dialect.time_column = columns.iter().map(|i| self.columns[*i].name.clone()).collect();
        self.selected.retain(|column| !columns.contains(column));
        self.time = Some((columns, found));
        Ok(())
    }

    /// Indices of the columns of the time, and what it is measured from.
    pub fn time(&self) -> Option<(&[usize], Scale)> {
        self.time
            .as_ref()
            .map(|(columns, clock)| (columns.as_slice(), clock.scale))
    }

    /// Lets times be off a little: leap seconds become the next second, and decimals beyond the 18th are cut.
    pub fn allow_inexact_times(&mut self) {
        if let Some((_, clock)) = &mut self.time {
            clock.takes_leap_seconds = true;
            clock.cuts = true;
        }
    }

    /// Keeps the text of a column for [`label`](Self::label), as the names of what rows report; it is then no column of values.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn set_label(&mut self, name: &str) -> Result<(), Error> {
        let column = self.position(name)?;
        self.selected.retain(|other| *other != column);
        self.label = Some(column);
        Ok(())
    }

    /// The label of the last row that was read.
    pub fn label(&self) -> &str {
        #[cfg(feature = "parquet")]
        if let Some(rows) = &self.arrow {
            return &rows.label;
        }
        self.label.map_or("", |column| self.row.cell_text(column))
    }

    /// Reads at most `limit` rows into `batch`. Returns how many there were; 0 after the last. Of a live source, a call with a limit of 1
    /// waits for no more than one row.
    ///
    /// # Errors
    /// If a line or a cell cannot be read and no more may be left out. Rows before it are handed out first. After an error in one line,
    /// reading goes on behind it.
    pub fn read(&mut self, batch: &mut Batch, limit: usize) -> Result<usize, Error> {
        batch.reset(self.selected.iter().map(|i| self.columns[*i].kind));
        if let Some(error) = self.late_error.take() {
            return Err(error);
        }
        while batch.rows < limit {
            let outcome = match self.next_into(batch) {
                Ok(false) => break,
                other => other,
            };
            if let Err(error) = outcome {
                batch.cut();
                let error = self.placed(error);
                if error.place().is_none() || self.is_repeated() {
                    if error.place().is_some() {
                        self.skipped.repeated += 1;
                        continue;
                    }
                    return Err(error);
                }
                if self.skipped.bad < self.dialect.skip_bad {
                    self.skip(&error);
                } else if batch.rows > 0 {
                    self.late_error = Some(error);
                    break;
                } else {
                    return Err(error);
                }
            }
        }
        Ok(batch.rows)
    }

    /// Reads the next row into `batch`. Returns whether there was one.
    fn next_into(&mut self, batch: &mut Batch) -> Result<bool, Error> {
        #[cfg(feature = "parquet")]
        if self.arrow.is_some() {
            return self.next_arrow(batch);
        }
        if !self.next_row()? {
            return Ok(false);
        }
        self.push(batch).map(|()| true)
    }

    fn skip(&mut self, error: &Error) {
        self.skipped.bad += 1;
        if self.skipped.faults.len() < MAX_FAULTS {
            self.skipped.faults.push(error.to_string());
        }
    }

    fn is_repeated(&self) -> bool {
        self.rows.is_preamble(&self.row)
    }

    /// An error of a line with the number of its row.
    fn placed(&self, mut error: Error) -> Error {
        if let Error::Line { place, problem, mend } = &mut error {
            place.row = self.count;
            if self.row.text.contains(&0) {
                "NUL bytes, as after a loss of power".clone_into(problem);
                *mend = "leave such lines out with --skip-bad";
            }
        }
        error
    }

    /// Reads the next row that is not blank into `self.row`.
    fn next_row(&mut self) -> Result<bool, Error> {
        loop {
            self.row.text.clear();
            self.row.cells.clear();
            let found = self.rows.next(&mut self.row);
            if !matches!(found, Ok(None)) {
                self.count += 1;
            }
            if found?.is_none() {
                return Ok(false);
            }
            if self.row.is_blank()
                && (self.row.cells.len() <= 1 || self.time.is_some())
                && (self.columns.len() > 1 || self.time.is_some())
            {
                self.count -= 1;
                self.skipped.blank += u64::from(self.row.cells.len() > 1);
                continue;
            }
            if self.rows.is_header_again(&self.row) {
                self.count -= 1;
                self.skipped.repeated += 1;
                continue;
            }
            return Ok(true);
        }
    }

    fn place(&self) -> Place {
        Place {
            line: self.row.line,
            row: self.count,
        }
    }

    fn push(&mut self, batch: &mut Batch) -> Result<(), Error> {
        self.rows.check_length(&self.row, self.columns.len(), &self.dialect)?;
        if let Some((columns, clock)) = &self.time {
            let time = match columns.as_slice() {
                [column] => match self.row.cell_text(*column) {
                    "" => {
                        Err(("is no time: the cell is empty", "mend the row, or leave such rows out with --skip-bad"))
                    }
                    text => clock.parse(text),
                },
                several => clock.of_parts(&several.iter().map(|i| self.row.cell_text(*i)).collect::<Vec<_>>()),
            };
            let time = time.map_err(|(problem, mend)| {
                let text = columns
                    .iter()
                    .map(|i| self.row.cell_text(*i))
                    .collect::<Vec<_>>()
                    .join(" ");
                self.refused(columns[0], &text, problem, mend.to_owned())
            })?;
            batch.times.push(time);
        }
        for (i, column) in self.selected.iter().enumerate() {
            let cell = self.row.cell(*column);
            if let Cells::Numbers(numbers) = &mut batch.columns[i] {
                // The usual cases, without a copy.
                if cell.is_empty() {
                    numbers.push(None);
                    continue;
                }
                if let Ok(Number::Double(value, _)) = number::parse(cell, self.syntax) {
                    let gaps = &self.gaps[*column];
                    numbers.push(Some(value).filter(|_| !gaps.has_numbers() || !gaps.has_number(value)));
                    continue;
                }
            }
            let pushed = push_cell(
                &mut batch.columns[i],
                self.row.cell_text(*column),
                &Meaning {
                    syntax: self.syntax,
                    gaps: &self.gaps[*column],
                    strips: self.dialect.strip_units,
                    clock: self.clocks[*column].as_ref(),
                    kind: self.columns[*column].kind,
                },
                &mut self.words[*column],
            );
            if let Err((problem, mend)) = pushed {
                return Err(self.cell_refused(*column, problem, mend));
            }
        }
        batch.places.push(self.place());
        batch.rows += 1;
        Ok(())
    }

    fn refused(&self, column: usize, cell: &str, problem: &'static str, mend: String) -> Error {
        Error::Cell {
            place: self.place(),
            column: printable(&self.columns[column].name),
            cell: printable(cell),
            problem,
            mend,
        }
    }

    fn cell_refused(&self, column: usize, problem: &'static str, mend: &'static str) -> Error {
        let cell = self.row.cell_text(column);
        let is_one_column =
            self.columns.len() == 1 && cell.contains([';', '\t', '|', ' ']) && problem == number::NO_NUMBER;
        let mend = if is_one_column {
            "name what separates cells with --delimiter"
        } else if problem == number::NO_NUMBER && crate::time::looks_like_time(cell) && self.time.is_none() {
            "if this is the time of the row, add --time exact"
        } else {
            mend
        };
        self.refused(column, cell, problem, mend.to_owned())
    }

    /// Reads all that is left and counts: kinds, ranges, gaps and times.
    ///
    /// # Errors
    /// As [`read`](Self::read), but cells of values are counted, not refused.
    pub fn survey(mut self) -> Result<Survey, Error> {
        #[cfg(feature = "parquet")]
        if self.arrow.is_some() {
            return self.survey_arrow();
        }
        let mut survey = Survey {
            columns: vec![Profile::default(); self.columns.len()],
            ..Survey::default()
        };
        let mut batch = Batch::default();
        self.selected.clear();
        loop {
            match self.read(&mut batch, 1) {
                Ok(0) => break,
                Ok(_) => {}
                Err(error) => return Err(error),
            }
            survey.rows += 1;
            let place = self.place();
            for (i, profile) in survey.columns.iter_mut().enumerate() {
                profile.add(self.row.cell_text(i), place, self.syntax, &self.gaps[i], self.dialect.strip_units);
            }
            if let Some(time) = batch.times.first() {
                survey.times.add(*time);
            }
        }
        survey.skipped = self.skipped;
        Ok(survey)
    }
}

/// Counts over all rows of a table.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Survey {
    /// Number of rows.
    pub rows: u64,
    /// Counts of each column.
    pub columns: Vec<Profile>,
    /// Counts of the times.
    pub times: Times,
    /// Lines that were left out.
    pub skipped: Skipped,
}

/// Counts over the times of rows.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Times {
    /// Decimals of a second that the finest one needs.
    pub decimals: u8,
    /// The first and the last in the order of rows.
    pub ends: Option<(Time, Time)>,
    /// Rows that are before the row above.
    pub backward: u64,
    /// Rows at the time of the row above.
    pub repeated: u64,
    /// The smallest and the largest step forward, in seconds.
    pub steps: Option<(f64, f64)>,
}

impl Times {
    pub(crate) fn add(&mut self, time: Time) {
        self.decimals = self.decimals.max(time.decimals());
        let Some((first, last)) = self.ends else {
            self.ends = Some((time, time));
            return;
        };
        self.ends = Some((first, time));
        let step = time.seconds_since(last);
        if time == last {
            self.repeated += 1;
        } else if step < 0.0 {
            self.backward += 1;
        } else {
            let (low, high) = self.steps.unwrap_or((step, step));
            self.steps = Some((low.min(step), high.max(step)));
        }
    }
}

/// What is known of the cells of a column.
pub(crate) struct Meaning<'a> {
    pub(crate) syntax: number::Syntax,
    pub(crate) gaps: &'a Spellings,
    pub(crate) strips: bool,
    pub(crate) clock: Option<&'a Clock>,
    pub(crate) kind: Kind,
}

/// Adds a cell to the cells of its column.
pub(crate) fn push_cell(
    cells: &mut Cells,
    text: &str,
    meaning: &Meaning<'_>,
    words: &mut Vec<String>,
) -> Result<(), number::Problem> {
    let is_numeric = matches!(meaning.kind, Kind::Number | Kind::Integer | Kind::Boolean);
    let is_gap = missing::is_usual(text, is_numeric) || (!meaning.gaps.is_empty() && meaning.gaps.has_text(text));
    match cells {
        Cells::Numbers(numbers) => numbers.push(if is_gap { None } else { number(text, meaning)? }),
        Cells::Integers(integers) => integers.push(if is_gap { None } else { integer(text, meaning.syntax)? }),
        Cells::Booleans(booleans) => booleans.push(match (is_gap, boolean(text)) {
            (true, _) => None,
            (_, Some(yes)) => Some(yes),
            _ => {
                return Err((
                    "is not true or false",
                    "mend the cell, name it with --missing, or leave the column out with --without",
                ));
            }
        }),
        Cells::Times(times) => times.push(match (is_gap, meaning.clock) {
            (true, _) => None,
            (_, Some(clock)) => Some(clock.parse(text)?),
            _ => return Err(crate::time::AMBIGUOUS),
        }),
        Cells::Words(indices) => {
            if is_gap {
                indices.push(None);
                return Ok(());
            }
            let known = words.iter().position(|word| word == text);
            if known.is_none() && (words.len() == MAX_WORDS || meaning.kind == Kind::Text) {
                return Err(("is text, and the column has more than 256 texts", "leave the column out with --without"));
            }
            indices.push(Some(known.unwrap_or_else(|| {
                words.push(text.to_owned());
                words.len() - 1
            }) as u32));
        }
    }
    Ok(())
}

fn number(text: &str, meaning: &Meaning<'_>) -> Result<Option<f64>, number::Problem> {
    let parsed = number::parse(text.as_bytes(), meaning.syntax);
    let parsed = match (&parsed, meaning.strips, number::without_unit(text)) {
        (Err(_), true, Some((number, _))) => number::parse(number.as_bytes(), meaning.syntax),
        _ => parsed,
    };
    match parsed {
        Ok(Number::Double(value, _)) => Ok(Some(value).filter(|_| !meaning.gaps.has_number(value))),
        Ok(Number::Whole(_)) => Err((
            "is a whole number of more than 53 bits among numbers with decimals",
            "split the column, or leave it out with --without",
        )),
        Err(problem) => Err(problem),
    }
}

fn integer(text: &str, syntax: number::Syntax) -> Result<Option<i64>, number::Problem> {
    match number::parse(text.as_bytes(), syntax)? {
        Number::Whole(whole) => Ok(Some(whole)),
        Number::Double(value, _) if value.fract() == 0.0 && value.abs() < 9.2e18 => Ok(Some(value as i64)),
        Number::Double(..) => Err((
            "is no whole number, as others of the column",
            "mend the cell, or leave the column out with --without",
        )),
    }
}
