//! A recording as CSV, as `fewbits unpack` writes it.

use crate::text;
use fewbits_record::{Playback, TimeBase, TimeFormat};
use fewbits_table::{Scale, Time, names};
use std::io::Cursor;

/// The words that a unit lists; `None` if it is the unit of numbers.
pub(crate) fn words_of(unit: &str) -> Option<Vec<String>> {
    let list = unit.strip_prefix("words: ")?;
    let pieces = names::pieces(list, ',');
    Some(pieces.iter().map(|word| names::unquoted(word)).collect())
}

/// A tick as text.
pub(crate) fn tick(tick: i64, time: TimeBase) -> String {
    let TimeBase::Clock { decimals, format, .. } = time else {
        return tick.to_string();
    };
    let scale = match format {
        TimeFormat::Utc => Scale::Utc,
        TimeFormat::Local => Scale::Local,
        _ => Scale::Seconds,
    };
    let found = Time::from_ticks(tick, decimals);
    let decimals = if found.decimals() == 0 { 0 } else { decimals };
    found.shown(scale, decimals)
}

/// The shortest text that reads back as the same number; empty for a gap.
fn number(value: Option<f64>) -> String {
    match value {
        None => String::new(),
        Some(value) if value.is_nan() => "NaN".to_owned(),
        Some(value) if value != 0.0 && (value.abs() < 1e-5 || value.abs() >= 1e16) => format!("{value:e}"),
        Some(value) => format!("{value}"),
    }
}

/// All rows of a recording as CSV.
pub(crate) fn csv(recording: &[u8]) -> Result<Vec<u8>, String> {
    let mut playback = Playback::new(Cursor::new(recording)).map_err(text)?;
    let schema = playback.schema().clone();
    let words: Vec<_> = schema.columns().iter().map(|column| words_of(column.unit())).collect();
    let mut rows = csv::Writer::from_writer(Vec::new());
    let time = (schema.time() != TimeBase::Numbered).then(|| "time".to_owned());
    let names = schema.columns().iter().map(|column| column.name().to_owned());
    rows.write_record(time.into_iter().chain(names)).map_err(text)?;
    for block in playback.blocks() {
        let block = block.map_err(text)?;
        for (row, at) in block.ticks.iter().enumerate() {
            let time = (schema.time() != TimeBase::Numbered).then(|| tick(*at, schema.time()));
            let cells = block
                .columns
                .iter()
                .zip(&words)
                .map(|(cells, words)| match (cells[row], words) {
                    (Some(index), Some(words)) if index.fract() == 0.0 && index >= 0.0 => words
                        .get(index as usize)
                        .cloned()
                        .unwrap_or_else(|| number(Some(index))),
                    (value, _) => number(value),
                });
            rows.write_record(time.into_iter().chain(cells)).map_err(text)?;
        }
    }
    rows.into_inner().map_err(|error| error.to_string())
}
