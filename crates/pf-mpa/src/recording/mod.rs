//! Tracking from single ranges at arbitrary times and from arbitrary anchors, as in recordings and from real radios.
//!
//! Real ranges have a common bias, an error of scale and outliers, anchors stop sending, and speed, noise and first position are unknown.
//! [`RangeTracker`] estimates all of these on a [`FusionCentre`]:
//!
//! ```text
//! state        [x, vx, y, vy, bias, scale, offset]; a velocity is forgotten within `persistence`, the bias changes slowly, the scale never
//! acquisition  the first range of each anchor is sent in full; three anchors or more give a position by the adaptive grid
//! tracking     each range is sent as the level of its innovation, or in full; with probability `outliers` it is unrelated to the state
//! speed, noise a bank of filters, weighted by evidence; works with 1 bit too
//! lost         by the centre's own test, if fewer than three anchors agree, or after `silence` seconds without a range: acquisition starts
//!              again
//! ```

mod own_error;
mod scheme;
mod settings;

pub use settings::RangeSettings;

use crate::Error;
use crate::encoder::optimal_loading;
use crate::factor::RangeFactor;
use crate::quantized::{QuantizedRange, RangeReference};
use crate::sensor::{BiasedRangeSensor, RangeNoise, RangeSensor};
use fewbits_core::{FullValue, Gaussian, Link, NumberFormat, Observed, SchemeNode, SensorNode};
use fewbits_filters::centre::{Event, FalseAlarms, FusionCentre, Reporting, Slot};
use fewbits_filters::{GridFilter, GridWorkspace, NoiseBank};
use fewbits_numerics::error::refuse;
use fewbits_numerics::error::{finite, within};
use fewbits_quantizers::Symbol;
use nalgebra::{Matrix2, SMatrix, SVector, Vector1, Vector2};
use own_error::OwnError;
use rand::Rng;
use scheme::{Tolerant, stray_level};
use settings::{BIAS, OFFSET, SCALE};
use std::collections::BTreeMap;

/// Probability of a false alarm of the test for a lost track, per range. With one bit a lost track shows only slowly, so the rate is
/// higher: in a recording of 1000 ranges, most losses are then false alarms.
const ONE_BIT_ALARMS: f64 = 3e-3;
const ALARMS: f64 = 1e-5;
/// Added to the variances of bias and scale when the track is lost, as a share of those before the first range: for the bias one square
/// metre by default.
const LOST_SHARE: f64 = 0.04;
/// Bits of a range that is sent in full.
const FULL_BITS: usize = 32;

/// How a range is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Travel {
    /// As a number of 32 bits.
    Full,
    /// As the level of its innovation with this many bits, 1 to 8.
    Bits(u32),
}

/// The estimate after one range.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RangeEstimate {
    /// Position, in metres.
    pub position: Vector2<f64>,
    /// Covariance of the position, in square metres.
    pub covariance: Matrix2<f64>,
    /// Common bias of the ranges, in metres.
    pub bias: f64,
    /// Error of scale: ranges are `1 + scale` times the distance, plus the bias.
    pub scale: f64,
    /// Estimated standard deviation of a range's error, in metres: the geometric mean over the bank's filters, weighted by their
    /// probabilities.
    pub noise: f64,
    /// Estimated standard deviation of the velocity along an axis, in metres per second, averaged in the same way.
    pub speed: f64,
    /// Whether this range showed that the track was lost. Acquisition then starts again.
    pub lost: bool,
}

impl RangeEstimate {
    /// Squared error of the position divided by its covariance, per coordinate. On average 1 if the covariance is right. `None` if the
    /// covariance is singular.
    pub fn normalised_error(&self, truth: &Vector2<f64>) -> Option<f64> {
        let error = self.position - truth;
        Some(0.5 * error.dot(&self.covariance.cholesky()?.solve(&error)))
    }
}

type Filter = NoiseBank<7, OwnError>;

