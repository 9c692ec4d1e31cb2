//! What every tracker here does, and the sensors it tracks with.

use crate::Error;
use crate::encoder::Encoder;
use crate::factor::RangeFactor;
use crate::quantized::{QuantizedRange, RangeReference};
use crate::sensor::RangeSensor;
use crate::target::{Manoeuvres, Target};
use fewbits_core::{Gaussian, Observed};
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::error::refuse;
use nalgebra::Vector2;
use rand::Rng;
use serde::{Deserialize, Serialize};

/// Coordinates of the position in the states of [`Target`] and of [`WithManoeuvre`](crate::WithManoeuvre).
pub const POSITION: [usize; 2] = [0, 1];

/// What one range sensor's report says about the position.
pub type Ranged = Observed<RangeSensor, RangeFactor, 1>;

/// What a step reveals besides the new belief.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct StepInfo {
    /// `ln p(observed now | past)`, as the tracker sees it; none where it has none (message passing).
    pub log_likelihood: Option<f64>,
    /// Effective sample size, of particles and draws.
    pub effective_sample_size: Option<f64>,
    /// How often the step fell back to Gaussian message passing, or widened a kernel without spread.
    pub fallbacks: u32,
}

impl StepInfo {
    /// Of a step without draws.
    pub(crate) fn of(log_likelihood: f64) -> Self {
        Self {
            log_likelihood: Some(log_likelihood),
            ..Self::default()
        }
    }
}

/// A tracker of the manoeuvring [`Target`]. Beliefs are values; a failed step leaves them as they were.
pub trait Tracker {
    /// What the tracker knows.
    type Belief: Clone;
    /// Buffers kept from step to step, so that a step does not allocate.
    type Workspace: Default;

    /// The belief before the first step.
    ///
    /// # Errors
    /// If the prior cannot be represented.
    fn start<R: Rng + ?Sized>(&self, rng: &mut R, target: &Target, prior: &Gaussian<4>) -> Result<Self::Belief, Error>;

    /// Mean and covariance of a belief: what a leader would broadcast.
    fn estimate(&self, belief: &Self::Belief) -> Gaussian<4>;

    /// Step `k`, counted from zero: time update and what was observed.
    ///
    /// # Errors
    /// [`Error::Impossible`] if what was observed is impossible under the belief; the belief is then as it was.
    fn step_in_place<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        target: &Target,
        k: usize,
        belief: &mut Self::Belief,
        observed: &[Ranged],
        workspace: &mut Self::Workspace,
    ) -> Result<StepInfo, Error>;

    /// The same from a belief to the next.
    ///
    /// # Errors
    /// As [`step_in_place`](Self::step_in_place).
    fn step<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        target: &Target,
        k: usize,
        belief: &Self::Belief,
        observed: &[Ranged],
    ) -> Result<(Self::Belief, StepInfo), Error> {
        let mut next = belief.clone();
        let info = self.step_in_place(rng, target, k, &mut next, observed, &mut Self::Workspace::default())?;
        Ok((next, info))
    }
}

/// What one step of a [`GaussianTracker`] is given.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Step<'a> {
    /// The target, which moves before it is observed.
    pub target: &'a Target,
    /// Which step of the target this is.
    pub k: usize,
    /// The belief before the step.
    pub belief: &'a Gaussian<4>,
    /// The ranges observed after the target has moved.
    pub observed: &'a [Ranged],
}

impl Step<'_> {
    /// The belief after the target has moved, before it is observed.
    pub fn predicted(&self, manoeuvres: Manoeuvres) -> Gaussian<4> {
        self.target.predict(self.belief, self.k, manoeuvres)
    }
}

/// A tracker whose belief is a Gaussian, and what makes it a [`Tracker`].
pub trait GaussianTracker {
    /// Buffers kept from step to step.
    type Workspace: Default;

    /// Checks the settings, before the first step.
    ///
    /// # Errors
    /// If one is out of range.
    fn check(&self) -> Result<(), Error> {
        Ok(())
    }

    /// The belief after a step. A mean or covariance that is no number is [`Error::Impossible`].
    ///
    /// # Errors
    /// As [`Tracker::step_in_place`].
    fn advance<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        step: Step<'_>,
        workspace: &mut Self::Workspace,
    ) -> Result<(Gaussian<4>, StepInfo), Error>;
}

impl<T: GaussianTracker> Tracker for T {
    type Belief = Gaussian<4>;
    type Workspace = T::Workspace;

