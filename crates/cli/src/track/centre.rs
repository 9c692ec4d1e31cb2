//! The fusion centre for sensors that all measure the same level.

use super::instant::{Instant, Qualifier};
use super::meaning::Seat;
use super::sensors;
use super::world::World;
use crate::arguments::Model;
use crate::error::Failure;
use crate::report::Report;
use fewbits_core::{BitString, Gaussian, Link, Message, NumberFormat, Observation, OnAxes, SensorNode, circle};
use fewbits_filters::centre::{
    Failures, FalseAlarms, FusionCentre, NoiseLearning, ReportTest, Reporting, SensorState, Slot,
};
use fewbits_filters::smoother::{Filtered, smooth};
use fewbits_filters::{MomentFilter, PointMassFilter, StateFilter};
use fewbits_models::{ContinuousLinear, LinearSensor};
use fewbits_recipes::stated::{StatedReading, Stating};
use nalgebra::Vector1;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

/// Probability per row that a sensor fails.
const FAILURE: f64 = 1e-4;
/// False alarm probabilities per observation and per row. They are small, because a table of many sensors and rows should have no false
/// alarm, and the offsets that `--align` estimates have small errors, which a more sensitive test would detect.
const ALARMS: FalseAlarms = FalseAlarms {
    sensor: 1e-6,
    centre: 1e-5,
};
/// Step of the learnt change for one sensor. The change that is found from the first rows is accurate already, so it is small.
const LEARNING: f64 = 0.01;
/// Smallest and largest factor of the change's variance: a level may rest while it is found, and then move.
const LEARNT: [f64; 2] = [1e-3, 1e6];
/// Bits of a value.
const VALUE_BITS: usize = 64;

/// Results of one instant.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Step {
    /// Level, slope and curvature, as many as the model has, each with its standard deviation.
    pub(super) estimate: Vec<(f64, f64)>,
    /// Number of bits sent, number of reports, how many of them were not used because they were too unlikely, and events by sensor.
    pub(super) bits: usize,
    pub(super) reports: usize,
    pub(super) rejected: usize,
    pub(super) events: Vec<(&'static str, Option<usize>)>,
    /// Number of sensors whose reports are used, and factor of the process noise.
    pub(super) used: usize,
    pub(super) noise_scale: f64,
}

/// A centre of any number of coordinates.
pub(super) trait Estimator {
    /// Adds the next sensor.
    fn join(&mut self, seat: Seat) -> Result<(), Failure>;
    /// Number of sensors added.
    fn seated(&self) -> usize;
    /// Processes one instant.
    fn step(&mut self, instant: &Instant) -> Result<Step, Failure>;
    /// Sets the factor of the change's variance.
    fn rescale(&mut self, scale: f64) -> Result<(), Failure>;
    /// Probability that a sensor works, and whether its reports are used.
    fn health(&self, sensor: usize) -> (f64, bool);
    /// Number of its reports that were rejected.
    fn rejected(&self, sensor: usize) -> u64;
    /// Of a sensor that sends bits: by how many deviations unlikely ones came more often than predicted.
    fn surprise(&self, sensor: usize) -> Option<f64>;
    /// The estimates of all steps given all reports, or those up to so many seconds later.
    fn smoothed(&self, lag: Option<f64>) -> Result<Vec<Vec<(f64, f64)>>, Failure>;
}

/// Purpose of the centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Use {
    /// Cells are measurements, which sensors of this program quantize.
    Measurements,
    /// Cells are reports.
    Reports,
    /// Unquantized measurements and no adaptation: the centre serves to compare likelihoods.
    Comparison,
}

/// A centre for the model.
pub(super) fn centre(world: &World, purpose: Use) -> Result<Box<dyn Estimator>, Failure> {
    Ok(match world.model {
        Model::Velocity => {
            let model = world.velocity(world.change)?;
            Box::new(Centre::<2, _>::new(model, MomentFilter, world, purpose)?)
        }
        Model::Acceleration => {
            let model = world.acceleration(world.change)?;
            Box::new(Centre::<3, _>::new(model, MomentFilter, world, purpose)?)
        }
        // Ranges have their own tracker.
        Model::Returning | Model::Walk | Model::Ranges => {
            let model = world.walk(world.change)?;
            if world.is_on_grid {
                Box::new(Centre::<1, _>::new(model, PointMassFilter::following(), world, purpose)?)
            } else {
                Box::new(Centre::<1, _>::new(model, MomentFilter, world, purpose)?)
            }
        }
    })
}

/// How a reading that states its meaning is tested.
fn tested(bits: &BitString) -> Option<ReportTest> {
    let reading = StatedReading::from_bits(&NumberFormat::Double, bits).ok()?;
    Some(if reading.lower == reading.upper {
        ReportTest::Value(reading.deviation * reading.deviation)
    } else {
        ReportTest::Cell(reading.upper - reading.lower)
    })
}

