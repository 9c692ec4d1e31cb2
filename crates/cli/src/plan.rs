//! `fewbits plan`: bits that a table would need.

use crate::arguments::PlanOptions;
use crate::error::Error;
use crate::input::Table;
use crate::numbers::widened;
use crate::plot::{Layer, Picture};
use crate::{Ending, output};
use fewbits_record::{Bound, Column, Recorder, Schema, TimeBase};
use serde::Serialize;

/// Error bounds that are tried, in percent of the range.
const PERCENTS: [f64; 7] = [0.01, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0];
/// Largest number of rows that are examined.
const MAX_ROWS: usize = 1 << 17;
/// The range, decimals and steps of a column, and bits per sample at some bounds.
#[derive(Serialize)]
struct ColumnPlan {
    name: String,
    samples: usize,
    gaps: usize,
    min: Option<f64>,
    max: Option<f64>,
    /// Steps with which the samples may have been quantised.
    steps: Vec<f64>,
    lossless_bits: f64,
    /// Percent of the range, the bound, bits per sample.
    bounds: Vec<(f64, f64, f64)>,
}

#[derive(Serialize)]
struct Plan {
    rows: usize,
    /// Whether the table has more rows than were examined.
    cut: bool,
    time: Option<TimePlan>,
    columns: Vec<ColumnPlan>,
}

/// Bits that times need, exact and with some tolerances.
#[derive(Serialize)]
struct TimePlan {
    exact_bits: f64,
    /// Tolerance in nanoseconds, bits per row.
    tolerances: Vec<(u64, f64)>,
}

/// Bits per row of a recording of one column.
fn bits_per_row(
    column: Column,
    time: TimeBase,
    rows_per_block: usize,
    ticks: &[i64],
    cells: &[Option<f64>],
) -> Result<f64, fewbits_record::Error> {
    let schema = Schema::new(vec![column], time)?.with_rows_per_block(rows_per_block)?;
    let mut recorder = Recorder::new(Vec::new(), schema);
    for (tick, cell) in ticks.iter().zip(cells) {
        recorder.push(*tick, &[*cell])?;
    }
    Ok(8.0 * recorder.finish()?.len() as f64 / cells.len() as f64)
}

fn plan_column(name: &str, cells: &[Option<f64>], rows_per_block: usize) -> Result<ColumnPlan, fewbits_record::Error> {
    let rows: Vec<i64> = (0..cells.len() as i64).collect();
    let finite: Vec<f64> = cells
        .iter()
        .flatten()
        .copied()
        .filter(|value| value.is_finite())
        .collect();
    let bits = |bound: Bound| {
        let column = Column::new(name, bound)?;
        bits_per_row(column, TimeBase::Numbered, rows_per_block, &rows, cells)
    };
    let ends = finite.iter().copied().fold(None, widened);
    let range = ends.map_or(0.0, |(low, high)| high - low);
    let mut bounds = Vec::new();
    // A bound must be positive, and its double finite.
    if range > 0.0 && (2.0 * range).is_finite() {
        for percent in PERCENTS {
            let delta = 0.01 * percent * range;
            if delta > 0.0 {
                bounds.push((percent, delta, bits(Bound::Absolute(delta))?));
            }
        }
    }
    Ok(ColumnPlan {
        name: name.to_owned(),
        samples: finite.len(),
        gaps: cells.iter().filter(|cell| cell.is_none()).count(),
        min: ends.map(|ends| ends.0),
        max: ends.map(|ends| ends.1),
        steps: fewbits_adaptive::own_steps(&finite),
        lossless_bits: bits(Bound::Lossless)?,
        bounds,
    })
}

