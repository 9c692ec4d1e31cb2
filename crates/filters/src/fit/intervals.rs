//! Intervals of parameters in which the likelihood is no parabola.

use super::errors::Spread;
use super::parameters::{DEVIATIONS, Estimate, Quantity};
use super::problem::{LONG, Problem};
use fewbits_numerics::normal::cdf;
use nalgebra::{DMatrix, DVector};

/// Nats by which the likelihood is below the most at the ends of an interval.
const NATS: f64 = 0.5 * DEVIATIONS * DEVIATIONS;
/// Share outside of an interval.
const OUTSIDE: f64 = 0.05;
/// Deviations beyond which no quantile is looked for, and halvings of a search.
const FARTHEST: f64 = 8.0;
const HALVINGS: usize = 60;
/// Of a time constant whose logarithm has a smaller deviation the likelihood is a parabola.
const CERTAIN: f64 = 0.1;
/// Time constants beside the one that was found, in its deviations, at most.
const BESIDE: usize = 12;
/// Step of the differences, in units of the search.
const STEP: f64 = 0.05;

/// A parabola in the mean of the level: its middle and deviation from what was found, and the value there.
struct Parabola {
    middle: f64,
    deviation: f64,
    value: f64,
}

impl Parabola {
    /// What the readings say of the time constant whatever the mean is: an average over means, since a mean that is found makes the level return too soon.
    fn told(&self) -> f64 {
        self.value + self.deviation.ln()
    }
}

impl Problem<'_> {
    /// States the limits of a level that returns, from the profile of the likelihood over time constants: the longer that is, the less the readings tell of
    /// the mean. The other parameters follow by one step of Newton from one time constant to the next.
    pub(super) fn limits(&self, spread: &Spread, estimates: &mut [Estimate]) {
        let place = |quantity| spread.determined.iter().position(|i| self.free[*i] == quantity);
        let (Some(time), Some(mean)) = (place(Quantity::TimeConstant), place(Quantity::Mean)) else {
            return;
        };
        let deviation = spread.factor.row(time).norm();
        if deviation < CERTAIN {
            return;
        }
        let others: Vec<usize> = (0..spread.determined.len())
            .filter(|i| ![time, mean].contains(i))
            .collect();
        let Some(covariance) = beside(spread, &others) else {
            return;
        };
        let worth = |moves: &DVector<f64>| {
            let mut point = DVector::zeros(self.free.len());
            spread
                .determined
                .iter()
                .zip(moves.iter())
                .for_each(|(i, by)| point[*i] = *by);
            self.worth(&self.at(&point))
        };
        let moved = |at: &DVector<f64>, i: usize, step: f64| {
            let value = |by: f64| {
                let mut other = at.clone();
                other[i] += by;
                worth(&other)
            };
            (value(step), value(-step))
        };
        let parabola = |at: &DVector<f64>, most: f64| {
            let (above, below) = moved(at, mean, STEP);
            let bent = (2.0 * most - above - below) / (STEP * STEP);
            let slope = (above - below) / (2.0 * STEP);
            (bent > 0.0 && bent.is_finite() && slope.is_finite()).then(|| Parabola {
                middle: at[mean] + slope / bent,
                deviation: bent.sqrt().recip(),
                value: most + 0.5 * slope * slope / bent,
            })
        };
        let origin = DVector::zeros(spread.determined.len());
        let Some(here) = parabola(&origin, worth(&origin)) else {
            return;
        };
        // Time, and the parabola there, from the shortest to the longest.
        let mut profile = vec![(0.0, here)];
        for side in [-deviation, deviation] {
            let mut at = origin.clone();
            for _ in 0..BESIDE {
                at[time] += side;
                let plain = worth(&at);
                let slopes = others.iter().map(|i| {
                    let step = STEP * spread.factor.row(*i).norm();
                    let (above, below) = moved(&at, *i, step);
                    (above - below) / (2.0 * step)
                });
                let step = &covariance * DVector::from_iterator(others.len(), slopes);
                let mut next = at.clone();
                others.iter().zip(step.iter()).for_each(|(i, by)| next[*i] += by);
                let most = worth(&next);
                let most = if most > plain {
                    at = next;
                    most
                } else {
                    plain
                };
                let Some(found) = parabola(&at, most) else { break };
                at[mean] = found.middle;
                let is_far = found.told() < profile[0].1.told() - 2.0 * NATS;
                profile.push((at[time], found));
                if is_far {
                    break;
                }
            }
        }
        profile.sort_by(|one, other| one.0.total_cmp(&other.0));
        let ends = ends(&profile);
        profile.retain(|one| one.0 >= ends[0].min(0.0) && one.0 <= ends[1].max(0.0));
        let (low, high) = (quantile(&profile, 0.5 * OUTSIDE), quantile(&profile, 1.0 - 0.5 * OUTSIDE));
        for one in estimates {
            let half = DEVIATIONS * one.standard_error;
            let (low, high) = match one.quantity {
                Quantity::TimeConstant => {
                    let longest = (LONG * self.length).max(one.value);
                    (one.value * ends[0].exp(), (one.value * ends[1].exp()).min(longest))
                }
                Quantity::Mean => {
                    let unit = self.unit(one.quantity);
                    ((one.value + low * unit).min(one.value - half), (one.value + high * unit).max(one.value + half))
                }
                _ => continue,
            };
            one.limits = Some((low.min(one.value), high.max(one.value)));
        }
    }
}

