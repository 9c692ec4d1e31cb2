//! What points and commas in numbers mean, by the first rows.

/// Whether numbers have decimal commas without a doubt: a comma before other than three digits, and no decimal points.
pub(crate) fn has_decimal_commas(rows: &[(u64, Vec<String>)]) -> bool {
    let (mut certain, mut points) = (false, false);
    for cell in rows.iter().flat_map(|(_, cells)| cells) {
        let size = cell.trim_start_matches(['-', '+', '\u{2212}']);
        let is_number = size.bytes().all(|c| c.is_ascii_digit() || matches!(c, b',' | b'.')) && !size.is_empty();
        match (size.split_once(','), is_number) {
            (Some((whole, places)), true) if !whole.contains(',') && !size.contains('.') => {
                certain |= !places.contains(',') && places.len() != 3 && !places.is_empty();
            }
            (None, true) => points |= size.split('.').count() == 2,
            _ => {}
        }
    }
    certain && !points
}

/// A cell of a column that may have points between groups: three digits behind every point, and without one up to three in all, as in
/// `980`, `990`, `1.000`.
pub(crate) fn doubtful_groups(rows: &[(u64, Vec<String>)]) -> Option<(u64, &str)> {
    let width = rows.iter().map(|(_, cells)| cells.len()).max().unwrap_or(0);
    (0..width).find_map(|column| {
        let (mut first, mut groups, mut hundreds) = (None, 0, 0);
        for (line, cells) in rows {
            let Some(cell) = cells.get(column) else { continue };
            let size = cell.trim_start_matches(['-', '+', '\u{2212}']);
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
