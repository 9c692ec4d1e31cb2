//! The interface of protocols: event handlers of nodes, and the actions that they may take.

use super::core::{SimulatorCore, Ticket};
use super::queue::EventKind;
use crate::error::{Cause, Error};
use crate::medium::Field;
use crate::note::Note;
use crate::units::{Instant, SensorId};
use fewbits_protocol::Frame;
use serde::{Serialize, de::DeserializeOwned};

/// Behaviour of the nodes: one small state machine per node, all under one protocol.
///
/// Handlers see their own node and the [`Context`], never another node: only bits pass between nodes. An error of a
/// handler ends the run. Events that a faulty network can cause are no errors; handlers write a [`Note`].
pub trait Protocol {
    /// State of one node.
    type Node;

    /// A timer has fired that the node or the start of the simulation set.
    ///
    /// # Errors
    /// If the run must end.
    fn on_timer(&self, node: &mut Self::Node, context: &mut Context<'_>, token: u32) -> Result<(), Error>;

    /// A frame has arrived and passed its check.
    ///
    /// # Errors
    /// If the run must end.
    fn on_frame(
        &self,
        node: &mut Self::Node,
        context: &mut Context<'_>,
        from: SensorId,
        frame: &Frame<'_>,
    ) -> Result<(), Error>;

    /// A frame has arrived and failed its check. The slot tells who sent it.
    ///
    /// # Errors
    /// If the run must end.
    fn on_damaged(&self, _: &mut Self::Node, _: &mut Context<'_>, _: SensorId) -> Result<(), Error> {
        Ok(())
    }

    /// The acknowledgement of a frame has arrived. This needs acknowledgements in the setup ([`Setup::retries`](crate::Setup::retries));
    /// broadcasts have none.
    ///
    /// # Errors
    /// If the run must end.
    fn on_ack(&self, _: &mut Self::Node, _: &mut Context<'_>, _: Ticket) -> Result<(), Error> {
        Ok(())
    }

    /// No acknowledgement of a frame has arrived, and no repetition is left. The frame itself may have arrived. For each acknowledged frame
    /// either this or [`on_ack`](Self::on_ack) is called once, unless its sender restarts or dies before.
    ///
    /// # Errors
    /// If the run must end.
    fn on_give_up(&self, _: &mut Self::Node, _: &mut Context<'_>, _: Ticket) -> Result<(), Error> {
        Ok(())
    }

    /// The node has lost its memory and starts again. Timers that it set before still fire.
    ///
    /// # Errors
    /// If the run must end.
    fn on_restart(&self, node: &mut Self::Node, context: &mut Context<'_>) -> Result<(), Error>;
}

/// A protocol whose nodes can be stored in a snapshot.
pub trait Storable: Protocol {
    /// The stored form of a node.
    type Stored: Serialize + DeserializeOwned;

    /// Converts a node to its stored form.
    ///
    /// # Errors
    /// If the node cannot be stored.
    fn store(&self, node: &Self::Node) -> Result<Self::Stored, Cause>;

    /// Makes the node `index` from its stored form.
    ///
    /// # Errors
    /// If the stored form is not that of such a node.
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

    /// Index of the node that handles the event.
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

    /// Sets a timer at a time of the node's own clock. If that is past, it fires now. `token` is passed to [`Protocol::on_timer`].
    pub fn at(&mut self, time: Instant, token: u32) {
        let time = self.core.when(self.node, time);
        self.core.schedule(time, self.node, EventKind::Timer(token));
    }

    /// Sends to a neighbour, possibly later in a batch. With acknowledgements, [`Protocol::on_ack`] or
    /// [`Protocol::on_give_up`] is called later with the returned ticket.
    ///
    /// # Errors
    /// [`Error::UnknownNode`], [`Error::SelfLink`], [`Error::OutOfRange`].
    pub fn send(&mut self, to: SensorId, frame: &Frame<'_>) -> Result<Ticket, Error> {
        self.core.field.check_link(self.node, to)?;
        Ok(self.core.submit(self.node, Some(to), frame))
    }

    /// Sends to a neighbour as soon as the medium is free, not in a batch.
    ///
    /// # Errors
    /// As [`Context::send`].
    pub(crate) fn send_now(&mut self, to: SensorId, frame: &Frame<'_>) -> Result<Ticket, Error> {
        self.core.field.check_link(self.node, to)?;
        Ok(self.core.send(self.node, Some(to), frame))
    }

    /// Sends to all neighbours, possibly later in a batch. Broadcasts are not acknowledged.
    pub fn broadcast(&mut self, frame: &Frame<'_>) {
        self.core.submit(self.node, None, frame);
    }

    /// Whether frames to a single receiver are acknowledged.
    pub(crate) fn has_acknowledgements(&self) -> bool {
        self.core.setup.retries.is_some()
    }

    /// Number of failed steps of estimators and sensors so far, in the whole network.
    pub(crate) fn failures(&self) -> u64 {
        self.core.state.ledger.faults.failures
    }

    /// Writes a note into the log.
    pub fn note(&mut self, note: Note) {
        self.core.note(self.node, note);
    }
}
