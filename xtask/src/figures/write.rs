//! Files: each is written under a temporary name and then renamed, so that none is ever half-written.

use super::record::Record;
use super::{Ending, Error, draw, gallery, print, summary};
use fewbits_experiments::{Outcome, Table};
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
        let refused = |source| Error::Write {
            path: path.to_owned(),
            source,
        };
        std::fs::create_dir_all(path).map_err(refused)?;
        let directory = Self { path: path.to_owned() };
        // Find out now, not after an hour of trials, whether files can be written.
        directory.write(".probe", b"")?;
        std::fs::remove_file(path.join(".probe")).map_err(refused)?;
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
                Error::Write { path, source }
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

/// Writes the files of one figure, its record last: there is no CSV without its JSON. The record as it was written.
pub(super) fn figure(
    out: &Directory,
    mut record: Record,
    outcome: Option<&Outcome>,
    plots: bool,
) -> Result<Record, Error> {
    out.clear(&record.id);
    let done = outcome
        .map_or(Ok(()), |outcome| tables_and_plot(out, &mut record, outcome, plots))
        .and_then(|()| {
            let document = json!(record);
            out.write(&format!("{}.json", record.id), format!("{document:#}\n").as_bytes())
        });
    if done.is_err() {
        for name in &record.files {
            let _ = std::fs::remove_file(out.path().join(name));
        }
    }
    done.map(|()| record)
}

fn tables_and_plot(out: &Directory, record: &mut Record, outcome: &Outcome, plots: bool) -> Result<(), Error> {
    let id = record.id.clone();
    let main = (format!("{id}.csv"), &outcome.tables.main);
    let further = outcome
        .tables
        .further
        .iter()
        .map(|(name, table)| (format!("{id}-{name}.csv"), table));
    for (name, table) in std::iter::once(main).chain(further) {
        let csv = to_csv(table).map_err(|error| Error::Write {
            path: out.path().join(&name),
            source: std::io::Error::other(error),
        })?;
        record.columns.insert(name.clone(), json!(table.columns()));
        record.files.push(name.clone());
        out.write(&name, &csv)?;
    }
    if plots {
        let name = format!("{id}.svg");
        record.files.push(name.clone());
        out.write(&name, draw::to_svg(&id, &outcome.plot)?.as_bytes())?;
    }
    Ok(())
}

fn to_csv(table: &Table) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(table.columns().iter().map(|column| column.name.as_ref()))?;
    for row in table.rows() {
        writer.write_record(row.iter().map(ToString::to_string))?;
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}

/// What a run leaves besides its figures: the gallery, and the summary as text and on standard output.
pub(super) struct Summary<'a> {
    pub(super) out: &'a Directory,
    /// Whether standard output gets JSON.
    pub(super) json: bool,
    /// What a reader must know first; empty for nothing.
    pub(super) note: &'a str,
}

impl Summary<'_> {
    /// Writes `index.html` and `summary.txt`: `records` are those of this run, `all` those of the directory.
    pub(super) fn write(
        &self,
        records: &[Record],
        all: &BTreeMap<String, Record>,
        elapsed: Duration,
    ) -> Result<(), Error> {
        let this_run: BTreeSet<String> = records.iter().map(|r| r.id.clone()).collect();
        let page = gallery::page(all.values(), &this_run, self.note);
        self.out.write("index.html", page.as_bytes())?;
        let text = summary::text(records, self.out.path(), elapsed);
        let note = if self.note.is_empty() {
            String::new()
        } else {
            format!("{}\n", self.note)
        };
        self.out.write("summary.txt", format!("{note}{text}").as_bytes())
    }

    /// Prints the summary.
    pub(super) fn print(&self, records: &[Record], elapsed: Duration) -> Ending {
        let page = if self.json { summary::json } else { summary::text };
        print(&page(records, self.out.path(), elapsed));
        if !self.note.is_empty() {
            eprintln!("{}", self.note);
        }
        if records.iter().all(Record::good) {
            Ending::Good
        } else {
            Ending::Failed
        }
    }
}
