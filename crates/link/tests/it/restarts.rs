//! States on disk, restarts, replays, new keys, clocks that were ahead.

use crate::world::{Reports, key, peers, receiver, settings};
use fewbits_core::{BitString, Observation};
use fewbits_link::{
    Counts, Direction, Error, Key, Output, Peer, Request, SensorLink, Start, Station, Step, Store, require_private,
};
use fewbits_protocol::{Feedback, Receiver, SensorSettings};
use std::net::SocketAddr;
use std::path::Path;

const SECOND: u64 = 1_000_000_000;

fn at(port: u16) -> SocketAddr {
    ([127, 0, 0, 1], port).into()
}

fn mode(path: &Path) -> u32 {
    std::os::unix::fs::PermissionsExt::mode(&std::fs::metadata(path).unwrap().permissions()) & 0o777
}

type One = Station<Box<dyn Receiver>>;

fn station_of(start: Start, known: Vec<Peer>, store: Option<Store>) -> Result<One, Error> {
    let (settings, receiver) = (settings(Reports::Signs, SECOND, 10), receiver(Reports::Signs, 0.05));
    Station::starting(start, settings, receiver, known, store)
}

fn station(store: Option<Store>) -> One {
    station_of(Start::Continue, peers(10), store).unwrap()
}

fn sensor(number: u32, key: Key, store: Option<Store>) -> SensorLink {
    SensorLink::new(SensorSettings::new(Feedback::Told), number, key, store).unwrap()
}

fn hello(link: &mut SensorLink) -> Vec<u8> {
    match link.hello().unwrap() {
        Request::Datagram(bytes) => bytes,
        other => panic!("{other:?}"),
    }
}

type Datagrams = Vec<(SocketAddr, Vec<u8>)>;

/// What the station does at a time: its datagrams by address, and its steps.
fn turn(station: &mut One, now: u64) -> (Datagrams, Vec<Step>, Vec<Output>) {
    let mut outputs = Vec::new();
    station.on_time(now, &mut outputs).unwrap();
    let (mut datagrams, mut steps, mut others) = (Vec::new(), Vec::new(), Vec::new());
    for output in outputs {
        match output {
            Output::Datagram { to, bytes } => datagrams.push((to, bytes)),
            Output::Step(step) => steps.push(step),
            other => others.push(other),
        }
    }
    (datagrams, steps, others)
}

/// The sensor's answer to a datagram: its report of one bit.
fn answer(link: &mut SensorLink, datagram: &[u8]) -> Option<Vec<u8>> {
    let mut requests = Vec::new();
    link.on_datagram(0, datagram, &mut requests).unwrap();
    let asked = requests.iter().any(|request| matches!(request, Request::Sample { .. }));
    if !asked {
        return None;
    }
    let mut requests = Vec::new();
    let bit = BitString::from_bytes(vec![0x80], 1).unwrap();
    link.on_sample(0, Some(&bit), &mut requests).unwrap();
    requests.into_iter().find_map(|request| match request {
        Request::Datagram(bytes) => Some(bytes),
        _ => None,
    })
}

/// Gives the station a datagram; returns what it sends at once.
fn give(station: &mut One, from: SocketAddr, bytes: &[u8]) -> Vec<Output> {
    let mut outputs = Vec::new();
    station.on_datagram(from, bytes, &mut outputs).unwrap();
    outputs.retain(|output| matches!(output, Output::Datagram { .. }));
    outputs
}

/// Whether the sensor of this place reported in one slot that begins at `now`.
fn reports(station: &mut One, link: &mut SensorLink, from: SocketAddr, now: u64, place: usize) -> bool {
    let (datagrams, ..) = turn(station, now);
    for (to, bytes) in datagrams {
        if to == from
            && let Some(report) = answer(link, &bytes)
        {
            assert!(give(station, from, &report).is_empty());
        }
    }
    let (_, steps, _) = turn(station, now + SECOND * 9 / 10);
    matches!(steps[0].observed[place], Observation::Received(_))
}

