//! `fewbits verify`: checks a recording against its table and error bounds.

use crate::arguments::VerifyOptions;
use crate::error::Error;
use crate::input::Table;
use crate::{Ending, bounds, clock, numbers, output};
use fewbits_record::Playback;
use serde::Serialize;

/// Largest number of failures of a column that are shown.
const SHOWN: usize = 3;

#[derive(Serialize)]
struct Verdict {
    rows: u64,
    ticks_failed: u64,
    missing_rows: u64,
    holds: bool,
    columns: Vec<ColumnVerdict>,
}

#[derive(Serialize)]
struct ColumnVerdict {
    name: String,
    bound: String,
    largest_error: f64,
    failed: u64,
    first_failures: Vec<String>,
}

/// Runs the task.
pub(crate) fn run(options: &VerifyOptions) -> Result<Ending, Error> {
    let file = options.packed.display().to_string();
    let mut playback = Playback::open(&options.packed).map_err(Error::recording(&file))?;
    let schema = playback.schema().clone();
    let (time, tolerance) = (schema.time(), schema.time().tolerance());
    let mut table_options = options.table.clone();
    let has_time = time != fewbits_record::TimeBase::Numbered;
    if has_time && table_options.time.is_none() {
        table_options.time = Some("exact".to_owned());
    }
    if table_options.columns.is_empty() {
        table_options.columns = schema.columns().iter().map(|column| column.name().to_owned()).collect();
    }
    let mut table = Table::open(&table_options)?;
    let mut verdict = Verdict {
        rows: 0,
        ticks_failed: 0,
        missing_rows: 0,
        holds: true,
        columns: schema
            .columns()
            .iter()
            .map(|column| ColumnVerdict {
                name: column.name().to_owned(),
                bound: bounds::shown(column.bound(), column.period()),
                largest_error: 0.0,
                failed: 0,
                first_failures: Vec::new(),
            })
            .collect(),
    };
    for block in playback.blocks() {
        let block = block.map_err(Error::recording(&file))?;
        for (row, tick) in block.ticks.iter().enumerate() {
            let Some((original, cells)) = table.next(time)? else {
                let problem = format!("has more rows than {}, which has {}", table.file(), verdict.rows);
                return Err(Error::content(&file, problem));
            };
            verdict.rows += 1;
            if original.is_some_and(|original| original.abs_diff(*tick) > tolerance) {
                verdict.ticks_failed += 1;
            }
            for (i, (column, sample)) in schema.columns().iter().zip(&cells).enumerate() {
                let (restored, result) = (block.columns[i][row], &mut verdict.columns[i]);
                if let (Some(a), Some(b)) = (sample, restored)
                    && a.is_finite()
                    && b.is_finite()
                {
                    // On a circle the error is the distance along the shorter arc.
                    let turns = column
                        .period()
                        .map_or(0.0, |period| period * ((a - b) / period).round());
                    result.largest_error = result.largest_error.max((a - b - turns).abs());
                }
                if !column.keeps(*sample, restored, block.share_bounds[i]) {
                    result.failed += 1;
                    if result.first_failures.len() < SHOWN {
                        let (row, at) = (verdict.rows, clock::shown(*tick, time));
                        let told = |cell: Option<f64>| cell.map_or("a gap".to_owned(), |value| value.to_string());
                        let (sample, restored) = (told(*sample), told(restored));
                        let failure = format!("row {row} (tick {at}): {sample} was restored as {restored}");
                        result.first_failures.push(failure);
                    }
                }
            }
        }
    }
    while table.next(time)?.is_some() {
        verdict.missing_rows += 1;
    }
    verdict.holds = verdict.ticks_failed == 0
        && verdict.missing_rows == 0
        && verdict.columns.iter().all(|column| column.failed == 0);
    if options.json {
        output::json(&verdict)?;
    } else {
        print(&verdict);
    }
    Ok(if verdict.holds { Ending::Good } else { Ending::Failed })
}

fn print(verdict: &Verdict) {
    for column in &verdict.columns {
        let state = if column.failed == 0 {
            "holds".to_owned()
        } else {
            format!("FAILS in {} rows", column.failed)
        };
        let largest = numbers::short(column.largest_error);
        println!("{}: {} {state}, largest error {largest}", column.name, column.bound);
        for failure in &column.first_failures {
            println!("  {failure}");
        }
    }
    if verdict.ticks_failed > 0 {
        println!("time: FAILS in {} rows", verdict.ticks_failed);
    }
    if verdict.missing_rows > 0 {
        println!("{} rows are missing at the end", verdict.missing_rows);
    }
    println!(
        "{} rows: {}",
        verdict.rows,
        if verdict.holds {
            "all promises hold"
        } else {
            "promises FAIL"
        }
    );
}
