//! First guesses.

use super::Request;
use super::model::{LevelModel, SensorModel, Spread};
use crate::Error;
use crate::calibration::{Instant, Reading, median};
use fewbits_numerics::error::positive;

/// Delays in intervals between readings: so many are tried in the search, and so many by a line.
const NEAR_DELAYS: i32 = 48;
const FARTHEST_DELAYS: i32 = 512;
/// Values by which these are compared, about.
const SOME: usize = 1000;

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
    let mut sensors = vec![SensorModel::exact(0.3 * wide); series.len()];
    let mut ratios = vec![None; series.len()];
    for (sensor, values) in series.iter().enumerate() {
        let model = &mut sensors[sensor];
        if values.is_empty() {
            model.bias = -threshold(instants, sensor, &series[anchor]).unwrap_or(middle);
        } else {
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
    let with_gains = |sign: &Option<f64>, delays: &[f64]| {
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
            let pairs = beside(&earlier(values, delays[sensor]), &series[anchor]);
            let one = &mut model.sensors[sensor];
            one.delay = delays[sensor];
            if let Some(ratio) = ratios[sensor] {
                one.gain = sign.map_or_else(|| line(&pairs).unwrap_or(ratio), |sign| sign * ratio);
            }
            one.bias = median(pairs.iter().map(|(level, value)| value - one.gain * level).collect());
        }
        model
    };
    let mut delays = vec![vec![0.0; series.len()]];
    if request.delay {
        let far = |(sensor, values): (usize, &Vec<(f64, f64)>)| match sensor == anchor {
            true => 0.0,
            false => far_delay(values, &series[anchor], interval, request.gain),
        };
        delays.push(series.iter().enumerate().map(far).collect());
        delays.dedup();
    }
    Ok(delays
        .iter()
        .flat_map(|delays| signs.iter().map(|sign| with_gains(sign, delays)))
        .collect())
}

fn earlier(values: &Series, delay: f64) -> Vec<(f64, f64)> {
    values.iter().map(|one| (one.0 - delay, one.1)).collect()
}

/// The delay at which a line through the values of another sensor leaves least, if it is beyond what the search tries by itself: [`NEAR_DELAYS`]
/// intervals. Half of the values must have another one beside them.
fn far_delay(values: &Series, other: &Series, interval: f64, has_gain: bool) -> f64 {
    let (Some(first), Some(last)) = (other.first(), other.last()) else {
        return 0.0;
    };
    // Of many values some suffice.
    let some: Vec<(f64, f64)> = values.iter().step_by(values.len() / SOME + 1).copied().collect();
    let left = |steps: i32| {
        let delay = f64::from(steps) * interval;
        let mut moved = earlier(&some, delay);
        moved.retain(|one| (first.0..=last.0).contains(&one.0));
        let pairs = beside(&moved, other);
        let count = pairs.len() as f64;
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
        let (level, value) = (mean(&|one| one.0), mean(&|one| one.1));
        let product = mean(&|one| (one.0 - level) * (one.1 - value));
        let gain = if has_gain {
            product / mean(&|one| (one.0 - level).powi(2))
        } else {
            1.0
        };
        let off = mean(&|one| (one.1 - value - gain * (one.0 - level)).powi(2));
        (2 * pairs.len() >= some.len() && off.is_finite()).then_some((off, steps))
    };
    let found = (-FARTHEST_DELAYS..=FARTHEST_DELAYS).filter_map(left);
    let best = found
        .min_by(|one, other| one.0.total_cmp(&other.0))
        .map_or(0, |best| best.1);
    if best.abs() > NEAR_DELAYS {
        f64::from(best) * interval
    } else {
        0.0
    }
}

/// The threshold above which another sensor's values are as often as a sensor's bits say, whatever the delay.
fn threshold(instants: &[Instant], sensor: usize, other: &Series) -> Option<f64> {
    let bits = instants.iter().flat_map(|instant| {
        let own = instant.values.iter().filter(|one| one.0 == sensor);
        own.map(|one| (instant.seconds, if one.1 == Reading::bit(true) { 1.0 } else { 0.0 }))
    });
    let (mut levels, above): (Vec<f64>, Vec<f64>) = beside(&bits.collect::<Vec<_>>(), other).into_iter().unzip();
    let below = levels.len() as f64 - above.iter().sum::<f64>();
    levels.sort_by(f64::total_cmp);
    levels
        .get((below as usize).min(levels.len().saturating_sub(1)))
        .copied()
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
