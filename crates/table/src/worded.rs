//! Dates with words or with other marks than those of ISO 8601, with their parts in its order, and the marks around times.

use crate::calendar::{digits, is_day_name, month_named};

/// A time without brackets around it, and without the marks that keep it a text in spreadsheets.
pub(crate) fn undressed(text: &str) -> &str {
    let text = text.trim();
    let within = |begin: &str, end: char| text.strip_prefix(begin)?.strip_suffix(end);
    within("[", ']')
        .or_else(|| within("=\"", '"'))
        .or_else(|| text.strip_prefix('\''))
        .unwrap_or(text)
}

/// Whether a text is two numbers with a colon that are no hours and minutes, as `1:5`: minutes have two digits.
pub(crate) fn is_ratio(text: &str) -> bool {
    let digits = |text: &str| text.bytes().all(|c| c.is_ascii_digit());
    text.split_once(':')
        .is_some_and(|(hours, minutes)| minutes.len() == 1 && digits(hours) && digits(minutes))
}

/// A date as of China, Japan or Korea, or of Hungary, with the marks of ISO 8601: `2024年3月5日 下午 9:30`, `2024. 3. 5. 21:30`.
pub(crate) fn of_east_asia(text: &str) -> Option<String> {
    const MARKS: [(&[char], &str); 6] = [
        (&['年', '년'], "-"),
        (&['月', '월'], "-"),
        (&['日', '일'], " "),
        (&['時', '时', '시'], ":"),
        (&['分', '분'], ":"),
        (&['秒', '초'], ""),
    ];
    const HALVES: [(&str, &str); 6] = [
        ("上午", "AM"),
        ("午前", "AM"),
        ("오전", "AM"),
        ("下午", "PM"),
        ("午後", "PM"),
        ("오후", "PM"),
    ];
    let begins = digits(text, 4).filter(|(_, count, _)| *count == 4)?;
    let mut plain = text.to_owned();
    if begins.2.starts_with('.') {
        // A point stands behind the day, too.
        let mut cells = text.splitn(4, '.').map(str::trim);
        let (year, month, day) = (cells.next()?, cells.next()?, cells.next()?);
        plain = format!("{year}-{month}-{day} {}", cells.next()?);
    } else if text.is_ascii() {
        return None;
    }
    let half = HALVES.iter().find(|(word, _)| plain.contains(word));
    for (word, _) in HALVES {
        plain = plain.replace(word, " ");
    }
    for (marks, mark) in MARKS {
        let spaced: Vec<&str> = plain.split(marks).map(str::trim).collect();
        plain = spaced.join(mark);
    }
    let words: Vec<&str> = plain.trim_end_matches(':').split_whitespace().collect();
    Some(
        format!("{} {}", words.join(" "), half.map_or("", |(_, word)| word))
            .trim_end()
            .to_owned(),
    )
}

/// A date with words, with its parts in the order of ISO 8601: `Tue, 05 Mar 2024 21:30:00 GMT`, `Mar 5, 2024 9:30 PM`.
pub(crate) fn arranged(text: &str) -> Option<String> {
    const FILLERS: [&str; 7] = ["de", "del", "kl", "kl.", "klo", "um", "alle"];
    if !text.contains(char::is_alphabetic) {
        return None;
    }
    let mut words: Vec<&str> = text.split([' ', ',', '\t']).filter(|word| !word.is_empty()).collect();
    words.retain(|word| !FILLERS.contains(&word.to_ascii_lowercase().as_str()));
    let has_day = words.first().is_some_and(|word| is_day_name(word));
    if has_day {
        words.remove(0);
    }
    let Some(at) = words.iter().position(|word| month_named(word).is_some()) else {
        return has_day.then(|| words.join(" "));
    };
    let month = month_named(words.remove(at))? + 1;
    let is_number = |word: &str, lengths: std::ops::RangeInclusive<usize>| {
        lengths.contains(&word.len()) && word.bytes().all(|c| c.is_ascii_digit())
    };
    let bare = |word: &str| {
        word.trim_end_matches(['.', 's', 't', 'n', 'd', 'r', 'h', 'e'])
            .to_owned()
    };
    if let ([year], false) = (words.as_slice(), has_day)
        && is_number(year, 4..=4)
    {
        // A month alone is that of its first day.
        return Some(format!("{year}-{month:02}-01"));
    }
    let day = words.iter().position(|word| is_number(&bare(word), 1..=2))?;
    let day = bare(words.remove(day));
    let year = words.iter().position(|word| is_number(word, 4..=4))?;
    let year = words.remove(year);
    Some(format!("{year}-{month:02}-{day:0>2} {}", words.join(" ")))
}

/// The first day of a quarter, or of a month before its year: `2026 Q1`, `2026Q1`, `Q1/2026`, `03/2026`.
pub(crate) fn of_period(text: &str) -> Option<String> {
    const MARKS: [char; 3] = [' ', '-', '/'];
    let at = text.find(MARKS).or(text.find(['Q', 'q']))?;
    let (first, last) = (&text[..at], text[at..].trim_start_matches(MARKS));
    let (year, part) = if first.len() == 4 { (first, last) } else { (last, first) };
    let (value, count, rest) = digits(part.trim_start_matches(['Q', 'q']), 3)?;
    let month = match part.starts_with(['Q', 'q']) {
        true => 3 * value - 2,
        false if first.len() <= 2 && count <= 2 => value,
        false => return None,
    };
    let is_year = year.len() == 4 && year.bytes().all(|c| c.is_ascii_digit());
    (is_year && rest.is_empty() && (1..=12).contains(&month)).then(|| format!("{year}-{month:02}-01"))
}

/// The three numbers at the beginning of a date with marks between them, and whether each has two digits at most.
pub(crate) fn three(cell: &str) -> Option<([i64; 3], bool)> {
    let (first, first_count, rest) = digits(undressed(cell), 4)?;
    let mark = rest.chars().next().filter(|mark| matches!(mark, '/' | '-' | '.'))?;
    let (second, second_count, rest) = digits(&rest[1..], 4)?;
    let (third, third_count, _) = digits(rest.strip_prefix(mark)?, 4)?;
    Some(([first, second, third], first_count.max(second_count).max(third_count) <= 2))
}
