//! `--list` and `describe`: what figures there are, and what one takes and gives.

use super::times::expected_seconds;
use fewbits_experiments::{AnyFigure, Column};
use indicatif::HumanDuration;
use std::fmt::Write;
use std::time::Duration;

/// One line per figure: id, expected time on two cores, title.
pub(super) fn list(figures: &[&'static dyn AnyFigure], quick: bool) -> String {
    let width = figures.iter().map(|f| f.about().id.len()).max().unwrap_or(0);
    let line = |f: &&dyn AnyFigure| {
        let seconds = expected_seconds(f.about().id, quick);
        let time = HumanDuration(Duration::from_secs_f64(seconds)).to_string();
        format!("{:width$}  {time:>10}  {}\n", f.about().id, f.about().title)
    };
    figures.iter().map(line).collect()
}

/// Everything about one figure: caption, source, parameters with defaults and ranges, tables with columns and units.
pub(super) fn one(figure: &dyn AnyFigure) -> String {
    let about = figure.about();
    let mut page = format!("{}: {}\n\n", about.id, about.title);
    wrap(&mut page, "  ", &format!("{}{}", about.caption, between(" (", about.source, ")")));
    let parameters = figure.parameters();
    if !parameters.is_empty() {
        page.push_str("\nparameters (--set NAME=VALUE)\n");
    }
    for parameter in parameters {
        let _ = writeln!(page, "  {} = {}", parameter.name, shortened(&parameter.default));
        wrap(&mut page, "      ", &parameter.meaning);
        if !parameter.entries.is_empty() {
            let _ = writeln!(page, "      a list of points {}, separated by commas", parameter.entries.join(":"));
        }
        if !parameter.range.is_empty() {
            let _ = writeln!(page, "      {}", parameter.range);
        }
    }
    for table in figure.tables() {
        let _ = writeln!(page, "\n{}", table.file(about.id));
        wrap(&mut page, "  ", &table.meaning);
        for Column {
            name, unit, meaning, ..
        } in &table.columns
        {
            wrap(&mut page, "  ", &format!("{name}{}: {meaning}", between(" [", unit, "]")));
        }
    }
    page
}

/// A text between marks; nothing of an empty one.
pub(super) fn between(open: &str, text: &str, close: &str) -> String {
    match text {
        "" => String::new(),
        text => format!("{open}{text}{close}"),
    }
}

/// A long list by its beginning and end.
fn shortened(list: &str) -> String {
    const LONGEST: usize = 100;
    if list.chars().count() <= LONGEST {
        return list.to_owned();
    }
    let entries: Vec<&str> = list.split(',').collect();
    match entries.as_slice() {
        [first, second, .., last] => format!("{first},{second},..,{last} ({} entries)", entries.len()),
        _ => list.to_owned(),
    }
}

/// Appends words in lines of at most 100 characters.
fn wrap(page: &mut String, indent: &str, text: &str) {
    let mut lines = vec![indent.to_owned()];
    for word in text.split_whitespace() {
        let line = lines.last().map_or(0, |line| line.chars().count());
        match lines.last_mut() {
            Some(last) if line + word.chars().count() <= 100 || last == indent => *last += &format!("{word} "),
            _ => lines.push(format!("{indent}  {word} ")),
        }
    }
    for line in lines.iter().filter(|line| !line.trim().is_empty()) {
        let _ = writeln!(page, "{}", line.trim_end());
    }
}
