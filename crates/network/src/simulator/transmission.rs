//! Sending of frames: batches, waiting for the medium, attempts, acknowledgements, and their costs.
//!
//! ```text
//! submit:        frame -> batch -> (full, or its hold time is over) -> dispatch
//! dispatch:      book the air; Transmit when it is free
//! Transmit:      one attempt: draw what arrives, charge, schedule arrivals; with acknowledgements also AckTimeout
//! arrival:       the receiver's radio answers an intact frame after a turnaround; Acknowledged when the answer is back
//! AckTimeout:    dispatch again, or give up after the last repetition
//! Resume:        dispatch what came while the sender had to be silent by its duty cycle
//! ```
//! By the ideal schedule a transmission begins when the medium is free around the sender and around all nodes that hear it. Requests are
//! served in the order in which they were made. A waiting node sleeps.

use super::attempt::{Attempt, LENGTH_BITS};
use super::core::{Batch, Outgoing, SimulatorCore, Ticket};
use super::log::{Acknowledgement, Detail, Entry};
use super::queue::EventKind;
use crate::medium::{Radio, on_air};
use crate::units::{Bits, Instant, Seconds, SensorId};
use fewbits_core::BitString;
use fewbits_protocol::Frame;

impl SimulatorCore {
    /// Sends a frame, possibly later in a batch.
    pub(super) fn submit(&mut self, from: SensorId, to: Option<SensorId>, frame: &Frame<'_>) -> Ticket {
        let batching = self.setup.batching;
        if batching.max_frames <= 1 {
            return self.send(from, to, frame);
        }
        let bits = on_air(frame, self.check_of(Some(frame.kind)));
        let radio = self.setup.radio_of(from);
        if let Some(waiting) = self.state.batches.get(&(from, to)) {
            let together: u64 = waiting
                .frames
                .iter()
                .chain([&bits])
                .map(|f| f.bits() as u64 + LENGTH_BITS)
                .sum();
            // A batch that needs a second link frame saves nothing: send the waiting frames first.
            if radio.link_frames(Bits(together)) > 1 {
                self.send_batch(from, to);
            }
        }
        let ticket = self.next_ticket();
        if !self.state.batches.contains_key(&(from, to)) {
            let number = self.next_number();
            let batch = Batch {
                number,
                ..Batch::default()
            };
            self.state.batches.insert((from, to), batch);
            // The first frame of a batch starts its timer.
            let at = self.state.now.after(batching.hold);
            self.schedule(at, from, EventKind::Flush(number));
        }
        let batch = self.state.batches.entry((from, to)).or_default();
        batch.frames.push(bits);
        batch.tickets.push(ticket);
        if batch.frames.len() >= batching.max_frames {
            self.send_batch(from, to);
        }
        ticket
    }

    /// Sends a frame as soon as the medium is free, not in a batch.
    pub(super) fn send(&mut self, from: SensorId, to: Option<SensorId>, frame: &Frame<'_>) -> Ticket {
        let bits = on_air(frame, self.check_of(Some(frame.kind)));
        let ticket = self.next_ticket();
        self.dispatch(from, to, std::slice::from_ref(&bits), &[ticket]);
        ticket
    }

    /// The hold time of a batch is over. If the batch was sent before, the waiting one has another number.
    pub(super) fn flush(&mut self, from: SensorId, number: u32) {
        let mut own = self
            .state
            .batches
            .range((from, None)..)
            .take_while(|((node, _), _)| *node == from);
        if let Some(to) = own.find(|(_, batch)| batch.number == number).map(|((_, to), _)| *to) {
            self.send_batch(from, to);
        }
    }

    fn send_batch(&mut self, from: SensorId, to: Option<SensorId>) {
        if let Some(batch) = self.state.batches.remove(&(from, to)) {
            self.dispatch(from, to, &batch.frames, &batch.tickets);
        }
    }

    /// Reserves the medium for frames and sends them when it is free.
    fn dispatch(&mut self, from: SensorId, to: Option<SensorId>, frames: &[BitString], tickets: &[Ticket]) {
        self.drain(from);
        let acknowledged = self.is_acknowledged(to);
        // A sender in an outage loses the frame, unless it repeats frames: then it tries again after the outage.
        if !self.is_alive(from) || (!acknowledged && !self.listens(from)) {
            self.state.ledger.faults.lost += 1;
            return;
        }
        let size = self.size(from, frames);
        let contends = self.contends();
        if let Some(resume) = self.quiet(from) {
            let number = self.next_number();
            self.state.outgoing.insert(number, outgoing(from, to, frames, tickets));
            self.schedule(resume, from, EventKind::Resume(number));
            return;
        }
        let start = match contends {
            true => self.state.now,
            false => self.book(from, size.air, acknowledged),
        };
        // The common case of a free medium needs no entry among the outgoing frames.
        if !contends && !acknowledged && start == self.state.now {
            self.attempt(&Attempt {
                from,
                to,
                frames,
                size,
                before: 0,
                sender_awake: false,
                receiver_awake: false,
                answer: None,
            });
            return;
        }
        let number = self.next_number();
        let outgoing = outgoing(from, to, frames, tickets);
        if contends {
            self.contend(number, outgoing);
            return;
        }
        self.state.outgoing.insert(number, outgoing);
        self.transmit_at(start, from, number);
    }

