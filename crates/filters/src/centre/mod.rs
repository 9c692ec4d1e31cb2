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
mod presence;
mod remote;
mod state;

pub use health::FalseAlarms;
pub use presence::Failures;
pub use remote::{RemoteSensor, Reporting};
pub use state::CentreState;

use crate::Error;
use crate::contract::{Evolving, Info, StateFilter, StateLikelihood};
use fewbits_core::{Belief, BitString, Gaussian, Observation};
use fewbits_numerics::error::{finite, non_negative, positive, refuse};
use health::{Alarm, Residual, SEQUENCES, limit};
use rand::Rng;
use state::{Checkpoint, MemberState, StoredSlot};
use std::collections::BTreeMap;

/// Reports of at most this many bits are words, whose alternatives are enumerated.
const WORD_BITS: usize = 4;
/// Observations without an alarm after which an excluded sensor is believed again.
const READMISSION: u32 = 100;

/// One sensor in one slot: what it was told, and what was observed of it. A sensor that was not asked has no slot.
#[derive(Debug, Clone, PartialEq)]
pub struct Slot {
    /// Number of the sensor.
    pub sensor: u32,
    /// The feedback as it travelled.
    pub feedback: BitString,
    /// What was observed.
    pub observation: Observation<BitString>,
}

impl Slot {
    /// A slot of sensor `sensor`.
    pub fn new(sensor: u32, feedback: BitString, observation: Observation<BitString>) -> Self {
        Self {
            sensor,
            feedback,
            observation,
        }
    }
}

/// Something that the centre noticed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event {
    /// A sensor has been silent for so long that it is taken for dead. Its silence no longer says anything.
    Dead(u32),
    /// A report came from a sensor that had been taken for dead.
    Alive(u32),
    /// A sensor's reports contradict the others': they are no longer used, but still watched.
    Excluded(u32),
    /// An excluded sensor has agreed with the others for long and is used again.
    Readmitted(u32),
    /// The model does not hold for the sensors together: observations are too unlikely, or residuals repeat. The track is lost, or a noise
    /// is understated.
    Lost,
    /// Observations are likelier than they should be, or residuals alternate: a noise is overstated.
    NoiseOverstated,
    /// The belief was replaced by the prior of [`FusionCentre::reacquire_from`].
    Reacquired,
}

/// What an update reveals.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Received {
    /// What the filter says.
    pub info: Info,
    /// What the centre noticed.
    pub events: Vec<Event>,
}

/// Process noise learnt from the signs of neighbouring residuals: `ln Q <- ln Q + gain b_k b_(k-1)`.
///
/// Residuals of a right model are independent; if `Q` is too small they repeat, if too large they alternate. It costs no bits and works
/// from one bit per sample on. On signals of bursts and rests one scale is not enough ([`NoiseBank`](crate::NoiseBank)).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseLearning {
    /// Step of `ln Q` per observation; .03 follows a ninefold jump within 200 samples, .01 is finer and slower.
    pub gain: f64,
    /// Smallest and largest factor of the stated process noise.
    pub range: [f64; 2],
}

impl NoiseLearning {
    /// Steps of .03, within a factor of 1000 to either side.
    pub const DEFAULT: Self = Self {
        gain: 0.03,
        range: [1e-3, 1e3],
    };

    fn check(&self) -> Result<(), Error> {
        non_negative("gain", self.gain)?;
        positive("range", self.range[0])?;
        positive("range", self.range[1])?;
        if self.range[0] > self.range[1] {
            return refuse("range", format!("{:?}", self.range), "the smaller factor first");
        }
        Ok(())
    }
}

struct Member<const D: usize> {
    sensor: Box<dyn RemoteSensor<D>>,
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

    /// The same, starting anew from `prior` whenever the track is lost: what is known of the state without any report.
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
        sensor.feedback(&self.estimate())?;
        let member = Member {
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
            for member in self.members.values_mut() {
                member.state.presence.advance(seconds, &self.failures);
            }
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
        let mut used = Vec::with_capacity(slots.len());
        let mut watched = Vec::with_capacity(slots.len());
        for slot in slots {
            let member = self.member(slot.sensor)?;
            let working = member.state.presence.working;
            let likelihood = member.sensor.likelihood(&slot.feedback, &slot.observation, working)?;
            watched.push(self.watch(member, slot, &predicted, &*likelihood)?);
            if !member.state.excluded {
                used.push(likelihood);
            }
        }
        let before = (self.window > 0.0).then(|| self.belief.clone());
        let mut belief = self.belief.clone();
        let info = self.filter.update(rng, &mut belief, &used)?;
        self.belief = belief;
        if let Some(before) = before {
            self.remember(before, slots);
        }
        let events = self.judge(rng, slots, &watched)?;
        Ok(Received { info, events })
    }

