//! Files: each is written under a temporary name and then renamed, so that none is ever half-written.

use super::{Error, Options, draw};
use fewbits_experiments::{About, Outcome, Table};
use serde_json::json;
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
}

/// Writes all files of one figure.
pub(super) fn figure(
    out: &Directory,
    about: About,
    outcome: &Outcome,
    elapsed: Duration,
    options: &Options,
) -> Result<(), Error> {
    let id = about.id;
    let tables = std::iter::once((format!("{id}.csv"), &outcome.tables.main))
        .chain(
            outcome
                .tables
                .further
                .iter()
                .map(|(name, table)| (format!("{id}-{name}.csv"), table)),
        )
        .collect::<Vec<_>>();
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for (name, table) in &tables {
        let csv = to_csv(table).map_err(|error| Error::Write {
            path: out.path().join(name),
            source: std::io::Error::other(error),
        })?;
        files.push((name.clone(), csv));
    }
    if !options.no_plots {
        files.push((format!("{id}.svg"), draw::to_svg(id, &outcome.plot)?.into_bytes()));
    }
    let columns: serde_json::Map<_, _> = tables
        .iter()
        .map(|(name, table)| (name.clone(), json!(table.columns())))
        .collect();
    let document = json!({
        "id": id,
        "title": about.title,
        "caption": about.caption,
        "source": about.source,
        "parameters": outcome.parameters,
        "seed": options.seed,
        "trials": outcome.parameters.get("trials"),
        "quick": options.quick,
        "version": env!("CARGO_PKG_VERSION"),
        "wall_time_s": elapsed.as_secs_f64(),
        "files": files.iter().map(|(name, _)| name).collect::<Vec<_>>(),
        "columns": columns,
        "claims": outcome.claims,
    });
    files.push((format!("{id}.json"), format!("{document:#}\n").into_bytes()));
    files.iter().try_for_each(|(name, content)| out.write(name, content))
}

fn to_csv(table: &Table) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(table.columns().iter().map(|column| column.name.as_ref()))?;
    for row in table.rows() {
        writer.write_record(row.iter().map(ToString::to_string))?;
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}
