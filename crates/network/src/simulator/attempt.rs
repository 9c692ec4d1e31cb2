//! One attempt to send frames: which copies arrive and when, and what the attempt costs.

use super::core::{BufferPool, SimulatorCore};
use super::log::{Detail, Entry, Reception, Transmission};
use super::queue::Arrival;
use crate::medium::air::{from_air, payload_bits};
use crate::medium::{Loss, ReceivedCopy, Transceiver};
use crate::units::{Bits, Joules, SensorId};
use fewbits_core::BitString;
use fewbits_protocol::Frame;
use rand::Rng;

/// Bits of the length field of each frame in a batch.
pub(super) const LENGTH_BITS: u64 = 16;

/// Numbers of bits of a frame or batch.
#[derive(Debug, Clone, Copy)]
pub(super) struct Size {
    /// Payload bits.
    pub(super) payload: u64,
    /// Bits of its frames, headers and checks included.
    pub(super) own: usize,
    /// Number of link frames.
    pub(super) link_frames: u64,
    /// Bits on air, with preambles and link headers.
    pub(super) air: Bits,
}

/// One attempt to send frames.
pub(super) struct Attempt<'a> {
    pub(super) from: SensorId,
    pub(super) to: Option<SensorId>,
    pub(super) frames: &'a [BitString],
    pub(super) size: Size,
    /// Number of earlier attempts for the same frames.
    pub(super) before: u32,
    /// Whether the sender is still awake from the attempt before.
    pub(super) sender_awake: bool,
    /// Whether the receiver is still awake from the attempt before.
    pub(super) receiver_awake: bool,
    /// The outgoing frame that an acknowledgement answers; `None` without acknowledgement.
    pub(super) answer: Option<u32>,
}

impl SimulatorCore {
    /// Numbers of bits of frames that are sent together.
    pub(super) fn size(&self, from: SensorId, frames: &[BitString]) -> Size {
        let radio = self.setup.radio_of(from);
        let own: usize = frames.iter().map(|frame| frame.bits()).sum();
        let lengths = if frames.len() > 1 {
            LENGTH_BITS * frames.len() as u64
        } else {
            0
        };
        let body = Bits(own as u64 + lengths);
        Size {
            payload: frames.iter().map(|frame| payload_bits(frame) as u64).sum(),
            own,
            link_frames: radio.link_frames(body),
            air: radio.on_air(body),
        }
    }

    /// Sends once. Returns whether a receiver listened.
    pub(super) fn attempt(&mut self, attempt: &Attempt<'_>) -> bool {
        // Buffers of earlier transmissions are reused, so most frames need no allocation.
        let mut pool = std::mem::take(&mut self.pool);
        let mut receptions = self.draw(attempt, &mut pool);
        let listened = !receptions.is_empty();
        let (sending, receiving) = self.charge(attempt, &receptions);
        self.launch(attempt, &receptions);
        if self.setup.detail >= Detail::Everything {
            self.state.log.entries.push(Entry::Sent(Transmission {
                at: self.state.now,
                from: attempt.from,
                to: attempt.to,
                frames: attempt.frames.to_vec(),
                attempt: attempt.before,
                payload: attempt.size.payload,
                air: attempt.size.air.0,
                receptions: std::mem::take(&mut receptions),
                sending,
                receiving,
            }));
        }
        for reception in receptions.drain(..) {
            let mut copies = reception.copies;
            copies.clear();
            pool.copies.push(copies);
        }
        pool.receptions = receptions;
        self.pool = pool;
        listened
    }

    /// Draws the copies that arrive at every node that could receive the attempt.
    fn draw(&mut self, attempt: &Attempt<'_>, pool: &mut BufferPool) -> Vec<Reception> {
        let (from, size) = (attempt.from, attempt.size);
        // This number names the random streams of the attempt, so it is read before `charge` counts the frame.
        let sent = u64::from(self.state.ledger.accounts[from.index()].frames);
        let mut receptions = std::mem::take(&mut pool.receptions);
        let hearers = match attempt.to {
            Some(_) => 1,
            None => self.field.graph().neighbours(from.index()).len(),
        };
        for hearer in 0..hearers {
            let to = match attempt.to {
                Some(to) => to,
                None => SensorId(self.field.graph().neighbours(from.index())[hearer]),
            };
            if self.listens(to) {
                let mut copies = pool.copies.pop().unwrap_or_default();
                self.receive(from, to, sent, 0, size.own, size.link_frames, &mut copies);
                receptions.push(Reception { to, copies });
            }
        }
        receptions
    }

    /// Draws the copies of one transmission at one receiver. A frame of several link frames is lost if any of them is.
    #[allow(clippy::too_many_arguments, reason = "the names of one random stream, and lengths")]
    pub(super) fn receive(
        &mut self,
        from: SensorId,
        to: SensorId,
        sent: u64,
        purpose: u64,
        bits: usize,
        link_frames: u64,
        copies: &mut Vec<ReceivedCopy>,
    ) {
        let loss = *self.setup.loss_of(from, to);
        if self.setup.channel.is_clean(&loss) {
            copies.push(ReceivedCopy {
                delay: self.setup.channel.delay,
                flipped: Vec::new(),
            });
            return;
        }
        // Every pair of transmission and receiver has its own random stream: a change elsewhere does not alter the draws here.
        let stream = self.air.indexed(u64::from(from.0)).indexed(sent);
        let mut rng = stream.indexed(u64::from(to.0)).indexed(purpose).fast_rng();
        let lost = self.loss_now(&mut rng, from, to, &loss);
        // A message of several link frames is lost if any of them is.
        let any_lost = match link_frames {
            1 => lost,
            several => 1.0 - (1.0 - lost).powf(several as f64),
        };
        self.setup.channel.copies(&mut rng, any_lost, bits, copies);
    }

