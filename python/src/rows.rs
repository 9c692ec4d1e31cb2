//! The rows of a table as observations of a filter, and what the filter knows after each.

use crate::callbacks::{Likelihoods, Observed, rising};
use crate::error::Outcome;
use crate::table::{Given, Table, doubles};
use arrow_array::Int64Array;
use pyo3::prelude::*;
use std::sync::Arc;

/// The rows that are left of a table, and the results of those before.
pub(crate) struct Rows<'a> {
    time: &'a str,
    given: Given,
    seconds: Vec<f64>,
    observed: Observed,
    /// Means and deviations, by coordinate.
    states: Vec<[Vec<f64>; 2]>,
    logs: Vec<f64>,
}

impl<'a> Rows<'a> {
    /// All rows of a table with this column of times, for functions of the user and a filter of so many coordinates.
    pub(crate) fn read(
        table: &Bound<'_, PyAny>,
        time: &'a str,
        functions: &Likelihoods,
        coordinates: usize,
    ) -> Outcome<Self> {
        let given = Given::read(table)?;
        Ok(Self {
            time,
            seconds: rising(&given.times(time)?)?,
            observed: functions.observed(&given, time)?,
            given,
            states: vec![Default::default(); coordinates],
            logs: Vec::new(),
        })
    }

    /// The observation of the next row, and the times of the row before it (0 of the first) and of its own.
    pub(crate) fn next<'py>(&mut self, py: Python<'py>) -> Outcome<Option<(Bound<'py, PyAny>, [f64; 2])>> {
        let row = self.logs.len();
        let Some(now) = self.seconds.get(row) else {
            return Ok(None);
        };
        py.check_signals()?;
        let before = if row > 0 { self.seconds[row - 1] } else { 0.0 };
        Ok(Some((self.observed.row(py, row)?, [before, *now])))
    }

    /// The results of the row: log likelihood, and mean and deviation of each coordinate.
    pub(crate) fn push(&mut self, log_likelihood: f64, moments: impl IntoIterator<Item = (f64, f64)>) {
        self.logs.push(log_likelihood);
        for ([means, deviations], (mean, deviation)) in self.states.iter_mut().zip(moments) {
            means.push(mean);
            deviations.push(deviation);
        }
    }

    /// The table of results. `bits`: those that were sent, by row.
    pub(crate) fn table(self, bits: Option<Vec<i64>>) -> Outcome<Table> {
        let rows: Vec<usize> = (0..self.logs.len()).collect();
        let mut columns = vec![(self.time.to_owned(), self.given.taken(self.time, &rows)?)];
        for (i, [means, deviations]) in self.states.into_iter().enumerate() {
            columns.push((format!("x{i}"), doubles(means)));
            columns.push((format!("x{i}_sd"), doubles(deviations)));
        }
        columns.push(("log_likelihood".to_owned(), doubles(self.logs)));
        columns.extend(bits.map(|bits| ("bits".to_owned(), Arc::new(Int64Array::from(bits)) as _)));
        Table::new(columns)
    }
}
