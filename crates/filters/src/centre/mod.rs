//! A fusion centre: a belief that moves with time, and the sensors that it receives from.
//!
//! Bits come in and go out; what carries them (a simulator, a socket, a recording) is the caller's. Sensors join and leave at any
//! time, report at any time and by any scheme. The centre knows how likely each still works ([presence](Failures)), says when its model
//! no longer holds ([health](FalseAlarms)), and goes on from a stored [`CentreState`] with the same bits.
//!
//! ```
//! use fewbits_core::{FullValue, Gaussian, Link, NumberFormat, Observation, OnAxes, Message};
//! use fewbits_filters::centre::{FusionCentre, Reporting, Slot};
//! use fewbits_filters::MomentFilter;
//! use fewbits_models::{ContinuousLinear, LinearSensor};
//! let mut rng = rand_pcg::Pcg64Mcg::new(1);
//! let world = ContinuousLinear::nearly_constant_velocity(0.1)?;
//! let prior = Gaussian::new([0.0, 1.0].into(), nalgebra::Matrix2::identity())?;
//! let mut centre = FusionCentre::new(&mut rng, world, MomentFilter, &prior)?;
//! let position = OnAxes::new(LinearSensor::direct(0.25)?, [0])?;
//! centre.join(7, Reporting::values(position, FullValue::new(0.25)?, Link::PERFECT))?;
//! let report = Message::to_bits(&2.1, &NumberFormat::Double)?;
//! let asked = centre.advance(&mut rng, 2.0)?.feedback(7)?;
//! centre.receive(&mut rng, &[Slot::new(7, asked, Observation::Received(report))])?;
//! assert!((centre.estimate().mean()[0] - 2.1).abs() < 0.2 && centre.time() == 2.0);
//! # Ok::<(), fewbits_filters::Error>(())
//! ```
//!
//! Not here: radio, addresses, frames; schemes of any one paper.

mod health;
mod judge;
mod late;
mod learning;
mod presence;
mod remote;
mod slot;
mod state;

pub use health::FalseAlarms;
pub use learning::NoiseLearning;
pub use presence::Failures;
pub use remote::{RemoteSensor, Reporting};
pub use slot::{Event, Received, Slot};
pub use state::CentreState;

use crate::Error;
use crate::contract::{Evolving, StateFilter, StateLikelihood};
use fewbits_core::factor::Scalar;
use fewbits_core::{Belief, BitString, Gaussian, Observation};
use fewbits_numerics::error::{finite, non_negative, positive, refuse};
use rand::Rng;
use state::{Checkpoint, MemberState};
use std::collections::BTreeMap;

struct Member<const D: usize> {
    sensor: Box<dyn RemoteSensor<D>>,
    /// Whether nothing but the link keeps its reports back.
    always_speaks: bool,
    state: MemberState,
}

