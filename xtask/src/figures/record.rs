//! What is on disk about a figure: the content of its JSON, which gallery, summary, `--failed` and `merge` read back.

use super::Options;
use crate::{Error, files};
use fewbits_experiments::{About, Claim, Expected, Outcome, Verdict, plain};
use fewbits_plot::{Plot, Shape};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json};
use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hasher};
use std::path::Path;
use std::process::Command;
use std::sync::LazyLock;
use std::time::{Duration, SystemTime};

/// One figure as it was made, or why it was not.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Record {
    pub(super) id: String,
    pub(super) title: String,
    pub(super) caption: String,
    pub(super) source: String,
    pub(super) parameters: Map<String, Json>,
    pub(super) seed: u64,
    pub(super) trials: Option<u64>,
    #[serde(default)]
    pub(super) quick: bool,
    pub(super) version: String,
    #[serde(default)]
    pub(super) commit: String,
    /// Of all that the result depends on; none if it may change without that.
    #[serde(default)]
    pub(super) fingerprint: Option<String>,
    #[serde(default)]
    pub(super) finished: String,
    pub(super) wall_time_s: f64,
    pub(super) files: Vec<String>,
    /// Check sums of the files, in their order.
    #[serde(default)]
    pub(super) sums: Vec<String>,
    #[serde(default)]
    pub(super) rows: usize,
    pub(super) columns: Map<String, Json>,
    pub(super) claims: Vec<Claim>,
    #[serde(default)]
    pub(super) error: Option<String>,
}

/// What was measured of a claim, for a reader.
pub(super) fn measured(claim: &Claim) -> String {
    claim.value.map_or_else(|| "nothing".to_owned(), short)
}

/// What was expected of it, for a reader.
pub(super) fn expectation(claim: &Claim) -> String {
    let tolerance = claim.tolerance.map_or_else(String::new, |t| format!(" ± {}", short(t)));
    match &claim.expected {
        Expected::Number(number) => short(*number) + &tolerance,
        Expected::Condition(condition) => condition.clone(),
    }
}

/// The commit that runs, with `+` if files differ from it; empty where there is no repository.
static COMMIT: LazyLock<String> = LazyLock::new(|| {
    let git = |arguments: &[&str]| {
        let run = Command::new("git")
            .args(arguments)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .ok()?;
        run.status
            .success()
            .then(|| String::from_utf8_lossy(&run.stdout).trim().to_owned())
    };
    let changed = git(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|s| !s.is_empty());
    git(&["rev-parse", "--short", "HEAD"]).map_or_else(String::new, |hash| hash + if changed { "+" } else { "" })
});

/// Whether a plot shows error bars.
fn has_error_bars(plot: &Plot) -> bool {
    let layers = plot.panels.iter().flat_map(|panel| &panel.layers);
    layers.into_iter().any(|layer| match &layer.shape {
        Shape::Points { errors, .. } => errors.iter().any(|error| *error > 0.0),
        _ => false,
    })
}

impl Record {
    /// A figure's record without result.
    pub(super) fn new(
        about: About,
        parameters: &Map<String, Json>,
        elapsed: Duration,
        options: &Options,
        fingerprint: Option<String>,
    ) -> Self {
        Self {
            id: about.id.to_owned(),
            title: about.title.to_owned(),
            caption: about.caption.to_owned(),
            source: about.source.to_owned(),
            parameters: parameters.clone(),
            seed: options.seed,
            trials: parameters.get("trials").and_then(Json::as_u64),
            quick: options.quick,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: COMMIT.clone(),
            fingerprint,
            finished: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
            wall_time_s: elapsed.as_secs_f64(),
            ..Self::default()
        }
    }

    /// With the claims of an outcome; its files are added as they are written.
    pub(super) fn with(mut self, outcome: &Outcome) -> Self {
        self.rows = outcome.tables.first().map_or(0, |table| table.rows.len());
        self.claims = outcome.claims.clone();
        if has_error_bars(&outcome.plot) && !self.caption.contains("standard error") {
            self.caption.push_str(" Error bars: one standard error.");
        }
        self
    }

    /// With the reason why there is no result.
    pub(super) fn failed(mut self, error: String) -> Self {
        self.error = Some(error);
        self
    }

