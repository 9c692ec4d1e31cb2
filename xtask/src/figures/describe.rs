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
    let source = if about.source.is_empty() {
        String::new()
    } else {
        format!(" ({})", about.source)
    };
    wrap(&mut page, "  ", &format!("{}{source}", about.caption));
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
            let unit = if unit.is_empty() {
                String::new()
            } else {
                format!(" [{unit}]")
            };
            wrap(&mut page, "  ", &format!("{name}{unit}: {meaning}"));
        }
    }
    page
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
    let mut line = indent.to_owned();
    for word in text.split_whitespace() {
        if line.chars().count() + word.chars().count() > 100 && line != indent {
            page.push_str(line.trim_end());
            page.push('\n');
            line = format!("{indent}  ");
        }
        line.push_str(word);
        line.push(' ');
    }
    if line.trim() != "" {
        page.push_str(line.trim_end());
        page.push('\n');
    }
}
