//! The same scenario over UDP through a lossy relay, without any network, and in the simulator: the same estimates for the same losses.

use crate::world::{Record, Reports, SENSORS, assert_replayed, key, measurement, node, peers, receiver, settings};
use fewbits_core::BitString;
use fewbits_link::{
    Datagram, Direction, Output, Program, SensorLink, Station, Step, Transport, Udp, run_sensor, run_station,
};
use fewbits_protocol::{Check, Feedback, Frame, Kind, Payload, SensorSettings, Slot, digest};
use std::collections::{HashSet, VecDeque};
use std::net::UdpSocket;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Slot and number of the sensors that were asked: those whose question was not lost.
pub type Asked = Arc<Mutex<HashSet<(u32, u32)>>>;

/// A sensor's program: measures as the world says.
pub struct Measuring {
    pub number: u32,
    pub node: Box<dyn fewbits_core::SensorNode<1> + Send>,
    pub stop: Arc<AtomicBool>,
    pub asked: Asked,
}

impl Program for Measuring {
    fn sample(&mut self, slot: Slot, feedback: &BitString) -> ControlFlow<(), Option<BitString>> {
        let mut rng = fewbits_monte_carlo::Stream::new(9).rng();
        let sample = measurement(self.number, slot.number());
        self.asked.lock().unwrap().insert((slot.number(), self.number));
        ControlFlow::Continue(self.node.report(&mut rng, &sample, feedback).unwrap_or(None))
    }
    fn goes_on(&mut self) -> bool {
        !self.stop.load(Ordering::Relaxed)
    }
}

/// Starts the ten sensors. They stop with `stop`.
pub fn sensors(
    reports: Reports,
    centre: std::net::SocketAddr,
    stop: &Arc<AtomicBool>,
    asked: &Asked,
) -> Vec<std::thread::JoinHandle<()>> {
    (0..reports.sensors())
        .map(|number| {
            let (stop, asked) = (stop.clone(), asked.clone());
            std::thread::spawn(move || {
                let mut socket = Udp::bind("127.0.0.1:0").unwrap();
                let mut link = SensorLink::new(SensorSettings::new(Feedback::Told), number, key(number), None).unwrap();
                let mut program = Measuring {
                    number,
                    node: node(reports),
                    stop,
                    asked,
                };
                run_sensor(&mut socket, &centre, &mut link, &mut program).unwrap();
            })
        })
        .collect()
}

/// Sensors speak to the relay, the relay to the centre from one socket per sensor. It loses 5 % of the datagrams and holds back 1 % until the next.
fn relay(centre: std::net::SocketAddr, stop: Arc<AtomicBool>) -> (std::net::SocketAddr, std::thread::JoinHandle<u32>) {
    let inside = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = inside.local_addr().unwrap();
    let thread = std::thread::spawn(move || {
        inside.set_nonblocking(true).unwrap();
        let mut outside: Vec<(std::net::SocketAddr, UdpSocket)> = Vec::new();
        let (mut state, mut lost, mut held) = (7_u64, 0, None::<(usize, bool, Vec<u8>)>);
        let mut buffer = [0; 2048];
        while !stop.load(Ordering::Relaxed) {
            let mut arrived = Vec::new();
            while let Ok((length, from)) = inside.recv_from(&mut buffer) {
                let known = outside.iter().position(|(address, _)| *address == from);
                let i = known.unwrap_or_else(|| {
                    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
                    socket.connect(centre).unwrap();
                    socket.set_nonblocking(true).unwrap();
                    outside.push((from, socket));
                    outside.len() - 1
                });
                arrived.push((i, true, buffer[..length].to_vec()));
            }
            for (i, (_, socket)) in outside.iter().enumerate() {
                while let Ok(length) = socket.recv(&mut buffer) {
                    arrived.push((i, false, buffer[..length].to_vec()));
                }
            }
            if arrived.is_empty() {
                std::thread::sleep(Duration::from_micros(200));
            }
            for datagram in arrived {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                match (state >> 33) % 100 {
                    0..5 => lost += 1,
                    5 if held.is_none() => held = Some(datagram),
                    _ => {
                        for (i, up, bytes) in std::iter::once(datagram).chain(held.take()) {
                            let _ = if up {
                                outside[i].1.send(&bytes)
                            } else {
                                inside.send_to(&bytes, outside[i].0)
                            };
                        }
                    }
                }
            }
        }
        lost
    });
    (address, thread)
}

