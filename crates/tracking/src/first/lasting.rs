//! Noise that lasts from row to row: its size and memory from the differences between sensors, and the error of an estimate under it.
//!
//! ```text
//! sensor    level + lasting + plain,  lasting(k) = rho lasting(k - 1) + innovation
//! found     differences of two sensors hold no level: their autocovariances are sums of those of both;
//!           the level's change from the differences of the mean over several rows, less those of the noise
//! error     of the filter that takes the noise as independent, gains K:  e(k) = (1 - sum K) (e(k-1) - step) + sum K (lasting + plain),
//!           whose covariance with the lasting parts is followed exactly
//! ```
//! The filter is not the best under such noise; its error is stated as large as it is.

use crate::first::groups::{centred, present, whole};
use crate::first::values::values_of;
use crate::rows::instant::Instant;
use nalgebra::{DMatrix, DVector};

/// Rows with values of all sensors from which anything is found.
const FEWEST: usize = 150;
/// Least correlation of successive values of a difference, and in deviations of what chance makes.
const LEAST: f64 = 0.3;
const CHANCE: f64 = 4.0;
/// Largest correlation with the value a fifth of the rows later, as a share of that with the next: what is more alike drifts or jumps.
const STAYS: f64 = 0.25;
/// Largest ratio of the squares of so many parts of the rows.
const UNLIKE: f64 = 5.0;
const PARTS: usize = 4;
/// Largest memory, and the share of the first correlation down to which it is found.
const LARGEST: f64 = 0.995;
const SMALL: f64 = 0.25;
/// Most sensors that are compared with each other.
const GROUP: usize = 16;
/// Rows over which the level's change is found.
const LAGS: [usize; 6] = [1, 2, 4, 8, 16, 32];

/// Noise of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Parts {
    /// Variances of the part that lasts, and of the other one.
    pub(crate) lasting: f64,
    pub(crate) plain: f64,
    /// Correlation of the first part with itself a row later.
    pub(crate) rho: f64,
}

/// Of all sensors, and the variance of the level's change from row to row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Lasting {
    pub(crate) parts: Vec<Parts>,
    pub(crate) change: f64,
}

/// Finds noise that lasts, if any sensor has it.
pub(crate) fn lasting(rows: &[Instant], sensors: usize) -> Option<Lasting> {
    let present = present(rows, sensors);
    let whole = whole(rows, &present);
    let (all, sensors, n) = (sensors, present.len(), whole.len());
    if sensors < 2 || n < FEWEST || 10 * n < 9 * rows.len() {
        return None;
    }
    let columns: Vec<Vec<f64>> = present.iter().map(|sensor| values_of(&whole, *sensor)).collect();
    // Of many sensors each is compared with those of its group.
    let groups = sensors.div_ceil(GROUP);
    let ends: Vec<usize> = (0..=groups).map(|group| group * sensors / groups).collect();
    let parts: Vec<Vec<Parts>> = ends
        .windows(2)
        .map(|ends| parts_of(&columns[ends[0]..ends[1]]))
        .collect::<Option<_>>()?;
    let parts = parts.concat();
    if parts.iter().all(|one| one.lasting == 0.0) {
        return None;
    }
    let change = change(&columns, &parts);
    // A sensor without values has any noise.
    let of = |sensor: usize| parts[present.iter().position(|one| *one == sensor).unwrap_or(0)];
    Some(Lasting {
        parts: (0..all).map(of).collect(),
        change,
    })
}

/// The parts of the noise of each sensor, from their differences; `None` if one is not the same throughout.
fn parts_of(columns: &[Vec<f64>]) -> Option<Vec<Parts>> {
    let (sensors, n) = (columns.len(), columns[0].len());
    let far = n / 5;
    let mut sums = vec![vec![0.0; far + 1]; sensors];
    let mut total = vec![0.0; far + 1];
    let mut squares = vec![0.0; sensors];
    for i in 0..sensors {
        for j in 0..i {
            let difference: Vec<f64> = columns[i]
                .iter()
                .zip(&columns[j])
                .map(|(one, other)| one - other)
                .collect();
            let found = autocovariances(&difference, far)?;
            squares[i] += found[0] * found[0];
            squares[j] += found[0] * found[0];
            for (lag, found) in found.into_iter().enumerate() {
                sums[i][lag] += found;
                sums[j][lag] += found;
                total[lag] += found / (sensors as f64 - 1.0);
            }
        }
    }
    let own = |sensor: usize| -> Vec<f64> {
        let all = sums[sensor].iter().zip(&total);
        all.map(|(sum, total)| {
            if sensors == 2 {
                0.5 * sum
            } else {
                (sum - total) / (sensors as f64 - 2.0)
            }
        })
        .collect()
    };
    // The deviation that chance makes of an autocovariance.
    let shares = if sensors == 2 { 2.0 } else { sensors as f64 - 2.0 };
    let chance = |squares: f64| (squares / n as f64).sqrt() / shares;
    (0..sensors)
        .map(|sensor| parts(&own(sensor), chance(squares[sensor])))
        .collect()
}

