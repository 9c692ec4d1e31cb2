//! The event-driven runner.

use crate::channel::{Channel, Check};
use crate::error::Error;
use crate::field::Field;
use crate::frame::{Frame, Kind};
use crate::kernel::Kernel;
use crate::ledger::{Account, Ledger};
use crate::log::{Detail, Log, Note};
use crate::queue::{Event, What};
use crate::radio::Radio;
use crate::units::{Instant, Joules, Seconds, SensorId};
use fewbits_core::BitString;
use fewbits_monte_carlo::Stream;
use fewbits_numerics::ArgumentError;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};

/// What the nodes do: one small state machine a node, all under one protocol.
///
/// Handlers see their own node and the [`Context`], never another node: whatever passes between nodes is bits. An error of a
/// handler ends the run; what may happen in a faulty network is no error but a [`Note`].
pub trait Protocol {
    /// What one node remembers.
    type Node;

    /// A timer that the node set, or that started it.
    ///
    /// # Errors
    /// What ends the run.
    fn on_timer(&self, node: &mut Self::Node, context: &mut Context<'_>, token: u32) -> Result<(), Error>;

    /// A frame that passed its check.
    ///
    /// # Errors
    /// What ends the run.
    fn on_frame(
        &self,
        node: &mut Self::Node,
        context: &mut Context<'_>,
        from: SensorId,
        frame: &Frame,
    ) -> Result<(), Error>;

    /// A frame that failed its check. Slots tell who sent it.
    ///
    /// # Errors
    /// What ends the run.
    fn on_damaged(&self, _: &mut Self::Node, _: &mut Context<'_>, _: SensorId) -> Result<(), Error> {
        Ok(())
    }

    /// The node has lost its memory and begins anew.
    ///
    /// # Errors
    /// What ends the run.
    fn on_restart(&self, node: &mut Self::Node, context: &mut Context<'_>) -> Result<(), Error>;
}

/// Frames that wait for company: up to `most` to the same receiver, at most `hold` long, share one preamble and header.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Batching {
    /// The most frames of a batch.
    pub most: usize,
    /// How long the first waits.
    pub hold: Seconds,
}

impl Batching {
    /// Every frame at once and alone.
    pub const NONE: Self = Self {
        most: 1,
        hold: Seconds::ZERO,
    };
}

/// Something that befalls a node.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// When.
    pub at: Seconds,
    /// Whom.
    pub node: SensorId,
    /// What.
    pub what: Mishap,
}

/// What can befall a node.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Mishap {
    /// It dies.
    Death,
    /// It loses its memory and begins anew.
    Restart,
    /// Its radio neither sends nor receives for so long.
    Outage(Seconds),
}

/// Everything about a network but its nodes' behaviour.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// The radio of every node.
    pub radio: Radio,
    /// What the air does.
    pub channel: Channel,
    /// Repetitions of a frame to one receiver until it is acknowledged; `None` for no acknowledgements.
    pub retries: Option<u32>,
    /// Whether frames wait for company.
    pub batching: Batching,
    /// What the check of a report covers; other frames are checked whole.
    pub report_check: Check,
    /// What befalls the nodes.
    pub faults: Vec<Fault>,
    /// How much is logged.
    pub detail: Detail,
    /// All randomness of the network: every frame has a stream of its own.
    pub stream: Stream,
}

impl Setup {
    /// A network without faults.
    pub fn new(radio: Radio, stream: Stream) -> Self {
        Self {
            radio,
            channel: Channel::PERFECT,
            retries: None,
            batching: Batching::NONE,
            report_check: Check::Whole,
            faults: Vec::new(),
            detail: Detail::Notes,
            stream,
        }
    }
}

/// A node's view of the network while it handles an event.
#[derive(Debug)]
pub struct Context<'a> {
    kernel: &'a mut Kernel,
    node: SensorId,
}

