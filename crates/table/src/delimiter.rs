//! Detection of what separates cells.

use crate::dialect::Delimiter;
use crate::lines::{Row, Split};
use crate::{civil, guess};

/// The cells of a line.
pub(crate) fn cells(line: &str, split: Split) -> Vec<String> {
    let mut row = Row {
        text: line.as_bytes().to_vec(),
        ..Row::default()
    };
    split.split(&mut row);
    row.texts()
}

/// The most frequent number of cells, how many lines have it, and whether the line of names may.
pub(crate) fn modal(lines: &[&str], split: Split) -> (usize, usize) {
    let mut counts = std::collections::BTreeMap::new();
    // The end of the head is data; the beginning may be anything.
    for line in &lines[lines.len() / 2..] {
        *counts.entry(cells(line, split).len()).or_insert(0_usize) += 1;
    }
    counts.into_iter().max_by_key(|(_, lines)| *lines).unwrap_or((1, 0))
}

/// Whether each row begins with a name in quotes that has none in the line of names, as R writes tables.
pub(crate) fn names_its_rows(lines: &[&str], split: Split) -> bool {
    let width = |line: &&str| cells(line, split).len();
    let [first, others @ ..] = lines else { return false };
    let count = width(first) + 1;
    !others.is_empty()
        && lines.iter().all(|line| line.as_bytes().first() == Some(&split.quote))
        && others.iter().all(|line| width(line) == count)
        // Numbers stand without quotes, or all cells have them.
        && others.iter().any(|line| line.bytes().filter(|c| *c == split.quote).count() < 2 * count)
}

/// A mark that stands in each line as often as in the first, where each line was taken for one cell.
pub(crate) fn other_mark(lines: &[&str]) -> Option<char> {
    let [first, others @ ..] = lines else { return None };
    [':', '#', '/', '!', '@', '&', '*'].into_iter().find(|mark| {
        let count = first.matches(*mark).count();
        let is_row = |line: &&str| {
            let values = line
                .split(*mark)
                .filter(|cell| cell.trim().parse::<f64>().is_ok())
                .count();
            line.matches(*mark).count() == count && values > 0 && !guess::looks_like_time(line)
        };
        count > 0 && !others.is_empty() && others.iter().all(is_row)
    })
}

/// Where the date stands in each row, if the names have one cell less since a space stands between date and time of day, or two less since
/// numbers of rows stand in front.
pub(crate) fn splits_its_times(lines: &[&str], split: Split) -> Option<usize> {
    let [first, others @ ..] = lines else { return None };
    let names = cells(first, split);
    let count = others.first().map(|line| cells(line, split).len())?;
    let at = count
        .checked_sub(names.len() + 1)
        .filter(|at| *at < 2 && names.len() > 1)?;
    let is_row = |line: &&str| {
        let row = cells(line, split);
        let is_number = |cell: &str| cell.trim_matches('"').bytes().all(|c| c.is_ascii_digit());
        row.len() == count
            && row[..at].iter().all(|cell| is_number(cell))
            && !row[at].contains(':')
            && guess::looks_like_time(&row[at])
            && civil::of_day(&row[at + 1]).is_some()
    };
    let is_word = |name: &String| name.contains(char::is_alphabetic) && name != "date";
    (split.delimiter == Delimiter::Spaces && names.iter().all(is_word) && others.iter().all(is_row)).then_some(at)
}

/// Largest number of titles above names that are aligned by spaces.
const MAX_TITLES: usize = 5;

/// The delimiter of lines: the first that splits nearly all of the later ones into equally many cells, at least two.
pub(crate) fn delimiter(lines: &[&str], quote: u8) -> Delimiter {
    let candidates = [
        Delimiter::Byte(b'\t'),
        Delimiter::Byte(b';'),
        Delimiter::Byte(b'|'),
        Delimiter::Byte(b','),
        Delimiter::Byte(b'~'),
        Delimiter::Byte(b'^'),
    ];
    let later = lines.len() - lines.len() / 2;
    let score = |delimiter: Delimiter| {
        let (count, found) = modal(lines, Split { delimiter, quote });
        (count >= 2).then_some(found)
    };
    let consistent = candidates
        .iter()
        .copied()
        .find(|delimiter| score(*delimiter).is_some_and(|found| 10 * found >= 8 * later));
    // Decimal commas are no delimiters if spaces split all lines alike, the names too, and commas do not.
    let is_decimal = |delimiter| {
        let spaces = Split {
            delimiter: Delimiter::Spaces,
            quote,
        };
        let width = |line: &&str, split| cells(line, split).len();
        let (words, _) = modal(lines, spaces);
        delimiter == Delimiter::Byte(b',')
            && words >= 2
            && lines.iter().all(|line| width(line, spaces) == words)
            && lines.first().is_some_and(|line| !line.contains(','))
    };
    if let Some(found) = consistent.filter(|found| !is_decimal(*found)) {
        return found;
    }
    let most = candidates
        .iter()
        .copied()
        .filter_map(|delimiter| score(delimiter).map(|found| (found, delimiter)));
    let best = most
        .filter(|(found, delimiter)| 2 * found >= later && !is_decimal(*delimiter))
        .max_by_key(|(found, _)| *found);
    if let Some((_, found)) = best {
        return found;
    }
    // Columns that are aligned by spaces: every line must have as many words, the first too, so that a date alone is no pair of columns; or
    // all from a line of names on, below titles.
    let spaces = Split {
        delimiter: Delimiter::Spaces,
        quote,
    };
    let counts: Vec<usize> = lines
        .iter()
        .map(|line| cells(line, spaces).len())
        .filter(|count| *count > 0)
        .collect();
    let (count, found) = modal(lines, spaces);
    let is_number = |line: &&str| line.split_whitespace().any(|word| word.parse::<f64>().is_ok());
    let is_titled = || {
        let words = |line: &&str| cells(line, spaces).len();
        let names = lines.iter().position(|line| words(line) == count);
        let data = lines.iter().position(|line| words(line) == count && is_number(line));
        names.zip(data).is_some_and(|(names, data)| {
            count >= 3
                && names <= MAX_TITLES
                && (names + 1..=names + 2).contains(&data)
                && !lines[names..data].iter().any(&is_number)
                && lines[data..].iter().all(|line| words(line) == count && is_number(line))
        })
    };
    if count >= 2
        && 10 * found >= 8 * later
        && (counts.first() == Some(&count)
            || is_titled()
            || names_its_rows(lines, spaces)
            || splits_its_times(lines, spaces).is_some())
    {
        return Delimiter::Spaces;
    }
    Delimiter::Byte(b',')
}
