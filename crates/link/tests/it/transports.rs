//! One scenario with the same losses over each transport: the same estimates.

use crate::world::{Record, Reports, key, measurement, node, peers, receiver, settings};
use fewbits_core::Observation;
use fewbits_link::{Output, Request, SensorLink, Station, Transport, Udp};
use fewbits_protocol::{Feedback, SensorSettings};
use std::time::{Duration, Instant};

const SLOTS: u64 = 25;
const LOSS: f64 = 0.1;

/// Whether a question or a report of this slot is lost.
fn is_lost(slot: u64, sensor: u32, way: u64) -> bool {
    use rand::RngExt;
    let stream = fewbits_monte_carlo::Stream::new(21)
        .indexed(slot)
        .indexed(u64::from(sensor));
    stream.indexed(way).rng().random::<f64>() < LOSS
}

/// The next datagram; an end that gets none waited in vain.
fn next<T: Transport>(transport: &mut T) -> (T::Address, Vec<u8>) {
    let (from, bytes) = transport.receive(Duration::from_secs(60)).unwrap().unwrap();
    (from, bytes.to_vec())
}

/// Sensors say where they are until the centre has heard each: a transport may need a while until both ends know of each other.
fn all_heard<T: Transport>(
    station: &mut Station<Box<dyn fewbits_protocol::Receiver>, T::Address>,
    centre: &mut T,
    sensors: &mut [(T, T::Address)],
    links: &mut [SensorLink],
) {
    let mut outputs = Vec::new();
    for ((transport, to), link) in sensors.iter_mut().zip(links) {
        let (before, start) = (station.counts().taken, Instant::now());
        while station.counts().taken == before {
            assert!(start.elapsed() < Duration::from_secs(60), "no hello arrives");
            let Request::Datagram(bytes) = link.hello().unwrap() else {
                panic!()
            };
            transport.send(to, &bytes);
            while let Some((from, bytes)) = centre.receive(Duration::from_millis(50)).unwrap() {
                station.on_datagram(from, bytes, &mut outputs).unwrap();
            }
        }
    }
}

/// Slots by hand: every datagram that is not lost arrives before the next step, however slow the machine is. `sensors` are ends with the address of
/// the centre. With `moves`, another centre with the same state goes on after half of the slots, at the transport that is returned.
fn by_hand<T: Transport>(
    reports: Reports,
    mut centre: T,
    sensors: &mut [(T, T::Address)],
    mut moves: Option<&mut dyn FnMut(T) -> T>,
) -> Vec<Record> {
    let count = sensors.len();
    let folder = tempfile::tempdir().unwrap();
    let mut nodes: Vec<_> = sensors.iter().map(|_| node(reports)).collect();
    let mut links: Vec<_> = (0..count as u32)
        .map(|number| SensorLink::new(SensorSettings::new(Feedback::Told), number, key(number), None).unwrap())
        .collect();
    let loss = 1.0 - (1.0 - LOSS).powi(2);
    let is_moved = moves.is_some();
    let begin = || {
        let known = (0..count as u32).map(|number| fewbits_link::Peer {
            number,
            key: key(number),
            address: None,
        });
        let store = is_moved.then(|| fewbits_link::Store::new(folder.path().join("state")));
        Station::new(settings(reports, 10, count), receiver(reports, loss), known.collect(), store).unwrap()
    };
    let mut station = begin();
    let (mut outputs, mut requests) = (Vec::new(), Vec::new());
    let mut rng = fewbits_monte_carlo::Stream::new(9).rng();
    all_heard(&mut station, &mut centre, sensors, &mut links);
    let mut records = Vec::new();
    for slot in 1..=SLOTS {
        if slot == SLOTS / 2
            && let Some(moves) = &mut moves
        {
            drop(station);
            centre = moves(centre);
            station = begin();
            all_heard(&mut station, &mut centre, sensors, &mut links);
        }
        station.on_time(10 * slot, &mut outputs).unwrap();
        let questions = outputs.drain(..).filter_map(|output| match output {
            Output::Datagram { to, bytes } => Some((to, bytes)),
            _ => None,
        });
        let questions: Vec<_> = questions.collect();
        assert_eq!(questions.len(), count);
        let mut expected = 0;
        for (i, (to, question)) in questions.into_iter().enumerate() {
            let (transport, address) = &mut sensors[i];
            if is_lost(slot, i as u32, 0) {
                continue;
            }
            centre.send(&to, &question);
            let (_, bytes) = next(transport);
            links[i].on_datagram(10 * slot, &bytes, &mut requests).unwrap();
            while let Some(request) = requests.pop() {
                match request {
                    Request::Sample { slot, feedback } => {
                        let sample = measurement(i as u32, slot.number());
                        let report = nodes[i].report(&mut rng, &sample, &feedback).unwrap();
                        links[i].on_sample(0, report.as_ref(), &mut requests).unwrap();
                    }
                    Request::Datagram(bytes) if !is_lost(slot, i as u32, 1) => {
                        transport.send(address, &bytes);
                        expected += 1;
                    }
                    _ => {}
                }
            }
        }
        for _ in 0..expected {
            let (from, bytes) = next(&mut centre);
            station.on_datagram(from, &bytes, &mut outputs).unwrap();
        }
        station.on_time(10 * slot + 9, &mut outputs).unwrap();
        let Some(Output::Step(step)) = outputs.pop() else {
            panic!()
        };
        let received = step.observed.iter().filter(|o| matches!(o, Observation::Received(_)));
        assert_eq!(received.count(), expected, "slot {slot}");
        records.push((step.slot, step.observed, step.estimate));
    }
    records
}

