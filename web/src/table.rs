//! A table of the user: what it costs, packed, restored, verified.

use crate::known::{self, Found, Known, Pieces, Rows};
use crate::reading::{self, Said};
use crate::{text, writing};
use fewbits_recipes::bounds::{self, Spec};
use fewbits_recipes::{Batch, plan, verify};
use fewbits_record::{Bound, Column, Playback, Recorder, Schema, TimeBase};
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::ops::ControlFlow;
use wasm_bindgen::prelude::wasm_bindgen;

/// Rows from which bits at several bounds are estimated.
const PLANNED: usize = 1 << 12;

/// How much computing time packing may take.
#[wasm_bindgen]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Effort {
    /// As `fewbits pack --fast`.
    Fast,
    /// The fewest bits.
    Thorough,
}

/// A table, or a recording, in memory.
#[wasm_bindgen]
pub struct Opened {
    rows: Rows,
    /// Bytes of columns packed alone, by column, bound and effort.
    alone: BTreeMap<(usize, String, Effort), usize>,
}

#[derive(Serialize)]
struct Summary<'a> {
    rows: usize,
    columns: &'a [Known],
    #[serde(flatten)]
    found: &'a Found,
}

#[derive(Serialize)]
struct Cost {
    bound: String,
    /// Largest distance of a restored number, in the unit of the column.
    delta: f64,
    bits: f64,
    bytes: usize,
}

#[derive(Serialize)]
struct Verdict {
    holds: bool,
    rows: u64,
    failed: Vec<String>,
}

#[wasm_bindgen]
impl Opened {
    /// Reads a table or a recording. `said`: what the user says of it, as JSON.
    pub fn read(bytes: Vec<u8>, said: &str) -> Result<Opened, String> {
        let said: Said = serde_json::from_str(said).map_err(text)?;
        let rows = reading::read(bytes, &said)?;
        known::check_columns(&rows)?;
        Ok(Self {
            rows,
            alone: BTreeMap::new(),
        })
    }

    /// What was understood, as JSON.
    pub fn summary(&self) -> Result<String, String> {
        let summary = Summary {
            rows: self.rows.batch.rows(),
            columns: &self.rows.columns,
            found: &self.rows.found,
        };
        serde_json::to_string(&summary).map_err(text)
    }

    /// A recording within these bounds, with the bytes of `fewbits pack --bound`. `identity`: random bits, which a recording of several blocks
    /// holds.
    pub fn pack(&mut self, bound: &str, effort: Effort, identity: u32) -> Result<Vec<u8>, String> {
        let schema = Schema::new(self.columns(bound)?, self.rows.time)
            .and_then(|schema| schema.with_time_name(&self.rows.time_name))
            .map_err(text)?;
        let bytes = packed(&self.rows.batch, schema.clone(), effort, identity)?;
        if let ([column], TimeBase::Numbered) = (schema.columns(), self.rows.time) {
            self.alone
                .insert((0, bounds::shown(column.bound(), column.period()), effort), bytes.len());
        }
        Ok(bytes)
    }

    /// What each column costs if it is packed alone, without times, as JSON.
    pub fn cost(&mut self, bound: &str, effort: Effort) -> Result<String, String> {
        let (mut costs, rows) = (Vec::new(), self.rows.batch.rows());
        for (i, column) in self.columns(bound)?.into_iter().enumerate() {
            let known = &self.rows.columns[i];
            let delta = match (column.bound(), known.min, known.max) {
                (Bound::Absolute(delta), ..) => delta,
                (Bound::ShareOfRange(share), Some(min), Some(max)) => share * (max - min),
                (Bound::Decimals(places), ..) => 0.5 / 10_f64.powi(i32::from(places)),
                _ => 0.0,
            };
            let shown = bounds::shown(column.bound(), column.period());
            let key = (i, shown.clone(), effort);
            let bytes = match self.alone.get(&key) {
                Some(bytes) => *bytes,
                None => {
                    let schema = Schema::new(vec![column], TimeBase::Numbered).map_err(text)?;
                    let batch = Batch {
                        ticks: None,
                        columns: vec![self.rows.batch.columns[i].clone()],
                    };
                    let bytes = packed(&batch, schema, effort, 0)?.len();
                    self.alone.insert(key, bytes);
                    bytes
                }
            };
            costs.push(Cost {
                bound: shown,
                delta,
                bits: if rows == 0 {
                    0.0
                } else {
                    8.0 * bytes as f64 / rows as f64
                },
                bytes,
            });
        }
        serde_json::to_string(&costs).map_err(text)
    }