#[test]
fn states_of_like_names_share_no_file_and_are_locked_and_private() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    // A process that was stopped while it wrote has left this.
    std::fs::write(path("node.1.new.77"), "half").unwrap();
    std::fs::write(path("node.1.new.of-mine"), "mine").unwrap();
    let one = Store::new(path("node.1")).durable().locked().unwrap();
    let two = Store::new(path("node.2")).locked().unwrap();
    // What was the next version of both may be anything, even a folder.
    std::fs::create_dir(path("node.new")).unwrap();
    one.save(&1).unwrap();
    two.save(&2).unwrap();
    assert_eq!((one.load::<u64>().unwrap(), two.load::<u64>().unwrap()), (Some(1), Some(2)));
    assert!(!path("node.1.new.77").exists() && path("node.1.new.of-mine").exists());
    assert_eq!(mode(&path("node.1")), 0o600);
    let refused = Store::new(path("node.1")).locked().unwrap_err();
    assert!(matches!(refused, Error::Locked { .. }), "{refused}");
    // A copy holds the state as long as it lives.
    let copy = one.clone();
    drop(one);
    assert!(Store::new(path("node.1")).locked().is_err());
    drop(copy);
    Store::new(path("node.1")).locked().unwrap();
    // Wider rights are refused, with what mends them.
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(path("node.2"), std::fs::Permissions::from_mode(0o640)).unwrap();
    let refused = two.load::<u64>().unwrap_err().to_string();
    assert!(refused.contains("chmod 600") && refused.contains("node.2"), "{refused}");
    std::fs::set_permissions(path("node.2"), std::fs::Permissions::from_mode(0o400)).unwrap();
    require_private(&path("node.2")).unwrap();
}

#[test]
fn second_process_on_one_state_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let store = |name: &str| Some(Store::new(folder.path().join(name)));
    let first = station(store("centre"));
    assert!(matches!(station_of(Start::Continue, peers(10), store("centre")), Err(Error::Locked { .. })));
    drop(first);
    station(store("centre"));
    let _sensor = sensor(3, key(3), store("sensor"));
    let again = SensorLink::new(SensorSettings::new(Feedback::Told), 3, key(3), store("sensor"));
    assert!(matches!(again, Err(Error::Locked { .. })));
}

#[test]
fn restarted_sensor_refuses_old_questions() {
    let folder = tempfile::tempdir().unwrap();
    let store = || Some(Store::new(folder.path().join("sensor")));
    let mut centre = station(None);
    let mut link = sensor(3, key(3), store());
    give(&mut centre, at(3), &hello(&mut link));
    let mut recorded = Vec::new();
    for slot in 1..=5 {
        let (datagrams, ..) = turn(&mut centre, slot * SECOND);
        for (_, bytes) in datagrams {
            assert!(answer(&mut link, &bytes).is_some());
            recorded.push(bytes);
        }
    }
    assert_eq!(recorded.len(), 5);
    for _ in 0..3 {
        drop(link);
        link = sensor(3, key(3), store());
        for old in &recorded {
            assert!(answer(&mut link, old).is_none());
        }
        assert_eq!(link.counts().replayed, 5);
    }
    // It answers the next question, and its own counters are new.
    assert!(reports(&mut centre, &mut link, at(3), 6 * SECOND, 3));
    assert_eq!(
        centre.counts(),
        Counts {
            taken: 2,
            ..Counts::default()
        }
    );
}

