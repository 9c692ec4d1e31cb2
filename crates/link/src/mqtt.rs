//! Datagrams through an MQTT broker.

use crate::error::Error;
use crate::topics::{QUEUE, Queue, Topics};
use crate::transport::{Datagram, Transport};
pub use rumqttc;
use rumqttc::NetworkOptions;
use rumqttc::v5::mqttbytes::QoS;
use rumqttc::v5::mqttbytes::v5::{Filter, Packet, RetainForwardRule, SubscribeReasonCode};
use rumqttc::v5::{Client, ConnectionError, Event, MqttOptions};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

/// Longest message, which the broker is told: it drops longer ones instead of sending them. A datagram with its topic is shorter.
const MAX_MESSAGE: u32 = 1 << 17;
const CONNECT_WITHIN: Duration = Duration::from_secs(10);
const RECONNECT_AFTER: Duration = Duration::from_secs(1);

/// The connection of one end to a broker that speaks MQTT 5. Addresses are sensor numbers.
///
/// Sensor 3 of the fleet `plant` sends on the topic `plant/3/up` and receives on `plant/3/down`. Both have quality of service 0: the
/// protocol itself handles lost frames, and a frame that comes after its slot is useless. If the connection ends, a thread connects again;
/// what is sent meanwhile is lost. Messages that the broker keeps for those who come later are not asked for, and longer ones than a
/// datagram are not sent by the broker: neither can keep an end from its own messages.
pub struct Mqtt {
    client: Arc<Client>,
    is_connected: Arc<AtomicBool>,
    topics: Topics,
    queue: Queue,
}

impl std::fmt::Debug for Mqtt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Mqtt")
            .field("topics", &self.topics)
            .finish_non_exhaustive()
    }
}

impl Mqtt {
    /// The centre of a fleet. It sets the size of messages and the kind of session in `options`.
    ///
    /// # Errors
    /// If the fleet's name has an empty part or one of `+ # * $ ?`, or the broker does not answer or refuses.
    pub fn centre(options: MqttOptions, fleet: &str) -> Result<Self, Error> {
        Self::connect(options, Topics::new(fleet, None)?)
    }

    /// A sensor of a fleet.
    ///
    /// # Errors
    /// As [`centre`](Self::centre).
    pub fn sensor(options: MqttOptions, fleet: &str, number: u32) -> Result<Self, Error> {
        Self::connect(options, Topics::new(fleet, Some(number))?)
    }

    fn connect(mut options: MqttOptions, topics: Topics) -> Result<Self, Error> {
        options.set_max_packet_size(Some(MAX_MESSAGE)).set_clean_start(true);
        let (host, port) = options.broker_address();
        let failed = |source| Error::socket(format!("{host}:{port}"), source);
        let mut network = NetworkOptions::new();
        network.set_tcp_nodelay(true);
        options.set_network_options(network);
        let (client, mut connection) = Client::new(options, QUEUE);
        let (client, is_connected) = (Arc::new(client), Arc::new(AtomicBool::new(false)));
        let (inlet, queue) = Queue::new(topics.clone());
        let (sender, outcome) = mpsc::channel();
        // The thread ends when the last client is dropped, so it must not keep one.
        let (weak, connected, topic) = (Arc::downgrade(&client), is_connected.clone(), topics.from("+"));
        let mut filter = Filter::new(topic.clone(), QoS::AtMostOnce);
        filter.retain_forward_rule = RetainForwardRule::Never;
        std::thread::spawn(move || {
            let mut must_subscribe = false;
            for event in connection.iter() {
                match event {
                    Ok(Event::Incoming(Packet::Publish(message))) => {
                        inlet.leave(&String::from_utf8_lossy(&message.topic), message.payload);
                    }
                    // The broker forgets the subscriptions of an ended session.
                    Ok(Event::Incoming(Packet::ConnAck(_))) => must_subscribe = true,
                    Ok(Event::Incoming(Packet::SubAck(answer))) => {
                        let taken = |code: &SubscribeReasonCode| matches!(code, SubscribeReasonCode::Success(_));
                        let refused = !answer.return_codes.iter().all(taken);
                        connected.store(!refused, Ordering::Relaxed);
                        let refusal = std::io::Error::other(format!("the broker refuses the topic {topic}"));
                        let _ = sender.send(if refused { Err(refusal) } else { Ok(()) });
                    }
                    Ok(_) => {}
                    Err(error) => {
                        connected.store(false, Ordering::Relaxed);
                        let error = match error {
                            ConnectionError::Io(error) => error,
                            error => std::io::Error::other(error),
                        };
                        let _ = sender.send(Err(error));
                        if weak.strong_count() == 0 {
                            return;
                        }
                        std::thread::sleep(RECONNECT_AFTER);
                    }
                }
                // If the queue of requests is full, try again after the next event.
                if must_subscribe && let Some(client) = weak.upgrade() {
                    must_subscribe = client.try_subscribe_many([filter.clone()]).is_err();
                }
            }
        });
        let slow = |_| Err(std::io::ErrorKind::TimedOut.into());
        outcome
            .recv_timeout(CONNECT_WITHIN)
            .unwrap_or_else(slow)
            .map_err(failed)?;
        Ok(Self {
            client,
            is_connected,
            topics,
            queue,
        })
    }
}

impl Transport for Mqtt {
    type Address = u32;

    fn send(&mut self, to: &u32, bytes: &[u8]) {
        // A frame that waits for a connection would come after its slot: drop it.
        if self.is_connected.load(Ordering::Relaxed) {
            let _ = self
                .client
                .try_publish(self.topics.to(*to), QoS::AtMostOnce, false, bytes.to_vec());
        }
    }

    fn receive(&mut self, wait: Duration) -> Result<Option<Datagram<'_, u32>>, Error> {
        Ok(self.queue.receive(wait))
    }
}
