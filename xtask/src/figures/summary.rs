//! The table at the end.

use super::record::{Record, expectation, measured};
use fewbits_experiments::Verdict;
use serde_json::json;
use std::fmt::Write;
use std::path::Path;
use std::time::Duration;

/// What was made and where to look, as text.
pub(super) fn text(records: &[Record], folder: &Path, elapsed: Duration) -> String {
    let width = records.iter().map(|r| r.id.len()).max().unwrap_or(0).max(6);
    let mut page = format!(
        "{:width$}  {:>6}  {:>6}  {:>6}  {:>7}  {:>8}\n",
        "figure", "rows", "pass", "fail", "skipped", "time/s"
    );
    for r in records {
        let counts = [Verdict::Pass, Verdict::Fail, Verdict::Skipped].map(|v| r.count(v));
        let [pass, fail, skipped] = counts;
        let _ = match &r.error {
            Some(error) => writeln!(page, "{:width$}  failed: {error}", r.id),
            None => writeln!(
                page,
                "{:width$}  {:>6}  {pass:>6}  {fail:>6}  {skipped:>7}  {:>8.2}",
                r.id, r.rows, r.wall_time_s
            ),
        };
    }
    for r in records {
        for c in r.claims.iter().filter(|c| c.verdict == Verdict::Fail) {
            let (measured, expected) = (measured(c), expectation(c));
            let _ =
                writeln!(page, "FAIL {} {}: {} (measured {measured}, expected {expected})", r.id, c.id, c.statement);
        }
    }
    for r in records.iter().filter(|r| r.is_undecided()) {
        let _ = writeln!(page, "FAIL {}: none of its {} claims was decided", r.id, r.claims.len());
    }
    let total = |verdict| records.iter().map(|r| r.count(verdict)).sum::<usize>();
    let broken = records.iter().filter(|r| r.error.is_some()).count();
    let broken = if broken > 0 {
        format!("; {broken} figures could not be made")
    } else {
        String::new()
    };
    let _ = writeln!(
        page,
        "\n{} figures in {:.1} s: {} claims hold, {} fail, {} skipped{broken}.",
        records.len(),
        elapsed.as_secs_f64(),
        total(Verdict::Pass),
        total(Verdict::Fail),
        total(Verdict::Skipped),
    );
    let _ = writeln!(
        page,
        "CSV, JSON and SVG are in {}; open {} to look at them.",
        folder.display(),
        folder.join("index.html").display()
    );
    page
}

/// The same for programs.
pub(super) fn json(records: &[Record], folder: &Path, elapsed: Duration) -> String {
    let figure = |r: &Record| {
        let failing: Vec<_> = r.claims.iter().filter(|c| c.verdict == Verdict::Fail).collect();
        json!({
            "id": r.id, "rows": r.rows, "pass": r.count(Verdict::Pass), "fail": r.count(Verdict::Fail),
            "skipped": r.count(Verdict::Skipped), "undecided": r.is_undecided(), "wall_time_s": r.wall_time_s, "error": r.error, "failing": failing,
        })
    };
    let figures: Vec<_> = records.iter().map(figure).collect();
    let good = records.iter().all(Record::good);
    let folder = folder.display().to_string();
    format!(
        "{:#}\n",
        json!({ "good": good, "out": folder, "wall_time_s": elapsed.as_secs_f64(), "figures": figures })
    )
}
