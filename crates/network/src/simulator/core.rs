//! State of a running simulation that nodes cannot read directly: time, event queue, ledger of bits and joules, log, and which nodes work.
//!
//! [`Simulator`](super::Simulator) takes events from here; [`Context`](super::Context) is the part that a protocol may use. Sending is in
//! `transmission`.

use super::ledger::{Account, Ledger};
use super::log::{Detail, Entry, Log, Reception};
use super::queue::{Arrival, Event, EventKind, Queue};
use super::setup::{FaultKind, Setup};
use crate::error::Error;
use crate::medium::loss::BurstState;
use crate::medium::{Field, ReceivedCopy};
use crate::note::Note;
use crate::units::{Instant, Joules, Seconds, SensorId};
use fewbits_core::BitString;
use fewbits_monte_carlo::Stream;
use fewbits_numerics::ArgumentError;
use fewbits_protocol::{Check, Kind, Note as FrameNote};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Identifies a frame that a node sent, for [`Protocol::on_ack`](super::Protocol::on_ack) and
/// [`Protocol::on_give_up`](super::Protocol::on_give_up). It is unique in a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Ticket(pub(super) u64);

/// Frames to one receiver that wait until they are sent together.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Batch {
    /// Number of the batch, which its timer names. A full batch is sent before its timer fires; the next batch has another number.
    pub(super) number: u32,
    pub(super) frames: Vec<BitString>,
    pub(super) tickets: Vec<Ticket>,
}

/// Frames that wait for the medium or for an acknowledgement.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Outgoing {
    pub(super) from: SensorId,
    pub(super) to: Option<SensorId>,
    pub(super) frames: Vec<BitString>,
    pub(super) tickets: Vec<Ticket>,
    /// Number of attempts so far.
    pub(super) attempts: u32,
    /// How often its sender has heard others in the present attempt.
    #[serde(default)]
    pub(super) heard: u32,
    /// Whether the sender is still awake from the attempt before.
    pub(super) sender_awake: bool,
    /// Whether the receiver is still awake from the attempt before.
    pub(super) receiver_awake: bool,
}

/// A transmission while it is on air.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OnAir {
    pub(super) from: SensorId,
    pub(super) start: Instant,
    pub(super) end: Instant,
    /// Arrivals to come: the receiver, and the position in the queue's list of arrivals.
    pub(super) arrivals: Vec<(SensorId, u32)>,
}

/// State of the simulator that a snapshot holds besides the nodes.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct State {
    pub(super) now: Instant,
    pub(super) queue: Queue,
    /// For each node whether it is alive. The ledger has the same information; this list is compact, because every event reads it.
    pub(super) alive: Vec<bool>,
    /// For each node the end of its last outage.
    pub(super) out_until: Vec<Instant>,
    /// For each node the time until which the medium around it is in use.
    pub(super) busy_until: Vec<Instant>,
    /// Until when nodes must be silent by their duty cycle.
    #[serde(default)]
    pub(super) quiet_until: BTreeMap<SensorId, Instant>,
    pub(super) batches: BTreeMap<(SensorId, Option<SensorId>), Batch>,
    pub(super) outgoing: BTreeMap<u32, Outgoing>,
    /// Next number of a batch or outgoing frame; they share one sequence.
    pub(super) next_number: u32,
    pub(super) next_ticket: u64,
    /// Transmissions that others may hear; only under carrier sense.
    #[serde(default)]
    pub(super) on_air: Vec<OnAir>,
    pub(super) bursts: BTreeMap<(SensorId, SensorId), BurstState>,
    pub(super) ledger: Ledger,
    pub(super) log: Log,
}

/// Buffers of finished transmissions, for reuse.
#[derive(Debug, Default)]
pub(super) struct BufferPool {
    pub(super) receptions: Vec<Reception>,
    pub(super) copies: Vec<Vec<ReceivedCopy>>,
}

#[derive(Debug)]
pub(super) struct SimulatorCore {
    pub(super) field: Field,
    pub(super) setup: Setup,
    pub(super) air: Stream,
    pub(super) state: State,
    pub(super) pool: BufferPool,
}

