//! Detection limits that the first rows show.

use crate::text::short;
use fewbits_filters::calibration::median;

/// Lower and upper limit.
pub(crate) type Ends = (Option<f64>, Option<f64>);

/// Values among which a limit is looked for, at least; a limit has one in so many of them, and more than so many times as many as any other
/// value.
const FEWEST: usize = 30;
const SHARE: usize = 20;
const MORE: usize = 5;
/// A number far from all others that marks gaps is there so many times at least.
const FEWEST_MARKS: usize = 3;
/// Beside it, values hardly ever repeat: at least this share of them are different.
const DIFFERENT: f64 = 0.5;
/// Or they repeat since they are rounded, though successive ones differ by so many steps: a level that rests would not be there more often than
/// near it.
const STEPS: f64 = 5.0;
/// It is at most this share of the others' range away from them.
const NEAR: f64 = 0.5;

/// Whether successive values inside the range differ by many of the smallest differences.
fn is_fine(values: &[f64], inner: &[&[f64]]) -> bool {
    let (low, high) = (inner[0][0], inner[inner.len() - 1][0]);
    let inside: Vec<f64> = values
        .iter()
        .copied()
        .filter(|value| (low..=high).contains(value))
        .collect();
    let changes = inside.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let gaps = inner.windows(2).map(|pair| pair[1][0] - pair[0][0]);
    median(changes) >= STEPS * gaps.fold(f64::INFINITY, f64::min)
}

/// Detection limits of a sensor from its values: an end of all values that many cells have, where others are hardly ever equal. A limit of 0 is
/// told and not taken: many things are never below it, and often there.
pub(crate) fn found(values: &[f64], name: &str, told: &mut Vec<String>) -> Ends {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let runs: Vec<&[f64]> = sorted.chunk_by(|one, other| one == other).collect();
    let (Some(first), Some(last)) = (runs.first(), runs.last()) else {
        return (None, None);
    };
    if values.len() < FEWEST || runs.len() < 3 {
        return (None, None);
    }
    let inner = &runs[1..runs.len() - 1];
    let most = inner.iter().map(|run| run.len()).max().unwrap_or(0);
    let count: usize = inner.iter().map(|run| run.len()).sum();
    let is_various = inner.len() as f64 >= DIFFERENT * count as f64 || is_fine(values, inner);
    let reach = NEAR * (inner[inner.len() - 1][0] - inner[0][0]);
    let is_limit = |run: &[f64]| is_various && run.len() * SHARE >= values.len() && run.len() > MORE * most.max(1);
    // Of values that mark gaps a few suffice.
    let is_mark = |run: &[f64], gap: f64| is_various && gap > 2.0 * reach && run.len() >= FEWEST_MARKS.max(most + 1);
    let mut end = |run: &[f64], gap: f64, option: &dyn Fn(f64) -> String| {
        let (at, many) = (run[0], run.len());
        if !is_limit(run) && !is_mark(run, gap) {
            return None;
        }
        if gap > reach {
            told.push(format!(
                "{name} has {many} values {}, far from all others: if it marks a gap, say --missing {at}; if it stands for values below a detection \
                 limit, write the limit, as <0.5",
                short(at)
            ));
            return None;
        }
        let what = format!("{name} has {many} values at the end of its range");
        let option = option(at);
        if at == 0.0 {
            told.push(format!(
                "{what}: if it is a detection limit, say --limits {option}; without it the bands are wrong"
            ));
            return None;
        }
        told.push(format!(
            "{what}, {}: it is taken for a detection limit, as --limits {option} says; --limits no takes them for values",
            short(at)
        ));
        Some(at)
    };
    let low = end(first, inner[0][0] - first[0], &|at| format!("{at}.."));
    let high = end(last, last[0] - inner[inner.len() - 1][0], &|at| format!("..{at}"));
    (low, high)
}
