//! A fusion centre: a belief that is predicted in continuous time and updated by the reports of many sensors.
//!
//! Input and output are bits. The caller carries them (by a simulator, a socket, a recording). Sensors join and leave at any time, and
//! report at any time by any scheme. The centre estimates the probability that each sensor still works ([presence](Failures)), raises an
//! alarm if its model no longer holds ([health](FalseAlarms)), and resumes from a stored [`CentreState`] with the same bits.
//!
//! ```
//! use fewbits_core::{Evolution, FullValue, Gaussian, Link, Message, NumberFormat, Observation, OnAxes};
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
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Not in this module: radio, addresses, frames; the scheme of any single paper.

mod alternative;
mod by_value;
mod constant_noise;
mod gate;
mod health;
mod judge;
mod late;
mod law;
mod learning;
mod log_ratio;
mod one_wrong;
mod presence;
mod rate;
mod reading;
mod receive;
mod remote;
mod repeats;
mod slot;
mod state;
mod together;
mod window;

pub use constant_noise::ConstantNoise;
pub use fewbits_core::Event;
pub use health::{FalseAlarms, Health};
pub use learning::NoiseLearning;
pub use presence::Failures;
pub use remote::{RemoteSensor, ReportTest, Reporting};
pub use slot::{Received, SensorState, Slot};
pub use state::CentreState;

use crate::Error;
use crate::contract::StateFilter;
use fewbits_core::{ArgumentError, Belief, BitString, Evolution, Gaussian, Observation};
use fewbits_numerics::error::{finite, non_negative, refuse};
use rand::Rng;
use state::{Checkpoint, MemberState};

struct Member<const D: usize> {
    number: u32,
    sensor: Box<dyn RemoteSensor<D>>,
    /// Probability that a report that was sent arrives.
    arrival: f64,
    /// Whether the sensor is never silent: a missing report was then lost on the link.
    always_speaks: bool,
    group: Option<u32>,
    state: MemberState,
}

/// A belief that is predicted over time, and the sensors that report to the centre.
///
/// ```text
/// advance(t):  belief = predict(over(t - now), noise scale);  the failure probability of every sensor grows
/// feedback(i): bits for sensor i, from the present belief
/// receive:     likelihoods of all slots of one instant; a silent sensor works with the probability found so far, one that reports works
///              test each report given the prediction and all others; reject those that are too unlikely
///              belief = update(likelihoods);  presence, residuals and their tests
/// late(t):     go back to the last belief before t;  repeat all later updates, the late slots included, in the order of time
/// ```
/// A call that fails leaves the centre unchanged.
pub struct FusionCentre<const D: usize, F: StateFilter<D>> {
    world: Box<dyn Evolution<D>>,
    filter: F,
    belief: F::Belief,
    now: f64,
    noise_scale: f64,
    /// In increasing order of their numbers.
    members: Vec<Member<D>>,
    outage: presence::Outage,
    monitor: health::Monitor,
    history: Vec<Checkpoint<F::Belief>>,
    dropped: u64,
    /// Number of instants in a row of which no report was used.
    astray: u32,
    alternative: Option<alternative::Alternative<D>>,
    health: Health,
    failures: Failures,
    limits: health::Limits,
    learning: Option<NoiseLearning>,
    acquisition: Option<Gaussian<D>>,
    window: f64,
}

