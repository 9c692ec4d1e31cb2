//! `cargo xtask alone`: every crate built as a user would depend on it, outside the workspace.
//!
//! For each library crate a package is written to a temporary folder that depends on that crate alone: checked with default
//! features and with none, then with the example of its front page and with each file in `examples` as its program, which is run. Examples
//! that read arguments are built only, those that share a file with tests are left out. With `--git` the dependency is on a repository instead of this checkout.

use crate::Error;
use crate::files::{read, write};
use cargo_metadata::{DependencyKind, MetadataCommand, Package};
use clap::Args;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

/// Options of `cargo xtask alone`.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Names of crates, such as `fewbits-core`; all without any.
    pub crates: Vec<String>,
    /// Only check, and run no examples; without names, the crates that promise few dependencies.
    #[arg(long)]
    pub fast: bool,
    /// Address of a repository to depend on by git, such as that of a bare clone: `file:///tmp/fewbits.git`.
    #[arg(long)]
    pub git: Option<String>,
}

/// Crates that others take alone, small by promise.
const LEAN: [&str; 3] = ["fewbits-core", "fewbits-quantizers", "fewbits-dymbo"];

/// Tries the crates and prints what failed; `Ok(false)` if anything did.
///
/// # Errors
/// If a manifest cannot be read, a folder not be written, or no crate has a given name.
pub fn run(options: &Options) -> Result<bool, Error> {
    let metadata = MetadataCommand::new().no_deps().exec()?;
    let is_library = |package: &&Package| package.manifest_path.as_str().contains("/crates/");
    let libraries: Vec<&Package> = metadata.packages.iter().filter(is_library).collect();
    let names: Vec<&str> = libraries.iter().map(|package| package.name.as_str()).collect();
    Error::check_crates(&options.crates, &names)?;
    let root = metadata.workspace_root.as_std_path();
    let target = metadata.target_directory.as_std_path().join("alone");
    let mut good = true;
    for package in libraries {
        let name = package.name.as_str();
        let chosen = match options.crates.as_slice() {
            [] => !options.fast || LEAN.contains(&name),
            names => names.iter().any(|n| n == name),
        };
        if chosen {
            good &= try_crate(package, root, &target, options)?;
        }
    }
    Ok(good)
}

fn try_crate(package: &Package, root: &Path, target: &Path, options: &Options) -> Result<bool, Error> {
    let git = options.git.as_deref();
    let folder = target.join("packages").join(package.name.as_str());
    let source = folder.join("src");
    std::fs::create_dir_all(&source).map_err(Error::writing(&source))?;
    write(&folder.join("Cargo.lock"), &read(&root.join("Cargo.lock"))?)?;
    let cargo = |verb: &str| {
        let status = Command::new("cargo")
            .args([verb, "--quiet"])
            .args(git.is_none().then_some("--offline"))
            .arg("--manifest-path")
            .arg(folder.join("Cargo.toml"))
            .env("CARGO_TARGET_DIR", target)
            .stdout(std::process::Stdio::null())
            .status();
        status.map(|status| status.success()).map_err(Error::cargo)
    };

    let mut good = true;
    let mut report = |what: &str, passed: bool| {
        println!("{:4} {} {what}", if passed { "ok" } else { "FAIL" }, package.name);
        good &= passed;
    };
    write(&source.join("main.rs"), "fn main() {}\n")?;
    for (what, features) in [("with default features", true), ("without features", false)] {
        write(&folder.join("Cargo.toml"), &manifest(package, git, features, &BTreeSet::new()))?;
        report(what, cargo("check")?);
    }
    if options.fast {
        return Ok(good);
    }
    let mut programs = Vec::new();
    for part in &package.targets {
        let path = part.src_path.as_std_path();
        if part.is_example() {
            let text = read(path)?;
            // What shares a file with tests is no program of its own.
            if !text.contains("#[path") {
                programs.push((format!("example {}", part.name), text));
            }
        } else if part.is_lib() {
            programs.extend(front_page(&read(path)?).map(|text| ("front page".to_owned(), text)));
        }
    }
    for (what, text) in programs {
        write(&folder.join("Cargo.toml"), &manifest(package, git, true, &used(&text)))?;
        write(&source.join("main.rs"), &text)?;
        let (verb, note) = match text.contains("env::args") {
            true => ("build", " (not run: it reads arguments)"),
            false => ("run", ""),
        };
        report(&format!("{what}{note}"), cargo(verb)?);
    }
    Ok(good)
}