#[test]
fn new_key_works_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let store = || Some(Store::new(folder.path().join("centre")));
    let mut centre = station(store());
    let mut link = sensor(3, key(3), None);
    for slot in 1..=5 {
        give(&mut centre, at(3), &hello(&mut link));
        assert!(reports(&mut centre, &mut link, at(3), slot * SECOND, 3));
    }
    drop(centre);
    // The sensor lost its state: under its old key it is taken for a replay, under a new one it is heard.
    let mut centre = station(store());
    let mut lost = sensor(3, key(3), None);
    assert!(!reports(&mut centre, &mut lost, at(3), 7 * SECOND, 3));
    drop(centre);
    let mut known = peers(10);
    known[3].key = key(77);
    let mut centre = station_of(Start::Continue, known, store()).unwrap();
    let mut link = sensor(3, key(77), None);
    for slot in 9..=40 {
        assert!(reports(&mut centre, &mut link, at(3), slot * SECOND, 3), "slot {slot}");
    }
    // The old key opens nothing.
    give(&mut centre, at(3), &hello(&mut lost));
    assert_eq!(centre.counts_of(3).forged, 1);
}

#[test]
fn one_key_for_two_sensors_is_refused() {
    let mut known = peers(10);
    known[4].key = key(3);
    let refused = station_of(Start::Continue, known, None).err().unwrap().to_string();
    assert!(refused.contains("sensor 3") && refused.contains("sensor 4"), "{refused}");
}

#[test]
fn copies_that_arrive_first_take_no_questions() {
    let mut centre = station(None);
    let mut link = sensor(3, key(3), None);
    give(&mut centre, at(3), &hello(&mut link));
    let mut asked = Vec::new();
    for slot in 1..=20 {
        let (datagrams, ..) = turn(&mut centre, slot * SECOND);
        asked.push(datagrams.len());
        let Some((_, question)) = datagrams.iter().find(|(to, _)| *to == at(3)) else {
            panic!("slot {slot}: the sensor was not asked, but {datagrams:?}");
        };
        let report = answer(&mut link, question).unwrap();
        // The thief copies every report, and his copy is faster.
        assert!(give(&mut centre, at(666), &report).is_empty());
        assert!(give(&mut centre, at(3), &report).is_empty());
    }
    assert!(asked.iter().all(|asked| *asked <= 2), "{asked:?}");
    // The sensor moves: it says where it is, answers there, and is then asked there only.
    for slot in 21..=23 {
        if slot == 21 {
            give(&mut centre, at(4), &hello(&mut link));
        }
        assert!(reports(&mut centre, &mut link, at(4), slot * SECOND, 3));
    }
    let (datagrams, ..) = turn(&mut centre, 24 * SECOND);
    assert_eq!(datagrams.iter().map(|(to, _)| *to).collect::<Vec<_>>(), [at(4)]);
}

#[test]
fn clock_that_was_ahead_is_reported_and_a_new_start_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let store = || Some(Store::new(folder.path().join("centre")));
    let day = 86_400 * SECOND;
    let mut centre = station(store());
    let mut link = sensor(3, key(3), None);
    give(&mut centre, at(3), &hello(&mut link));
    assert!(reports(&mut centre, &mut link, at(3), 10 * SECOND, 3));
    assert!(reports(&mut centre, &mut link, at(3), day, 3));
    // The clock is right again: no slot begins, and that is said, once a minute.
    let said = |outputs: &[Output]| {
        let waits = outputs.iter().filter_map(|output| match output {
            Output::ClockBehind { wait } => Some(*wait),
            _ => None,
        });
        waits.collect::<Vec<_>>()
    };
    let (_, steps, others) = turn(&mut centre, 12 * SECOND);
    assert!(steps.is_empty());
    assert_eq!(said(&others), [day + SECOND - 12 * SECOND]);
    assert!((13..60).all(|t| said(&turn(&mut centre, t * SECOND).2).is_empty()));
    assert_eq!(said(&turn(&mut centre, 72 * SECOND).2).len(), 1);
    // Started again it says so too.
    drop(centre);
    let mut centre = station(store());
    assert_eq!(said(&turn(&mut centre, 80 * SECOND).2).len(), 1);
    drop(centre);
    // A new start goes on at once with the same sensor, which was never stopped, and refuses what was accepted before.
    let old = hello(&mut link);
    let mut centre = station_of(Start::Anew, peers(10), store()).unwrap();
    assert!(reports(&mut centre, &mut link, at(3), 90 * SECOND, 3));
    give(&mut centre, at(3), &old);
    let mut recorded = centre.counts();
    assert_eq!((recorded.taken, recorded.forged), (2, 0));
    give(&mut centre, at(3), &old);
    recorded.replayed += 1;
    assert_eq!(centre.counts(), recorded);
    assert!((91..100).all(|t| reports(&mut centre, &mut link, at(3), t * SECOND, 3)));
    // With other sensors it may begin anew too.
    drop(centre);
    let mut more = peers(10);
    more[9].number = 99;
    more[9].key = key(99);
    let refused = station_of(Start::Continue, more.clone(), store())
        .err()
        .unwrap()
        .to_string();
    assert!(refused.contains("new start"), "{refused}");
    let mut centre = station_of(Start::Anew, more, store()).unwrap();
    assert!(reports(&mut centre, &mut link, at(3), 120 * SECOND, 3));
}

