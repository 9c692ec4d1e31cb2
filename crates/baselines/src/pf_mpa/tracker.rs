//! The traits of the trackers of this crate, and the network of sensors that they use.

use crate::pf_mpa::encoder::Encoder;
use crate::pf_mpa::range_factor::{IntervalRule, RangeFactor};
use crate::pf_mpa::target::{Manoeuvres, Target};
use fewbits_core::{Gaussian, Observed};
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::error::refuse;
use fewbits_pf_mpa::Error;
use fewbits_pf_mpa::RangeSensor;
use fewbits_pf_mpa::{QuantizedRange, RangeReference};
use nalgebra::Vector2;
use rand::Rng;
use serde::{Deserialize, Serialize};

/// Coordinates of the position in the states of [`Target`] and of [`WithManoeuvre`](crate::pf_mpa::WithManoeuvre).
pub const POSITION: [usize; 2] = [0, 1];

/// One range sensor's report, as a likelihood of the position.
pub type Ranged = Observed<RangeSensor, RangeFactor, 1>;

/// Likelihood and diagnostics of one step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct StepInfo {
    /// `ln p(observed now | past)` under the tracker's model; `None` if the tracker does not compute it (message passing).
    pub log_likelihood: Option<f64>,
    /// Effective sample size of the particles or draws, if there are any.
    pub effective_sample_size: Option<f64>,
    /// How often the step fell back to Gaussian message passing, or widened a singular kernel.
    pub fallbacks: u32,
}

impl StepInfo {
    /// The information of a step without draws.
    pub(crate) fn of(log_likelihood: f64) -> Self {
        Self {
            log_likelihood: Some(log_likelihood),
            ..Self::default()
        }
    }
}

/// A tracker of the manoeuvring [`Target`]. After a failed step the belief is unchanged.
pub trait Tracker {
    /// The tracker's state between steps.
    type Belief: Clone;
    /// Buffers that are reused from step to step, so that a step does not allocate.
    type Workspace: Default;

    /// The belief before the first step.
    ///
    /// # Errors
    /// If the prior cannot be represented.
    fn start<R: Rng>(&self, rng: &mut R, target: &Target, prior: &Gaussian<4>) -> Result<Self::Belief, Error>;

    /// Mean and covariance of a belief: what a leader would broadcast.
    fn estimate(&self, belief: &Self::Belief) -> Gaussian<4>;

    /// Step `k`, counted from zero: predicts, then updates with the observations.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the observations have probability zero under the belief. The belief is then unchanged.
    fn step_in_place<R: Rng>(
        &self,
        rng: &mut R,
        target: &Target,
        k: usize,
        belief: &mut Self::Belief,
        observed: &[Ranged],
        workspace: &mut Self::Workspace,
    ) -> Result<StepInfo, Error>;

    /// As [`step_in_place`](Self::step_in_place), but returns the new belief.
    ///
    /// # Errors
    /// As [`step_in_place`](Self::step_in_place).
    fn step<R: Rng>(
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

/// The input of one step of a [`GaussianTracker`].
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Step<'a> {
    /// The target, which moves before it is observed.
    pub target: &'a Target,
    /// Number of the step, counted from zero.
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

/// A tracker whose belief is a Gaussian. Each one is a [`Tracker`].
pub trait GaussianTracker {
    /// Buffers that are reused from step to step.
    type Workspace: Default;

    /// Checks the settings, before the first step.
    ///
    /// # Errors
    /// If a setting is out of range.
    fn check(&self) -> Result<(), Error> {
        Ok(())
    }

    /// The belief after a step. If a mean or covariance is not finite, the result is [`Error::Impossible`].
    ///
    /// # Errors
    /// As [`Tracker::step_in_place`].
    fn advance<R: Rng>(
        &self,
        rng: &mut R,
        step: Step<'_>,
        workspace: &mut Self::Workspace,
    ) -> Result<(Gaussian<4>, StepInfo), Error>;
}

impl<T: GaussianTracker> Tracker for T {
    type Belief = Gaussian<4>;
    type Workspace = T::Workspace;

    fn start<R: Rng>(&self, _: &mut R, _: &Target, prior: &Gaussian<4>) -> Result<Gaussian<4>, Error> {
        self.check()?;
        Ok(*prior)
    }

    fn estimate(&self, belief: &Gaussian<4>) -> Gaussian<4> {
        *belief
    }

    fn step_in_place<R: Rng>(
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
    /// The unquantized ranges, for comparison.
    Ranges,
}

/// Range sensors that all nodes know, their quantizer, and how references are computed.
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    sensors: Vec<RangeSensor>,
    scheme: QuantizedRange,
    encoder: Encoder,
    interval: IntervalRule,
}

impl Network {
    /// Sensors at `positions`, numbered in this order. With fewer than three the position is ambiguous.
    ///
    /// # Errors
    /// If there is no sensor, a position is not finite, or two sensors are at the same place.
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
            interval: IntervalRule::Correct,
        })
    }

    /// The same network with another interval for message passing. Likelihoods use the true cell.
    #[must_use]
    pub fn with_interval(self, interval: IntervalRule) -> Self {
        Self { interval, ..self }
    }

    /// The sensors.
    pub fn sensors(&self) -> &[RangeSensor] {
        &self.sensors
    }

    /// The quantizer of all sensors.
    pub fn scheme(&self) -> &QuantizedRange {
        &self.scheme
    }

    /// Draws a range from every sensor to a target at `(x, y)`.
    pub fn measure<R: Rng>(&self, rng: &mut R, x: f64, y: f64) -> Vec<f64> {
        self.sensors.iter().map(|s| s.measure(rng, s.distance(x, y))).collect()
    }

    /// The reference of every sensor for step `k`, from the estimate of the step before.
    ///
    /// # Errors
    /// If a reference is not finite.
    pub fn references(&self, target: &Target, k: usize, previous: &Gaussian<4>) -> Result<Vec<RangeReference>, Error> {
        let predicted = target.predict(previous, k, Manoeuvres::AsNoise);
        let noise = self.scheme.noise();
        let of = |s: &RangeSensor| {
            let sensor = s.on_axes::<4>(POSITION)?;
            self.encoder.reference(target, &sensor, noise, previous, &predicted)
        };
        self.sensors.iter().map(of).collect()
    }

    /// The observations of step `k`. Every range is encoded with the references that follow from `previous`, the estimate of step `k - 1`.
    ///
    /// # Errors
    /// If there is not one range per sensor, a range is not finite, or a reference is not.
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
                    let factor = RangeFactor::level(&self.scheme, level, &reference, self.interval)?;
                    Ok(Observed::new(*s, factor))
                })
                .collect(),
        }
    }
}
