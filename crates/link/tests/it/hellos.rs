//! Heartbeats of sensors that are not asked yet, and slots that begin too late.

use crate::world::{Reports, key, measurement, node, peers, receiver, settings};
use fewbits_core::{BitString, Observation, SensorNode};
use fewbits_link::{
    Direction, Output, Program, Request, SensorLink, Start, Station, Store, Udp, run_sensor, run_station,
};
use fewbits_monte_carlo::Stream;
use fewbits_protocol::{Feedback, Note, Receiver, SensorSettings, Slot};
use std::collections::HashSet;
use std::net::SocketAddr;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

const HOUR: u64 = 3_600_000_000_000;

type One = Station<Box<dyn Receiver>>;

fn station(period: u64, store: Option<Store>) -> One {
    let receiver = receiver(Reports::Signs, 0.05);
    Station::starting(Start::Continue, settings(Reports::Signs, period, 10), receiver, peers(10), store).unwrap()
}

fn sensor() -> SensorLink {
    SensorLink::new(SensorSettings::new(Feedback::Told), 3, key(3), None).unwrap()
}

fn hello(link: &mut SensorLink) -> Vec<u8> {
    match link.hello().unwrap() {
        Request::Datagram(bytes) => bytes,
        other => panic!("{other:?}"),
    }
}

/// The datagrams among the outputs of a call.
fn sent(call: impl FnOnce(&mut Vec<Output>)) -> Vec<(SocketAddr, Vec<u8>)> {
    let mut outputs = Vec::new();
    call(&mut outputs);
    let datagrams = outputs.into_iter().filter_map(|output| match output {
        Output::Datagram { to, bytes } => Some((to, bytes)),
        _ => None,
    });
    datagrams.collect()
}

/// A sensor of a centre with slots of an hour knows within a moment that it is heard. Counters of answers are new, also after a restart.
#[test]
fn hellos_are_answered_within_a_slot() {
    let folder = tempfile::tempdir().unwrap();
    let here: SocketAddr = ([127, 0, 0, 1], 3).into();
    let (mut link, mut counters) = (sensor(), HashSet::new());
    for life in 1..=3 {
        let mut centre = station(HOUR, Some(Store::new(folder.path().join("centre"))));
        // Which counters were used is known from its first slot on.
        let early = hello(&mut link);
        assert!(sent(|outputs| centre.on_datagram(here, &early, outputs).unwrap()).is_empty());
        let asked = sent(|outputs| centre.on_time(life * HOUR, outputs).unwrap());
        let answers = (0..5).flat_map(|_| {
            let bytes = hello(&mut link);
            sent(|outputs| centre.on_datagram(here, &bytes, outputs).unwrap())
        });
        let answers: Vec<_> = answers.collect();
        assert_eq!((asked.len(), answers.len()), (1, 5));
        for (to, bytes) in asked.iter().chain(&answers) {
            let (counter, _) = key(3).open(Direction::ToSensor, bytes).unwrap();
            assert!(*to == here && counters.insert(counter));
        }
        // The sensor takes them and does nothing more: it measures for questions.
        let before = link.counts().taken;
        for (_, bytes) in &answers {
            let mut requests = Vec::new();
            link.on_datagram(0, bytes, &mut requests).unwrap();
            assert!(requests.is_empty());
        }
        assert_eq!(link.counts().taken, before + 5);
        // Whoever repeats a hello, or has no key, gets nothing.
        let once = hello(&mut link);
        assert_eq!(sent(|outputs| centre.on_datagram(here, &once, outputs).unwrap()).len(), 1);
        let mut forged = hello(&mut link);
        forged[20] ^= 1;
        for bytes in [once, forged] {
            assert!(sent(|outputs| centre.on_datagram(here, &bytes, outputs).unwrap()).is_empty());
        }
        // One that has a key and never ends gets a limited number, so that counters for questions remain.
        let more = (0..2000).map(|_| hello(&mut link)).collect::<Vec<_>>();
        let count = |bytes: &Vec<u8>| sent(|outputs| centre.on_datagram(here, bytes, outputs).unwrap()).len();
        assert!((500..1100).contains(&more.iter().map(count).sum::<usize>()));
    }
}