#[test]
fn slots_pass_while_the_state_cannot_be_stored() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let mut centre = station(Some(Store::new(inner.join("centre"))));
    let mut link = sensor(3, key(3), None);
    give(&mut centre, at(3), &hello(&mut link));
    let (datagrams, ..) = turn(&mut centre, SECOND);
    let report = answer(&mut link, &datagrams[0].1).unwrap();
    give(&mut centre, at(3), &report);
    // The disk goes away before the step is stored: it is not published.
    std::fs::rename(&inner, folder.path().join("away")).unwrap();
    let (_, steps, others) = turn(&mut centre, SECOND * 19 / 10);
    assert!(steps.is_empty() && matches!(&others[0], Output::Passed { reason, .. } if reason.contains("store")));
    let (datagrams, steps, others) = turn(&mut centre, 2 * SECOND);
    assert!(datagrams.is_empty() && steps.is_empty() && others.len() == 1);
    // It comes back: the step is published once, and slots go on.
    std::fs::rename(folder.path().join("away"), &inner).unwrap();
    let (datagrams, steps, _) = turn(&mut centre, 3 * SECOND);
    assert_eq!((datagrams.len(), steps.len(), steps[0].slot), (1, 1, 1));
    assert!(matches!(steps[0].observed[3], Observation::Received(_)));
    assert!(reports(&mut centre, &mut link, at(3), 4 * SECOND, 3));
}

#[test]
fn state_of_the_first_format_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sensor");
    Store::new(&path).save(&8192_u64).unwrap();
    let mut link = sensor(3, key(3), Some(Store::new(&path)));
    let (counter, _) = key(3).open(Direction::ToCentre, &hello(&mut link)).unwrap();
    assert_eq!(counter, 8193);
}

#[test]
fn estimator_state_goes_on_and_other_forms_are_refused() {
    use crate::world::{Reports, mixed};
    use fewbits_protocol::Receiver;
    let mut before = mixed(Reports::Signs, 0.05);
    before.predict(5).unwrap();
    let compact = before.state().unwrap();
    let mut again = mixed(Reports::Signs, 0.05);
    again.restore(&compact).unwrap();
    assert_eq!((again.state().unwrap(), again.estimate()), (compact.clone(), before.estimate()));
    let cut = BitString::from_bytes(compact.bytes()[..9].to_vec(), 72).unwrap();
    assert!(again.restore(&cut).is_err() && again.state().unwrap() == compact);
    let json = serde_json::to_vec(&(Some(4_u64), 5_u64, before.centre().state())).unwrap();
    let bits = 8 * json.len();
    let refused = again.restore(&BitString::from_bytes(json, bits).unwrap()).unwrap_err();
    assert!(refused.to_string().contains("another version") && again.state().unwrap() == compact);
}
