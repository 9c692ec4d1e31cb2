//! Tracking from ranges that come one at a time, at any time, from any anchor: recordings, and live radios of the kind.
//!
//! Real ranges are all too long by a common bias, some are outliers, anchors fall silent, nobody knows the speed, and the first position
//! has to be found. [`RangeTracker`] does all of it, on a [`FusionCentre`]:
//!
//! ```text
//! state        [x, vx, y, vy, bias]; velocities that are forgotten within `persistence`, a bias that hardly moves
//! acquisition  the first range of each anchor travels in full; three anchors or more give a position by the adaptive grid
//! tracking     each range travels as the level of its innovation, or in full; with probability `outliers` it says nothing
//! speed        a bank of filters over speeds, weighed by evidence: also with 1 bit, since each filter predicts the other's bits
//! lost         the centre's own test, fewer than three anchors that agree, or `silence` seconds without a range: acquisition again
//! ```

mod scheme;
mod settings;

pub use settings::RangeSettings;

use crate::Error;
use crate::encoder::optimal_loading;
use crate::error::refuse;
use crate::factor::RangeFactor;
use crate::quantized::{QuantizedRange, RangeReference};
use crate::sensor::{BiasedRangeSensor, RangeNoise, RangeSensor};
use fewbits_core::{FullValue, Gaussian, Link, NumberFormat, Observed, SchemeNode, SensorNode};
use fewbits_filters::centre::{Event, FalseAlarms, FusionCentre, Reporting, Slot};
use fewbits_filters::{GridFilter, GridWorkspace, MomentFilter, NoiseBank};
use fewbits_numerics::error::{finite, within};
use fewbits_quantizers::Symbol;
use nalgebra::{Matrix2, SMatrix, SVector, Vector1, Vector2};
use rand::Rng;
use scheme::{Tolerant, stray_level};
use std::collections::BTreeMap;

/// Coordinates of position and bias in the state.
const AXES: [usize; 3] = [0, 2, 4];
/// How often the speed may change, per range: once in a few minutes.
const SWITCHING: f64 = 0.003;
/// Losses that are found where there are none, per range. A lost track of one bit shows slowly, in its residuals only, so that the rate is
/// higher; errors of real ranges are alike for seconds, which a low rate forgives.
const ONE_BIT_ALARMS: f64 = 3e-3;
const ALARMS: f64 = 1e-6;
/// Bits of a range in full.
const FULL_BITS: usize = 32;

/// How a range travels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Travel {
    /// In full.
    Full,
    /// As the level of its innovation, this many bits.
    Bits(u32),
}

/// What is known after a range.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RangeEstimate {
    /// Position and its covariance.
    pub position: Vector2<f64>,
    /// See `position`.
    pub covariance: Matrix2<f64>,
    /// Bias of all ranges.
    pub bias: f64,
    /// Deviation of the velocity along an axis, as it was learnt: [`RangeSettings::speed`] times the root of the bank's noise scale, which is the
    /// geometric mean under the probabilities of its filters.
    pub speed: f64,
    /// Whether the track was found to be lost with this range; acquisition begins anew.
    pub lost: bool,
}

impl RangeEstimate {
    /// Squared error of the position in units of its covariance, per coordinate: 1 on average if the covariance is right. `None` if the
    /// covariance is singular.
    pub fn normalised_error(&self, truth: &Vector2<f64>) -> Option<f64> {
        let error = self.position - truth;
        Some(0.5 * error.dot(&self.covariance.cholesky()?.solve(&error)))
    }
}

type Filter = NoiseBank<5, MomentFilter>;

/// An anchor: its number at the centre, how it senses, and its own half.
struct Anchor {
    number: u32,
    sensor: RangeSensor,
    node: Box<dyn SensorNode<1>>,
}

/// A tracker of one target from the ranges of fixed anchors.
pub struct RangeTracker {
    anchors: BTreeMap<String, Anchor>,
    travel: Travel,
    settings: RangeSettings,
    noise: RangeNoise,
    centre: Option<FusionCentre<5, Filter>>,
    /// Time of the centre's zero.
    origin: f64,
    /// Ranges in full since acquisition began: the latest of each anchor.
    collected: BTreeMap<u32, (f64, Vector2<f64>, f64)>,
    bias: (f64, f64),
    last: f64,
    /// Anchors that contradict the others since acquisition.
    excluded: usize,
    bits: usize,
    losses: usize,
}

