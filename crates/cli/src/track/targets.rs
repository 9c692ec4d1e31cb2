//! Rows of several targets in one table of `ranges`.

use super::anchors::Anchor;
use super::columns::{is_place, words};
use super::target::{OfTarget, Target};
use crate::arguments::TableOptions;
use crate::error::Error;
use crate::files::is_regular;
use crate::input::Table;
use fewbits_record::TimeBase;
use fewbits_table::Kind;
use fewbits_table::names::as_argument;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;

/// Names of a column that has the name of each row's target.
const TARGETS: [&str; 14] = [
    "tag", "target", "robot", "mobile", "device", "id", "object", "person", "asset", "badge", "vehicle", "player",
    "name", "mote",
];
/// Rows that are looked at.
const ROWS: usize = 4000;
/// A target has at least so many rows, and a table at most so many targets: others are counters.
const FEWEST: usize = 8;
const MOST: usize = 20;
/// Targets that are tracked, at most.
const MOST_TRACKED: usize = 1000;

/// The targets that a column of a file names, as they come, with their rows.
pub(super) fn targets(options: &TableOptions, column: &str) -> Result<Vec<Target>, Error> {
    const OPTION: &str = "--target";
    if !is_regular(&options.file) {
        return Err(Error::option(OPTION, column, "a file in place of a pipe, since it is read more than once"));
    }
    let chosen = TableOptions {
        by: None,
        ..options.clone()
    };
    let mut table = Table::open_with_time(&chosen, 2)?.with_labels(column)?;
    let (mut names, mut rows) = (Vec::<String>::new(), Vec::new());
    while table.next(TimeBase::Numbered)?.is_some() {
        let label = table.label();
        rows.push((!label.is_empty()).then(|| match names.iter().position(|name| name == label) {
            Some(number) => number,
            None => {
                names.push(label.to_owned());
                names.len() - 1
            }
        }));
        if names.len() > MOST_TRACKED {
            return Err(Error::option(OPTION, column, "a column that names at most 1000 targets"));
        }
    }
    let rows: Rc<[Option<usize>]> = rows.into();
    let all: Rc<[String]> = names.into();
    let of = |(number, name): (usize, &String)| Target {
        name: name.clone(),
        rows: OfTarget::new(number, Rc::clone(&rows)),
        all: Rc::clone(&all),
    };
    Ok(all.iter().enumerate().map(of).collect())
}

/// The column that names the anchor of each row, if rows are single ranges.
fn by(options: &TableOptions, names: &[String]) -> Option<String> {
    let found = names
        .iter()
        .find(|name| words(name).first().is_some_and(|word| is_place(word)));
    options.by.clone().or_else(|| found.cloned())
}

/// The labels of the first rows by this column.
fn labels(options: &TableOptions, value: &str, name: &str) -> Result<Vec<String>, Error> {
    let chosen = TableOptions {
        columns: vec![value.to_owned()],
        ..options.clone()
    };
    let mut table = Table::open(&chosen)?.with_labels(name)?;
    let mut found = Vec::new();
    while found.len() < ROWS && table.next(TimeBase::Numbered)?.is_some() {
        found.push(table.label().to_owned());
    }
    Ok(found)
}

/// Refuses a file whose rows are of several targets. What else is wrong with the file is told when its rows are read.
pub(super) fn refuse_several(options: &TableOptions, anchors: &[Anchor]) -> Result<(), Error> {
    if !is_regular(&options.file) {
        return Ok(());
    }
    let whole = TableOptions {
        columns: Vec::new(),
        without: None,
        by: None,
        time: None,
        time_column: None,
        ..options.clone()
    };
    let Ok(table) = Table::open(&whole) else {
        return Ok(());
    };
    let names = table.names.clone();
    let by = by(options, &names);
    let is_target = |name: &&String| {
        Some(*name) != by.as_ref() && words(name).first().is_some_and(|word| TARGETS.contains(&word.as_str()))
    };
    let is_value = |i: &usize| {
        let name = &names[*i];
        !is_target(&name) && Some(name) != by.as_ref() && !matches!(table.kind(*i), Kind::Words | Kind::Text)
    };
    let Some(value) = (0..names.len()).rev().find(is_value) else {
        return Ok(());
    };
    for name in names.iter().filter(is_target) {
        let Ok(targets) = labels(&whole, &names[value], name) else {
            continue;
        };
        let of_anchors = match &by {
            Some(by) => labels(&whole, &names[value], by).unwrap_or_default(),
            None => Vec::new(),
        };
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        targets
            .iter()
            .for_each(|target| *counts.entry(target).or_default() += 1);
        // Another name of the anchor is no target: each anchor has one.
        let mut of_each: BTreeMap<&String, BTreeSet<&String>> = BTreeMap::new();
        for (anchor, target) in of_anchors.iter().zip(&targets) {
            of_each.entry(anchor).or_default().insert(target);
        }
        let is_crossed = of_anchors.is_empty() || of_each.values().any(|targets| targets.len() > 1);
        let is_anchor = counts
            .keys()
            .any(|target| anchors.iter().any(|(anchor, _)| anchor == target));
        let is_plain = (2..=MOST).contains(&counts.len()) && counts.values().all(|rows| *rows >= FEWEST);
        if is_plain && is_crossed && !is_anchor {
            let some: Vec<String> = counts.keys().take(3).map(|target| format!("`{target}`")).collect();
            let problem = format!(
                "column `{name}` names {} targets, {}, and one target is tracked: --target {} gives each a track; \
                 without that column all rows are of one target",
                counts.len(),
                some.join(", "),
                as_argument([name])
            );
            return Err(Error::content(&options.file, problem));
        }
    }
    Ok(())
}
