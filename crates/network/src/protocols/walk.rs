//! A belief that is sent from leader to leader or along a chain of nodes, hop by hop: the state machines of `fewbits-protocol` on the
//! simulated radio.

use super::{decoded, malformed};
use crate::clock::Clock;
use crate::error::{Cause, Error};
use crate::medium::Field;
use crate::note::{Note, Stage};
use crate::simulator::{Context, Protocol, Setup, Simulator, Storable, Ticket};
use crate::units::{Instant, SensorId};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::error::refuse;
use fewbits_protocol::{Bearer, Errand, Frame, Leader, SLOT_BITS, Slot};
use serde::{Deserialize, Serialize};

/// A belief that is sent over the network from leader to leader, as a [`Leader`] decides.
///
/// ```text
/// slot k, leader:  belief = lead(message);  send it to the next leader, hop by hop along a shortest route, named slot k + 1
///         others:  a handover for somebody else goes on; one for oneself makes a leader; a second one of its slot is noted
/// ```
/// With acknowledgements, a node that gives up a handover leads itself and notes it. If the belief arrived nevertheless, there are two
/// leaders from then on; when they meet, the log has a disagreement. A leader draws from the random stream of its slot.
#[derive(Debug, Clone)]
pub struct Walk<L> {
    leader: L,
    clock: Clock,
    stream: Stream,
    last_slot: u32,
}

/// A node of a [`Walk`].
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WalkNode {
    bearer: Bearer,
    /// Handovers that are sent and not answered: the radio's ticket, and the name of the frame.
    tickets: Vec<(Ticket, (Slot, u32))>,
    estimates: Vec<(u32, Vec<f64>)>,
}

impl WalkNode {
    /// The estimates that this node made as a leader, each with its slot.
    pub fn estimates(&self) -> &[(u32, Vec<f64>)] {
        &self.estimates
    }

    /// The slot in which it leads; `None` if it does not.
    pub fn leads(&self) -> Option<u32> {
        self.bearer.leads().map(Slot::number)
    }
}

impl<L: Leader> Walk<L> {
    /// A walk of at most `slots` slots, fewer than 2^23. Leaders draw from `stream`.
    ///
    /// # Errors
    /// If `slots` is 2^23 or more.
    pub fn new(leader: L, clock: Clock, slots: u32, stream: Stream) -> Result<Self, Error> {
        if slots >= 1 << (SLOT_BITS - 1) {
            return refuse("slots", slots, "fewer than 2^23");
        }
        Ok(Self {
            leader,
            clock,
            stream,
            last_slot: slots,
        })
    }

    /// The network before its first slot, in which `first` leads.
    ///
    /// # Errors
    /// If the setup is out of range, `first` does not exist, or the field is not connected.
    pub fn simulate(self, field: Field, first: SensorId, setup: Setup) -> Result<Simulator<Self>, Error> {
        field.check(first)?;
        field.routes(first)?;
        let (clock, acknowledged) = (self.clock, setup.retries.is_some());
        let node = |id: usize| {
            let bearer = Bearer::new(id as u32, clock.schedule(), u64::from(self.last_slot), acknowledged);
            WalkNode {
                bearer: if id == first.index() { bearer.first() } else { bearer },
                tickets: Vec::new(),
                estimates: Vec::new(),
            }
        };
        let nodes = (0..field.len()).map(node).collect();
        let mut simulator = Simulator::new(self, nodes, field, setup)?;
        simulator.start(first, clock.start(1), 0)?;
        Ok(simulator)
    }

