//! `fewbits plan`: bits that a table would need.

use crate::arguments::PlanOptions;
use crate::error::Error;
use crate::files::is_regular;
use crate::input::Table;
use crate::plot::{Layer, Picture};
use crate::rows::TableRows;
use crate::{Ending, output, say};
use fewbits_recipes::plan::{ColumnPlan, PERCENTS, Plan, plan as recipe};
use std::fmt::Write;
use std::ops::ControlFlow;

/// Largest number of rows that are examined.
const MAX_ROWS: usize = 1 << 17;

/// Runs the task.
pub(crate) fn run(options: &PlanOptions) -> Result<Ending, Error> {
    let mut table = Table::open(&options.table)?;
    let survey = match is_regular(&options.table.file) {
        true => Some(table.survey(&options.table)?),
        false => None,
    };
    let time = table.time_base(&options.table, survey.as_ref())?;
    let (file, names) = (table.file().to_owned(), table.names.clone());
    let integers = table.code_integers()?;
    let mut rows = TableRows::new(table, time);
    let Some(batch) = rows.take(MAX_ROWS)? else {
        return Err(Error::empty(&file, "rows"));
    };
    let mut go = |_| ControlFlow::Continue(());
    let mut plan = recipe(&names, &batch, time, options.rows_per_block, &mut go).map_err(Error::recipe(&file))?;
    let ends = batch.columns.iter().zip(&integers);
    for (column, (cells, integers)) in plan.columns.iter_mut().zip(ends) {
        // Codes stand for whole numbers, which are kept exactly under any bound.
        if let Some(integers) = integers {
            let numbers = || cells.iter().flatten().map(|code| integers.number(*code) as f64);
            (column.min, column.max) = (numbers().reduce(f64::min), numbers().reduce(f64::max));
            column.steps.clear();
            column
                .bounds
                .iter_mut()
                .for_each(|bound| bound.2 = column.lossless_bits);
        }
    }
    plan.cut = batch.rows() == MAX_ROWS && rows.take(1)?.is_some();
    if let Some(path) = &options.plot {
        picture(&file, &plan).save(path)?;
    }
    if options.json {
        output::json(&plan)?;
    } else {
        output::print(&text(&plan))?;
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

fn text(plan: &Plan) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let cut = if plan.cut {
        " (the first; the table has more)"
    } else {
        ""
    };
    let _ =
        writeln!(text, "{} rows{cut}; bits per sample, each column alone, headers and checksums included", plan.rows);
    let percents: String = PERCENTS
        .iter()
        .map(|percent| format!("{:>8}", format!("{percent}%")))
        .collect();
    let _ = writeln!(text, "{:<24} {:>8}{percents}  range, steps", "column", "lossless");
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
        let _ =
            writeln!(text, "{:<24} {:>8.2}{bits}  {range}{steps}{gaps}", say::name(&column.name), column.lossless_bits);
    }
    if let Some(time) = &plan.time {
        let tolerances: Vec<String> = time
            .tolerances
            .iter()
            .map(|(nanoseconds, bits)| format!("±{} ms {bits:.2}", nanoseconds / 1_000_000))
            .collect();
        let _ = writeln!(text, "time: bits per row exact {:.2}, {}", time.exact_bits, tolerances.join(", "));
    }
    text
}
