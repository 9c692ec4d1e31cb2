//! What the runner knows that the nodes do not: time, books, who is alive.

use crate::air::{Outcome, Spare, frames_of, replayed};
use crate::channel::Check;
use crate::error::Error;
use crate::field::Field;
use crate::frame::{Frame, Kind};
use crate::ledger::Ledger;
use crate::log::{Detail, Entry, Log, Note, Stored, Transmission};
use crate::queue::{Event, Queue, What};
use crate::simulator::{Mishap, Setup};
use crate::units::{Bits, Instant, Joules, Seconds, SensorId};
use fewbits_core::BitString;
use fewbits_monte_carlo::Stream;
use fewbits_numerics::ArgumentError;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, VecDeque};

/// Bits of a frame's length in a batch.
const LENGTH_BITS: u64 = 16;

/// What a snapshot holds besides the nodes.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct State {
    pub(crate) now: Instant,
    pub(crate) queue: Queue,
    /// For each node the end of its last outage.
    out_until: Vec<Instant>,
    outbox: BTreeMap<(SensorId, Option<SensorId>), Vec<Stored>>,
    /// Transmissions so far.
    transmissions: usize,
    pub(crate) ledger: Ledger,
    pub(crate) log: Log,
}

#[derive(Debug)]
pub(crate) struct Kernel {
    pub(crate) field: Field,
    pub(crate) setup: Setup,
    pub(crate) air: Stream,
    pub(crate) state: State,
    pub(crate) recorded: Option<VecDeque<Transmission>>,
    spare: Spare,
}

impl Kernel {
    pub(crate) fn new(field: Field, setup: Setup) -> Result<Self, Error> {
        setup.radio.checked()?;
        setup.channel.checked()?;
        let nodes = field.len();
        let mut kernel = Self {
            air: setup.stream.named("air"),
            state: State {
                now: Instant::default(),
                queue: Queue::default(),
                out_until: vec![Instant::default(); nodes],
                outbox: BTreeMap::new(),
                transmissions: 0,
                ledger: Ledger::new(nodes),
                log: Log::default(),
            },
            field,
            setup,
            recorded: None,
            spare: Spare::default(),
        };
        for index in 0..kernel.setup.faults.len() {
            let fault = kernel.setup.faults[index];
            kernel.field.check(fault.node)?;
            let index = u32::try_from(index)
                .map_err(|_| ArgumentError::new("faults", kernel.setup.faults.len(), "fewer than 2^32"))?;
            kernel.schedule(Instant::default().after(fault.at), fault.node, What::Mishap(index));
        }
        Ok(kernel)
    }

    pub(crate) fn resume(&mut self, state: State) -> Result<(), Error> {
        let nodes = self.field.len();
        let known = |id: SensorId| id.index() < nodes;
        let consistent = state.ledger.accounts.len() == nodes
            && state.out_until.len() == nodes
            && state.queue.is_consistent(known)
            && state
                .outbox
                .keys()
                .all(|(from, to)| known(*from) && to.is_none_or(known));
        if !consistent {
            return Err(Error::Stored(format!("a snapshot of another network: expected {nodes} nodes")));
        }
        self.state = state;
        Ok(())
    }

    #[inline]
    pub(crate) fn schedule(&mut self, time: Instant, node: SensorId, what: What) {
        self.state.queue.push(time.max(self.state.now), node, what);
    }

    /// The next event up to `end`; time moves on to it.
    #[inline]
    pub(crate) fn next(&mut self, end: Instant) -> Option<Event> {
        let event = self.state.queue.pop(end)?;
        self.state.now = event.time;
        Some(event)
    }

    #[inline]
    pub(crate) fn is_alive(&self, node: SensorId) -> bool {
        self.state.ledger.accounts[node.index()].died.is_none()
    }

    pub(crate) fn listens(&self, node: SensorId) -> bool {
        self.is_alive(node) && self.state.out_until[node.index()] <= self.state.now
    }

    pub(crate) fn report_check(&self) -> Check {
        self.setup.report_check
    }

    pub(crate) fn check_of(&self, kind: Kind) -> Check {
        match kind {
            Kind::Report => self.setup.report_check,
            _ => Check::Whole,
        }
    }

    pub(crate) fn note(&mut self, node: SensorId, note: Note) {
        let faults = &mut self.state.ledger.faults;
        match note {
            Note::Damaged | Note::Malformed => faults.damaged += 1,
            Note::Duplicate => faults.duplicates += 1,
            Note::Late => faults.late += 1,
            Note::Disagreement { .. } => faults.disagreements += 1,
            Note::Resynchronised { .. } => faults.resynchronisations += 1,
            _ => {}
        }
        if self.setup.detail >= Detail::Notes {
            let at = self.state.now;
            self.state.log.entries.push(Entry::Noted { at, node, note });
        }
    }

