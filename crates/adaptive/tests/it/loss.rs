//! Loss, restart, refresh.

use super::common::mixed;
use fewbits_adaptive::{Config, Receiver, Sensor};
use fewbits_core::{Link, Observation};
use fewbits_monte_carlo::Stream;

const DELTA: f64 = 0.05;

/// With a refresh every 50 slots, an error above delta ends at the next refresh that arrives, and is flagged from the first packet
/// after the loss.
#[test]
fn errors_after_a_loss_end_with_the_next_refresh() {
    let config = Config::new(DELTA).unwrap().resilient(4, Some(50)).unwrap();
    let link = Link::lossy(0.2).unwrap();
    for seed in 0..20 {
        let mut rng = Stream::new(seed).rng();
        let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
        let mut lost_since: Option<usize> = None;
        for (n, sample) in mixed(seed, 3000).into_iter().enumerate() {
            let report = sensor.encode(sample).unwrap();
            assert_eq!(n % 50 == 0, report.is_some_and(|r| r.refresh));
            let observation = link.transmit(&mut rng, report.map(|r| r.packet).as_ref(), &()).unwrap();
            let arrived = observation.received().is_some();
            if report.is_some() && !arrived {
                lost_since.get_or_insert(n);
            }
            if arrived && report.is_some_and(|r| r.refresh) {
                lost_since = None;
            }
            let tracked = receiver.receive(&observation).unwrap();
            if lost_since.is_none() {
                assert!(tracked.synchronised);
                assert!((tracked.value.unwrap() - sample).abs() <= DELTA);
            } else if arrived || n % 50 == 0 {
                assert!(!tracked.synchronised, "{seed} {n}");
            }
        }
    }
}

#[test]
fn a_receiver_joins_at_a_refresh_on_request() {
    let config = Config::new(DELTA).unwrap().resilient(8, None).unwrap();
    let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::joining(config));
    let samples = mixed(3, 400);
    for (n, sample) in samples.iter().enumerate() {
        if n == 200 {
            sensor.request_refresh();
        }
        let report = sensor.encode(*sample).unwrap();
        let observation = if n < 100 {
            Observation::Nothing
        } else {
            report.map(|r| r.packet).into()
        };
        let tracked = receiver.receive(&observation).unwrap();
        assert_eq!(tracked.synchronised, n >= 200);
        assert!(n < 200 || (tracked.value.unwrap() - sample).abs() <= DELTA);
    }
}

#[test]
fn what_is_known_to_be_lost_is_noticed_at_once() {
    let config = Config::new(DELTA).unwrap().resilient(2, Some(100)).unwrap();
    let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
    for (n, sample) in mixed(4, 300).into_iter().enumerate() {
        let report = sensor.encode(sample).unwrap().map(|r| r.packet);
        let observation = if n == 130 { Observation::Lost } else { report.into() };
        let tracked = receiver.receive(&observation).unwrap();
        assert_eq!(tracked.synchronised, !(130..200).contains(&n), "{n}");
    }
}
