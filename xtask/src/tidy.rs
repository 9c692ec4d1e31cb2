//! `cargo xtask tidy`: the house rules, as a test.
//!
//! 1. Every crate opens with documentation, inherits the lints, and has a row in the table of `docs/architecture.md`.
//! 2. A crate imports only from floors below its own, as that table says.
//! 3. Every figure id in the docs exists, and every figure is in the docs.
//! 4. Every file of integration tests is a module of the crate's one test binary.
//! 5. Every relative link of a page leads to a file, and every page of `docs` is linked from `docs/index.md`.
//! 6. No source file has more than 400 lines, and no files of a crate import each other in a circle (`tidy/files.rs`).
//! 7. Errata and the figures and tests that show them cite each other (`tidy/errata.rs`).

pub(crate) mod errata;
mod files;

use crate::Error;
use crate::files::{list, read, rust_files};
use cargo_metadata::{DependencyKind, MetadataCommand, Package};
use fewbits_experiments::ids;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Checks the workspace and prints what is wrong; `Ok(false)` if anything is.
///
/// # Errors
/// If a file cannot be read.
pub fn run() -> Result<bool, Error> {
    let problems = check(&Path::new(env!("CARGO_MANIFEST_DIR")).join(".."))?;
    for problem in &problems {
        println!("{problem}");
    }
    println!("{} problems", problems.len());
    Ok(problems.is_empty())
}

/// Everything in the workspace at `root` that breaks a house rule.
///
/// # Errors
/// If a file cannot be read.
pub fn check(root: &Path) -> Result<Vec<String>, Error> {
    let floors = floors(&read(&root.join("docs/architecture.md"))?);
    let mut problems = Vec::new();
    for package in crates(root)? {
        let name = short(&package.name);
        let imports = package
            .dependencies
            .iter()
            .filter(|d| d.kind == DependencyKind::Normal)
            .map(|d| d.name.as_str());
        problems.extend(manifest_problems(name, package.description.is_some(), imports, &floors));
        let path = package.manifest_path.parent().map_or(root, |path| path.as_std_path());
        if !read(&path.join("Cargo.toml"))?.contains("[lints]\nworkspace = true") {
            problems.push(format!("crates/{name}: does not inherit the lints"));
        }
        for file in rust_files(&path.join("src"))? {
            let text = read(&file)?;
            let shown = file.strip_prefix(root).unwrap_or(&file).display().to_string();
            if !text.starts_with("//!") {
                problems.push(format!("{shown}: does not open with documentation (`//!`)"));
            }
        }
        let tests = path.join("tests/it");
        if tests.is_dir() {
            let listed = read(&tests.join("main.rs"))?;
            let files = rust_files(&tests)?;
            let stems = files.iter().filter_map(|file| file.file_stem()?.to_str());
            problems
                .extend(unlisted(&listed, stems).map(|stem| format!("crates/{name}: tests/it/{stem}.rs never runs")));
        }
    }
    problems.extend(files::problems(root, &source_folders(root)?)?);
    problems.extend(figure_problems(root)?);
    problems.extend(link_problems(root)?);
    problems.extend(errata::problems(root)?);
    Ok(problems)
}

/// Files beside a test binary's root that are none of its modules.
fn unlisted<'a>(root: &str, stems: impl Iterator<Item = &'a str>) -> impl Iterator<Item = &'a str> {
    stems.filter(move |stem| *stem != "main" && !root.contains(&format!("mod {stem};")))
}

/// The library crates of the workspace.
fn crates(root: &Path) -> Result<Vec<Package>, Error> {
    let metadata = MetadataCommand::new()
        .manifest_path(root.join("Cargo.toml"))
        .no_deps()
        .exec()?;
    let ours = |package: &Package| {
        package
            .manifest_path
            .components()
            .rev()
            .nth(2)
            .is_some_and(|c| c.as_str() == "crates")
    };
    let mut crates: Vec<Package> = metadata.packages.into_iter().filter(ours).collect();
    crates.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(crates)
}

/// The folders of all packages with sources: the crates and this one.
fn source_folders(root: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut folders = list(&root.join("crates"))?;
    folders.retain(|folder| folder.join("src").is_dir());
    folders.push(root.join("xtask"));
    Ok(folders)
}

/// A package's name without the project's.
fn short(name: &str) -> &str {
    name.strip_prefix("fewbits-").unwrap_or(name)
}

/// Floors by crate, from the rows `| floor | `name` ... |` of the architecture table.
fn floors(architecture: &str) -> BTreeMap<String, u32> {
    let mut floors = BTreeMap::new();
    for line in architecture.lines() {
        let mut cells = line.split('|').map(str::trim).skip(1);
        let (Some(floor), Some(names)) = (cells.next(), cells.next()) else {
            continue;
        };
        let Ok(floor) = floor.parse() else { continue };
        for name in names.split('`').skip(1).step_by(2) {
            floors.insert(name.to_owned(), floor);
        }
    }
    floors
}

