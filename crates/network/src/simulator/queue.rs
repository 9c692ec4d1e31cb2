//! What will happen, in order, and the frames that are under way.

use crate::frame::stored;
use crate::units::{Instant, SensorId};
use fewbits_core::BitString;
use serde::{Deserialize, Serialize};
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

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
    pub(crate) time: Instant,
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

/// Events, and the bits of those that are arrivals.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Queue {
    sequence: u64,
    /// An event before all of the heap: most frames arrive before anything else happens.
    front: Option<Event>,
    heap: BinaryHeap<Reverse<Event>>,
    arrivals: Vec<Option<Arrival>>,
    free: Vec<u32>,
}

impl Queue {
    #[inline]
    pub(crate) fn push(&mut self, time: Instant, node: SensorId, what: What) {
        let mut event = Event::new(time, self.sequence, node, what);
        self.sequence += 1;
        let first = self.front.or_else(|| self.heap.peek().map(|event| event.0));
        if first.is_none_or(|first| event < first) {
            match self.front.replace(event) {
                Some(front) => event = front,
                None => return,
            }
        }
        self.heap.push(Reverse(event));
    }

    /// The next event up to `end`.
    #[inline]
    pub(crate) fn pop(&mut self, end: Instant) -> Option<Event> {
        match (self.front, self.heap.peek()) {
            (Some(front), _) if front.time <= end => self.front.take(),
            (None, Some(Reverse(first))) if first.time <= end => self.heap.pop().map(|event| event.0),
            _ => None,
        }
    }

    /// Bits that arrive at a node.
    pub(crate) fn deliver(&mut self, at: Instant, from: SensorId, to: SensorId, bits: BitString) {
        let arrival = Some(Arrival { from, bits });
        let place = if let Some(place) = self.free.pop() {
            self.arrivals[place as usize] = arrival;
            place
        } else {
            self.arrivals.push(arrival);
            (self.arrivals.len() - 1) as u32
        };
        self.push(at, to, What::Arrival(place));
    }

    /// What has arrived.
    pub(crate) fn take(&mut self, place: u32) -> Option<(SensorId, BitString)> {
        let arrival = self.arrivals.get_mut(place as usize)?.take()?;
        self.free.push(place);
        Some((arrival.from, arrival.bits))
    }

    /// Whether a queue that was read is in order and among nodes that exist.
    pub(crate) fn is_consistent(&self, known: impl Fn(SensorId) -> bool) -> bool {
        let mut events = self.heap.iter().map(|event| event.0);
        self.front.is_none_or(|front| known(front.node))
            && events.all(|event| known(event.node) && self.front.is_none_or(|front| front < event))
            && self.free.iter().all(|place| (*place as usize) < self.arrivals.len())
            && self.arrivals.iter().flatten().all(|arrival| known(arrival.from))
    }

    /// Bytes that it holds.
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
                queue.push(Instant(time), SensorId(token), What::Timer(token));
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
                    prop_assert_eq!((event.time.0, event.what()), (first.0, What::Timer(first.1)));
                }
            }
            waiting.sort_unstable();
            for (time, token) in waiting {
                let event = queue.pop(Instant(u64::MAX)).unwrap();
                prop_assert_eq!((event.time.0, event.node, event.what()), (time, SensorId(token), What::Timer(token)));
            }
            prop_assert!(queue.pop(Instant(u64::MAX)).is_none());
        }
    }

    #[test]
    fn what_happens_is_kept_in_the_event() {
        let all = [
            What::Timer(u32::MAX),
            What::Arrival(7),
            What::Mishap(0),
            What::Flush(None),
            What::Flush(Some(SensorId(3))),
        ];
        for what in all {
            assert_eq!(Event::new(Instant(1), 1 << 60, SensorId(2), what).what(), what);
        }
    }
}
