//! Errata and what shows them cite each other.

use crate::Error;
use crate::errata::{add_tests, cited, rows};
use crate::files::{list, read, rust_files};
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

/// Citations of what is no erratum, and errata that nothing shows. Whether the last column names what does is known after a run only:
/// `cargo xtask figures errata --check`.
pub(super) fn problems(root: &Path) -> Result<Vec<String>, Error> {
    let page = read(&root.join("docs/errata.md"))?;
    let known: BTreeSet<&str> = rows(&page).map(|row| row.id).collect();
    let mut problems = Vec::new();
    let sources = rust_files(&root.join("crates"))?.into_iter();
    for file in sources.chain(list(&root.join("docs"))?).filter(|file| file.is_file()) {
        // A string may go on in the next line.
        let text = read(&file)?.replace("\\\n", " ");
        let unknown = cited(&text).filter(|id| !known.contains(id));
        let shown = file.strip_prefix(root).unwrap_or(&file).display();
        problems.extend(unknown.map(|id| format!("{shown}: cites {id}, which docs/errata.md does not have")));
    }
    let alone = rows(&page).filter(|row| row.shown_by.is_empty());
    problems.extend(alone.map(|row| format!("docs/errata.md, {}: no figure and no test shows it", row.id)));
    Ok(problems)
}