    fn carry_out(&self, node: &mut WalkNode, context: &mut Context<'_>, mut errands: Vec<Errand>) -> Result<(), Error> {
        let now = context.now().0;
        // An errand can lead to others: repeat until none is left.
        while !errands.is_empty() {
            let mut next = Vec::new();
            for errand in errands {
                match errand {
                    Errand::SetTimer { at } => context.at(Instant(at), 0),
                    Errand::Note { with, note } => {
                        let with = SensorId(with);
                        context.note(Note::Frame { with, note });
                    }
                    Errand::Send {
                        destination,
                        name,
                        frame,
                    } => match hop(context, destination)? {
                        Some(hop) => {
                            let ticket = context.send_now(hop, &decoded(&frame)?)?;
                            if context.has_acknowledgements() {
                                node.tickets.push((ticket, name));
                            }
                        }
                        None => node.bearer.on_give_up(now, name, &mut next),
                    },
                    Errand::Lead { slot, message } => {
                        let slot = slot.number();
                        let mut rng = self.stream.named("lead").indexed(u64::from(slot)).rng();
                        match self
                            .leader
                            .lead(&mut rng, u64::from(slot), context.id().0, message.as_ref())
                        {
                            Ok(lead) => {
                                node.estimates.push((slot, lead.estimate.clone()));
                                node.bearer.on_led(now, lead, &mut next);
                            }
                            Err(error) => {
                                node.bearer.on_failed(now, &mut next);
                                self.failed(context, slot, error)?;
                            }
                        }
                    }
                }
            }
            errands = next;
        }
        Ok(())
    }

    /// Notes that a leader's step failed. Different nodes lead, so failures are counted over the whole run.
    fn failed(&self, context: &mut Context<'_>, slot: u32, error: Cause) -> Result<(), Error> {
        let last = Note::failed(Stage::Lead, slot, &error);
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
}

/// The neighbour that is next on a shortest route to `destination`; `None` if there is no route.
fn hop(context: &Context<'_>, destination: u32) -> Result<Option<SensorId>, Error> {
    let (id, field) = (context.id(), context.field());
    field.check(SensorId(destination))?;
    if field.graph().neighbours(id.index()).binary_search(&destination).is_ok() {
        return Ok(Some(SensorId(destination)));
    }
    let routes = field.graph().hops_from(destination as usize)?;
    Ok(routes.parent(id.index()).map(|hop| SensorId(hop as u32)))
}

impl<L: Leader> Protocol for Walk<L> {
    type Node = WalkNode;

    fn on_timer(&self, node: &mut WalkNode, context: &mut Context<'_>, _: u32) -> Result<(), Error> {
        let mut errands = Vec::new();
        node.bearer.on_timer(context.now().0, &mut errands);
        self.carry_out(node, context, errands)
    }

    fn on_frame(
        &self,
        node: &mut WalkNode,
        context: &mut Context<'_>,
        from: SensorId,
        frame: &Frame<'_>,
    ) -> Result<(), Error> {
        if (frame.destination as usize) >= context.field().len() {
            context.note(malformed(from, frame));
            return Ok(());
        }
        let mut errands = Vec::new();
        node.bearer.on_decoded(context.now().0, from.0, frame, &mut errands);
        self.carry_out(node, context, errands)
    }

    fn on_ack(&self, node: &mut WalkNode, _: &mut Context<'_>, ticket: Ticket) -> Result<(), Error> {
        if let Some(at) = node.tickets.iter().position(|(sent, _)| *sent == ticket) {
            node.bearer.on_ack(node.tickets.remove(at).1);
        }
        Ok(())
    }

    fn on_give_up(&self, node: &mut WalkNode, context: &mut Context<'_>, ticket: Ticket) -> Result<(), Error> {
        let Some(at) = node.tickets.iter().position(|(sent, _)| *sent == ticket) else {
            return Ok(());
        };
        let mut errands = Vec::new();
        node.bearer
            .on_give_up(context.now().0, node.tickets.remove(at).1, &mut errands);
        self.carry_out(node, context, errands)
    }

    /// A restarted node loses the belief if it had it.
    fn on_restart(&self, node: &mut WalkNode, _: &mut Context<'_>) -> Result<(), Error> {
        node.bearer.on_memory_lost();
        node.tickets.clear();
        Ok(())
    }
}

impl<L: Leader> Storable for Walk<L> {
    type Stored = WalkNode;

    fn store(&self, node: &WalkNode) -> Result<WalkNode, Cause> {
        Ok(node.clone())
    }

    fn revive(&self, _: usize, stored: WalkNode) -> Result<WalkNode, Cause> {
        Ok(stored)
    }
}
