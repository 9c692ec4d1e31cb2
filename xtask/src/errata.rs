//! What shows each erratum of `docs/errata.md`: the figures with a claim that cites it, and the tests whose documentation does.
//!
//! An erratum is cited by the word `erratum` before its id.

use std::collections::{BTreeMap, BTreeSet};

/// In the column of an erratum that has no numbers to compare.
const NOTATION: &str = "notation";

/// A row of the tables.
pub(crate) struct Row<'a> {
    pub(crate) id: &'a str,
    /// The last column.
    pub(crate) shown_by: &'a str,
    /// The columns before it.
    rest: &'a str,
}

impl<'a> Row<'a> {
    /// None for lines that are no row of an erratum.
    fn read(line: &'a str) -> Option<Self> {
        let id = line.strip_prefix("| `")?.split('`').next().filter(|id| is_id(id))?;
        let (rest, shown_by) = line.strip_suffix('|')?.rsplit_once('|')?;
        Some(Self {
            id,
            shown_by: shown_by.trim(),
            rest,
        })
    }

    /// Whether the last column has this figure.
    pub(crate) fn names(&self, figure: &str) -> bool {
        self.shown_by.split(", ").any(|item| item.trim_matches('`') == figure)
    }
}

/// The errata of the page.
pub(crate) fn rows(page: &str) -> impl Iterator<Item = Row<'_>> {
    page.lines().filter_map(Row::read)
}

/// The page with the last column written anew: the figures that `figures` gives for a row, then its tests.
pub(crate) fn written(
    page: &str,
    tests: &BTreeMap<String, BTreeSet<String>>,
    figures: impl Fn(&Row<'_>) -> Vec<&'static str>,
) -> String {
    let line = |line: &str| match Row::read(line) {
        None => format!("{line}\n"),
        Some(row) => {
            let figures = figures(&row).into_iter().map(|id| format!("`{id}`"));
            let tests = tests
                .get(row.id)
                .into_iter()
                .flatten()
                .map(|name| format!("test `{name}`"));
            let shown: Vec<_> = figures.chain(tests).collect();
            let shown = match row.shown_by {
                NOTATION if shown.is_empty() => NOTATION.to_owned(),
                _ => shown.join(", "),
            };
            format!("{}| {shown} |\n", row.rest)
        }
    };
    page.lines().map(line).collect()
}

/// The errata that a text cites, in words or by `claims.showing("mpa-1")`.
pub(crate) fn cited(text: &str) -> impl Iterator<Item = &str> {
    let in_words = text
        .split("rratum ")
        .skip(1)
        .map(|rest| rest.trim_start_matches([' ', '`']));
    let by_name = text.split(".showing(\"").skip(1);
    let id = |rest: &str| {
        rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '-')
            .unwrap_or(rest.len())
    };
    in_words
        .chain(by_name)
        .map(move |rest| &rest[..id(rest)])
        .filter(|id| is_id(id))
}

/// Adds the tests of a source file whose documentation cites errata: names by erratum.
pub(crate) fn add_tests(source: &str, tests: &mut BTreeMap<String, BTreeSet<String>>) {
    let (mut errata, mut is_test) = (Vec::new(), false);
    for line in source.lines().map(str::trim_start) {
        if line.starts_with("///") {
            errata.extend(cited(line));
        } else if line.starts_with("#[") {
            is_test |= line.starts_with("#[test]");
        } else {
            if let (true, Some(rest)) = (is_test, line.strip_prefix("fn ")) {
                let name = rest.split('(').next().unwrap_or_default();
                for id in &errata {
                    tests.entry((*id).to_owned()).or_default().insert(name.to_owned());
                }
            }
            errata.clear();
            is_test = false;
        }
    }
}

/// `<system>-<number>`.
fn is_id(text: &str) -> bool {
    text.split_once('-').is_some_and(|(system, number)| {
        let letters = |c: char| c.is_ascii_lowercase();
        !system.is_empty() && system.chars().all(letters) && number.parse::<u32>().is_ok()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn citations_are_found_in_claims_and_above_tests() {
        let claim = "the printed one is higher (erratum mpa-4, erratum `mpa-16`); an erratum of print, erratum fig-x";
        assert_eq!(cited(claim).collect::<Vec<_>>(), ["mpa-4", "mpa-16"]);
        let shown = r#"About::of("x").showing("A caption."); claims.showing("mpa-5").all()"#;
        assert_eq!(cited(shown).collect::<Vec<_>>(), ["mpa-5"]);
        let source = "/// Erratum `mi-2`.\n#[test]\nfn shown() {}\n/// Erratum `mi-3`.\nfn no_test() {}\n";
        let mut tests = BTreeMap::new();
        add_tests(source, &mut tests);
        assert_eq!(tests.into_iter().collect::<Vec<_>>(), [("mi-2".to_owned(), ["shown".to_owned()].into())]);
    }

    #[test]
    fn the_last_column_is_written() {
        let page = "| id | shown by |\n| `mi-2` | a | old |\n| `mi-3` | b | notation |\n";
        let tests = [("mi-2".to_owned(), ["t".to_owned()].into())].into();
        let figures = |row: &Row<'_>| {
            if row.id == "mi-2" {
                vec!["mi-fig4-2"]
            } else {
                Vec::new()
            }
        };
        let new = written(page, &tests, figures);
        assert_eq!(new, "| id | shown by |\n| `mi-2` | a | `mi-fig4-2`, test `t` |\n| `mi-3` | b | notation |\n");
        let row = rows(&new).next().unwrap();
        assert!(row.names("mi-fig4-2") && !row.names("t") && !row.names("mi-fig4"));
    }
}
