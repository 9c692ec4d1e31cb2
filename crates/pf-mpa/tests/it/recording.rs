//! Simulated recordings whose speed, noise, bias, scale, anchors and gaps differ from the tracker's settings.

use fewbits_core::Dynamics;
use fewbits_models::ContinuousLinear;
use fewbits_monte_carlo::{Moments, Stream};
use fewbits_pf_mpa::{RangeSettings, RangeTracker, Travel};
use nalgebra::{Vector2, Vector3, Vector4};
use rand::RngExt;
use rand_distr::StandardNormal;

/// Ranges of a recording.
const LENGTH: usize = 1000;
/// Recordings of each kind.
const RECORDINGS: u64 = 4;

/// A made-up recording: anchors, ranges `(time, anchor, range)` and the true positions at the ranges' times.
struct Recording {
    anchors: Vec<(String, Vector2<f64>)>,
    ranges: Vec<(f64, String, f64)>,
    truth: Vec<Vector2<f64>>,
}

/// Correlation time of the lasting part of an anchor's errors, in seconds.
const LASTING: f64 = 4.0;

/// What a recording is made of.
#[derive(Clone, Copy, Debug)]
struct World {
    speed: f64,
    /// Standard deviations of the part of the error that is independent in each range, and of the part that lasts for seconds.
    noise: f64,
    lasting: f64,
    bias: f64,
    /// Ranges are `1 + scale` times the distance.
    scale: f64,
    anchors: usize,
    /// Seconds without ranges in the middle.
    gap: f64,
}

impl Recording {
    fn places(&self) -> impl Iterator<Item = (String, Vector3<f64>)> {
        self.anchors.iter().map(|(name, place)| (name.clone(), place.push(0.0)))
    }
}

impl World {
    fn record(&self, seed: u64) -> Recording {
        let mut rng = Stream::new(seed).named("recording").rng();
        let anchors: Vec<(String, Vector2<f64>)> = (0..self.anchors)
            .map(|i| {
                let angle = std::f64::consts::TAU * i as f64 / self.anchors as f64 + 0.3;
                let radius = 45.0 + 15.0 * (i % 2) as f64;
                (format!("node {i}"), Vector2::new(100.0 + radius * angle.cos(), -20.0 + radius * angle.sin()))
            })
            .collect();
        // Gently pulled back, so that it stays among the anchors.
        let model = ContinuousLinear::forgotten_velocity_2d(self.speed, 8.0).unwrap();
        let mut state = Vector4::new(100.0, 0.0, -20.0, 0.0);
        let (mut time, mut ranges, mut truth) = (1000.0, Vec::new(), Vec::new());
        // The lasting error of each anchor, and when it last ranged.
        let mut lasting = vec![(0.0, f64::NEG_INFINITY); self.anchors];
        for k in 0..LENGTH {
            let seconds = 0.3 + 0.4 * rng.random::<f64>() + if k == LENGTH / 2 { self.gap } else { 0.0 };
            state = model.over(seconds).unwrap().propagate(&mut rng, &state);
            (state[0], state[2]) = (100.0 + (state[0] - 100.0) * 0.997, -20.0 + (state[2] + 20.0) * 0.997);
            time += seconds;
            let anchor = rng.random_range(0..anchors.len());
            let (name, place) = &anchors[anchor];
            let position = Vector2::new(state[0], state[2]);
            let (shared, last) = lasting[anchor];
            let kept = ((last - time) / LASTING).exp();
            let shared: f64 =
                kept * shared + (1.0 - kept * kept).sqrt() * self.lasting * rng.sample::<f64, _>(StandardNormal);
            lasting[anchor] = (shared, time);
            let normal: f64 = rng.sample(StandardNormal);
            let mut range = (1.0 + self.scale) * (position - place).norm() + self.bias + self.noise * normal + shared;
            if rng.random::<f64>() < 0.015 {
                range += 30.0 * rng.random::<f64>();
            }
            ranges.push((time, name.clone(), range));
            truth.push(position);
        }
        Recording { anchors, ranges, truth }
    }
}

/// Results of the trackers of several recordings of one kind.
#[derive(Debug)]
struct Score {
    /// Root mean squared error, in metres.
    rms: f64,
    /// Median over the recordings.
    nees: f64,
    /// Averages over the recordings.
    bits: f64,
    losses: f64,
    speed: f64,
    noise: f64,
    scale: f64,
}

