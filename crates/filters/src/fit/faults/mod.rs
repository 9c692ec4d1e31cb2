//! Faults of sensors that are no parameters of the model: each is tested beside a sensor without it.
//!
//! | fault | test |
//! |---|---|
//! | bits that are inverted now and then | likelihood ratio: each bit is inverted with one probability |
//! | a switch with hysteresis | likelihood ratio: the threshold is lower while the last bit was 1 |
//! | values that lag behind rises and falls | differences from the reference against the way that its earlier values went |
//! | values that are left out because they are large, or small | likelihood ratio: an absent value lies beyond the outermost one |
//!
//! A likelihood ratio of a fixed alternative is beyond `e^x` by chance with probability `e^-x` at most, whatever leaves values out otherwise.

mod absent;
mod lag;

use super::parameters::Quantity;
use super::problem::{ENOUGH, Problem};
use super::readings::{Readings, Told};
use super::search::maximum;
use crate::calibration::{Instant, Reading};
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// Nats by which a fault of bits explains the readings better, so that one of two is as certain as 99 in a hundred: of 350 sound tables two reached more.
/// Of two independent tests at a boundary it would be 3.3. The number of sensors of bits is added as its logarithm.
const CERTAIN: f64 = 2.7;
/// Readings or instants from which a fault is found, at least.
const FEWEST: usize = 30;
/// A screened point that is worse by more nats than this is not climbed from.
const HOPELESS: f64 = 3.0;
/// Where the search of a share of inverted bits, and of a hysteresis in noises, begins.
const SHARES: [f64; 3] = [0.01, 0.04, 0.12];
const WIDTHS: [f64; 4] = [0.3, 1.0, 2.0, 4.0];
/// Noises, beside that which was found, at which it begins.
const NOISES: [f64; 3] = [1.0, 0.5, 0.2];

/// What is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FaultKind {
    /// Bits are inverted. The size is the share of them.
    InvertedBits,
    /// A switch has another threshold for a rise than for a fall. The size is the distance of the two.
    Hysteresis,
    /// Values differ while the level rises and while it falls, as by friction or a delay. The size is how far they lag behind in either direction,
    /// on average; negative if they lead.
    Lag,
    /// Values above a limit are absent. The size is the limit.
    AbsentAbove,
    /// Values below a limit are absent. The size is the limit.
    AbsentBelow,
}

impl FaultKind {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::InvertedBits => "inverted-bits",
            Self::Hysteresis => "hysteresis",
            Self::Lag => "lag",
            Self::AbsentAbove => "absent-above",
            Self::AbsentBelow => "absent-below",
        }
    }
}

/// A fault of a sensor for which the model has no parameter. The numbers that were found suppose that it is not there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fault {
    /// The sensor.
    pub sensor: usize,
    /// What is wrong.
    pub kind: FaultKind,
    /// How large it is, about.
    pub size: f64,
    /// Nats by which it explains the readings better than a sensor without it.
    pub evidence: f64,
}

impl Problem<'_> {
    /// Faults that are certain, beside absent values. `bits`: the sensors without values.
    pub(super) fn faults(&self, instants: &[Instant], bits: &[usize], reference: usize) -> Vec<Fault> {
        let limit = CERTAIN + (bits.len() as f64).ln();
        let switches = bits.iter().filter_map(|sensor| self.switch(*sensor));
        let mut found: Vec<Fault> = switches.filter(|fault| fault.evidence > limit).collect();
        found.extend(self.lags(instants, reference));
        found
    }

    /// The likelier of the two faults of a sensor of bits.
    fn switch(&self, sensor: usize) -> Option<Fault> {
        let readings = self.part.as_ref().unwrap_or(&self.readings);
        let own = [Quantity::Change, Quantity::Noise(sensor), Quantity::Bias(sensor)];
        let places: Vec<usize> = (0..self.free.len()).filter(|i| own.contains(&self.free[*i])).collect();
        let noise = self.free.iter().position(|one| *one == Quantity::Noise(sensor));
        let count = readings.by_sensor[sensor].len();
        if count < FEWEST {
            return None;
        }
        let model_at = |point: &[f64]| {
            let mut all = DVector::zeros(self.free.len());
            places.iter().zip(point).for_each(|(place, by)| all[*place] = *by);
            self.at(&all)
        };
        let plain = self.log_likelihood_of(readings, &self.model) - self.vagueness(&self.model);
        let best = |kind: FaultKind, sizes: &[f64]| {
            let worth = |size: f64, point: &[f64]| {
                let model = model_at(point);
                let faulty = with_fault(readings, sensor, kind, size)?;
                Some(self.log_likelihood_of(&faulty, &model) - self.vagueness(&model) - plain)
            };
            let mut start: Option<(f64, f64, Vec<f64>)> = None;
            for size in sizes {
                for factor in &NOISES[..if noise.is_some() { NOISES.len() } else { 1 }] {
                    let point: Vec<f64> = places
                        .iter()
                        .map(|place| if Some(*place) == noise { factor.ln() } else { 0.0 })
                        .collect();
                    let found = worth(*size, &point)?;
                    if start.as_ref().is_none_or(|(most, ..)| found > *most) {
                        start = Some((found, *size, point));
                    }
                }
            }
            let (_, size, point) = start.filter(|(found, ..)| *found > -HOPELESS)?;
            let of = |by: &DVector<f64>| {
                let moved: Vec<f64> = point.iter().zip(by.iter().skip(1)).map(|(at, by)| at + by).collect();
                worth(size * by[0].exp(), &moved).unwrap_or(f64::NEG_INFINITY)
            };
            let found = maximum(of, 1 + places.len(), None, ENOUGH);
            let size = size * found.point[0].exp();
            Some(Fault {
                sensor,
                kind,
                size: if kind == FaultKind::Hysteresis {
                    2.0 * size
                } else {
                    size
                },
                evidence: found.value,
            })
        };
        let width = WIDTHS.map(|width| width * self.model.sensors[sensor].noise);
        let both = [
            best(FaultKind::InvertedBits, &SHARES),
            best(FaultKind::Hysteresis, &width),
        ];
        both.into_iter()
            .flatten()
            .max_by(|one, other| one.evidence.total_cmp(&other.evidence))
    }
}

/// The readings of a sensor of bits under a fault: with a hysteresis, the bit before moves the threshold.
fn with_fault(readings: &Readings, sensor: usize, kind: FaultKind, size: f64) -> Option<Readings> {
    let mut found = readings.clone();
    let mut before = 0.0;
    for place in &readings.by_sensor[sensor] {
        let one: &mut Told = &mut found.told[*place];
        let Reading::Within { lower, upper } = one.reading else {
            continue;
        };
        if kind == FaultKind::InvertedBits {
            // Not more than a half is.
            let share = size.min(0.49);
            one.chance = Some((2.0 * share, share));
            continue;
        }
        let shift = -size * before;
        let (lower, upper) = (lower + shift, upper + shift);
        if lower.partial_cmp(&upper) != Some(std::cmp::Ordering::Less) {
            return None;
        }
        before = if lower.is_finite() { 1.0 } else { -1.0 };
        one.reading = Reading::Within { lower, upper };
    }
    Some(found)
}
