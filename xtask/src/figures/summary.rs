//! The table at the end.

use super::Finished;
use super::write::Directory;
use fewbits_experiments::{Claim, Verdict};
use std::time::Duration;

/// Prints what was made and where to look; whether everything held.
pub(super) fn print(finished: &[Finished], out: &Directory, elapsed: Duration) -> bool {
    let width = finished
        .iter()
        .map(|f| f.figure.about().id.len())
        .max()
        .unwrap_or(0)
        .max(6);
    println!(
        "{:width$}  {:>6}  {:>6}  {:>6}  {:>7}  {:>8}",
        "figure", "rows", "pass", "fail", "skipped", "time/s"
    );
    let (mut totals, mut broken) = ([0; 3], 0);
    for Finished {
        figure,
        result,
        elapsed,
    } in finished
    {
        let id = figure.about().id;
        match result {
            Ok(outcome) => {
                let counts = count(&outcome.claims);
                for (total, count) in totals.iter_mut().zip(counts) {
                    *total += count;
                }
                let [pass, fail, skipped] = counts;
                let rows = outcome.tables.main.len();
                let seconds = elapsed.as_secs_f64();
                println!("{id:width$}  {rows:>6}  {pass:>6}  {fail:>6}  {skipped:>7}  {seconds:>8.2}");
            }
            Err(error) => {
                broken += 1;
                println!("{id:width$}  failed: {error}");
            }
        }
    }
    for Finished { figure, result, .. } in finished {
        let Ok(outcome) = result else { continue };
        for claim in outcome.claims.iter().filter(|claim| claim.verdict == Verdict::Fail) {
            let tolerance = claim.tolerance.map_or(String::new(), |t| format!(" +- {t}"));
            println!(
                "FAIL {} {}: {} (measured {}, expected {}{tolerance})",
                figure.about().id,
                claim.id,
                claim.statement,
                claim.value,
                claim.expected
            );
        }
    }
    let [pass, fail, skipped] = totals;
    println!(
        "\n{} figures in {:.1} s: {pass} claims hold, {fail} fail, {skipped} skipped{}.",
        finished.len(),
        elapsed.as_secs_f64(),
        if broken > 0 {
            format!("; {broken} figures could not be made")
        } else {
            String::new()
        }
    );
    println!(
        "CSV, JSON and SVG are in {}; open {} to look at them.",
        out.path().display(),
        out.path().join("index.html").display()
    );
    fail == 0 && broken == 0
}

fn count(claims: &[Claim]) -> [usize; 3] {
    [Verdict::Pass, Verdict::Fail, Verdict::Skipped].map(|v| claims.iter().filter(|c| c.verdict == v).count())
}
