//! Several recordings as one table in the order of time.

use crate::blocks::Rows;
use crate::column::Column;
use crate::error::{Error, ensure};
use crate::integers::Integers;
use crate::playback::{Playback, Row};
use crate::schema::{Schema, TimeBase, TimeFormat};
use fewbits_block_codec::ArgumentError;
use std::collections::BTreeMap;
use std::io::{Read, Seek};

/// Rows of one recording.
struct Source<'a, R> {
    rows: Rows<'a, R>,
    /// How many of the finest ticks one tick is.
    factor: i64,
    /// Codes of whole numbers, of this recording and of the first, by their place in a row.
    codes: Vec<(usize, Integers, Integers)>,
    next: Option<Row>,
}

/// Iterator over the rows of several recordings ([`merged`]).
pub struct Merged<'a, R> {
    /// By the tick of the next row, or as long as that is not read of the last one (if none is, a tick that no row is before), and the place
    /// among all.
    sources: BTreeMap<(i64, usize), Source<'a, R>>,
}

fn names(schema: &Schema) -> Vec<&str> {
    schema.columns.iter().map(Column::name).collect()
}

fn described(time: TimeBase) -> &'static str {
    match time {
        TimeBase::Numbered => "numbers of rows",
        TimeBase::Clock { format, .. } => match format {
            TimeFormat::Seconds => "seconds",
            TimeFormat::Utc => "UTC",
            TimeFormat::Local => "times without a zone",
        },
    }
}

/// Decimals of a second; 0 if rows are numbered.
fn decimals(schema: &Schema) -> u8 {
    match schema.time {
        TimeBase::Clock { decimals, .. } => decimals,
        TimeBase::Numbered => 0,
    }
}

/// Which of the wanted columns have other codes of whole numbers than those of the first recording.
fn codes(schema: &Schema, first: Option<&Schema>, wanted: &[&str]) -> Result<Vec<(usize, Integers, Integers)>, Error> {
    let mut found = Vec::new();
    for (place, name) in wanted.iter().enumerate() {
        let of = |schema: &Schema| schema.position(name).map(|i| schema.columns[i].integers);
        match (of(schema)?, first.map_or(Ok(None), of)?) {
            (Some(own), Some(wanted)) if own != wanted => found.push((place, own, wanted)),
            (own, wanted) if own.is_some() != wanted.is_some() => {
                let expected = "whole numbers of 64 bits in all recordings, or in none";
                return Err(ArgumentError::new("columns", format!("`{name}`"), expected).into());
            }
            _ => {}
        }
    }
    Ok(found)
}

impl<R: Read + Seek> Source<'_, R> {
    /// The next row, with the finest ticks and the codes of the first recording.
    fn read(&mut self) -> Result<Option<Row>, Error> {
        let Some(mut row) = self.rows.next().transpose()? else {
            return Ok(None);
        };
        let expected = "a tick that fits 64 bits with the decimals of the finest recording";
        let finer = row.tick.checked_mul(self.factor);
        row.tick = finer.ok_or_else(|| ArgumentError::new("time", row.tick, expected))?;
        for (place, own, wanted) in &self.codes {
            if let Some(Some(code)) = row.values.get_mut(*place) {
                *code = wanted.code(own.number(*code));
            }
        }
        Ok(Some(row))
    }
}

/// The rows with ticks in `from..=to` of several recordings as one table: at each step the earliest next row, of equal ticks that of the
/// first recording. Ticks are those of the recording whose times have the most decimals. Columns are those of the first recording, by their names. A recording is opened when its first tick is reached, so
/// recordings one after the other take the memory of one block. Damaged bytes give one error per stretch; the iteration continues behind
/// them. Columns that were requested before are forgotten.
///
/// # Errors
/// If the recordings have different columns, or times of different formats, or the only block of one is damaged.
pub fn merged<'a, R: Read + Seek>(
    playbacks: &'a mut [Playback<R>],
    wanted: &[&str],
    (from, to): (i64, i64),
) -> Result<Merged<'a, R>, Error> {
    let first = playbacks.first().map(|playback| playback.schema().clone());
    if let Some(first) = &first {
        let mut sorted = names(first);
        sorted.sort_unstable();
        for (i, playback) in playbacks.iter().enumerate() {
            let mut others = names(playback.schema());
            others.sort_unstable();
            let found = |what: String| format!("{what} in recording {}", i + 1);
            let expected = || format!("those of the first: {}", sorted.join(", "));
            ensure!(others == sorted, "columns", found(others.join(", ")), expected());
            let [own, wanted] = [playback.schema(), first].map(|schema| described(schema.time));
            ensure!(own == wanted, "time", found(own.to_owned()), format!("{wanted}, as in the first"));
        }
    }
    let finest = playbacks
        .iter()
        .map(|playback| decimals(playback.schema()))
        .max()
        .unwrap_or(0);
    let mut sources = BTreeMap::new();
    for (i, playback) in playbacks.iter_mut().enumerate() {
        playback.columns(wanted)?;
        // Without an index the first tick is not known: such a recording is open from the beginning.
        let factor = 10_i64.pow(u32::from(finest - decimals(playback.schema())));
        let begin = playback
            .ticks()?
            .map_or(i64::MIN, |ticks| ticks.0.saturating_mul(factor).max(from));
        let codes = codes(playback.schema(), first.as_ref(), wanted)?;
        let own_from = from.div_euclid(factor) + i64::from(from.rem_euclid(factor) != 0);
        let (rows, next) = (playback.range(own_from, to.div_euclid(factor)), None);
        let source = Source {
            rows,
            factor,
            codes,
            next,
        };
        sources.insert((begin, i), source);
    }
    Ok(Merged { sources })
}

impl<R: Read + Seek> Iterator for Merged<'_, R> {
    type Item = Result<Row, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let ((mut tick, place), mut source) = self.sources.pop_first()?;
            let item = match source.next.take() {
                Some(row) => Some(Ok(row)),
                None => match source.read() {
                    Ok(Some(row)) => {
                        tick = row.tick;
                        source.next = Some(row);
                        None
                    }
                    // The recording is closed.
                    Ok(None) => continue,
                    Err(error) => Some(Err(error)),
                },
            };
            self.sources.insert((tick, place), source);
            if item.is_some() {
                return item;
            }
        }
    }
}
