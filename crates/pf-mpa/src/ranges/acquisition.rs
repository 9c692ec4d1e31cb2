//! All places that explain the first ranges.
//!
//! ```text
//! for all ranges, and for all but those of one anchor:
//!     on a grid of positions p:  ln p(p | ranges); bias and scale are integrated out, since ranges are linear in them
//!     at each local maximum:     the most probable state by Gauss-Newton steps, for each noise; its covariance and evidence there
//! keep:  the places whose evidence is not negligible beside the best, each as one hypothesis
//! ```
//! Fewer ranges than position, bias and error of scale have coordinates leave a curve of places: it is cut into pieces by the error of scale, and each
//! place of a piece into slices that are short enough for one linearisation.
//!
//! Anchors on a circle have a second place, the inverse of the first in that circle: its ranges differ by a factor only. Which of the two it is
//! is decided by the prior of scale and bias alone, so both are kept while both are probable.

use super::bank::Hypothesis;
use super::fit::{Calibration, Search};
use super::gaussian::Normal;
use super::grid::Grid;
use super::odds::is_worth;
use super::rows::Collected;
use super::search::{Bank, Found};
use super::settings::Known;

/// Sets and places that become hypotheses at most, and by how many nats they may be worse than the best.
const KEPT: usize = 6;
const WORSE: f64 = 9.2;
/// Shares of a place with a bias of an anchor's own and of the best place, at the noise that explains the place best: one that is less than this part of
/// the share that pieces may lack is left out.
const IMPROBABLE: f64 = 0.1;
/// Slices of a place, and of a place of a piece, in its length's deviation.
const SLICES: f64 = 4.0;
const SLICES_OF_A_PIECE: f64 = 2.0;
/// Prior probability that the range of an anchor does not depend on the distance beside that of an outlier.
const BAD_ANCHOR: f64 = 0.01;
/// Probability that an anchor is good before its first range, and after a first range that was an outlier.
const GOOD: f64 = 0.99;
const GOOD_AFTER_OUTLIER: f64 = 0.6;
/// Pieces of an error of scale that the ranges do not determine: middles and common deviation in deviations of its prior, and their weights. Together
/// they have its mean and variance.
const PIECES: [(f64, f64); 5] = [(0.0, 0.375), (-0.8, 0.25), (0.8, 0.25), (-1.6, 0.0625), (1.6, 0.0625)];
const PIECE: f64 = 0.6;
/// Two places are the same if they differ by less than this many deviations.
const SAME: f64 = 1.0;

/// Whether two laws are about the same position.
pub(super) fn is_same(a: &Normal, b: &Normal) -> bool {
    (0..a.axes).all(|i| (a.mean[i] - b.mean[i]).powi(2) <= SAME * SAME * a.variance(i).max(b.variance(i)))
}

