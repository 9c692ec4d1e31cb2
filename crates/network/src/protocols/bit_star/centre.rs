//! The fusion centre of a star: carries out the actions of its state machine on the simulated radio.

use super::super::decoded;
use super::node::CentreNode;
use super::{BitStar, OTHER, SLOT_BEGINS};
use crate::error::Error;
use crate::note::{Note, Stage};
use crate::simulator::Context;
use crate::units::{Instant, SensorId};
use fewbits_protocol::{Action, CentreTimer, Outcome, Receiver, Recipient, predict_and_ask, update_or_drop};

impl<R: Receiver, const M: usize> BitStar<R, M> {
    pub(super) fn carry_out(
        &self,
        centre: &mut CentreNode<R>,
        context: &mut Context<'_>,
        actions: Vec<Action>,
    ) -> Result<(), Error> {
        let slots = self.measurements.slots();
        for action in actions {
            match action {
                Action::SetTimer { at, timer } => {
                    let token = match timer {
                        CentreTimer::SlotBegins => SLOT_BEGINS,
                        _ => OTHER,
                    };
                    context.at(Instant(at), token);
                }
                Action::Note { sensor, note } => {
                    let with = SensorId(sensor as u32 + 1);
                    context.note(Note::Frame { with, note });
                }
                Action::Send { to, frame } => {
                    let frame = decoded(&frame)?;
                    match to {
                        Recipient::All => context.broadcast(&frame),
                        Recipient::Sensor(i) => self.send_down(context, SensorId(i as u32 + 1), &frame)?,
                    }
                }
                Action::Predict { slot } if slot > u64::from(slots) => {}
                Action::Predict { slot } => match predict_and_ask(&mut centre.receiver, &self.members, slot) {
                    Ok((feedback, state)) => {
                        // The machine answers a prediction with frames and timers, which are carried out before the next action.
                        let mut sent = Vec::new();
                        centre.machine.on_predicted(&feedback, state.as_ref(), &mut sent);
                        self.carry_out(centre, context, sent)?;
                    }
                    Err(error) => {
                        let note = Note::failed(Stage::Prediction, slot as u32, &error);
                        centre.failures.note(context, slots, note)?;
                    }
                },
                Action::Update { slot, observed } => {
                    let slot = slot as u32;
                    match update_or_drop(&mut centre.receiver, &observed) {
                        Outcome::Used => {}
                        Outcome::SilentDropped(error) => {
                            let reason = error.to_string();
                            context.note(Note::SilenceIgnored { slot, reason });
                        }
                        Outcome::Failed(error) => {
                            let note = Note::failed(Stage::Update, slot, &error);
                            centre.failures.note(context, slots, note)?;
                        }
                    }
                    centre.estimates.push((slot, centre.receiver.estimate()));
                }
            }
        }
        Ok(())
    }
}
