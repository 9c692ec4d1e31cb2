//! Datagrams over zenoh, between peers or through routers.

use crate::error::Error;
use crate::topics::{Inlet, Queue, Topics};
use crate::transport::{Datagram, Transport};
pub use ::zenoh;
use ::zenoh::pubsub::Subscriber;
use ::zenoh::{Session, Wait};
use std::time::Duration;

/// The zenoh session of one end. Addresses are sensor numbers.
///
/// Sensor 3 of the fleet `plant` sends on the key `plant/3/up` and receives on `plant/3/down`. The session's configuration says who
/// connects to whom. If sensors connect to a centre that listens, no router is needed.
#[derive(Debug)]
pub struct Zenoh {
    session: Session,
    topics: Topics,
    queue: Queue<u32>,
    /// Receives datagrams until it is dropped.
    _subscriber: Subscriber<()>,
}

impl Zenoh {
    /// The centre of a fleet.
    ///
    /// # Errors
    /// If the fleet's name has an empty part or one of `+ # * $ ?`, or the session is closed.
    pub fn centre(session: Session, fleet: &str) -> Result<Self, Error> {
        Self::subscribe(session, Topics::new(fleet, None)?)
    }

    /// A sensor of a fleet.
    ///
    /// # Errors
    /// As [`centre`](Self::centre).
    pub fn sensor(session: Session, fleet: &str, number: u32) -> Result<Self, Error> {
        Self::subscribe(session, Topics::new(fleet, Some(number))?)
    }

    fn subscribe(session: Session, topics: Topics) -> Result<Self, Error> {
        let (inlet, queue) = Inlet::new();
        let (key, own) = (topics.from("*"), topics.clone());
        let subscriber = session.declare_subscriber(&key).callback(move |sample| {
            if let Some(sensor) = own.sensor_of(sample.key_expr().as_str()) {
                inlet.leave(sensor, &sample.payload().to_bytes());
            }
        });
        let subscriber = subscriber.wait();
        Ok(Self {
            _subscriber: subscriber.map_err(|error| Error::socket(key, std::io::Error::other(error)))?,
            session,
            topics,
            queue,
        })
    }
}

impl Transport for Zenoh {
    type Address = u32;

    fn send(&mut self, to: &u32, bytes: &[u8]) {
        // If the network is congested, drop the datagram instead of delaying it.
        let put = self.session.put(self.topics.to(*to), bytes);
        let _ = put
            .congestion_control(::zenoh::qos::CongestionControl::Drop)
            .express(true)
            .wait();
    }

    fn receive(&mut self, wait: Duration) -> Result<Option<Datagram<'_, u32>>, Error> {
        Ok(self.queue.receive(wait))
    }
}