/// The hypotheses that explain the latest range of each anchor, the most probable first. None if no place does.
pub(super) fn hypotheses(
    known: &Known,
    anchors: usize,
    calibration: Calibration,
    collected: &[Collected],
) -> Vec<Hypothesis> {
    let mut calibration = calibration;
    if let Some(clock) = known.clock {
        // The middle of the bias: what makes the ranges lengths of the size of the room.
        let mean = collected.iter().map(|one| one.range).sum::<f64>() / collected.len().max(1) as f64;
        calibration[0] = (mean, clock * clock);
    }
    let search = Search {
        known,
        calibration,
        anchors,
    };
    let least = known.axes + 1;
    let typical = known.speeds[known.middle_speed];
    let left = |without: Option<usize>| -> Vec<Collected> {
        collected
            .iter()
            .enumerate()
            .filter(|(i, _)| Some(*i) != without)
            .map(|(_, one)| *one)
            .collect()
    };
    // An outlier, or an anchor whose ranges say nothing, is as probable as `bad`, and its range as `1 / stray`.
    let bad = known.outliers + BAD_ANCHOR;
    let penalty = |without: Option<usize>| {
        let ranges = collected.len() - usize::from(without.is_some());
        let apart = if without.is_some() {
            (bad / known.stray).ln()
        } else {
            0.0
        };
        ranges as f64 * (1.0 - bad).ln() + apart
    };
    let likely = |one: &Found| one.log_evidence + penalty(one.without) + one.log_share();
    // Fewer ranges than unknowns.
    let is_short = |ranges: usize| ranges < known.axes + 2 && calibration[1].1 > 0.0;
    let grid = Grid::new(&search, collected);
    let mut found: Vec<Found> = Vec::new();
    let singles = if collected.len() > least {
        0..collected.len()
    } else {
        0..0
    };
    for without in std::iter::once(None).chain(singles.map(Some)) {
        let ranges = left(without);
        for start in grid.maxima(&search.calibration, without) {
            let Some(best) = search.best(&start, &ranges, without, typical) else {
                continue;
            };
            let twin = found
                .iter_mut()
                .find(|other| other.without == without && is_same(&other.normal, &best.normal));
            match twin {
                Some(twin) if best.log_evidence > twin.log_evidence => *twin = best,
                Some(_) => {}
                None => found.push(best),
            }
        }
    }
    found.sort_by(|a, b| likely(b).total_cmp(&likely(a)));
    let Some(best) = found.first().map(likely) else {
        return Vec::new();
    };
    found.retain(|one| likely(one) > best - WORSE);
    found.truncate(KEPT);
    let mut parts: Vec<(Search<'_>, Found, f64)> = Vec::new();
    for one in found {
        let ranges = left(one.without);
        if is_short(ranges.len()) {
            for (piece, place, log_share) in pieces(&search, &grid, &one, &ranges, typical) {
                let is_known = parts.iter().any(|(other, known, _)| {
                    known.without == place.without
                        && other.calibration == piece.calibration
                        && is_same(&known.normal, &place.normal)
                });
                if is_known {
                    continue;
                }
                let slices = piece.sliced(&place, &ranges, typical, SLICES_OF_A_PIECE);
                let slices = if slices.is_empty() { vec![place] } else { slices };
                parts.extend(slices.into_iter().map(|slice| (piece, slice, log_share)));
            }
            continue;
        }
        let slices = search.sliced(&one, &ranges, typical, SLICES);
        let slices = if slices.is_empty() { vec![one] } else { slices };
        parts.extend(slices.into_iter().map(|slice| (search, slice, 0.0)));
    }
    let odds = |(_, one, log_share): &(Search<'_>, Found, f64)| likely(one) + log_share;
    parts.sort_by(|a, b| odds(b).total_cmp(&odds(a)));
    let best = parts.first().map_or(0.0, odds);
    let weights: Vec<f64> = parts.iter().map(|part| (odds(part) - best).exp()).collect();
    let total: f64 = weights.iter().sum();
    let mut rest = total;
    let counts = weights.iter().take_while(|weight| {
        let is_needed = rest > known.needless * total;
        rest -= *weight;
        is_needed
    });
    let kept = counts.count();
    parts.truncate(kept);
    let mut made: Vec<Made<'_>> = Vec::new();
    let all_good = vec![GOOD; anchors];
    for (search, one, log_share) in &parts {
        let out = one.without.map(|i| collected[i].anchor);
        let some = left(one.without);
        for (variant, (own, probability)) in known.anchor_biases.iter().enumerate() {
            // A bias of an anchor's own is an explanation of its range: it is taken in at a place that the others explain.
            let is_apart = own.only().is_some();
            if is_apart && out.is_some() && out != own.only() {
                continue;
            }
            let (ranges, without) = if is_apart {
                (collected, None)
            } else {
                (&some[..], one.without)
            };
            let log_prior = penalty(without) + probability.ln() + log_share;
            let is_probable = |log_evidence: f64| log_evidence + log_prior > best + (IMPROBABLE * known.needless).ln();
            if is_apart && !search.evidence(one, ranges, *own).is_some_and(is_probable) {
                continue;
            }
            if let Some(bank) = search.bank(one, ranges, *own) {
                made.push(Made {
                    log_weight: bank.log_evidence + log_prior,
                    search,
                    one,
                    without,
                    variant,
                    bank,
                });
            }
        }
    }
    made.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
    let highest = made.first().map_or(0.0, |one| one.log_weight);
    let total: f64 = made.iter().map(|one| (one.log_weight - highest).exp()).sum();
    made.retain(|one| is_worth(one.log_weight - highest, known.negligible));
    let mut all = Vec::with_capacity(made.len());
    for made in made {
        let (own, _) = known.anchor_biases[made.variant];
        let out = made.without.map(|i| collected[i].anchor);
        let mut good = all_good.clone();
        out.into_iter().for_each(|out| good[out] = GOOD_AFTER_OUTLIER);
        let some = left(made.without);
        // One of which an anchor is apart may be improbable for long, and then needs all of its filters.
        let is_apart = own.only().is_some();
        let share = if is_apart {
            1.0
        } else {
            (made.log_weight - highest).exp() / total
        };
        let least = known.least_weight(share);
        let (filters, weights) = made.search.laws(&made.bank, made.one, &some, own, least);
        if weights.iter().all(|weight| weight.is_finite()) {
            let mut hypothesis = Hypothesis::new(made.log_weight, filters, weights, good, made.variant);
            hypothesis.is_cut = is_short(some.len() - usize::from(is_apart));
            hypothesis.apart = own.only();
            all.push(hypothesis);
        }
    }
    all
}

/// A hypothesis before the laws of its filters are built.
struct Made<'a> {
    log_weight: f64,
    search: &'a Search<'a>,
    one: &'a Found,
    without: Option<usize>,
    variant: usize,
    bank: Bank,
}

/// A place cut by the error of scale: what each piece is searched with, the places, and `ln` of the piece's share. A curve may have two places
/// for one error of scale, or none.
fn pieces<'a>(
    search: &Search<'a>,
    grid: &Grid<'_>,
    one: &Found,
    ranges: &[Collected],
    typical: f64,
) -> Vec<(Search<'a>, Found, f64)> {
    let [bias, (middle, variance)] = search.calibration;
    let deviation = variance.sqrt();
    let mut found: Vec<(Search<'a>, Found, f64)> = Vec::new();
    for (off, share) in PIECES {
        let scale = (middle + off * deviation, (PIECE * deviation).powi(2));
        let piece = Search {
            calibration: [bias, scale],
            ..*search
        };
        let mut own: Vec<Found> = Vec::new();
        let starts = grid
            .maxima(&piece.calibration, one.without)
            .into_iter()
            .map(|start| start.to_vec());
        for start in starts.chain([one.normal.mean.clone()]) {
            if let Some(place) = piece.best(&start, ranges, one.without, typical)
                && !own.iter().any(|known| is_same(&known.normal, &place.normal))
            {
                own.push(place);
            }
        }
        found.extend(own.into_iter().map(|place| (piece, place, share.ln())));
    }
    found
}
