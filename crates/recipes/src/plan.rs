//! Bits that a table would need at several bounds.

use crate::error::Error;
use crate::source::{Batch, Watch, report};
use fewbits_record::{Bound, Column, Recorder, Schema, TimeBase};
use serde::Serialize;

/// Error bounds that are tried, in percent of the range.
pub const PERCENTS: [f64; 7] = [0.01, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0];
/// Tolerances of times that are tried, in nanoseconds.
const TOLERANCES: [u64; 4] = [1_000_000, 10_000_000, 100_000_000, 1_000_000_000];

/// The range, decimals and steps of a column, and bits per sample at some bounds.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ColumnPlan {
    /// Name of the column.
    pub name: String,
    /// Number of finite values.
    pub samples: usize,
    /// Number of gaps.
    pub gaps: usize,
    /// Smallest finite value.
    pub min: Option<f64>,
    /// Largest finite value.
    pub max: Option<f64>,
    /// Steps with which the samples may have been quantised.
    pub steps: Vec<f64>,
    /// Bits per sample without error.
    pub lossless_bits: f64,
    /// Percent of the range, the bound, bits per sample.
    pub bounds: Vec<(f64, f64, f64)>,
}

/// Bits that times need, exact and with some tolerances.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TimePlan {
    /// Bits per row of exact times.
    pub exact_bits: f64,
    /// Tolerance in nanoseconds, bits per row.
    pub tolerances: Vec<(u64, f64)>,
}

/// Bits that times and each column need.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Plan {
    /// Number of rows that were examined.
    pub rows: usize,
    /// Whether the table has more rows; set by the caller.
    pub cut: bool,
    /// Times; `None` if rows are numbered.
    pub time: Option<TimePlan>,
    /// Each column alone, in its own recording.
    pub columns: Vec<ColumnPlan>,
}

/// Packs each column of `batch` alone at several bounds.
///
/// # Errors
/// If the batch has other columns than names, a recorder refuses them, or `watch` breaks; it is called after each column.
pub fn plan(
    names: &[String],
    batch: &Batch,
    time: TimeBase,
    rows_per_block: usize,
    watch: &mut Watch<'_>,
) -> Result<Plan, Error> {
    batch.check(names.len())?;
    let mut columns = Vec::with_capacity(names.len());
    for (name, cells) in names.iter().zip(&batch.columns) {
        columns.push(plan_column(name, cells, rows_per_block)?);
        report(watch, columns.len() as u64)?;
    }
    Ok(Plan {
        rows: batch.rows(),
        cut: false,
        time: match &batch.ticks {
            Some(ticks) => plan_time(ticks, time, rows_per_block)?,
            None => None,
        },
        columns,
    })
}

/// Bits per row of a recording of one column.
fn bits_per_row(
    column: Column,
    time: TimeBase,
    rows_per_block: usize,
    ticks: Option<&[i64]>,
    cells: &[Option<f64>],
) -> Result<f64, fewbits_record::Error> {
    let schema = Schema::new(vec![column], time)?.with_rows_per_block(rows_per_block)?;
    let mut recorder = Recorder::new(Vec::new(), schema);
    for (row, cell) in cells.iter().enumerate() {
        match ticks {
            Some(ticks) => recorder.push(ticks[row], &[*cell])?,
            None => recorder.push_next(&[*cell])?,
        }
    }
    Ok(8.0 * recorder.finish()?.len() as f64 / cells.len().max(1) as f64)
}

fn plan_column(name: &str, cells: &[Option<f64>], rows_per_block: usize) -> Result<ColumnPlan, Error> {
    let finite: Vec<f64> = cells
        .iter()
        .flatten()
        .copied()
        .filter(|value| value.is_finite())
        .collect();
    let bits = |bound: Bound| {
        let column = Column::new(name, bound)?;
        bits_per_row(column, TimeBase::Numbered, rows_per_block, None, cells)
    };
    let min = finite.iter().copied().reduce(f64::min);
    let max = finite.iter().copied().reduce(f64::max);
    let range = min.zip(max).map_or(0.0, |(min, max)| max - min);
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
        min,
        max,
        steps: fewbits_adaptive::own_steps(&finite),
        lossless_bits: bits(Bound::Lossless)?,
        bounds,
    })
}

fn plan_time(ticks: &[i64], time: TimeBase, rows_per_block: usize) -> Result<Option<TimePlan>, Error> {
    let TimeBase::Clock { decimals, .. } = time else {
        return Ok(None);
    };
    let cells = vec![Some(0.0); ticks.len()];
    let bits = |nanoseconds: u64| {
        let ten = 10_u64.pow(u32::from(9_u8.saturating_sub(decimals)));
        let mut coarse = time;
        if let TimeBase::Clock { tolerance, .. } = &mut coarse {
            *tolerance = nanoseconds / ten;
        }
        let column = Column::new("", Bound::Lossless)?;
        bits_per_row(column, coarse, rows_per_block, Some(ticks), &cells)
    };
    let mut tolerances = Vec::new();
    for nanoseconds in TOLERANCES {
        tolerances.push((nanoseconds, bits(nanoseconds)?));
    }
    Ok(Some(TimePlan {
        exact_bits: bits(0)?,
        tolerances,
    }))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::ops::ControlFlow;

    #[test]
    fn empty_and_constant_columns_have_plans() {
        let names = ["a".to_owned(), "b".to_owned()];
        let batch = Batch {
            ticks: Some((0..100).map(|i| 1000 * i).collect()),
            columns: vec![vec![None; 100], vec![Some(7.0); 100]],
        };
        let mut steps = Vec::new();
        let mut watch = |progress: crate::Progress| {
            steps.push(progress.done);
            ControlFlow::Continue(())
        };
        let time = TimeBase::Clock {
            decimals: 3,
            tolerance: 0,
            format: fewbits_record::TimeFormat::Seconds,
        };
        let found = plan(&names, &batch, time, 512, &mut watch).unwrap();
        assert_eq!((found.columns[0].gaps, found.columns[0].min), (100, None));
        assert!(found.columns[1].bounds.is_empty() && found.time.is_some());
        assert_eq!(steps, [1, 2]);
    }

    #[test]
    fn callback_stops_a_plan() {
        let batch = Batch {
            ticks: None,
            columns: vec![vec![Some(1.0)]; 2],
        };
        let names = ["a".to_owned(), "b".to_owned()];
        let stopped = plan(&names, &batch, TimeBase::Numbered, 512, &mut |_| ControlFlow::Break(()));
        assert!(matches!(stopped, Err(Error::Stopped)));
    }
}