/// The same over UDP.
fn over_udp(reports: Reports) -> Vec<Record> {
    udp(reports, None)
}

fn udp(reports: Reports, moves: Option<&mut dyn FnMut(Udp) -> Udp>) -> Vec<Record> {
    let centre = Udp::bind("127.0.0.1:0").unwrap();
    let address = centre.address();
    let mut sensors: Vec<_> = peers(reports.sensors())
        .iter()
        .map(|_| (Udp::bind("127.0.0.1:0").unwrap(), address))
        .collect();
    by_hand(reports, centre, &mut sensors, moves)
}

/// A fleet, or a part of one, moves to another centre: no report is lost, and the estimates are those of a centre that stayed.
#[test]
fn a_fleet_moves_over_udp() {
    let mut moves = |old: Udp| {
        let address = old.address();
        drop(old);
        Udp::bind(address).unwrap()
    };
    assert_eq!(udp(Reports::Signs, Some(&mut moves)), over_udp(Reports::Signs));
}

/// Signs, censored values and counted signs over a transport and over UDP. `end` is the centre's, or a sensor's with its number.
#[cfg(any(feature = "mqtt", feature = "zenoh"))]
fn assert_as_over_udp<T: Transport<Address = u32>>(mut end: impl FnMut(&str, Option<u32>) -> T) {
    for (fleet, reports) in [
        ("a", Reports::Signs),
        ("b/c", Reports::Censored),
        ("d", Reports::Counted),
    ] {
        let centre = end(fleet, None);
        let mut sensors: Vec<_> = (0..reports.sensors())
            .map(|number| (end(fleet, Some(number)), number))
            .collect();
        let start = Instant::now();
        let records = by_hand(reports, centre, &mut sensors, None);
        println!("{reports:?}: {SLOTS} slots in {:?}", start.elapsed());
        assert_eq!(records, over_udp(reports), "{reports:?}");
    }
}

/// The part `plant/north` of a fleet moves to another centre, which is heard before the next slot; `plant/south` stays.
#[cfg(any(feature = "mqtt", feature = "zenoh"))]
fn assert_moved<T: Transport<Address = u32>>(mut end: impl FnMut(&str, Option<u32>) -> T) {
    for (part, is_moved) in [("plant/north", true), ("plant/south", false)] {
        let centre = end(part, None);
        let mut sensors: Vec<_> = (0..Reports::Signs.sensors())
            .map(|number| (end(part, Some(number)), number))
            .collect();
        let mut again = |old: T| {
            let new = end(part, None);
            drop(old);
            new
        };
        let moves: Option<&mut dyn FnMut(T) -> T> = if is_moved { Some(&mut again) } else { None };
        assert_eq!(by_hand(Reports::Signs, centre, &mut sensors, moves), over_udp(Reports::Signs), "{part}");
    }
}

/// The estimates over UDP follow the losses, so that what the tests below compare says something.
#[test]
fn losses_change_estimates() {
    let records = over_udp(Reports::Signs);
    let lost = records
        .iter()
        .flat_map(|(_, observed, _)| observed)
        .filter(|o| **o == Observation::Nothing)
        .count();
    assert!((25..75).contains(&lost), "{lost} of {} lost", SLOTS * 10);
    assert_eq!(records, over_udp(Reports::Signs));
    let mut lossless = receiver(Reports::Signs, 1.0 - (1.0 - LOSS).powi(2));
    lossless.predict(1).unwrap();
    assert_ne!(lossless.estimate(), records[0].2);
}