    /// What befalls a node; true if it begins anew.
    pub(crate) fn mishap(&mut self, index: usize) -> bool {
        let Some(fault) = self.setup.faults.get(index).copied() else {
            return false;
        };
        if !self.is_alive(fault.node) {
            return false;
        }
        match fault.what {
            Mishap::Death => self.kill(fault.node, self.state.now),
            Mishap::Outage(duration) => {
                let until = self.state.now.after(duration);
                let out = &mut self.state.out_until[fault.node.index()];
                *out = until.max(*out);
            }
            Mishap::Restart => {
                self.note(fault.node, Note::Restarted);
                return true;
            }
        }
        false
    }

    fn kill(&mut self, node: SensorId, at: Instant) {
        self.state.ledger.accounts[node.index()].died = Some(at);
        self.note(node, Note::Died);
    }

    pub(crate) fn deliver(&mut self, at: Instant, from: SensorId, to: SensorId, bits: BitString) {
        self.state.queue.deliver(at.max(self.state.now), from, to, bits);
    }

    /// Sends now, or puts into the outbox.
    pub(crate) fn submit(&mut self, from: SensorId, to: Option<SensorId>, frame: Frame) -> Result<bool, Error> {
        let batching = self.setup.batching;
        if batching.most <= 1 {
            return self.transmit(from, to, &frame);
        }
        let bits = Stored(frame.to_bits(self.check_of(frame.kind))?);
        let waiting = self.state.outbox.entry((from, to)).or_default();
        waiting.push(bits);
        match waiting.len() {
            n if n >= batching.most => self.flush(from, to)?,
            1 => {
                let at = self.state.now.after(batching.hold);
                self.schedule(at, from, What::Flush(to));
            }
            _ => {}
        }
        Ok(false)
    }

    /// Sends what waits.
    pub(crate) fn flush(&mut self, from: SensorId, to: Option<SensorId>) -> Result<(), Error> {
        match self.state.outbox.remove(&(from, to)) {
            Some(frames) if !frames.is_empty() => self.put_on_air(from, to, &frames).map(|_| ()),
            _ => Ok(()),
        }
    }

    pub(crate) fn transmit(&mut self, from: SensorId, to: Option<SensorId>, frame: &Frame) -> Result<bool, Error> {
        let bits = Stored(frame.to_bits(self.check_of(frame.kind))?);
        self.put_on_air(from, to, std::slice::from_ref(&bits))
    }

    fn put_on_air(&mut self, from: SensorId, to: Option<SensorId>, frames: &[Stored]) -> Result<bool, Error> {
        self.drain(from);
        if !self.listens(from) {
            self.state.ledger.faults.lost += 1;
            return Ok(false);
        }
        let own: u64 = frames.iter().map(|frame| frame.0.bits() as u64).sum();
        let lengths = if frames.len() > 1 {
            LENGTH_BITS * frames.len() as u64
        } else {
            0
        };
        let payload: u64 = frames.iter().map(payload_bits).sum();
        let whole = self.setup.radio.preamble + self.setup.radio.header + Bits(own + lengths);
        let mut spare = std::mem::take(&mut self.spare);
        let mut outcome = match &mut self.recorded {
            None => self.draw(from, to, frames, own as usize, &mut spare),
            Some(recorded) => replayed(recorded.pop_front(), from, to, frames, self.state.transmissions)?,
        };
        self.state.transmissions += 1;
        let (sending, receiving, air) = self.charge(from, to.is_none(), whole, payload, &outcome);
        self.launch(from, whole, frames, &outcome);
        if self.setup.detail >= Detail::Everything {
            self.state.log.entries.push(Entry::Sent(Transmission {
                at: self.state.now,
                from,
                to,
                frames: frames.to_vec(),
                payload,
                air: air.0,
                attempts: outcome.attempts,
                answers: outcome.answers,
                acknowledged: outcome.acknowledged,
                receptions: std::mem::take(&mut outcome.receptions),
                sending,
                receiving,
            }));
        }
        for reception in outcome.receptions.drain(..) {
            let mut copies = reception.copies;
            copies.clear();
            spare.copies.push(copies);
        }
        spare.receptions = outcome.receptions;
        self.spare = spare;
        Ok(outcome.acknowledged)
    }

