//! The event-driven simulator: the interface of protocols, and the run itself.
//!
//! `core` has the state that nodes cannot read; `transmission` sends frames.

mod attempt;
mod contention;
mod context;
mod core;
mod ledger;
mod log;
mod queue;
mod setup;
mod summary;
pub(crate) mod transmission;

pub use self::core::Ticket;
pub use context::{Context, Protocol, Storable};
pub use ledger::{Account, Faults, Ledger, Totals};
pub use log::{Acknowledgement, Detail, Entry, Log, Reception, Transmission};
pub use setup::{Access, Batching, CarrierSense, Fault, FaultKind, Setup};
pub use summary::{EstimateError, Summary};

use self::core::{SimulatorCore, State};
use crate::error::Error;
use crate::medium::Field;
use crate::medium::air::from_air;
use crate::note::Note;
use crate::units::{Instant, Joules, Seconds, SensorId};
use fewbits_core::BitString;
use fewbits_numerics::error::entries;
use fewbits_protocol::Frame;
use log::{unreadable, unwritable};
use queue::{Arrival, Event, EventKind};
use std::io::{Read, Write};

/// A network at one instant.
///
/// Access to the medium is by an ideal schedule ([`Access::Scheduled`]) or by carrier sense ([`Access::CarrierSense`]). By the schedule a
/// transmission begins when the medium is free around its sender and around all nodes that hear it. Requests are
/// served in the order in which they were made, and a waiting node sleeps. An acknowledgement follows its frame after a turnaround.
#[derive(Debug)]
pub struct Simulator<P: Protocol> {
    protocol: P,
    nodes: Vec<P::Node>,
    core: SimulatorCore,
}

impl<P: Protocol> Simulator<P> {
    /// A network with one node state for each node of the field, at time 0 and without timers.
    ///
    /// # Errors
    /// If a number of the setup is out of range, a fault names a node that does not exist, or there is not one state per
    /// node.
    pub fn new(protocol: P, nodes: Vec<P::Node>, field: Field, setup: Setup) -> Result<Self, Error> {
        entries("nodes", nodes.len(), field.len())?;
        Ok(Self {
            core: SimulatorCore::new(field, setup)?,
            protocol,
            nodes,
        })
    }

    /// Sets a node's first timer, at a time of its own clock.
    ///
    /// # Errors
    /// [`Error::UnknownNode`]; [`Error::Unheard`] if there are other nodes and none is in range.
    pub fn start(&mut self, node: SensorId, at: Instant, token: u32) -> Result<(), Error> {
        self.core.field.check_heard(node)?;
        let at = self.core.when(node, at);
        self.core.schedule(at, node, EventKind::Timer(token));
        Ok(())
    }

    /// Lets arbitrary bits arrive at a node, as if `from` had sent them. It simulates a foreign radio; nothing is charged.
    ///
    /// # Errors
    /// [`Error::UnknownNode`].
    pub fn inject(&mut self, at: Instant, from: SensorId, to: SensorId, bits: BitString) -> Result<(), Error> {
        self.core.field.check(from)?;
        self.core.field.check(to)?;
        let answer = None;
        self.core.deliver(at, to, Arrival { from, answer, bits });
        Ok(())
    }

    /// Handles all events up to and including `end`, in the order of their times. Events of the same time are handled in the order in which
    /// they were scheduled. Returns the number of events.
    ///
    /// # Errors
    /// If a handler of the protocol returns an error.
    pub fn run_until(&mut self, end: Instant) -> Result<u64, Error> {
        let mut events = 0;
        while let Some(event) = self.core.next(end) {
            self.handle(event)?;
            events += 1;
        }
        self.core.state.now = self.core.state.now.max(end);
        self.core.drain_all();
        Ok(events)
    }

    /// Handles the next `count` events, or fewer if there are fewer. Returns the number of events.
    ///
    /// # Errors
    /// If a handler of the protocol returns an error.
    pub fn run_events(&mut self, count: u64) -> Result<u64, Error> {
        for handled in 0..count {
            match self.core.next(Instant(u64::MAX)) {
                Some(event) => self.handle(event)?,
                None => return Ok(handled),
            }
        }
        Ok(count)
    }

    fn handle(&mut self, event: Event) -> Result<(), Error> {
        let id = event.node;
        match event.kind() {
            EventKind::Timer(token) => {
                if !self.core.is_alive(id) {
                    return Ok(());
                }
                let mut context = Context::new(&mut self.core, id);
                self.protocol.on_timer(&mut self.nodes[id.index()], &mut context, token)
            }
            EventKind::Arrival(place) => match self.core.state.queue.take(place) {
                Some(arrival) => self.arrive(id, arrival),
                None => Ok(()),
            },
            EventKind::Fault(index) => {
                if self.core.fault(index as usize) {
                    let mut context = Context::new(&mut self.core, id);
                    self.protocol.on_restart(&mut self.nodes[id.index()], &mut context)?;
                }
                Ok(())
            }
            EventKind::Flush(batch) => {
                self.core.flush(id, batch);
                Ok(())
            }
            EventKind::Transmit(frame) => {
                self.core.transmit(frame);
                Ok(())
            }
            EventKind::Acknowledged(frame) => {
                let tickets = self.core.acknowledged(id, frame);
                self.tell(id, &tickets, P::on_ack)
            }
            EventKind::Resume(frame) => {
                self.core.resume_frame(frame);
                Ok(())
            }
            EventKind::AckTimeout(frame) => {
                let tickets = self.core.ack_timeout(frame);
                self.tell(id, &tickets, P::on_give_up)
            }
        }
    }