/// A sensor that reports by the clock would set its clock by an answer in the middle of a slot.
#[test]
fn sensors_that_report_by_the_clock_are_not_answered() {
    let mut all = settings(Reports::Signs, HOUR, 10);
    all.members[3].feedback = Feedback::Clock;
    let mut centre = Station::new(all, receiver(Reports::Signs, 0.05), peers(10), None).unwrap();
    let (here, mut link) = (([127, 0, 0, 1], 3).into(), sensor());
    centre.on_time(HOUR, &mut Vec::new()).unwrap();
    let bytes = hello(&mut link);
    assert!(sent(|outputs| centre.on_datagram(here, &bytes, outputs).unwrap()).is_empty());
}

/// Defect: a centre that was started late in a slot asked when there was no time to answer, and took what did not come for silence.
#[test]
fn a_slot_that_begins_late_passes_and_is_no_silence() {
    const SECOND: u64 = 1_000_000_000;
    let (here, mut link) = (([127, 0, 0, 1], 3).into(), sensor());
    let mut centre = station(SECOND, None);
    let bytes = hello(&mut link);
    centre.on_datagram(here, &bytes, &mut Vec::new()).unwrap();
    // Started at .95 of a slot: nothing is asked, nothing observed, and the next slot begins in time.
    let mut outputs = Vec::new();
    centre.on_time(4 * SECOND + 950_000_000, &mut outputs).unwrap();
    assert!(outputs.is_empty() && centre.next_timer() == Some(5 * SECOND));
    centre.on_time(5 * SECOND, &mut outputs).unwrap();
    assert!(matches!(outputs[..], [Output::Datagram { .. }]));
    // Held up until .7 of the next: its step is published, and that slot 6 passes is said, with the reason.
    outputs.clear();
    centre.on_time(6 * SECOND + 700_000_000, &mut outputs).unwrap();
    let steps: Vec<u64> = outputs
        .iter()
        .filter_map(|o| match o {
            Output::Step(step) => Some(step.slot),
            _ => None,
        })
        .collect();
    let passed =
        |output: &Output| matches!(output, Output::Passed { slot: 6, reason } if reason.contains("0.700 s earlier"));
    assert!(steps == [5] && outputs.iter().any(passed), "{outputs:?}");
    assert!(outputs.iter().all(|output| !matches!(output, Output::Datagram { .. })));
    // A little late is in time.
    outputs.clear();
    centre.on_time(7 * SECOND + 300_000_000, &mut outputs).unwrap();
    assert!(matches!(outputs[..], [Output::Datagram { .. }]), "{outputs:?}");
    outputs.clear();
    centre.on_time(7 * SECOND + 900_000_000, &mut outputs).unwrap();
    assert!(matches!(&outputs[..], [Output::Step(step)] if step.asked[3] && step.observed[3] == Observation::Nothing));
}

/// Measures until it is told to stop.
struct Measuring {
    half: Box<dyn SensorNode<1> + Send>,
    stop: Arc<AtomicBool>,
    asked: Arc<AtomicUsize>,
}

impl Program for Measuring {
    fn sample(&mut self, slot: Slot, feedback: &BitString) -> ControlFlow<(), Option<BitString>> {
        self.asked.fetch_add(1, Ordering::Relaxed);
        let mut rng = Stream::new(u64::from(slot.number())).rng();
        ControlFlow::Continue(
            self.half
                .report(&mut rng, &measurement(3, slot.number()), feedback)
                .unwrap(),
        )
    }

    fn goes_on(&mut self) -> bool {
        !self.stop.load(Ordering::Relaxed)
    }
}

/// Whether a report comes of a sensor that is told `told` for the host of a centre that listens at `listens`.
fn reports_from(listens: &str, told: &str) -> bool {
    let mut socket = Udp::bind(format!("{listens}:0")).unwrap();
    let centre: SocketAddr = format!("{told}:{}", socket.address().port()).parse().unwrap();
    let stop = Arc::new(AtomicBool::new(false));
    let mut program = Measuring {
        half: node(Reports::Signs),
        stop: stop.clone(),
        asked: Arc::default(),
    };
    let asked = program.asked.clone();
    let thread = std::thread::spawn(move || {
        let mut own = Udp::bind(if centre.is_ipv6() { "[::]:0" } else { "0.0.0.0:0" }).unwrap();
        run_sensor(&mut own, &centre, &mut sensor(), &mut program).unwrap();
    });
    let mut station = station(50_000_000, None);
    let (began, mut heard) = (Instant::now(), false);
    run_station(&mut socket, &mut station, |_, outputs| {
        heard |= outputs
            .iter()
            .any(|output| matches!(output, Output::Step(step) if step.reports() > 0));
        match heard || began.elapsed() > Duration::from_secs(60) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    })
    .unwrap();
    stop.store(true, Ordering::Relaxed);
    thread.join().unwrap();
    assert!(!heard || asked.load(Ordering::Relaxed) > 0);
    heard
}