    /// The time until which a node must be silent by its duty cycle, if that is to come.
    fn quiet(&self, node: SensorId) -> Option<Instant> {
        let until = self.state.quiet_until.get(&node).copied();
        until.filter(|until| *until > self.state.now)
    }

    /// A node sends from `start` on: its next frame waits as its duty cycle says.
    fn keep_duty(&mut self, node: SensorId, start: Instant, air: Bits) {
        let radio = self.setup.radio_of(node);
        if let Some(period) = radio.lora.and_then(|lora| lora.period(radio.duration(air))) {
            self.state.quiet_until.insert(node, start.after(period));
        }
    }

    /// The duty cycle lets an outgoing frame begin, unless another of its sender was first.
    pub(super) fn resume_frame(&mut self, number: u32) {
        let Some(outgoing) = self.state.outgoing.get_mut(&number) else {
            return;
        };
        (outgoing.sender_awake, outgoing.receiver_awake) = (false, false);
        let (from, acknowledged) = (outgoing.from, outgoing.to.is_some() && self.setup.retries.is_some());
        if let Some(resume) = self.quiet(from) {
            self.schedule(resume, from, EventKind::Resume(number));
        } else if self.contends() {
            if let Some(outgoing) = self.state.outgoing.remove(&number) {
                self.contend(number, outgoing);
            }
        } else if let Some(outgoing) = self.state.outgoing.get(&number) {
            let air = self.size(from, &outgoing.frames).air;
            let start = self.book(from, air, acknowledged);
            self.transmit_at(start, from, number);
        }
    }

    fn transmit_at(&mut self, start: Instant, from: SensorId, number: u32) {
        if start <= self.state.now {
            return self.transmit(number);
        }
        self.schedule(start, from, EventKind::Transmit(number));
    }

    /// The medium is free for an outgoing frame: makes an attempt.
    pub(super) fn transmit(&mut self, number: u32) {
        let Some(mut outgoing) = self.state.outgoing.remove(&number) else {
            return;
        };
        let (from, to) = (outgoing.from, outgoing.to);
        self.drain(from);
        let acknowledged = self.is_acknowledged(to);
        let size = self.size(from, &outgoing.frames);
        if self.contends()
            && let Some(resume) = self.quiet(from)
        {
            self.state.outgoing.insert(number, outgoing);
            self.schedule(resume, from, EventKind::Resume(number));
            return;
        }
        let mut sends = self.listens(from);
        let mut listened = false;
        if sends && self.hears_others(from) {
            outgoing.heard += 1;
            if outgoing.heard < self.tries() {
                self.contend(number, outgoing);
                return;
            }
            sends = false;
        }
        outgoing.heard = 0;
        if sends {
            if self.contends() {
                self.keep_duty(from, self.state.now, size.air);
            }
            listened = self.attempt(&Attempt {
                from,
                to,
                frames: &outgoing.frames,
                size,
                before: outgoing.attempts,
                sender_awake: outgoing.sender_awake,
                receiver_awake: outgoing.receiver_awake,
                answer: acknowledged.then_some(number),
            });
        } else {
            self.state.ledger.faults.lost += 1;
        }
        // The attempt may have emptied the battery.
        if acknowledged && self.is_alive(from) {
            let at = self.ack_deadline(from, size.air);
            self.schedule(at, from, EventKind::AckTimeout(number));
            outgoing.attempts += 1;
            (outgoing.sender_awake, outgoing.receiver_awake) = (sends, listened);
            self.state.outgoing.insert(number, outgoing);
        }
    }

    /// An acknowledgement has arrived. Returns the tickets of the frames that it acknowledges: none if the sender cannot receive, or
    /// they were acknowledged before.
    pub(super) fn acknowledged(&mut self, sender: SensorId, number: u32) -> Vec<Ticket> {
        self.drain(sender);
        if !self.listens(sender) {
            self.state.ledger.faults.lost += 1;
            return Vec::new();
        }
        self.state
            .outgoing
            .remove(&number)
            .map_or_else(Vec::new, |frame| frame.tickets)
    }

    /// No acknowledgement came in time. Repeats the frames, or returns the tickets of those that are given up.
    pub(super) fn ack_timeout(&mut self, number: u32) -> Vec<Ticket> {
        let Some(outgoing) = self.state.outgoing.get(&number) else {
            return Vec::new();
        };
        let (from, attempts) = (outgoing.from, outgoing.attempts);
        if self.setup.retries.is_none_or(|retries| attempts > retries) {
            self.state.ledger.faults.given_up += 1;
            return self
                .state
                .outgoing
                .remove(&number)
                .map_or_else(Vec::new, |frame| frame.tickets);
        }
        if let Some(resume) = self.quiet(from) {
            self.schedule(resume, from, EventKind::Resume(number));
            return Vec::new();
        }
        if self.contends() {
            if let Some(outgoing) = self.state.outgoing.remove(&number) {
                self.contend(number, outgoing);
            }
            return Vec::new();
        }
        let air = self.size(from, &outgoing.frames).air;
        let start = self.book(from, air, true);
        // A sender that must wait for the medium sleeps until then.
        if start > self.state.now
            && let Some(outgoing) = self.state.outgoing.get_mut(&number)
        {
            (outgoing.sender_awake, outgoing.receiver_awake) = (false, false);
        }
        self.transmit_at(start, from, number);
        Vec::new()
    }