/// A centre's state is good over another transport: what it knew is, where its sensors were is not.
#[test]
fn state_over_another_transport() {
    let folder = tempfile::tempdir().unwrap();
    let store = || Some(fewbits_link::Store::new(folder.path().join("state")));
    let (settings, mut outputs) = (|| settings(Reports::Signs, 10, 10), Vec::new());
    let known = peers(10).into_iter().map(|peer| fewbits_link::Peer {
        address: Some(([127, 0, 0, 1], 9).into()),
        ..peer
    });
    let mut udp = Station::new(settings(), receiver(Reports::Signs, LOSS), known.collect(), store()).unwrap();
    udp.on_time(10, &mut outputs).unwrap();
    udp.on_time(19, &mut outputs).unwrap();
    let last = udp.last_step().cloned();
    drop(udp);
    let unknown = peers(10).into_iter().map(|peer| fewbits_link::Peer::<u32> {
        address: None,
        number: peer.number,
        key: peer.key,
    });
    let mut topics = Station::new(settings(), receiver(Reports::Signs, LOSS), unknown.collect(), store()).unwrap();
    assert_eq!(topics.last_step(), last.as_ref());
    assert_eq!(topics.last_step().unwrap().asked, [true; 10]);
    let mut outputs = Vec::new();
    topics.on_time(20, &mut outputs).unwrap();
    topics.on_time(29, &mut outputs).unwrap();
    assert!(outputs.iter().all(|output| !matches!(output, Output::Datagram { .. })));
    assert_eq!(topics.last_step().unwrap().asked, [false; 10]);
}

#[cfg(feature = "mqtt")]
mod mqtt {
    use super::*;
    use fewbits_link::mqtt::{Mqtt, rumqttc::v5::MqttOptions};
    use std::process::{Child, Command, Stdio};

    /// A broker that ends with the test.
    struct Broker {
        process: Child,
        port: u16,
        _settings: tempfile::TempDir,
    }

    impl Drop for Broker {
        fn drop(&mut self) {
            let _ = self.process.kill();
            let _ = self.process.wait();
        }
    }

    impl Broker {
        fn at(port: u16) -> std::io::Result<Self> {
            // Debian's place is not on everybody's path.
            let path = format!("{}:/usr/sbin:/usr/local/sbin", std::env::var("PATH").unwrap_or_default());
            let folder = tempfile::tempdir()?;
            // Without the last setting, messages that follow one another wait 40 ms for the acknowledgement of the one before.
            let settings = format!("listener {port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\n");
            std::fs::write(folder.path().join("broker.conf"), settings)?;
            let mut command = Command::new("mosquitto");
            let command = command
                .args(["-c", "broker.conf"])
                .current_dir(&folder)
                .env("PATH", path);
            let process = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
            let broker = Self {
                process,
                port,
                _settings: folder,
            };
            let start = Instant::now();
            while std::net::TcpStream::connect(("127.0.0.1", port)).is_err() {
                assert!(start.elapsed() < Duration::from_secs(60), "the broker does not listen");
                std::thread::sleep(Duration::from_millis(20));
            }
            Ok(broker)
        }

        fn start() -> Option<Self> {
            let free = std::net::TcpListener::bind("127.0.0.1:0")
                .unwrap()
                .local_addr()
                .unwrap();
            let broker = Self::at(free.port()).ok();
            if broker.is_none() {
                println!("skipped: mosquitto is not installed");
            }
            broker
        }

        fn end(&self, fleet: &str, sensor: Option<u32>) -> Result<Mqtt, fewbits_link::Error> {
            let options = MqttOptions::new("", "127.0.0.1", self.port);
            match sensor {
                None => Mqtt::centre(options, fleet),
                Some(number) => Mqtt::sensor(options, fleet, number),
            }
        }
    }

    #[test]
    fn same_estimates_over_mqtt() {
        if let Some(broker) = Broker::start() {
            assert_as_over_udp(|fleet, sensor| broker.end(fleet, sensor).unwrap());
        }
    }

    #[test]
    fn a_part_of_a_fleet_moves_over_mqtt() {
        if let Some(broker) = Broker::start() {
            assert_moved(|fleet, sensor| broker.end(fleet, sensor).unwrap());
        }
    }

