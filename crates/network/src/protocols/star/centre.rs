//! The fusion centre of a star.

use super::{BEGIN, DEADLINE, Feedback, Star};
use crate::error::Error;
use crate::estimator::Estimator;
use crate::medium::{Frame, Kind, digest};
use crate::note::{Note, Stage};
use crate::protocols::slot::{Arrived, Failures, echo_bits, echo_of, from_prior, predict, update_or_discard};
use crate::simulator::Context;
use crate::units::SensorId;
use fewbits_core::Message;
use serde::{Deserialize, Serialize};

/// The fusion centre.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Centre<B> {
    pub(super) slot: u32,
    pub(super) belief: B,
    /// The prediction into the slot until its deadline; `None` before the first slot, after a deadline and where the prediction failed.
    predicted: Option<B>,
    /// Digests of what the sensors were told, one per sensor.
    digests: Vec<u32>,
    arrived: Vec<Arrived>,
    /// Somebody asked for the whole belief.
    asked: bool,
    failures: Failures,
    pub(super) estimates: Vec<Vec<f64>>,
}

impl<B> Centre<B> {
    pub(super) fn new(belief: B) -> Self {
        Self {
            slot: 0,
            belief,
            predicted: None,
            digests: Vec::new(),
            arrived: Vec::new(),
            asked: false,
            failures: Failures::default(),
            estimates: Vec::new(),
        }
    }

    /// A frame of a sensor failed its check while its report was awaited.
    pub(super) fn damaged(&mut self, from: SensorId) {
        if self.predicted.is_some()
            && let Some(arrived) = from.index().checked_sub(1).and_then(|i| self.arrived.get_mut(i))
            && *arrived == Arrived::Nothing
        {
            *arrived = Arrived::Lost;
        }
    }
}

impl<E: Estimator> Star<E> {
    /// The centre begins a slot.
    pub(super) fn begin(&self, centre: &mut Centre<E::Belief>, context: &mut Context<'_>) -> Result<(), Error> {
        let slot = self.clock.slot(context.now());
        if slot > self.last_slot() {
            return Ok(());
        }
        context.at(self.clock.deadline(slot), DEADLINE);
        context.at(self.clock.start(slot + 1), BEGIN);
        let previous = std::mem::take(&mut centre.arrived);
        centre.slot = slot;
        centre.arrived = vec![Arrived::Nothing; self.estimator.sensors()];
        let predicted = match predict(&self.estimator, self.stream, slot, &centre.belief) {
            Ok(predicted) => predicted,
            Err(error) => {
                centre.predicted = None;
                return centre
                    .failures
                    .record(context, self.last_slot(), Stage::Prediction, slot, &error);
            }
        };
        match self.feedback {
            Feedback::Told => self.tell(centre, slot, &predicted, context)?,
            Feedback::Echoed => {
                let shared = self.belief_bits(&centre.belief)?;
                let sum = digest(u64::from(slot - 1), &shared);
                centre.digests = vec![sum; self.estimator.sensors()];
                let frame = if std::mem::take(&mut centre.asked) {
                    Frame::new(Kind::Snapshot, slot, sum, shared)
                } else {
                    let echo = echo_bits(&previous, self.estimator.report_end())?;
                    // Whoever follows must read what was written.
                    if slot > 1 && !previous.is_empty() && echo_of(&self.estimator, &echo).as_ref() != Ok(&previous) {
                        return Err(Error::UnreadableEcho { slot: slot - 1 });
                    }
                    Frame::new(Kind::Echo, slot, sum, echo)
                };
                context.broadcast(&frame)?;
            }
        }
        centre.predicted = Some(predicted);
        Ok(())
    }

    fn tell(
        &self,
        centre: &mut Centre<E::Belief>,
        slot: u32,
        predicted: &E::Belief,
        context: &mut Context<'_>,
    ) -> Result<(), Error> {
        let sensors = self.estimator.sensors();
        let questions = (0..sensors).map(|i| self.question(slot, predicted, i));
        let questions = questions.collect::<Result<Vec<_>, Error>>()?;
        centre.digests = questions.iter().map(|bits| digest(u64::from(slot), bits)).collect();
        let alike = questions.windows(2).all(|pair| pair[0] == pair[1]);
        for (sensor, (bits, sum)) in questions.into_iter().zip(centre.digests.clone()).enumerate() {
            // A sensor without question reports by the clock.
            if bits.bits() == 0 {
                continue;
            }
            let frame = Frame::new(Kind::Question, slot, sum, bits);
            if alike {
                return context.broadcast(&frame);
            }
            context.send(SensorId(sensor as u32 + 1), &frame)?;
        }
        Ok(())
    }

    /// The centre ends a slot.
    pub(super) fn finish(&self, centre: &mut Centre<E::Belief>, context: &mut Context<'_>) -> Result<(), Error> {
        let slot = centre.slot;
        let mut note = None;
        if let Some(predicted) = centre.predicted.take() {
            let after = update_or_discard(&self.estimator, self.stream, slot, &predicted, &centre.arrived);
            (centre.belief, note) = after;
        }
        centre.estimates.resize(slot as usize - 1, Vec::new());
        centre.estimates.push(self.estimator.mean(&centre.belief));
        match note {
            Some(note) => centre.failures.note(context, self.last_slot(), note),
            None => Ok(()),
        }
    }

    /// The centre takes a frame: a report, or a request for the belief.
    pub(super) fn on_report(
        &self,
        centre: &mut Centre<E::Belief>,
        context: &mut Context<'_>,
        from: SensorId,
        frame: &Frame,
    ) {
        let Some(sensor) = (from.index()).checked_sub(1).filter(|i| *i < self.estimator.sensors()) else {
            return context.note(Note::Malformed);
        };
        match frame.kind {
            Kind::Request => {
                let (with, slot) = (from, frame.slot);
                context.note(Note::Disagreement { with, slot });
                centre.asked = true;
            }
            Kind::Report if frame.slot != centre.slot || centre.predicted.is_none() => context.note(Note::Late),
            Kind::Report if centre.arrived[sensor] != Arrived::Nothing => context.note(Note::Duplicate),
            Kind::Report if frame.digest != centre.digests[sensor] => {
                centre.arrived[sensor] = Arrived::Foreign;
                let (with, slot) = (from, frame.slot);
                context.note(Note::Disagreement { with, slot });
            }
            Kind::Report => {
                // Kept as it would be encoded again: the echo must say the same to whoever follows.
                let format = self.estimator.report_format(sensor);
                let decoded = E::Report::from_bits(&format, &frame.payload).and_then(|report| report.to_bits(&format));
                centre.arrived[sensor] = match decoded {
                    Ok(bits) => Arrived::Report(bits),
                    Err(_) => {
                        context.note(Note::Malformed);
                        Arrived::Lost
                    }
                };
            }
            _ => context.note(Note::Malformed),
        }
    }

    /// The centre has lost its memory. It goes on from the belief without reports and broadcasts it.
    pub(super) fn restart(&self, centre: &mut Centre<E::Belief>, context: &Context<'_>) {
        let slot = self.clock.slot(context.now()).min(self.last_slot());
        if let Ok(belief) = from_prior(&self.estimator, self.stream, slot) {
            centre.belief = belief;
        }
        centre.predicted = None;
        centre.arrived = Vec::new();
        centre.asked = true;
    }
}
