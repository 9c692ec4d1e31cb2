//! A table: its columns, which of them are read, and which give the time.

use crate::clock;
use crate::column::{Column, Kind};
use crate::dialect::Dialect;
use crate::error::{Error, listed, printable};
use crate::known;
use crate::lines::Row;
use crate::missing::Spellings;
use crate::names;
use crate::number;
use crate::plain::Scanner;
use crate::profile::{Meaning, Profile};
use crate::rows::Rows;
use crate::survey::Survey;
use crate::words::Words;
use crate::written::Clock;

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
    pub(crate) words: Vec<Words>,
    /// Whether a column has cells as `<0.25`.
    pub(crate) has_limits: Vec<bool>,
    pub(crate) clocks: Vec<Option<Clock>>,
    pub(crate) selected: Vec<usize>,
    pub(crate) time: Option<(Vec<usize>, Clock)>,
    pub(crate) label: Option<usize>,
    /// Columns of values of a long table that is made wide.
    pub(crate) values: Vec<usize>,
    /// Of a wide table that was made of a long one: the line of each row there, and how that is written.
    pub(crate) own_lines: Vec<u64>,
    pub(crate) own_dialect: Option<Dialect>,
    pub(crate) row: Row,
    /// What splits plain lines, if the table may have some.
    pub(crate) scanner: Option<Scanner>,
    pub(crate) count: u64,
    /// The first cell of the last row, if it is a number and rows may stand in blocks.
    pub(crate) first_number: Option<f64>,
    pub(crate) skipped: Skipped,
    /// An error that came behind rows that were handed out first.
    pub(crate) late_error: Option<Error>,
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
        let syntax = dialect.marks();
        let count = columns.len();
        let has_settings = dialect.format.as_deref() == Some(known::TEKTRONIX);
        let first = if has_settings { known::SETTINGS } else { 0 };
        let mut table = Self {
            gaps: columns
                .iter()
                .map(|column| dialect.missing_of(&column.name, &column.own_name))
                .collect(),
            scanner: rows.scanner(syntax, count),
            rows,
            #[cfg(feature = "parquet")]
            arrow: None,
            dialect,
            syntax,
            words: vec![Words::default(); count],
            has_limits: Vec::new(),
            clocks: vec![None; count],
            selected: (first.min(count)..count).collect(),
            time: None,
            label: None,
            values: Vec::new(),
            own_lines: Vec::new(),
            own_dialect: None,
            row: Row::default(),
            count: 0,
            first_number: None,
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
        for name in &table.dialect.words {
            table.position(name)?;
        }
        let kinds: Vec<Kind> = table.profiles.iter().map(Profile::kind).collect();
        table.set_kinds(&kinds);
        let profiles = std::mem::take(&mut table.profiles);
        table.set_words(&profiles);
        table.profiles = profiles;
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
                // A table of Arrow arrays without rows has no profiles here.
                let sample = self.profiles.get(i).map_or(&[][..], |profile| &profile.sample);
                self.clocks[i] = clock::clock(&[&name], sample, None, &mut own).ok();
            }
        }
    }

    /// Uses what a [`survey`](Self::survey) of the same table found: the kinds of columns over all rows.
    pub fn use_survey(&mut self, survey: &Survey) {
        self.set_words(&survey.columns);
        for (profile, known) in survey.columns.iter().zip(&mut self.profiles) {
            known.unit.clone_from(&profile.unit);
        }
        #[cfg(feature = "parquet")]
        if self.arrow.is_some() {
            self.set_arrow_kinds(&survey.columns);
            return;
        }
        let kinds: Vec<Kind> = survey.columns.iter().map(Profile::kind).collect();
        self.set_kinds(&kinds);
    }

    fn set_words(&mut self, profiles: &[Profile]) {
        for (i, profile) in profiles.iter().enumerate().take(self.words.len()) {
            if profile.kind() == Kind::Words {
                self.words[i] = Words::new(profile.all_words(&self.gaps[i]));
            }
        }
    }

    /// States the words of a column: its cells are indices into this list, and other words are refused.
    pub fn fix_words(&mut self, column: usize, words: Vec<String>) {
        if let (Some(known), Some(column)) = (self.words.get_mut(column), self.columns.get_mut(column)) {
            *known = Words::fixed(words);
            column.kind = Kind::Words;
        }
    }

    /// States that a column has whole numbers of 64 bits, where the first rows show only such as doubles hold. A typed column keeps its type.
    pub fn expect_integers(&mut self, column: usize) {
        #[cfg(feature = "parquet")]
        if self.arrow.is_some() {
            return;
        }
        if let Some(column) = self.columns.get_mut(column)
            && column.kind == Kind::Number
        {
            column.kind = Kind::Integer;
        }
    }

    /// How the table is written, completed by what was detected.
    pub fn dialect(&self) -> &Dialect {
        self.own_dialect.as_ref().unwrap_or(&self.dialect)
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
        self.words.get(column).map_or(&[], Words::as_slice)
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

    /// Whether the first lines have numbers in every selected column, and nothing else, and no name says that they are identifiers: then
    /// nothing is learned by a [`survey`](Self::survey) of their kinds.
    pub fn is_plain(&self) -> bool {
        let mut selected = self.selected.iter();
        selected.all(|i| {
            let profile = &self.profiles[*i];
            self.columns[*i].kind == Kind::Number && profile.numbers > 0 && profile.meaning == Meaning::Open
        })
    }

    /// The selected columns of numbers whose digits have zeros in front in the first rows, which are lost, and a cell of each.
    pub fn lost_zeros(&self) -> Vec<(&Column, &str)> {
        let of = |i: &usize| Some((self.columns.get(*i)?, self.profiles.get(*i)?.lost_zeros()?));
        self.selected.iter().filter_map(of).collect()
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
}
