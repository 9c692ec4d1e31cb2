//! Biases of single anchors that walk: clocks that drift, people and shelves that come and go before anchors.
//!
//! Residuals of constant biases are independent from range to range. Where the latest ones are not, copies of the best hypothesis are added in which
//! each anchor has a bias of its own that is forgotten after a while, and the next ranges decide.

use super::bank::Hypothesis;
use super::residuals::Residuals;
use super::settings::Known;
use super::walk::Walk;

/// Deviations of the biases as multiples of the root of the mean product of neighbouring residuals, and ranges of an anchor after which its bias is
/// forgotten. A slow walk is taken for motion, so that residuals show a small part of it.
const WALKS: [(f64, f64); 3] = [(1.5, 6.0), (1.5, 50.0), (3.0, 200.0)];
/// They are at most this share of the spread of the anchors: larger ones explain a wrong place.
const LARGEST: f64 = 0.05;
/// Share of the best hypothesis that each copy takes.
const TAKEN: f64 = 0.02;
/// Copies are added from this mean product of neighbouring residuals on, in their deviations, if it is above zero by so many of its own.
const LASTING: f64 = 0.15;
const SURE: f64 = 4.0;

/// The hypotheses with walking biases that the latest residuals ask for, whose numbers begin with `variant`. Their shares are taken off the best one.
/// While others of which that is not known are there, none are added.
pub(super) fn with_walks(
    known: &Known,
    hypotheses: &mut [Hypothesis],
    residuals: &mut [Residuals],
    variant: usize,
) -> Vec<Hypothesis> {
    let best = hypotheses
        .iter()
        .max_by(|one, other| one.log_share().total_cmp(&other.log_share()))
        .map(|best| best.variant);
    if hypotheses
        .iter()
        .any(|one| one.walk.is_some() && Some(one.variant) != best)
    {
        return Vec::new();
    }
    let (mut sum, mut variance, mut weight, mut squares, mut seconds) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for one in residuals.iter() {
        sum += one.recent.sum;
        variance += one.recent.variance;
        weight += one.recent.weight;
        squares += one.recent.squares;
        seconds += one.recent.seconds;
    }
    if variance <= 0.0 || sum < LASTING * weight || sum < SURE * variance.sqrt() || squares <= 0.0 || seconds <= 0.0 {
        return Vec::new();
    }
    let found = (squares / weight).sqrt();
    residuals.iter_mut().for_each(Residuals::forget_recent);
    let Some(best) = hypotheses
        .iter_mut()
        .max_by(|one, other| one.log_share().total_cmp(&other.log_share()))
    else {
        return Vec::new();
    };
    let anchors = best.good.len();
    // What walks already is too little.
    let before = best.walk.map_or(0.0, |walk| walk.deviation);
    let largest = LARGEST * known.size;
    // More anchors than the state has unknowns: with fewer, biases that walk explain anything.
    if before >= largest || best.usable(|_| true) <= known.axes + 2 {
        return Vec::new();
    }
    let made = WALKS.iter().enumerate().map(|(number, (times, ranges))| {
        let deviation = (times * found).hypot(before).min(largest);
        let mut copy = best.clone();
        copy.log_weight += TAKEN.ln();
        copy.walk = Some(Walk {
            deviation,
            seconds: ranges * seconds / weight,
        });
        (copy.variant, copy.apart) = (variant + number, None);
        for i in &copy.alive {
            copy.filters[*i].give_biases(anchors, deviation * deviation);
        }
        copy
    });
    let made: Vec<Hypothesis> = made.collect();
    best.log_weight += (1.0 - TAKEN * WALKS.len() as f64).ln();
    made
}
