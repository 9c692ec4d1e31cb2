//! Settings of the range tracker.

use super::line::Line;
use super::measured::Measured;
use super::members::{Member, members};
use super::own::Own;
use crate::Error;
use fewbits_numerics::error::{finite, non_negative, positive, refuse, within};
use nalgebra::Vector3;

/// Default deviations and widths in multiples of the spread of the anchors, the root mean square of their distance from their middle.
mod shares {
    /// Largest noise, and the factor down to the smallest.
    pub(super) const NOISE: f64 = 0.256;
    pub(super) const NOISES: f64 = 128.0;
    /// Velocity per second, and the factor to either side.
    pub(super) const SPEED: f64 = 0.08;
    pub(super) const SPEEDS: f64 = 10.0;
    /// The same of a target that rests.
    pub(super) const REST: f64 = 0.0003;
    pub(super) const BIAS: f64 = 0.2;
    pub(super) const ANCHOR_BIAS: f64 = 0.03;
    /// Probability that an anchor has a bias of its own of the size of the common one.
    pub(super) const OUT_OF_PLACE: f64 = 0.08;
    pub(super) const STRAY: f64 = 4.0;
    /// Deviation of an estimated height, at least.
    pub(super) const HEIGHT: f64 = 0.5;
    /// Deviation of a clock that nothing is known of.
    pub(super) const CLOCK: f64 = 10.0;
}
/// The same for ranges whose errors are in proportion to the distance: of their logarithms.
mod logarithms {
    pub(super) const NOISE: f64 = 1.0;
    pub(super) const NOISES: f64 = 32.0;
    pub(super) const BIAS: f64 = 0.3;
    pub(super) const ANCHOR_BIAS: f64 = 0.1;
    pub(super) const OF_ONE: f64 = 0.4;
}
/// Uncertainty of a noise or speed that is stated, as a factor.
const STATED: f64 = 4.0;
/// Weight below which a filter is left out. A level says less than a range in full, so of levels more filters stay probable.
const NEGLIGIBLE: f64 = 1e-4;
pub(super) const NEGLIGIBLE_OF_LEVELS: f64 = 5e-5;
/// Share of the first places that is left out.
const NEEDLESS: f64 = 1e-3;
pub(super) const NEEDLESS_OF_LEVELS: f64 = 1e-3;
/// A filter of more weight in its hypothesis is kept, however improbable the hypothesis is.
const LEAST_WEIGHT: f64 = 3e-3;
/// Deviation by which the bias changes in a second, as a share of its own.
const DRIFT: f64 = 0.002;

/// What is known of the target's height.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Height {
    /// It is estimated if the anchors differ in height or one is not at zero; otherwise it is zero, as theirs.
    #[default]
    Unsaid,
    /// It is known and constant, in the unit of the anchors' coordinates.
    Known(f64),
    /// It is estimated and may change: mean and standard deviation before the first range. Anchors of like heights leave two sides, and the
    /// estimate can settle on the wrong one with a narrow band: use it only where the anchors' heights differ as much as their places.
    Estimated {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        deviation: f64,
    },
}