/// An anchor: its number at the centre, its sensor model, and its own half of the scheme.
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
    centre: Option<FusionCentre<7, Filter>>,
    /// Time, in seconds, that the centre counts as zero.
    origin: f64,
    /// The latest range in full of each anchor since acquisition began: time, place of the anchor, range.
    collected: BTreeMap<u32, (f64, Vector2<f64>, f64)>,
    /// Mean and variance of bias and error of scale before acquisition.
    calibration: [(f64, f64); 2],
    last: f64,
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
        let noise = RangeNoise::constant(0.5 * settings.least_noise())?;
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
            calibration: settings.calibration().map(|deviation| (0.0, deviation * deviation)),
            last: f64::NEG_INFINITY,
            bits: 0,
            losses: 0,
        })
    }

    /// Total bits of all ranges so far.
    pub fn bits(&self) -> usize {
        self.bits
    }

    /// Number of times that the track was lost.
    pub fn losses(&self) -> usize {
        self.losses
    }

    /// Processes one range in metres at `time` (seconds, not before the last). `None` during acquisition.
    ///
    /// # Errors
    /// If there is no such anchor, a number is not finite, or `time` is before the last range's.
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
        let anchors = self.anchors.len() as u32;
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
                let used = (0..anchors).filter(|number| centre.is_excluded(*number) == Ok(false));
                // The ranges of two anchors have two common places.
                received.events.contains(&Event::Lost) || used.count() < 3
            }
            // The range has probability zero under the belief, even as an outlier: the track is lost.
            Err(Error::Impossible) => true,
            Err(error) => return Err(error),
        };
        let estimate = self.centre.as_ref().map(|centre| self.estimate(centre, lost));
        if lost {
            self.losses += 1;
            self.forget();
        }
        Ok(estimate)
    }

    fn estimate(&self, centre: &FusionCentre<7, Filter>, lost: bool) -> RangeEstimate {
        let belief = centre.estimate();
        let (m, p) = (belief.mean(), belief.covariance());
        let (filters, weights) = (centre.filter().filters(), centre.belief().probabilities());
        let least = self.noise.at_sensor();
        let log_noise = |filter: &OwnError| 0.5 * (filter.variance + least * least).ln();
        let noise = filters
            .iter()
            .zip(weights)
            .map(|(filter, p)| p * log_noise(filter))
            .sum::<f64>();
        RangeEstimate {
            position: Vector2::new(m[0], m[2]),
            covariance: Matrix2::new(p[(0, 0)], p[(0, 2)], p[(2, 0)], p[(2, 2)]),
            bias: m[BIAS],
            scale: m[SCALE],
            noise: noise.exp(),
            speed: self.settings.speed * centre.filter().scale(centre.belief()).sqrt(),
            lost,
        }
    }

    /// Starts acquisition again. The estimates of bias and scale are kept, with a larger variance.
    fn forget(&mut self) {
        if let Some(centre) = self.centre.take() {
            let belief = centre.estimate();
            for ((axis, known), deviation) in [BIAS, SCALE]
                .into_iter()
                .zip(&mut self.calibration)
                .zip(self.settings.calibration())
            {
                let (mean, prior) = (belief.mean()[axis], deviation * deviation);
                let variance = belief.covariance()[(axis, axis)] + LOST_SHARE * prior;
                if variance.is_finite() && mean.abs() < 3.0 * deviation {
                    *known = (mean, variance.min(prior));
                }
            }
        }
        self.collected.clear();
    }

    /// Computes the belief from the collected ranges by the adaptive grid, and starts the centre with it if there is one.
    fn acquire(&mut self, rng: &mut dyn Rng, time: f64) -> Result<(), Error> {
        let places = || self.anchors.values().map(|anchor| *anchor.sensor.position());
        let count = self.anchors.len() as f64;
        let middle = places().sum::<Vector2<f64>>() / count;
        let spread = places().map(|p| (p - middle).norm_squared()).sum::<f64>() / count;
        let speed = self.settings.speed;
        let (mut mean, mut variances) = (SVector::<f64, 7>::zeros(), SVector::<f64, 7>::repeat(speed * speed));
        let [bias, scale] = self.calibration;
        (mean[0], mean[2], mean[BIAS], mean[SCALE]) = (middle[0], middle[1], bias.0, scale.0);
        // Prior: the target is somewhere among the anchors or a little outside.
        (variances[0], variances[2], variances[BIAS], variances[SCALE]) = (spread, spread, bias.1, scale.1);
        let prior = Gaussian::from_trusted_parts(mean, SMatrix::from_diagonal(&variances));
        // If no place fits the ranges within their noise, or the posterior is a thin ridge, try larger noise; then wait for more ranges.
        let (mut found, mut workspace) = (None, GridWorkspace::default());
        for inflation in [1.0, 2.0, 4.0] {
            let ranges = self.collected.values().map(|(then, place, range)| {
                // The target may have moved since the range was taken.
                let deviation = inflation * self.settings.noise.hypot(speed * (time - then));
                let noise = RangeNoise::constant(deviation)?;
                let factor = RangeFactor::value(*range, noise)?;
                Ok(Observed::new(BiasedRangeSensor(RangeSensor::new(*place, noise)?), factor))
            });
            let ranges: Vec<Observed<BiasedRangeSensor, RangeFactor, 1>> = ranges.collect::<Result<_, Error>>()?;
            match GridFilter::default().update(&prior, [0, 2, BIAS, SCALE], ranges.as_slice(), &mut workspace) {
                Ok((belief, _)) => {
                    found = Some(belief);
                    break;
                }
                Err(Error::Impossible | Error::Unresolved { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        let Some(belief) = found else { return Ok(()) };
        self.centre = Some(self.centre_from(rng, &belief)?);
        self.origin = time;
        Ok(())
    }

    fn centre_from(&self, rng: &mut dyn Rng, belief: &Gaussian<7>) -> Result<FusionCentre<7, Filter>, Error> {
        // What a filter's noise has more than the schemes'.
        let least = self.noise.at_sensor();
        let (bank, transition) = self.settings.bank();
        let filter = |(speed, noise): (f64, f64)| {
            let deviation = noise * self.settings.noise;
            let variance = deviation * deviation - least * least;
            (OwnError { variance }, speed * speed)
        };
        let bank = NoiseBank::of(bank.into_iter().map(filter).collect(), &transition)?;
        let sensor = FalseAlarms::default().sensor;
        let centre = match self.travel {
            Travel::Bits(1) => ONE_BIT_ALARMS,
            _ => ALARMS,
        };
        let mut centre = FusionCentre::new(rng, self.settings.world()?, bank, belief)?
            .with_false_alarms(FalseAlarms { sensor, centre })?;
        for anchor in self.anchors.values() {
            let sensing = BiasedRangeSensor(anchor.sensor).on_axes::<7>([0, 2, OFFSET, SCALE])?;
            let RangeSettings { outliers, stray, .. } = self.settings;
            match self.travel {
                Travel::Full => {
                    let scheme = Tolerant {
                        scheme: full_value(self.noise)?,
                        outliers,
                        stray: move |(): &(), _: &f64| 1.0 / stray,
                    };
                    let remote = Reporting::new(sensing, scheme, Link::PERFECT, |_: &Gaussian<7>, _: &Gaussian<1>| ());
                    centre.join(anchor.number, remote.sending_values())?;
                }
                Travel::Bits(bits) => {
                    let (levels, loading) = (1 << bits, optimal_loading(1 << bits)?);
                    let scheme = Tolerant {
                        scheme: quantizer(bits, self.noise)?,
                        outliers,
                        stray: move |r: &RangeReference, level: &Symbol| stray_level(levels, stray, r, level),
                    };
                    let ask = move |_: &Gaussian<7>, expected: &Gaussian<1>| RangeReference::about(expected, loading);
                    centre.join(anchor.number, Reporting::new(sensing, scheme, Link::PERFECT, ask))?;
                }
            }
        }
        Ok(centre)
    }
}

fn quantizer(bits: u32, noise: RangeNoise) -> Result<QuantizedRange, Error> {
    within("bits", f64::from(bits), 1.0, 8.0)?;
    // All nodes that hear the reports compute the references themselves, so they are not sent.
    Ok(QuantizedRange::new(1 << bits, noise)?.with_format(NumberFormat::Double))
}

fn full_value(noise: RangeNoise) -> Result<FullValue, Error> {
    let deviation = noise.at_sensor();
    Ok(FullValue::new(deviation * deviation)?.with_format(NumberFormat::Single))
}