impl RangeTracker {
    /// A tracker with anchors at known places, by name.
    ///
    /// # Errors
    /// If there are fewer than three anchors, a place or a setting is not finite or out of range, or levels have 0 or more than 8 bits.
    pub fn new(
        anchors: impl IntoIterator<Item = (String, Vector2<f64>)>,
        travel: Travel,
        settings: RangeSettings,
    ) -> Result<Self, Error> {
        settings.check()?;
        let noise = RangeNoise::constant(settings.noise)?;
        let mut seated = BTreeMap::new();
        for (name, place) in anchors {
            let sensor = RangeSensor::new(place, noise)?;
            let node: Box<dyn SensorNode<1>> = match travel {
                Travel::Full => Box::new(SchemeNode::new(full_value(noise)?)),
                Travel::Bits(bits) => Box::new(SchemeNode::new(quantizer(bits, noise)?)),
            };
            let number = seated.len() as u32;
            seated.insert(name, Anchor { number, sensor, node });
        }
        if seated.len() < 3 {
            return refuse("anchors", format!("{} anchors", seated.len()), "at least three, of different names");
        }
        Ok(Self {
            anchors: seated,
            travel,
            settings,
            noise,
            centre: None,
            origin: 0.0,
            collected: BTreeMap::new(),
            bias: (0.0, settings.bias * settings.bias),
            last: f64::NEG_INFINITY,
            excluded: 0,
            bits: 0,
            losses: 0,
        })
    }

    /// Bits of all ranges so far.
    pub fn bits(&self) -> usize {
        self.bits
    }

    /// How often the track was lost.
    pub fn losses(&self) -> usize {
        self.losses
    }

    /// Takes in one range in metres at `time` (seconds, not before the last). `None` while the position is being looked for.
    ///
    /// # Errors
    /// If there is no such anchor, a number is not finite, or the time is before the last range's.
    pub fn push(
        &mut self,
        rng: &mut dyn Rng,
        time: f64,
        anchor: &str,
        range: f64,
    ) -> Result<Option<RangeEstimate>, Error> {
        finite("range", range)?;
        if finite("time", time)? < self.last {
            return refuse("time", time, format!("{} or later", self.last));
        }
        let Some(Anchor { number, sensor, .. }) = self.anchors.get(anchor) else {
            return refuse("anchor", anchor, format!("one of {:?}", self.anchors.keys().collect::<Vec<_>>()));
        };
        let (number, place) = (*number, *sensor.position());
        if time - self.last > self.settings.silence {
            self.forget();
        }
        self.last = time;
        let (Some(centre), Some(anchor)) = (self.centre.as_mut(), self.anchors.get_mut(anchor)) else {
            self.bits += FULL_BITS;
            self.collected.insert(number, (time, place, range));
            if self.collected.len() >= self.anchors.len().min(4) {
                self.acquire(rng, time)?;
            }
            return Ok(self.centre.as_ref().map(|centre| self.estimate(centre, false)));
        };
        let feedback = centre.advance(rng, time - self.origin)?.feedback(anchor.number)?;
        let report = anchor.node.report(rng, &Vector1::new(range), &feedback)?;
        self.bits += report.as_ref().map_or(0, |bits| bits.bits());
        let slot = Slot::new(anchor.number, feedback, report.into());
        let lost = match centre.receive(rng, &[slot]) {
            Ok(received) => {
                let count = |wanted: fn(&Event) -> bool| received.events.iter().filter(|event| wanted(event)).count();
                self.excluded += count(|event| matches!(event, Event::Excluded(_)));
                self.excluded -= count(|event| matches!(event, Event::Readmitted(_)));
                // The ranges of two anchors have two common places.
                received.events.contains(&Event::Lost) || self.excluded + 3 > self.anchors.len()
            }
            // Nothing of the belief explains the range, not even as an outlier.
            Err(fewbits_filters::Error::Core(fewbits_core::Error::Impossible)) => true,
            Err(error) => return Err(error.into()),
        };
        let estimate = self.centre.as_ref().map(|centre| self.estimate(centre, lost));
        if lost {
            self.losses += 1;
            self.forget();
        }
        Ok(estimate)
    }

    fn estimate(&self, centre: &FusionCentre<5, Filter>, lost: bool) -> RangeEstimate {
        let belief = centre.estimate();
        let (m, p) = (belief.mean(), belief.covariance());
        let scale = centre.filter().scale(centre.belief());
        RangeEstimate {
            position: Vector2::new(m[0], m[2]),
            covariance: Matrix2::new(p[(0, 0)], p[(0, 2)], p[(2, 0)], p[(2, 2)]),
            bias: m[4],
            speed: self.settings.speed * scale.sqrt(),
            lost,
        }
    }

    /// Looks for the position anew; what is known of the bias stays.
    fn forget(&mut self) {
        if let Some(centre) = self.centre.take() {
            let belief = centre.estimate();
            // A lost track says little about the bias.
            let variance = belief.covariance()[(4, 4)] + 1.0;
            if variance.is_finite() && belief.mean()[4].abs() < 3.0 * self.settings.bias {
                self.bias = (belief.mean()[4], variance.min(self.settings.bias * self.settings.bias));
            }
        }
        self.collected.clear();
        self.excluded = 0;
    }