/// The first example of a crate's documentation as a program.
fn front_page(library: &str) -> Option<String> {
    let mut lines = library.lines().map_while(|line| line.strip_prefix("//!"));
    // A block in another language ends with the fence that a program begins with.
    loop {
        let fence = lines.find(|line| line.trim().starts_with("```"))?;
        if ["```", "```rust"].contains(&fence.trim()) {
            break;
        }
        lines.find(|line| line.trim() == "```")?;
    }
    let lines = lines.map(|line| line.strip_prefix(' ').unwrap_or(line));
    let shown = lines.take_while(|line| line.trim() != "```");
    let body: Vec<&str> = shown.map(|line| line.strip_prefix("# ").unwrap_or(line)).collect();
    let body = body.join("\n");
    Some(if body.contains("fn main()") {
        body
    } else if body.contains("Ok::<") {
        format!("fn main() {{\nlet done = (|| {{\n{body}\n}})();\nassert!(done.is_ok());\n}}\n")
    } else {
        format!("fn main() {{\n{body}\n}}\n")
    })
}

/// Names that stand before a `::` in a program: crates among them.
fn used(program: &str) -> BTreeSet<String> {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let before = |end: usize| program[..end].rsplit(|c| !is_name(c)).next().unwrap_or_default();
    program
        .match_indices("::")
        .map(|(end, _)| before(end).to_owned())
        .collect()
}

/// A package that depends on one crate and on what its program imports besides.
fn manifest(package: &Package, git: Option<&str>, default_features: bool, used: &BTreeSet<String>) -> String {
    let place = |folder: &str| match git {
        Some(address) => format!("git = \"{address}\""),
        None => format!("path = \"{folder}\""),
    };
    let mut text = format!(
        "[package]\nname = \"alone-{0}\"\nversion = \"0.0.0\"\nedition = \"2024\"\n[workspace]\n[dependencies]\n\
         {0} = {{ {1}, default-features = {default_features} }}\n",
        package.name,
        place(package.manifest_path.as_str().trim_end_matches("/Cargo.toml")),
    );
    let mut known = BTreeSet::from([package.name.to_string()]);
    for dependency in &package.dependencies {
        let imported = used.contains(&dependency.name.replace('-', "_"));
        if dependency.kind == DependencyKind::Build || !imported || !known.insert(dependency.name.clone()) {
            continue;
        }
        let features: Vec<String> = dependency.features.iter().map(|f| format!("\"{f}\"")).collect();
        let source = match &dependency.path {
            Some(path) => place(path.as_str()),
            None => format!("version = \"{}\"", dependency.req),
        };
        text += &format!(
            "{} = {{ {source}, default-features = {}, features = [{}] }}\n",
            dependency.name,
            dependency.uses_default_features,
            features.join(", ")
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{front_page, used};

    #[test]
    fn front_pages_are_programs() {
        let page = "//! A.\n//!\n//! ```text\n//! x\n//! ```\n//! ```\n//! use a::b;\n//! # Ok::<(), a::E>(())\n//! ```\n//! C.\n\nmod a;\n";
        let program = front_page(page).unwrap();
        assert!(
            program.starts_with("fn main() {\nlet done = (|| {\nuse a::b;\nOk::<(), a::E>(())\n})();"),
            "{program}"
        );
        assert_eq!(front_page("//! None.\n"), None);
    }

    #[test]
    fn imports_are_found() {
        let program = "//! x\nuse rand::RngExt;\nuse fewbits_core::{Link, Sign};\nfn main() {}\n";
        assert_eq!(used(program).into_iter().collect::<Vec<_>>(), ["fewbits_core", "rand"]);
    }
}
