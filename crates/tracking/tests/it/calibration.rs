//! Calibration.

use crate::{Normal, rows, tracked, walk};
use fewbits_filters::fit::Quantity;
use fewbits_tracking::{CalibrationOptions, Error, Instant, Instants, LevelOptions, Request, calibrate};

const NOISES: [f64; 2] = [0.3, 0.6];
const OFFSET: f64 = 1.5;
const CHANGE: f64 = 0.2;

fn table(count: usize) -> Vec<Instant> {
    let mut normal = Normal(11);
    let level = walk(&mut normal, count, CHANGE);
    let mut read = |level: f64, sensor: usize| Some(level + sensor as f64 * OFFSET + NOISES[sensor] * normal.next());
    rows(level.iter().map(|level| vec![read(*level, 0), read(*level, 1)]))
}

fn of_first() -> CalibrationOptions {
    CalibrationOptions {
        request: Request {
            reference: Some(0),
            ..Request::default()
        },
        ..CalibrationOptions::default()
    }
}

#[test]
fn noises_offset_and_change_are_found() {
    let names = ["a", "b"].map(str::to_owned);
    let found = calibrate(&of_first(), &names, &table(1500)).unwrap();
    for (quantity, truth) in [
        (Quantity::Noise(0), NOISES[0]),
        (Quantity::Noise(1), NOISES[1]),
        (Quantity::Bias(1), OFFSET),
        (Quantity::Change, CHANGE),
    ] {
        let one = found.fit.estimates.iter().find(|one| one.quantity == quantity).unwrap();
        let off = (one.value - truth) / one.standard_error;
        assert!(off.abs() < 4.0 && one.standard_error < 0.1 * truth, "{quantity:?}: {one:?}");
    }
    let stored = &found.calibration;
    assert_eq!((stored.relative_to.as_str(), stored.sensors[1].name.as_str()), ("a", "b"));
}

#[test]
fn calibration_states_noises_change_and_offsets_of_a_level() {
    let (names, table) = (["a", "b"].map(str::to_owned), table(1000));
    let found = calibrate(&of_first(), &names, &table).unwrap().calibration;
    let mut options = LevelOptions::default();
    let corrections = found.apply(&mut options, &names);
    assert_eq!(options.change, Some((found.change, 1.0)));
    let rows = Instants::listed(names, table).corrected(corrections, None);
    let (_, summary) = tracked(&options, rows);
    for (sensor, known) in summary.sensors.iter().zip(&found.sensors) {
        assert!((sensor.noise - known.noise()).abs() < 1e-12 && sensor.used, "{}", sensor.name);
    }
}

#[test]
fn reading_that_is_no_bit_is_refused_with_its_row() {
    let names = ["a", "b"].map(str::to_owned);
    let options = CalibrationOptions {
        bits: vec![1],
        ..of_first()
    };
    let refused = calibrate(&options, &names, &table(100)).unwrap_err();
    assert!(matches!(refused, Error::Content { row: 1, .. }), "{refused}");
}
