//! A belief that travels: from leader to leader, or along a chain of nodes, hop by hop.

use crate::clock::Clock;
use crate::error::Error;
use crate::exchange::shared;
use crate::field::Field;
use crate::frame::{Frame, Kind, digest};
use crate::log::{Note, Stored};
use crate::simulator::{Context, Protocol, Setup, Simulator};
use crate::units::SensorId;
use fewbits_core::BitString;
use fewbits_monte_carlo::Stream;
use rand_pcg::Pcg64Dxsm;
use serde::{Deserialize, Serialize};

const LEAD: u32 = 0;

/// What a leader does with the belief that it was handed.
pub trait Walker {
    /// One leader's step: measure, update, choose who leads next. The first leader has no message.
    ///
    /// # Errors
    /// If the message is no belief, or the measurement is impossible under it: the leader then keeps what it had.
    fn lead(&self, rng: &mut Pcg64Dxsm, slot: u32, node: SensorId, message: Option<&BitString>) -> Result<Lead, Error>;
}

/// What a leader's step gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Lead {
    /// The belief as it travels on.
    pub message: BitString,
    /// Who leads next; nobody ends the walk.
    pub next: Option<SensorId>,
    /// The estimate.
    pub estimate: Vec<f64>,
}

/// A belief that walks over the network under a [`Walker`].
///
/// ```text
/// slot k, leader:  belief = lead(message);  send it to the next leader, hop by hop along a shortest route, named slot k + 1
///         others:  a handover for somebody else goes on; one for oneself makes a leader; a second one of its slot is noted
/// ```
/// With acknowledgements, a leader whose handover is not acknowledged stays leader and notes it ([`Note::Retained`]): should the belief have
/// arrived all the same there are two of them from then on, and where they meet the log has the disagreement.
#[derive(Debug, Clone)]
pub struct Walk<W> {
    walker: W,
    clock: Clock,
    stream: Stream,
    last_slot: u32,
    acknowledged: bool,
}

/// A node of a [`Walk`].
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WalkNode {
    /// The slot in which it leads, and the belief that it was handed.
    leading: Option<(u32, Option<Stored>)>,
    /// Slot and digest of the last handover that it took.
    taken: Option<(u32, u32)>,
    /// Slot and digest of the last handover that it passed on.
    passed: Option<(u32, u32)>,
    estimates: Vec<(u32, Vec<f64>)>,
}

impl WalkNode {
    /// The estimates that it made, each with its slot.
    pub fn estimates(&self) -> &[(u32, Vec<f64>)] {
        &self.estimates
    }

    /// The slot in which it leads, if it does.
    pub fn leads(&self) -> Option<u32> {
        self.leading.as_ref().map(|(slot, _)| *slot)
    }
}

impl<W: Walker> Walk<W> {
    /// A walk of at most `slots` steps; `stream` is what the walker draws from.
    pub fn new(walker: W, clock: Clock, slots: u32, stream: Stream) -> Self {
        Self {
            walker,
            clock,
            stream,
            last_slot: slots.min((1 << 29) - 1),
            acknowledged: false,
        }
    }

    /// The walker.
    pub fn walker(&self) -> &W {
        &self.walker
    }

    /// The slots.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// The network before its first slot, in which `first` leads.
    ///
    /// # Errors
    /// If the setup is out of range, `first` does not exist, or the field is not in one piece.
    pub fn simulate(mut self, field: Field, first: SensorId, setup: Setup) -> Result<Simulator<Self>, Error> {
        field.check(first)?;
        field.routes(first)?;
        self.acknowledged = setup.retries.is_some();
        let clock = self.clock;
        let mut nodes = vec![WalkNode::default(); field.len()];
        nodes[first.index()].leading = Some((1, None));
        let mut simulator = Simulator::new(self, nodes, field, setup)?;
        simulator.start(first, clock.start(1), LEAD)?;
        Ok(simulator)
    }

