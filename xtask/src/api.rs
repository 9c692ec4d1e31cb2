//! `cargo xtask api`: every public item of the library crates, one file per crate, so that no public change passes unseen.

#[cfg(not(feature = "api"))]
use crate::Error;
use clap::Args;
use std::process::Command;

/// Options of `cargo xtask api`.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Compare with the files instead of writing them.
    #[arg(long)]
    pub check: bool,
}

/// Names the real rustdoc to the copy of this program that cargo runs in its place.
const RUSTDOC: &str = "FEWBITS_RUSTDOC";

/// Runs rustdoc with the arguments of this process if cargo started it in rustdoc's place: whether it succeeded.
///
/// JSON descriptions are behind a flag that a stable rustdoc takes only with a variable set. Set for all of cargo, the variable would
/// have build scripts run, and crates compiled, anew.
pub fn as_rustdoc() -> Option<bool> {
    let rustdoc = std::env::var_os(RUSTDOC)?;
    let arguments = std::env::args_os().skip(1);
    let status = Command::new(rustdoc)
        .args(arguments)
        .env("RUSTC_BOOTSTRAP", "1")
        .status();
    Some(status.is_ok_and(|status| status.success()))
}

/// Runs this command in an xtask with the feature `api`: what reads rustdoc's descriptions is built for it alone.
///
/// # Errors
/// If cargo cannot be started.
#[cfg(not(feature = "api"))]
pub fn run(options: &Options) -> Result<bool, Error> {
    let mut cargo = Command::new("cargo");
    cargo.args(["run", "--quiet", "--package", "xtask", "--features", "api", "--", "api"]);
    if options.check {
        cargo.arg("--check");
    }
    Ok(cargo.status().map_err(Error::cargo)?.success())
}

#[cfg(feature = "api")]
pub use listing::run;

#[cfg(feature = "api")]
mod listing {
    use super::{Options, RUSTDOC};
    use crate::{Error, files};
    use cargo_metadata::MetadataCommand;
    use std::path::Path;
    use std::process::Command;

    /// Writes `docs/api/<crate>.txt` for every crate that can be published, or compares; `Ok(false)` if a file differs.
    ///
    /// # Errors
    /// If rustdoc fails or a file cannot be read or written.
    pub fn run(options: &Options) -> Result<bool, Error> {
        let metadata = MetadataCommand::new().no_deps().exec()?;
        let me = std::env::current_exe().map_err(Error::cargo)?;
        let rustdoc = std::env::var_os("RUSTDOC").unwrap_or_else(|| "rustdoc".into());
        let status = Command::new("cargo")
            .args(["doc", "--workspace", "--no-deps", "--lib", "--quiet"])
            .env("RUSTDOC", me)
            .env(RUSTDOC, rustdoc)
            .env("RUSTDOCFLAGS", "-Z unstable-options --output-format json --cap-lints allow")
            .status()
            .map_err(Error::cargo)?;
        if !status.success() {
            return Err(Error("rustdoc failed".to_owned()));
        }
        let folder = metadata.workspace_root.as_std_path().join("docs/api");
        std::fs::create_dir_all(&folder).map_err(Error::writing(&folder))?;
        let mut same = true;
        for package in &metadata.packages {
            let private = package.publish.as_ref().is_some_and(Vec::is_empty);
            let Some(library) = package.targets.iter().find(|t| t.is_lib()).filter(|_| !private) else {
                continue;
            };
            let description = metadata
                .target_directory
                .as_std_path()
                .join("doc")
                .join(format!("{}.json", library.name));
            let listed = list(&description)?;
            let path = folder.join(format!("{}.txt", package.name));
            if !options.check {
                files::write(&path, &listed)?;
            } else if std::fs::read_to_string(&path).unwrap_or_default() != listed {
                println!("public items changed: {} (`cargo xtask api` writes it anew)", path.display());
                same = false;
            }
        }
        Ok(same)
    }

    /// One line per public item; derived and blanket implementations are left out.
    fn list(description: &Path) -> Result<String, Error> {
        let api = public_api::Builder::from_rustdoc_json(description)
            .omit_blanket_impls(true)
            .omit_auto_trait_impls(true)
            .omit_auto_derived_impls(true)
            .build();
        let misfit = "the version of the crate `public-api` must fit the toolchain's";
        let api = api.map_err(|source| Error(format!("{}: {source}; {misfit}", description.display())))?;
        Ok(api.items().map(|item| format!("{item}\n")).collect())
    }
}