/// Where the likelihood of the time, averaged over means, is below the most by [`NATS`].
fn ends(profile: &[(f64, Parabola)]) -> [f64; 2] {
    let told = |i: usize| profile[i].1.told();
    let most = (0..profile.len()).map(told).fold(f64::NEG_INFINITY, f64::max);
    let nats = |i: usize| NATS - (most - told(i));
    let within: Vec<usize> = (0..profile.len()).filter(|i| nats(*i) > 0.0).collect();
    let (first, last) = (within.first().copied().unwrap_or(0), within.last().copied().unwrap_or(0));
    let end = |inner: usize, outer: Option<usize>| match outer.filter(|outer| *outer < profile.len()) {
        Some(outer) => {
            let share = nats(inner) / (nats(inner) - nats(outer));
            profile[inner].0 + share * (profile[outer].0 - profile[inner].0)
        }
        None => profile[inner].0,
    };
    [end(first, first.checked_sub(1)), end(last, Some(last + 1))]
}

/// A quantile of the mean over time constants: of normal distributions, weighted by what the readings say of each.
fn quantile(profile: &[(f64, Parabola)], share: f64) -> f64 {
    let most = profile.iter().map(|one| one.1.told()).fold(f64::NEG_INFINITY, f64::max);
    let weight = |one: &Parabola| (one.told() - most).exp();
    let all: f64 = profile.iter().map(|one| weight(&one.1)).sum();
    let below = |at: f64| {
        let of = |one: &Parabola| weight(one) * cdf((at - one.middle) / one.deviation);
        profile.iter().map(|one| of(&one.1)).sum::<f64>() / all
    };
    let edge = |side: f64| {
        let of = profile
            .iter()
            .map(|one| one.1.middle + side * FARTHEST * one.1.deviation);
        of.fold(side * f64::NEG_INFINITY, if side > 0.0 { f64::max } else { f64::min })
    };
    let (mut low, mut high) = (edge(-1.0), edge(1.0));
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if below(middle) < share {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// The covariance of some of the parameters that are determined while the others are held.
fn beside(spread: &Spread, some: &[usize]) -> Option<DMatrix<f64>> {
    let covariance = &spread.factor * spread.factor.transpose();
    let information = covariance.try_inverse()?;
    DMatrix::from_fn(some.len(), some.len(), |i, j| information[(some[i], some[j])]).try_inverse()
}