impl SimulatorCore {
    pub(super) fn new(field: Field, setup: Setup) -> Result<Self, Error> {
        setup.check(&field)?;
        let nodes = field.len();
        let mut core = Self {
            air: setup.stream.named("air"),
            state: State {
                now: Instant::default(),
                queue: Queue::default(),
                alive: vec![true; nodes],
                out_until: vec![Instant::default(); nodes],
                busy_until: vec![Instant::default(); nodes],
                quiet_until: BTreeMap::new(),
                batches: BTreeMap::new(),
                outgoing: BTreeMap::new(),
                next_number: 0,
                next_ticket: 0,
                on_air: Vec::new(),
                bursts: BTreeMap::new(),
                ledger: Ledger::new(nodes),
                log: Log::default(),
            },
            field,
            setup,
            pool: BufferPool::default(),
        };
        for index in 0..core.setup.faults.len() {
            let fault = core.setup.faults[index];
            let index = u32::try_from(index)
                .map_err(|_| ArgumentError::new("faults", core.setup.faults.len(), "fewer than 2^32"))?;
            core.schedule(Instant::default().after(fault.at), fault.node, EventKind::Fault(index));
        }
        Ok(core)
    }

    /// Continues with a stored state.
    pub(super) fn resume(&mut self, state: State) -> Result<(), Error> {
        let nodes = self.field.len();
        let known = |id: SensorId| id.index() < nodes;
        let reached = |from: SensorId, to: Option<SensorId>| match to {
            Some(to) => self.field.check_link(from, to).is_ok(),
            None => known(from),
        };
        // A stored state may be wrong: an index beyond the nodes would panic only much later.
        let consistent = state.ledger.accounts.len() == nodes
            && state.alive.len() == nodes
            && (0..nodes).all(|node| state.alive[node] == state.ledger.accounts[node].died.is_none())
            && state.out_until.len() == nodes
            && state.busy_until.len() == nodes
            && state.quiet_until.keys().all(|node| known(*node))
            && state.queue.is_consistent(known)
            && state.batches.keys().all(|(from, to)| reached(*from, *to))
            && state.outgoing.values().all(|frame| reached(frame.from, frame.to))
            && state
                .on_air
                .iter()
                .all(|one| known(one.from) && one.arrivals.iter().all(|(to, _)| known(*to)))
            && state.bursts.keys().all(|(from, to)| known(*from) && known(*to));
        if !consistent {
            return Err(Error::SnapshotOfOtherNetwork {
                found: state.ledger.accounts.len(),
                expected: nodes,
            });
        }
        self.state = state;
        Ok(())
    }

    /// The time by a node's own clock.
    #[inline]
    pub(super) fn local(&self, node: SensorId, time: Instant) -> Instant {
        match self.setup.drift.get(&node) {
            None => time,
            // The rate is at least -1/2, so a clock never runs backwards.
            Some(rate) => Instant(time.0.saturating_add_signed((time.0 as f64 * rate).round() as i64)),
        }
    }

    /// The first instant at which a node's own clock shows this time.
    pub(super) fn when(&self, node: SensorId, local: Instant) -> Instant {
        let Some(rate) = self.setup.drift.get(&node) else {
            return local;
        };
        // Division and rounding may be off by a nanosecond: correct by `local`.
        let mut time = Instant((local.0 as f64 / (1.0 + rate)) as u64);
        while time.0 > 0 && self.local(node, Instant(time.0 - 1)) >= local {
            time.0 -= 1;
        }
        while self.local(node, time) < local {
            time.0 += 1;
        }
        time
    }

    #[inline]
    pub(super) fn schedule(&mut self, time: Instant, node: SensorId, kind: EventKind) {
        self.state.queue.push(time.max(self.state.now), node, kind);
    }

    /// Takes the next event up to `end` and advances the time to it.
    #[inline]
    pub(super) fn next(&mut self, end: Instant) -> Option<Event> {
        let event = self.state.queue.pop(end)?;
        self.state.now = event.time;
        Some(event)
    }

    #[inline]
    pub(super) fn is_alive(&self, node: SensorId) -> bool {
        self.state.alive[node.index()]
    }

    /// Whether a node's radio sends and receives.
    pub(super) fn listens(&self, node: SensorId) -> bool {
        self.is_alive(node) && self.state.out_until[node.index()] <= self.state.now
    }

