//! The event queue, and the frames that are on their way.

use crate::units::{Instant, SensorId};
use fewbits_core::BitString;
use serde::{Deserialize, Serialize};
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum EventKind {
    /// A timer of the protocol, with its token.
    Timer(u32),
    /// Bits arrive. The number is the position in the list of arrivals.
    Arrival(u32),
    /// A fault, by its index in the setup's list.
    Fault(u32),
    /// The hold time of a batch is over. No effect if the batch of this number was sent before.
    Flush(u32),
    /// The medium is free for an attempt of an outgoing frame.
    Transmit(u32),
    /// The acknowledgement of an outgoing frame arrives at its sender.
    Acknowledged(u32),
    /// The sender's wait for the acknowledgement of an outgoing frame is over. No effect if it arrived.
    AckTimeout(u32),
    /// The sender of an outgoing frame may send again by its duty cycle.
    Resume(u32),
}

impl EventKind {
    /// The kind as a number below 8, and the argument.
    fn parts(self) -> (u64, u32) {
        match self {
            Self::Timer(token) => (0, token),
            Self::Arrival(place) => (1, place),
            Self::Fault(index) => (2, index),
            Self::Flush(batch) => (3, batch),
            Self::Transmit(frame) => (4, frame),
            Self::Acknowledged(frame) => (5, frame),
            Self::AckTimeout(frame) => (6, frame),
            Self::Resume(frame) => (7, frame),
        }
    }
}

/// Events are ordered by time, then by the order of scheduling. They are small, because the queue moves them: `rank` holds the place in
/// the order of scheduling, then three bits for the kind.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Event {
    pub(crate) time: Instant,
    rank: u64,
    pub(crate) node: SensorId,
    argument: u32,
}

impl Event {
    fn new(time: Instant, sequence: u64, node: SensorId, kind: EventKind) -> Self {
        let (number, argument) = kind.parts();
        Self {
            time,
            rank: sequence << 3 | number,
            node,
            argument,
        }
    }

