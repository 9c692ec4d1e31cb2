//! How long figures take: measured once, on two cores of the machine of record, at full counts and quick.
//!
//! Used for the order of work (longest first), for the time that a run is expected to take, and in `--list`.

use super::record::Record;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::time::Duration;

/// Columns: id, seconds at full counts, seconds of a quick run.
const TABLE: &str = include_str!("times.csv");

/// Seconds of a figure that the table does not have.
const UNKNOWN_SECONDS: f64 = 2.0;

/// Seconds that a figure is expected to take with one neighbour.
pub(super) fn expected_seconds(id: &str, quick: bool) -> f64 {
    let line = TABLE.lines().find_map(|line| line.strip_prefix(id)?.strip_prefix(','));
    let field = line.and_then(|rest| rest.split(',').nth(usize::from(quick)));
    field
        .and_then(|text| text.trim().parse().ok())
        .unwrap_or(UNKNOWN_SECONDS)
}

/// The table with what the figures of a directory took; figures of which it has none keep their times.
pub(super) fn table(records: &BTreeMap<String, Record>) -> String {
    let mut page = String::from("id,seconds,quick_seconds\n");
    for figure in fewbits_experiments::all() {
        let id = figure.about().id;
        let seconds = [false, true].map(|quick| match records.get(id) {
            Some(record) if record.quick == quick && record.error.is_none() => record.wall_time_s,
            _ => expected_seconds(id, quick),
        });
        let _ = writeln!(page, "{id},{:.2},{:.2}", seconds[0], seconds[1]);
    }
    page
}

/// A duration in words: `12 s`, `3 min`, `1 h 5 min`.
pub(super) fn in_words(duration: Duration) -> String {
    let seconds = duration.as_secs_f64();
    let minutes = (seconds / 60.0).round() as u64;
    match seconds {
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 100.0 => format!("{s:.0} s"),
        _ if minutes < 100 => format!("{minutes} min"),
        _ => format!("{} h {} min", minutes / 60, minutes % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_in_words_have_one_or_two_units() {
        let words = [0.04, 9.97, 61.0, 100.0, 6100.0].map(|s| in_words(Duration::from_secs_f64(s)));
        assert_eq!(words, ["0.0 s", "10 s", "61 s", "2 min", "1 h 42 min"]);
    }

    #[test]
    fn every_line_of_the_table_names_a_figure() {
        let ids: Vec<_> = fewbits_experiments::all()
            .iter()
            .map(|figure| figure.about().id)
            .collect();
        for line in TABLE.lines().skip(1) {
            let fields: Vec<_> = line.split(',').collect();
            assert!(ids.contains(&fields[0]), "{line}");
            assert!(
                fields[1..]
                    .iter()
                    .all(|text| text.parse::<f64>().is_ok_and(|s| s >= 0.0)),
                "{line}"
            );
        }
    }
}
