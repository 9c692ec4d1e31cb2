//! `cargo xtask tidy`: the house rules, as a test.
//!
//! 1. Every crate opens with documentation, inherits the lints, and has a row in the table of `docs/architecture.md`.
//! 2. A crate imports only from floors below its own, as that table says.
//! 3. No `unwrap`, `expect`, `panic!` and their like in library sources outside tests.
//! 4. Every figure id in the docs exists, and every figure is in the docs.

use fewbits_experiments::all;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why the rules could not be checked.
#[derive(Debug, Error)]
#[error("cannot read {path}: {source}")]
pub struct Error {
    path: PathBuf,
    source: std::io::Error,
}

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
    for (name, path) in crates(root)? {
        let manifest = read(&path.join("Cargo.toml"))?;
        problems.extend(manifest_problems(&name, &manifest, &floors));
        for file in rust_files(&path.join("src"))? {
            let text = read(&file)?;
            let shown = file.strip_prefix(root).unwrap_or(&file).display().to_string();
            if !text.starts_with("//!") {
                problems.push(format!("{shown}: does not open with documentation (`//!`)"));
            }
            problems.extend(panics(&shown, &text));
        }
    }
    problems.extend(figure_problems(root)?);
    Ok(problems)
}

fn read(path: &Path) -> Result<String, Error> {
    std::fs::read_to_string(path).map_err(|source| Error {
        path: path.to_owned(),
        source,
    })
}

fn list(path: &Path) -> Result<Vec<PathBuf>, Error> {
    let failed = |source| Error {
        path: path.to_owned(),
        source,
    };
    let mut entries = Vec::new();
    for entry in std::fs::read_dir(path).map_err(failed)? {
        entries.push(entry.map_err(failed)?.path());
    }
    entries.sort();
    Ok(entries)
}

/// Folder name and path of every library crate.
fn crates(root: &Path) -> Result<Vec<(String, PathBuf)>, Error> {
    let named = |path: PathBuf| Some((path.file_name()?.to_string_lossy().into_owned(), path));
    Ok(list(&root.join("crates"))?
        .into_iter()
        .filter(|path| path.join("Cargo.toml").is_file())
        .filter_map(named)
        .collect())
}

fn rust_files(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut files = Vec::new();
    for path in list(folder)? {
        if path.is_dir() {
            files.extend(rust_files(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    Ok(files)
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

fn manifest_problems(name: &str, manifest: &str, floors: &BTreeMap<String, u32>) -> Vec<String> {
    let mut problems = Vec::new();
    let lines: Vec<&str> = manifest.lines().map(str::trim).collect();
    if !lines.windows(2).any(|pair| pair == ["[lints]", "workspace = true"]) {
        problems.push(format!("crates/{name}: does not inherit the lints"));
    }
    if !lines.iter().any(|line| line.starts_with("description = ")) {
        problems.push(format!("crates/{name}: has no description"));
    }
    let Some(own) = floors.get(name) else {
        problems.push(format!("crates/{name}: is not in the table of docs/architecture.md"));
        return problems;
    };
    let dependencies = lines.iter().skip_while(|line| **line != "[dependencies]").skip(1);
    for line in dependencies.take_while(|line| !line.starts_with('[')) {
        let Some(other) = line
            .strip_prefix("fewbits-")
            .and_then(|rest| rest.split(['.', ' ', '=']).next())
        else {
            continue;
        };
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

/// Calls that panic, in code that is not a test and not documentation.
fn panics(file: &str, text: &str) -> Vec<String> {
    const FORBIDDEN: [&str; 6] = [
        ".unwrap()",
        ".expect(",
        "panic!(",
        "todo!(",
        "unimplemented!(",
        "unreachable!(",
    ];
    let code = text
        .lines()
        .enumerate()
        .take_while(|(_, line)| line.trim() != "#[cfg(test)]");
    code.filter(|(_, line)| !line.trim_start().starts_with("//"))
        .flat_map(|(number, line)| {
            FORBIDDEN
                .iter()
                .filter(|call| line.contains(**call))
                .map(move |call| (number, call))
        })
        .map(|(number, call)| format!("{file}:{}: `{call}` in library code", number + 1))
        .collect()
}

/// Figure ids that the docs name and the registry lacks, or the other way round.
fn figure_problems(root: &Path) -> Result<Vec<String>, Error> {
    let registered: BTreeSet<String> = all().iter().map(|figure| figure.about().id.to_owned()).collect();
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
    fn the_workspace_is_tidy() {
        let problems = check(&Path::new(env!("CARGO_MANIFEST_DIR")).join("..")).unwrap();
        assert!(problems.is_empty(), "\n{}", problems.join("\n"));
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
        let manifest = |import: &str| {
            format!("description = \"x\"\n[dependencies]\n{import}.workspace = true\n[lints]\nworkspace = true\n")
        };
        assert!(manifest_problems("models", &manifest("fewbits-core"), &floors).is_empty());
        assert_eq!(manifest_problems("models", &manifest("fewbits-filters"), &floors).len(), 1);
        assert_eq!(manifest_problems("models", &manifest("fewbits-elsewhere"), &floors).len(), 1);
    }

    #[test]
    fn panicking_calls_are_found_outside_tests_and_comments_only() {
        let text = "//! x.unwrap()\nfn f() { x.unwrap(); }\n#[cfg(test)]\nmod tests { fn g() { x.unwrap(); } }\n";
        assert_eq!(panics("f.rs", text), ["f.rs:2: `.unwrap()` in library code"]);
    }
}