    fn loss_now<R: Rng>(&mut self, rng: &mut R, from: SensorId, to: SensorId, loss: &Loss) -> f64 {
        let bursts = &mut self.state.bursts;
        let before = || bursts.get(&(from, to)).copied();
        let (probability, state) = loss.drawn(rng, self.field.distance(from.0, to.0), self.state.now, before);
        if let Some(state) = state {
            bursts.insert((from, to), state);
        }
        probability
    }

    /// Adds an attempt to the ledger. Returns the energies of sending and of receiving, summed over nodes.
    fn charge(&mut self, attempt: &Attempt<'_>, receptions: &[Reception]) -> (Joules, Joules) {
        let (from, air) = (attempt.from, attempt.size.air);
        let radio = self.setup.radio_of(from);
        let reach = match (&radio.transceiver, attempt.to) {
            // Constant power: the energy does not depend on the distance.
            (Transceiver::Powers { .. }, _) => 0.0,
            (Transceiver::FirstOrder { .. }, Some(to)) => self.field.distance(from.0, to.0),
            // A broadcast is sent with the power for the whole range.
            (Transceiver::FirstOrder { .. }, None) => self.field.range(),
        };
        let frame_time = radio.duration(air);
        let mut sending = radio.transmit(air, reach);
        let mut receiving = Joules::ZERO;
        let mut awake = frame_time;
        if !attempt.sender_awake {
            sending += radio.wake_up();
            awake += radio.wake + radio.doze;
        }
        if attempt.answer.is_some() {
            receiving = radio.turn() + radio.receive(radio.acknowledgement);
            awake += radio.answer_time();
        }
        // A repetition carries no new payload.
        let payload = Bits(if attempt.before == 0 { attempt.size.payload } else { 0 });
        let accounts = &mut self.state.ledger.accounts;
        let sender = &mut accounts[from.index()];
        sender.payload += payload;
        sender.air += air;
        sender.frames = sender.frames.wrapping_add(1);
        sender.sending += sending;
        sender.receiving += receiving;
        sender.awake += awake;
        for reception in receptions {
            let radio = self.setup.radio_of(reception.to);
            let mut spent = radio.listen() + radio.receive(air);
            let mut awake = frame_time + radio.guard;
            if !attempt.receiver_awake {
                spent += radio.wake_up();
                awake += radio.wake + radio.doze;
            }
            let account = &mut accounts[reception.to.index()];
            account.receiving += spent;
            account.awake += awake;
            receiving += spent;
        }
        let messages = &mut self.state.ledger.messages;
        messages.messages += u64::from(attempt.before == 0);
        messages.payload += payload;
        messages.air += air;
        messages.sending += sending;
        messages.receiving += receiving;
        self.drain(from);
        for reception in receptions {
            self.drain(reception.to);
        }
        (sending, receiving)
    }

    /// Schedules the arrivals of all copies.
    fn launch(&mut self, attempt: &Attempt<'_>, receptions: &[Reception]) {
        let on_air = self
            .state
            .now
            .after(self.setup.radio_of(attempt.from).duration(attempt.size.air));
        let busy = self.collide(attempt.from);
        let mut arrivals = Vec::new();
        if receptions.is_empty() && attempt.to.is_some() {
            self.state.ledger.faults.lost += 1;
        }
        for reception in receptions {
            if reception.copies.is_empty() {
                self.state.ledger.faults.lost += 1;
            }
            if self.is_garbled(&busy, reception.to) {
                self.state.ledger.faults.lost += 1;
                continue;
            }
            for copy in &reception.copies {
                let at = on_air.after(copy.delay);
                // A receiver acknowledges only what it can read.
                let mut answer = attempt.answer.filter(|_| self.is_intact(attempt.frames, copy));
                for bits in frames_of(attempt.frames, copy) {
                    let from = attempt.from;
                    // One acknowledgement for all frames of a batch.
                    let answer = answer.take();
                    let place = self.deliver(at, reception.to, Arrival { from, answer, bits });
                    if self.contends() {
                        arrivals.push((reception.to, place));
                    }
                }
            }
        }
        self.occupy(attempt.from, self.state.now, attempt.size.air, arrivals);
    }

    fn is_intact(&self, frames: &[BitString], copy: &ReceivedCopy) -> bool {
        copy.flipped.is_empty()
            || frames_of(frames, copy).all(|bits| {
                let bytes = from_air(&bits);
                Frame::decode(&bytes, self.check_of(Frame::kind_of(&bytes))).is_ok()
            })
    }
}

/// The frames of a batch as they arrive.
fn frames_of<'a>(frames: &'a [BitString], copy: &'a ReceivedCopy) -> impl Iterator<Item = BitString> + 'a {
    let mut start = 0;
    frames.iter().map(move |frame| {
        let from = start;
        start += frame.bits();
        copy.flipped
            .iter()
            .filter_map(|bit| (*bit as usize).checked_sub(from))
            .filter(|bit| *bit < frame.bits())
            .fold(frame.clone(), BitString::with_flipped)
    })
}