/// How many times as many slots as planned a run may take.
const MAX_LONGER: usize = 20;

/// Number of reports that were received.
fn received(steps: &[Step]) -> usize {
    let all = steps.iter().flat_map(|step| &step.observed);
    all.filter(|o| matches!(o, fewbits_core::Observation::Received(_)))
        .count()
}

fn over_udp(reports: Reports, steps: usize) {
    let mut socket = Udp::bind("127.0.0.1:0").unwrap();
    let centre = socket.address();
    let stop = Arc::new(AtomicBool::new(false));
    let (relay, lossy) = relay(centre, stop.clone());
    let asked = Asked::default();
    let threads = sensors(reports, relay, &stop, &asked);
    let (loss, count) = (1.0 - 0.94_f64.powi(2), reports.sensors());
    let settings = settings(reports, 30_000_000, count as usize);
    let mut station = Station::new(settings, receiver(reports, loss), peers(count), None).unwrap();
    // All sensors have said where they are before the first slot.
    let mut known = HashSet::new();
    while known.len() < count as usize {
        let (from, bytes) = socket.receive(Duration::from_secs(60)).unwrap().unwrap();
        station.on_datagram(from, bytes, &mut Vec::new()).unwrap();
        known.insert(from);
    }
    let mut records: Vec<Step> = Vec::new();
    run_station(&mut socket, &mut station, |_, outputs| {
        for output in outputs {
            if let Output::Step(step) = output {
                assert!(step.asked.iter().all(|asked| *asked));
                records.push(step.clone());
            }
        }
        // On a busy machine few reports come in time: go on until there are enough of them to compare.
        if records.len() < steps || received(&records) <= steps && records.len() < MAX_LONGER * steps {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    })
    .unwrap();
    stop.store(true, Ordering::Relaxed);
    for thread in threads {
        thread.join().unwrap();
    }
    let lost = lossy.join().unwrap();
    let received = received(&records);
    println!("{reports:?}: {received} of {} reports, {lost} datagrams lost", count as usize * records.len());
    assert!(lost > 0 && received > steps, "{lost} lost, {received} received");
    assert_replayed(&mut *receiver(reports, loss), &records);
    let asked = Arc::new(asked.lock().unwrap().clone());
    let records: Vec<Record> = records
        .into_iter()
        .map(|step| (step.slot, step.observed, step.estimate))
        .collect();
    without_a_network(reports, loss, &records, &asked);
    simulated(reports, loss, records, asked);
}

/// The simulated network with the losses that were recorded. Its slots are consecutive: compared up to the first that the real centre slept through.
fn simulated(reports: Reports, loss: f64, records: Vec<Record>, asked: Arc<HashSet<(u32, u32)>>) {
    use fewbits_network::{BitStar, Clock, Field, Instant, Measurements, Radio, Seconds, Setup};
    let first = records[0].0;
    let records: Vec<Record> = (first..)
        .zip(records)
        .take_while(|(slot, record)| *slot == record.0)
        .map(|(_, record)| record)
        .collect();
    let (slots, stream) = (records.len() as u32, fewbits_monte_carlo::Stream::new(5));
    let number = move |slot: u32| Slot::of_count(first + u64::from(slot) - 1).number();
    // Who was not asked in a slot does not measure in it: a codec with memory must not know of it.
    let measured = Measurements::from_fn(slots, move |slot, sensor| {
        let (slot, sensor) = (number(slot), sensor as u32);
        asked.contains(&(slot, sensor)).then(|| measurement(sensor, slot))
    });
    let clock = Clock::new(Seconds::new(1.0).unwrap()).unwrap();
    let recorded: Vec<Vec<bool>> = records
        .iter()
        .map(|(_, observed, _)| {
            observed
                .iter()
                .map(|o| *o != fewbits_core::Observation::Nothing)
                .collect()
        })
        .collect();
    let report = settings(reports, 1, 1).members[0].report;
    let star = BitStar::new(
        move || Ok(receiver(reports, loss)),
        Feedback::Told,
        report,
        move |_| -> Box<dyn fewbits_core::SensorNode<1>> { node(reports) },
        measured,
        clock,
        stream,
    );
    let star = star
        .unwrap()
        .with_recorded_losses(move |slot, sensor| recorded[slot as usize - 1][sensor]);
    let setup = Setup::new(Radio::cc2420(0.0).unwrap(), stream);
    let mut network = star
        .simulate_on(Field::star(reports.sensors() as usize, 10.0).unwrap(), setup)
        .unwrap();
    network
        .run_until(Instant(u64::from(slots + 1) * 1_000_000_000))
        .unwrap();
    let estimates = network.nodes()[0].estimates();
    println!("{reports:?}: {slots} slots simulated, {} bits of payload", network.ledger().sum().payload.0);
    assert_eq!(estimates.len(), records.len());
    for ((_, simulated), (slot, _, estimate)) in estimates.iter().zip(&records) {
        assert_eq!(simulated, estimate, "slot {slot}");
    }
}

/// The same machines in one thread, where what did not arrive over UDP does not arrive either.
fn without_a_network(reports: Reports, loss: f64, records: &[Record], asked: &HashSet<(u32, u32)>) {
    use fewbits_protocol::{Action, Centre, CentreTimer, Payload, Receiver, Recipient, Sensor, Task, update_or_drop};
    let count = reports.sensors() as usize;
    let mut centre = Centre::new(settings(reports, 1, count));
    let mut filter = receiver(reports, loss);
    let mut sensors: Vec<_> = (0..count)
        .map(|_| (Sensor::new(SensorSettings::new(Feedback::Told)), node(reports)))
        .collect();
    let mut rng = fewbits_monte_carlo::Stream::new(9).rng();
    for (slot, observed, estimate) in records {
        let mut actions = Vec::new();
        centre.on_timer(*slot, CentreTimer::SlotBegins, &mut actions);
        assert!(actions.contains(&Action::Predict { slot: *slot }));
        filter.predict(*slot).unwrap();
        let feedback: Vec<_> = (0..count).map(|i| filter.feedback(i).unwrap()).collect();
        actions.clear();
        centre.on_predicted(&feedback, None, &mut actions);
        for action in std::mem::take(&mut actions) {
            let Action::Send { to, frame } = action else { continue };
            for (i, (sensor, node)) in sensors.iter_mut().enumerate() {
                let number = Slot::of_count(*slot).number();
                if to != Recipient::All && to != Recipient::Sensor(i) || !asked.contains(&(number, i as u32)) {
                    continue;
                }
                let Task::Sample { slot, feedback } = sensor.on_frame(0, &frame).task else {
                    panic!()
                };
                let sample = measurement(i as u32, slot.number());
                let report = node.report(&mut rng, &sample, &feedback.into()).unwrap();
                let Task::Send(frame) = sensor.on_sample(0, report.as_ref().map(Payload::from)).task else {
                    continue;
                };
                let mut bytes = vec![0; frame.len()];
                frame.encode(Check::Whole, &mut bytes).unwrap();
                // The recorded loss.
                if observed[i] != fewbits_core::Observation::Nothing {
                    centre.on_frame(i, &bytes, &mut actions);
                }
            }
        }
        assert!(actions.is_empty(), "{actions:?}");
        centre.on_timer(*slot, CentreTimer::Deadline, &mut actions);
        let Some(Action::Update {
            observed: simulated, ..
        }) = actions.pop()
        else {
            panic!()
        };
        assert_eq!(simulated, observed.iter().cloned().map(Some).collect::<Vec<_>>());
        update_or_drop(&mut filter, &simulated);
        assert_eq!(&filter.estimate(), estimate, "slot {slot}");
    }
}

#[test]
fn signs_over_udp_and_without_it() {
    over_udp(Reports::Signs, 60);
}

#[test]
fn censored_values_over_udp_and_without_it() {
    over_udp(Reports::Censored, 60);
}

#[test]
fn four_signs_that_are_counted_over_udp_and_without_it() {
    over_udp(Reports::Counted, 60);
}

#[test]
fn followed_signals_over_udp_and_without_it() {
    over_udp(Reports::Followed, 60);
}

#[test]
fn sensors_that_are_not_reached_are_not_asked() {
    use fewbits_protocol::Receiver;
    // Censoring sensors, whose silence would say much.
    let reports = Reports::Censored;
    let mut station = Station::new(settings(reports, 10, 10), receiver(reports, 0.05), peers(SENSORS), None).unwrap();
    let (mut alone, mut outputs) = (receiver(reports, 0.05), Vec::new());
    for slot in 1..=5 {
        station.on_time(10 * slot, &mut outputs).unwrap();
        station.on_time(10 * slot + 9, &mut outputs).unwrap();
        alone.predict(slot).unwrap();
        let Some(Output::Step(step)) = outputs.pop() else {
            panic!()
        };
        assert_eq!((step.asked, step.estimate), (vec![false; 10], alone.estimate()));
    }
}

/// Datagrams that have all arrived before the sensor reads the first.
struct Arrived {
    datagrams: VecDeque<Vec<u8>>,
    read: Vec<u8>,
    sent: Vec<Vec<u8>>,
}

impl Transport for Arrived {
    type Address = u32;

    fn send(&mut self, _: &u32, bytes: &[u8]) {
        self.sent.push(bytes.to_vec());
    }

    fn receive(&mut self, _: Duration) -> Result<Option<Datagram<'_, u32>>, fewbits_link::Error> {
        let Some(next) = self.datagrams.pop_front() else {
            return Ok(None);
        };
        self.read = next;
        Ok(Some((0, &self.read)))
    }
}