fn score(recordings: &[Recording], travel: Travel, settings: RangeSettings) -> Score {
    let [mut squares, mut bits, mut losses, mut speed, mut noise, mut scale] = [(); 6].map(|()| Moments::default());
    let mut normalised = Vec::new();
    for recording in recordings {
        let mut tracker = RangeTracker::new(recording.places(), travel, settings).unwrap();
        let (mut count, mut nees, mut last) = (0, Moments::default(), None);
        for ((time, anchor, range), truth) in recording.ranges.iter().zip(&recording.truth) {
            if let Some(found) = tracker.push(*time, anchor, *range).unwrap() {
                squares.add((found.position.xy() - truth).norm_squared());
                nees.add(found.normalised_error(&truth.push(0.0)).unwrap());
                count += 1;
                last = Some(found);
            }
        }
        // All but the acquisition.
        assert!(count > recording.ranges.len() * 9 / 10, "{count} estimates");
        let last = last.unwrap();
        speed.add(last.speed);
        noise.add(last.noise);
        scale.add(last.scale);
        normalised.push(nees.mean());
        bits.add(tracker.bits() as f64 / recording.ranges.len() as f64);
        losses.add(tracker.losses() as f64);
    }
    normalised.sort_by(f64::total_cmp);
    Score {
        rms: squares.mean().sqrt(),
        nees: normalised[normalised.len() / 2],
        bits: bits.mean(),
        losses: losses.mean(),
        speed: speed.mean(),
        noise: noise.mean(),
        scale: scale.mean(),
    }
}

const WORLDS: [World; 4] = [
    World {
        speed: 0.5,
        noise: 1.2,
        lasting: 0.9,
        bias: 2.0,
        scale: 0.0,
        anchors: 4,
        gap: 0.0,
    },
    World {
        speed: 1.0,
        noise: 1.3,
        lasting: 0.9,
        bias: -1.0,
        scale: 0.0,
        anchors: 5,
        gap: 30.0,
    },
    World {
        speed: 2.0,
        noise: 1.3,
        lasting: 0.9,
        bias: 3.0,
        scale: 0.0,
        anchors: 4,
        gap: 10.0,
    },
    World {
        speed: 3.0,
        noise: 1.2,
        lasting: 0.9,
        bias: 0.0,
        scale: 0.0,
        anchors: 6,
        gap: 0.0,
    },
];

/// Radios that are not calibrated, with independent errors.
const UNCALIBRATED: [World; 2] = [
    World {
        speed: 1.0,
        noise: 0.55,
        lasting: 0.0,
        bias: 0.0,
        scale: 0.07,
        anchors: 4,
        gap: 0.0,
    },
    World {
        speed: 1.5,
        noise: 1.5,
        lasting: 0.0,
        bias: 1.0,
        scale: -0.05,
        anchors: 6,
        gap: 30.0,
    },
];

/// What a user of such radios says.
fn stated() -> RangeSettings {
    RangeSettings {
        noise: Some(1.8),
        speed: Some(1.0),
        bias: Some(5.0),
        ..RangeSettings::default()
    }
}

const TRAVELS: [Travel; 3] = [Travel::Full, Travel::Bits(1), Travel::Bits(2)];

/// Scores of the tracker with default settings and of one that is told the speed, for each of [`TRAVELS`], over recordings of each world.
fn learnt_and_told(worlds: &[World]) -> Vec<[(Score, Score); 3]> {
    let one = |seed: usize, world: &World| {
        let record = |k| world.record(seed as u64 + 100 * k);
        let recordings: Vec<_> = (0..RECORDINGS).map(record).collect();
        let told = RangeSettings {
            speed: Some(world.speed),
            speed_factor: Some(1.0),
            ..stated()
        };
        TRAVELS.map(|travel| {
            let learnt = score(&recordings, travel, stated());
            let told = score(&recordings, travel, told);
            println!("{travel:?} {world:?}: {:.3}\n    {learnt:.3?}\n    {told:.3?}", learnt.rms / told.rms);
            assert!((0.4..2.5).contains(&(learnt.speed / world.speed)), "{travel:?} {world:?}: {learnt:?}");
            assert!((0.7..1.5).contains(&learnt.nees), "{travel:?} {world:?}: {learnt:?}");
            (learnt, told)
        })
    };
    std::thread::scope(|scope| {
        let start = |(seed, world)| scope.spawn(move || one(seed, world));
        let running: Vec<_> = worlds.iter().enumerate().map(start).collect();
        running.into_iter().map(|run| run.join().unwrap()).collect()
    })
}

