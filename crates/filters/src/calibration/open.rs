//! How far the readings leave open what was found, and with it how far off the level is.
//!
//! ```text
//! theta   logarithms of the change and of the noises of the most precise sensors
//! C       inverse of the curvature of ln p(all readings | theta), which is at least that of a standard normal density
//! g       gradient of the logarithm of the level's deviation, which is a mean over the instants
//! open    sqrt(g' C g)
//! ```

use super::{Instant, Level, Number};
use crate::Error;
use fewbits_core::Evolution;
use nalgebra::{DMatrix, DVector};

/// Distance at which differences are taken, in `ln`.
const STEP: f64 = 0.2;
/// Sensors whose noises are looked at. Where there are more, the level rests on no single one.
const SENSORS: usize = 3;

/// What the readings leave open.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Openness {
    /// Standard deviation of the logarithm of the level's standard deviation.
    pub of_level: f64,
    /// The number to which most of it is due: a sensor's noise, or the change if `None`.
    pub number: Option<usize>,
    /// Standard deviation of the logarithm of that number.
    pub of_number: f64,
}

impl<W, E, const D: usize> Level<'_, W, D>
where
    W: Fn(f64) -> Result<E, Error>,
    E: Evolution<D>,
{
    /// What the readings leave open of the level's standard deviation, since unknown numbers were found from them. The guesses are what was found.
    /// `None` if no number is unknown, or if numbers run out of range.
    ///
    /// # Errors
    /// As [`calibrate`](Self::calibrate).
    pub fn openness(&self, instants: &[Instant], change: Number, noises: &[Number]) -> Result<Option<Openness>, Error> {
        let (counts, range) = self.checked(instants, change, noises)?;
        let precision = |sensor: usize| counts[sensor] as f64 / noises[sensor].start().powi(2);
        let mut precise: Vec<usize> = (0..noises.len())
            .filter(|sensor| noises[*sensor].is_unknown() && counts[*sensor] > 0)
            .collect();
        precise.sort_by(|one, other| precision(*other).total_cmp(&precision(*one)));
        precise.truncate(SENSORS);
        let own_change = change.is_unknown().then_some(None);
        let axes: Vec<Option<usize>> = own_change.into_iter().chain(precise.into_iter().map(Some)).collect();
        let start: Vec<f64> = noises.iter().map(Number::start).collect();
        let at = |moves: &[(usize, f64)]| {
            let (mut change, mut noises) = (change.start(), start.clone());
            for (axis, by) in moves {
                let number = axes[*axis].map_or(&mut change, |sensor| &mut noises[sensor]);
                *number *= by.exp();
            }
            self.pass(instants, range, change, &noises)
        };
        Ok(openness(&axes, at).filter(|found| found.of_level.is_finite()))
    }
}

/// `at`: `ln p` and the logarithm of the level's deviation where some of the axes are moved.
fn openness(axes: &[Option<usize>], at: impl Fn(&[(usize, f64)]) -> Option<(f64, f64)>) -> Option<Openness> {
    let count = axes.len();
    if count == 0 {
        return None;
    }
    let here = at(&[])?.0;
    let mut curvature = DMatrix::zeros(count, count);
    let mut gradient = DVector::zeros(count);
    for i in 0..count {
        let (above, below) = (at(&[(i, STEP)])?, at(&[(i, -STEP)])?);
        curvature[(i, i)] = (2.0 * here - above.0 - below.0) / (STEP * STEP);
        gradient[i] = (above.1 - below.1) / (2.0 * STEP);
    }
    for i in 0..count {
        for j in 0..i {
            let (above, below) = (at(&[(i, STEP), (j, STEP)])?, at(&[(i, -STEP), (j, -STEP)])?);
            let both = (2.0 * here - above.0 - below.0) / (STEP * STEP);
            curvature[(i, j)] = 0.5 * (both - curvature[(i, i)] - curvature[(j, j)]);
            curvature[(j, i)] = curvature[(i, j)];
        }
    }
    // Beside a maximum, where the number may as well be 0, the likelihood bends the other way.
    let mut parts = curvature.symmetric_eigen();
    parts.eigenvalues.apply(|one| *one = 1.0 / (one.max(0.0) + 1.0));
    let covariance = parts.recompose();
    let share = |i: usize| gradient[i].abs() * covariance[(i, i)].sqrt();
    let most = (0..count).max_by(|one, other| share(*one).total_cmp(&share(*other)))?;
    Some(Openness {
        of_level: gradient.dot(&(&covariance * &gradient)).sqrt(),
        number: axes[most],
        of_number: covariance[(most, most)].sqrt(),
    })
}