/// Autocovariances of a difference; `None` if it is not the same throughout.
fn autocovariances(values: &[f64], far: usize) -> Option<Vec<f64>> {
    let clipped = centred(values);
    let mean = clipped.iter().sum::<f64>() / clipped.len() as f64;
    let off: Vec<f64> = clipped.iter().map(|value| value - mean).collect();
    let square = |part: &[f64]| part.iter().map(|one| one * one).sum::<f64>();
    let squares = off.chunks_exact(off.len() / PARTS).map(square);
    let (least, most) = squares.fold((f64::INFINITY, 0.0_f64), |(least, most), one| (least.min(one), most.max(one)));
    if most > UNLIKE * least {
        return None;
    }
    let at = |lag: usize| {
        let products: f64 = off.iter().zip(&off[lag..]).map(|(one, later)| one * later).sum();
        products / (off.len() - lag) as f64
    };
    let found: Vec<f64> = (0..=far).map(at).collect();
    let stays = found[far - far / 4..].iter().sum::<f64>() / (far / 4 + 1) as f64 > STAYS * found[1];
    (!stays || found[1] < LEAST * found[0]).then_some(found)
}

/// The parts of a noise of these autocovariances, whose errors have the deviation `chance`.
fn parts(own: &[f64], chance: f64) -> Option<Parts> {
    let all = own[0];
    if all <= 0.0 {
        return None;
    }
    if own[1] < (LEAST * all).max(CHANCE * chance) {
        return Some(Parts {
            lasting: 0.0,
            plain: all,
            rho: 0.0,
        });
    }
    let end = own
        .iter()
        .skip(1)
        .position(|one| *one < SMALL * own[1])
        .map_or(own.len() - 1, |at| at + 1);
    let pairs = own[1..=end].windows(2);
    let (products, squares) =
        pairs.fold((0.0, 0.0), |(products, squares), pair| (products + pair[0] * pair[1], squares + pair[0] * pair[0]));
    let rho = (products / squares).clamp(LEAST, LARGEST);
    let lasting = (own[1] / rho).min(all);
    Some(Parts {
        lasting,
        plain: all - lasting,
        rho,
    })
}

/// The variance of the level's change from row to row.
fn change(columns: &[Vec<f64>], parts: &[Parts]) -> f64 {
    let weights: Vec<f64> = parts.iter().map(|one| 1.0 / (one.lasting + one.plain)).collect();
    let all: f64 = weights.iter().sum();
    let n = columns[0].len();
    let mean = |row: usize| {
        columns
            .iter()
            .zip(&weights)
            .map(|(column, weight)| column[row] * weight)
            .sum::<f64>()
            / all
    };
    let means: Vec<f64> = (0..n).map(mean).collect();
    let (mut sum, mut precision) = (0.0, 0.0);
    for lag in LAGS {
        let squares: Vec<f64> = means
            .iter()
            .zip(&means[lag..])
            .map(|(one, later)| (later - one).powi(2))
            .collect();
        let found = squares.iter().sum::<f64>() / squares.len() as f64;
        let of = |(one, weight): (&Parts, &f64)| {
            let share = (weight / all).powi(2);
            let memory = (1.0 + one.rho) / (1.0 - one.rho);
            let noise = 2.0 * share * (one.lasting * (1.0 - one.rho.powi(lag as i32)) + one.plain);
            (noise, noise * (2.0 * memory / n as f64).sqrt())
        };
        let (noise, error) = parts
            .iter()
            .zip(&weights)
            .map(of)
            .fold((0.0, 0.0_f64), |(noise, error), one| (noise + one.0, error.hypot(one.1)));
        let deviation = error.hypot(found * (1.4 * lag as f64 / n as f64).sqrt()) / lag as f64;
        let weight = 1.0 / (deviation * deviation);
        sum += weight * (found - noise) / lag as f64;
        precision += weight;
    }
    // What may as well be larger makes bands too narrow.
    (sum / precision).max(0.0) + 0.5 / precision.sqrt()
}

/// The error of an estimate, and its covariance with the lasting parts.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ErrorUnderLasting {
    parts: Vec<Parts>,
    covariance: DMatrix<f64>,
}

impl ErrorUnderLasting {
    /// Before the first row. `variance`: of the level.
    pub(crate) fn new(parts: Vec<Parts>, variance: f64) -> Self {
        let all = std::iter::once(variance).chain(parts.iter().map(|one| one.lasting));
        let covariance = DMatrix::from_diagonal(&DVector::from_iterator(parts.len() + 1, all));
        Self { parts, covariance }
    }

    /// The level is known no better than with this variance.
    pub(crate) fn forget(&mut self, variance: f64) {
        *self = Self::new(std::mem::take(&mut self.parts), variance);
    }

    /// After so many rows, in which the level changed with this variance.
    pub(crate) fn advance(&mut self, rows: f64, change: f64) {
        for (i, one) in self.parts.iter().enumerate() {
            let kept = one.rho.powf(rows);
            self.covariance.row_mut(i + 1).scale_mut(kept);
            self.covariance.column_mut(i + 1).scale_mut(kept);
            self.covariance[(i + 1, i + 1)] += one.lasting * (1.0 - kept * kept);
        }
        self.covariance[(0, 0)] += change;
    }

    /// After an estimate that took a share of each sensor's difference from its forecast. Its variance.
    pub(crate) fn update(&mut self, gains: &[f64]) -> f64 {
        // The error becomes that of the row `taken`; the lasting parts stay.
        let kept = 1.0 - gains.iter().sum::<f64>();
        let taken = DVector::from_iterator(gains.len() + 1, std::iter::once(kept).chain(gains.iter().copied()));
        let mut with_all = &self.covariance * &taken;
        with_all[0] = taken.dot(&with_all);
        self.covariance.set_column(0, &with_all);
        self.covariance.set_row(0, &with_all.transpose());
        let plain = gains.iter().zip(&self.parts).map(|(gain, one)| gain * gain * one.plain);
        self.covariance[(0, 0)] += plain.sum::<f64>();
        self.covariance[(0, 0)]
    }
}