fn plan_time(ticks: &[i64], time: TimeBase, rows_per_block: usize) -> Result<Option<TimePlan>, fewbits_record::Error> {
    let TimeBase::Clock { decimals, format, .. } = time else {
        return Ok(None);
    };
    let cells = vec![Some(0.0); ticks.len()];
    let bits = |nanoseconds: u64| {
        let ten = 10_u64.pow(u32::from(9_u8.saturating_sub(decimals)));
        let time = TimeBase::Clock {
            decimals,
            tolerance: nanoseconds / ten,
            format,
        };
        let column = Column::new("", Bound::Lossless)?;
        bits_per_row(column, time, rows_per_block, ticks, &cells)
    };
    let mut tolerances = Vec::new();
    for nanoseconds in [1_000_000, 10_000_000, 100_000_000, 1_000_000_000] {
        tolerances.push((nanoseconds, bits(nanoseconds)?));
    }
    Ok(Some(TimePlan {
        exact_bits: bits(0)?,
        tolerances,
    }))
}

/// Runs the task.
pub(crate) fn run(options: &PlanOptions) -> Result<Ending, Error> {
    let survey = if options.table.file == "-" {
        None
    } else {
        Some(Table::survey(&options.table)?)
    };
    let mut table = Table::open(&options.table)?;
    let time = table.time_base(&options.table, survey.as_ref())?;
    let (ticks, columns) = table.rows(time, MAX_ROWS)?;
    let cut = ticks.len() == MAX_ROWS && table.next(time)?.is_some();
    let failed = Error::recording(table.file());
    let rows_per_block = options.rows_per_block;
    let planned = table
        .names
        .iter()
        .zip(&columns)
        .map(|(name, cells)| plan_column(name, cells, rows_per_block));
    let plan = Plan {
        rows: ticks.len(),
        cut,
        time: plan_time(&ticks, time, rows_per_block).map_err(&failed)?,
        columns: planned.collect::<Result<_, _>>().map_err(&failed)?,
    };
    if let Some(path) = &options.plot {
        picture(table.file(), &plan).save(path)?;
    }
    if options.json {
        output::json(&plan)?;
    } else {
        print(&plan);
    }
    Ok(Ending::Good)
}

/// Bits per sample against the bound, one line per column.
fn picture(file: &str, plan: &Plan) -> Picture {
    let line = |(colour, column): (usize, &ColumnPlan)| Layer::Line {
        points: column.bounds.iter().map(|bound| (bound.0, bound.2)).collect(),
        colour,
        name: format!("{} (lossless {:.1})", column.name, column.lossless_bits),
    };
    Picture {
        title: format!("{file}: {} rows", plan.rows),
        x: "bound in percent of the range".to_owned(),
        y: "bits per sample".to_owned(),
        is_log: true,
        is_map: false,
        layers: plan.columns.iter().enumerate().map(line).collect(),
    }
}

fn print(plan: &Plan) {
    let cut = if plan.cut {
        " (the first; the table has more)"
    } else {
        ""
    };
    println!("{} rows{cut}; bits per sample, each column alone, headers and checksums included", plan.rows);
    let percents: String = PERCENTS
        .iter()
        .map(|percent| format!("{:>8}", format!("{percent}%")))
        .collect();
    println!("{:<24} {:>8}{percents}  range, steps", "column", "lossless");
    for column in &plan.columns {
        let bits: String = PERCENTS
            .iter()
            .map(|percent| match column.bounds.iter().find(|bound| bound.0 == *percent) {
                Some(bound) => format!("{:>8.2}", bound.2),
                None => format!("{:>8}", "-"),
            })
            .collect();
        let range = match (column.min, column.max) {
            (Some(min), Some(max)) => format!("{min} to {max}"),
            _ => "no values".to_owned(),
        };
        let steps: Vec<String> = column.steps.iter().map(f64::to_string).collect();
        let steps = if steps.is_empty() {
            String::new()
        } else {
            format!(", steps {}", steps.join(" "))
        };
        let gaps = if column.gaps > 0 {
            format!(", {} gaps", column.gaps)
        } else {
            String::new()
        };
        println!("{:<24} {:>8.2}{bits}  {range}{steps}{gaps}", column.name, column.lossless_bits);
    }
    if let Some(time) = &plan.time {
        let tolerances: Vec<String> = time
            .tolerances
            .iter()
            .map(|(nanoseconds, bits)| format!("±{} ms {bits:.2}", nanoseconds / 1_000_000))
            .collect();
        println!("time: bits per row exact {:.2}, {}", time.exact_bits, tolerances.join(", "));
    }
}
