//! Errata and what shows them cite each other.

use super::rust_files;
use crate::Error;
use crate::errata::{NOTATION, add_tests, cited, rows};
use crate::files::{list, read};
use fewbits_experiments::all;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The tests that show errata, by erratum.
pub(crate) fn tests(root: &Path) -> Result<BTreeMap<String, BTreeSet<String>>, Error> {
    let mut tests = BTreeMap::new();
    for folder in ["crates", "tests"] {
        for file in rust_files(&root.join(folder))? {
            add_tests(&read(&file)?, &mut tests);
        }
    }
    Ok(tests)
}

/// Citations of what is no erratum, errata that nothing shows, and rows that name other figures or tests than those that cite them.
/// Which figure of a system has the claim is known after a run only: `cargo xtask figures errata --check`.
pub(super) fn problems(root: &Path) -> Result<Vec<String>, Error> {
    let page = read(&root.join("docs/errata.md"))?;
    let known: BTreeSet<&str> = rows(&page).map(|row| row.id).collect();
    let tests = tests(root)?;
    let registered: BTreeSet<&str> = all().iter().map(|figure| figure.about().id).collect();
    let mut problems = Vec::new();
    // Systems whose claims cite an erratum.
    let mut citing: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for file in rust_files(&root.join("crates"))?
        .into_iter()
        .chain(list(&root.join("docs"))?)
    {
        if file.is_dir() {
            continue;
        }
        let shown = file.strip_prefix(root).unwrap_or(&file).display().to_string();
        // A string may go on in the next line.
        let text = read(&file)?.replace("\\\n", " ");
        problems.extend(
            cited(&text)
                .filter(|id| !known.contains(id))
                .map(|id| format!("{shown}: cites {id}, which docs/errata.md does not have")),
        );
        if let Some((system, _)) = shown
            .strip_prefix("crates/experiments/src/")
            .and_then(|rest| rest.split_once('/'))
        {
            let claims = text.lines().filter(|line| !line.trim_start().starts_with("//"));
            for id in claims.flat_map(cited).chain(showing(&text)) {
                citing.entry(id.to_owned()).or_default().insert(system.to_owned());
            }
        }
    }
    let none = BTreeSet::new();
    for row in rows(&page) {
        let mut wrong = |what: String| problems.push(format!("docs/errata.md, {}: {what}", row.id));
        let (figures, named) = row.figures_and_tests();
        for figure in figures.difference(&registered) {
            wrong(format!("`{figure}` is no figure"));
        }
        let systems: BTreeSet<&str> = figures.iter().filter_map(|id| id.split('-').next()).collect();
        let cite: BTreeSet<&str> = citing.get(row.id).unwrap_or(&none).iter().map(String::as_str).collect();
        if systems != cite {
            wrong(format!(
                "figures of {systems:?} show it, but claims of {cite:?} cite it; `cargo xtask figures errata`"
            ));
        }
        let have: BTreeSet<&str> = tests.get(row.id).unwrap_or(&none).iter().map(String::as_str).collect();
        if named != have {
            wrong(format!("names the tests {named:?}, but {have:?} cite it; `cargo xtask figures errata`"));
        }
        if figures.is_empty() && named.is_empty() && row.shown_by != NOTATION {
            wrong("no figure and no test shows it".to_owned());
        }
    }
    Ok(problems)
}

/// Errata in `claims.showing("mpa-1")`.
fn showing(text: &str) -> impl Iterator<Item = &str> {
    text.split(".showing(\"")
        .skip(1)
        .filter_map(|rest| rest.split('"').next())
}