    /// Takes in what was observed at an earlier `time`: the belief goes back to it, and all that came since is taken in again. Returns
    /// whether it did; reports older than the window are dropped and counted. Presence and health are not judged again.
    ///
    /// # Errors
    /// As [`receive`](Self::receive).
    pub fn late(&mut self, rng: &mut dyn Rng, time: f64, slots: &[Slot]) -> Result<bool, Error> {
        finite("time", time)?;
        let Some(from) = self.history.iter().rposition(|checkpoint| checkpoint.time <= time) else {
            self.dropped += slots.len() as u64;
            return Ok(false);
        };
        let mut replayed = self.history[from..].to_vec();
        let stored: Vec<StoredSlot> = slots.iter().map(|slot| self.stored(slot)).collect::<Result<_, _>>()?;
        let at = replayed.partition_point(|checkpoint| checkpoint.time <= time);
        let late = Checkpoint {
            time,
            belief: replayed[0].belief.clone(),
            slots: stored,
        };
        replayed.insert(at, late);
        let (mut belief, mut now) = (replayed[0].belief.clone(), replayed[0].time);
        for checkpoint in &mut replayed {
            self.moved(rng, &mut belief, checkpoint.time - now)?;
            now = checkpoint.time;
            checkpoint.belief = belief.clone();
            let mut likelihoods: Vec<Box<dyn StateLikelihood<D>>> = Vec::new();
            for slot in checkpoint.slots.iter().filter(|slot| slot.used) {
                // A sensor may have left since.
                if let Some(member) = self.members.get(&slot.sensor) {
                    let (feedback, observation) = slot.bits()?;
                    likelihoods.push(member.sensor.likelihood(&feedback, &observation, slot.working)?);
                }
            }
            self.filter.update(rng, &mut belief, &likelihoods)?;
        }
        self.moved(rng, &mut belief, self.now - now)?;
        self.history.truncate(from);
        self.history.extend(replayed);
        self.belief = belief;
        Ok(true)
    }

    fn moved(&mut self, rng: &mut dyn Rng, belief: &mut F::Belief, seconds: f64) -> Result<(), Error> {
        if seconds > 0.0 {
            let motion = self.world.over(seconds)?;
            self.filter.predict(rng, &*motion, self.noise_scale, belief)?;
        }
        Ok(())
    }

    fn stored(&self, slot: &Slot) -> Result<StoredSlot, Error> {
        let state = &self.member(slot.sensor)?.state;
        Ok(StoredSlot::new(slot, state.presence.working, !state.excluded))
    }

    /// Keeps the belief before an instant and its slots, as long as the window lasts.
    fn remember(&mut self, before: F::Belief, slots: &[Slot]) {
        let stored = slots.iter().filter_map(|slot| self.stored(slot).ok()).collect();
        self.history.push(Checkpoint {
            time: self.now,
            belief: before,
            slots: stored,
        });
        // The last belief before the window is what a report from its beginning goes back to.
        let oldest = self.now - self.window;
        let first = self.history.partition_point(|checkpoint| checkpoint.time < oldest);
        self.history.drain(..first.saturating_sub(1));
    }

    /// What one slot says about its sensor, from the belief before.
    fn watch(
        &self,
        member: &Member<D>,
        slot: &Slot,
        predicted: &Gaussian<D>,
        likelihood: &dyn StateLikelihood<D>,
    ) -> Result<Watched, Error> {
        let evidence = |observation: &Observation<BitString>, working: f64| -> Result<Option<(f64, f64)>, Error> {
            let likelihood = member.sensor.likelihood(&slot.feedback, observation, working)?;
            possible(likelihood.condition(predicted))
        };
        match &slot.observation {
            Observation::Lost => Ok(Watched::Nothing),
            Observation::Nothing => {
                let silence = evidence(&slot.observation, 1.0)?.map_or(0.0, |(log, _)| log.exp());
                Ok(Watched::Silence(silence.min(1.0)))
            }
            Observation::Received(bits) => {
                let Some((log, correction)) = possible(likelihood.condition(predicted))? else {
                    return Ok(Watched::Report(None));
                };
                if let Some(variance) = member.sensor.value_variance(predicted) {
                    let arrives = (member.sensor.arrival() * member.state.presence.working).ln();
                    return Ok(Watched::Report(Residual::of_value(log - arrives, variance, correction)));
                }
                if bits.bits() == 0 || bits.bits() > WORD_BITS {
                    return Ok(Watched::Report(None));
                }
                let mut words = Vec::with_capacity(1 << bits.bits());
                let mut at = 0;
                for word in 0..1_u8 << bits.bits() {
                    let other = BitString::from_bytes(vec![word << (8 - bits.bits())], bits.bits())?;
                    if other == *bits {
                        at = words.len();
                        words.push((log, correction));
                        continue;
                    }
                    let observation = Observation::Received(other);
                    // A word that the scheme never sends is no alternative.
                    if let Ok(Some(found)) = evidence(&observation, member.state.presence.working) {
                        words.push(found);
                    }
                }
                Ok(Watched::Report(Residual::of_word(&words, at)))
            }
        }
    }