impl Context<'_> {
    /// Who handles the event.
    pub fn id(&self) -> SensorId {
        self.node
    }

    /// When.
    pub fn now(&self) -> Instant {
        self.kernel.state.now
    }

    /// Where everybody stands.
    pub fn field(&self) -> &Field {
        &self.kernel.field
    }

    /// Sets a timer; one in the past fires now.
    pub fn at(&mut self, time: Instant, token: u32) {
        self.kernel.schedule(time, self.node, What::Timer(token));
    }

    /// Sets a timer.
    pub fn after(&mut self, duration: Seconds, token: u32) {
        self.at(self.now().after(duration), token);
    }

    /// Sends to a neighbour, perhaps later in a batch. True if an acknowledgement came.
    ///
    /// # Errors
    /// [`Error::UnknownNode`], [`Error::SelfLink`], [`Error::OutOfRange`]; if the frame does not fit its format.
    pub fn send(&mut self, to: SensorId, frame: Frame) -> Result<bool, Error> {
        self.kernel.field.check_link(self.node, to)?;
        self.kernel.submit(self.node, Some(to), frame)
    }

    /// Sends to a neighbour at once and alone. True if an acknowledgement came.
    ///
    /// # Errors
    /// As [`Context::send`].
    pub fn send_now(&mut self, to: SensorId, frame: Frame) -> Result<bool, Error> {
        self.kernel.field.check_link(self.node, to)?;
        self.kernel.transmit(self.node, Some(to), &frame)
    }

    /// Sends to all neighbours, perhaps later in a batch.
    ///
    /// # Errors
    /// If the frame does not fit its format.
    pub fn broadcast(&mut self, frame: Frame) -> Result<(), Error> {
        self.kernel.submit(self.node, None, frame).map(|_| ())
    }

    /// Notes something.
    pub fn note(&mut self, note: Note) {
        self.kernel.note(self.node, note);
    }
}

/// A network at some instant.
#[derive(Debug)]
pub struct Simulator<P: Protocol> {
    protocol: P,
    nodes: Vec<P::Node>,
    kernel: Kernel,
}

impl<P: Protocol> Simulator<P> {
    /// A network of one node state for each node of the field; nothing has happened yet and no timer is set.
    ///
    /// # Errors
    /// If numbers of the setup are out of range, a fault befalls a node that does not exist, or there is not one state for each
    /// node.
    pub fn new(protocol: P, nodes: Vec<P::Node>, field: Field, setup: Setup) -> Result<Self, Error> {
        if nodes.len() != field.len() {
            let expected = format!("{}, one per node of the field", field.len());
            return Err(ArgumentError::new("nodes", nodes.len(), expected).into());
        }
        Ok(Self {
            kernel: Kernel::new(field, setup)?,
            protocol,
            nodes,
        })
    }

    /// Starts a node's first timer.
    ///
    /// # Errors
    /// [`Error::UnknownNode`].
    pub fn start(&mut self, node: SensorId, at: Instant, token: u32) -> Result<(), Error> {
        self.kernel.field.check(node)?;
        self.kernel.schedule(at, node, What::Timer(token));
        Ok(())
    }

    /// Lets arbitrary bits arrive at a node, as if `from` had sent them: what a stranger's radio does. Nothing is charged.
    ///
    /// # Errors
    /// [`Error::UnknownNode`].
    pub fn inject(&mut self, at: Instant, from: SensorId, to: SensorId, bits: BitString) -> Result<(), Error> {
        self.kernel.field.check(from)?;
        self.kernel.field.check(to)?;
        self.kernel.deliver(at, from, to, bits);
        Ok(())
    }

    /// Takes what happens to each transmission from a log instead of the channel.
    #[must_use]
    pub fn replaying(mut self, log: &Log) -> Self {
        self.kernel.recorded = Some(log.transmissions().cloned().collect());
        self
    }

    /// Handles all events up to and including `end`, in the order of their times; of one time, in the order in which they were
    /// scheduled. Returns how many there were.
    ///
    /// # Errors
    /// Those of the protocol.
    pub fn run_until(&mut self, end: Instant) -> Result<u64, Error> {
        let mut events = 0;
        while let Some(event) = self.kernel.next(end) {
            self.handle(event)?;
            events += 1;
        }
        self.kernel.state.now = self.kernel.state.now.max(end);
        self.kernel.drain_all();
        Ok(events)
    }

    /// Handles the next `count` events, or all that there are; returns how many there were.
    ///
    /// # Errors
    /// Those of the protocol.
    pub fn run_events(&mut self, count: u64) -> Result<u64, Error> {
        for handled in 0..count {
            match self.kernel.next(Instant(u64::MAX)) {
                Some(event) => self.handle(event)?,
                None => return Ok(handled),
            }
        }
        Ok(count)
    }

