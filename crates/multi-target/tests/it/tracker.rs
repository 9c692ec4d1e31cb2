//! The tracker against integration over the joint state, and against the printed association of two targets.

use fewbits_baselines::pf_mpa::association::{AssociationRule, update};
use fewbits_core::factor::{Factor, Levels, Scalar, Value};
use fewbits_core::{Cell, Dynamics, Gaussian, Observed, Sensing};
use fewbits_models::{Ar1, LinearSensor, constant_velocity_1d};
use fewbits_monte_carlo::Stream;
use fewbits_multi_target::{Birth, Error, Label, Report, Track, Tracker, Tracks};
use nalgebra::{Matrix2, Vector1, Vector2};
use rand::RngExt;

fn track(entrance: usize, existence: f64, mean: f64, variance: f64) -> Track<1> {
    Track {
        label: Label { born: 1, entrance },
        existence,
        belief: Gaussian::scalar(mean, variance).unwrap(),
    }
}

fn known(tracks: &[Track<1>]) -> Tracks<1> {
    Tracks {
        time: 1,
        list: tracks.to_vec(),
    }
}

type Seen = Observed<LinearSensor<1, 1>, Scalar, 1>;

fn value(z: f64, variance: f64) -> Seen {
    Observed::new(LinearSensor::direct(variance).unwrap(), Value::scalar(z, variance).unwrap().into())
}

fn cell(lower: f64, upper: f64, variance: f64) -> Seen {
    let factor = Levels::certain(Cell::new(lower, upper).unwrap(), variance).unwrap();
    Observed::new(LinearSensor::direct(variance).unwrap(), factor.into())
}

/// Both targets exist, both are seen, nothing is false: what the thesis calls association, exactly.
#[test]
fn two_targets_and_two_values_are_the_exact_printed_association() {
    let (z, r) = ([1.3, 0.8], 0.2);
    let list = [track(0, 1.0, 1.0, 0.3), track(1, 1.0, 1.6, 0.1)];
    let targets = [list[0].belief, list[1].belief];
    let straight = AssociationRule::Exact.probability(&targets, z, r).unwrap();
    let expected = update(&targets, z, r, straight).unwrap();
    let mut tracks = known(&list);
    let seen = z.map(|z| value(z, r));
    let reports = [0, 1].map(|j| Report {
        likelihood: &seen[j],
        clutter: 0.0,
    });
    Tracker::new(1.0, Vec::new())
        .unwrap()
        .update(&mut tracks, |_| 1.0, &reports)
        .unwrap();
    for (found, expected) in tracks.list.iter().zip(&expected.targets) {
        assert_eq!(found.existence, 1.0);
        assert!((found.belief.mean() - expected.mean()).amax() < 1e-12);
        assert!((found.belief.covariance() - expected.covariance()).amax() < 1e-12);
    }
}

/// Moments of each target and the probability that it exists, by sums over a grid of both states, all four cases of existence and all
/// associations, written without a filter.
fn on_a_grid(list: &[Track<1>; 2], seen: &[Seen], clutter: &[f64], detection: f64) -> [[f64; 3]; 2] {
    let nodes: Vec<f64> = (0..=400).map(|k| -4.0 + 0.025 * f64::from(k)).collect();
    let table = |t: &Track<1>| -> Vec<f64> {
        let (m, v) = (t.belief.mean()[0], t.belief.covariance()[0]);
        nodes
            .iter()
            .map(|x| (-0.5 * (x - m) * (x - m) / v).exp() / (std::f64::consts::TAU * v).sqrt() * 0.025)
            .collect()
    };
    let densities = [table(&list[0]), table(&list[1])];
    let likely: Vec<Vec<f64>> = seen
        .iter()
        .map(|one| {
            nodes
                .iter()
                .map(|x| one.factor.log_likelihood(&Vector1::new(*x)).exp())
                .collect()
        })
        .collect();
    let (mut total, mut sums) = (0.0, [[0.0; 3]; 2]);
    // Integrals of 1, x, x^2 against density times likelihood of report j, or of none.
    let integral = |i: usize, j: Option<usize>| -> [f64; 3] {
        let mut of = [0.0; 3];
        for (k, x) in nodes.iter().enumerate() {
            let w = densities[i][k] * j.map_or(1.0, |j| likely[j][k]);
            (of[0], of[1], of[2]) = (of[0] + w, of[1] + w * x, of[2] + w * x * x);
        }
        of
    };
    let reports = seen.len();
    for exists in 0..4_usize {
        for a in 0..=reports {
            for b in 0..=reports {
                let choice = [a, b].map(|c| (c < reports).then_some(c));
                let legal = (0..2).all(|i| exists >> i & 1 == 1 || choice[i].is_none());
                if !legal || (choice[0].is_some() && choice[0] == choice[1]) {
                    continue;
                }
                let mut weight: f64 = (0..reports)
                    .filter(|j| !choice.contains(&Some(*j)))
                    .map(|j| clutter[j])
                    .product();
                let mut parts = [[0.0; 3]; 2];
                for i in 0..2 {
                    let r = list[i].existence;
                    parts[i] = integral(i, choice[i]);
                    weight *= match (exists >> i & 1 == 1, choice[i].is_some()) {
                        (false, _) => 1.0 - r,
                        (true, false) => r * (1.0 - detection),
                        (true, true) => r * detection,
                    } * parts[i][0];
                }
                total += weight;
                for i in (0..2).filter(|i| exists >> i & 1 == 1) {
                    (0..3).for_each(|k| sums[i][k] += weight * parts[i][k] / parts[i][0]);
                }
            }
        }
    }
    sums.map(|s| {
        let mean = s[1] / s[0];
        [s[0] / total, mean, s[2] / s[0] - mean * mean]
    })
}