/// What is assumed about ranges and target before the first range. Lengths are in the unit of the anchors' coordinates. A length that is
/// `None` is a share of the anchors' spread, so that a recording gives the same path in each unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RangeSettings {
    /// Largest standard deviation of a range's error, without biases and error of scale. Larger ones are not considered, because they would
    /// explain a lost track. Default: about a quarter of the spread.
    pub noise: Option<f64>,
    /// The tracker estimates the noise from `noise / noise_factor` to `noise`. Errors that last for seconds make the estimate too small:
    /// with 1 the deviation is `noise`. Default: 4, or 128 if `noise` is not stated.
    pub noise_factor: Option<f64>,
    /// Share of outliers: ranges that do not depend on the distance.
    pub outliers: f64,
    /// Width of the interval over which outliers are spread. Default: four spreads.
    pub stray: Option<f64>,
    /// Standard deviation of the velocity along each axis, per second. Default: 0.08 spreads.
    pub speed: Option<f64>,
    /// The tracker estimates the speed from `speed / speed_factor` to `speed * speed_factor`. Default: 4, or 10 if `speed` is not stated, and then
    /// the target may rest too: 0.0003 spreads per second.
    pub speed_factor: Option<f64>,
    /// Correlation time of the velocity, in seconds.
    pub persistence: f64,
    /// Standard deviation of the bias that all ranges share, before the first range; 0 if there is none. Default: a fifth of the spread.
    pub bias: Option<f64>,
    /// Standard deviation of the bias of each single anchor beside the common one; it is constant. Default: either 0 or 0.03 spreads,
    /// whichever explains the ranges.
    pub anchor_bias: Option<f64>,
    /// Growth of the variance of the common bias per second. Default: a variance of `(0.002 bias)^2`.
    pub drift: Option<f64>,
    /// Standard deviation of the error of scale before the first range; 0 if there is none. Ranges are `1 + scale` times the distance.
    pub scale: f64,
    /// Seconds without a range after which acquisition starts again.
    pub silence: f64,
    /// What is known of the target's height.
    pub height: Height,
    /// Whether the ranges of one time share an unknown offset that has nothing to do with that of other times: differences of times of
    /// arrival with an unknown clock. Ranges must then travel in full.
    pub unknown_clock: bool,
    /// Whether errors are in proportion to the distance, as those of distances from signal strengths, whose shadowing is a number of decibels:
    /// `ln range = (1 + scale) ln distance + bias + noise`, distances in spreads of the anchors. Deviations of noise, biases and scale are those of
    /// the logarithm: about shares of the distance, and of the exponent. Defaults: noise up to 1, bias 0.3, single anchors' biases 0 or 0.1.
    pub proportional: bool,
}

impl Default for RangeSettings {
    fn default() -> Self {
        Self {
            noise: None,
            noise_factor: None,
            outliers: 0.02,
            stray: None,
            speed: None,
            speed_factor: None,
            persistence: 6.0,
            bias: None,
            anchor_bias: None,
            drift: None,
            scale: 0.1,
            silence: 30.0,
            height: Height::Unsaid,
            unknown_clock: false,
            proportional: false,
        }
    }
}

/// All numbers, in the unit of the anchors' coordinates.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Known {
    /// Number of estimated coordinates of the position, 2 or 3.
    pub(super) axes: usize,
    /// The target's height if it is not estimated.
    pub(super) level: f64,
    /// Middle of the anchors with the height's prior mean, and deviations of the position before the first range.
    pub(super) middle: [f64; 3],
    pub(super) spreads: [f64; 3],
    /// The line that the anchors are nearly on.
    pub(super) line: Option<Line>,
    /// The spread of the anchors.
    pub(super) anchors_spread: f64,
    /// What a range measures, and its change over the room: the spread, or 1 of a logarithm.
    pub(super) measured: Measured,
    pub(super) size: f64,
    /// Deviations of the bank, and the steps between them as lists.
    pub(super) noises: Vec<f64>,
    pub(super) speeds: Vec<f64>,
    /// One in the middle, and whether the first is that of a target that rests.
    pub(super) middle_speed: usize,
    pub(super) has_rest: bool,
    /// Filter by filter: speed by speed, for each the noises.
    pub(super) bank: Vec<Member>,
    pub(super) outliers: f64,
    pub(super) stray: f64,
    pub(super) persistence: f64,
    /// Mean and deviation of bias and scale.
    pub(super) bias: f64,
    pub(super) scale: f64,
    pub(super) drift: f64,
    /// What is supposed of single anchors' biases, each with its probability.
    pub(super) anchor_biases: Vec<(Own, f64)>,
    pub(super) silence: f64,
    /// A filter of less weight is left out until changes from its neighbours reach it again, and a smaller share of these does not change a filter.
    pub(super) negligible: f64,
    /// Of the pieces and slices of places those of the least probability are left out: together of this share.
    pub(super) needless: f64,
    /// Deviation of the clock, if it is unknown.
    pub(super) clock: Option<f64>,
}

