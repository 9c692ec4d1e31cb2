//! Queue, air and books: what the runner knows that the nodes do not.

use crate::channel::{Check, Copy};
use crate::error::Error;
use crate::field::Field;
use crate::frame::{Frame, Kind, stored};
use crate::ledger::Ledger;
use crate::log::{Detail, Entry, Log, Note, Reception, Stored, Transmission};
use crate::simulator::{Mishap, Setup};
use crate::units::{Bits, Instant, Joules, Seconds, SensorId};
use fewbits_core::BitString;
use fewbits_monte_carlo::Stream;
use fewbits_numerics::ArgumentError;
use serde::{Deserialize, Serialize};
use std::cmp::{Ordering, Reverse};
use std::collections::{BTreeMap, BinaryHeap, VecDeque};

/// Bits of a frame's length in a batch.
const LENGTH_BITS: u64 = 16;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum What {
    Timer(u32),
    Arrival(u32),
    Flush(Option<SensorId>),
    Mishap(u32),
}

/// Events are ordered by time, then by when they were scheduled. Small, since the queue moves them: `rank` is the place in the
/// order of scheduling, then three bits of what it is.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Event {
    time: Instant,
    rank: u64,
    pub(crate) node: SensorId,
    argument: u32,
}

impl Event {
    fn new(time: Instant, sequence: u64, node: SensorId, what: What) -> Self {
        let (kind, argument) = match what {
            What::Timer(token) => (0, token),
            What::Arrival(place) => (1, place),
            What::Mishap(index) => (2, index),
            What::Flush(None) => (3, 0),
            What::Flush(Some(to)) => (4, to.0),
        };
        Self {
            time,
            rank: sequence << 3 | kind,
            node,
            argument,
        }
    }

    pub(crate) fn what(&self) -> What {
        match self.rank & 7 {
            0 => What::Timer(self.argument),
            1 => What::Arrival(self.argument),
            2 => What::Mishap(self.argument),
            3 => What::Flush(None),
            _ => What::Flush(Some(SensorId(self.argument))),
        }
    }
}

impl Ord for Event {
    #[inline]
    fn cmp(&self, other: &Self) -> Ordering {
        (self.time, self.rank).cmp(&(other.time, other.rank))
    }
}

impl PartialOrd for Event {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Event {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Event {}

/// Bits on their way to a node.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Arrival {
    from: SensorId,
    #[serde(with = "stored")]
    bits: BitString,
}

/// What a snapshot holds besides the nodes.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct State {
    pub(crate) now: Instant,
    sequence: u64,
    /// An event before all of the queue: most frames arrive before anything else happens.
    front: Option<Event>,
    queue: BinaryHeap<Reverse<Event>>,
    arrivals: Vec<Option<Arrival>>,
    free: Vec<u32>,
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
    air: Stream,
    pub(crate) state: State,
    pub(crate) recorded: Option<VecDeque<Transmission>>,
    spare: Spare,
}

/// Memory of transmissions that are over.
#[derive(Debug, Default)]
struct Spare {
    receptions: Vec<Reception>,
    copies: Vec<Vec<Copy>>,
}

