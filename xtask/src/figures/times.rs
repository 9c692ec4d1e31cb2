//! How long figures take: measured once, on two cores of the machine of record, at full counts and quick.
//!
//! Used for the order of work (longest first), for the time that a run is expected to take, and in `--list`.

use super::record::Record;
use std::collections::BTreeMap;
use std::fmt::Write;

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
    for id in fewbits_experiments::ids() {
        let seconds = [false, true].map(|quick| match records.get(id) {
            Some(record) if record.quick == quick && record.error.is_none() => record.wall_time_s,
            _ => expected_seconds(id, quick),
        });
        let _ = writeln!(page, "{id},{:.2},{:.2}", seconds[0], seconds[1]);
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_table_names_a_figure() {
        let ids = fewbits_experiments::ids();
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
