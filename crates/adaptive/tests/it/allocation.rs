//! Neither half allocates.

use super::common::mixed;
use allocation_counter::measure;
use fewbits_adaptive::{Config, Receiver, Sensor};

#[test]
fn samples_and_reports_allocate_nothing() {
    assert!(size_of::<Sensor>() <= 4096);
    let line = Config::new(0.05).unwrap();
    for config in [line, line.circular(7.0).unwrap(), line.resilient(4, Some(100)).unwrap()] {
        let (mut sensor, mut receiver) = (Sensor::new(config), Receiver::new(config));
        let samples = mixed(9, 20_000);
        let mut one = |sample: f64| {
            let report = sensor.encode(sample).unwrap();
            receiver.receive(&report.map(|r| r.packet).into()).unwrap();
        };
        assert_eq!(measure(|| one(samples[0])).count_total, 0);
        let used = measure(|| {
            samples
                .iter()
                .chain(&[1e300, 1.0 / 3.0, 0.0])
                .for_each(|sample| one(*sample))
        });
        assert_eq!(used.count_total, 0);
        let stored = serde_json::to_string(&sensor).unwrap();
        let mut sensor: Sensor = serde_json::from_str(&stored).unwrap();
        let used = measure(|| {
            for sample in &samples {
                sensor.encode(*sample).unwrap();
            }
        });
        assert_eq!(used.count_total, 0);
    }
}