/// What happened to a transmission.
struct Outcome {
    attempts: u32,
    acknowledged: bool,
    answers: u32,
    receptions: Vec<Reception>,
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
                sequence: 0,
                front: None,
                queue: BinaryHeap::new(),
                arrivals: Vec::new(),
                free: Vec::new(),
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
            && state
                .front
                .is_none_or(|front| known(front.node) && state.queue.iter().all(|event| front < event.0))
            && state.queue.iter().all(|event| known(event.0.node))
            && state.free.iter().all(|place| (*place as usize) < state.arrivals.len())
            && state.arrivals.iter().flatten().all(|arrival| known(arrival.from))
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
        let sequence = self.state.sequence;
        self.state.sequence += 1;
        let mut event = Event::new(time.max(self.state.now), sequence, node, what);
        let first = self
            .state
            .front
            .or_else(|| self.state.queue.peek().map(|event| event.0));
        if first.is_none_or(|first| event < first) {
            match self.state.front.replace(event) {
                Some(front) => event = front,
                None => return,
            }
        }
        self.state.queue.push(Reverse(event));
    }

    /// The next event up to `end`; time moves on to it.
    #[inline]
    pub(crate) fn next(&mut self, end: Instant) -> Option<Event> {
        let front = self.state.front.take_if(|front| front.time <= end);
        let event = match self.state.queue.peek() {
            _ if front.is_some() => front,
            Some(Reverse(first)) if self.state.front.is_none() && first.time <= end => {
                self.state.queue.pop().map(|event| event.0)
            }
            _ => None,
        }?;
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

    fn check_of(&self, kind: Kind) -> Check {
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
        let arrival = Some(Arrival { from, bits });
        let place = if let Some(place) = self.state.free.pop() {
            self.state.arrivals[place as usize] = arrival;
            place
        } else {
            self.state.arrivals.push(arrival);
            (self.state.arrivals.len() - 1) as u32
        };
        self.schedule(at, to, What::Arrival(place));
    }

    pub(crate) fn take(&mut self, place: u32) -> Option<(SensorId, BitString)> {
        let arrival = self.state.arrivals.get_mut(place as usize)?.take()?;
        self.state.free.push(place);
        Some((arrival.from, arrival.bits))
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

    /// What happens on air.
    fn draw(&self, from: SensorId, to: Option<SensorId>, frames: &[Stored], bits: usize, spare: &mut Spare) -> Outcome {
        let sent = u64::from(self.state.ledger.accounts[from.index()].frames);
        let stream = || self.air.indexed(u64::from(from.0)).indexed(sent);
        let copies = |receiver: u32, attempt: u32, copies: &mut Vec<Copy>| {
            let rng = || {
                stream()
                    .indexed(u64::from(receiver))
                    .indexed(u64::from(attempt))
                    .fast_rng()
            };
            self.setup
                .channel
                .copies(rng, self.field.distance(from.0, receiver), bits, copies);
        };
        let mut outcome = Outcome {
            attempts: 0,
            acknowledged: false,
            answers: 0,
            receptions: std::mem::take(&mut spare.receptions),
        };
        let Some(to) = to else {
            outcome.attempts = 1;
            let neighbours = self.field.graph().neighbours(from.index());
            for to in neighbours
                .iter()
                .map(|receiver| SensorId(*receiver))
                .filter(|to| self.listens(*to))
            {
                let mut arrived = spare.copies.pop().unwrap_or_default();
                copies(to.0, 0, &mut arrived);
                outcome.receptions.push(Reception { to, copies: arrived });
            }
            return outcome;
        };
        let (mut arrived, listens) = (spare.copies.pop().unwrap_or_default(), self.listens(to));
        let most = self.setup.retries.map_or(1, |retries| retries.saturating_add(1));
        while outcome.attempts < most && !outcome.acknowledged {
            let before = arrived.len();
            if listens {
                copies(to.0, 2 * outcome.attempts, &mut arrived);
            }
            outcome.attempts += 1;
            let intact = arrived[before..].iter().any(|copy| self.is_intact(frames, copy));
            if self.setup.retries.is_some() && intact {
                outcome.answers += 1;
                // The answer crosses the same air.
                let mut answer = Vec::new();
                copies(to.0, 2 * outcome.attempts - 1, &mut answer);
                outcome.acknowledged = answer.iter().any(|copy| copy.flipped.is_empty());
            }
        }
        if listens {
            outcome.receptions.push(Reception { to, copies: arrived });
        }
        outcome
    }

    fn is_intact(&self, frames: &[Stored], copy: &Copy) -> bool {
        copy.flipped.is_empty()
            || frames_of(frames, copy).all(|bits| {
                let check = Frame::kind_of(&bits).map_or(Check::Whole, |kind| self.check_of(kind));
                Frame::from_bits(&bits, check).is_ok()
            })
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
            + state.queue.capacity() * size_of::<Reverse<Event>>()
            + state.arrivals.capacity() * size_of::<Option<Arrival>>()
            + state
                .arrivals
                .iter()
                .flatten()
                .map(|a| a.bits.bytes().len())
                .sum::<usize>()
            + state.free.capacity() * size_of::<u32>()
            + state.out_until.capacity() * size_of::<Instant>()
            + state.ledger.accounts.capacity() * size_of::<crate::ledger::Account>()
            + state.log.entries.capacity() * size_of::<Entry>()
    }
}

fn payload_bits(frame: &Stored) -> u64 {
    let overhead = Frame::kind_of(&frame.0).map_or(0, Frame::overhead);
    (frame.0.bits() as u64).saturating_sub(u64::from(overhead))
}

/// The frames of a batch as they arrive.
fn frames_of<'a>(frames: &'a [Stored], copy: &'a Copy) -> impl Iterator<Item = BitString> + 'a {
    let mut start = 0;
    frames.iter().map(move |Stored(frame)| {
        let from = start;
        start += frame.bits();
        copy.flipped
            .iter()
            .filter_map(|bit| (*bit as usize).checked_sub(from))
            .filter(|bit| *bit < frame.bits())
            .fold(frame.clone(), BitString::with_flipped)
    })
}

fn replayed(
    recorded: Option<Transmission>,
    from: SensorId,
    to: Option<SensorId>,
    frames: &[Stored],
    transmission: usize,
) -> Result<Outcome, Error> {
    let left = |difference| Error::LeftLog {
        transmission,
        difference,
    };
    let recorded = recorded.ok_or_else(|| left("the log has ended"))?;
    if (recorded.from, recorded.to) != (from, to) {
        return Err(left("sender or receiver"));
    }
    if recorded.frames != frames {
        return Err(left("the bits"));
    }
    Ok(Outcome {
        attempts: recorded.attempts,
        acknowledged: recorded.acknowledged,
        answers: recorded.answers,
        receptions: recorded.receptions,
    })
}
