//! Interface of an estimator to the centre's state machine: all messages are bits.

use crate::centre::Member;
use crate::sensor::Feedback;
use fewbits_core::{BitString, Event, Observation};
use serde::{Deserialize, Serialize};

/// Any error of an estimator.
pub type BoxError = Box<dyn std::error::Error + Send + Sync>;

/// An estimator at a fusion centre, called slot by slot. Object-safe.
///
/// ```text
/// slot k:  predict(k);  feedback(i) for each sensor i;  update(what was observed of each sensor that was asked)
/// ```
/// Invariants: calls are functions of the state and their arguments, so two ends with equal states stay equal. A call that fails leaves the
/// state unchanged. `restore(state())` changes nothing.
pub trait Receiver {
    /// Number of sensors.
    fn sensors(&self) -> usize;

    /// Predicts into slot `slot`, counted from 1. Slots may be skipped.
    ///
    /// # Errors
    /// If the estimator fails.
    fn predict(&mut self, slot: u64) -> Result<(), BoxError>;

    /// The feedback for a sensor, from the prediction; empty if the sensor needs none.
    ///
    /// # Errors
    /// If the scheme fails.
    fn feedback(&self, sensor: usize) -> Result<BitString, BoxError>;

    /// Updates with observations of the slot, in increasing order of the sensors' numbers. Sensors that were not asked are left out.
    ///
    /// # Errors
    /// If the observations have probability zero together, or the estimator fails.
    fn update(&mut self, observed: &[(usize, Observation<BitString>)]) -> Result<(), BoxError>;

    /// Mean and standard deviation of each coordinate of the state.
    fn estimate(&self) -> Vec<(f64, f64)>;

    /// The estimator's judgement of each sensor, by their numbers. Empty if the estimator does not judge sensors.
    fn health(&self) -> Vec<SensorHealth> {
        Vec::new()
    }

    /// What the last update found out about sensors, counted from 0, and model. Empty if the estimator does not judge them.
    fn events(&self) -> Vec<Event> {
        Vec::new()
    }

    /// The complete state of the estimator, without rounding.
    ///
    /// # Errors
    /// If the state cannot be written.
    fn state(&self) -> Result<BitString, BoxError>;

    /// Continues from a state. Any bits give a state or an error.
    ///
    /// # Errors
    /// If the bits are not a state of this estimator.
    fn restore(&mut self, state: &BitString) -> Result<(), BoxError>;
}

/// An estimator's judgement of one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SensorHealth {
    /// Probability that the sensor works.
    pub working: f64,
    /// Whether the estimator regards it as dead.
    pub dead: bool,
    /// Whether its reports are not used at present because they do not fit the model.
    pub excluded: bool,
}

impl<R: Receiver + ?Sized> Receiver for Box<R> {
    fn sensors(&self) -> usize {
        (**self).sensors()
    }

    fn predict(&mut self, slot: u64) -> Result<(), BoxError> {
        (**self).predict(slot)
    }

    fn feedback(&self, sensor: usize) -> Result<BitString, BoxError> {
        (**self).feedback(sensor)
    }

    fn update(&mut self, observed: &[(usize, Observation<BitString>)]) -> Result<(), BoxError> {
        (**self).update(observed)
    }

    fn estimate(&self) -> Vec<(f64, f64)> {
        (**self).estimate()
    }

    fn health(&self) -> Vec<SensorHealth> {
        (**self).health()
    }

    fn events(&self) -> Vec<Event> {
        (**self).events()
    }

    fn state(&self) -> Result<BitString, BoxError> {
        (**self).state()
    }

    fn restore(&mut self, state: &BitString) -> Result<(), BoxError> {
        (**self).restore(state)
    }
}

/// Predicts into a slot. Returns the feedback for each of the `members` and, if one of them follows by echo, the state before the
/// prediction. Both are arguments of [`Centre::on_predicted`](crate::Centre::on_predicted).
///
/// # Errors
/// If the receiver fails.
pub fn predict_and_ask<R: Receiver + ?Sized>(
    receiver: &mut R,
    members: &[Member],
    slot: u64,
) -> Result<(Vec<BitString>, Option<BitString>), BoxError> {
    let follows = members.iter().any(|member| member.feedback == Feedback::Echoed);
    // Before the prediction: followers have the state at the end of the slot before.
    let state = follows.then(|| receiver.state()).transpose()?;
    receiver.predict(slot)?;
    let feedback = (0..members.len()).map(|sensor| receiver.feedback(sensor));
    Ok((feedback.collect::<Result<_, _>>()?, state))
}

/// Result of an update.
#[derive(Debug)]
pub enum Outcome {
    /// All observations were used.
    Used,
    /// The observations were impossible together, but possible without the sensors from which nothing came; these count as not asked.
    SilentDropped(BoxError),
    /// No observation was used: the prediction remains.
    Failed(BoxError),
}

/// Updates with the observations. If that fails, it updates without the sensors from which nothing came. If that fails too, it does not
/// update.
///
/// A sensor that is silent although its scheme always sends contradicts a link that is assumed to lose nothing. It is left out and not
/// counted as lost, because [`Observation::Lost`] means that it sent.
///
/// `observed` has one item per sensor; `None` means no observation.
pub fn update_or_drop<R: Receiver + ?Sized>(receiver: &mut R, observed: &[Option<Observation<BitString>>]) -> Outcome {
    let asked = observed.iter().cloned().enumerate();
    update_asked(receiver, asked.filter_map(|(sensor, o)| Some((sensor, o?))).collect())
}

/// As [`update_or_drop`], with observations of the sensors that were asked, in increasing order of their numbers.
pub fn update_asked<R: Receiver + ?Sized>(
    receiver: &mut R,
    mut asked: Vec<(usize, Observation<BitString>)>,
) -> Outcome {
    let first = match receiver.update(&asked) {
        Ok(()) => return Outcome::Used,
        Err(error) => error,
    };
    let all = asked.len();
    asked.retain(|(_, observation)| *observation != Observation::Nothing);
    match asked.len() < all && receiver.update(&asked).is_ok() {
        true => Outcome::SilentDropped(first),
        false => Outcome::Failed(first),
    }
}
