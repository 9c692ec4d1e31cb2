//! Odometry between ranges: a known displacement moves the place, and its error is estimated as the speed was.

use fewbits_monte_carlo::Stream;
use fewbits_pf_mpa::{RangeSettings, RangeTracker, Travel};
use nalgebra::Vector3;
use rand::RngExt;
use rand_distr::StandardNormal;

const PLACES: [[f64; 2]; 5] = [[0.0, 0.0], [14.0, 1.0], [13.0, 11.0], [1.0, 10.0], [7.0, 13.0]];

fn anchors() -> Vec<(String, Vector3<f64>)> {
    let named = |place: &[f64; 2]| (format!("{place:?}"), Vector3::new(place[0], place[1], 0.0));
    PLACES.iter().map(named).collect()
}

fn tracker() -> RangeTracker {
    RangeTracker::new(anchors(), Travel::Full, RangeSettings::default()).unwrap()
}

/// Rms error, and the share of coordinates in their bands, of a target that leaps by a metre along each axis, with one range a second. The
/// odometry is 3 % off and has noise of its own.
fn leaping(seed: u64, has_odometry: bool) -> (f64, f64) {
    let mut rng = Stream::new(seed).named("odometry").rng();
    let anchors = anchors();
    let mut tracker = tracker();
    let mut truth = Vector3::new(6.0, 6.0, 0.0);
    let (mut squares, mut held, mut rows) = (0.0, 0.0, 0.0);
    for k in 0..300 {
        let time = f64::from(k);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        // Pulled back, so that it stays among the anchors.
        let mut step = Vector3::new(normal(), normal(), 0.0);
        step -= 0.1 * (truth - Vector3::new(7.0, 6.0, 0.0));
        truth += step;
        let told = 1.03 * step + 0.02 * Vector3::new(normal(), normal(), 0.0);
        let noise = 0.1 * normal();
        if has_odometry {
            tracker.moved(time, &told).unwrap();
        }
        let (name, place) = &anchors[k as usize % anchors.len()];
        let Some(found) = tracker.push(time, name, (truth - place).norm() + noise).unwrap() else {
            continue;
        };
        squares += (found.position - truth).norm_squared();
        held += (0..2)
            .filter(|i| (found.bands[*i].0..=found.bands[*i].1).contains(&truth[*i]))
            .count() as f64;
        rows += 1.0;
    }
    assert!(rows > 250.0, "{rows}");
    (f64::sqrt(squares / rows), 0.5 * held / rows)
}

#[test]
fn odometry_follows_a_target_that_leaps() {
    for seed in 0..4 {
        let ((with, held), (without, _)) = (leaping(seed, true), leaping(seed, false));
        println!("{with:.3} with, held {held:.3}; {without:.3} without");
        assert!(with < 0.4 && with < 0.35 * without && held > 0.85, "seed {seed}: {with}, {held}, {without}");
    }
}

/// Up to the moment within an instant at which the filters of the bank exchange weight.
#[test]
fn no_displacement_changes_nothing() {
    let (mut one, mut other) = (tracker(), tracker());
    let (anchors, truth) = (anchors(), Vector3::new(4.0, 5.0, 0.0));
    let mut rng = Stream::new(3).named("still").rng();
    for k in 0..60 {
        let (name, place) = &anchors[k % anchors.len()];
        let range = (truth - place).norm() + 0.05 * rng.sample::<f64, _>(StandardNormal);
        let time = 0.3 * k as f64;
        let a = one.push(time, name, range).unwrap();
        other.moved(time, &Vector3::zeros()).unwrap();
        let b = other.push(time, name, range).unwrap();
        assert_eq!(a.is_some(), b.is_some());
        if let (Some(a), Some(b)) = (a, b) {
            let deviation = a.covariance.trace().sqrt();
            assert!((a.position - b.position).norm() < 0.05 * deviation, "{k}: {} {}", a.position, b.position);
            assert!((b.covariance.trace().sqrt() / deviation - 1.0).abs() < 0.05, "{k}");
        }
    }
}

#[test]
fn bad_displacements_are_refused_and_change_nothing() {
    let mut tracker = tracker();
    for (k, (name, place)) in anchors().iter().enumerate() {
        tracker
            .push(k as f64, name, (Vector3::new(4.0, 5.0, 0.0) - place).norm())
            .unwrap();
    }
    let before = tracker.moved(4.0, &Vector3::zeros()).unwrap().unwrap();
    assert!(tracker.moved(5.0, &Vector3::new(f64::NAN, 0.0, 0.0)).is_err());
    assert!(tracker.moved(3.0, &Vector3::zeros()).is_err());
    assert!(tracker.moved(f64::NAN, &Vector3::zeros()).is_err());
    assert_eq!(tracker.moved(4.0, &Vector3::zeros()).unwrap().unwrap(), before);
    let by = Vector3::new(2.0, -1.0, 0.0);
    let after = tracker.moved(4.0, &by).unwrap().unwrap();
    assert!((after.position - before.position - by).norm() < 1e-12);
}