impl Known {
    /// The weight below which a filter of a hypothesis of this probability is left out: the less it is, the fewer filters are kept.
    pub(super) fn least_weight(&self, share: f64) -> f64 {
        (self.negligible / share).clamp(self.negligible, LEAST_WEIGHT)
    }

    /// Leaves out that the target rests.
    pub(super) fn leave_rest_out(&mut self) {
        if self.has_rest {
            self.has_rest = false;
            self.middle_speed -= 1;
            self.speeds.remove(0);
            self.bank.drain(..self.noises.len());
        }
    }
}

/// The root mean square of the distances of places from their middle.
fn spread_of(places: &[Vector3<f64>]) -> f64 {
    let count = places.len() as f64;
    let middle = places.iter().sum::<Vector3<f64>>() / count;
    (places.iter().map(|place| (place - middle).norm_squared()).sum::<f64>() / count).sqrt()
}

impl RangeSettings {
    /// The same for a target whose speeds among these anchors, if none is stated, are so many times slower, and last so many times longer.
    #[must_use]
    pub fn slower(self, anchors: &[Vector3<f64>], times: f64) -> Self {
        let unsaid = shares::SPEED * spread_of(anchors) / times;
        Self {
            speed: self.speed.or(Some(unsaid)),
            speed_factor: self.speed_factor.or(self.speed.is_none().then_some(shares::SPEEDS)),
            persistence: times * self.persistence,
            ..self
        }
    }

