//! A sensor of a star.

use super::{BEGIN, CENTRE, Star};
use crate::error::Error;
use crate::estimator::Estimator;
use crate::medium::{Frame, Kind, digest};
use crate::note::{Note, Stage};
use crate::protocols::slot::{Failures, echo_of, own, predict, update_or_discard};
use crate::simulator::Context;
use crate::units::SensorId;
use fewbits_core::{BitString, Message};
use serde::{Deserialize, Serialize};

/// A sensor.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Sensor<B, Y> {
    memory: Y,
    /// The last slot that it answered in.
    pub(super) answered: u32,
    /// The belief that it shares with the centre, and the slot after which it holds. `None` while it knows that it does not share it.
    pub(super) replica: Option<(u32, B)>,
    failures: Failures,
}

impl<B, Y> Sensor<B, Y> {
    pub(super) fn new(memory: Y, start: B) -> Self {
        Self {
            memory,
            answered: 0,
            replica: Some((0, start)),
            failures: Failures::default(),
        }
    }

    /// It has lost its memory and knows that it must ask for the belief.
    pub(super) fn restart(&mut self, memory: Y) {
        self.memory = memory;
        self.replica = None;
    }
}

impl<E: Estimator> Star<E> {
    /// A sensor whose question has no bits begins a slot.
    pub(super) fn by_the_clock(
        &self,
        sensor: &mut Sensor<E::Belief, E::Memory>,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let slot = self.clock.slot(context.now());
        if slot > self.last_slot() {
            return Ok(());
        }
        context.at(self.clock.start(slot + 1), BEGIN);
        let (index, nothing) = (context.id().index() - 1, BitString::default());
        let question = E::Question::from_bits(&self.estimator.question_format(index), &nothing)?;
        self.answer(sensor, context, slot, digest(u64::from(slot), &nothing), &question)
    }

    /// A sensor measures and reports.
    fn answer(
        &self,
        sensor: &mut Sensor<E::Belief, E::Memory>,
        context: &mut Context<'_>,
        slot: u32,
        sum: u32,
        question: &E::Question,
    ) -> Result<(), Error> {
        let index = context.id().index() - 1;
        if slot > self.last_slot() {
            return Ok(());
        }
        sensor.answered = slot;
        let mut rng = own(self.stream, index, slot);
        let memory = &mut sensor.memory;
        let reported = self.measurements.with(slot, index, |measurement| {
            self.estimator
                .report(&mut rng, slot, index, memory, measurement, question)
        });
        match reported {
            Some(Ok(Some(report))) => {
                let payload = report.to_bits(&self.estimator.report_format(index))?;
                context
                    .send(CENTRE, &Frame::new(Kind::Report, slot, sum, payload))
                    .map(|_| ())
            }
            Some(Ok(None)) => Ok(()),
            Some(Err(error)) => {
                let slots = self.last_slot();
                sensor.failures.record(context, slots, Stage::Report, slot, &error)
            }
            None => {
                context.note(Note::NotMeasured { slot });
                Ok(())
            }
        }
    }

    /// A sensor takes a frame of the centre: a question, an echo or the whole belief.
    pub(super) fn on_broadcast(
        &self,
        sensor: &mut Sensor<E::Belief, E::Memory>,
        context: &mut Context<'_>,
        from: SensorId,
        frame: &Frame,
    ) -> Result<(), Error> {
        let slot = frame.slot;
        // Only the centre's frames are for sensors; those of other sensors are in range but addressed to it.
        if from != CENTRE || !matches!(frame.kind, Kind::Question | Kind::Echo | Kind::Snapshot) {
            context.note(Note::Malformed);
            return Ok(());
        }
        if slot <= sensor.answered || slot != self.clock.slot(context.now()) {
            let again = slot == sensor.answered;
            context.note(if again { Note::Duplicate } else { Note::Late });
            return Ok(());
        }
        let index = context.id().index() - 1;
        match frame.kind {
            Kind::Question => {
                let sum = digest(u64::from(slot), &frame.payload);
                if sum != frame.digest {
                    context.note(Note::Disagreement { with: from, slot });
                    return Ok(());
                }
                match E::Question::from_bits(&self.estimator.question_format(index), &frame.payload) {
                    Ok(question) => self.answer(sensor, context, slot, sum, &question),
                    Err(_) => {
                        context.note(Note::Malformed);
                        Ok(())
                    }
                }
            }
            _ => self.follow(sensor, context, index, frame),
        }
    }

    /// A sensor brings its replica up to the centre's, or asks for the whole.
    fn follow(
        &self,
        sensor: &mut Sensor<E::Belief, E::Memory>,
        context: &mut Context<'_>,
        index: usize,
        frame: &Frame,
    ) -> Result<(), Error> {
        let Some(codec) = &self.codec else {
            context.note(Note::Malformed);
            return Ok(());
        };
        let slot = frame.slot;
        let fresh = match frame.kind {
            Kind::Snapshot => (codec.read)(&self.estimator, &frame.payload).ok(),
            _ => self.caught_up(sensor, slot, &frame.payload),
        };
        // The digest is taken of the belief, not of the frame: it is what must be shared.
        let agreed = match fresh {
            Some(belief) => {
                let bits = (codec.write)(&self.estimator, &belief)?;
                (digest(u64::from(slot - 1), &bits) == frame.digest).then_some(belief)
            }
            None => None,
        };
        let Some(belief) = agreed else {
            sensor.replica = None;
            context.note(Note::Disagreement { with: CENTRE, slot });
            let request = Frame::new(Kind::Request, slot, 0, BitString::default());
            return context.send(CENTRE, &request).map(|_| ());
        };
        if frame.kind == Kind::Snapshot && sensor.replica.as_ref().is_none_or(|(at, _)| at + 2 < slot) {
            context.note(Note::Resynchronised { slot });
        }
        let predicted = predict(&self.estimator, self.stream, slot, &belief);
        sensor.replica = Some((slot - 1, belief));
        let predicted = match predicted {
            Ok(predicted) => predicted,
            Err(error) => {
                let slots = self.last_slot();
                return sensor.failures.record(context, slots, Stage::Prediction, slot, &error);
            }
        };
        // What is shared is asked as it would travel.
        let bits = self.question(slot, &predicted, index)?;
        let question = E::Question::from_bits(&self.estimator.question_format(index), &bits)?;
        self.answer(sensor, context, slot, frame.digest, &question)
    }

    /// The replica after the slot before `slot`, by the echo of that slot; none if it is not at the slot before that.
    fn caught_up(&self, sensor: &Sensor<E::Belief, E::Memory>, slot: u32, echo: &BitString) -> Option<E::Belief> {
        let (at, belief) = sensor.replica.as_ref()?;
        if slot == 1 && *at == 0 {
            return Some(belief.clone());
        }
        if at + 2 != slot {
            return None;
        }
        let arrived = echo_of(&self.estimator, echo).ok()?;
        let predicted = predict(&self.estimator, self.stream, slot - 1, belief).ok()?;
        Some(update_or_discard(&self.estimator, self.stream, slot - 1, &predicted, &arrived).0)
    }
}