    /// Bits have arrived. The receiver's radio acknowledges them by itself, before the node handles them.
    fn arrive(&mut self, id: SensorId, arrival: Arrival) -> Result<(), Error> {
        let Arrival { from, answer, bits } = arrival;
        self.core.drain(id);
        if !self.core.listens(id) {
            self.core.state.ledger.faults.lost += 1;
            return Ok(());
        }
        // The radio acknowledges an intact frame before the protocol looks at it.
        if let Some(frame) = answer {
            self.core.answer(frame, id, from);
        }
        let bytes = from_air(&bits);
        let frame = Frame::decode(&bytes, self.core.check_of(Frame::kind_of(&bytes)));
        let mut context = Context::new(&mut self.core, id);
        let node = &mut self.nodes[id.index()];
        match frame {
            Ok(frame) => self.protocol.on_frame(node, &mut context, from, &frame),
            Err(error) => {
                let (with, note) = (from, error.into());
                context.note(Note::Frame { with, note });
                self.protocol.on_damaged(node, &mut context, from)
            }
        }
    }

    /// Calls `handler` for each of the tickets, if the node is alive.
    fn tell(
        &mut self,
        id: SensorId,
        tickets: &[Ticket],
        handler: fn(&P, &mut P::Node, &mut Context<'_>, Ticket) -> Result<(), Error>,
    ) -> Result<(), Error> {
        for ticket in tickets {
            if self.core.is_alive(id) {
                let mut context = Context::new(&mut self.core, id);
                handler(&self.protocol, &mut self.nodes[id.index()], &mut context, *ticket)?;
            }
        }
        Ok(())
    }

    /// The states of all nodes, by index.
    pub fn nodes(&self) -> &[P::Node] {
        &self.nodes
    }

    /// The simulated time.
    pub fn now(&self) -> Instant {
        self.core.state.now
    }

    /// Bits, energies and numbers of faults so far.
    pub fn ledger(&self) -> &Ledger {
        &self.core.state.ledger
    }

    /// The log.
    pub fn log(&self) -> &Log {
        &self.core.state.log
    }

    /// Total energy of a node until now.
    ///
    /// # Errors
    /// [`Error::UnknownNode`].
    pub fn energy(&self, node: SensorId) -> Result<Joules, Error> {
        self.core.field.check(node)?;
        let account: &Account = &self.ledger().accounts()[node.index()];
        Ok(account.total(self.core.setup.radio_of(node), self.now()))
    }

    /// Whether a node is alive.
    pub fn is_alive(&self, node: SensorId) -> bool {
        node.index() < self.nodes.len() && self.core.is_alive(node)
    }

    /// Whether an outage of its radio keeps a node from sending and receiving.
    pub fn is_out(&self, node: SensorId) -> bool {
        self.is_alive(node) && !self.core.listens(node)
    }

    /// Cost, lifetime and faults until now. [`Summary::with_errors`] adds the estimation error.
    pub fn summary(&self) -> Summary {
        let now = self.now();
        let spent = || {
            let accounts = (0..).map(SensorId).zip(self.ledger().accounts());
            accounts.map(|(node, account)| (node, account, self.core.setup.radio_of(node)))
        };
        let lives = spent().filter_map(|(node, account, radio)| {
            let life = match account.died {
                Some(died) => died.since_start().value(),
                None => radio.battery?.value() / (account.total(radio, now).value() / now.since_start().value()),
            };
            Some((Seconds::new(life).ok()?, node))
        });
        let first = lives.min_by(|a, b| a.0.value().total_cmp(&b.0.value()));
        let energy = spent().map(|(_, account, radio)| account.total(radio, now)).sum();
        Summary::new(now.since_start(), self.ledger(), energy, first)
    }

    /// Bytes of memory of the network: nodes (without their own heap memory), queue, frames on air, ledger, field.
    pub fn memory(&self) -> usize {
        self.nodes.capacity() * size_of::<P::Node>() + self.core.memory()
    }

    /// Writes the state of the run as CBOR: nodes, queue, frames on air, ledger, log. Protocol, field and setup are not included.
    ///
    /// # Errors
    /// [`Error::Unwritable`].
    pub fn snapshot(&self, to: impl Write) -> Result<(), Error>
    where
        P: Storable,
    {
        let nodes = self.nodes.iter().map(|node| self.protocol.store(node));
        let nodes = nodes.collect::<Result<Vec<_>, _>>();
        let nodes = nodes.map_err(|source| Error::Unwritable { source })?;
        ciborium::into_writer(&(nodes, &self.core.state), to).map_err(unwritable)
    }

    /// The run in the state of the snapshot. Protocol, field and setup must be those of the original run.
    ///
    /// # Errors
    /// [`Error::Unreadable`] if the bytes are not a snapshot; [`Error::SnapshotOfOtherNetwork`]; as [`Simulator::new`].
    pub fn restore(protocol: P, field: Field, setup: Setup, from: impl Read) -> Result<Self, Error>
    where
        P: Storable,
    {
        let (nodes, state): (Vec<P::Stored>, State) = ciborium::from_reader(from).map_err(unreadable)?;
        let nodes = nodes.into_iter().enumerate();
        let nodes = nodes.map(|(index, node)| protocol.revive(index, node));
        let nodes = nodes.collect::<Result<_, _>>();
        let nodes = nodes.map_err(|source| Error::Unreadable { source })?;
        let mut restored = Self::new(protocol, nodes, field, setup)?;
        restored.core.resume(state)?;
        Ok(restored)
    }
}