    /// Enters a transmission into the books; energies of senders and receivers, bits on air.
    fn charge(
        &mut self,
        from: SensorId,
        to_all: bool,
        whole: Bits,
        payload: u64,
        outcome: &Outcome,
    ) -> (Joules, Joules, Bits) {
        let radio = &self.setup.radio;
        let times = f64::from(outcome.attempts);
        let scaled = |joules: Joules, n: f64| Joules::trusted(joules.value() * n);
        let answers = f64::from(outcome.answers);
        let farthest = outcome
            .receptions
            .iter()
            .map(|reception| self.field.distance(from.0, reception.to.0));
        // Without power control a broadcast reaches the whole range, and so does a frame to somebody who is not there.
        let reach = match (to_all, outcome.receptions.is_empty()) {
            (false, false) => farthest.fold(0.0, f64::max),
            _ => self.field.range(),
        };
        let acknowledged = self.setup.retries.is_some() && !to_all;
        let mut sending = scaled(radio.transmit(whole, reach), times) + radio.wake_up();
        let mut own_receiving = Joules::ZERO;
        let frame_time = radio.duration(whole);
        let answer_time = radio.turnaround + radio.duration(radio.acknowledgement);
        let mut awake = radio.wake.value() + radio.doze.value() + frame_time.value() * times;
        if acknowledged {
            own_receiving = scaled(radio.turn() + radio.receive(radio.acknowledgement), times);
            awake += answer_time.value() * times;
        }
        let mut air = whole * u64::from(outcome.attempts);
        let sender = &mut self.state.ledger.accounts[from.index()];
        sender.payload += Bits(payload);
        sender.air += air;
        sender.frames = sender.frames.wrapping_add(outcome.attempts);
        sender.sending += sending;
        sender.receiving += own_receiving;
        sender.awake += Seconds::trusted(awake);
        let mut receiving = own_receiving;
        for reception in &outcome.receptions {
            let spent = radio.wake_up() + scaled(radio.listen() + radio.receive(whole), times);
            let answering = scaled(radio.turn() + radio.transmit(radio.acknowledgement, reach), answers);
            let answered = radio.acknowledgement * u64::from(outcome.answers);
            let awake = radio.wake.value()
                + radio.doze.value()
                + (frame_time + radio.guard).value() * times
                + answer_time.value() * answers;
            let account = &mut self.state.ledger.accounts[reception.to.index()];
            account.receiving += spent;
            account.sending += answering;
            account.air += answered;
            account.awake += Seconds::trusted(awake);
            receiving += spent;
            sending += answering;
            air += answered;
        }
        let messages = &mut self.state.ledger.messages;
        messages.messages += 1;
        messages.payload += Bits(payload);
        messages.air += air;
        messages.sending += sending;
        messages.receiving += receiving;
        self.drain(from);
        for reception in &outcome.receptions {
            self.drain(reception.to);
        }
        (sending, receiving, air)
    }

    /// A node whose batteries are empty dies: when they were, if it has only idled since.
    #[inline]
    pub(crate) fn drain(&mut self, node: SensorId) {
        let radio = &self.setup.radio;
        let account = &self.state.ledger.accounts[node.index()];
        let spent = account.total(radio, self.state.now);
        if account.died.is_none() && spent >= radio.battery {
            self.exhaust(node, spent);
        }
    }

    #[cold]
    fn exhaust(&mut self, node: SensorId, spent: Joules) {
        let radio = &self.setup.radio;
        let idle = (radio.baseline + radio.sleep).value();
        let since = if idle > 0.0 {
            (spent - radio.battery).value() / idle
        } else {
            0.0
        };
        let now = self.state.now.since_start().value();
        self.kill(node, Instant::default().after(Seconds::trusted((now - since).max(0.0))));
    }

    /// All nodes whose batteries are empty die.
    pub(crate) fn drain_all(&mut self) {
        (0..self.field.len() as u32).for_each(|node| self.drain(SensorId(node)));
    }

    /// Schedules the arrivals.
    fn launch(&mut self, from: SensorId, whole: Bits, frames: &[Stored], outcome: &Outcome) {
        let on_air = self.state.now.after(self.setup.radio.duration(whole));
        for reception in &outcome.receptions {
            if reception.copies.is_empty() {
                self.state.ledger.faults.lost += 1;
            }
            for copy in &reception.copies {
                let at = on_air.after(copy.delay);
                for bits in frames_of(frames, copy) {
                    self.deliver(at, from, reception.to, bits);
                }
            }
        }
    }

    pub(crate) fn memory(&self) -> usize {
        let (state, nodes) = (&self.state, self.field.len());
        let graph = (nodes + 1) * size_of::<usize>() + 2 * self.field.graph().edges() * size_of::<u32>();
        nodes * size_of::<[f64; 2]>()
            + graph
            + state.queue.memory()
            + state.out_until.capacity() * size_of::<Instant>()
            + state.ledger.accounts.capacity() * size_of::<crate::ledger::Account>()
            + state.log.entries.capacity() * size_of::<Entry>()
    }
}

fn payload_bits(frame: &Stored) -> u64 {
    let overhead = Frame::kind_of(&frame.0).map_or(0, Frame::overhead);
    (frame.0.bits() as u64).saturating_sub(u64::from(overhead))
}