    fn start<R: Rng + ?Sized>(&self, _: &mut R, _: &Target, prior: &Gaussian<4>) -> Result<Gaussian<4>, Error> {
        self.check()?;
        Ok(*prior)
    }

    fn estimate(&self, belief: &Gaussian<4>) -> Gaussian<4> {
        *belief
    }

    fn step_in_place<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        target: &Target,
        k: usize,
        belief: &mut Gaussian<4>,
        observed: &[Ranged],
        workspace: &mut T::Workspace,
    ) -> Result<StepInfo, Error> {
        let step = Step {
            target,
            k,
            belief,
            observed,
        };
        let (next, info) = self.advance(rng, step, workspace)?;
        if !next.is_finite() {
            return Err(Error::Impossible);
        }
        *belief = next;
        Ok(info)
    }
}

/// What the sensors report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reports {
    /// Levels of the quantizer.
    Levels,
    /// The ranges themselves: what quantization is measured against.
    Ranges,
}

/// Range sensors that all nodes know, their quantizer and how references are derived.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    sensors: Vec<RangeSensor>,
    scheme: QuantizedRange,
    encoder: Encoder,
}

impl Network {
    /// Sensors at `positions`, numbered in this order. Fewer than three leave the position ambiguous.
    ///
    /// # Errors
    /// If there is none, a position is not finite, or two sensors stand at the same place.
    pub fn new(positions: &[Vector2<f64>], scheme: QuantizedRange, encoder: Encoder) -> Result<Self, Error> {
        at_least_one("sensors", positions.len())?;
        if let Some(i) = (1..positions.len()).find(|i| positions[..*i].contains(&positions[*i])) {
            return refuse("positions", format!("{:?} twice", positions[i]), "sensors at different places");
        }
        let sensors = positions.iter().map(|p| RangeSensor::new(*p, *scheme.noise()));
        Ok(Self {
            sensors: sensors.collect::<Result<_, _>>()?,
            scheme,
            encoder,
        })
    }

    /// The sensors.
    pub fn sensors(&self) -> &[RangeSensor] {
        &self.sensors
    }

    /// What they report.
    pub fn scheme(&self) -> &QuantizedRange {
        &self.scheme
    }

    /// Bits of all reports of one step.
    pub fn report_bits(&self) -> usize {
        self.sensors.len() * self.scheme.bits() as usize
    }

    /// A measurement of every sensor.
    pub fn measure<R: Rng + ?Sized>(&self, rng: &mut R, x: f64, y: f64) -> Vec<f64> {
        self.sensors.iter().map(|s| s.measure(rng, s.distance(x, y))).collect()
    }

    /// The reference of every sensor for step `k`, from the estimate of the step before.
    ///
    /// # Errors
    /// If the estimate gives no number.
    pub fn references(&self, target: &Target, k: usize, previous: &Gaussian<4>) -> Result<Vec<RangeReference>, Error> {
        let predicted = target.predict(previous, k, Manoeuvres::AsNoise);
        let noise = self.scheme.noise();
        let of = |s: &RangeSensor| {
            let sensor = s.on_axes::<4>(POSITION)?;
            self.encoder.reference(target, &sensor, noise, previous, &predicted)
        };
        self.sensors.iter().map(of).collect()
    }

    /// What the receivers know after step `k`: every range encoded against `previous`, the estimate of the step before.
    ///
    /// # Errors
    /// If there is not one range per sensor, one is not finite, or the estimate gives no number.
    pub fn observe(
        &self,
        target: &Target,
        k: usize,
        previous: &Gaussian<4>,
        ranges: &[f64],
        reports: Reports,
    ) -> Result<Vec<Ranged>, Error> {
        if ranges.len() != self.sensors.len() {
            let expected = format!("{}, one per sensor", self.sensors.len());
            return refuse("ranges", format!("{} numbers", ranges.len()), expected);
        }
        let pairs = self.sensors.iter().zip(ranges);
        match reports {
            Reports::Ranges => pairs
                .map(|(s, z)| Ok(Observed::new(*s, RangeFactor::value(*z, *self.scheme.noise())?)))
                .collect(),
            Reports::Levels => pairs
                .zip(self.references(target, k, previous)?)
                .map(|((s, z), reference)| {
                    let level = self.scheme.level(*z, &reference)?;
                    Ok(Observed::new(*s, self.scheme.received(level, &reference)?))
                })
                .collect(),
        }
    }
}