    /// The radio of `by` acknowledges what arrived intact from `to`.
    pub(super) fn answer(&mut self, number: u32, by: SensorId, to: SensorId) {
        let radio = *self.setup.radio_of(by);
        let mut copies = Vec::new();
        let sent = u64::from(self.state.ledger.accounts[by.index()].acknowledgements);
        let bits = usize::try_from(radio.acknowledgement.0).unwrap_or(usize::MAX);
        // The last index separates these streams from those of frames.
        self.receive(by, to, sent, 1, bits, 1, &mut copies);
        let begins = self.state.now.after(radio.turnaround);
        self.occupy(by, begins, radio.acknowledgement, Vec::new());
        let sending = radio.turn() + radio.transmit(radio.acknowledgement, self.field.distance(by.0, to.0));
        let account = &mut self.state.ledger.accounts[by.index()];
        account.acknowledgements = account.acknowledgements.wrapping_add(1);
        account.sending += sending;
        account.air += radio.acknowledgement;
        account.awake += radio.answer_time();
        let messages = &mut self.state.ledger.messages;
        messages.air += radio.acknowledgement;
        messages.sending += sending;
        let intact = copies.iter().filter(|copy| copy.flipped.is_empty());
        match intact
            .map(|copy| copy.delay)
            .min_by(|a, b| a.value().total_cmp(&b.value()))
        {
            Some(delay) => {
                let sent = self
                    .state
                    .now
                    .after(radio.turnaround)
                    .after(radio.duration(radio.acknowledgement));
                self.schedule(sent.after(delay), to, EventKind::Acknowledged(number));
            }
            None => self.state.ledger.faults.lost += 1,
        }
        if self.setup.detail >= Detail::Everything {
            self.state.log.entries.push(Entry::Answered(Acknowledgement {
                at: self.state.now,
                from: by,
                to,
                air: radio.acknowledgement.0,
                copies,
                sending,
            }));
        }
        self.drain(by);
    }

    fn is_acknowledged(&self, to: Option<SensorId>) -> bool {
        to.is_some() && self.setup.retries.is_some()
    }

    fn next_ticket(&mut self) -> Ticket {
        let ticket = Ticket(self.state.next_ticket);
        self.state.next_ticket += 1;
        ticket
    }

    fn next_number(&mut self) -> u32 {
        let number = self.state.next_number;
        self.state.next_number = number.wrapping_add(1);
        number
    }

    /// Reserves the medium around the sender and all nodes that hear it, from the time at which it is free. Returns that time.
    fn book(&mut self, from: SensorId, air: Bits, acknowledged: bool) -> Instant {
        let radio = self.setup.radio_of(from);
        let neighbours = self.field.graph().neighbours(from.index());
        let busy = &mut self.state.busy_until;
        let own = busy[from.index()].max(self.state.now);
        let start = neighbours
            .iter()
            .map(|node| busy[*node as usize])
            .fold(own, Instant::max);
        let mut end = start.after(radio.duration(air));
        if acknowledged {
            end = end.after(radio.turnaround).after(radio.duration(radio.acknowledgement));
        }
        busy[from.index()] = end;
        neighbours.iter().for_each(|node| busy[*node as usize] = end);
        self.keep_duty(from, start, air);
        start
    }

    /// Time until which the sender of a frame that begins now waits for its acknowledgement.
    fn ack_deadline(&self, from: SensorId, air: Bits) -> Instant {
        let (radio, delay) = (self.setup.radio_of(from), self.setup.channel.delay);
        let end = self.state.now.after(radio.duration(air));
        match self.setup.ack_timeout {
            Some(timeout) => end.after(timeout),
            // The same roundings as for the acknowledgement's own time, plus a nanosecond: it arrives in time.
            None => {
                let answered = end
                    .after(delay)
                    .after(radio.turnaround)
                    .after(radio.duration(radio.acknowledgement));
                Instant(answered.after(delay).0.saturating_add(1))
            }
        }
    }
}

/// Frames that wait to be sent for the first time.
fn outgoing(from: SensorId, to: Option<SensorId>, frames: &[BitString], tickets: &[Ticket]) -> Outgoing {
    Outgoing {
        from,
        to,
        frames: frames.to_vec(),
        tickets: tickets.to_vec(),
        attempts: 0,
        heard: 0,
        sender_awake: false,
        receiver_awake: false,
    }
}

/// Total time on air of frames of the given lengths, one after the other, with the overheads of each.
pub(crate) fn air_time(radio: &Radio, bodies: impl IntoIterator<Item = Bits>) -> Seconds {
    bodies.into_iter().map(|body| radio.duration(radio.on_air(body))).sum()
}