/// The same of a sensor that sends on change. Its values come because they are far from the last, so that of right ones too many are on one
/// side and few are near the forecast. Only an improbable one is tested: it stands for a narrow cell about it.
fn tested_on_change(bits: &BitString) -> Option<ReportTest> {
    Some(match tested(bits)? {
        ReportTest::Value(variance) => ReportTest::Cell(NARROW * variance.sqrt()),
        cell => cell,
    })
}

/// Width of a narrow cell, in deviations.
const NARROW: f64 = 1e-6;

struct Member {
    seat: Seat,
    node: Box<dyn SensorNode<1>>,
    /// Its last value, less its offset.
    last: Option<f64>,
}

struct Centre<const D: usize, F: StateFilter<D>> {
    centre: FusionCentre<D, F>,
    members: Vec<Member>,
    purpose: Use,
    period: Option<f64>,
    is_on_change: bool,
    zero: f64,
    rng: Pcg64Mcg,
    world: ContinuousLinear<D>,
    /// All beliefs, if they are to be smoothed.
    kept: Option<Vec<Filtered<D>>>,
}

/// Mean and standard deviation of each coordinate. `zero`: standard deviation of what all values of the level may be off.
fn moments<const D: usize>(belief: &Gaussian<D>, zero: f64) -> Vec<(f64, f64)> {
    let deviation = |i: usize| {
        let own = belief.covariance()[(i, i)].sqrt();
        if i == 0 { own.hypot(zero) } else { own }
    };
    (0..D).map(|i| (belief.mean()[i], deviation(i))).collect()
}

/// Of angles that differ by whole periods, the one nearest to the prediction. Other values keep every bit: one at a detection limit is no
/// longer at it after rounding.
fn nearest(cell: f64, expected: f64, period: Option<f64>) -> f64 {
    period.map_or(cell, |period| circle::nearest(cell, expected, period))
}

impl<const D: usize, F: StateFilter<D>> Centre<D, F> {
    fn new(model: ContinuousLinear<D>, filter: F, world: &World, purpose: Use) -> Result<Self, Failure> {
        let mut rng = Pcg64Mcg::seed_from_u64(0);
        let prior = world.start::<D>(world.change)?;
        let failures = Failures {
            rate: FAILURE / world.interval,
            ..Failures::default()
        };
        let mut centre = FusionCentre::new(&mut rng, model, filter, &prior)?.with_failures(failures)?;
        centre = centre.with_false_alarms(ALARMS)?;
        if world.is_learning && purpose != Use::Comparison {
            let learning = NoiseLearning {
                // Every sensor adds a term in each row, and they do not depend on each other.
                gain: LEARNING / (world.sensors.max(1) as f64).sqrt(),
                range: LEARNT,
            };
            centre = centre.learning_noise(learning)?;
        }
        Ok(Self {
            centre,
            members: Vec::new(),
            purpose,
            period: world.period,
            is_on_change: world.is_on_change,
            zero: world.zero,
            rng,
            world: model,
            kept: world.is_smoothed.then(Vec::new),
        })
    }

    fn slot(&mut self, sensor: usize, cell: Option<f64>, qualifier: Qualifier) -> Result<Slot, Failure> {
        let number = sensor as u32;
        let member = &mut self.members[sensor];
        if member.seat.is_stated() {
            let expected = self.centre.estimate().mean()[0];
            let cell = cell.filter(|cell| cell.is_finite());
            let cell = cell.map(|cell| nearest(cell - member.seat.offset, expected, self.period));
            let reading = member.seat.reading(cell, qualifier, member.last);
            member.last = cell.or(member.last);
            let bits = reading
                .map(|reading| reading.to_bits(&NumberFormat::Double))
                .transpose()?;
            return Ok(Slot::new(number, self.centre.feedback(number)?, Observation::from(bits)));
        }
        let feedback = match qualifier.threshold.or(member.seat.threshold) {
            // Only bits are told a threshold.
            Some(threshold) if member.seat.sends == Report::Sign => sensors::double(threshold - member.seat.offset)?,
            _ => self.centre.feedback(number)?,
        };
        // A measurement that is not finite counts as missing.
        let report = match cell.filter(|cell| cell.is_finite()) {
            None => None,
            Some(cell) if self.purpose == Use::Reports && member.seat.sends != Report::Value => {
                Some(sensors::bits(member.seat.sends, cell)?)
            }
            Some(cell) => {
                let expected = self.centre.estimate().mean()[0];
                let cell = nearest(cell - member.seat.offset, expected, self.period);
                let measurement = Vector1::new(cell);
                member.node.report(&mut self.rng, &measurement, &feedback)?
            }
        };
        Ok(Slot::new(number, feedback, Observation::from(report)))
    }
}