    /// Bits per sample of the first rows of a column at several bounds, as JSON: `[percent of the range, bound, bits]` each, and the bits
    /// of no loss.
    pub fn plan(&self, column: usize) -> Result<String, String> {
        let (Some(cells), Some(known)) = (self.rows.batch.columns.get(column), self.rows.columns.get(column)) else {
            return Err(format!("there is no column {column}"));
        };
        let batch = Batch {
            ticks: None,
            columns: vec![cells[..cells.len().min(PLANNED)].to_vec()],
        };
        let mut go = |_| ControlFlow::Continue(());
        let names = [known.name.clone()];
        let planned =
            plan::plan(&names, &batch, TimeBase::Numbered, fewbits_record::ROWS_PER_BLOCK, &mut go).map_err(text)?;
        serde_json::to_string(&planned.columns).map_err(text)
    }

    /// The samples of a column; NaN for gaps.
    pub fn values(&self, column: usize) -> Vec<f64> {
        let cells = self.rows.batch.columns.get(column);
        cells.map_or_else(Vec::new, |cells| cells.iter().map(|cell| cell.unwrap_or(f64::NAN)).collect())
    }

    /// The samples of a column as a recording restores them; NaN for gaps.
    pub fn restored(&self, recording: &[u8], column: usize) -> Result<Vec<f64>, String> {
        let mut playback = Playback::new(Cursor::new(recording)).map_err(text)?;
        let known = self.rows.columns.get(column);
        let name = known.map(|known| known.name.clone()).unwrap_or_default();
        playback.columns(&[&name]).map_err(text)?;
        let mut values = Vec::with_capacity(self.rows.batch.rows());
        for block in playback.blocks() {
            let block = block.map_err(text)?;
            values.extend(block.columns.iter().flatten().map(|cell| cell.unwrap_or(f64::NAN)));
        }
        Ok(values)
    }

    /// A recording as CSV, as `fewbits unpack` writes it.
    pub fn to_csv(&self, recording: &[u8]) -> Result<Vec<u8>, String> {
        writing::csv(recording)
    }

    /// Compares every cell and every time of a recording with the table, as JSON.
    pub fn verify(&self, recording: &[u8]) -> Result<String, String> {
        let mut playback = Playback::new(Cursor::new(recording)).map_err(text)?;
        let matches: Vec<usize> = (0..self.rows.columns.len()).collect();
        let mut go = |_| ControlFlow::Continue(());
        let found =
            verify::verify(&mut playback, &mut Pieces::new(&self.rows.batch), &matches, &mut go).map_err(text)?;
        let failed = found.columns.iter().filter(|column| column.failed > 0);
        let mut failed: Vec<String> = failed.map(|column| column.name.clone()).collect();
        if found.ticks_failed > 0 {
            failed.push("time".to_owned());
        }
        if found.missing_rows > 0 || found.extra_rows > 0 {
            failed.push("number of rows".to_owned());
        }
        failed.extend(found.damage);
        let verdict = Verdict {
            holds: found.holds,
            rows: found.rows,
            failed,
        };
        serde_json::to_string(&verdict).map_err(text)
    }
}

impl Opened {
    /// The columns with their bounds, in the language of `--bound`.
    fn columns(&self, bound: &str) -> Result<Vec<Column>, String> {
        let known = &self.rows.columns;
        let names: Vec<&str> = known.iter().map(|column| column.name.as_str()).collect();
        let mut specs = bounds::parse(bound, &names).map_err(text)?;
        for (spec, known) in specs.iter_mut().zip(known) {
            // Between two words there is nothing.
            if matches!(known.kind, "words" | "boolean") {
                *spec = Spec::LOSSLESS;
            } else if spec.bound != Bound::Lossless {
                spec.period = spec.period.or(known.period);
            }
        }
        let ends = known.iter().zip(&specs).map(|(known, spec)| {
            let ends = known.min.zip(known.max);
            ends.filter(|_| spec.bound != Bound::Lossless)
        });
        let columns = bounds::columns(&names, &specs, &ends.collect::<Vec<_>>()).map_err(text)?;
        let with_unit = columns
            .into_iter()
            .zip(known)
            .map(|(column, known)| column.with_unit(&known.unit));
        with_unit.collect::<Result<_, _>>().map_err(text)
    }
}

fn packed(batch: &Batch, schema: Schema, effort: Effort, identity: u32) -> Result<Vec<u8>, String> {
    let effort = match effort {
        Effort::Fast => fewbits_record::Effort::Fast,
        Effort::Thorough => fewbits_record::Effort::Thorough,
    };
    let recorder = Recorder::new(Vec::new(), schema);
    let mut recorder = recorder.with_effort(effort).with_identity(identity);
    let numbered: Vec<i64>;
    let ticks = match &batch.ticks {
        Some(ticks) => ticks,
        None => {
            numbered = (0..batch.rows() as i64).collect();
            &numbered
        }
    };
    recorder.push_columns(ticks, &batch.columns).map_err(text)?;
    recorder.finish().map_err(text)
}