/// Measures the number of the slot, for some rounds.
struct Numbers(usize);

impl Program for Numbers {
    fn sample(&mut self, slot: Slot, _: &BitString) -> ControlFlow<(), Option<BitString>> {
        ControlFlow::Continue(Some(BitString::from_bytes(vec![slot.number() as u8], 8).unwrap()))
    }
    fn goes_on(&mut self) -> bool {
        self.0 = self.0.saturating_sub(1);
        self.0 > 0
    }
}

#[test]
fn questions_that_wait_are_answered_in_turn() {
    let questions = (1..=3).map(|count| {
        let slot = Slot::of_count(count);
        let frame = Frame::new(Kind::Feedback, slot, digest(slot, Payload::EMPTY), Payload::EMPTY);
        key(0).seal(Direction::ToSensor, 0, count, &frame.to_bytes(Check::Whole))
    });
    let mut transport = Arrived {
        datagrams: questions.collect(),
        read: Vec::new(),
        sent: Vec::new(),
    };
    let mut link = SensorLink::new(SensorSettings::new(Feedback::Told), 0, key(0), None).unwrap();
    run_sensor(&mut transport, &0, &mut link, &mut Numbers(10)).unwrap();
    let mut reported = Vec::new();
    for envelope in &transport.sent {
        let (_, bytes) = key(0).open(Direction::ToCentre, envelope).unwrap();
        let frame = Frame::decode(bytes, Check::Whole).unwrap();
        if frame.kind == Kind::Report {
            reported.push((frame.slot.number(), frame.payload.bytes().to_vec()));
        }
    }
    assert_eq!(reported, [(1, vec![1]), (2, vec![2]), (3, vec![3])]);
}