/// A belief that moves with time, and sensors that come and go.
///
/// ```text
/// advance(t):  belief = predict(over(t - now), noise scale);  every sensor may have failed meanwhile
/// feedback(i): what sensor i is told, from the belief now
/// receive:     likelihoods of all slots of one instant, each with the probability that its sensor works
///              presence, residuals and their tests, from the belief before;  belief = update(likelihoods)
/// late(t):     back to the last belief before t;  all that came since, and the late slots, in order of time
/// ```
/// A call that fails leaves the centre as it was.
pub struct FusionCentre<const D: usize, F: StateFilter<D>> {
    world: Box<dyn Evolving<D>>,
    filter: F,
    belief: F::Belief,
    now: f64,
    noise_scale: f64,
    members: BTreeMap<u32, Member<D>>,
    outage: presence::Outage,
    monitor: health::Monitor,
    history: Vec<Checkpoint<F::Belief>>,
    dropped: u64,
    failures: Failures,
    false_alarms: FalseAlarms,
    learning: Option<NoiseLearning>,
    acquisition: Option<Gaussian<D>>,
    window: f64,
}

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// A centre without sensors that knows `prior` at time 0.
    ///
    /// # Errors
    /// If the filter cannot represent the prior.
    pub fn new(
        rng: &mut dyn Rng,
        world: impl Evolving<D> + 'static,
        mut filter: F,
        prior: &Gaussian<D>,
    ) -> Result<Self, Error> {
        let belief = filter.start(rng, prior)?;
        Ok(Self {
            world: Box::new(world),
            filter,
            belief,
            now: 0.0,
            noise_scale: 1.0,
            members: BTreeMap::new(),
            outage: presence::Outage::default(),
            monitor: health::Monitor::default(),
            history: Vec::new(),
            dropped: 0,
            failures: Failures::default(),
            false_alarms: FalseAlarms::default(),
            learning: None,
            acquisition: None,
            window: 0.0,
        })
    }

    /// The same with other suppositions about failures.
    ///
    /// # Errors
    /// If a rate is out of range.
    pub fn with_failures(self, failures: Failures) -> Result<Self, Error> {
        failures.check()?;
        Ok(Self { failures, ..self })
    }

    /// The same with other rates of false alarms.
    ///
    /// # Errors
    /// If a rate is out of range.
    pub fn with_false_alarms(self, false_alarms: FalseAlarms) -> Result<Self, Error> {
        false_alarms.check()?;
        Ok(Self { false_alarms, ..self })
    }

    /// The same with process noise that is learnt.
    ///
    /// # Errors
    /// If the gain is negative or the range is none.
    pub fn learning_noise(self, learning: NoiseLearning) -> Result<Self, Error> {
        learning.check()?;
        Ok(Self {
            learning: Some(learning),
            ..self
        })
    }

    /// The same with another factor of the stated process noise to begin with: one that was learnt before.
    ///
    /// # Errors
    /// If it is not above 0.
    pub fn with_noise_scale(self, noise_scale: f64) -> Result<Self, Error> {
        positive("noise_scale", noise_scale)?;
        Ok(Self { noise_scale, ..self })
    }

    /// The same, starting anew from `prior` whenever the track is lost: what is known of the state without any report.
    /// What was learnt of the process noise is kept.
    #[must_use]
    pub fn reacquire_from(self, prior: Gaussian<D>) -> Self {
        Self {
            acquisition: Some(prior),
            ..self
        }
    }

    /// The same, taking in reports that are at most `window` seconds late. It keeps every belief and slot of that time.
    ///
    /// # Errors
    /// If the window is negative or not finite.
    pub fn with_window(self, window: f64) -> Result<Self, Error> {
        non_negative("window", window)?;
        Ok(Self { window, ..self })
    }

    /// Seats a sensor; one of the same number is replaced.
    ///
    /// # Errors
    /// If the sensor cannot ask for a report under the present belief: its noise is stated twice with different numbers.
    pub fn join(&mut self, number: u32, sensor: impl RemoteSensor<D> + 'static) -> Result<(), Error> {
        let estimate = self.estimate();
        let feedback = sensor.feedback(&estimate)?;
        let nothing = sensor.likelihood(&feedback, &Observation::Nothing, 1.0).ok();
        let nothing = nothing.and_then(|one| one.as_linear_scalar(estimate.mean()));
        let member = Member {
            always_speaks: nothing.is_some_and(|(one, _)| matches!(one.factor, Scalar::Constant(_))),
            sensor: Box::new(sensor),
            state: MemberState::new(),
        };
        self.members.insert(number, member);
        Ok(())
    }

    /// Dismisses a sensor. Whether there was one.
    pub fn leave(&mut self, number: u32) -> bool {
        self.members.remove(&number).is_some()
    }

    /// Numbers of the sensors.
    pub fn sensors(&self) -> impl Iterator<Item = u32> + '_ {
        self.members.keys().copied()
    }

    /// Seconds since the prior.
    pub fn time(&self) -> f64 {
        self.now
    }

    /// The belief as the filter has it.
    pub fn belief(&self) -> &F::Belief {
        &self.belief
    }

    /// Mean and covariance of the belief.
    pub fn estimate(&self) -> Gaussian<D> {
        Gaussian::from_trusted_parts(self.belief.mean(), self.belief.covariance())
    }

    /// The filter.
    pub fn filter(&self) -> &F {
        &self.filter
    }

    /// Factor of the stated process noise, as it was learnt.
    pub fn noise_scale(&self) -> f64 {
        self.noise_scale
    }

    /// Reports that came too late.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Probability that a sensor works.
    ///
    /// # Errors
    /// If there is no such sensor.
    pub fn working(&self, number: u32) -> Result<f64, Error> {
        Ok(self.member(number)?.state.presence.working)
    }

    /// Whether a sensor is taken for dead.
    ///
    /// # Errors
    /// If there is no such sensor.
    pub fn is_named_dead(&self, number: u32) -> Result<bool, Error> {
        Ok(self.member(number)?.state.presence.named_dead)
    }

    /// Whether a sensor's reports are not used at present.
    ///
    /// # Errors
    /// If there is no such sensor.
    pub fn is_excluded(&self, number: u32) -> Result<bool, Error> {
        Ok(self.member(number)?.state.excluded)
    }

    fn member(&self, number: u32) -> Result<&Member<D>, Error> {
        let seated = self.members.len();
        self.members
            .get(&number)
            .ok_or(Error::UnknownSensor { sensor: number, seated })
    }

    /// Moves the belief to `time` (seconds since the prior).
    ///
    /// # Errors
    /// If the time is not finite or before the present.
    pub fn advance(&mut self, rng: &mut dyn Rng, time: f64) -> Result<&mut Self, Error> {
        let seconds = finite("time", time)? - self.now;
        if seconds < 0.0 {
            return refuse("time", time, format!("{} or later; see `late`", self.now));
        }
        if seconds > 0.0 {
            let motion = self.world.over(seconds)?;
            let mut belief = self.belief.clone();
            self.filter.predict(rng, &*motion, self.noise_scale, &mut belief)?;
            self.belief = belief;
            let sensors = self.members.values_mut().map(|member| &mut member.state.presence);
            self.outage.advance(seconds, &self.failures, sensors);
            self.now = time;
        }
        Ok(self)
    }

    /// What a sensor is told before it measures.
    ///
    /// # Errors
    /// If there is no such sensor, or as [`RemoteSensor::feedback`].
    pub fn feedback(&self, number: u32) -> Result<BitString, Error> {
        self.member(number)?.sensor.feedback(&self.estimate())
    }

    /// Takes in what was observed at the present instant.
    ///
    /// # Errors
    /// If a sensor is unknown or bits do not decode; [`fewbits_core::Error::Impossible`] if the observations are impossible together, in
    /// which case the caller may drop them or start anew.
    pub fn receive(&mut self, rng: &mut dyn Rng, slots: &[Slot]) -> Result<Received, Error> {
        let predicted = self.estimate();
        // A report is judged given those before it: sensors that err with the prediction would else count as independent. Silence is judged by
        // the prediction alone, since the silence of sensors that died together would speak for each other's.
        let mut given = predicted;
        let mut used = Vec::with_capacity(slots.len());
        let mut watched = Vec::with_capacity(slots.len());
        for slot in slots {
            let member = self.member(slot.sensor)?;
            let working = member.state.presence.working;
            let likelihood = member.sensor.likelihood(&slot.feedback, &slot.observation, working)?;
            let is_report = matches!(slot.observation, Observation::Received(_));
            let belief = if is_report { &given } else { &predicted };
            watched.push(self.watch(member, slot, belief, &*likelihood)?);
            if !member.state.excluded {
                if is_report
                    && slots.len() > 1
                    && let Ok(conditioned) = likelihood.condition(&given)
                {
                    given = conditioned.belief;
                }
                used.push(likelihood);
            }
        }
        let before = (self.window > 0.0).then(|| self.belief.clone());
        let mut belief = self.belief.clone();
        let used: Vec<&dyn StateLikelihood<D>> = used.iter().map(|one| &**one).collect();
        let info = self.filter.update(rng, &mut belief, &used)?;
        self.belief = belief;
        if let Some(before) = before {
            self.remember(before, slots);
        }
        let events = self.judge(rng, slots, &watched)?;
        Ok(Received { info, events })
    }
}