/// The geometric mean of ratios.
fn mean_ratio(ratios: impl Iterator<Item = f64>) -> f64 {
    let mut logs = Moments::default();
    ratios.for_each(|ratio| logs.add(ratio.ln()));
    logs.mean().exp()
}

/// The tracker expects 1 m/s. It is compared with itself when it is told the speed, and few bits with full ranges.
#[test]
fn few_bits_and_a_learnt_speed_cost_little() {
    let scores = learnt_and_told(&WORLDS);
    // Over all kinds, since the ratio of one kind has a standard error of up to 5 %.
    for (i, travel) in TRAVELS.iter().enumerate() {
        let cost = mean_ratio(scores.iter().map(|of| of[i].0.rms / of[i].1.rms));
        println!("{travel:?}: {cost:.3} of the tracker that is told the speed");
        assert!(cost < if *travel == Travel::Bits(1) { 1.15 } else { 1.05 }, "{travel:?}: {cost}");
        let losses = scores.iter().map(|of| of[i].0.losses).sum::<f64>() / WORLDS.len() as f64;
        assert!(losses <= if *travel == Travel::Bits(1) { 1.0 } else { 0.1 }, "{travel:?}: {losses} a recording");
    }
    for [full, one, _] in &scores {
        assert!(one.0.rms < 1.9 * full.0.rms && (1.0..2.0).contains(&one.0.bits), "{full:?} {one:?}");
    }
    let two_bits = mean_ratio(scores.iter().map(|[full, _, two]| two.0.rms / full.0.rms));
    println!("2 bits: {two_bits:.3} of full ranges");
    assert!(two_bits < 1.15, "{two_bits}");
    assert!(scores.iter().all(|[.., two]| (2.0..3.0).contains(&two.0.bits)));
}

#[test]
fn errors_of_scale_and_the_noise_are_found() {
    for (world, scores) in UNCALIBRATED.iter().zip(learnt_and_told(&UNCALIBRATED)) {
        for (travel, (learnt, told)) in TRAVELS.iter().zip(&scores) {
            assert!(learnt.rms < 1.15 * told.rms, "{travel:?}: {learnt:?} {told:?}");
            assert!((learnt.scale - world.scale).abs() < 0.02, "{travel:?} {world:?}: {learnt:?}");
            assert!((0.5..2.0).contains(&(learnt.noise / world.noise)), "{travel:?} {world:?}: {learnt:?}");
        }
        let [full, one, two] = scores.map(|(learnt, _)| learnt.rms);
        assert!(one < 1.9 * full && two < 1.25 * full, "{world:?}: {full} {one} {two}");
    }
}

/// The target is carried away while no range arrives: the track is flagged within 20 ranges, and found again.
#[test]
fn a_lost_track_is_flagged_and_found_again() {
    for travel in [Travel::Full, Travel::Bits(1), Travel::Bits(2)] {
        let mut delays = Moments::default();
        for seed in 0..4 {
            let mut recording = World { gap: 0.0, ..WORLDS[1] }.record(50 + seed);
            // Carried 30 m within a fraction of a second.
            for k in LENGTH / 2..LENGTH {
                let (_, name, range) = &mut recording.ranges[k];
                let place = recording.anchors.iter().find(|a| a.0 == *name).unwrap().1;
                let moved = recording.truth[k] + Vector2::new(30.0, 0.0);
                *range += (moved - place).norm() - (recording.truth[k] - place).norm();
                recording.truth[k] = moved;
            }
            let mut tracker = RangeTracker::new(recording.places(), travel, stated()).unwrap();
            let (mut flagged, mut last) = (None, f64::INFINITY);
            for (k, ((time, anchor, range), truth)) in recording.ranges.iter().zip(&recording.truth).enumerate() {
                if let Some(found) = tracker.push(*time, anchor, *range).unwrap() {
                    let near = (found.position.xy() - truth).norm() < 6.0;
                    if k >= LENGTH / 2 && flagged.is_none() && (found.lost || near) {
                        flagged = Some(k - LENGTH / 2);
                    }
                    last = (found.position.xy() - truth).norm();
                }
            }
            delays.add(flagged.unwrap_or(LENGTH / 2) as f64);
            assert!(last < 10.0, "{travel:?}, seed {seed}: {last} m at the end");
        }
        println!("{travel:?}: flagged or caught up after {:.1} ranges", delays.mean());
        assert!(delays.mean() < 20.0, "{travel:?}: {}", delays.mean());
    }
}

