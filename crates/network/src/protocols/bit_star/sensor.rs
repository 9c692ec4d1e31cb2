//! A sensor of a star: carries out the tasks of its state machine with its half of the scheme and the simulated radio.

use super::node::SensingNode;
use super::routes::CENTRE;
use super::{BitStar, OTHER, SLOT_BEGINS};
use crate::error::Error;
use crate::note::{Note, Stage};
use crate::simulator::Context;
use crate::units::Instant;
use fewbits_core::BitString;
use fewbits_protocol::{
    BoxError, Kind, Payload, Reaction, Receiver, SensorTimer, Slot, Task, digest, reports_of, update_or_drop,
};

impl<R: Receiver, const M: usize> BitStar<R, M> {
    pub(super) fn react(
        &self,
        sensor: &mut SensingNode<R, M>,
        context: &mut Context<'_>,
        reaction: Reaction<'_>,
    ) -> Result<(), Error> {
        if let Some((at, timer)) = reaction.timer {
            let token = match timer {
                SensorTimer::Unacknowledged { slot } => OTHER | slot.number() << 1,
                _ => SLOT_BEGINS,
            };
            context.at(Instant(at), token);
        }
        if let Some(note) = reaction.note {
            context.note(Note::Frame { with: CENTRE, note });
        }
        match reaction.task {
            // The simulated radio repeats frames itself.
            Task::Wait | Task::SendAgain => Ok(()),
            Task::Send(frame) => self.send_up(context, &frame),
            Task::Follow { slot, kind, payload } => {
                let followed = |replica| self.followed(replica, slot, kind, payload.into()).ok();
                let state = sensor.replica.as_mut().and_then(followed);
                let sum = state.map(|state| digest(slot.before(), Payload::from(&state)));
                let reaction = sensor.machine.on_followed(sum);
                self.react(sensor, context, reaction)
            }
            Task::Sample { slot, .. } if slot.number() > self.measurements.slots() => Ok(()),
            Task::Sample { slot, feedback } => {
                let report = self.sample(sensor, context, slot.number(), feedback.into())?;
                let now = context.now().0;
                let reaction = sensor.machine.on_sample(now, report.as_ref().map(Payload::from));
                self.react(sensor, context, reaction)
            }
        }
    }

    /// The report of a slot. `None` for silence, without a measurement, and if a step failed.
    fn sample(
        &self,
        sensor: &mut SensingNode<R, M>,
        context: &mut Context<'_>,
        slot: u32,
        told: BitString,
    ) -> Result<Option<BitString>, Error> {
        let index = context.id().index() - 1;
        let slots = self.measurements.slots();
        let feedback = match &mut sensor.replica {
            None => Ok(told),
            // The replica's feedback is used as it would have been sent.
            Some(replica) => replica.predict(u64::from(slot)).and_then(|()| replica.feedback(index)),
        };
        let feedback = match feedback {
            Ok(feedback) => feedback,
            Err(error) => {
                let note = Note::failed(Stage::Prediction, slot, &error);
                return sensor.failures.note(context, slots, note).map(|()| None);
            }
        };
        let stream = self.stream.named("sensor").indexed(index as u64);
        let mut rng = stream.indexed(u64::from(slot)).rng();
        let (half, counted) = (&mut sensor.half, &mut sensor.counted);
        let reported = self.measurements.with(slot, index, |measurement| {
            let before = slot.saturating_sub(1);
            half.skip(u64::from(before.saturating_sub(*counted)));
            *counted = before;
            let report = half.report(&mut rng, measurement, &feedback)?;
            *counted = slot;
            Ok::<_, fewbits_core::Error>(report)
        });
        match reported {
            Some(Ok(report)) => Ok(report),
            Some(Err(error)) => {
                let note = Note::failed(Stage::Report, slot, &error.into());
                sensor.failures.note(context, slots, note).map(|()| None)
            }
            None => {
                context.note(Note::NotMeasured { slot });
                Ok(None)
            }
        }
    }

    /// Advances a replica to the end of the slot before `slot` and returns its state.
    fn followed(&self, replica: &mut R, slot: Slot, kind: Kind, told: BitString) -> Result<BitString, BoxError> {
        if kind == Kind::Snapshot {
            replica.restore(&told)?;
        } else if slot.number() > 1 {
            // The replica already predicted into that slot when it gave its feedback.
            let lengths: Vec<_> = self.members.iter().map(|member| member.report).collect();
            update_or_drop(replica, &reports_of(&told, &lengths)?);
        }
        replica.state()
    }
}
