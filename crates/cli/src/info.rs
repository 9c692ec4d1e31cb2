//! `fewbits info`: describes a recording.

use crate::arguments::InfoOptions;
use crate::error::Error;
use crate::numbers::{exact, short, widened};
use crate::{Ending, bounds, clock, output, recording, say};
use fewbits_record::{Bound, Column, TimeBase};
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
    /// The largest error that the bound allows, and the mean error of values that are spread evenly; `null` if they depend on each value.
    largest_error: Option<f64>,
    mean_error: Option<f64>,
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
            largest_error: None,
            mean_error: None,
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
    for (info, column) in columns.iter_mut().zip(schema.columns()) {
        (info.largest_error, info.mean_error) = errors(column, info.min.zip(info.max)).unzip();
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

/// The largest error of a column within its bound, and the mean one if values are spread evenly between the numbers that the recording has for
/// them: half of the largest. Bounds of an earlier recording are added to both, since their errors are not known. `ends`: the column's
/// smallest and largest number, as restored.
fn errors(column: &Column, ends: Option<(End, End)>) -> Option<(f64, f64)> {
    let largest = match (column.bound(), ends) {
        (Bound::Lossless, _) => 0.0,
        (Bound::Absolute(bound), _) => bound,
        // The range that was restored is smaller than that of the table by twice the bound at most.
        (Bound::ShareOfRange(share), Some((End::Number(low), End::Number(high)))) if share < 0.5 => {
            share * (high - low) / (1.0 - 2.0 * share)
        }
        _ => return None,
    };
    let earlier = column.earlier_bound();
    Some((largest + earlier, 0.5 * largest + earlier))
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
        let errors = match (column.largest_error, column.mean_error) {
            (Some(largest), Some(mean)) if largest > 0.0 => {
                format!(" (largest error {}, mean about {})", short(largest), short(mean))
            }
            _ => String::new(),
        };
        let name = say::name(&column.name);
        let _ = writeln!(text, "  {name}: {}{errors}, {ends}, {} gaps", column.bound, column.gaps);
    }
    text
}
