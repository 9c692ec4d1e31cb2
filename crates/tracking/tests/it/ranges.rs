//! A place from ranges.

use crate::{Normal, rows};
use fewbits_tracking::{Error, Instant, Instants, Mistake, RangesOptions, RangesTracker};
use nalgebra::Vector3;

const NAMES: [&str; 4] = ["a", "b", "c", "d"];
const NOISE: f64 = 0.1;

fn anchors() -> Vec<(String, Vector3<f64>)> {
    let places = [[0.0, 0.0], [10.0, 0.0], [10.0, 8.0], [0.0, 8.0]];
    let anchor = |(name, [x, y]): (&str, [f64; 2])| (name.to_owned(), Vector3::new(x, y, 0.0));
    NAMES.into_iter().zip(places).map(anchor).collect()
}

/// A target on an ellipse: its places, and its ranges.
fn table(count: usize) -> (Vec<Vector3<f64>>, Vec<Instant>) {
    let mut normal = Normal(5);
    let place = |k: usize| {
        let turn = 0.02 * k as f64;
        Vector3::new(5.0 + 3.0 * turn.cos(), 4.0 + 2.0 * turn.sin(), 0.0)
    };
    let places: Vec<Vector3<f64>> = (0..count).map(place).collect();
    let mut ranges = |place: &Vector3<f64>| {
        let range = |(_, anchor): (String, Vector3<f64>)| Some((anchor - place).norm() + NOISE * normal.next());
        anchors().into_iter().map(range).collect::<Vec<_>>()
    };
    let cells: Vec<_> = places.iter().map(&mut ranges).collect();
    (places, rows(cells))
}

#[test]
fn ranges_find_the_place() {
    let (places, table) = table(300);
    let mut rows = Instants::listed(NAMES, table);
    let mut tracker = RangesTracker::new(&RangesOptions::default(), &anchors(), &mut rows).unwrap();
    assert_eq!(tracker.coordinates(), 2);
    let (mut squares, mut count) = (0.0, 0.0);
    for place in &places {
        let instant = rows.next().unwrap().unwrap();
        let row = tracker.step(rows.names(), &instant).unwrap();
        if let Some(found) = row.estimate {
            squares += (found.position - place).norm_squared();
            count += 1.0;
        }
    }
    let summary = tracker.finish(&rows).unwrap();
    assert!((squares / count).sqrt() < 0.2 && count > 280.0, "{} of {count}", (squares / count).sqrt());
    assert_eq!((summary.rows, summary.ranges, summary.losses), (300, 1200, 0));
    assert!(summary.lines[0].starts_with("300 rows, 1200 ranges"), "{:?}", summary.lines);
}

#[test]
fn failed_step_of_ranges_leaves_the_tracker_as_it_was() {
    let table = table(120).1;
    let mut names: Vec<String> = NAMES.map(str::to_owned).to_vec();
    names.push("elsewhere".to_owned());
    let mut lists = [0; 2].map(|_| Instants::listed(NAMES, table.clone()));
    let [mut plain, mut tried] = lists
        .each_mut()
        .map(|rows| RangesTracker::new(&RangesOptions::default(), &anchors(), rows).unwrap());
    for (k, row) in table.iter().enumerate() {
        let mut wrong = row.clone();
        wrong.reports.push((4, Some(3.0)));
        wrong.reports[0].1 = Some(-1.0);
        assert!(matches!(tried.step(&names, &wrong), Err(Error::Unknown { name }) if name == "elsewhere"));
        assert_eq!(plain.step(&names, row).unwrap(), tried.step(&names, row).unwrap(), "row {k}");
    }
    let [one, other] = &lists;
    assert_eq!(plain.finish(one).unwrap(), tried.finish(other).unwrap());
}

#[test]
fn sensor_that_is_no_anchor_is_refused() {
    let table = rows(std::iter::repeat_n(vec![Some(3.0); 2], 20));
    let mut rows = Instants::listed(["a", "x"], table);
    let refused = RangesTracker::new(&RangesOptions::default(), &anchors(), &mut rows).err();
    assert!(matches!(refused, Some(Error::Unknown { name }) if name == "x"));
}

/// Ranges of places whose anchors the table exchanges may also look like those of a target that is higher.
#[test]
fn exchanged_anchors_are_no_height() {
    let places = [[0.7, 0.5], [14.0, 1.1], [12.7, 9.0], [-0.9, 9.4], [7.4, 1.3]].map(|[x, y]| Vector3::new(x, y, 0.0));
    let names = ["a", "b", "c", "d", "e"];
    let options = RangesOptions {
        looks_ahead: true,
        ..RangesOptions::default()
    };
    let mut heights = 0;
    for seed in [2, 4_u32] {
        let mut normal = Normal(u64::from(seed));
        let cells = |k: u32| {
            let turn = 0.002 * f64::from((seed + 3) * k);
            let target = Vector3::new(7.0 + 4.2 * turn.cos(), 4.9 + 2.8 * (1.37 * turn).sin(), 0.0);
            let range = |anchor: &Vector3<f64>| Some((anchor - target).norm() + 0.2 + NOISE * normal.next());
            places.iter().map(range).collect::<Vec<_>>()
        };
        let cells: Vec<_> = (0..300).map(cells).collect();
        let mut anchors: Vec<(String, Vector3<f64>)> = names.map(str::to_owned).into_iter().zip(places).collect();
        (anchors[1].1, anchors[4].1) = (places[4], places[1]);
        let mut rows = Instants::listed(names, rows(cells));
        let mut tracker = RangesTracker::new(&options, &anchors, &mut rows).unwrap();
        while let Some(instant) = rows.next().unwrap() {
            tracker.step(rows.names(), &instant).unwrap();
        }
        let summary = tracker.finish(&rows).unwrap();
        heights += usize::from(summary.hints.iter().any(|hint| hint.contains("higher or lower")));
        assert_eq!(summary.mistake, Some(Mistake::Swapped("b".to_owned(), "e".to_owned())), "{:?}", summary.hints);
    }
    assert_eq!(heights, 2, "these ranges look like those of a height too");
}
