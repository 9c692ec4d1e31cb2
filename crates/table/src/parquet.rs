//! Parquet files as tables: every type of number, decimals, times, booleans, dictionaries and text; others are named when they are asked for.

use crate::arrow::{self, Decoded};
use crate::cell::{Meaning, push_cell};
use crate::column::{Batch, Cells, Column, Kind};
use crate::dialect::Dialect;
use crate::error::{Error, Place, printable};
use crate::names;
use crate::profile::Profile;
use crate::survey::{Survey, WATCHED};
use crate::table::Table;
use crate::time::{Scale, Time};
use ::parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::ParquetMetaData;
use ::parquet::file::reader::ChunkReader;
use arrow_array::RecordBatch;
use arrow_schema::{FieldRef, SchemaRef};

/// Rows of a batch of Arrow arrays.
const ROWS: usize = 1 << 14;

/// Rows of a Parquet file.
pub(crate) struct ArrowRows {
    reader: ParquetRecordBatchReader,
    schema: SchemaRef,
    /// The first batch, which was read ahead.
    ahead: Option<RecordBatch>,
    /// Cells of the columns that are needed, of the present batch.
    decoded: Vec<Option<Decoded>>,
    length: usize,
    next: usize,
    pub(crate) label: String,
}

impl ArrowRows {
    fn field(&self, column: usize) -> &FieldRef {
        &self.schema.fields()[column]
    }

    /// What times of a column are measured from, if its type says so.
    pub(crate) fn scale(&self, column: usize) -> Option<Scale> {
        if self.field(column).metadata().contains_key("decimals") {
            return Some(Scale::Seconds);
        }
        arrow::scale_of(self.field(column).data_type())
    }

    /// Goes to the next row; loads a batch if needed. Returns whether there is one.
    fn advance(&mut self, needed: &[usize]) -> Result<bool, Error> {
        while self.next == self.length {
            let batch = match self.ahead.take() {
                Some(batch) => batch,
                None => match next_of(&mut self.reader)? {
                    None => return Ok(false),
                    Some(batch) => batch,
                },
            };
            self.decoded = vec![None; self.schema.fields().len()];
            for column in needed {
                self.decoded[*column] = Some(arrow::decode(self.field(*column), batch.column(*column))?);
            }
            self.length = batch.num_rows();
            self.next = 0;
        }
        self.next += 1;
        Ok(true)
    }

    /// A cell as text, for times of several columns, labels and messages.
    pub(crate) fn text(&self, column: usize) -> String {
        let row = self.next - 1;
        match &self.decoded[column] {
            Some(Decoded::Texts(texts)) => texts[row].clone().unwrap_or_default(),
            Some(Decoded::Cells(cells)) => shown(cells, row, self.scale(column)),
            None => String::new(),
        }
    }
}

fn shown(cells: &Cells, row: usize, scale: Option<Scale>) -> String {
    match cells {
        Cells::Numbers(cells) => cells[row].map_or(String::new(), |value| format!("{value}")),
        Cells::Integers(cells) => cells[row].map_or(String::new(), |value| value.to_string()),
        Cells::Booleans(cells) => cells[row].map_or(String::new(), |value| value.to_string()),
        Cells::Words(cells) => cells[row].map_or(String::new(), |value| value.to_string()),
        Cells::Times(cells) => {
            cells[row].map_or(String::new(), |time| time.shown(scale.unwrap_or(Scale::Seconds), time.decimals()))
        }
    }
}

impl Table {
    /// Opens a Parquet file.
    ///
    /// # Errors
    /// If it is damaged, or the settings of `said` do not go together.
    pub fn open_parquet(file: impl ChunkReader + 'static, said: &Dialect) -> Result<Self, Error> {
        let length = file.len();
        let builder = guarded(|| ParquetRecordBatchReaderBuilder::try_new(file))?;
        check(builder.metadata(), length)?;
        let schema = builder.schema().clone();
        let mut reader = guarded(|| builder.with_batch_size(ROWS).build())?;
        let ahead = next_of(&mut reader)?;
        let own_names: Vec<String> = schema.fields().iter().map(|field| field.name().clone()).collect();
        let distinct = names::distinct(&own_names);
        let mut profiles = Profile::of_columns(own_names.len());
        let dialect = Dialect {
            format: Some("Parquet".to_owned()),
            decimal: Some('.'),
            ..said.clone().checked()?
        };
        let mut columns = Vec::with_capacity(own_names.len());
        for (i, field) in schema.fields().iter().enumerate() {
            let unit = field.metadata().get("unit").cloned().unwrap_or_default();
            let (name, own_name) = (distinct[i].clone(), own_names[i].clone());
            let decoded = ahead
                .as_ref()
                .and_then(|batch| arrow::decode(field, batch.column(i)).ok());
            if let Some(decoded) = &decoded {
                add_all(&mut profiles[i], decoded, &dialect, (&name, &own_name), 0);
            }
            columns.push(Column {
                name,
                own_name,
                unit,
                kind: Kind::Number,
            });
        }
        let rows = ArrowRows {
            reader,
            schema,
            ahead,
            decoded: Vec::new(),
            length: 0,
            next: 0,
            label: String::new(),
        };
        Self::of_arrow(rows, dialect, columns, profiles)
    }