impl<const D: usize, F: StateFilter<D>> Estimator for Centre<D, F> {
    fn join(&mut self, seat: Seat) -> Result<(), Failure> {
        let sends = if self.purpose == Use::Comparison {
            Report::Value
        } else {
            seat.sends
        };
        let seat = Seat { sends, ..seat };
        let variance = seat.noise * seat.noise;
        let (number, link) = (self.members.len() as u32, Link::lossy(seat.loss)?);
        if seat.is_stated() {
            let usual = seat.usual() * seat.usual();
            let sensing = OnAxes::<_, D, 1>::new(LinearSensor::direct(usual)?, [0])?;
            let nothing = |_: &Gaussian<D>, _: &Gaussian<1>| ();
            let remote = Reporting::new(sensing, Stating::new(usual)?, link, nothing)
                .sending_values()
                .testing(if seat.meaning.silent_within.is_some() {
                    tested_on_change
                } else {
                    tested
                });
            self.centre.join_boxed(number, Box::new(remote))?;
        } else {
            self.centre.join_boxed(number, sends.remote::<D>(0, variance, link)?)?;
        }
        self.members.push(Member {
            node: sends.node::<D>(0, variance)?,
            last: None,
            seat,
        });
        Ok(())
    }

    fn seated(&self) -> usize {
        self.members.len()
    }

    fn step(&mut self, instant: &Instant) -> Result<Step, Failure> {
        // First the forecast: sensors compare with it, so the feedback of all slots is made before any report is used.
        self.centre.advance(&mut self.rng, instant.seconds)?;
        let mut slots = Vec::with_capacity(instant.reports.len());
        let (mut bits, mut reports) = (0, 0);
        for (i, (sensor, cell)) in instant.reports.iter().enumerate() {
            let slot = self.slot(*sensor, *cell, instant.qualifiers.get(i).copied().unwrap_or_default())?;
            if let Some(report) = slot.observation.received() {
                let is_stated = self.members[*sensor].seat.is_stated();
                // What a value means beside its number is known without being sent.
                bits += if !is_stated {
                    report.bits()
                } else if cell.is_some() {
                    VALUE_BITS
                } else {
                    0
                };
                reports += usize::from(!is_stated || cell.is_some());
            }
            slots.push(slot);
        }
        let received = self.centre.receive(&mut self.rng, &slots)?;
        let events = received.events.into_iter();
        let events = events.map(|event| (event.name(), event.sensor().map(|sensor| sensor as usize)));
        // Alarms are about values that come whatever they are, not about those that were sent because they are far from the last.
        let is_meant = |event: &(&'static str, Option<usize>)| {
            !self.is_on_change || !matches!(event.0, "lost" | "noise overstated")
        };
        let events: Vec<_> = events.filter(is_meant).collect();
        let rejected = events.iter().filter(|(event, _)| *event == "rejected").count();
        let belief = self.centre.estimate();
        if let Some(kept) = &mut self.kept {
            kept.push(Filtered {
                seconds: instant.seconds,
                belief,
                noise_scale: self.centre.noise_scale(),
                is_new: events
                    .iter()
                    .any(|(event, _)| matches!(*event, "reopened" | "reacquired")),
            });
        }
        Ok(Step {
            estimate: moments(&belief, self.zero),
            bits,
            reports,
            rejected,
            events,
            used: (0..self.members.len()).filter(|sensor| self.health(*sensor).1).count(),
            noise_scale: self.centre.noise_scale(),
        })
    }

    fn rescale(&mut self, scale: f64) -> Result<(), Failure> {
        Ok(self.centre.set_noise_scale(scale)?)
    }

    fn health(&self, sensor: usize) -> (f64, bool) {
        let number = sensor as u32;
        let used = |state: SensorState| (state.working, !state.declared_dead && !state.excluded);
        self.centre.sensor(number).map_or((0.0, false), used)
    }

    fn rejected(&self, sensor: usize) -> u64 {
        self.centre.sensor(sensor as u32).map_or(0, |state| state.rejected)
    }

    fn surprise(&self, sensor: usize) -> Option<f64> {
        self.centre.sensor(sensor as u32).ok()?.surprise
    }

    fn smoothed(&self, lag: Option<f64>) -> Result<Vec<Vec<(f64, f64)>>, Failure> {
        let beliefs = smooth(&self.world, self.kept.as_deref().unwrap_or_default(), lag)?;
        Ok(beliefs.iter().map(|belief| moments(belief, self.zero)).collect())
    }
}