    pub(super) fn check_of(&self, kind: Option<Kind>) -> Check {
        match kind {
            Some(Kind::Report) => self.setup.report_check,
            _ => Check::Whole,
        }
    }

    pub(super) fn note(&mut self, node: SensorId, note: Note) {
        let faults = &mut self.state.ledger.faults;
        match &note {
            Note::Frame { note, .. } => match note {
                FrameNote::Duplicate { .. } => faults.duplicates += 1,
                FrameNote::Late { .. } => faults.late += 1,
                FrameNote::Disagreement { .. } => faults.disagreements += 1,
                FrameNote::Resynchronised { .. } => faults.resynchronisations += 1,
                FrameNote::Retained { .. } => {}
                _ => faults.damaged += 1,
            },
            Note::SilenceIgnored { .. } => faults.silence_ignored += 1,
            Note::Failed { .. } => faults.failures += 1,
            _ => {}
        }
        if self.setup.detail >= Detail::Notes {
            let at = self.state.now;
            self.state.log.entries.push(Entry::Noted { at, node, note });
        }
    }

    /// Applies a fault. Returns whether the node restarts.
    pub(super) fn fault(&mut self, index: usize) -> bool {
        let Some(fault) = self.setup.faults.get(index).copied() else {
            return false;
        };
        if !self.is_alive(fault.node) {
            return false;
        }
        match fault.kind {
            FaultKind::Death => self.kill(fault.node, self.state.now),
            FaultKind::Outage(duration) => {
                // Overlapping outages last until the later end.
                let until = self.state.now.after(duration);
                let out = &mut self.state.out_until[fault.node.index()];
                *out = until.max(*out);
            }
            FaultKind::Restart => {
                self.forget(fault.node);
                self.note(fault.node, Note::Restarted);
                return true;
            }
        }
        false
    }

    /// Drops all frames of a node that are not sent or not acknowledged yet.
    fn forget(&mut self, node: SensorId) {
        self.state.batches.retain(|(from, _), _| *from != node);
        self.state.outgoing.retain(|_, frame| frame.from != node);
    }

    fn kill(&mut self, node: SensorId, at: Instant) {
        self.state.alive[node.index()] = false;
        self.state.ledger.accounts[node.index()].died = Some(at);
        self.forget(node);
        self.note(node, Note::Died);
    }

    pub(super) fn deliver(&mut self, at: Instant, to: SensorId, arrival: Arrival) -> u32 {
        self.state.queue.deliver(at.max(self.state.now), to, arrival)
    }

    /// Lets a node die whose battery is empty. If it was idle since, the time of death is when the battery became empty.
    #[inline]
    pub(super) fn drain(&mut self, node: SensorId) {
        let radio = self.setup.radio_of(node);
        let Some(battery) = radio.battery else { return };
        let account = &self.state.ledger.accounts[node.index()];
        let spent = account.total(radio, self.state.now);
        if account.died.is_none() && spent >= battery {
            self.exhaust(node, spent - battery);
        }
    }

    #[cold]
    fn exhaust(&mut self, node: SensorId, overspent: Joules) {
        let radio = self.setup.radio_of(node);
        let idle = (radio.baseline + radio.sleep).value();
        // The overspent energy divided by the idle power is the time since the battery became empty.
        let since = if idle > 0.0 { overspent.value() / idle } else { 0.0 };
        let now = self.state.now.since_start().value();
        self.kill(node, Instant::default().after(Seconds::trusted((now - since).max(0.0))));
    }

    /// Applies [`drain`](Self::drain) to all nodes.
    pub(super) fn drain_all(&mut self) {
        (0..self.field.len() as u32).for_each(|node| self.drain(SensorId(node)));
    }

    pub(super) fn memory(&self) -> usize {
        let (state, nodes) = (&self.state, self.field.len());
        let graph = (nodes + 1) * size_of::<usize>() + 2 * self.field.graph().edges() * size_of::<u32>();
        nodes * size_of::<[f64; 2]>()
            + graph
            + state.queue.memory()
            + state.alive.capacity()
            + (state.out_until.capacity() + state.busy_until.capacity()) * size_of::<Instant>()
            + state.outgoing.len() * size_of::<Outgoing>()
            + state.ledger.accounts.capacity() * size_of::<Account>()
            + state.log.entries.capacity() * size_of::<Entry>()
    }
}
