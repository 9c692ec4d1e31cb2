//! Hashes of the sources that the figures of each system depend on, so that results are reused while none of them changes. The build
//! script runs this file.
//!
//! A system is a folder of `crates/experiments/src` with a `mod.rs`. Its figures depend on that folder, on the folders of other systems
//! that it names, on its reference values, on all other files of `experiments`, on what runs, judges, draws and writes figures, and on
//! every library crate that these name, with the crates below.

use std::collections::{BTreeMap, BTreeSet};
use std::hash::{DefaultHasher, Hasher};
use std::path::{Path, PathBuf};

/// Shared files that name crates whose results no figure shows: the error type wraps the errors of all crates.
const WITHOUT_RESULTS: [&str; 1] = ["error.rs"];

/// Files beside `experiments` and the libraries that make figures what they are.
pub const SHARED: [&str; 8] = [
    "Cargo.lock",
    "Cargo.toml",
    "crates/experiments/Cargo.toml",
    "xtask/Cargo.toml",
    "xtask/src/figures/produce.rs",
    "xtask/src/figures/record.rs",
    "xtask/src/figures/sources.rs",
    "xtask/src/figures/write.rs",
];

/// The hash of each system's sources in the workspace at `root`.
///
/// # Errors
/// If a file or folder cannot be read.
pub fn hashes(root: &Path) -> std::io::Result<BTreeMap<String, u64>> {
    let crates: BTreeMap<String, Crate> = entries(&root.join("crates"))?
        .into_iter()
        .filter(|path| path.join("Cargo.toml").is_file())
        .map(|path| Crate::read(&path))
        .collect::<std::io::Result<_>>()?;
    let experiments = root.join("crates/experiments");
    let (mut shared, mut systems) = (Vec::new(), Vec::new());
    for path in entries(&experiments.join("src"))? {
        if path.join("mod.rs").is_file() {
            systems.push(path);
        } else if path.is_dir() {
            shared.extend(files(&path)?);
        } else {
            shared.push(path);
        }
    }
    shared.extend(SHARED.map(|path| root.join(path)));
    let with_results = shared
        .iter()
        .filter(|path| !WITHOUT_RESULTS.iter().any(|name| path.ends_with(name)));
    let shared_crates = words(with_results, "fewbits_")?;
    let names: BTreeSet<String> = systems.iter().map(|path| name(path)).collect();

    let mut table = BTreeMap::new();
    for system in &names {
        // The systems that this one names, and those that they name.
        let mut own = BTreeSet::from([system.clone()]);
        let mut sources = shared.clone();
        let mut open = vec![system.clone()];
        while let Some(next) = open.pop() {
            let here = files(&experiments.join("src").join(&next))?;
            for word in words(&here, "crate::")?.intersection(&names) {
                if own.insert(word.clone()) {
                    open.push(word.clone());
                }
            }
            sources.extend(here);
        }
        let references = files(&experiments.join("references"))?;
        sources.extend(
            references
                .into_iter()
                .filter(|path| own.iter().any(|system| name(path).starts_with(system.as_str()))),
        );
        let mut needed: Vec<String> = words(&sources, "fewbits_")?.union(&shared_crates).cloned().collect();
        // `experiments` itself is taken file by file.
        needed.retain(|word| word != "experiments");
        let mut reached = BTreeSet::new();
        while let Some(next) = needed.pop() {
            if let Some(found) = crates.get(&next)
                && reached.insert(next)
            {
                needed.extend(found.imports.iter().cloned());
                sources.extend(found.files.iter().cloned());
            }
        }
        table.insert(system.clone(), hash(root, &sources)?);
    }
    Ok(table)
}

/// A library crate: its files, and the crates it imports.
struct Crate {
    files: Vec<PathBuf>,
    imports: Vec<String>,
}

impl Crate {
    fn read(path: &Path) -> std::io::Result<(String, Self)> {
        let manifest = path.join("Cargo.toml");
        let text = std::fs::read_to_string(&manifest)?;
        let dependencies = text.split("\n[").find(|section| section.starts_with("dependencies]"));
        let imports = dependencies
            .unwrap_or_default()
            .lines()
            .filter_map(|line| line.strip_prefix("fewbits-"))
            .map(|rest| identifier(rest).replace('-', "_"))
            .collect();
        let mut files = files(&path.join("src"))?;
        files.push(manifest);
        Ok((name(path).replace('-', "_"), Self { files, imports }))
    }
}