impl<const D: usize, F: StateFilter<D>> FusionCentre<D, F> {
    /// A centre without sensors, with the belief `prior` at time 0.
    ///
    /// # Errors
    /// If the filter cannot represent the prior.
    pub fn new(
        rng: &mut dyn Rng,
        world: impl Evolution<D> + 'static,
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
            members: Vec::new(),
            outage: presence::Outage::default(),
            monitor: health::Monitor::default(),
            history: Vec::new(),
            dropped: 0,
            astray: 0,
            alternative: None,
            health: Health::default(),
            failures: Failures::default(),
            limits: health::Limits::new(&FalseAlarms::default()),
            learning: None,
            acquisition: None,
            window: 0.0,
        })
    }

    /// The same centre with other assumptions about failures.
    ///
    /// # Errors
    /// If a rate is out of range.
    pub fn with_failures(self, failures: Failures) -> Result<Self, Error> {
        failures.check()?;
        Ok(Self { failures, ..self })
    }

    /// The same centre with other rates of false alarms.
    ///
    /// # Errors
    /// If a rate is out of range.
    pub fn with_false_alarms(self, false_alarms: FalseAlarms) -> Result<Self, Error> {
        false_alarms.check()?;
        Ok(Self {
            limits: health::Limits::new(&false_alarms),
            ..self
        })
    }

    /// The same centre with another use of its tests.
    #[must_use]
    pub fn with_health(self, health: Health) -> Self {
        Self { health, ..self }
    }

    /// The same centre, learning the scale of the process noise.
    ///
    /// # Errors
    /// If the gain is negative, or the range is not two positive numbers, the smaller first.
    pub fn learning_noise(self, learning: NoiseLearning) -> Result<Self, Error> {
        learning.check()?;
        Ok(Self {
            learning: Some(learning),
            ..self
        })
    }

    /// The same centre, which restarts from `prior` whenever the track is lost. `prior` is the distribution of the state without any
    /// report. The learnt scale of the process noise is kept.
    #[must_use]
    pub fn reacquire_from(self, prior: Gaussian<D>) -> Self {
        Self {
            acquisition: Some(prior),
            ..self
        }
    }

    /// The same centre, which accepts reports that are at most `window` seconds late. It stores the beliefs and slots of that time.
    ///
    /// # Errors
    /// If the window is negative or not finite.
    pub fn with_window(self, window: f64) -> Result<Self, Error> {
        non_negative("window", window)?;
        Ok(Self { window, ..self })
    }

    /// Adds a sensor. An earlier sensor of the same number is replaced.
    ///
    /// # Errors
    /// If the sensor cannot compute its feedback under the present belief, or its scheme and its sensing model state different noise.
    pub fn join(&mut self, number: u32, sensor: impl RemoteSensor<D> + 'static) -> Result<(), Error> {
        self.join_boxed(number, Box::new(sensor))
    }

    /// As [`join`](Self::join), for a type of sensor that is chosen at run time.
    ///
    /// # Errors
    /// As [`join`](Self::join).
    pub fn join_boxed(&mut self, number: u32, sensor: Box<dyn RemoteSensor<D>>) -> Result<(), Error> {
        self.seat_with(number, sensor, MemberState::new())
    }

    /// Replaces the scheme of a sensor that has joined, by that of the next slot for example. What the centre knows of the sensor's presence and
    /// health is kept.
    ///
    /// # Errors
    /// If there is no such sensor; as [`join`](Self::join).
    pub fn renew(&mut self, number: u32, sensor: impl RemoteSensor<D> + 'static) -> Result<(), Error> {
        let state = self.member(number)?.state;
        self.seat_with(number, Box::new(sensor), state)
    }

    fn seat_with(&mut self, number: u32, sensor: Box<dyn RemoteSensor<D>>, state: MemberState) -> Result<(), Error> {
        // The feedback is computed here, so that a sensor whose models state different noise is refused now and not at its first report.
        let silent = Slot::new(number, sensor.feedback(&self.estimate())?, Observation::Nothing);
        let nothing = sensor.likelihood(&silent, 1.0);
        let member = Member {
            number,
            arrival: sensor.arrival(),
            always_speaks: nothing.is_ok_and(|one| one.as_constant().is_some()),
            group: sensor.group(),
            sensor,
            state,
        };
        match self.seat(number, 0) {
            Ok(seat) => self.members[seat] = member,
            Err(seat) => self.members.insert(seat, member),
        }
        Ok(())
    }

    /// Removes a sensor. Returns whether there was one.
    pub fn leave(&mut self, number: u32) -> bool {
        self.seat(number, 0).map(|seat| self.members.remove(seat)).is_ok()
    }

    /// Numbers of the sensors.
    pub fn sensors(&self) -> impl Iterator<Item = u32> + '_ {
        self.members.iter().map(|member| member.number)
    }

    /// Present time, in seconds since the prior.
    pub fn time(&self) -> f64 {
        self.now
    }

    /// The belief in the representation of the filter.
    pub fn belief(&self) -> &F::Belief {
        &self.belief
    }

    /// Mean and covariance of the belief, as a Gaussian.
    pub fn estimate(&self) -> Gaussian<D> {
        Gaussian::from_trusted_parts(self.belief.mean(), self.belief.covariance())
    }

    /// The filter.
    pub fn filter(&self) -> &F {
        &self.filter
    }

    /// Sets the factor of the stated process noise, from which learning goes on.
    ///
    /// # Errors
    /// If it is not positive.
    pub fn set_noise_scale(&mut self, scale: f64) -> Result<(), Error> {
        self.noise_scale = fewbits_numerics::error::positive("scale", scale)?;
        Ok(())
    }

    /// The learnt factor of the stated process noise; 1 without learning, if none is set.
    pub fn noise_scale(&self) -> f64 {
        self.noise_scale
    }

    /// Number of reports that were dropped because they were too late.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// What the centre knows of a sensor.
    ///
    /// # Errors
    /// If there is no such sensor.
    pub fn sensor(&self, number: u32) -> Result<SensorState, Error> {
        let state = &self.member(number)?.state;
        Ok(SensorState {
            working: state.presence.working,
            declared_dead: state.presence.named_dead,
            excluded: state.excluded || (state.repeats.is_stuck && self.health == Health::Exclude),
            disputed: state.disputed,
            rejected: state.rejected,
            unreadable: state.unreadable,
            copies: state.copies,
            surprise: state.rate.score(),
        })
    }

    /// Index of a sensor, or the index at which to insert it. Slots are mostly in order, so `guess` is tried first.
    fn seat(&self, number: u32, guess: usize) -> Result<usize, usize> {
        match self.members.get(guess) {
            Some(member) if member.number == number => Ok(guess),
            _ => self.members.binary_search_by_key(&number, |member| member.number),
        }
    }

    fn member(&self, number: u32) -> Result<&Member<D>, Error> {
        Ok(&self.members[self.seated(number, 0)?])
    }

    #[inline]
    fn seated(&self, number: u32, guess: usize) -> Result<usize, Error> {
        let seated = self.members.len();
        let expected = || format!("one of the {seated} sensors that have joined");
        let unknown = |_| ArgumentError::new("number", number, expected()).into();
        self.seat(number, guess).map_err(unknown)
    }

    /// Predicts the belief to `time` (seconds since the prior).
    ///
    /// # Errors
    /// If the time is not finite, earlier than the present time, or so late that the variance of the belief overflows.
    pub fn advance(&mut self, rng: &mut dyn Rng, time: f64) -> Result<&mut Self, Error> {
        let seconds = finite("time", time)? - self.now;
        if seconds < 0.0 {
            return refuse("time", time, format!("{} or later; see `late`", self.now));
        }
        if seconds > 0.0 {
            // On a copy, so that a failure leaves the centre as it was.
            let mut belief = self.belief.clone();
            let alternative = match self.alternative {
                Some(alternative) => alternative.moved(&*self.world.over(seconds)?, self.noise_scale),
                None => None,
            };
            self.moved(rng, &mut belief, seconds).map_err(|error| match error {
                Error::NotANumber { .. } => {
                    ArgumentError::new("time", time, "a time at which the belief has finite moments").into()
                }
                other => other,
            })?;
            (self.belief, self.alternative) = (belief, alternative);
            let sensors = self.members.iter_mut().map(|member| &mut member.state.presence);
            self.outage.advance(seconds, &self.failures, sensors);
            self.now = time;
        }
        Ok(self)
    }

    /// The bits that a sensor is told before it measures.
    ///
    /// # Errors
    /// If there is no such sensor, or if [`RemoteSensor::feedback`] fails.
    pub fn feedback(&self, number: u32) -> Result<BitString, Error> {
        self.member(number)?.sensor.feedback(&self.estimate())
    }
}