    fn lead(&self, node: &mut WalkNode, context: &mut Context<'_>) -> Result<(), Error> {
        let Some((slot, message)) = node.leading.take() else {
            return Ok(());
        };
        let mut rng = shared(self.stream, "lead", slot);
        let message_bits = message.as_ref().map(|stored| &stored.0);
        let Ok(step) = self.walker.lead(&mut rng, slot, context.id(), message_bits) else {
            context.note(Note::Refused { slot });
            self.stay(node, context, slot + 1, message);
            return Ok(());
        };
        node.estimates.push((slot, step.estimate));
        let Some(next) = step.next else { return Ok(()) };
        if next == context.id() {
            self.stay(node, context, slot + 1, Some(Stored(step.message)));
            return Ok(());
        }
        let sum = digest(u64::from(slot + 1), &step.message);
        let frame = Frame {
            destination: next.0,
            ..Frame::new(Kind::Handover, slot + 1, sum, step.message.clone())
        };
        if slot < self.last_slot && !self.pass(context, frame)? && self.acknowledged {
            context.note(Note::Retained { slot });
            self.stay(node, context, slot + 1, Some(Stored(step.message)));
        }
        Ok(())
    }

    /// Leads in a slot to come.
    fn stay(&self, node: &mut WalkNode, context: &mut Context<'_>, slot: u32, message: Option<Stored>) {
        if slot <= self.last_slot {
            node.leading = Some((slot, message));
            context.at(self.clock.start(slot), LEAD);
        }
    }

    /// Sends a handover one hop further. True if that was acknowledged.
    fn pass(&self, context: &mut Context<'_>, frame: Frame) -> Result<bool, Error> {
        let (id, destination) = (context.id(), frame.destination);
        let field = context.field();
        field.check(SensorId(destination))?;
        let hop = if field.graph().neighbours(id.index()).binary_search(&destination).is_ok() {
            destination
        } else {
            let routes = field.graph().hops_from(destination as usize)?;
            match routes.parent(id.index()) {
                Some(hop) => hop as u32,
                None => return Ok(false),
            }
        };
        context.send_now(SensorId(hop), frame)
    }
}

impl<W: Walker> Protocol for Walk<W> {
    type Node = WalkNode;

    fn on_timer(&self, node: &mut WalkNode, context: &mut Context<'_>, _: u32) -> Result<(), Error> {
        self.lead(node, context)
    }

    fn on_frame(
        &self,
        node: &mut WalkNode,
        context: &mut Context<'_>,
        from: SensorId,
        frame: &Frame,
    ) -> Result<(), Error> {
        let slot = frame.slot;
        let known = (frame.destination as usize) < context.field().len();
        if frame.kind != Kind::Handover || !known {
            context.note(Note::Malformed);
            return Ok(());
        }
        if digest(u64::from(slot), &frame.payload) != frame.digest {
            context.note(Note::Disagreement { with: from, slot });
            return Ok(());
        }
        let own = frame.destination == context.id().0;
        let last = if own { &mut node.taken } else { &mut node.passed };
        match *last {
            Some(seen) if seen == (slot, frame.digest) => {
                context.note(Note::Duplicate);
                return Ok(());
            }
            Some((seen, _)) if own && slot == seen => {
                context.note(Note::Disagreement { with: from, slot });
                return Ok(());
            }
            Some((seen, _)) if own && slot < seen => {
                context.note(Note::Late);
                return Ok(());
            }
            _ => *last = Some((slot, frame.digest)),
        }
        if !own {
            if !self.pass(context, frame.clone())? && self.acknowledged {
                // The belief is here now: whoever holds it leads.
                context.note(Note::Retained { slot });
                self.stay(node, context, slot, Some(Stored(frame.payload.clone())));
            }
            return Ok(());
        }
        if node.leading.is_some() {
            // Two leaders have met: the belief that has seen more stays, the later one of equals goes.
            context.note(Note::Disagreement { with: from, slot });
            if node.leads().is_some_and(|leads| leads >= slot) {
                return Ok(());
            }
        }
        self.stay(node, context, slot, Some(Stored(frame.payload.clone())));
        Ok(())
    }

    /// The belief is gone if it was here.
    fn on_restart(&self, node: &mut WalkNode, _: &mut Context<'_>) -> Result<(), Error> {
        node.leading = None;
        Ok(())
    }
}