    fn handle(&mut self, event: Event) -> Result<(), Error> {
        let id = event.node;
        match event.what() {
            What::Mishap(index) => {
                if self.kernel.mishap(index as usize) {
                    let mut context = Context {
                        kernel: &mut self.kernel,
                        node: id,
                    };
                    self.protocol.on_restart(&mut self.nodes[id.index()], &mut context)?;
                }
                Ok(())
            }
            What::Flush(to) => self.kernel.flush(id, to),
            What::Timer(token) => {
                if !self.kernel.is_alive(id) {
                    return Ok(());
                }
                let mut context = Context {
                    kernel: &mut self.kernel,
                    node: id,
                };
                self.protocol.on_timer(&mut self.nodes[id.index()], &mut context, token)
            }
            What::Arrival(place) => {
                let Some((from, bits)) = self.kernel.state.queue.take(place) else {
                    return Ok(());
                };
                self.kernel.drain(id);
                if !self.kernel.listens(id) {
                    self.kernel.state.ledger.faults.lost += 1;
                    return Ok(());
                }
                let check = match Frame::kind_of(&bits) {
                    Some(Kind::Report) => self.kernel.report_check(),
                    _ => Check::Whole,
                };
                let frame = Frame::from_bits(&bits, check);
                let mut context = Context {
                    kernel: &mut self.kernel,
                    node: id,
                };
                let node = &mut self.nodes[id.index()];
                if let Ok(frame) = frame {
                    self.protocol.on_frame(node, &mut context, from, &frame)
                } else {
                    context.note(Note::Damaged);
                    self.protocol.on_damaged(node, &mut context, from)
                }
            }
        }
    }

    /// The protocol.
    pub fn protocol(&self) -> &P {
        &self.protocol
    }

    /// The nodes.
    pub fn nodes(&self) -> &[P::Node] {
        &self.nodes
    }

    /// The time.
    pub fn now(&self) -> Instant {
        self.kernel.state.now
    }

    /// The books.
    pub fn ledger(&self) -> &Ledger {
        &self.kernel.state.ledger
    }

    /// The log.
    pub fn log(&self) -> &Log {
        &self.kernel.state.log
    }

    /// All energy of a node until now.
    ///
    /// # Errors
    /// [`Error::UnknownNode`].
    pub fn energy(&self, node: SensorId) -> Result<Joules, Error> {
        self.kernel.field.check(node)?;
        let account: &Account = &self.ledger().accounts()[node.index()];
        Ok(account.total(&self.kernel.setup.radio, self.now()))
    }

    /// Whether a node is alive.
    pub fn is_alive(&self, node: SensorId) -> bool {
        node.index() < self.nodes.len() && self.kernel.is_alive(node)
    }

    /// Whether an outage keeps a node from sending and receiving.
    pub fn is_out(&self, node: SensorId) -> bool {
        self.is_alive(node) && !self.kernel.listens(node)
    }

    /// Bytes that the network holds: nodes (their own heap memory not counted), queue, frames on air, books, field.
    pub fn memory(&self) -> usize {
        self.nodes.capacity() * size_of::<P::Node>() + self.kernel.memory()
    }

    /// Writes the whole run as CBOR: nodes, queue, frames on air, books, log. Protocol, field and setup are not part of it.
    ///
    /// # Errors
    /// [`Error::Stored`].
    pub fn snapshot(&self, to: impl Write) -> Result<(), Error>
    where
        P::Node: Serialize,
    {
        ciborium::into_writer(&(&self.nodes, &self.kernel.state), to).map_err(|error| Error::Stored(error.to_string()))
    }

    /// A run as it was when the snapshot was taken, under the same protocol, field and setup.
    ///
    /// # Errors
    /// [`Error::Stored`] if it is no snapshot or is one of another number of nodes; as [`Simulator::new`].
    pub fn restore(protocol: P, field: Field, setup: Setup, from: impl Read) -> Result<Self, Error>
    where
        P::Node: DeserializeOwned,
    {
        let (nodes, state) =
            ciborium::from_reader(from).map_err(|error: ciborium::de::Error<_>| Error::Stored(error.to_string()))?;
        let mut restored = Self::new(protocol, nodes, field, setup)?;
        restored.kernel.resume(state)?;
        Ok(restored)
    }
}