/// Few-bit reports, uncertain existence, missed and false reports: one update has the exact moments of each target.
#[test]
fn one_update_of_few_bit_reports_has_the_moments_of_the_joint_posterior() {
    let list = [track(0, 0.7, 0.2, 0.5), track(1, 0.4, 1.1, 0.3)];
    let seen = [cell(0.0, 0.8, 0.1), cell(0.8, f64::INFINITY, 0.1), value(0.5, 0.2)];
    let clutter = [0.05, 0.1, 0.02];
    let expected = on_a_grid(&list, &seen, &clutter, 0.85);
    let mut tracks = known(&list);
    let reports: Vec<Report<'_, 1>> = seen
        .iter()
        .zip(clutter)
        .map(|(likelihood, clutter)| Report { likelihood, clutter })
        .collect();
    let tracker = Tracker::new(1.0, Vec::new()).unwrap().with_gate(0.0).unwrap();
    tracker.update(&mut tracks, |_| 0.85, &reports).unwrap();
    for (found, [existence, mean, variance]) in tracks.list.iter().zip(expected) {
        assert!((found.existence - existence).abs() < 1e-9, "{} {existence}", found.existence);
        assert!((found.belief.mean()[0] - mean).abs() < 1e-9);
        assert!((found.belief.covariance()[0] - variance).abs() < 1e-9);
    }
}

/// One track that is not seen: `r (1 - d) / (1 - r d)`.
#[test]
fn silence_lowers_existence() {
    let mut tracks = known(&[track(0, 0.6, 0.0, 1.0)]);
    Tracker::new(1.0, Vec::new())
        .unwrap()
        .update(&mut tracks, |_| 0.9, &[])
        .unwrap();
    assert!((tracks.list[0].existence - 0.06 / 0.46).abs() < 1e-15);
    assert_eq!(tracks.list[0].belief, Gaussian::scalar(0.0, 1.0).unwrap());
}

#[test]
fn a_failed_update_leaves_the_tracks() {
    let list = [track(0, 1.0, 0.0, 1.0)];
    let (seen, tracker) = (value(0.1, 1.0), Tracker::new(1.0, Vec::new()).unwrap());
    let mut tracks = known(&list);
    // Two reports of one target, and nothing is false.
    let twice = [Report {
        likelihood: &seen,
        clutter: 0.0,
    }; 2];
    assert_eq!(tracker.update(&mut tracks, |_| 1.0, &twice), Err(Error::Impossible));
    assert!(tracker.update(&mut tracks, |_| 1.5, &twice[..1]).is_err());
    let negative = Report {
        clutter: -1.0,
        ..twice[0]
    };
    assert!(tracker.update(&mut tracks, |_| 1.0, &[negative]).is_err());
    assert_eq!(tracks, known(&list));
    assert!(Tracker::<1>::new(1.5, Vec::new()).is_err());
    assert!(
        Tracker::new(
            1.0,
            vec![Birth {
                probability: f64::NAN,
                belief: list[0].belief
            }]
        )
        .is_err()
    );
}

