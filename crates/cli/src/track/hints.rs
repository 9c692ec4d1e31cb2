//! What the first rows of a table suggest that no option says.

use super::rows::Instant;
use crate::arguments::{Model, TrackOptions};
use fewbits_filters::calibration::median;

/// Periods of angles and their like.
const PERIODS: [f64; 4] = [360.0, std::f64::consts::TAU, 400.0, 24.0];
/// Two values this share of a period apart are near each other on the circle.
const NEARLY: f64 = 0.8;
/// Values between which silence is looked at, at least, and share of empty cells.
const FEWEST: usize = 3;
const EMPTY: f64 = 0.5;
/// An offset is told if it is this many of the sensor's deviations.
const LARGE: f64 = 1.0;

/// Hints, a line each.
/// `noises` and `offsets`: of each sensor. `has_slope`: a slope explains the first rows far better.
pub(super) fn hints(
    options: &TrackOptions,
    first: &[Instant],
    names: &[String],
    (noises, offsets): (&[f64], &[f64]),
    has_slope: bool,
) -> Vec<String> {
    let mut lines = Vec::new();
    if options.reports {
        return lines;
    }
    for (sensor, name) in names.iter().enumerate() {
        let cells: Vec<Option<f64>> = first
            .iter()
            .flat_map(|instant| &instant.reports)
            .filter(|(other, _)| *other == sensor)
            .map(|(_, cell)| cell.filter(|cell| cell.is_finite()))
            .collect();
        let values: Vec<f64> = cells.iter().copied().flatten().collect();
        let steps: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
        if options.period.is_none()
            && let Some(period) = turns(&values, &steps)
        {
            lines.push(format!(
                "{name} jumps by nearly {period} and back: if it is an angle, say --period {period}; without it these estimates are wrong"
            ));
        }
        let silent = (cells.len() - values.len()) as f64;
        let least = steps.iter().fold(f64::INFINITY, |least, step| least.min(*step));
        let typical = median(steps.clone());
        if options.silent_within.is_none()
            && values.len() >= FEWEST
            && silent > EMPTY * cells.len() as f64
            && least > 0.5 * typical
        {
            lines.push(format!(
                "{name} has values in {} of {} cells, each at least {least:.3} from the one before: if it sends on change, say \
                 --silent-within {least:.3}; without it the bands are wrong",
                values.len(),
                cells.len()
            ));
        }
    }
    let large = |(sensor, offset): (usize, &f64)| offset.abs() > LARGE * noises[sensor];
    if names.len() == 2 && offsets.iter().enumerate().any(large) {
        let apart = (offsets[0] - offsets[1]).abs();
        lines.push(format!(
            "the two sensors are {apart:.3} apart, and nothing says which is right: the level is taken to be in the middle, and may be {:.3} off",
            0.5 * apart
        ));
    }
    if options.model == Model::Walk && has_slope {
        lines.push("the first rows have a slope: --model velocity explains them far better".to_owned());
    }
    lines
}

/// The period whose ends the values cross, if there is one.
fn turns(values: &[f64], steps: &[f64]) -> Option<f64> {
    let (low, high) = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)));
    PERIODS.into_iter().find(|period| {
        let is_inside = low >= 0.0 && high <= *period || low >= -0.5 * period && high <= 0.5 * period;
        let crossings = steps.iter().filter(|step| **step > NEARLY * period).count();
        is_inside && crossings >= 2 && 2 * crossings < steps.len()
    })
}
