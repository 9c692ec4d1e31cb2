//! Datagrams through an MQTT broker, and messages of other programs there.

use crate::doors::home_assistant::Message;
use crate::doors::lorawan::{Server, uplink};
use crate::error::Error;
use crate::topics::{Inlet, QUEUE, Queue, Topics};
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

/// A connection that is made anew when it ends. What is published meanwhile is lost.
struct Connection {
    client: Arc<Client>,
    is_connected: Arc<AtomicBool>,
}

impl Connection {
    /// Connects, and hands what is published on `filters` to `take`.
    fn open(
        mut options: MqttOptions,
        filters: Vec<String>,
        take: impl Fn(&str, &[u8]) + Send + 'static,
    ) -> Result<Self, Error> {
        options.set_max_packet_size(Some(MAX_MESSAGE)).set_clean_start(true);
        let (host, port) = options.broker_address();
        let failed = |source| Error::socket(format!("{host}:{port}"), source);
        let mut network = NetworkOptions::new();
        network.set_tcp_nodelay(true);
        options.set_network_options(network);
        let (client, mut connection) = Client::new(options, QUEUE);
        let (client, is_connected) = (Arc::new(client), Arc::new(AtomicBool::new(false)));
        let (sender, outcome) = mpsc::channel();
        // The thread ends when the last client is dropped, so it must not keep one.
        let (weak, connected) = (Arc::downgrade(&client), is_connected.clone());
        let topics = filters.join(", ");
        let filters = filters.into_iter().map(|topic| {
            let mut filter = Filter::new(topic, QoS::AtMostOnce);
            filter.retain_forward_rule = RetainForwardRule::Never;
            filter
        });
        let filters: Vec<Filter> = filters.collect();
        std::thread::spawn(move || {
            let mut must_subscribe = false;
            for event in connection.iter() {
                match event {
                    Ok(Event::Incoming(Packet::Publish(message))) => {
                        take(&String::from_utf8_lossy(&message.topic), &message.payload);
                    }
                    // The broker forgets the subscriptions of an ended session.
                    Ok(Event::Incoming(Packet::ConnAck(_))) if filters.is_empty() => {
                        connected.store(true, Ordering::Relaxed);
                        let _ = sender.send(Ok(()));
                    }
                    Ok(Event::Incoming(Packet::ConnAck(_))) => must_subscribe = true,
                    Ok(Event::Incoming(Packet::SubAck(answer))) => {
                        let taken = |code: &SubscribeReasonCode| matches!(code, SubscribeReasonCode::Success(_));
                        let refused = !answer.return_codes.iter().all(taken);
                        connected.store(!refused, Ordering::Relaxed);
                        if refused {
                            tracing::warn!(topics, "the broker refuses the topics");
                        }
                        let refusal = std::io::Error::other(format!("the broker refuses the topic {topics}"));
                        let _ = sender.send(if refused { Err(refusal) } else { Ok(()) });
                    }
                    Ok(_) => {}
                    Err(error) => {
                        if connected.swap(false, Ordering::Relaxed) {
                            tracing::warn!(%error, "the connection to the broker has ended");
                        }
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
                    must_subscribe = client.try_subscribe_many(filters.clone()).is_err();
                }
            }
        });
        let slow = |_| Err(std::io::ErrorKind::TimedOut.into());
        outcome
            .recv_timeout(CONNECT_WITHIN)
            .unwrap_or_else(slow)
            .map_err(failed)?;
        Ok(Self { client, is_connected })
    }

    /// Publishes without waiting. `retained`: the broker keeps the message for those who come later, and confirms it.
    fn publish(&self, topic: String, retained: bool, bytes: Vec<u8>) {
        let quality = if retained { QoS::AtLeastOnce } else { QoS::AtMostOnce };
        // What waits for a connection would come too late: drop it.
        if retained || self.is_connected.load(Ordering::Relaxed) {
            let _ = self.client.try_publish(topic, quality, retained, bytes);
        }
    }
}

/// The connection of one end to a broker that speaks MQTT 5. Addresses are sensor numbers.
///
/// Sensor 3 of the fleet `plant` sends on the topic `plant/3/up` and receives on `plant/3/down`. Both have quality of service 0: the
/// protocol itself handles lost frames, and a frame that comes after its slot is useless. If the connection ends, a thread connects again;
/// what is sent meanwhile is lost. Messages that the broker keeps for those who come later are not asked for, and longer ones than a
/// datagram are not sent by the broker: neither can keep an end from its own messages.
pub struct Mqtt {
    connection: Connection,
    topics: Topics,
    queue: Queue<u32>,
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

