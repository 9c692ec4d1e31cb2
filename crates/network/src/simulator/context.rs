//! The interface of protocols: event handlers of nodes, and the actions that they may take.

use super::core::{SimulatorCore, Ticket};
use super::queue::EventKind;
use crate::error::{Cause, Error};
use crate::medium::Field;
use crate::note::Note;
use crate::units::{Instant, Seconds, SensorId};
use fewbits_protocol::Frame;
use serde::{Serialize, de::DeserializeOwned};

/// Behaviour of the nodes: one small state machine per node, all under one protocol.
///
/// Handlers see their own node and the [`Context`], never another node: whatever passes between nodes is bits. An error of a
/// handler ends the run; what may happen in a faulty network is no error but a [`Note`].
pub trait Protocol {
    /// State of one node.
    type Node;

    /// A timer has fired that the node set, or that started it.
    ///
    /// # Errors
    /// An error ends the run.
    fn on_timer(&self, node: &mut Self::Node, context: &mut Context<'_>, token: u32) -> Result<(), Error>;

    /// A frame has arrived and passed its check.
    ///
    /// # Errors
    /// An error ends the run.
    fn on_frame(
        &self,
        node: &mut Self::Node,
        context: &mut Context<'_>,
        from: SensorId,
        frame: &Frame<'_>,
    ) -> Result<(), Error>;

    /// A frame has arrived and failed its check. Slots tell who sent it.
    ///
    /// # Errors
    /// An error ends the run.
    fn on_damaged(&self, _: &mut Self::Node, _: &mut Context<'_>, _: SensorId) -> Result<(), Error> {
        Ok(())
    }

    /// The acknowledgement of a frame has arrived. Only if the setup has acknowledgements ([`Setup::retries`](crate::Setup::retries)), and never for broadcasts.
    ///
    /// # Errors
    /// An error ends the run.
    fn on_ack(&self, _: &mut Self::Node, _: &mut Context<'_>, _: Ticket) -> Result<(), Error> {
        Ok(())
    }

    /// No acknowledgement of a frame has arrived, and no repetition is left. The frame may have arrived all the same. Exactly one of this and
    /// [`on_ack`](Self::on_ack) is called for each acknowledged frame, unless its sender restarts or dies before.
    ///
    /// # Errors
    /// An error ends the run.
    fn on_give_up(&self, _: &mut Self::Node, _: &mut Context<'_>, _: Ticket) -> Result<(), Error> {
        Ok(())
    }

    /// The node has lost its memory and begins anew. Timers that it set still fire.
    ///
    /// # Errors
    /// An error ends the run.
    fn on_restart(&self, node: &mut Self::Node, context: &mut Context<'_>) -> Result<(), Error>;
}

/// A protocol whose nodes can be stored in a snapshot.
pub trait Storable: Protocol {
    /// A node as it is stored.
    type Stored: Serialize + DeserializeOwned;

    /// The node as it is stored.
    ///
    /// # Errors
    /// If it cannot be written.
    fn store(&self, node: &Self::Node) -> Result<Self::Stored, Cause>;

    /// The node with this index as it was stored.
    ///
    /// # Errors
    /// If what was stored is no such node.
    fn revive(&self, index: usize, stored: Self::Stored) -> Result<Self::Node, Cause>;
}

/// A node's view of the network while it handles an event.
#[derive(Debug)]
pub struct Context<'a> {
    pub(super) core: &'a mut SimulatorCore,
    pub(super) node: SensorId,
}

impl<'a> Context<'a> {
    pub(super) fn new(core: &'a mut SimulatorCore, node: SensorId) -> Self {
        Self { core, node }
    }

    /// The node that handles the event.
    pub fn id(&self) -> SensorId {
        self.node
    }

    /// The time by the node's own clock.
    pub fn now(&self) -> Instant {
        self.core.local(self.node, self.core.state.now)
    }

    /// Positions and neighbours of all nodes.
    pub fn field(&self) -> &Field {
        &self.core.field
    }

    /// Sets a timer by the node's own clock; one in the past fires now.
    pub fn at(&mut self, time: Instant, token: u32) {
        let time = self.core.when(self.node, time);
        self.core.schedule(time, self.node, EventKind::Timer(token));
    }

    /// Sets a timer.
    pub fn after(&mut self, duration: Seconds, token: u32) {
        self.at(self.now().after(duration), token);
    }

    /// Sends to a neighbour, perhaps later in a batch. Returns at once; with acknowledgements, [`Protocol::on_ack`] or
    /// [`Protocol::on_give_up`] is called with the ticket later.
    ///
    /// # Errors
    /// [`Error::UnknownNode`], [`Error::SelfLink`], [`Error::OutOfRange`].
    pub fn send(&mut self, to: SensorId, frame: &Frame<'_>) -> Result<Ticket, Error> {
        self.core.field.check_link(self.node, to)?;
        Ok(self.core.submit(self.node, Some(to), frame))
    }

    /// Sends to a neighbour as soon as the air is free, alone.
    ///
    /// # Errors
    /// As [`Context::send`].
    pub fn send_now(&mut self, to: SensorId, frame: &Frame<'_>) -> Result<Ticket, Error> {
        self.core.field.check_link(self.node, to)?;
        Ok(self.core.send(self.node, Some(to), frame))
    }

    /// Sends to all neighbours, perhaps later in a batch. Nobody acknowledges it.
    pub fn broadcast(&mut self, frame: &Frame<'_>) {
        self.core.submit(self.node, None, frame);
    }

    /// Whether frames to one receiver are acknowledged.
    pub fn has_acknowledgements(&self) -> bool {
        self.core.setup.retries.is_some()
    }

    /// How many steps of estimators and sensors have failed so far, in the whole network.
    pub(crate) fn failures(&self) -> u64 {
        self.core.state.ledger.faults.failures
    }

    /// Writes a note into the log.
    pub fn note(&mut self, note: Note) {
        self.core.note(self.node, note);
    }
}
