//! A recording of the user, read into memory.

use crate::known::{Found, FoundTime, Known, Rows};
use crate::text;
use crate::writing::{tick, words_of};
use bytes::Bytes;
use fewbits_recipes::Batch;
use fewbits_record::{Playback, TimeBase, TimeFormat};
use std::io::Cursor;

/// All rows that can be read; damaged parts are named.
pub(crate) fn read(bytes: Bytes) -> Result<Rows, String> {
    let mut playback = Playback::new(Cursor::new(bytes)).map_err(text)?;
    let schema = playback.schema().clone();
    let mut skipped = Vec::new();
    if !playback.is_finished() {
        skipped.push("the end is missing (not finished, or cut off)".to_owned());
    }
    let mut batch = Batch {
        ticks: (schema.time() != TimeBase::Numbered).then(Vec::new),
        columns: vec![Vec::new(); schema.columns().len()],
    };
    for block in playback.blocks() {
        let block = match block {
            Ok(block) => block,
            Err(error @ fewbits_record::Error::Block { .. }) => {
                skipped.push(text(error));
                continue;
            }
            Err(error) => return Err(text(error)),
        };
        if let Some(ticks) = &mut batch.ticks {
            ticks.extend(&block.ticks);
        }
        for (all, cells) in batch.columns.iter_mut().zip(block.columns) {
            all.extend(cells);
        }
    }
    // Their samples are codes, and the page computes with doubles.
    let is_kept: Vec<bool> = schema
        .columns()
        .iter()
        .map(|column| column.integers().is_none())
        .collect();
    let left_out = schema.columns().iter().filter(|column| column.integers().is_some());
    skipped.extend(left_out.map(|column| {
        format!("column `{}`: whole numbers of 64 bits are not shown: use `fewbits unpack`", column.name())
    }));
    let mut keeps = is_kept.iter().copied();
    batch.columns.retain(|_| keeps.next().unwrap_or(true));
    let kept = schema.columns().iter().zip(&is_kept).filter(|(_, is_kept)| **is_kept);
    let columns = kept
        .map(|(column, _)| column)
        .zip(&batch.columns)
        .map(|(column, cells)| {
            let numbers = || cells.iter().flatten().copied();
            let finite = || numbers().filter(|number| number.is_finite());
            let words = words_of(column.unit());
            Known {
                name: column.name().to_owned(),
                unit: column.unit().to_owned(),
                kind: if words.is_some() { "words" } else { "number" },
                words,
                samples: numbers().count(),
                gaps: cells.len() - numbers().count(),
                min: finite().reduce(f64::min),
                max: finite().reduce(f64::max),
                sentinel: None,
                sentinel_cells: 0,
                period: column.period(),
            }
        });
    let time = batch
        .ticks
        .as_ref()
        .and_then(|ticks| Some((ticks.first()?, ticks.last()?)));
    let found = Found {
        format: "recording".to_owned(),
        dialect: format!("bounds: {}", fewbits_recipes::bounds::summary(schema.columns())),
        time: time.map(|(from, to)| FoundTime {
            columns: vec!["time".to_owned()],
            scale: match schema.time() {
                TimeBase::Clock {
                    format: TimeFormat::Utc,
                    ..
                } => "UTC",
                TimeBase::Clock {
                    format: TimeFormat::Local,
                    ..
                } => "local time of an unknown zone",
                _ => "seconds",
            },
            from: tick(*from, schema.time()),
            to: tick(*to, schema.time()),
        }),
        skipped,
        ..Found::default()
    };
    Ok(Rows {
        columns: columns.collect(),
        time: schema.time(),
        time_name: schema.time_name().to_owned(),
        found,
        batch,
    })
}