/// What is wrong with a crate's manifest; `dependencies` are the packages it imports.
fn manifest_problems<'a>(
    name: &str,
    described: bool,
    dependencies: impl Iterator<Item = &'a str>,
    floors: &BTreeMap<String, u32>,
) -> Vec<String> {
    let mut problems = Vec::new();
    if !described {
        problems.push(format!("crates/{name}: has no description"));
    }
    let Some(own) = floors.get(name) else {
        problems.push(format!("crates/{name}: is not in the table of docs/architecture.md"));
        return problems;
    };
    for other in dependencies.filter(|other| other.starts_with("fewbits-")).map(short) {
        match floors.get(other) {
            Some(floor) if floor < own => {}
            Some(floor) => {
                problems.push(format!("crates/{name} (floor {own}) imports {other} (floor {floor}): only downwards"));
            }
            None => problems.push(format!("crates/{name} imports {other}, which is not in docs/architecture.md")),
        }
    }
    problems
}

/// Figure ids that the docs name and the registry lacks, or the other way round.
fn figure_problems(root: &Path) -> Result<Vec<String>, Error> {
    let registered: BTreeSet<String> = ids().into_iter().map(str::to_owned).collect();
    let systems: BTreeSet<&str> = registered.iter().filter_map(|id| id.split('-').next()).collect();
    let mut documented = BTreeSet::new();
    for path in list(&root.join("docs"))?.into_iter().chain([root.join("README.md")]) {
        if path.extension().is_some_and(|extension| extension == "md") {
            let text = read(&path)?;
            let quoted = text.split('`').skip(1).step_by(2).map(str::to_owned);
            let is_crate = |word: &str| root.join("crates").join(word).is_dir();
            documented.extend(quoted.filter(|word| is_figure_id(word, &systems) && !is_crate(word)));
        }
    }
    let unknown = documented
        .difference(&registered)
        .map(|id| format!("docs: figure `{id}` does not exist"));
    let missing = registered
        .difference(&documented)
        .map(|id| format!("docs: figure `{id}` is not mentioned"));
    Ok(unknown.chain(missing).collect())
}

/// Links of pages that lead nowhere, and pages that the index does not have.
fn link_problems(root: &Path) -> Result<Vec<String>, Error> {
    let docs = root.join("docs");
    let mut problems = Vec::new();
    let index = read(&docs.join("index.md"))?;
    for path in list(&docs)?.into_iter().chain(list(root)?) {
        if path.extension().is_none_or(|extension| extension != "md") {
            continue;
        }
        let (folder, name) = (path.parent().unwrap_or(root), path.file_name().unwrap_or_default());
        let shown = path.strip_prefix(root).unwrap_or(&path).display().to_string();
        for link in links(&read(&path)?) {
            if !folder.join(&link).exists() {
                problems.push(format!("{shown}: the link to {link} leads nowhere"));
            }
        }
        let name = name.to_string_lossy();
        if folder == docs && name != "index.md" && !index.contains(&format!("({name})")) {
            problems.push(format!("{shown}: docs/index.md does not link to it"));
        }
    }
    Ok(problems)
}

/// The files that relative links of a page name, without anchors.
fn links(page: &str) -> Vec<String> {
    let targets = page.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
    targets
        .map(|(target, _)| target.split('#').next().unwrap_or_default())
        .filter(|target| !target.is_empty() && !target.contains("://") && !target.contains(char::is_whitespace))
        .map(str::to_owned)
        .collect()
}

/// `<system>-<word>`, where the word names a figure, a table or an experiment of ours; a bare number names an erratum.
fn is_figure_id(word: &str, systems: &BTreeSet<&str>) -> bool {
    word.split_once('-').is_some_and(|(system, rest)| {
        systems.contains(system)
            && !rest.chars().all(|c| c.is_ascii_digit())
            && rest
                .chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c.is_ascii_uppercase())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tests_that_never_run_are_found() {
        let found: Vec<&str> = unlisted("mod laws;\n", ["main", "laws", "fixtures"].into_iter()).collect();
        assert_eq!(found, ["fixtures"]);
    }

    #[test]
    fn the_workspace_is_tidy() {
        let problems = check(&Path::new(env!("CARGO_MANIFEST_DIR")).join("..")).unwrap();
        assert!(problems.is_empty(), "\n{}", problems.join("\n"));
    }

    #[test]
    fn relative_links_are_found_without_anchors() {
        let page =
            "[a](one.md) ![b](images/two.svg) [c](three.md#part) [d](https://example.org/x) [e](#here) `f[0](x, y)`";
        assert_eq!(links(page), ["one.md", "images/two.svg", "three.md"]);
    }

    #[test]
    fn floors_come_from_the_table() {
        let floors = floors("| floor | crate |\n|---|---|\n| 1 | `models` · `topology` | x |\n| 0 | `core` | y |\n");
        assert_eq!(
            floors.into_iter().collect::<Vec<_>>(),
            [("core".into(), 0), ("models".into(), 1), ("topology".into(), 1)]
        );
    }

    #[test]
    fn imports_go_only_downwards() {
        let floors = [
            ("core".to_owned(), 0),
            ("models".to_owned(), 1),
            ("filters".to_owned(), 2),
        ]
        .into();
        let problems = |import| manifest_problems("models", true, [import].into_iter(), &floors).len();
        assert_eq!([problems("fewbits-core"), problems("serde")], [0, 0]);
        assert_eq!([problems("fewbits-filters"), problems("fewbits-elsewhere")], [1, 1]);
    }
}
