//! Names that stand in the lines above the line of names.

/// Takes names from the lines above the line of names, the nearest of which is the last.
///
/// 1. If the last line names the columns of an index alone, others are named by the line above.
/// 2. A column without a name takes that of the line above, if that line names every column.
/// 3. Equal names get that of a line above in front if this tells them apart, as `T,T` below `Kitchen,Attic`. A name there holds for the empty
///    cells behind it.
///
/// `width`: number of cells of a row. `is_name`: whether a cell may be a name.
pub(crate) fn take_names(
    names: &mut [String],
    rows: &[(u64, Vec<String>)],
    width: usize,
    is_name: impl Fn(&str) -> bool,
) {
    let mut above = rows.iter().rev().map(|(_, cells)| cells).peekable();
    let count = filled(names);
    let is_index = width > count && count > 0 && names[..count].iter().all(|name| !name.is_empty());
    if let Some(line) = above.peek() {
        let others = line.get(count..names.len()).unwrap_or_default();
        let is_whole = line.len() >= names.len() && line[..names.len()].iter().all(|name| is_name(name));
        if is_index && !others.is_empty() && others.iter().all(|name| is_name(name)) {
            names[count..].clone_from_slice(others);
            above.next();
        } else if is_whole && names.iter().take(width).any(String::is_empty) {
            let unnamed = names
                .iter_mut()
                .take(width)
                .zip(line.iter())
                .filter(|(name, _)| name.is_empty());
            unnamed.for_each(|(name, above)| name.clone_from(above));
            above.next();
        }
    }
    if let Some(line) = above.peek()
        && line.len() >= names.len()
        && line[..names.len()].iter().all(|name| name.is_empty() || is_name(name))
    {
        let mut last = "";
        let groups: Vec<&str> = line
            .iter()
            .map(|name| {
                last = if name.is_empty() { last } else { name };
                last
            })
            .collect();
        let is_equal = |i: usize| {
            names
                .iter()
                .filter(|name| !name.is_empty() && **name == names[i])
                .count()
                > 1
        };
        let equal: Vec<usize> = (0..names.len()).filter(|i| is_equal(*i)).collect();
        let joined: Vec<String> = equal.iter().map(|i| format!("{} {}", groups[*i], names[*i])).collect();
        let are_apart = (1..joined.len()).all(|i| !joined[..i].contains(&joined[i]));
        if are_apart && equal.iter().all(|i| !groups[*i].is_empty()) {
            equal.iter().zip(joined).for_each(|(i, name)| names[*i] = name);
        }
    }
}

/// Number of cells up to the last that is not empty.
pub(crate) fn filled(cells: &[String]) -> usize {
    cells
        .iter()
        .rposition(|cell| !cell.is_empty())
        .map_or(0, |last| last + 1)
}
