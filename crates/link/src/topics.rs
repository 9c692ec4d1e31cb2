//! Topic names for transports: sensor 3 of the fleet `plant` sends on `plant/3/up` and receives on `plant/3/down`.

use crate::error::Error;
use crate::transport::{Datagram, MAX_DATAGRAM};
use fewbits_numerics::error::refuse;
use std::sync::mpsc;
use std::time::Duration;

/// Largest number of waiting datagrams. Further ones are dropped, so that memory stays bounded.
pub(crate) const QUEUE: usize = 4096;

/// The topics of one end. Addresses are sensor numbers.
#[derive(Debug, Clone)]
pub(crate) struct Topics {
    fleet: String,
    /// Number of the sensor; `None` at the centre.
    sensor: Option<u32>,
}

impl Topics {
    /// # Errors
    /// If the name of the fleet has an empty part or a wildcard character.
    pub(crate) fn new(fleet: &str, sensor: Option<u32>) -> Result<Self, Error> {
        if fleet.split('/').any(str::is_empty) || fleet.contains(|c: char| "+#*$?".contains(c) || c.is_control()) {
            return refuse("fleet", fleet, "parts separated by `/`, none empty, without `+ # * $ ?`");
        }
        let fleet = fleet.to_owned();
        Ok(Self { fleet, sensor })
    }

    fn ways(&self) -> (&'static str, &'static str) {
        match self.sensor {
            None => ("down", "up"),
            Some(_) => ("up", "down"),
        }
    }

    /// The topic on which this end sends.
    pub(crate) fn to(&self, sensor: u32) -> String {
        format!("{}/{sensor}/{}", self.fleet, self.ways().0)
    }

    /// The topics on which this end receives; `any` is the wildcard for sensor numbers.
    pub(crate) fn from(&self, any: &str) -> String {
        let sensor = self.sensor.map_or_else(|| any.to_owned(), |sensor| sensor.to_string());
        format!("{}/{sensor}/{}", self.fleet, self.ways().1)
    }

    /// The sensor number in the topic of a received datagram.
    pub(crate) fn sensor_of(&self, topic: &str) -> Option<u32> {
        let rest = topic.strip_prefix(&self.fleet)?.strip_prefix('/')?;
        rest.strip_suffix(self.ways().1)?.strip_suffix('/')?.parse().ok()
    }
}

/// The sending end of a queue, for a thread of the transport.
pub(crate) struct Inlet<A>(mpsc::SyncSender<(A, Vec<u8>)>);

impl<A> Inlet<A> {
    /// Both ends of a queue.
    pub(crate) fn new() -> (Self, Queue<A>) {
        let (sender, receiver) = mpsc::sync_channel(QUEUE);
        let last = Vec::new();
        (Self(sender), Queue { receiver, last })
    }

    /// Leaves a datagram from this address. What is too long for one, or for which there is no room, is dropped.
    pub(crate) fn leave(&self, from: A, bytes: &[u8]) {
        if bytes.len() <= MAX_DATAGRAM {
            let _ = self.0.try_send((from, bytes.to_vec()));
        }
    }
}

/// The queue of received datagrams.
#[derive(Debug)]
pub(crate) struct Queue<A> {
    receiver: mpsc::Receiver<(A, Vec<u8>)>,
    last: Vec<u8>,
}

impl<A> Queue<A> {
    pub(crate) fn receive(&mut self, wait: Duration) -> Option<Datagram<'_, A>> {
        let (from, bytes) = self.receiver.recv_timeout(wait).ok()?;
        self.last = bytes;
        Some((from, &self.last))
    }
}
