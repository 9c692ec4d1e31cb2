//! A belief that travels: from leader to leader, or along a chain of nodes, hop by hop.

use crate::clock::Clock;
use crate::error::Error;
use crate::measurements::MAX_SLOTS;
use crate::medium::{Field, Frame, Kind, Stored, digest};
use crate::note::{Note, Stage};
use crate::protocols::slot::shared;
use crate::simulator::{Context, Protocol, Setup, Simulator, Ticket};
use crate::units::SensorId;
use fewbits_core::BitString;
use fewbits_monte_carlo::Stream;
use rand_pcg::Pcg64Dxsm;
use serde::{Deserialize, Serialize};

/// Timer: the slot of a leader begins.
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
/// With acknowledgements, a node that gives up a handover leads itself and notes it ([`Note::Retained`]): should the belief have arrived all the same,
/// there are two leaders from then on, and where they meet the log has the disagreement. A node that leads already keeps the belief that has seen
/// more slots.
#[derive(Debug, Clone)]
pub struct Walk<W> {
    walker: W,
    clock: Clock,
    stream: Stream,
    last_slot: u32,
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
    /// Handovers that it sent and that are not acknowledged yet.
    pending: Vec<PendingHandover>,
    estimates: Vec<(u32, Vec<f64>)>,
}

/// A handover that was sent and is not acknowledged yet.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PendingHandover {
    ticket: Ticket,
    to: SensorId,
    /// The slot in which its receiver is to lead.
    slot: u32,
    belief: Stored,
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
            last_slot: slots.min(MAX_SLOTS),
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
    pub fn simulate(self, field: Field, first: SensorId, setup: Setup) -> Result<Simulator<Self>, Error> {
        field.check(first)?;
        field.routes(first)?;
        let clock = self.clock;
        let mut nodes = vec![WalkNode::default(); field.len()];
        nodes[first.index()].leading = Some((1, None));
        let mut simulator = Simulator::new(self, nodes, field, setup)?;
        simulator.start(first, clock.start(1), LEAD)?;
        Ok(simulator)
    }

    fn lead(&self, node: &mut WalkNode, context: &mut Context<'_>) -> Result<(), Error> {
        // A timer that was set for an earlier handover must not start a slot that is still to come.
        let Some((slot, message)) = node
            .leading
            .take_if(|(slot, _)| self.clock.start(*slot) <= context.now())
        else {
            return Ok(());
        };
        let mut rng = shared(self.stream, "lead", slot);
        let message_bits = message.as_ref().map(|stored| &stored.0);
        let step = match self.walker.lead(&mut rng, slot, context.id(), message_bits) {
            Ok(step) => step,
            Err(error) => {
                self.stay(node, context, slot + 1, message);
                return self.failed(context, slot, &error);
            }
        };
        node.estimates.push((slot, step.estimate));
        let Some(next) = step.next else { return Ok(()) };
        let belief = Stored(step.message);
        if next == context.id() {
            self.stay(node, context, slot + 1, Some(belief));
            return Ok(());
        }
        if slot >= self.last_slot {
            return Ok(());
        }
        let frame = Frame {
            destination: next.0,
            ..Frame::new(Kind::Handover, slot + 1, digest(u64::from(slot + 1), &belief.0), belief.0)
        };
        self.pass(node, context, frame)
    }

    /// Notes that a leader's step failed. Leaders change, so failures count over the whole run.
    fn failed(&self, context: &mut Context<'_>, slot: u32, error: &Error) -> Result<(), Error> {
        let (stage, reason) = (Stage::Lead, error.in_full());
        let last = Note::Failed { stage, slot, reason };
        context.note(last.clone());
        if context.failures() > u64::from(self.last_slot / 2) {
            return Err(Error::MostSlotsFailed {
                node: context.id(),
                failed: u32::try_from(context.failures()).unwrap_or(u32::MAX),
                slots: self.last_slot,
                last,
            });
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

    /// Takes a belief that another node was to lead with, or that another node has sent. Where this node leads already, the belief that has seen more
    /// slots stays, of equals the one that is here.
    fn take_over(&self, node: &mut WalkNode, context: &mut Context<'_>, with: SensorId, slot: u32, belief: Stored) {
        if let Some(leads) = node.leads() {
            context.note(Note::Disagreement { with, slot });
            if leads >= slot {
                return;
            }
        }
        self.stay(node, context, slot, Some(belief));
    }

    /// Sends a handover one hop further. Without a route this node keeps it.
    fn pass(&self, node: &mut WalkNode, context: &mut Context<'_>, frame: Frame) -> Result<(), Error> {
        let (id, destination, slot) = (context.id(), frame.destination, frame.slot);
        let field = context.field();
        field.check(SensorId(destination))?;
        let hop = if field.graph().neighbours(id.index()).binary_search(&destination).is_ok() {
            Some(destination)
        } else {
            let routes = field.graph().hops_from(destination as usize)?;
            routes.parent(id.index()).map(|hop| hop as u32)
        };
        let Some(hop) = hop.map(SensorId) else {
            self.keep(node, context, SensorId(destination), slot, Stored(frame.payload));
            return Ok(());
        };
        let ticket = context.send_now(hop, &frame)?;
        if context.has_acknowledgements() {
            node.pending.push(PendingHandover {
                ticket,
                to: hop,
                slot,
                belief: Stored(frame.payload),
            });
        }
        Ok(())
    }

    /// Keeps a belief that could not be handed over.
    fn keep(&self, node: &mut WalkNode, context: &mut Context<'_>, with: SensorId, slot: u32, belief: Stored) {
        context.note(Note::Retained { slot });
        self.take_over(node, context, with, slot, belief);
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
            return self.pass(node, context, frame.clone());
        }
        self.take_over(node, context, from, slot, Stored(frame.payload.clone()));
        Ok(())
    }

    fn on_ack(&self, node: &mut WalkNode, _: &mut Context<'_>, ticket: Ticket) -> Result<(), Error> {
        node.pending.retain(|handover| handover.ticket != ticket);
        Ok(())
    }

    fn on_give_up(&self, node: &mut WalkNode, context: &mut Context<'_>, ticket: Ticket) -> Result<(), Error> {
        if let Some(at) = node.pending.iter().position(|handover| handover.ticket == ticket) {
            let handover = node.pending.remove(at);
            self.keep(node, context, handover.to, handover.slot, handover.belief);
        }
        Ok(())
    }

    /// The belief is gone if it was here.
    fn on_restart(&self, node: &mut WalkNode, _: &mut Context<'_>) -> Result<(), Error> {
        node.leading = None;
        node.pending.clear();
        Ok(())
    }
}
