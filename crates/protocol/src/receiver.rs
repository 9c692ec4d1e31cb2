//! An estimator as the centre's machine needs it: bits in, bits out.

use crate::centre::Member;
use crate::sensor::Feedback;
use fewbits_core::{BitString, Observation};
use serde::{Deserialize, Serialize};

/// Any error of an estimator.
pub type BoxError = Box<dyn std::error::Error + Send + Sync>;

/// An estimator at a fusion centre, slot by slot. Object-safe.
///
/// ```text
/// slot k:  predict(k);  feedback(i) for each sensor i;  update(what was observed of each sensor that was asked)
/// ```
/// Laws: calls are functions of the state and their arguments, so that two ends with equal state stay equal; a call that fails leaves the
/// state as it was; `restore(state())` changes nothing.
pub trait Receiver {
    /// Number of sensors.
    fn sensors(&self) -> usize;

    /// Moves on to slot `slot`, counted from the first, which is 1. Slots may be left out.
    ///
    /// # Errors
    /// Those of the estimator.
    fn predict(&mut self, slot: u64) -> Result<(), BoxError>;

    /// What a sensor is told before it measures, from the prediction. Empty where there is nothing to tell.
    ///
    /// # Errors
    /// Those of the scheme.
    fn feedback(&self, sensor: usize) -> Result<BitString, BoxError>;

    /// Takes in what was observed of sensors in the slot, in rising order of their numbers. Sensors that were not asked are left out.
    ///
    /// # Errors
    /// If the observations are impossible together; others of the estimator.
    fn update(&mut self, observed: &[(usize, Observation<BitString>)]) -> Result<(), BoxError>;

    /// The estimate: mean and standard deviation of each coordinate.
    fn estimate(&self) -> Vec<(f64, f64)>;

    /// How each sensor is judged, by their numbers. Empty for an estimator that does not judge them.
    fn health(&self) -> Vec<SensorHealth> {
        Vec::new()
    }

    /// All that the estimator knows, exactly.
    ///
    /// # Errors
    /// If it cannot be written.
    fn state(&self) -> Result<BitString, BoxError>;

    /// Goes on from a state. Total.
    ///
    /// # Errors
    /// If the bits are no state of this estimator.
    fn restore(&mut self, state: &BitString) -> Result<(), BoxError>;
}

/// How an estimator judges one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SensorHealth {
    /// Probability that it works.
    pub working: f64,
    /// It is taken for dead.
    pub dead: bool,
    /// Its reports are not used at present, since they do not fit the model.
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

    fn state(&self) -> Result<BitString, BoxError> {
        (**self).state()
    }

    fn restore(&mut self, state: &BitString) -> Result<(), BoxError> {
        (**self).restore(state)
    }
}

/// Predicts into a slot. Returns what each of the `members` is told and, where one of them follows by echo, the state before the
/// prediction: what [`Centre::on_predicted`](crate::Centre::on_predicted) takes.
///
/// # Errors
/// Those of the receiver.
pub fn predict_and_ask<R: Receiver + ?Sized>(
    receiver: &mut R,
    members: &[Member],
    slot: u64,
) -> Result<(Vec<BitString>, Option<BitString>), BoxError> {
    let follows = members.iter().any(|member| member.feedback == Feedback::Echoed);
    let state = follows.then(|| receiver.state()).transpose()?;
    receiver.predict(slot)?;
    let feedback = (0..members.len()).map(|sensor| receiver.feedback(sensor));
    Ok((feedback.collect::<Result<_, _>>()?, state))
}

/// How an update went.
#[derive(Debug)]
pub enum Outcome {
    /// With all observations.
    Used,
    /// The observations were impossible together, and possible without the sensors of which nothing came: these count as not asked.
    SilentDropped(BoxError),
    /// Without any: the prediction stands.
    Failed(BoxError),
}

/// Updates with what was observed; if that fails, without the sensors of which nothing came; if that fails too, not at all.
///
/// A sensor that is silent where its scheme had to speak contradicts a link that is thought to lose nothing. It is left out rather than
/// taken as lost, since [`Observation::Lost`] says that it spoke.
///
/// `observed` has one item per sensor; `None` is no observation.
pub fn update_or_drop<R: Receiver + ?Sized>(receiver: &mut R, observed: &[Option<Observation<BitString>>]) -> Outcome {
    let asked = observed.iter().cloned().enumerate();
    update_asked(receiver, asked.filter_map(|(sensor, o)| Some((sensor, o?))).collect())
}

/// The same with what was observed of the sensors that were asked, in rising order of their numbers.
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
