//! Files: each is written under a temporary name and then renamed, so that none is ever half-written.

use super::describe::between;
use super::record::{Record, check_sum};
use super::{gallery, summary};
use crate::Error;
use fewbits_experiments::{Outcome, Table};
use fewbits_plot::{Axis, Layer, Panel, Plot, Scale, Shape};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The output directory.
pub(super) struct Directory {
    path: PathBuf,
}

impl Directory {
    /// Makes the directory if it is missing.
    pub(super) fn create(path: &Path) -> Result<Self, Error> {
        std::fs::create_dir_all(path).map_err(Error::writing(path))?;
        let directory = Self { path: path.to_owned() };
        // Find out now, not after an hour of trials, whether files can be written.
        directory.write(".probe", b"")?;
        std::fs::remove_file(path.join(".probe")).map_err(Error::writing(path))?;
        Ok(directory)
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a whole file or none.
    pub(super) fn write(&self, name: &str, content: &[u8]) -> Result<(), Error> {
        let path = self.path.join(name);
        let unfinished = self.path.join(format!(".{name}.{}", std::process::id()));
        std::fs::write(&unfinished, content)
            .and_then(|()| std::fs::rename(&unfinished, &path))
            .map_err(|source| {
                // The write has failed already; a left-over is the lesser harm.
                let _ = std::fs::remove_file(&unfinished);
                Error::writing(&path)(source)
            })
    }

    /// Removes what an earlier run left of a figure.
    fn clear(&self, id: &str) {
        let Ok(earlier) = Record::read_one(&self.path, id) else {
            return;
        };
        for name in earlier.files.iter().chain([&format!("{id}.json")]) {
            // A file that is gone already is as good.
            let _ = std::fs::remove_file(self.path.join(name));
        }
    }
}

/// A figure as it was made: its record, and its files with their text.
#[derive(Serialize, Deserialize)]
pub(super) struct Made {
    pub(super) record: Record,
    files: Vec<(String, String)>,
}

impl Made {
    /// Without result.
    pub(super) fn failed(record: Record, reason: &impl ToString) -> Self {
        Self {
            record: record.failed(reason.to_string()),
            files: Vec::new(),
        }
    }

    /// With the tables and, if wanted, the plot of an outcome.
    pub(super) fn of(record: Record, outcome: &Outcome, plots: bool) -> Self {
        let mut made = Self {
            record: record.clone().with(outcome),
            files: Vec::new(),
        };
        match made.add(outcome, plots) {
            Ok(()) => made,
            Err(error) => Self::failed(record, &error),
        }
    }

    fn add(&mut self, outcome: &Outcome, plots: bool) -> Result<(), Error> {
        let id = self.record.id.clone();
        for table in &outcome.tables {
            let name = table.file(&id);
            let csv = to_csv(table)
                .map_err(std::io::Error::other)
                .map_err(Error::writing(Path::new(&name)))?;
            self.record.columns.insert(name.clone(), json!(table.columns));
            self.files.push((name, csv));
        }
        if plots {
            if let Some(title) = blank(&outcome.plot) {
                return Err(Error(format!("the plot shows nothing in its panel `{title}`")));
            }
            let svg = fewbits_plot::to_svg(&outcome.plot.clone().typeset())?;
            self.files.push((format!("{id}.svg"), svg));
        }
        let named = |(name, text): &(String, String)| (name.clone(), check_sum(text.as_bytes()));
        (self.record.files, self.record.sums) = self.files.iter().map(named).unzip();
        Ok(())
    }

    /// Writes the files, the record last: there is no CSV without its JSON. The record as it was written.
    pub(super) fn write(self, out: &Directory) -> Record {
        out.clear(&self.record.id);
        let document = json!(self.record);
        let last = (format!("{}.json", self.record.id), format!("{document:#}\n"));
        let written = self
            .files
            .iter()
            .chain([&last])
            .try_for_each(|(name, text)| out.write(name, text.as_bytes()));
        match written {
            Ok(()) => self.record,
            Err(error) => {
                for (name, _) in &self.files {
                    let _ = std::fs::remove_file(out.path().join(name));
                }
                self.record.failed(error.to_string())
            }
        }
    }
}

/// The title of a panel in which nothing would be seen, if there is one or no panel at all.
fn blank(plot: &Plot) -> Option<String> {
    let shows = |axis: &Axis, value: f64| value.is_finite() && (axis.scale == Scale::Linear || value > 0.0);
    let is_seen = |panel: &Panel, layer: &Layer| match &layer.shape {
        Shape::Line { points, .. } | Shape::Points { points, .. } => {
            points.iter().any(|(x, y)| shows(&panel.x, *x) && shows(&panel.y, *y))
        }
        Shape::Heat { values, .. } => values.iter().flatten().any(|value| value.is_finite()),
        _ => !layer.is_empty(),
    };
    let is_blank = |panel: &&Panel| !panel.layers.iter().any(|layer| is_seen(panel, layer));
    match plot.panels.iter().find(is_blank) {
        Some(panel) => Some(panel.title.clone()),
        None => plot.panels.is_empty().then(String::new),
    }
}

fn to_csv(table: &Table) -> Result<String, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(table.columns.iter().map(|column| &column.name))?;
    for row in &table.rows {
        writer.write_record(row.iter().map(ToString::to_string))?;
    }
    let bytes = writer.into_inner().map_err(|error| error.into_error())?;
    String::from_utf8(bytes).map_err(|error| std::io::Error::other(error).into())
}

/// Writes `index.html` and `summary.txt`: `records` are those of this run, `all` those of the directory; `note` is what a reader must
/// know first.
pub(super) fn write_summary(
    out: &Directory,
    records: &[Record],
    all: &BTreeMap<String, Record>,
    elapsed: Duration,
    note: &str,
) -> Result<(), Error> {
    let this_run: BTreeSet<String> = records.iter().map(|r| r.id.clone()).collect();
    out.write("index.html", gallery::page(all.values(), &this_run, note).as_bytes())?;
    let text = summary::text(records, out.path(), elapsed);
    out.write("summary.txt", format!("{}{text}", between("", note, "\n")).as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panel_in_which_nothing_is_seen_is_named() {
        let panel =
            |title: &str, y: f64| Panel::semilog(title, "x", "y").with(Layer::line("", vec![(0.0, y), (1.0, y)]));
        assert_eq!(blank(&Plot::grid(2, vec![panel("a", 1.0), panel("b", 2.0)])), None);
        for lost in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(blank(&Plot::grid(2, vec![panel("a", 1.0), panel("b", lost)])).as_deref(), Some("b"));
        }
        assert_eq!(blank(&Plot::of(Panel::linear("none", "x", "y"))).as_deref(), Some("none"));
        assert_eq!(blank(&Plot::grid(1, Vec::new())).as_deref(), Some(""));
    }
}