    /// The belief that the collected ranges leave, by the adaptive grid over the anchors' surroundings.
    fn acquire(&mut self, rng: &mut dyn Rng, time: f64) -> Result<(), Error> {
        let places = || self.anchors.values().map(|anchor| *anchor.sensor.position());
        let count = self.anchors.len() as f64;
        let middle = places().sum::<Vector2<f64>>() / count;
        let spread = places().map(|p| (p - middle).norm_squared()).sum::<f64>() / count;
        let speed = self.settings.speed;
        let (mut mean, mut variances) = (SVector::<f64, 5>::zeros(), SVector::<f64, 5>::repeat(speed * speed));
        (mean[0], mean[2], mean[4]) = (middle[0], middle[1], self.bias.0);
        // Targets move among their anchors, and somewhat beyond.
        (variances[0], variances[2], variances[4]) = (spread, spread, self.bias.1);
        let prior = Gaussian::from_trusted_parts(mean, SMatrix::from_diagonal(&variances));
        // Ranges that have no common place within their noise, or only a ridge: once more with a larger one, then wait for others.
        let (mut found, mut workspace) = (None, GridWorkspace::default());
        for inflation in [1.0, 2.0, 4.0] {
            let ranges = self.collected.values().map(|(then, place, range)| {
                // Since then the target may have moved on.
                let deviation = inflation * self.settings.noise.hypot(speed * (time - then));
                let noise = RangeNoise::constant(deviation)?;
                let factor = RangeFactor::value(*range, noise)?;
                Ok(Observed::new(BiasedRangeSensor(RangeSensor::new(*place, noise)?), factor))
            });
            let ranges: Vec<Observed<BiasedRangeSensor, RangeFactor, 1>> = ranges.collect::<Result<_, Error>>()?;
            match GridFilter::default().update(&prior, AXES, ranges.as_slice(), &mut workspace) {
                Ok((belief, _)) => {
                    found = Some(belief);
                    break;
                }
                Err(
                    fewbits_filters::Error::Core(fewbits_core::Error::Impossible)
                    | fewbits_filters::Error::Unresolved { .. },
                ) => {}
                Err(error) => return Err(error.into()),
            }
        }
        let Some(belief) = found else { return Ok(()) };
        self.centre = Some(self.centre_from(rng, &belief)?);
        self.origin = time;
        Ok(())
    }

    fn centre_from(&self, rng: &mut dyn Rng, belief: &Gaussian<5>) -> Result<FusionCentre<5, Filter>, Error> {
        let bank = NoiseBank::new(MomentFilter, self.settings.scales(), SWITCHING)?;
        let sensor = FalseAlarms::default().sensor;
        let centre = match self.travel {
            Travel::Bits(1) => ONE_BIT_ALARMS,
            _ => ALARMS,
        };
        let mut centre = FusionCentre::new(rng, self.settings.world()?, bank, belief)?
            .with_false_alarms(FalseAlarms { sensor, centre })?;
        for anchor in self.anchors.values() {
            let sensing = BiasedRangeSensor(anchor.sensor).on_axes::<5>(AXES)?;
            let RangeSettings { outliers, stray, .. } = self.settings;
            match self.travel {
                Travel::Full => {
                    let scheme = Tolerant {
                        scheme: full_value(self.noise)?,
                        outliers,
                        stray: move |(): &(), _: &f64| 1.0 / stray,
                    };
                    let remote = Reporting::new(sensing, scheme, Link::PERFECT, |_: &Gaussian<5>, _: &Gaussian<1>| ());
                    centre.join(anchor.number, remote.sending_values())?;
                }
                Travel::Bits(bits) => {
                    let (levels, loading) = (1 << bits, optimal_loading(1 << bits)?);
                    let scheme = Tolerant {
                        scheme: quantizer(bits, self.noise)?,
                        outliers,
                        stray: move |r: &RangeReference, level: &Symbol| stray_level(levels, stray, r, level),
                    };
                    let ask = move |_: &Gaussian<5>, expected: &Gaussian<1>| RangeReference::about(expected, loading);
                    centre.join(anchor.number, Reporting::new(sensing, scheme, Link::PERFECT, ask))?;
                }
            }
        }
        Ok(centre)
    }
}

fn quantizer(bits: u32, noise: RangeNoise) -> Result<QuantizedRange, Error> {
    within("bits", f64::from(bits), 1.0, 8.0)?;
    // All nodes that hear the reports compute the references themselves: they do not travel.
    Ok(QuantizedRange::new(1 << bits, noise)?.with_format(NumberFormat::Double))
}

fn full_value(noise: RangeNoise) -> Result<FullValue, Error> {
    let deviation = noise.at_sensor();
    Ok(FullValue::new(deviation * deviation)?.with_format(NumberFormat::Single))
}