    fn connect(options: MqttOptions, topics: Topics) -> Result<Self, Error> {
        let (inlet, queue) = Inlet::new();
        let own = topics.clone();
        let connection = Connection::open(options, vec![topics.from("+")], move |topic, bytes| {
            if let Some(sensor) = own.sensor_of(topic) {
                inlet.leave(sensor, bytes);
            }
        })?;
        Ok(Self {
            connection,
            topics,
            queue,
        })
    }
}

impl Transport for Mqtt {
    type Address = u32;

    fn send(&mut self, to: &u32, bytes: &[u8]) {
        self.connection.publish(self.topics.to(*to), false, bytes.to_vec());
    }

    fn receive(&mut self, wait: Duration) -> Result<Option<Datagram<'_, u32>>, Error> {
        Ok(self.queue.receive(wait))
    }
}

/// Messages of others at a broker: what is published on some topics, and what is to be published, as by [doors](crate::doors).
pub struct Messages {
    connection: Connection,
    queue: mpsc::Receiver<(String, Vec<u8>)>,
}

impl std::fmt::Debug for Messages {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Messages").finish_non_exhaustive()
    }
}

impl Messages {
    /// Connects and listens to these topics, which may have wildcards; to none if there are none. 4096 messages wait, further ones are
    /// dropped.
    ///
    /// # Errors
    /// If the broker does not answer or refuses.
    pub fn open(options: MqttOptions, topics: Vec<String>) -> Result<Self, Error> {
        let (sender, queue) = mpsc::sync_channel(QUEUE);
        let connection = Connection::open(options, topics, move |topic, bytes| {
            let _ = sender.try_send((topic.to_owned(), bytes.to_vec()));
        })?;
        Ok(Self { connection, queue })
    }

    /// Publishes a message without waiting. It is lost if there is no connection, unless the broker is to keep it.
    pub fn publish(&self, message: &Message) {
        let content = message.content.clone().into_bytes();
        self.connection
            .publish(message.topic.clone(), message.retained, content);
    }

    /// Topic and content of the next message; `None` if none comes within `wait`.
    pub fn receive(&self, wait: Duration) -> Option<(String, Vec<u8>)> {
        self.queue.recv_timeout(wait).ok()
    }
}

/// Sensors behind a LoRaWAN network server. Addresses are devices: the EUI at ChirpStack, the name at The Things Stack.
///
/// A sensor of class A hears a question only after it has sent something, in one of its two receive windows.
pub struct Lorawan {
    connection: Connection,
    server: Server,
    port: u8,
    queue: Queue<String>,
}

impl std::fmt::Debug for Lorawan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Lorawan")
            .field("server", &self.server)
            .finish_non_exhaustive()
    }
}

impl Lorawan {
    /// The centre of sensors that send on this port of an application. Uplinks on other ports are left to others.
    ///
    /// # Errors
    /// If the broker does not answer or refuses.
    pub fn centre(options: MqttOptions, server: Server, port: u8) -> Result<Self, Error> {
        let (inlet, queue) = Inlet::new();
        let connection = Connection::open(options, vec![server.uplinks()], move |_, bytes| {
            match uplink(&String::from_utf8_lossy(bytes)) {
                Ok(Some(found)) if found.port == port => inlet.leave(found.device, &found.payload),
                Ok(_) => {}
                Err(error) => tracing::warn!(%error, "a message of the network server was not understood"),
            }
        })?;
        Ok(Self {
            connection,
            server,
            port,
            queue,
        })
    }
}

impl Transport for Lorawan {
    type Address = String;

    fn send(&mut self, to: &String, bytes: &[u8]) {
        let message = self.server.downlink(to, self.port, bytes);
        self.connection
            .publish(message.topic, false, message.content.into_bytes());
    }

    fn receive(&mut self, wait: Duration) -> Result<Option<Datagram<'_, String>>, Error> {
        Ok(self.queue.receive(wait))
    }
}
