//! `cargo xtask size`: lines and public items of every crate.
//!
//! A line of code is neither blank, comment nor documentation, and no part of a module of tests. A public item is a line that begins with
//! `pub fn`, `pub struct`, `pub enum`, `pub trait`, `pub const`, `pub static` or `pub type`, whether or not its module is public.

use crate::Error;
use crate::files::{list, read};
use clap::Args;
use std::ops::AddAssign;
use std::path::Path;

/// Options of `cargo xtask size`.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Names of crates without the project's, such as `core`; all without any. Their sum is the last line.
    pub crates: Vec<String>,
}

/// Counts of one crate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Size {
    files: usize,
    code: usize,
    documentation: usize,
    comments: usize,
    public: usize,
}

impl AddAssign for Size {
    fn add_assign(&mut self, other: Self) {
        self.files += other.files;
        self.code += other.code;
        self.documentation += other.documentation;
        self.comments += other.comments;
        self.public += other.public;
    }
}

/// Prints the table.
///
/// # Errors
/// If a file cannot be read, or no crate has a given name.
pub fn run(options: &Options) -> Result<bool, Error> {
    let folders = list(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates"))?;
    let name = |folder: &Path| folder.file_name().map(|name| name.to_string_lossy().into_owned());
    let names: Vec<String> = folders.iter().filter_map(|folder| name(folder)).collect();
    Error::check_crates(&options.crates, &names.iter().map(String::as_str).collect::<Vec<_>>())?;
    println!("{:20}{:>7}{:>8}{:>8}{:>10}{:>8}", "crate", "files", "code", "docs", "comments", "public");
    let row = |name: &str, size: &Size| {
        let Size {
            files,
            code,
            documentation,
            comments,
            public,
        } = size;
        println!("{name:20}{files:7}{code:8}{documentation:8}{comments:10}{public:8}");
    };
    let mut sum = Size::default();
    for (folder, name) in folders.iter().zip(&names) {
        if options.crates.is_empty() || options.crates.contains(name) {
            let size = of_folder(&folder.join("src"))?;
            row(name, &size);
            sum += size;
        }
    }
    row("sum", &sum);
    Ok(true)
}

fn of_folder(folder: &Path) -> Result<Size, Error> {
    let mut size = Size::default();
    for path in list(folder)? {
        if path.is_dir() {
            size += of_folder(&path)?;
        } else if path.extension().is_some_and(|e| e == "rs") && path.file_stem().is_some_and(|stem| stem != "tests") {
            size += of_text(&read(&path)?);
        }
    }
    Ok(size)
}

/// Beginnings of lines that declare a public item.
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
    let mut size = Size {
        files: 1,
        ..Size::default()
    };
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
        if line.is_empty() {
            continue;
        }
        if line.starts_with("///") || line.starts_with("//!") {
            size.documentation += 1;
        } else if line.starts_with("//") {
            size.comments += 1;
        } else {
            size.code += 1;
            let declared = line.strip_prefix("pub ");
            size.public += usize::from(declared.is_some_and(|rest| PUBLIC.iter().any(|kind| rest.starts_with(kind))));
        }
    }
    size
}

#[cfg(test)]
mod tests {
    use super::{Size, of_text};

    #[test]
    fn lines_are_counted_by_kind() {
        let text = "//! A.\n\nuse a::b;\n/// F.\npub fn f() {\n    // Why.\n    g();\n}\n#[cfg(test)]\nmod other;\n\
                    fn g() {}\n#[cfg(test)]\nmod tests {\n    pub fn h() {}\n}\npub(crate) struct S;\n";
        let expected = Size {
            files: 1,
            code: 6,
            documentation: 2,
            comments: 1,
            public: 1,
        };
        assert_eq!(of_text(text), expected);
    }
}
