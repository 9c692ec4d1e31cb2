//! Fingerprints of the sources that the figures of each system depend on, so that results are reused while none of them changes.
//!
//! A system is a folder of `crates/experiments/src`. Its figures depend on that folder, on the folders of other systems that it
//! names, on its reference values, on the files that all figures share, and on every library crate that these name, with the
//! crates below.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::hash::{DefaultHasher, Hasher};
use std::path::{Path, PathBuf};

/// Shared files that name crates whose results no figure shows: the error type wraps the errors of all crates.
const WITHOUT_RESULTS: [&str; 1] = ["error.rs"];

fn main() -> std::io::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for path in ["../crates", "../Cargo.lock", "../Cargo.toml", "src/figures/draw"] {
        println!("cargo:rerun-if-changed={path}");
    }
    let crates: BTreeMap<String, Crate> = entries(&root.join("crates"))?
        .into_iter()
        .filter(|path| path.join("Cargo.toml").is_file())
        .map(|path| Crate::read(&path))
        .collect::<std::io::Result<_>>()?;
    let experiments = root.join("crates/experiments");
    let (mut shared, mut systems) = (Vec::new(), Vec::new());
    for path in entries(&experiments.join("src"))? {
        if path.is_dir() { &mut systems } else { &mut shared }.push(path);
    }
    shared.extend([root.join("Cargo.lock"), root.join("Cargo.toml")]);
    shared.extend(files(&root.join("xtask/src/figures/draw"))?);
    let shared_crates = words(
        shared
            .iter()
            .filter(|path| !WITHOUT_RESULTS.iter().any(|name| path.ends_with(name))),
        "fewbits_",
    )?;
    let names: BTreeSet<String> = systems.iter().map(|path| name(path)).collect();

    let mut table = String::from("pub(super) const SOURCES: &[(&str, u64)] = &[\n");
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
        let _ = writeln!(table, "    ({system:?}, {:#018x}),", hash(&root, &sources)?);
    }
    table.push_str("];\n");
    std::fs::write(PathBuf::from(std::env::var_os("OUT_DIR").unwrap_or_default()).join("sources.rs"), table)
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
