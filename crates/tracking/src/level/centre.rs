//! The fusion centre for sensors that all measure the same level.

use crate::error::Failure;
use crate::first::lasting::{ErrorUnderLasting, Lasting};
use crate::level::band::{Pending, moments};
use crate::level::estimator::{Estimator, Event, LevelRow, Revision, Use};
use crate::level::meaning::Seat;
use crate::level::open;
use crate::level::options::Model;
use crate::level::remote::remote;
use crate::level::report::{Report, double};
use crate::level::saved::{Marks, Saved};
use crate::level::world::World;
use crate::rows::instant::{Instant, Qualifier};
use fewbits_core::{Gaussian, Message, NumberFormat, Observation, SensorNode, circle};
use fewbits_filters::centre::{Failures, FalseAlarms, FusionCentre, NoiseLearning, SensorState, Slot};
use fewbits_filters::smoother::{Filtered, smooth};
use fewbits_filters::{MomentFilter, PointMassFilter, StateFilter};
use fewbits_models::ContinuousLinear;
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
/// The same where errors of sensors last, which no test of the centre expects.
const ALARMS_IF_LASTING: FalseAlarms = FalseAlarms {
    sensor: 1e-9,
    centre: 1e-9,
};
/// Step of the learnt change for one sensor. The change that is found from the first rows is accurate already, so it is small.
const LEARNING: f64 = 0.01;
/// Smallest and largest factor of the change's variance: a level may rest while it is found, and then move.
const LEARNT: [f64; 2] = [1e-3, 1e6];
/// Bits of a value.
const VALUE_BITS: usize = 64;

/// A centre for the model.
pub(crate) fn centre(world: &World, purpose: Use) -> Result<Box<dyn Estimator>, Failure> {
    Ok(match world.model {
        Model::Velocity => {
            let model = world.velocity(world.change)?;
            Box::new(Centre::<2, _>::new(model, MomentFilter, world, purpose)?)
        }
        Model::Acceleration => {
            let model = world.acceleration(world.change)?;
            Box::new(Centre::<3, _>::new(model, MomentFilter, world, purpose)?)
        }
        Model::Returning | Model::Walk => {
            let model = world.walk(world.change)?;
            if world.is_on_grid {
                Box::new(Centre::<1, _>::new(model, PointMassFilter::following(), world, purpose)?)
            } else {
                Box::new(Centre::<1, _>::new(model, MomentFilter, world, purpose)?)
            }
        }
    })
}

pub(super) struct Member {
    pub(super) seat: Seat,
    pub(super) node: Box<dyn SensorNode<1>>,
    /// Its last value, less its offset.
    pub(super) last: Option<f64>,
}

