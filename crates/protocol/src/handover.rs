//! A belief that is sent from leader to leader: the leader's step, and the state machine of each node.

use crate::frame::{Check, Frame, Kind, digest};
use crate::note::Note;
use crate::payload::Payload;
use crate::receiver::BoxError;
use crate::slot::{Schedule, Slot};
use fewbits_core::BitString;
use fewbits_core::rand::Rng;
use serde::{Deserialize, Serialize};

/// A leader's step with the belief that was handed to it. Object-safe.
pub trait Leader {
    /// One step: measure, update, choose the next leader. The first leader has no message. `rng` is a function of the slot, so a node that
    /// repeats the step draws the same numbers.
    ///
    /// # Errors
    /// If the message is not a belief, or the measurement is impossible under it. The leader then keeps the belief that it had.
    fn lead(&self, rng: &mut dyn Rng, slot: u64, node: u32, message: Option<&BitString>) -> Result<Lead, BoxError>;
}

/// Result of a leader's step.
#[derive(Debug, Clone, PartialEq)]
pub struct Lead {
    /// The updated belief, as it is sent.
    pub message: BitString,
    /// Address of the next leader; `None` ends the walk.
    pub next: Option<u32>,
    /// The estimate, for the log.
    pub estimate: Vec<f64>,
}

/// What the driver of a [`Bearer`] must do, in this order.
#[derive(Debug, Clone, PartialEq)]
pub enum Errand {
    /// Take the leader's step in this slot with this belief, and call [`Bearer::on_led`] or [`Bearer::on_failed`].
    Lead {
        /// The slot.
        slot: Slot,
        /// The belief; `None` for the first leader.
        message: Option<BitString>,
    },
    /// Send the frame's bytes one hop towards its destination. If there is no route, call [`Bearer::on_give_up`].
    Send {
        /// Address of the node for which the frame is meant.
        destination: u32,
        /// Slot and digest of the frame, which identify it in [`Bearer::on_ack`] and [`Bearer::on_give_up`].
        name: (Slot, u32),
        /// The frame's bytes.
        frame: Vec<u8>,
    },
    /// Call [`Bearer::on_timer`] at this time or later.
    SetTimer {
        /// The time, in nanoseconds.
        at: u64,
    },
    /// Record a note.
    Note {
        /// Address of the node that the note is about.
        with: u32,
        /// The note.
        note: Note,
    },
}

/// A handover that was sent and is not acknowledged yet.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Pending {
    name: (Slot, u32),
    destination: u32,
    belief: BitString,
}

/// State machine of a node of a walk. It leads if the belief was handed to it, and forwards what is for others. It takes events and
/// returns [`Errand`]s.
///
/// ```text
/// on_timer(slot begins) -> Lead;  on_led(next) -> Send;  on_failed -> leads again in the next slot
/// on_frame(handover) -> for itself: SetTimer (its slot); for another: Send; a second one of its slot: Note
/// on_ack ends a pending handover;  on_give_up -> leads itself, Note (retained)
/// ```
/// A handover that was given up may have arrived nevertheless. Then there are two leaders, and when they meet a disagreement is noted.
/// A node that already leads keeps the belief that contains more slots.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Bearer {
    address: u32,
    schedule: Schedule,
    /// The last slot in which a node leads.
    last: u64,
    /// Whether the link reports success or failure of a handover.
    acknowledged: bool,
    /// The slot in which the node will lead, and the belief that was handed to it.
    leading: Option<(Slot, Option<BitString>)>,
    /// The same while the driver takes the leader's step.
    acting: Option<(Slot, Option<BitString>)>,
    /// Slot and digest of the last handover that the node accepted.
    taken: Option<(Slot, u32)>,
    /// Slot and digest of the last handover that the node forwarded.
    passed: Option<(Slot, u32)>,
    pending: Vec<Pending>,
}

impl Bearer {
    /// A node with this address. No node leads after slot `last`. `acknowledged`: whether the driver calls [`on_ack`](Self::on_ack) or
    /// [`on_give_up`](Self::on_give_up) for each frame that it sends.
    pub fn new(address: u32, schedule: Schedule, last: u64, acknowledged: bool) -> Self {
        Self {
            address,
            schedule,
            last,
            acknowledged,
            leading: None,
            acting: None,
            taken: None,
            passed: None,
            pending: Vec::new(),
        }
    }

    /// The node as the leader of slot 1. The driver calls [`on_timer`](Self::on_timer) when that slot begins.
    #[must_use]
    pub fn first(self) -> Self {
        Self {
            leading: Some((Slot::of_count(1), None)),
            ..self
        }
    }

    /// The slot in which the node leads; `None` if it does not.
    pub fn leads(&self) -> Option<Slot> {
        self.leading.as_ref().map(|(slot, _)| *slot)
    }

    /// The node has lost its memory, and the belief if it had it.
    pub fn on_memory_lost(&mut self) {
        (self.leading, self.acting) = (None, None);
        self.pending.clear();
    }

    fn begins(&self, slot: Slot, now: u64) -> u64 {
        self.schedule.start(slot.nearest_count(self.schedule.count(now)))
    }