    /// The kind of a column, by its type or, of text and 64-bit integers, by its cells.
    pub(crate) fn arrow_kind(rows: &ArrowRows, column: usize, profile: &Profile) -> Kind {
        let field = rows.field(column);
        if field.metadata().contains_key("decimals") {
            return Kind::Time;
        }
        match arrow::kind_of(field.data_type()) {
            Ok(Some(Kind::Integer)) if profile.integers == 0 => Kind::Number,
            Ok(Some(kind)) => kind,
            Ok(None) => profile.kind(),
            Err(()) => Kind::Text,
        }
    }

    /// As [`read`](Self::read), of Arrow arrays.
    pub(crate) fn next_arrow(&mut self, batch: &mut Batch) -> Result<bool, Error> {
        let needed = self.needed();
        let Some(rows) = &mut self.arrow else { return Ok(false) };
        if !rows.advance(&needed)? {
            return Ok(false);
        }
        self.count += 1;
        let Some(rows) = &self.arrow else { return Ok(false) };
        let (row, place) = (
            rows.next - 1,
            Place {
                line: 0,
                row: self.count,
            },
        );
        if let Some((columns, clock)) = &self.time {
            let time = match (columns.as_slice(), columns.first().and_then(|column| rows.decoded[*column].as_ref())) {
                ([_], Some(Decoded::Cells(Cells::Times(times)))) => match times[row] {
                    Some(time) => clock.zoned(time),
                    None => Err(("is no time: the cell is empty", "leave such rows out with --skip-bad")),
                },
                _ => clock.of_parts(
                    &columns
                        .iter()
                        .map(|column| rows.text(*column))
                        .collect::<Vec<_>>()
                        .iter()
                        .map(String::as_str)
                        .collect::<Vec<_>>(),
                ),
            };
            let refused = |(problem, mend): (&'static str, &'static str)| Error::Cell {
                place,
                column: printable(&self.columns[columns[0]].name),
                cell: printable(&rows.text(columns[0])),
                problem,
                mend: mend.to_owned(),
            };
            batch.times.push(time.map_err(refused)?);
        }
        for (i, column) in self.selected.iter().enumerate() {
            let gaps = &self.gaps[*column];
            let Some(decoded) = &rows.decoded[*column] else {
                return Err(arrow::refused(rows.field(*column)));
            };
            let pushed = match (decoded, &mut batch.columns[i]) {
                (Decoded::Cells(Cells::Numbers(from)), Cells::Numbers(into)) => {
                    into.push(from[row].filter(|value| !gaps.has_number(*value)));
                    Ok(())
                }
                (Decoded::Cells(Cells::Integers(from)), Cells::Integers(into)) => {
                    into.push(from[row].filter(|value| !gaps.has_number(*value as f64)));
                    Ok(())
                }
                (Decoded::Cells(Cells::Integers(from)), Cells::Numbers(into)) => match from[row] {
                    Some(whole) if (whole as f64) as i128 != i128::from(whole) => Err((
                        "is a whole number of more than 53 bits",
                        "split the column, or leave it out with --without",
                    )),
                    whole => {
                        into.push(whole.map(|whole| whole as f64).filter(|value| !gaps.has_number(*value)));
                        Ok(())
                    }
                },
                (Decoded::Cells(Cells::Booleans(from)), Cells::Booleans(into)) => {
                    into.push(from[row]);
                    Ok(())
                }
                (Decoded::Cells(Cells::Times(from)), Cells::Times(into)) => {
                    into.push(from[row]);
                    Ok(())
                }
                (_, into) => {
                    let meaning = Meaning {
                        syntax: self.syntax,
                        gaps,
                        strips: self.dialect.strip_units,
                        clock: self.clocks[*column].as_ref(),
                        kind: self.columns[*column].kind,
                        unit: self.profiles[*column].unit.as_deref(),
                    };
                    push_cell(into, rows.text(*column).trim(), &meaning, &mut self.words[*column])
                }
            };
            pushed.map_err(|(problem, mend)| Error::Cell {
                place,
                column: printable(&self.columns[*column].name),
                cell: printable(&rows.text(*column)),
                problem,
                mend: mend.to_owned(),
            })?;
        }
        batch.places.push(place);
        batch.rows += 1;
        let label = self.label.map(|column| rows.text(column));
        if let (Some(rows), Some(label)) = (&mut self.arrow, label) {
            rows.label = label;
        }
        Ok(true)
    }