    #[test]
    fn broker_that_stops_and_comes_back() {
        let Some(broker) = Broker::start() else { return };
        let (mut centre, mut sensor) = (broker.end("f", None).unwrap(), broker.end("f", Some(3)).unwrap());
        let port = broker.port;
        sensor.send(&3, b"before");
        assert_eq!(next(&mut centre), (3, b"before".to_vec()));
        drop(broker);
        let _again = Broker::at(port).unwrap();
        let start = Instant::now();
        loop {
            assert!(start.elapsed() < Duration::from_secs(60), "no connection");
            sensor.send(&3, b"after");
            if let Some(taken) = centre.receive(Duration::from_millis(50)).unwrap() {
                assert_eq!(taken, (3, &b"after"[..]));
                break;
            }
        }
        centre.send(&3, b"down");
        assert_eq!(next(&mut sensor), (3, b"down".to_vec()));
    }

    /// The broker keeps a message of three megabytes on a sensor's topic: the centre hears its sensors nevertheless.
    #[test]
    fn large_kept_message_blinds_nobody() {
        use fewbits_link::mqtt::rumqttc::{Client, Event, MqttOptions, Packet, QoS};
        let Some(broker) = Broker::start() else { return };
        let mut options = MqttOptions::new("large", "127.0.0.1", broker.port);
        options.set_max_packet_size(1 << 22, 1 << 22);
        let (client, mut connection) = Client::new(options, 10);
        client
            .publish("f/3/up", QoS::AtLeastOnce, true, vec![0; 3 << 20])
            .unwrap();
        let kept = connection
            .iter()
            .any(|event| matches!(event, Ok(Event::Incoming(Packet::PubAck(_)))));
        assert!(kept);
        let (mut centre, mut sensor) = (broker.end("f", None).unwrap(), broker.end("f", Some(3)).unwrap());
        sensor.send(&3, b"small");
        assert_eq!(next(&mut centre), (3, b"small".to_vec()));
        // One that comes while the centre is connected is left out too.
        client
            .publish("f/3/up", QoS::AtLeastOnce, false, vec![0; 3 << 20])
            .unwrap();
        assert!(
            connection
                .iter()
                .any(|event| matches!(event, Ok(Event::Incoming(Packet::PubAck(_)))))
        );
        sensor.send(&3, b"again");
        assert_eq!(next(&mut centre), (3, b"again".to_vec()));
    }

    #[test]
    fn broker_that_is_not_there_and_names_for_many() {
        let free = std::net::TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap();
        let error = Mqtt::centre(MqttOptions::new("", "127.0.0.1", free.port()), "f").unwrap_err();
        assert!(error.to_string().contains(&free.to_string()), "{error}");
        for fleet in ["", "a//b", "/a", "a/", "a/+", "#", "a*"] {
            let error = Mqtt::centre(MqttOptions::new("", "127.0.0.1", free.port()), fleet).unwrap_err();
            assert!(matches!(&error, fewbits_link::Error::Argument(argument) if argument.name == "fleet"), "{error}");
        }
    }
}

#[cfg(feature = "zenoh")]
mod zenohs {
    use super::*;
    use fewbits_link::zenoh::{Zenoh, zenoh};
    use zenoh::{Session, Wait};

    fn free() -> std::net::SocketAddr {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        listener.local_addr().unwrap()
    }

    /// A session that listens at the place, or connects to it.
    fn session(mode: &str, place: std::net::SocketAddr, listens: bool) -> Session {
        let mut config = zenoh::Config::default();
        let way = if listens {
            "listen/endpoints"
        } else {
            "connect/endpoints"
        };
        let settings = [
            ("mode", format!("\"{mode}\"")),
            ("scouting/multicast/enabled", "false".to_owned()),
            ("listen/endpoints", "[]".to_owned()),
            (way, format!("[\"tcp/{place}\"]")),
        ];
        settings
            .iter()
            .for_each(|(name, value)| config.insert_json5(name, value).unwrap());
        zenoh::open(config).wait().unwrap()
    }

    #[test]
    fn same_estimates_over_zenoh() {
        let place = free();
        // The centre's session listens, those of the sensors connect to it: no router.
        let (centre, sensors) = (session("peer", place, true), [(); 2].map(|()| session("peer", place, false)));
        assert_as_over_udp(|fleet, sensor| match sensor {
            None => Zenoh::centre(centre.clone(), fleet).unwrap(),
            Some(number) => Zenoh::sensor(sensors[number as usize % 2].clone(), fleet, number).unwrap(),
        });
    }

    /// Every centre has a session of its own, as on another machine; a router is between them and the sensors.
    #[test]
    fn a_part_of_a_fleet_moves_over_zenoh() {
        let place = free();
        let _router = session("router", place, true);
        let sensors = session("client", place, false);
        assert_moved(|fleet, sensor| match sensor {
            None => Zenoh::centre(session("client", place, false), fleet).unwrap(),
            Some(number) => Zenoh::sensor(sensors.clone(), fleet, number).unwrap(),
        });
    }
}
