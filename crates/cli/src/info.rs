//! `fewbits info`: describes a recording.

use crate::arguments::InfoOptions;
use crate::error::Error;
use crate::numbers::{exact, widened};
use crate::{Ending, bounds, clock, output, recording, say};
use fewbits_record::{Column, TimeBase};
use serde::Serialize;
use std::fmt::Write;

#[derive(Serialize)]
struct Info {
    file: String,
    bytes: u64,
    rows: u64,
    blocks: u64,
    rows_per_block: usize,
    bits_per_sample: f64,
    index: bool,
    finished: bool,
    damaged: u64,
    time: String,
    from: Option<String>,
    to: Option<String>,
    columns: Vec<ColumnInfo>,
}

#[derive(Serialize)]
struct ColumnInfo {
    name: String,
    unit: String,
    bound: String,
    min: Option<End>,
    max: Option<End>,
    gaps: u64,
}

/// Smallest or largest value of a column.
#[derive(Clone, Copy, PartialEq, PartialOrd, Serialize)]
#[serde(untagged)]
enum End {
    Number(f64),
    Whole(i64),
}

impl End {
    fn of(column: &Column, value: f64) -> Self {
        match column.integers() {
            Some(integers) => Self::Whole(integers.number(value)),
            None => Self::Number(value),
        }
    }

    fn text(self) -> String {
        match self {
            Self::Number(value) => exact(value),
            Self::Whole(number) => number.to_string(),
        }
    }
}

/// Runs the task. It decodes everything once, so that what it reports was verified.
pub(crate) fn run(options: &InfoOptions) -> Result<Ending, Error> {
    let file = options.file.display().to_string();
    let mut playback = recording::open(&options.file)?;
    let schema = playback.schema().clone();
    let time = schema.time();
    let mut columns: Vec<ColumnInfo> = schema
        .columns()
        .iter()
        .map(|column| ColumnInfo {
            name: column.name().to_owned(),
            unit: column.unit().to_owned(),
            bound: bounds::of_column(column),
            min: None,
            max: None,
            gaps: 0,
        })
        .collect();
    let (mut rows, mut blocks, mut damaged) = (0, 0, 0);
    let mut span = None;
    for block in playback.blocks() {
        let block = match block {
            Ok(block) => block,
            // The blocks after damaged bytes can be read.
            Err(fewbits_record::Error::Block { .. }) => {
                damaged += 1;
                continue;
            }
            Err(error) => return Err(Error::recording(&file)(error)),
        };
        rows += block.rows() as u64;
        blocks += 1;
        span = block.ticks.iter().copied().fold(span, widened);
        for ((info, cells), column) in columns.iter_mut().zip(&block.columns).zip(schema.columns()) {
            info.gaps += cells.iter().filter(|cell| cell.is_none()).count() as u64;
            let is_value = |value: &&f64| value.is_finite() || column.integers().is_some();
            for value in cells.iter().flatten().filter(is_value) {
                let value = End::of(column, *value);
                info.min = Some(info.min.filter(|min| *min <= value).unwrap_or(value));
                info.max = Some(info.max.filter(|max| *max >= value).unwrap_or(value));
            }
        }
    }
    let samples = (rows * columns.len() as u64).max(1);
    let info = Info {
        bytes: playback.bytes(),
        bits_per_sample: 8.0 * playback.bytes() as f64 / samples as f64,
        rows,
        blocks,
        rows_per_block: schema.rows_per_block(),
        index: playback.has_index(),
        finished: playback.is_finished(),
        damaged,
        time: match time {
            TimeBase::Clock { tolerance: 0, .. } => "exact".to_owned(),
            TimeBase::Clock {
                tolerance, decimals, ..
            } => {
                let seconds = tolerance as f64 / 10_f64.powi(i32::from(decimals));
                format!("±{seconds} s")
            }
            _ => "numbered".to_owned(),
        },
        from: span.map(|span| clock::shown(span.0, time)),
        to: span.map(|span| clock::shown(span.1, time)),
        columns,
        file,
    };
    if options.json {
        output::json(&info)?;
    } else {
        output::print(&text(&info))?;
    }
    // Whether rows are missing at the end cannot be told from a recording without its end.
    Ok(if damaged == 0 && info.finished {
        Ending::Good
    } else {
        Ending::Failed
    })
}

fn text(info: &Info) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{}: {} rows, {} columns, {} bytes, {:.3} bits per sample",
        info.file,
        info.rows,
        info.columns.len(),
        info.bytes,
        info.bits_per_sample
    );
    let index = match (info.finished, info.index) {
        (false, _) => "without its end (not finished, or cut off)",
        (true, true) => "with index",
        (true, false) => "without index",
    };
    let _ = writeln!(text, "{} blocks of up to {} rows, {index}", info.blocks, info.rows_per_block);
    if info.damaged > 0 {
        let _ = writeln!(text, "{} damaged parts", info.damaged);
    }
    if let (Some(from), Some(to)) = (&info.from, &info.to) {
        let _ = writeln!(text, "time {}: {from} to {to}", info.time);
    }
    for column in &info.columns {
        let unit = if column.unit.is_empty() {
            String::new()
        } else {
            format!(" {}", say::name(&column.unit))
        };
        let ends = match (column.min, column.max) {
            (Some(min), Some(max)) => format!("{} to {}{unit}", min.text(), max.text()),
            _ => "no values".to_owned(),
        };
        let _ = writeln!(text, "  {}: {}, {ends}, {} gaps", say::name(&column.name), column.bound, column.gaps);
    }
    text
}