    /// Columns whose cells are needed.
    fn needed(&self) -> Vec<usize> {
        let time = self.time.iter().flat_map(|(columns, _)| columns.iter().copied());
        let values = self.values.iter().copied();
        self.selected
            .iter()
            .copied()
            .chain(time)
            .chain(self.label)
            .chain(values)
            .collect()
    }

    /// Counts over all rows.
    pub(crate) fn survey_arrow(mut self, watch: &mut dyn FnMut(u64) -> bool) -> Result<Survey, Error> {
        let mut survey = Survey {
            columns: Profile::of_columns(self.columns.len()),
            ..Survey::default()
        };
        self.selected.clear();
        let mut batch = Batch::default();
        loop {
            // Batches are counted by columns, times by rows.
            let ahead = match self.arrow.as_mut() {
                Some(rows) if rows.next == rows.length => match rows.ahead.take() {
                    Some(batch) => Some(batch),
                    None => next_of(&mut rows.reader)?,
                },
                _ => None,
            };
            if let (Some(next), Some(rows)) = (ahead, self.arrow.as_mut()) {
                for (i, profile) in survey.columns.iter_mut().enumerate() {
                    if let Ok(decoded) = arrow::decode(rows.field(i), next.column(i)) {
                        let names = (self.columns[i].name.as_str(), self.columns[i].own_name.as_str());
                        add_all(profile, &decoded, &self.dialect, names, survey.rows);
                    }
                }
                rows.ahead = Some(next);
            }
            if self.read(&mut batch, 1)? == 0 {
                break;
            }
            survey.rows += 1;
            if survey.rows.is_multiple_of(WATCHED) && !watch(survey.rows) {
                break;
            }
            if let Some(time) = batch.times.first() {
                survey.times.add(*time);
            }
        }
        survey.skipped = self.skipped;
        Ok(survey)
    }
}

/// What the Parquet reader gives. Of damaged pages it makes panics, as divisions by a length of zero: they are errors here. The reader is not
/// used after one.
fn guarded<T>(read: impl FnOnce() -> Result<T, ParquetError>) -> Result<T, Error> {
    match std::panic::catch_unwind(std::panic::AssertUnwindSafe(read)) {
        Ok(found) => Ok(found?),
        Err(_) => Err(Error::Parquet(ParquetError::General("a page does not decode".to_owned()))),
    }
}

fn next_of(reader: &mut ParquetRecordBatchReader) -> Result<Option<RecordBatch>, Error> {
    guarded(|| Ok(reader.next().transpose()?))
}

/// Refuses places of pages outside of the file, which a damaged end may state and the reader takes for granted.
fn check(metadata: &ParquetMetaData, length: u64) -> Result<(), Error> {
    let refused = |what: &str| Error::Parquet(ParquetError::General(format!("{what} outside of the file")));
    for group in metadata.row_groups() {
        if group.num_rows() < 0 || group.total_byte_size() < 0 {
            return Err(refused("a group of rows"));
        }
        for column in group.columns() {
            let first = column.dictionary_page_offset().unwrap_or(0);
            let places = [
                first,
                column.data_page_offset(),
                column.compressed_size(),
                column.num_values(),
            ];
            let [first, data, size, _] = places.map(|place| u64::try_from(place).ok());
            let start = match (first, data) {
                (Some(0), Some(data)) => data,
                (Some(first), Some(data)) => first.min(data),
                _ => return Err(refused("a column")),
            };
            let end = size.and_then(|size| start.checked_add(size));
            if column.num_values() < 0 || end.is_none_or(|end| end > length) {
                return Err(refused("a column"));
            }
        }
    }
    Ok(())
}

/// Adds the cells of a batch that begins behind so many rows.
fn add_all(profile: &mut Profile, decoded: &Decoded, dialect: &Dialect, (name, own_name): (&str, &str), before: u64) {
    let gaps = dialect.missing_of(name, own_name);
    match decoded {
        Decoded::Texts(texts) => {
            for (i, text) in texts.iter().enumerate() {
                let place = Place {
                    line: 0,
                    row: before + i as u64 + 1,
                };
                let text = text.as_deref().unwrap_or_default().trim();
                profile.add(text, place, crate::number::Syntax::default(), &gaps, dialect.strip_units);
            }
            profile.settle();
        }
        Decoded::Cells(cells) => {
            for row in 0..cells.len() {
                match cells {
                    Cells::Times(times) => profile.add_time(times[row].map(Time::seconds)),
                    Cells::Booleans(cells) => profile.add_boolean(cells[row]),
                    Cells::Integers(cells) => profile.add_integer(cells[row], &gaps),
                    _ => profile.add_double(cells.number(row).ok().flatten(), &gaps),
                }
            }
        }
    }
}