pub(super) struct Centre<const D: usize, F: StateFilter<D>> {
    pub(super) centre: FusionCentre<D, F>,
    pub(super) members: Vec<Member>,
    purpose: Use,
    period: Option<f64>,
    is_on_change: bool,
    zero: f64,
    /// Factor of the level's deviation for what the rows leave open of change and noises.
    open: f64,
    pub(super) rng: Pcg64Mcg,
    world: ContinuousLinear<D>,
    /// All beliefs, if they are to be smoothed.
    pub(super) kept: Option<Vec<Filtered<D>>>,
    /// The error under noise that lasts, and its deviation in those of the belief at each instant.
    pub(super) error: Option<ErrorUnderLasting>,
    pub(super) wider: Vec<f64>,
    interval: f64,
    pub(super) instants: usize,
    /// Values that are not believed yet.
    pub(super) pending: Pending,
    pub(super) marks: Option<Marks<F::Belief>>,
    /// The state before the last instant.
    pub(super) before: Option<Saved<F::Belief>>,
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
        let alarms = if world.is_lasting { ALARMS_IF_LASTING } else { ALARMS };
        centre = centre.with_false_alarms(alarms)?;
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
            open: world.open.as_ref().map_or(1.0, open::factor),
            rng,
            world: model,
            kept: world.is_smoothed.then(Vec::new),
            error: None,
            wider: Vec::new(),
            interval: world.interval,
            instants: 0,
            pending: Pending::default(),
            marks: world.is_followed.then(Marks::new),
            before: None,
        })
    }

    /// The deviation of the error under noise that lasts, in those of the belief. `before`: time and belief before the forecast.
    fn wider(
        &mut self,
        instant: &Instant,
        events: &[Event],
        before: (f64, Gaussian<D>),
        forecast: &Gaussian<D>,
    ) -> f64 {
        let belief = self.centre.estimate().covariance()[(0, 0)];
        let used: Vec<bool> = (0..self.members.len()).map(|sensor| self.health(sensor).1).collect();
        let Some(error) = &mut self.error else { return 1.0 };
        let change = forecast.covariance()[(0, 0)] - before.1.covariance()[(0, 0)];
        error.advance((instant.seconds - before.0) / self.interval, change.max(0.0));
        let mut gains = vec![0.0; self.members.len()];
        for (sensor, cell) in &instant.reports {
            let is_taken = used[*sensor] && !events.contains(&("rejected", Some(*sensor)));
            if cell.is_some_and(f64::is_finite) && is_taken {
                gains[*sensor] = belief / self.members[*sensor].seat.noise.powi(2);
            }
        }
        // Reports of which one is taken to be wrong count less together.
        let all: f64 = gains.iter().sum();
        gains.iter_mut().for_each(|gain| *gain /= all.max(1.0));
        if events.iter().any(|(event, _)| *event == "reopened") {
            error.forget(belief);
        }
        (error.update(&gains) / belief).sqrt().max(1.0)
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
            Some(threshold) if member.seat.sends == Report::Sign => double(threshold - member.seat.offset)?,
            _ => self.centre.feedback(number)?,
        };
        // A measurement that is not finite counts as missing.
        let report = match cell.filter(|cell| cell.is_finite()) {
            None => None,
            Some(cell) if self.purpose == Use::Reports && member.seat.sends != Report::Value => {
                Some(member.seat.sends.bits(cell)?)
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

    /// The deviation of a level of which the only sensor says something else, again and again.
    fn doubt(&mut self, instant: &Instant, events: &[Event], level: f64) -> f64 {
        let mut values = instant.values();
        let (Some((sensor, value)), None) = (values.next(), values.next()) else {
            self.pending.clear();
            return 0.0;
        };
        let is_used = |sensor: usize| self.health(sensor).1;
        let is_alone = (0..self.members.len()).all(|other| other == sensor || !is_used(other));
        if !is_alone || self.purpose == Use::Reports || !events.contains(&("rejected", Some(sensor))) {
            self.pending.clear();
            return 0.0;
        }
        let seat = &self.members[sensor].seat;
        let value = nearest(value - seat.offset, level, self.period);
        self.pending.add(value, seat.usual(), level)
    }

    /// Processes an instant.
    fn stepped(&mut self, instant: &Instant) -> Result<LevelRow, Failure> {
        // First the forecast: sensors compare with it, so the feedback of all slots is made before any report is used.
        let before = (self.centre.time(), self.centre.estimate());
        self.centre.advance(&mut self.rng, instant.seconds)?;
        let forecast = self.centre.estimate();
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
        // Alarms are about values that come whatever they are, not about those that were sent because they are far off.
        let is_meant = |event: &(&'static str, Option<usize>)| {
            !self.is_on_change || !matches!(event.0, "lost" | "noise overstated")
        };
        let events: Vec<_> = events.filter(is_meant).collect();
        let rejected = events.iter().filter(|(event, _)| *event == "rejected").count();
        let belief = self.centre.estimate();
        let wider = self.open * self.wider(instant, &events, before, &forecast);
        self.wider.extend(self.kept.is_some().then_some(wider));
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
        let mut estimate = moments(&belief, wider, self.zero);
        estimate[0].1 = estimate[0].1.max(self.doubt(instant, &events, estimate[0].0));
        Ok(LevelRow {
            estimate,
            bits,
            reports,
            rejected,
            events,
            forecast: (forecast.mean()[0], forecast.covariance()[(0, 0)]),
            used: (0..self.members.len()).filter(|sensor| self.health(*sensor).1).count(),
            noise_scale: self.centre.noise_scale(),
            full: None,
        })
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
        self.centre.join_boxed(self.members.len() as u32, remote(&seat)?)?;
        self.members.push(Member {
            node: sends.node(seat.noise * seat.noise)?,
            last: None,
            seat,
        });
        Ok(())
    }

    fn seated(&self) -> usize {
        self.members.len()
    }

    fn step(&mut self, instant: &Instant) -> Result<LevelRow, Failure> {
        let mut saved = self.saved();
        let found = self.stepped(instant);
        match found {
            Ok(_) => {
                self.instants += 1;
                if let Some(marks) = &mut self.marks {
                    marks.add(&mut saved);
                }
                self.before = Some(saved);
            }
            Err(_) => self.return_to(saved),
        }
        found
    }

    fn undo(&mut self) {
        if let Some(saved) = self.before.take() {
            self.return_to(saved);
        }
    }

    fn revise(&mut self, revision: &Revision<'_>) -> Result<Option<LevelRow>, Failure> {
        self.revised(revision)
    }

    fn under(&mut self, lasting: &Lasting) {
        let variance = self.centre.estimate().covariance()[(0, 0)];
        self.error = Some(ErrorUnderLasting::new(lasting.parts.clone(), variance));
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
        let all = beliefs.iter().zip(&self.wider);
        Ok(all.map(|(belief, wider)| moments(belief, *wider, self.zero)).collect())
    }
}
