//! A leak in rooms.

use fewbits_tracking::{Error, Instant, LeakTracker, RoomSensor, Rooms};

fn rooms() -> Rooms {
    let sensor = |name: &str, x: f64| RoomSensor {
        name: name.to_owned(),
        place: [x, 1.5],
        noise: 0.02,
        thresholds: Vec::new(),
    };
    Rooms {
        plan: "#########\n#aaa#bbb#\n#aaa#bbb#\n#aaa.bbb#\n#########\na = left\nb = right\n".to_owned(),
        square: 1.0,
        split: 1,
        height: 2.5,
        diffusivity: 0.05,
        flow: 0.0,
        decay: 0.0,
        background: 0.0,
        rate: [0.001, 10.0],
        start: None,
        model_error: 0.1,
        faults: 0.001,
        sensor: vec![sensor("one", 2.5), sensor("two", 6.5)],
    }
}

/// Only the left sensor smells anything.
fn table() -> Vec<Instant> {
    let row = |k: u32| {
        let seconds = 30.0 * f64::from(k);
        Instant::new(u64::from(k) + 1, seconds, &[Some(0.01 * f64::from(k)), Some(0.0)])
    };
    (0..20).map(row).collect()
}

#[test]
fn the_room_of_a_leak_is_that_of_the_sensor_that_smells_it() {
    let (names, rows) = (["one", "two"].map(str::to_owned), table());
    let mut tracker = LeakTracker::new(&rooms(), &names, rows[19].seconds).unwrap();
    rows.iter().for_each(|row| tracker.step(row).unwrap());
    let found = tracker.estimate().unwrap();
    let sum: f64 = found.rooms.iter().map(|(_, p)| p).sum();
    assert!(
        (sum - 1.0).abs() < 1e-9 && found.rooms[0].0 == "left" && found.rooms[0].1 > 0.9,
        "{:?}",
        found.rooms
    );
    let summary = tracker.finish(0).unwrap();
    assert_eq!((summary.rows, summary.readings), (20, 40));
}

#[test]
fn refused_reading_leaves_the_belief_as_it_was() {
    let (names, rows) = (["one", "two"].map(str::to_owned), table());
    let mut words = rooms();
    words.sensor[1].thresholds = vec![0.1];
    let mut tracker = LeakTracker::new(&words, &names, rows[19].seconds).unwrap();
    rows[..10].iter().for_each(|row| tracker.step(row).unwrap());
    let before = tracker.estimate().unwrap();
    let wrong = Instant::new(11, 300.0, &[Some(0.1), Some(0.5)]);
    assert!(matches!(tracker.step(&wrong), Err(Error::Row { row: 11, .. })));
    assert_eq!((tracker.estimate().unwrap(), tracker.readings()), (before, 20));
}

#[test]
fn rooms_out_of_range_are_refused() {
    let mut wrong = rooms();
    wrong.sensor[1].name = "one".to_owned();
    assert!(matches!(wrong.check(), Err(Error::Rooms { .. })));
    let unknown = LeakTracker::new(&rooms(), &["three".to_owned()], 60.0).err();
    assert!(matches!(unknown, Some(Error::Unknown { name }) if name == "three"));
}
