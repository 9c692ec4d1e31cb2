//! The maximum of the posterior density, which may have several peaks and plateaus.

use crate::observation::bank::Bank;
use crate::observation::source::Kind;
use fewbits_numerics::golden::maximum;
use fewbits_numerics::normal::log_pdf;

/// Smallest number of points of the scan.
const POINTS: usize = 4001;
/// Largest number of points of the scan.
const MAX_POINTS: usize = 64_001;
/// Number of points per noise standard deviation.
const PER_NOISE: f64 = 8.0;
/// Log densities closer than this belong to the same plateau.
const PLATEAU: f64 = 1e-12;
/// Relative width at which golden-section search stops.
const GOLDEN_STOP: f64 = 1e-10;

/// For each outcome, the argument of the largest posterior density.
///
/// A dense scan finds the highest peak; a golden-section search refines it. On a plateau the estimate is its midpoint.
pub(crate) fn estimates(bank: &Bank, outcomes: usize) -> Vec<f64> {
    let reach = bank.source().reach();
    let intervals = (PER_NOISE * 2.0 * reach / bank.finest_noise()).min(MAX_POINTS as f64 - 1.0) as usize;
    // An even number of intervals, so that zero and both ends are points of the scan.
    let intervals = intervals.max(POINTS - 1).next_multiple_of(2);
    let points: Vec<f64> = (0..=intervals)
        .map(|i| reach * (2.0 * i as f64 - intervals as f64) / intervals as f64)
        .collect();
    let rows = bank.log_rows(&points);
    let prior = |x: f64| match bank.source().kind() {
        Kind::Uniform { .. } => 0.0,
        Kind::Gaussian { deviation } => log_pdf(x / deviation),
    };
    let log_prior: Vec<f64> = points.iter().map(|&x| prior(x)).collect();
    let mut counts = Vec::new();
    let mut score = vec![0.0; points.len()];
    (0..outcomes)
        .map(|index| {
            bank.counts_at(index, &mut counts);
            bank.log_likelihood(&rows, &counts, &mut score);
            score.iter_mut().zip(&log_prior).for_each(|(s, p)| *s += p);
            let best = score.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let enough = best - PLATEAU * best.abs().max(1.0);
            let first = score.iter().position(|&s| s >= enough).unwrap_or(0);
            let last = (first..points.len())
                .take_while(|&i| score[i] >= enough)
                .last()
                .unwrap_or(first);
            // Four neighbours are as high only on a plateau: about a smooth peak at most two are.
            if last > first + 2 {
                return 0.5 * (points[first] + points[last]);
            }
            // Between the points on either side the log posterior is unimodal, so the golden-section search finds its peak.
            let posterior = |x: f64| {
                bank.groups().iter().zip(&counts).fold(prior(x), |sum, (g, &ones)| {
                    let [l0, l1] = g.sensor.log_probabilities(x);
                    sum + ones as f64 * l1 + (g.count - ones) as f64 * l0
                })
            };
            maximum(posterior, points[first.saturating_sub(1)], points[(last + 1).min(points.len() - 1)], GOLDEN_STOP).0
        })
        .collect()
}