    /// Checks the settings and gives each a number.
    pub(super) fn known(&self, anchors: &[Vector3<f64>]) -> Result<Known, Error> {
        for place in anchors {
            place.iter().try_for_each(|x| finite("anchors", *x).map(|_| ()))?;
        }
        let count = anchors.len() as f64;
        let middle = anchors.iter().sum::<Vector3<f64>>() / count;
        let spread = spread_of(anchors);
        if anchors.iter().all(|place| *place == anchors[0]) {
            return refuse("anchors", "all at one place", "anchors at different places");
        }
        // Squares of squares are computed.
        if !spread.powi(4).is_normal() {
            let size = anchors.iter().map(|place| (place - middle).amax()).fold(0.0, f64::max);
            return refuse("anchors", format!("{size} from their middle"), "a unit in which this is 1e-70 to 1e70");
        }
        let (measured, size) = if self.proportional {
            if self.unknown_clock {
                return refuse("proportional", "with an unknown clock", "one of the two: an offset has no logarithm");
            }
            (Measured::Logarithm { unit: spread }, 1.0)
        } else {
            (Measured::Distance, spread)
        };
        // The default of a length that is measured, of distances and of logarithms.
        let of_ranges = |stated: Option<f64>, share: f64, logarithm: f64| {
            let own = if self.proportional { logarithm } else { share * spread };
            stated.unwrap_or(own)
        };
        let factor = |factor: Option<f64>, stated: Option<f64>, unstated: f64| {
            factor.unwrap_or(if stated.is_some() { STATED } else { unstated })
        };
        let noise = of_ranges(self.noise, shares::NOISE, logarithms::NOISE);
        let speed = self.speed.unwrap_or(shares::SPEED * spread);
        let noises = if self.proportional {
            logarithms::NOISES
        } else {
            shares::NOISES
        };
        let noise_factor = factor(self.noise_factor, self.noise, noises);
        let speed_factor = factor(self.speed_factor, self.speed, shares::SPEEDS);
        let bias = of_ranges(self.bias, shares::BIAS, logarithms::BIAS);
        let stray = of_ranges(self.stray, shares::STRAY, shares::STRAY);
        within("outliers", self.outliers, 0.0, 0.5)?;
        within("noise_factor", noise_factor, 1.0, 1e3)?;
        within("speed_factor", speed_factor, 1.0, 1e3)?;
        for (name, value, size) in [
            ("noise", noise, size),
            ("stray", stray, size),
            ("speed", speed, spread),
            ("persistence", self.persistence, spread),
            ("silence", self.silence, spread),
        ] {
            positive(name, value)?;
            // Squares are computed.
            if !(value / size * (value / size)).is_normal() {
                return refuse(
                    name,
                    value,
                    format!("a number that is not negligible beside the anchors' spread {spread}"),
                );
            }
        }
        non_negative("bias", bias)?;
        non_negative("scale", self.scale)?;
        let drift = self.drift.unwrap_or((DRIFT * bias).powi(2));
        non_negative("drift", drift)?;
        let anchor_biases = match self.anchor_bias {
            Some(deviation) => vec![(Own::Each(non_negative("anchor_bias", deviation)?), 1.0)],
            None if bias > 0.0 => {
                let each = of_ranges(None, shares::ANCHOR_BIAS, logarithms::ANCHOR_BIAS);
                let mut all = vec![(Own::Each(0.0), 0.7), (Own::Each(each), 0.3)];
                // One anchor stands elsewhere, or is behind a wall for good.
                if anchors.len() > 3 && !self.unknown_clock {
                    let deviation = of_ranges(None, shares::BIAS, logarithms::OF_ONE);
                    all.extend(
                        (0..anchors.len()).map(|anchor| (Own::Only { anchor, deviation }, shares::OUT_OF_PLACE)),
                    );
                }
                all
            }
            // Who says that there is no bias means that of single anchors too.
            None => vec![(Own::Each(0.0), 1.0)],
        };
        let is_flat = anchors.iter().all(|place| place.z == 0.0);
        let height = |deviation: f64| deviation.max(shares::HEIGHT * spread);
        let (axes, level, mean, deviation) = match self.height {
            Height::Known(level) => (2, finite("height", level)?, level, spread),
            Height::Estimated { mean, deviation } => {
                (3, 0.0, finite("height", mean)?, positive("height's deviation", deviation)?)
            }
            Height::Unsaid if is_flat => (2, 0.0, 0.0, spread),
            Height::Unsaid => {
                let variance = anchors.iter().map(|place| (place.z - middle.z).powi(2)).sum::<f64>() / count;
                (3, 0.0, middle.z, height(variance.sqrt()))
            }
        };
        let spacing = if self.speed.is_some() { 2.0 } else { 2.5 };
        let noises = steps(noise / noise_factor, noise, 2.0);
        let mut speeds = steps(speed / speed_factor, speed * speed_factor, spacing);
        let has_rest = self.speed.is_none() && self.speed_factor.is_none();
        let middle_speed = speeds.len() / 2 + usize::from(has_rest);
        if has_rest {
            speeds.insert(0, shares::REST * spread);
        }
        Ok(Known {
            axes,
            level,
            middle: [middle.x, middle.y, mean],
            spreads: [spread, spread, deviation],
            line: Line::of(anchors),
            anchors_spread: spread,
            measured,
            size,
            bank: members(&speeds, &noises),
            noises,
            speeds,
            middle_speed,
            has_rest,
            outliers: self.outliers,
            stray,
            persistence: self.persistence,
            bias,
            scale: self.scale,
            drift,
            anchor_biases,
            silence: self.silence,
            negligible: NEGLIGIBLE,
            needless: NEEDLESS,
            clock: self.unknown_clock.then_some(shares::CLOCK * spread),
        })
    }
}

/// Numbers from one to another in even ratios, each at most `spacing` times the one before, which raises the error by a few percent.
fn steps(from: f64, to: f64, spacing: f64) -> Vec<f64> {
    // A factor of exactly one is one number.
    let count = ((to / from).ln() / spacing.ln() - 1e-9).ceil().max(0.0);
    let ratio = (to / from).ln() / count.max(1.0);
    (0..=count as i32)
        .map(|i| from * (ratio * f64::from(i)).exp())
        .collect()
}
