//! What points and commas in numbers mean, by the first rows.

use crate::hint::{BLANKS, DASHES, SPACES, without_unit};

/// Whether numbers have decimal commas without a doubt: a comma before other than three digits, and no decimal points.
pub(crate) fn has_decimal_commas(rows: &[(u64, Vec<String>)]) -> bool {
    let (mut certain, mut points) = (false, false);
    for cell in rows.iter().flat_map(|(_, cells)| cells) {
        let cell = cell.trim_matches(BLANKS).trim();
        let size = without_exponent(cell.trim_start_matches(['-', '+']).trim_start_matches(DASHES));
        // A unit behind the number, as in `20,5 °C` and `40,1 %`.
        let size = match without_unit(size) {
            Some((number, unit)) if unit.chars().count() <= 6 && !unit.contains([',', '.', ' ']) => number,
            _ => size,
        };
        // Spaces between groups of digits, as of French spreadsheets, say nothing of decimals.
        let is_spaced = |c: char| c == ' ' || SPACES.contains(&c);
        let bare;
        let size = if size.starts_with(|c: char| c.is_ascii_digit()) && size.contains(is_spaced) {
            bare = size.replace(is_spaced, "");
            bare.as_str()
        } else {
            size
        };
        let is_number = size.bytes().all(|c| c.is_ascii_digit() || matches!(c, b',' | b'.')) && !size.is_empty();
        match (size.split_once(','), is_number) {
            (Some((whole, places)), true) if !whole.contains(',') && !size.contains('.') => {
                // No group stands behind a zero alone, or behind more than three digits.
                let is_no_group = places.len() != 3 || whole.starts_with('0') || whole.len() > 3;
                certain |= !places.contains(',') && is_no_group && !places.is_empty();
            }
            (None, true) => points |= size.split('.').count() == 2,
            _ => {}
        }
    }
    certain && !points
}

/// The mark of comments: `//` or `% ` if the first line is one.
pub(crate) fn of_comments(lines: &[(u64, String)]) -> &'static str {
    match lines.first() {
        Some((_, first)) if first.starts_with("//") => "//",
        Some((_, first)) if first.starts_with("% ") => "%",
        _ => "#",
    }
}

/// The digits before an exponent, as of `1,5E-03`.
fn without_exponent(size: &str) -> &str {
    match size.split_once(['e', 'E']) {
        Some((digits, exponent)) if exponent.parse::<i32>().is_ok() => digits,
        _ => size,
    }
}

/// Whether a line is one of marks alone, as `-----+-----`.
pub(crate) fn is_ruler(cells: &[String]) -> bool {
    let is_mark = |cell: &String| cell.chars().all(|c| "-=+|: \u{2500}\u{253c}".contains(c));
    cells.iter().all(is_mark)
        && cells
            .iter()
            .any(|cell| cell.contains("--") || cell.contains("==") || cell.contains('\u{2500}'))
}

/// A cell of a column that may have points between groups: three digits behind every point, and without one up to three in all, as in
/// `980`, `990`, `1.000`.
pub(crate) fn doubtful_groups(rows: &[(u64, Vec<String>)]) -> Option<(u64, &str)> {
    let width = rows.iter().map(|(_, cells)| cells.len()).max().unwrap_or(0);
    (0..width).find_map(|column| {
        let (mut first, mut groups, mut hundreds) = (None, 0, 0);
        for (line, cells) in rows {
            let Some(cell) = cells.get(column) else { continue };
            let size = cell.trim_start_matches(['-', '+']).trim_start_matches(DASHES);
            if !size.bytes().all(|c| c.is_ascii_digit() || c == b'.') || size.is_empty() {
                continue;
            }
            let (whole, rest) = size
                .split_once('.')
                .map_or((size, None), |(whole, rest)| (whole, Some(rest)));
            match rest {
                _ if whole.len() > 3 || (whole.len() > 1 && whole.starts_with('0')) => return None,
                Some(rest) if rest.len() == 3 && !whole.starts_with('0') && !whole.is_empty() => {
                    groups += 1;
                    first.get_or_insert((*line, cell.as_str()));
                }
                Some(_) => return None,
                None => hundreds += u32::from(whole.len() == 3),
            }
        }
        first.filter(|_| groups >= 3 && hundreds >= 3)
    })
}

/// The mark around cells: a single one if all cells of the names, or of the first row, stand between two, or if each of the first lines has a
/// delimiter between two.
pub(crate) fn quote(lines: &[&str]) -> char {
    let is_quoted = |cell: &str| cell.len() > 1 && cell.starts_with('\'') && cell.ends_with('\'');
    let is_single = lines
        .iter()
        .take(2)
        .any(|line| line.split([',', ';', '\t']).all(is_quoted));
    let is_around = |line: &&str, delimiter: char| {
        let mut cells = line.split(delimiter);
        cells.any(|cell| cell.starts_with('\'') && !cell[1..].contains('\''))
            && cells.any(|cell| cell.ends_with('\'') && !cell.starts_with('\''))
    };
    let first = &lines[..lines.len().min(5)];
    let are_around = |delimiter: &char| first.len() > 1 && first.iter().all(|line| is_around(line, *delimiter));
    let is_single = is_single || [',', ';', '\t'].iter().any(are_around);
    if is_single { '\'' } else { '"' }
}