/// The ranges before the track are those of a place 40 m away.
#[test]
fn a_wrong_start_is_flagged_and_mended() {
    for travel in [Travel::Full, Travel::Bits(1), Travel::Bits(2)] {
        for seed in 0..4 {
            let mut recording = WORLDS[1].record(70 + seed);
            let mut tracker = RangeTracker::new(recording.places(), travel, stated()).unwrap();
            let (mut first, mut right) = (None, None);
            for (k, truth) in recording.truth.iter().enumerate().take(LENGTH / 4) {
                let (time, anchor, range) = &mut recording.ranges[k];
                if first.is_none() {
                    let place = recording.anchors.iter().find(|a| a.0 == *anchor).unwrap().1;
                    *range += (truth + Vector2::new(28.0, 28.0) - place).norm() - (truth - place).norm();
                }
                if let Some(found) = tracker.push(*time, anchor, *range).unwrap() {
                    let start = *first.get_or_insert(k);
                    if k > start && (found.lost || (found.position.xy() - truth).norm() < 8.0) {
                        right.get_or_insert(k - start);
                    }
                }
            }
            let delay = right.unwrap_or(LENGTH);
            println!("{travel:?}, seed {seed}: flagged or right after {delay} ranges");
            assert!(delay <= 20, "{travel:?}, seed {seed}: {delay}");
        }
    }
}

#[test]
fn bad_settings_and_ranges_are_refused() {
    let recording = WORLDS[0].record(1);
    let settings = RangeSettings::default();
    let new = |anchors: &[(String, Vector2<f64>)], travel, settings| {
        RangeTracker::new(anchors.iter().map(|(name, place)| (name.clone(), place.push(0.0))), travel, settings)
    };
    assert!(new(&recording.anchors[..2], Travel::Full, settings).is_err());
    assert!(new(&recording.anchors, Travel::Bits(0), settings).is_err());
    for bad in [
        RangeSettings {
            speed: Some(f64::NAN),
            ..settings
        },
        RangeSettings {
            noise_factor: Some(0.5),
            ..settings
        },
        RangeSettings {
            noise: Some(1e-200),
            ..settings
        },
        RangeSettings {
            scale: -0.1,
            ..settings
        },
    ] {
        assert!(new(&recording.anchors, Travel::Full, bad).is_err(), "{bad:?}");
    }
    let mut tracker = new(&recording.anchors, Travel::Bits(2), settings).unwrap();
    assert!(tracker.push(1.0, "nobody", 3.0).is_err());
    assert!(tracker.push(1.0, "node 0", f64::NAN).is_err());
    tracker.push(1.0, "node 0", 50.0).unwrap();
    assert!(tracker.push(0.5, "node 0", 50.0).is_err());
}

#[test]
fn a_track_of_two_anchors_is_lost() {
    let world = World {
        speed: 1.0,
        noise: 1.2,
        lasting: 0.9,
        bias: 2.0,
        scale: 0.0,
        anchors: 3,
        gap: 0.0,
    };
    let recording = world.record(3);
    let anchors = recording.places();
    let mut tracker = RangeTracker::new(anchors, Travel::Full, stated()).unwrap();
    for (k, (time, anchor, range)) in recording.ranges.iter().enumerate() {
        // One of three anchors drifts away: once it is excluded, two places fit the others.
        let drift = if anchor == "node 0" {
            0.05 * k.saturating_sub(300) as f64
        } else {
            0.0
        };
        tracker.push(*time, anchor, range + drift).unwrap();
        assert!(k >= 300 || tracker.losses() == 0, "{k}");
    }
    assert!(tracker.losses() >= 1);
}