    /// Presence, health and noise from what was watched.
    fn judge(&mut self, rng: &mut dyn Rng, slots: &[Slot], watched: &[Watched]) -> Result<Vec<Event>, Error> {
        let mut events = Vec::new();
        let (sensor_limit, centre_limit) = (
            limit(self.false_alarms.sensor / SEQUENCES as f64),
            limit(self.false_alarms.centre / SEQUENCES as f64),
        );
        let mut pooled = [(0.0, 0_u32); SEQUENCES];
        let mut products = 0.0;
        let allowed = self.members.len() / 2;
        let mut excluded = self.members.values().filter(|m| m.state.excluded).count();
        for (slot, watched) in slots.iter().zip(watched) {
            let Some(member) = self.members.get_mut(&slot.sensor) else {
                continue;
            };
            let state = &mut member.state;
            match watched {
                Watched::Nothing => {}
                Watched::Silence(silence) => {
                    if state.presence.silent(*silence, &self.failures) {
                        events.push(Event::Dead(slot.sensor));
                    }
                }
                Watched::Report(found) => {
                    if state.presence.heard() {
                        events.push(Event::Alive(slot.sensor));
                    }
                    let Some(found) = found else { continue };
                    let product = state.last_residual.map(|last| last * found.residual);
                    state.last_residual = Some(found.residual);
                    let terms = [Some(found.surprise), Some(found.residual), product];
                    let alarm = state.monitor.add(terms, sensor_limit) == Some(Alarm::Contradiction);
                    state.quiet = if alarm { 0 } else { state.quiet.saturating_add(1) };
                    if state.excluded {
                        if state.quiet >= READMISSION {
                            state.excluded = false;
                            excluded -= 1;
                            events.push(Event::Readmitted(slot.sensor));
                        }
                        continue;
                    }
                    if alarm && excluded < allowed {
                        state.excluded = true;
                        excluded += 1;
                        self.monitor = health::Monitor::default();
                        events.push(Event::Excluded(slot.sensor));
                        continue;
                    }
                    // Residuals of different sensors have different signs when a track is lost; surprises and products do not.
                    for (sum, term) in pooled.iter_mut().zip([terms[0], None, terms[2]]) {
                        if let Some(term) = term {
                            *sum = (sum.0 + term, sum.1 + 1);
                        }
                    }
                    products += product.unwrap_or(0.0).clamp(-3.0, 3.0);
                }
            }
        }
        if let Some(learning) = &self.learning {
            let [low, high] = learning.range;
            self.noise_scale = (self.noise_scale * (learning.gain * products).exp()).clamp(low, high);
        }
        let terms = pooled.map(|(sum, count)| (count > 0).then(|| sum / f64::from(count).sqrt()));
        let alarm = self.monitor.add(terms, centre_limit);
        if alarm == Some(Alarm::Overstatement) {
            events.push(Event::NoiseOverstated);
        }
        if alarm == Some(Alarm::Contradiction) {
            events.push(Event::Lost);
            if let Some(prior) = self.acquisition {
                self.belief = self.filter.start(rng, &prior)?;
                self.history.clear();
                for member in self.members.values_mut() {
                    member.state.last_residual = None;
                    member.state.monitor = health::Monitor::default();
                }
                events.push(Event::Reacquired);
            }
        }
        Ok(events)
    }
}

/// What one slot says about its sensor.
enum Watched {
    Nothing,
    Silence(f64),
    Report(Option<Residual>),
}

/// Evidence and correction, `None` if the observation is impossible.
fn possible<const D: usize>(
    conditioned: Result<crate::contract::Conditioned<D>, Error>,
) -> Result<Option<(f64, f64)>, Error> {
    match conditioned {
        Ok(found) => Ok(Some((found.log_likelihood, found.correction))),
        Err(Error::Core(fewbits_core::Error::Impossible)) => Ok(None),
        Err(error) => Err(error),
    }
}
