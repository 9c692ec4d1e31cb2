//! Rules for single files: none is longer than [`MOST_LINES`] lines, and no files of a crate import each other in a circle.
//!
//! Files that break a rule today stand in `allowed.txt`. An entry that is no longer needed is a problem too, so the list only shrinks.

use crate::Error;
use crate::files::{read, rust_files};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The most lines of a source file, its unit tests included.
const MOST_LINES: usize = 400;
/// Re-exports that are followed from a name to the file that defines it.
const MOST_REEXPORTS: usize = 8;

/// What the allow-list permits.
#[derive(Debug, Default)]
struct Allowed {
    long: BTreeSet<String>,
    circles: Vec<BTreeSet<String>>,
}

/// Lines `long <file>` and `circle <file> <file> ...`; empty lines and lines that begin with `#` are passed over.
fn allowed(list: &str) -> Allowed {
    let mut allowed = Allowed::default();
    for line in list.lines().filter(|line| !line.starts_with('#')) {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("long") => allowed.long.extend(words.map(str::to_owned)),
            Some("circle") => allowed.circles.push(words.map(str::to_owned).collect()),
            _ => {}
        }
    }
    allowed
}

/// Files that break a rule, over all crates with a folder `src` in one of `folders`.
pub(super) fn problems(root: &Path, folders: &[PathBuf]) -> Result<Vec<String>, Error> {
    let allowed = allowed(include_str!("allowed.txt"));
    let mut problems = Vec::new();
    let (mut long, mut used) = (BTreeSet::new(), vec![false; allowed.circles.len()]);
    for folder in folders {
        let source = folder.join("src");
        let mut files = BTreeMap::new();
        for path in rust_files(&source)? {
            let shown = path.strip_prefix(root).unwrap_or(&path).display().to_string();
            let text = read(&path)?;
            let lines = text.lines().count();
            if lines > MOST_LINES {
                if !allowed.long.contains(&shown) {
                    problems.push(format!("{shown}: {lines} lines, at most {MOST_LINES}"));
                }
                long.insert(shown.clone());
            }
            let module = module_of(path.strip_prefix(&source).unwrap_or(&path));
            files.insert(module, (shown, text));
        }
        let names = |circle: Vec<&Module>| -> BTreeSet<String> { circle.iter().map(|m| files[*m].0.clone()).collect() };
        let texts = files.iter().map(|(module, (_, text))| (module.clone(), text.as_str()));
        let graph = imports(&texts.collect());
        for circle in circles(&graph).into_iter().map(names) {
            match allowed.circles.iter().position(|known| circle.is_subset(known)) {
                Some(at) => used[at] = true,
                None => {
                    let list: Vec<&str> = circle.iter().map(String::as_str).collect();
                    problems.push(format!("files import each other in a circle: {}", list.join(" ")));
                }
            }
        }
    }
    let unneeded = allowed.long.difference(&long).map(|file| format!("long {file}"));
    let unused = allowed.circles.iter().zip(used).filter(|(_, used)| !used);
    let broken = unused.map(|(circle, _)| format!("circle {}", circle.iter().cloned().collect::<Vec<_>>().join(" ")));
    problems.extend(
        unneeded
            .chain(broken)
            .map(|entry| format!("xtask/src/tidy/allowed.txt: `{entry}` is no longer needed")),
    );
    Ok(problems)
}

/// A module's path below the crate's root.
type Module = Vec<String>;

/// The module that a file below `src` is.
fn module_of(file: &Path) -> Module {
    let mut module: Module = file
        .with_extension("")
        .iter()
        .map(|part| part.to_string_lossy().into_owned())
        .collect();
    let root = module.len() == 1 && matches!(module[0].as_str(), "lib" | "main");
    if root || module.last().is_some_and(|last| last == "mod") {
        module.pop();
    }
    module
}