/// Births, deaths and labels over time in every unit: one target appears, stays and leaves, among false reports. Of all steps of ten runs,
/// those with a wrong number of tracks, and those where the likeliest is far off or has another label, are few; by chance some are.
#[test]
fn a_target_is_found_kept_and_dropped() {
    for unit in [1e-4, 1.0, 1e4] {
        let (mut steps, mut wrong, mut off, mut relabelled) = (0, 0, 0, 0);
        for run in 0..10 {
            let entrance = Gaussian::new(Vector2::new(0.0, unit), Matrix2::identity() * unit * unit).unwrap();
            let births = vec![Birth {
                probability: 0.05,
                belief: entrance,
            }];
            let tracker = Tracker::new(0.98, births).unwrap();
            let motion = constant_velocity_1d(1.0, 0.01 * unit * unit).unwrap();
            let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), 0.25 * unit * unit).unwrap();
            let mut rng = Stream::new(6).indexed(run).rng();
            let (mut tracks, mut state) = (Tracks::default(), Vector2::new(0.0, unit));
            let mut label = None;
            for k in 0..60 {
                tracker.predict(&motion, &mut tracks).unwrap();
                let mut seen = Vec::new();
                if (10..40).contains(&k) {
                    state = motion.propagate(&mut rng, &state);
                    if rng.random::<f64>() < 0.9 {
                        let z = sensor.sample(&mut rng, &state)[0];
                        let lower = (z / unit).floor() * unit;
                        seen.push(Cell::new(lower, lower + unit).unwrap());
                    }
                }
                // A false report anywhere over 100 cells.
                let at = (rng.random::<f64>() * 100.0 - 30.0).floor() * unit;
                seen.push(Cell::new(at, at + unit).unwrap());
                let seen: Vec<_> = seen
                    .iter()
                    .map(|cell| Observed::new(sensor, Levels::certain(*cell, 0.25 * unit * unit).unwrap()))
                    .collect();
                let reports: Vec<_> = seen
                    .iter()
                    .map(|likelihood| Report {
                        likelihood,
                        clutter: 0.01,
                    })
                    .collect();
                tracker.update(&mut tracks, |_| 0.9, &reports).unwrap();
                let likeliest = tracks.confirmed(0.5).max_by(|a, b| a.existence.total_cmp(&b.existence));
                // Three steps are for it to be seen, and to be missed.
                if !(10..13).contains(&k) && !(40..43).contains(&k) {
                    steps += 1;
                    wrong += usize::from(tracks.confirmed(0.5).count() != usize::from((13..40).contains(&k)));
                }
                if (13..40).contains(&k) {
                    let far = |t: &Track<2>| (t.belief.mean()[0] - state[0]).abs() > 2.0 * unit;
                    off += usize::from(likeliest.is_none_or(far));
                    let own = likeliest.map(|t| t.label);
                    relabelled += usize::from(own.is_some() && label.is_some() && own != label);
                    label = own.or(label);
                }
            }
            let text = serde_json::to_string(&(&tracker, &tracks)).unwrap();
            let back: (Tracker<2>, Tracks<2>) = serde_json::from_str(&text).unwrap();
            assert_eq!(back, (tracker, tracks));
        }
        assert!(wrong * 10 < steps, "{wrong} of {steps}");
        assert!(off * 10 < steps && relabelled <= 5, "{off} {relabelled} of {steps}");
    }
}

/// Without reports a prediction is that of the dynamics, and existence decays.
#[test]
fn prediction_is_the_dynamics() {
    let motion = Ar1::new(0.9, 0.5).unwrap();
    let mut tracks = known(&[track(0, 0.8, 2.0, 1.0)]);
    Tracker::new(0.95, Vec::new())
        .unwrap()
        .predict(&motion, &mut tracks)
        .unwrap();
    assert!((tracks.list[0].existence - 0.76).abs() < 1e-15 && tracks.time == 2);
    assert!((tracks.list[0].belief.mean()[0] - 1.8).abs() < 1e-15);
    assert!((tracks.list[0].belief.covariance()[0] - 1.31).abs() < 1e-15);
    assert_eq!(tracks.list.len(), 1);
}
