//! Estimators with typed messages, and the conversion of their messages to bits: the published closed loops, each a [`Receiver`].

use fewbits_core::{BitReader, BitString, BitWriter, Gaussian, Message, Observation};
use fewbits_protocol::{BoxError, Receiver};

/// An estimator at a fusion centre with a typed belief. [`OverBits`] makes a [`Receiver`] of it.
///
/// ```text
/// slot k:  predicted = predict(belief);  feedback(predicted, i) for each sensor i
///          belief = update(predicted, what was observed)
/// ```
/// Invariant: all methods are functions of their arguments, so two ends with equal beliefs stay equal.
pub trait Estimator {
    /// The knowledge of the state. It is sent to sensors that follow the centre.
    type Belief: Message + Clone;
    /// What a sensor is sent before it measures.
    type Feedback: Message;
    /// What a sensor may report.
    type Report: Message;

    /// Number of sensors.
    fn sensors(&self) -> usize;

    /// The belief before the first slot, which both ends know.
    fn start(&self) -> Self::Belief;

    /// The belief predicted from the slot before into slot `slot`, which is counted from 1.
    ///
    /// # Errors
    /// If the filter fails.
    fn predict(&self, slot: u64, belief: &Self::Belief) -> Result<Self::Belief, BoxError>;

    /// The feedback for `sensor`, from the predicted belief.
    ///
    /// # Errors
    /// If the scheme fails.
    fn feedback(&self, predicted: &Self::Belief, sensor: usize) -> Result<Self::Feedback, BoxError>;

    /// The predicted belief updated with observations of sensors, in increasing order of their numbers. Sensors without observation are
    /// left out.
    ///
    /// # Errors
    /// If the observations have probability zero together, or the filter fails.
    fn update(
        &self,
        slot: u64,
        predicted: &Self::Belief,
        observed: &[(usize, Observation<Self::Report>)],
    ) -> Result<Self::Belief, BoxError>;

    /// Mean and standard deviation of each coordinate of the state.
    fn estimate(&self, belief: &Self::Belief) -> Vec<(f64, f64)>;

    /// Format in which beliefs are sent.
    fn belief_format(&self) -> <Self::Belief as Message>::Format;

    /// Format in which the feedback of a sensor is sent.
    fn feedback_format(&self, sensor: usize) -> <Self::Feedback as Message>::Format;

    /// Format in which the reports of a sensor are sent.
    fn report_format(&self, sensor: usize) -> <Self::Report as Message>::Format;
}

/// Mean and standard deviation of each coordinate of a Gaussian, for [`Estimator::estimate`].
pub fn moments<const D: usize>(belief: &Gaussian<D>) -> Vec<(f64, f64)> {
    let deviations = belief.standard_deviations();
    belief.mean().iter().copied().zip(deviations.iter().copied()).collect()
}

/// Bits of the slot number in a state.
const SLOT_BITS: u32 = 64;
/// Largest number of slots that are predicted in one step. A clock that jumps by more was wrong before or is wrong now.
const MAX_SKIPPED: u64 = 1 << 20;

/// A [`Receiver`] made from an [`Estimator`]. Its state is the slot in 64 bits, followed by the belief.
///
/// The start belief applies to the slot before the first prediction, whichever slot that is. If slots are skipped later, the belief is
/// predicted through them, up to 2^20; a prediction through more fails. Bits that are not a report of the scheme count as [`Observation::Lost`]: a report was sent but not understood.
/// A step whose estimate is not finite fails and leaves the state unchanged.
#[derive(Debug, Clone, PartialEq)]
pub struct OverBits<E: Estimator> {
    estimator: E,
    /// The last slot that was predicted; 0 before the first.
    slot: u64,
    belief: E::Belief,
}

impl<E: Estimator> OverBits<E> {
    /// The receiver before the first slot.
    pub fn new(estimator: E) -> Self {
        let belief = estimator.start();
        Self {
            estimator,
            slot: 0,
            belief,
        }
    }

    /// The estimator.
    pub fn estimator(&self) -> &E {
        &self.estimator
    }

    /// The belief: the predicted one between a prediction and its update.
    pub fn belief(&self) -> &E::Belief {
        &self.belief
    }

    fn finite(&self, belief: E::Belief) -> Result<E::Belief, BoxError> {
        let estimate = self.estimator.estimate(&belief);
        match estimate.iter().position(|(mean, _)| !mean.is_finite()) {
            None => Ok(belief),
            Some(i) => {
                Err(format!("the estimate is {} in coordinate {i}: expected a finite number", estimate[i].0).into())
            }
        }
    }
}

impl<E: Estimator> Receiver for OverBits<E> {
    fn sensors(&self) -> usize {
        self.estimator.sensors()
    }

    fn predict(&mut self, slot: u64) -> Result<(), BoxError> {
        let mut predicted = None;
        let first = if self.slot == 0 {
            slot
        } else {
            self.slot.saturating_add(1)
        };
        if slot.saturating_sub(first) > MAX_SKIPPED {
            let skipped = slot.saturating_sub(first);
            return Err(format!("{skipped} slots were skipped: expected at most {MAX_SKIPPED}; begin anew").into());
        }
        // A model predicts one slot, so the slots that were skipped are predicted too. The belief changes only if all succeed.
        for slot in first..=slot {
            predicted = Some(
                self.estimator
                    .predict(slot, predicted.as_ref().unwrap_or(&self.belief))?,
            );
        }
        if let Some(predicted) = predicted {
            self.belief = self.finite(predicted)?;
            self.slot = slot;
        }
        Ok(())
    }

    fn feedback(&self, sensor: usize) -> Result<BitString, BoxError> {
        let feedback = self.estimator.feedback(&self.belief, sensor)?;
        Ok(feedback.to_bits(&self.estimator.feedback_format(sensor))?)
    }

    fn update(&mut self, observed: &[(usize, Observation<BitString>)]) -> Result<(), BoxError> {
        let decoded = observed.iter().map(|(sensor, observation)| {
            let decoded = match observation {
                Observation::Received(bits) => E::Report::from_bits(&self.estimator.report_format(*sensor), bits)
                    .map_or(Observation::Lost, Observation::Received),
                Observation::Nothing => Observation::Nothing,
                Observation::Lost => Observation::Lost,
            };
            (*sensor, decoded)
        });
        let decoded: Vec<_> = decoded.collect();
        let updated = self.estimator.update(self.slot, &self.belief, &decoded)?;
        self.belief = self.finite(updated)?;
        Ok(())
    }

    fn estimate(&self) -> Vec<(f64, f64)> {
        self.estimator.estimate(&self.belief)
    }

    fn state(&self) -> Result<BitString, BoxError> {
        let mut writer = BitWriter::new();
        writer.write(self.slot, SLOT_BITS)?;
        self.belief.encode(&self.estimator.belief_format(), &mut writer)?;
        Ok(writer.finish())
    }

    fn restore(&mut self, state: &BitString) -> Result<(), BoxError> {
        let mut reader = BitReader::new(state);
        let slot = reader.read(SLOT_BITS)?;
        let belief = E::Belief::decode(&self.estimator.belief_format(), &mut reader)?;
        reader.finish()?;
        (self.slot, self.belief) = (slot, belief);
        Ok(())
    }
}