fn identifier(text: &str) -> &str {
    let end = text.find(|c: char| !c.is_ascii_alphanumeric() && c != '_' && c != '-');
    &text[..end.unwrap_or(text.len())]
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn entries(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut paths = std::fs::read_dir(folder)?
        .map(|entry| Ok(entry?.path()))
        .collect::<std::io::Result<Vec<_>>>()?;
    paths.sort();
    Ok(paths)
}

/// All files below a folder.
fn files(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for path in entries(folder)? {
        if path.is_dir() {
            found.extend(files(&path)?);
        } else {
            found.push(path);
        }
    }
    Ok(found)
}

/// The identifiers that follow `prefix` in the Rust files among these.
fn words<'a>(paths: impl IntoIterator<Item = &'a PathBuf>, prefix: &str) -> std::io::Result<BTreeSet<String>> {
    let mut found = BTreeSet::new();
    for path in paths
        .into_iter()
        .filter(|path| path.extension().is_some_and(|e| e == "rs"))
    {
        let text = std::fs::read_to_string(path)?;
        let after = text.split(prefix).skip(1);
        found.extend(after.map(|rest| identifier(rest).to_owned()));
    }
    Ok(found)
}

/// Hash of names and contents, in order of the names.
fn hash(root: &Path, paths: &[PathBuf]) -> std::io::Result<u64> {
    let mut hasher = DefaultHasher::new();
    for path in paths.iter().collect::<BTreeSet<_>>() {
        hasher.write(path.strip_prefix(root).unwrap_or(path).to_string_lossy().as_bytes());
        hasher.write(&std::fs::read(path)?);
    }
    Ok(hasher.finish())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A workspace of two systems, a library for each, and one that draws.
    fn workspace() -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        let library = "crates/experiments/src";
        let own = [
            (format!("{library}/lib.rs"), "mod one; mod two; use fewbits_plot::Plot;"),
            (format!("{library}/claim.rs"), "mod all;"),
            (format!("{library}/claim/all.rs"), ""),
            (format!("{library}/one/mod.rs"), "use fewbits_low::x;"),
            (format!("{library}/two/mod.rs"), "use fewbits_high::x;"),
            ("crates/experiments/references/one.csv".to_owned(), "1"),
        ];
        let crates = [
            ("low", ""),
            ("high", ""),
            ("plot", "fewbits-axes.workspace = true\n"),
            ("axes", ""),
        ];
        let crates = crates.map(|(name, needs)| {
            let manifest = format!("[package]\n\n[dependencies]\n{needs}");
            [
                (format!("crates/{name}/src/lib.rs"), String::new()),
                (format!("crates/{name}/Cargo.toml"), manifest),
            ]
        });
        let shared = SHARED.map(|path| (path.to_owned(), "[package]\n"));
        let fixed = own
            .into_iter()
            .chain(shared)
            .map(|(path, text)| (path, text.to_owned()));
        for (path, text) in fixed.chain(crates.into_iter().flatten()) {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        root
    }

    #[test]
    fn a_change_reaches_the_systems_that_depend_on_it() {
        const BOTH: [&str; 2] = ["one", "two"];
        let cases: [(&str, &[&str]); 11] = [
            ("crates/experiments/src/one/mod.rs", &["one"]),
            ("crates/experiments/references/one.csv", &["one"]),
            ("crates/low/src/lib.rs", &["one"]),
            ("crates/high/Cargo.toml", &["two"]),
            ("crates/experiments/src/claim.rs", &BOTH),
            ("crates/experiments/src/claim/all.rs", &BOTH),
            ("crates/experiments/Cargo.toml", &BOTH),
            ("crates/plot/src/lib.rs", &BOTH),
            ("crates/axes/src/lib.rs", &BOTH),
            ("xtask/src/figures/write.rs", &BOTH),
            ("Cargo.toml", &BOTH),
        ];
        let root = workspace();
        for (path, systems) in cases {
            let before = hashes(root.path()).unwrap();
            assert_eq!(before.keys().collect::<Vec<_>>(), BOTH);
            let file = root.path().join(path);
            let text = std::fs::read_to_string(&file).unwrap();
            std::fs::write(&file, text + "\n// changed\n").unwrap();
            let after = hashes(root.path()).unwrap();
            let changed: Vec<_> = BOTH.into_iter().filter(|name| before[*name] != after[*name]).collect();
            assert_eq!(changed, systems, "{path}");
        }
    }

    #[test]
    fn every_shared_file_is_in_the_workspace() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        assert!(!hashes(&root).unwrap().is_empty());
    }
}