/// The text without comments and unit tests.
fn code(text: &str) -> String {
    let tests = ["#[cfg(test)]\nmod tests", "#[cfg(test)]\n#[allow"];
    let end = tests
        .iter()
        .filter_map(|start| text.find(start))
        .min()
        .unwrap_or(text.len());
    let lines = text[..end]
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default());
    lines.collect::<Vec<_>>().join("\n")
}

/// One name that a `use` brings into a module.
struct Import {
    path: Module,
    is_public: bool,
}

/// The names that the `use` items of a text bring in; braces are written out.
fn uses(code: &str) -> Vec<Import> {
    let mut found = Vec::new();
    for statement in code.split(';') {
        let Some(at) = statement.rfind("use ").filter(|at| {
            let before = statement[..*at].trim_end_matches(' ');
            before.is_empty() || before.ends_with(['\n', '}', ')', ']']) || before.ends_with("pub")
        }) else {
            continue;
        };
        let before = statement[..at].lines().last().unwrap_or_default().trim();
        let is_public = before.starts_with("pub");
        let tree: String = statement[at + 4..].split_whitespace().collect::<Vec<_>>().join(" ");
        expand(&tree, &mut Vec::new(), &mut |path| found.push(Import { path, is_public }));
    }
    found
}

/// Calls `found` with every path of a use tree.
fn expand(tree: &str, prefix: &mut Module, found: &mut impl FnMut(Module)) {
    let tree = tree.trim();
    let Some(open) = tree.find('{') else {
        let path = tree.split(" as ").next().unwrap_or_default();
        let parts = path
            .split("::")
            .map(|part| part.trim().to_owned())
            .filter(|part| !part.is_empty());
        found(prefix.iter().cloned().chain(parts).collect());
        return;
    };
    let depth = prefix.len();
    prefix.extend(
        tree[..open]
            .split("::")
            .map(|p| p.trim().to_owned())
            .filter(|p| !p.is_empty()),
    );
    let inner = tree[open + 1..].rsplit_once('}').map_or("", |(inner, _)| inner);
    let (mut level, mut from) = (0, 0);
    for (at, letter) in inner.char_indices().chain([(inner.len(), ',')]) {
        match letter {
            '{' => level += 1,
            '}' => level -= 1,
            ',' if level == 0 => {
                if !inner[from..at].trim().is_empty() {
                    expand(&inner[from..at], prefix, found);
                }
                from = at + 1;
            }
            _ => {}
        }
    }
    prefix.truncate(depth);
}

/// Paths written out in the code that begin with `crate::` or `super::`.
fn written(code: &str) -> Vec<Module> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_' || c == ':' || c == '$';
    let words = code
        .split(|c| !is_word(c))
        .filter(|word| word.starts_with("crate::") || word.starts_with("super::"));
    words
        .map(|word| word.split("::").filter(|p| !p.is_empty()).map(str::to_owned).collect())
        .collect()
}

/// For each file the files of the crate that it imports from. A `pub use` hands a name on and imports nothing.
fn imports(files: &BTreeMap<Module, &str>) -> BTreeMap<Module, BTreeSet<Module>> {
    let codes: BTreeMap<&Module, String> = files.iter().map(|(module, text)| (module, code(text))).collect();
    let mut names: BTreeMap<&Module, Vec<Import>> = BTreeMap::new();
    for (module, code) in &codes {
        names.insert(module, uses(code));
    }
    let mut graph = BTreeMap::new();
    for (module, code) in &codes {
        let own = names[*module]
            .iter()
            .filter(|import| !import.is_public)
            .map(|import| import.path.clone());
        let mut targets = BTreeSet::new();
        for path in own.chain(written(code)) {
            targets.extend(defined(&path, module, files, &names, MOST_REEXPORTS));
        }
        targets.remove(*module);
        graph.insert((*module).clone(), targets);
    }
    graph
}

