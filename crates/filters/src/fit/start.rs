//! First guesses.

use super::Request;
use super::model::{LevelModel, SensorModel, Spread};
use crate::Error;
use crate::calibration::{Instant, median};
use fewbits_numerics::error::positive;

/// Readings by time.
type Series = [(f64, f64)];

/// First guesses, with other gains if these are looked for.
pub(super) fn starts(
    series: &[Vec<(f64, f64)>],
    instants: &[Instant],
    anchor: usize,
    request: &Request,
) -> Result<Vec<LevelModel>, Error> {
    let numbers = |values: &Series| values.iter().map(|one| one.1).collect::<Vec<f64>>();
    let level = Spread::of(numbers(&series[anchor]));
    let middle = level.map_or_else(|| median(numbers(&series[anchor])), |level| level.middle);
    let wide = level.map_or(1.0, |level| level.spread);
    let own = rough(&series[anchor], wide);
    // Of bits, the level is as often above the threshold as below it.
    let mut sensors = vec![
        SensorModel {
            bias: -middle,
            ..SensorModel::exact(0.3 * wide)
        };
        series.len()
    ];
    let mut ratios = vec![None; series.len()];
    for (sensor, values) in series.iter().enumerate() {
        let model = &mut sensors[sensor];
        if !values.is_empty() {
            let spread = Spread::of(numbers(values)).map_or(wide, |own| own.spread);
            *model = SensorModel::exact(0.7 * rough(values, spread));
            if sensor != anchor && request.gain {
                ratios[sensor] = Some(spread / wide);
            }
        }
        if let Some(known) = request.noises.get(sensor).copied().flatten() {
            model.noise = positive("noises", known)?;
        }
    }
    sensors[anchor].bias = 0.0;
    let gaps = instants.windows(2).map(|pair| pair[1].seconds - pair[0].seconds);
    let interval = median(gaps.collect());
    let interval = if interval > 0.0 { interval } else { 1.0 };
    // The gain of a line, and where the sensor is so late that a line shows none, that of the widths with either sign.
    let signs: &[Option<f64>] = match request.gain {
        true => &[None, Some(1.0), Some(-1.0)],
        false => &[None],
    };
    let with_gains = |sign: &Option<f64>| {
        let mut model = LevelModel {
            change: 0.3 * own / interval.sqrt(),
            time_constant: None,
            mean: middle,
            sensors: sensors.clone(),
        };
        for (sensor, values) in series.iter().enumerate() {
            if sensor == anchor || values.is_empty() {
                continue;
            }
            let pairs = beside(values, &series[anchor]);
            let one = &mut model.sensors[sensor];
            if let Some(ratio) = ratios[sensor] {
                one.gain = sign.map_or_else(|| line(&pairs).unwrap_or(ratio), |sign| sign * ratio);
            }
            one.bias = median(pairs.iter().map(|(level, value)| value - one.gain * level).collect());
        }
        model
    };
    Ok(signs.iter().map(with_gains).collect())
}

/// The noise of a sensor if its level did not change, from the median of its steps or their mean size. `wide`: the width of all values.
fn rough(values: &Series, wide: f64) -> f64 {
    let steps: Vec<f64> = values.windows(2).map(|pair| (pair[1].1 - pair[0].1).abs()).collect();
    let mean = steps.iter().sum::<f64>() / (steps.len() as f64).max(1.0);
    let typical = median(steps);
    // The deviation of a difference.
    let size = if typical > 0.0 { typical / 0.6745 } else { mean * 1.2533 };
    if size > 0.0 {
        size / std::f64::consts::SQRT_2
    } else {
        0.1 * wide
    }
}

/// What another sensor reads at the times of these values, on the line between its two values about them, and the values.
fn beside(values: &Series, other: &Series) -> Vec<(f64, f64)> {
    let at = |seconds: f64| {
        let next = other.partition_point(|one| one.0 < seconds);
        match (next.checked_sub(1).map(|before| other[before]), other.get(next)) {
            (Some(before), Some(after)) => {
                let share = (seconds - before.0) / (after.0 - before.0);
                Some(before.1 + share * (after.1 - before.1))
            }
            (Some(only), None) => Some(only.1),
            (None, only) => only.map(|only| only.1),
        }
    };
    values.iter().filter_map(|one| Some((at(one.0)?, one.1))).collect()
}

/// The slope of Tukey's resistant line, between the medians of the lower and the upper third. `None` if the level does not vary.
fn line(pairs: &[(f64, f64)]) -> Option<f64> {
    let mut sorted = pairs.to_vec();
    sorted.sort_by(|one, other| one.0.total_cmp(&other.0));
    let third = sorted.len() / 3;
    let middle = |part: &[(f64, f64)]| {
        let of = |pick: fn(&(f64, f64)) -> f64| median(part.iter().map(pick).collect());
        (of(|one| one.0), of(|one| one.1))
    };
    let (low, high) = (middle(&sorted[..third]), middle(&sorted[sorted.len() - third..]));
    let slope = (high.1 - low.1) / (high.0 - low.0);
    (slope.is_finite() && slope != 0.0).then_some(slope)
}