    pub(crate) fn kind(&self) -> EventKind {
        match self.rank & 7 {
            0 => EventKind::Timer(self.argument),
            1 => EventKind::Arrival(self.argument),
            2 => EventKind::Fault(self.argument),
            3 => EventKind::Flush(self.argument),
            4 => EventKind::Transmit(self.argument),
            5 => EventKind::Acknowledged(self.argument),
            6 => EventKind::AckTimeout(self.argument),
            _ => EventKind::Resume(self.argument),
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
pub(crate) struct Arrival {
    pub(crate) from: SensorId,
    /// The outgoing frame that the receiver's radio acknowledges when these bits arrive.
    pub(crate) answer: Option<u32>,
    pub(crate) bits: BitString,
}

/// The events, and the bits of those that are arrivals.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Queue {
    sequence: u64,
    /// An event that precedes all others: most frames arrive before anything else happens, so it need not enter the heap.
    front: Option<Event>,
    heap: BinaryHeap<Reverse<Event>>,
    arrivals: Vec<Option<Arrival>>,
    free: Vec<u32>,
}

impl Queue {
    #[inline]
    pub(crate) fn push(&mut self, time: Instant, node: SensorId, kind: EventKind) {
        let mut event = Event::new(time, self.sequence, node, kind);
        self.sequence += 1;
        // Either `front` precedes all events of the heap, or there is none.
        let first = self.front.or_else(|| self.heap.peek().map(|event| event.0));
        if first.is_none_or(|first| event < first) {
            match self.front.replace(event) {
                Some(front) => event = front,
                None => return,
            }
        }
        self.heap.push(Reverse(event));
    }

    /// Takes the next event up to `end`.
    #[inline]
    pub(crate) fn pop(&mut self, end: Instant) -> Option<Event> {
        match (self.front, self.heap.peek()) {
            (Some(front), _) if front.time <= end => self.front.take(),
            (None, Some(Reverse(first))) if first.time <= end => self.heap.pop().map(|event| event.0),
            _ => None,
        }
    }

    /// Schedules the arrival of bits at a node. Returns their position in the list of arrivals.
    pub(crate) fn deliver(&mut self, at: Instant, to: SensorId, arrival: Arrival) -> u32 {
        let arrival = Some(arrival);
        let place = if let Some(place) = self.free.pop() {
            self.arrivals[place as usize] = arrival;
            place
        } else {
            self.arrivals.push(arrival);
            (self.arrivals.len() - 1) as u32
        };
        self.push(at, to, EventKind::Arrival(place));
        place
    }

    /// Destroys bits on their way. Returns whether there were any.
    pub(crate) fn destroy(&mut self, place: u32) -> bool {
        // The place stays taken: the event of the arrival still refers to it, and `take` frees it.
        self.arrivals
            .get_mut(place as usize)
            .is_some_and(|arrival| arrival.take().is_some())
    }

    /// Takes the bits that have arrived; `None` if they were destroyed.
    pub(crate) fn take(&mut self, place: u32) -> Option<Arrival> {
        let arrival = self.arrivals.get_mut(place as usize)?.take();
        self.free.push(place);
        arrival
    }

    /// Whether a queue that was read from a snapshot is in order and names only existing nodes.
    pub(crate) fn is_consistent(&self, known: impl Fn(SensorId) -> bool) -> bool {
        let mut events = self.heap.iter().map(|event| event.0);
        self.front.is_none_or(|front| known(front.node))
            && events.all(|event| known(event.node) && self.front.is_none_or(|front| front < event))
            && self.free.iter().all(|place| (*place as usize) < self.arrivals.len())
            && self.arrivals.iter().flatten().all(|arrival| known(arrival.from))
    }

    /// Bytes of memory of the queue.
    pub(crate) fn memory(&self) -> usize {
        self.heap.capacity() * size_of::<Reverse<Event>>()
            + self.arrivals.capacity() * size_of::<Option<Arrival>>()
            + self
                .arrivals
                .iter()
                .flatten()
                .map(|a| a.bits.bytes().len())
                .sum::<usize>()
            + self.free.capacity() * size_of::<u32>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Pushes and pops in any order give the events by time, of one time by when they were pushed; a stored queue goes on alike.
        #[test]
        fn events_come_by_time_and_then_as_they_were_pushed(work in prop::collection::vec((0_u64..6, any::<bool>()), 1..60)) {
            let mut queue = Queue::default();
            let mut waiting: Vec<(u64, u32)> = Vec::new();
            for (token, (time, pop)) in work.into_iter().enumerate() {
                let token = token as u32;
                queue.push(Instant(time), SensorId(token), EventKind::Timer(token));
                waiting.push((time, token));
                if pop {
                    let mut stored = Vec::new();
                    ciborium::into_writer(&queue, &mut stored).unwrap();
                    queue = ciborium::from_reader(stored.as_slice()).unwrap();
                    prop_assert!(queue.is_consistent(|_| true));
                    waiting.sort_unstable();
                    let first = waiting.remove(0);
                    prop_assert!(first.0 == 0 || queue.pop(Instant(first.0 - 1)).is_none());
                    let event = queue.pop(Instant(first.0)).unwrap();
                    prop_assert_eq!((event.time.0, event.kind()), (first.0, EventKind::Timer(first.1)));
                }
            }
            waiting.sort_unstable();
            for (time, token) in waiting {
                let event = queue.pop(Instant(u64::MAX)).unwrap();
                prop_assert_eq!((event.time.0, event.node, event.kind()), (time, SensorId(token), EventKind::Timer(token)));
            }
            prop_assert!(queue.pop(Instant(u64::MAX)).is_none());
        }
    }

    #[test]
    fn an_event_keeps_its_kind_and_argument() {
        let all = [
            EventKind::Timer(u32::MAX),
            EventKind::Arrival(7),
            EventKind::Fault(0),
            EventKind::Flush(3),
            EventKind::Transmit(4),
            EventKind::Acknowledged(5),
            EventKind::AckTimeout(6),
            EventKind::Resume(8),
        ];
        for kind in all {
            assert_eq!(Event::new(Instant(1), 1 << 60, SensorId(2), kind).kind(), kind);
        }
    }
}