    /// The command that makes it again.
    pub(super) fn command(&self) -> String {
        let defaults = self.defaults();
        let mut command = format!("cargo xtask figures {}", self.id);
        let changed = |(name, value): &(&String, &Json)| defaults.get(*name) != Some(value);
        for (name, value) in self.parameters.iter().filter(changed) {
            command.push_str(&format!(" --set {name}={}", plain(value).replace(", ", ",")));
        }
        if self.seed != 1 {
            command.push_str(&format!(" --seed {}", self.seed));
        }
        if self.quick {
            command.push_str(" --quick");
        }
        command
    }

    pub(super) fn system(&self) -> &str {
        self.id.split('-').next().unwrap_or_default()
    }

    pub(super) fn count(&self, verdict: Verdict) -> usize {
        self.claims.iter().filter(|c| c.verdict == verdict).count()
    }

    /// Made, some claim decided where all could be, and none fails.
    pub(super) fn good(&self) -> bool {
        self.error.is_none() && self.count(Verdict::Fail) == 0 && !self.is_undecided()
    }

    /// Whether it shows nothing: at the figure's own parameters and full counts, no claim was decided.
    pub(super) fn is_undecided(&self) -> bool {
        let decided = self.count(Verdict::Pass) + self.count(Verdict::Fail) > 0;
        self.error.is_none() && !decided && !self.quick && self.parameters == self.defaults()
    }

    /// The figure's own parameters; none if there is no figure of this id.
    fn defaults(&self) -> Map<String, Json> {
        let figures = fewbits_experiments::all();
        let own = figures.iter().find(|figure| figure.about().id == self.id);
        own.and_then(|figure| figure.configure(&[], self.quick).ok())
            .map(|run| run.parameters)
            .unwrap_or_default()
    }

    /// The record of one figure.
    ///
    /// # Errors
    /// If it cannot be read, is another figure's, or names files that are not this figure's own in this folder.
    pub(super) fn read_one(folder: &Path, id: &str) -> std::io::Result<Self> {
        let text = std::fs::read_to_string(folder.join(format!("{id}.json")))?;
        let record: Self = serde_json::from_str(&text)?;
        let own = |name: &String| {
            let one = Path::new(name).components().count() == 1 && !name.contains(['/', '\\']);
            let rest = name.strip_prefix(id);
            one && rest.is_some_and(|rest| {
                rest.starts_with(['.', '-']) && [".csv", ".svg"].iter().any(|end| rest.ends_with(end))
            })
        };
        if record.id != id || !record.files.iter().all(own) {
            return Err(std::io::Error::other(format!("{id}.json is no record of figure {id}")));
        }
        Ok(record)
    }

    /// The first of its files that is absent from the folder or not as it was written.
    pub(super) fn damaged(&self, folder: &Path) -> Option<&String> {
        let whole = |(name, sum): (&String, &String)| {
            std::fs::read(folder.join(name)).is_ok_and(|content| check_sum(&content) == *sum)
        };
        let unsealed = self.files.get(self.sums.len()..).and_then(<[String]>::first);
        self.files
            .iter()
            .zip(&self.sums)
            .find(|file| !whole(*file))
            .map(|(name, _)| name)
            .or(unsealed)
    }

    /// The records in a directory, by id. What cannot be read as one is left out.
    pub(super) fn read_all(folder: &Path) -> Result<BTreeMap<String, Self>, Error> {
        let mut records = BTreeMap::new();
        for path in files::list(folder)? {
            if path.extension().is_some_and(|extension| extension == "json")
                && let Some(id) = path.file_stem().and_then(|stem| stem.to_str())
                && let Ok(record) = Self::read_one(folder, id)
            {
                records.insert(record.id.clone(), record);
            }
        }
        Ok(records)
    }
}

/// A hash of a file's content, which tells whether it is still what was written.
pub(super) fn check_sum(content: &[u8]) -> String {
    let mut hasher = DefaultHasher::new();
    hasher.write(content);
    format!("{:016x}", hasher.finish())
}

/// A number with enough digits to read and no more.
fn short(number: f64) -> String {
    if number == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e6).contains(&number.abs()) {
        return format!("{number:.2e}");
    }
    let decimals = (6 - number.abs().log10().floor() as i32 - 1).clamp(0, 8) as usize;
    let text = format!("{number:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}
