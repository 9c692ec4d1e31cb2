//! Writes what `figures` needs to know of its sources and its compiler: an earlier result is kept while none of them changes.

#[path = "src/figures/sources.rs"]
mod sources;

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Variables of cargo that say how the results are compiled.
const OPTIONS: [&str; 3] = ["TARGET", "OPT_LEVEL", "CARGO_ENCODED_RUSTFLAGS"];

fn main() -> std::io::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    println!("cargo:rerun-if-changed=../crates");
    for path in sources::SHARED {
        println!("cargo:rerun-if-changed=../{path}");
    }
    let mut text = String::from("pub(super) const SOURCES: &[(&str, u64)] = &[\n");
    for (system, hash) in sources::hashes(&root)? {
        let _ = writeln!(text, "    ({system:?}, {hash:#018x}),");
    }
    let variable = |name| std::env::var(name).unwrap_or_default();
    let compiler = Command::new(variable("RUSTC")).arg("-vV").output()?.stdout;
    let built = OPTIONS.map(variable).join(" ") + " " + &String::from_utf8_lossy(&compiler);
    let _ = writeln!(text, "];\npub(super) const BUILT_WITH: &str = {built:?};");
    std::fs::write(PathBuf::from(variable("OUT_DIR")).join("sources.rs"), text)
}
