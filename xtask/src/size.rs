//! `cargo xtask size`: lines and public items of every crate.
//!
//! A line of code is neither blank, comment nor documentation, and no part of a module of tests. A public item is a line that begins with
//! `pub fn`, `pub struct`, `pub enum`, `pub trait`, `pub const`, `pub static` or `pub type`, whether or not its module is public.

use crate::Error;
use crate::files::{list, read, rust_files};
use clap::Args;
use std::path::{Path, PathBuf};

/// Options of `cargo xtask size`.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Names of crates without the project's, such as `core`; all without any. Their sum is the last line.
    pub crates: Vec<String>,
}

/// Counts of one crate: files, then lines of each kind, and public items among the lines of code.
type Size = [usize; 5];
const KINDS: [&str; 5] = ["files", "code", "docs", "comments", "public"];

/// Prints the table.
///
/// # Errors
/// If a file cannot be read, or no crate has a given name.
pub fn run(options: &Options) -> Result<bool, Error> {
    let folders = list(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates"))?;
    let name = |folder: &PathBuf| folder.file_name().map(|name| name.to_string_lossy().into_owned());
    let names: Vec<String> = folders.iter().filter_map(name).collect();
    Error::check_crates(&options.crates, &names.iter().map(String::as_str).collect::<Vec<_>>())?;
    let row = |name: &str, cells: &[String]| println!("{name:20}{}", cells.concat());
    let counted = |size: &Size| size.map(|count| format!("{count:10}"));
    row("crate", &KINDS.map(|kind| format!("{kind:>10}")));
    let mut sum = Size::default();
    for (folder, name) in folders.iter().zip(&names) {
        if options.crates.is_empty() || options.crates.contains(name) {
            let mut size = Size::default();
            for path in rust_files(&folder.join("src"))? {
                if path.file_stem().is_some_and(|stem| stem != "tests") {
                    add(&mut size, &of_text(&read(&path)?));
                }
            }
            row(name, &counted(&size));
            add(&mut sum, &size);
        }
    }
    row("sum", &counted(&sum));
    Ok(true)
}

fn add(sum: &mut Size, more: &Size) {
    sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
}

/// Beginnings of lines that declare a public item, behind `pub`.
const PUBLIC: [&str; 8] = [
    "fn ",
    "const fn ",
    "struct ",
    "enum ",
    "trait ",
    "const ",
    "static ",
    "type ",
];

fn of_text(text: &str) -> Size {
    let mut size = [1, 0, 0, 0, 0];
    let [_, code, documentation, comments, public] = &mut size;
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line == "#[cfg(test)]" {
            // A module of tests in the file ends with the first bracket at the margin; one in another file, with its semicolon.
            let item = lines.find(|line| !line.starts_with('#')).unwrap_or_default();
            if !item.ends_with(';') {
                lines.find(|line| *line == "}");
            }
            continue;
        }
        let line = line.trim();
        if line.starts_with("///") || line.starts_with("//!") {
            *documentation += 1;
        } else if line.starts_with("//") {
            *comments += 1;
        } else if !line.is_empty() {
            *code += 1;
            let declared = line.strip_prefix("pub ");
            *public += usize::from(declared.is_some_and(|rest| PUBLIC.iter().any(|kind| rest.starts_with(kind))));
        }
    }
    size
}

#[cfg(test)]
mod tests {
    use super::of_text;

    #[test]
    fn lines_are_counted_by_kind() {
        let text = "//! A.\n\nuse a::b;\n/// F.\npub fn f() {\n    // Why.\n    g();\n}\n#[cfg(test)]\nmod other;\n\
                    fn g() {}\n#[cfg(test)]\nmod tests {\n    pub fn h() {}\n}\npub(crate) struct S;\n";
        assert_eq!(of_text(text), [1, 6, 2, 1, 1]);
    }
}