/// The module whose file defines what `path` names in `module`; `None` if it is of another crate.
fn defined(
    path: &[String],
    module: &Module,
    files: &BTreeMap<Module, &str>,
    names: &BTreeMap<&Module, Vec<Import>>,
    left: usize,
) -> Option<Module> {
    let mut at = module.clone();
    let mut rest = path;
    let mut begun = false;
    while let Some((first, after)) = rest.split_first() {
        match first.as_str() {
            "crate" => at.clear(),
            "super" => drop(at.pop()),
            "self" => {}
            name => {
                let below: Module = at.iter().cloned().chain([name.to_owned()]).collect();
                if files.contains_key(&below) {
                    at = below;
                } else if !begun {
                    return None;
                } else {
                    let handed_on = names.get(&at).into_iter().flatten();
                    let mut handed_on = handed_on.filter(|import| import.path.last().is_some_and(|last| last == name));
                    let source = handed_on.next().filter(|_| left > 0);
                    return match source {
                        Some(import) => defined(&import.path, &at, files, names, left - 1).or(None),
                        None => Some(at),
                    };
                }
            }
        }
        begun = true;
        rest = after;
    }
    Some(at)
}

/// The files that a file reaches by imports of imports.
fn reached<'a>(graph: &'a BTreeMap<Module, BTreeSet<Module>>, from: &'a Module) -> BTreeSet<&'a Module> {
    let (mut seen, mut pending) = (BTreeSet::new(), vec![from]);
    while let Some(next) = pending.pop() {
        pending.extend(
            graph
                .get(next)
                .into_iter()
                .flatten()
                .filter(|other| seen.insert(*other)),
        );
    }
    seen
}

/// Sets of more than one file that all reach each other.
fn circles(graph: &BTreeMap<Module, BTreeSet<Module>>) -> BTreeSet<Vec<&Module>> {
    let reach: BTreeMap<_, _> = graph.keys().map(|module| (module, reached(graph, module))).collect();
    let both = |a: &Module, b: &Module| reach[a].contains(b) && reach[b].contains(a);
    let circle = |module| graph.keys().filter(|other| both(module, other)).collect();
    graph.keys().filter(|module| both(module, module)).map(circle).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crate_of(files: &[(&str, &str)]) -> Vec<Vec<String>> {
        let texts: Vec<(Module, &str)> = files
            .iter()
            .map(|(file, text)| (module_of(Path::new(file)), *text))
            .collect();
        let graph = imports(&texts.into_iter().collect());
        circles(&graph)
            .iter()
            .map(|circle| circle.iter().map(|m| m.join("/")).collect())
            .collect()
    }

    #[test]
    fn circles_are_found_through_reexports() {
        let lib = ("lib.rs", "mod a;\nmod b;\npub use a::One;\npub use b::{Two, Three};\n");
        let a = ("a.rs", "use crate::{Three, x::Y};\npub struct One;\n");
        let straight = (
            "b.rs",
            "use std::fmt;\npub struct Two;\npub struct Three;\n#[cfg(test)]\nmod tests { use crate::One; }\n",
        );
        assert!(crate_of(&[lib, a, straight]).is_empty());
        let round = ("b.rs", "pub struct Two(crate::One);\npub struct Three;\n");
        assert_eq!(crate_of(&[lib, a, round]), [["a", "b"]]);
    }

    #[test]
    fn parents_and_children_may_form_a_circle() {
        let parent = "mod b;\npub use b::Part;\n";
        let child = ("a/b.rs", "use super::Whole;\npub struct Part(Whole);\n");
        assert!(crate_of(&[("lib.rs", "mod a;"), ("a/mod.rs", parent), child]).is_empty());
        let calls = "mod b;\nuse b::Part;\npub struct Whole(Part);\n";
        assert_eq!(crate_of(&[("lib.rs", "mod a;"), ("a/mod.rs", calls), child]), [["a", "a/b"]]);
    }

    #[test]
    fn lists_are_read_line_by_line() {
        let list = allowed("# why\nlong x.rs\n\ncircle a.rs b.rs\n");
        assert!(list.long.contains("x.rs") && list.circles.len() == 1 && list.circles[0].len() == 2);
    }
}