/// A centre at all addresses of its machine answers from another one than the sensor was told. Linux has all of 127.0.0.0/8.
#[cfg(target_os = "linux")]
#[test]
fn a_sensor_that_was_told_another_address_of_its_centre_is_asked() {
    assert!(reports_from("0.0.0.0", "127.0.0.2"));
    // A socket for both protocols, as most systems have it.
    match std::net::UdpSocket::bind("[::1]:0") {
        Ok(_) => assert!(reports_from("[::]", "[::1]") && reports_from("[::]", "127.0.0.3")),
        Err(_) => println!("skipped: this machine has no IPv6"),
    }
}

/// Files that say different schemes: both ends learn it from the first frame, however silent the sensor is, and again with each report. The
/// reports are of the right length, so nothing else would tell.
#[test]
fn both_ends_are_told_of_another_meaning() {
    let other = |output: &Output| match output {
        Output::Note {
            sensor: 3,
            note: Note::OtherMeaning { found, .. },
        } => Some(*found),
        _ => None,
    };
    for (here, there) in [(0, 0), (5, 5), (5, 0), (0, 6), (5, 6)] {
        let mut settings = settings(Reports::Signs, HOUR, 10);
        settings.meanings = vec![here; 10];
        let mut centre = Station::new(settings, receiver(Reports::Signs, 0.05), peers(10), None).unwrap();
        let mut own = SensorSettings::new(Feedback::Told);
        own.meaning = there;
        let mut link = SensorLink::new(own, 3, key(3), None).unwrap();
        let (address, mut sensor) = (SocketAddr::from(([127, 0, 0, 1], 3)), node(Reports::Signs));
        let (mut at_centre, mut at_sensor, mut used) = (0, 0, 0);
        let mut up = vec![hello(&mut link)];
        for slot in 1..=4 {
            let mut outputs = Vec::new();
            centre.on_time(slot * HOUR, &mut outputs).unwrap();
            for bytes in std::mem::take(&mut up) {
                centre.on_datagram(address, &bytes, &mut outputs).unwrap();
            }
            used += outputs
                .iter()
                .filter(|output| matches!(output, Output::Step(step) if step.reports() > 0))
                .count();
            for output in outputs {
                at_centre += other(&output).map_or(0, |found| {
                    assert_eq!(found, there);
                    1
                });
                let Output::Datagram { bytes, .. } = output else {
                    continue;
                };
                let mut requests = Vec::new();
                link.on_datagram(0, &bytes, &mut requests).unwrap();
                for request in std::mem::take(&mut requests) {
                    match request {
                        Request::Sample { feedback, .. } => {
                            let mut rng = Stream::new(slot).rng();
                            let report = sensor
                                .report(&mut rng, &measurement(3, slot as u32), &feedback)
                                .unwrap();
                            link.on_sample(0, report.as_ref(), &mut requests).unwrap();
                        }
                        Request::Note(Note::OtherMeaning { found, .. }) => {
                            assert_eq!(found, here);
                            at_sensor += 1;
                        }
                        _ => {}
                    }
                }
                up.extend(requests.into_iter().filter_map(|request| match request {
                    Request::Datagram(bytes) => Some(bytes),
                    _ => None,
                }));
                // A report belongs to the slot in which it was asked for.
                let mut answers = Vec::new();
                for bytes in std::mem::take(&mut up) {
                    centre.on_datagram(address, &bytes, &mut answers).unwrap();
                }
                for answer in answers {
                    at_centre += usize::from(other(&answer).is_some());
                    if let Output::Datagram { bytes, .. } = answer {
                        let mut notes = Vec::new();
                        link.on_datagram(0, &bytes, &mut notes).unwrap();
                        at_sensor += usize::from(
                            notes
                                .iter()
                                .any(|note| matches!(note, Request::Note(Note::OtherMeaning { .. }))),
                        );
                    }
                }
            }
        }
        let differ = here != 0 && there != 0 && here != there;
        // A centre that was told nothing takes it for an answer to another question.
        let is_used = here == there || there == 0;
        assert_eq!(
            (at_centre > 1, at_sensor > 1, used > 0),
            (differ, differ, is_used),
            "{here} {there}: {at_centre} {at_sensor} {used}"
        );
    }
}