    /// A timer has fired. A timer that was set for an earlier handover has no effect before the node's slot begins.
    pub fn on_timer(&mut self, now: u64, errands: &mut Vec<Errand>) {
        let due = self.leads().is_some_and(|slot| self.begins(slot, now) <= now);
        if !due {
            return;
        }
        self.acting = self.leading.take();
        if let Some((slot, belief)) = &self.acting {
            errands.push(Errand::Lead {
                slot: *slot,
                message: belief.clone(),
            });
        }
    }

    /// The leader's step has succeeded.
    pub fn on_led(&mut self, now: u64, lead: Lead, errands: &mut Vec<Errand>) {
        let (Some((slot, _)), Some(next)) = (self.acting.take(), lead.next) else {
            return;
        };
        let (after, belief) = (slot.after(), lead.message);
        if next == self.address {
            self.stay(now, after, Some(belief), errands);
        // After the last slot nobody leads, so nothing is handed over.
        } else if slot.nearest_count(self.schedule.count(now)) < self.last {
            let sum = digest(after, Payload::from(&belief));
            self.pass(next, (after, sum), belief, errands);
        }
    }

    /// The leader's step has failed: the node leads again in the next slot, with the belief that it had.
    pub fn on_failed(&mut self, now: u64, errands: &mut Vec<Errand>) {
        if let Some((slot, belief)) = self.acting.take() {
            self.stay(now, slot.after(), belief, errands);
        }
    }

    /// Leads in a slot to come.
    fn stay(&mut self, now: u64, slot: Slot, belief: Option<BitString>, errands: &mut Vec<Errand>) {
        if slot.nearest_count(self.schedule.count(now)) <= self.last {
            self.leading = Some((slot, belief));
            let at = self.begins(slot, now);
            errands.push(Errand::SetTimer { at });
        }
    }

    fn pass(&mut self, destination: u32, name: (Slot, u32), belief: BitString, errands: &mut Vec<Errand>) {
        let frame = Frame {
            destination,
            ..Frame::new(Kind::Handover, name.0, name.1, Payload::from(&belief))
        };
        errands.push(Errand::Send {
            destination,
            name,
            frame: frame.to_bytes(Check::Whole),
        });
        // The handover is kept until the driver has found a route, even if the link does not acknowledge.
        self.pending.retain(|pending| self.acknowledged && pending.name != name);
        self.pending.push(Pending {
            name,
            destination,
            belief,
        });
    }

    /// A decoded frame has arrived from the neighbour `from`.
    pub fn on_decoded(&mut self, now: u64, from: u32, frame: &Frame<'_>, errands: &mut Vec<Errand>) {
        let (slot, name) = (frame.slot, (frame.slot, frame.digest));
        let mut note = |note| errands.push(Errand::Note { with: from, note });
        if frame.kind != Kind::Handover {
            return note(Note::Unexpected { kind: frame.kind });
        }
        // The digest is that of the belief: a mismatch means that the payload was damaged.
        if digest(slot, frame.payload) != frame.digest {
            return note(Note::Disagreement { slot });
        }
        let own = frame.destination == self.address;
        let last = if own { &mut self.taken } else { &mut self.passed };
        match *last {
            Some(seen) if seen == name => return note(Note::Duplicate { slot }),
            // Two leaders hand over different beliefs for one slot: keep the first.
            Some((seen, _)) if own && slot == seen => return note(Note::Disagreement { slot }),
            Some((seen, _)) if own && seen.is_after(slot) => return note(Note::Late { slot }),
            _ => *last = Some(name),
        }
        let belief = frame.payload.into();
        match own {
            true => self.take_over(now, from, slot, belief, errands),
            false => self.pass(frame.destination, name, belief, errands),
        }
    }

    /// Accepts a belief that another node has sent or was meant to lead with. If this node leads already, the belief that contains more
    /// slots is kept; in a tie, its own.
    ///
    /// A repeated frame does not reach this function: [`on_decoded`](Self::on_decoded) compares it with the last accepted handover, which a
    /// loss of memory does not clear, and notes the same one as a duplicate, another one of its slot as a disagreement and one of an
    /// earlier slot as late. This holds for frames that are less than half the range of slot numbers old. Nor does a second report
    /// that a handover was given up reach it, because the first one removes the handover from `pending`.
    fn take_over(&mut self, now: u64, with: u32, slot: Slot, belief: BitString, errands: &mut Vec<Errand>) {
        if let Some(leads) = self.leads() {
            let note = Note::Disagreement { slot };
            errands.push(Errand::Note { with, note });
            if !slot.is_after(leads) {
                return;
            }
        }
        self.stay(now, slot, Some(belief), errands);
    }

    /// A handover has arrived at the next hop; `name` is its slot and digest.
    pub fn on_ack(&mut self, name: (Slot, u32)) {
        self.pending.retain(|pending| pending.name != name);
    }

    /// No acknowledgement of a handover came, or there is no route: this node leads with the belief.
    pub fn on_give_up(&mut self, now: u64, name: (Slot, u32), errands: &mut Vec<Errand>) {
        let Some(at) = self.pending.iter().position(|pending| pending.name == name) else {
            return;
        };
        let Pending {
            destination, belief, ..
        } = self.pending.remove(at);
        let note = Note::Retained { slot: name.0 };
        let with = destination;
        errands.push(Errand::Note { with, note });
        self.take_over(now, with, name.0, belief, errands);
    }
}
