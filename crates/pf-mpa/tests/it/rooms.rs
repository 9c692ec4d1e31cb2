//! Random rooms: whether a place that the tracker is sure of is right, and whether its bands hold what they say.

use fewbits_core::Dynamics;
use fewbits_models::ContinuousLinear;
use fewbits_monte_carlo::Stream;
use fewbits_pf_mpa::{Height, Mistake, RangeSettings, RangeTracker, Travel, height_of, mistake_of};
use nalgebra::{Vector3, Vector4};
use rand::RngExt;
use rand_distr::StandardNormal;
use std::ops::Range;

/// Ranges in each room.
const LENGTH: usize = 400;
/// A place is wrong if its normalised squared error is above this for so many ranges in a row.
const WRONG: f64 = 25.0;
const LONG: usize = 20;

#[derive(Debug)]
struct Room {
    anchors: Vec<(String, Vector3<f64>)>,
    noise: f64,
    bias: f64,
    scale: f64,
    speed: f64,
    middle: (f64, f64),
    /// An anchor whose ranges are longer by so much.
    long: Option<(usize, f64)>,
}

impl Room {
    fn random(seed: u64) -> Self {
        let mut rng = Stream::new(seed).named("rooms").rng();
        let mut even = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let (wide, deep) = (even(6.0, 40.0), even(6.0, 40.0));
        let corner = (even(-100.0, 100.0), even(-100.0, 100.0));
        let count = even(3.0, 9.0) as usize;
        let is_rectangle = count == 4 && even(0.0, 1.0) < 0.7;
        let place = |x: f64, y: f64| Vector3::new(corner.0 + x, corner.1 + y, 0.0);
        let places: Vec<Vector3<f64>> = if is_rectangle {
            vec![place(0.0, 0.0), place(wide, 0.0), place(wide, deep), place(0.0, deep)]
        } else {
            // Not all on one line.
            loop {
                let found: Vec<_> = (0..count).map(|_| place(even(0.0, wide), even(0.0, deep))).collect();
                let (a, b) = (found[1] - found[0], found[2] - found[0]);
                if (a.x * b.y - a.y * b.x).abs() > 0.1 * wide * deep {
                    break found;
                }
            }
        };
        let noise = 0.02 * 50.0_f64.powf(even(0.0, 1.0));
        let speed = 0.05 * 30.0_f64.powf(even(0.0, 1.0));
        let middle = places.iter().sum::<Vector3<f64>>() / places.len() as f64;
        let spread = (places.iter().map(|p| (p - middle).norm_squared()).sum::<f64>() / places.len() as f64).sqrt();
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        Self {
            bias: 0.2 * spread * normal(),
            scale: 0.1 * normal(),
            anchors: places
                .into_iter()
                .enumerate()
                .map(|(i, place)| (format!("a{i}"), place))
                .collect(),
            noise,
            speed,
            long: None,
            middle: (corner.0 + 0.5 * wide, corner.1 + 0.5 * deep),
        }
    }
}

/// What a tracker did in one room.
#[derive(Debug, Default, Clone)]
struct Outcome {
    seed: u64,
    rows: usize,
    held: usize,
    longest_wrong: usize,
    losses: usize,
    squares: f64,
    nees: f64,
    searching: usize,
    /// The bias that the tracker says the long anchor has alone.
    own_bias: Option<f64>,
    /// Seconds of pushes while searching and while tracking.
    seconds: [f64; 2],
}

fn walk(room: &Room, seed: u64, travel: Travel, settings: RangeSettings) -> Outcome {
    let mut rng = Stream::new(seed).named("walk").rng();
    let model = ContinuousLinear::forgotten_velocity_2d(room.speed, 6.0).unwrap();
    let mut even = |deviation: f64| deviation * rng.sample::<f64, _>(StandardNormal);
    let mut state =
        Vector4::new(room.middle.0 + even(2.0), even(room.speed), room.middle.1 + even(2.0), even(room.speed));
    let mut tracker = RangeTracker::new(room.anchors.clone(), travel, settings).unwrap();
    let mut outcome = Outcome {
        seed,
        ..Outcome::default()
    };
    let (mut wrong, mut time) = (0, 0.0);
    for k in 0..LENGTH {
        let seconds = 0.1 + 0.2 * rng.random::<f64>();
        time += seconds;
        state = model.over(seconds).unwrap().propagate(&mut rng, &state);
        let (name, place) = &room.anchors[k % room.anchors.len()];
        let truth = Vector3::new(state[0], state[2], 0.0);
        let own = room
            .long
            .filter(|(long, _)| long % room.anchors.len() == k % room.anchors.len());
        let range = own.map_or(0.0, |(_, bias)| bias)
            + (1.0 + room.scale) * (truth - place).norm()
            + room.bias
            + room.noise * rng.sample::<f64, _>(StandardNormal);
        let begun = std::time::Instant::now();
        let found = tracker.push(time, name, range).unwrap();
        let is_first = found.is_some() && outcome.rows == 0;
        outcome.seconds[usize::from(found.is_some() && !is_first)] += begun.elapsed().as_secs_f64();
        let Some(found) = found else {
            outcome.searching += 1;
            continue;
        };
        for i in 0..2 {
            outcome.held += usize::from((found.bands[i].0..=found.bands[i].1).contains(&truth[i]));
            outcome.rows += 1;
        }
        let nees = found
            .normalised_error(&truth)
            .unwrap_or_else(|| panic!("seed {seed}, range {k}: {found:?}"));
        outcome.nees += nees;
        outcome.squares += (found.position - truth).norm_squared();
        wrong = if nees > WRONG && !found.lost { wrong + 1 } else { 0 };
        outcome.longest_wrong = outcome.longest_wrong.max(wrong);
    }
    outcome.losses = tracker.losses();
    outcome.own_bias = room.long.and_then(|(long, _)| {
        let (name, _) = &room.anchors[long % room.anchors.len()];
        tracker.own_bias(name).unwrap()
    });
    outcome
}

/// One anchor that is .5 to 3 m too long.
fn long_anchor(room: &Room, seed: u64) -> (usize, f64) {
    let mut rng = Stream::new(seed).named("long").rng();
    (rng.random_range(0..room.anchors.len()), 0.5 + 2.5 * rng.random::<f64>())
}

/// The rooms of these seeds. `long`: in each of at least four anchors, one is .5 to 3 m too long for good.
fn measure(seeds: Range<u64>, travel: Travel, settings: RangeSettings, long: bool) -> (f64, usize) {
    let outcomes: Vec<(Room, Outcome)> = std::thread::scope(|scope| {
        let half = |odd: u64| {
            let seeds = seeds.clone();
            scope.spawn(move || {
                let one = |seed: u64| {
                    let mut room = Room::random(seed);
                    if long {
                        if room.anchors.len() < 4 {
                            return None;
                        }
                        room.long = Some(long_anchor(&room, seed));
                    }
                    let outcome = walk(&room, seed, travel, settings);
                    Some((room, outcome))
                };
                let own = seeds.filter(|seed| seed % 2 == odd);
                own.filter_map(one).collect::<Vec<_>>()
            })
        };
        [half(0), half(1)]
            .into_iter()
            .flat_map(|run| run.join().unwrap())
            .collect()
    });
    let (rows, held) = outcomes
        .iter()
        .fold((0, 0), |(rows, held), (_, one)| (rows + one.rows, held + one.held));
    let wrong = outcomes.iter().filter(|(_, one)| one.longest_wrong >= LONG).count();
    for (room, one) in outcomes
        .iter()
        .filter(|(_, one)| one.longest_wrong >= LONG || one.held * 100 < one.rows * 75)
    {
        println!(
            "seed {}: {} anchors, noise {:.3}, bias {:.2}, scale {:.3}, speed {:.2}: wrong for {}, held {:.2}, nees {:.1}, rms {:.2}, losses {}",
            one.seed,
            room.anchors.len(),
            room.noise,
            room.bias,
            room.scale,
            room.speed,
            one.longest_wrong,
            one.held as f64 / one.rows as f64,
            one.nees / one.rows as f64 * 2.0,
            (one.squares / one.rows as f64 * 2.0).sqrt(),
            one.losses
        );
    }
    let share = held as f64 / rows as f64;
    // Rows of a room are not independent: the deviation is that of the rooms' shares.
    let squares: f64 = outcomes
        .iter()
        .map(|(_, one)| (one.held as f64 - share * one.rows as f64).powi(2))
        .sum();
    let deviation = squares.sqrt() / rows as f64;
    let named = outcomes.iter().filter(|(_, one)| one.own_bias.is_some()).count();
    let sum = |of: fn(&Outcome) -> f64| outcomes.iter().map(|(_, one)| of(one)).sum::<f64>();
    println!(
        "{travel:?}: {} rooms of {seeds:?}: held {share:.4} +- {deviation:.4}, wrong in {wrong}, named {named}, losses {}, searching {}: {:.0} us a range; tracking {:.1} us a range",
        outcomes.len(),
        sum(|one| one.losses as f64),
        sum(|one| one.searching as f64),
        1e6 * sum(|one| one.seconds[0]) / sum(|one| one.searching as f64 + 1.0),
        2e6 * sum(|one| one.seconds[1]) / sum(|one| one.rows as f64)
    );
    for anchors in 3..9 {
        let of = |number: &dyn Fn(&Outcome) -> f64| {
            let some = outcomes.iter().filter(|(room, _)| room.anchors.len() == anchors);
            some.map(|(_, one)| number(one)).sum::<f64>()
        };
        let rows = of(&|one| one.rows as f64).max(1.0);
        println!(
            "    {anchors} anchors: held {:.4}, NEES {:.2}, rms {:.2}, tracking {:.1} us",
            of(&|one| one.held as f64) / rows,
            2.0 * of(&|one| one.nees) / rows,
            (2.0 * of(&|one| one.squares) / rows).sqrt(),
            2e6 * of(&|one| one.seconds[1]) / rows
        );
    }
    (share, wrong)
}

/// Without biases of single anchors, as the rooms are.
fn none_alone() -> RangeSettings {
    RangeSettings {
        anchor_bias: Some(0.0),
        ..RangeSettings::default()
    }
}

const TRAVELS: [Travel; 3] = [Travel::Full, Travel::Bits(1), Travel::Bits(2)];

#[test]
fn no_confident_place_is_wrong() {
    for travel in TRAVELS {
        let (share, wrong) = measure(0..12, travel, none_alone(), false);
        assert!(wrong == 0 && share > 0.9, "{travel:?}: {wrong} rooms, bands hold {share}");
    }
}

/// Defect: a lost track left its bias and scale to the next search, narrow and wrong, and the place was searched near the anchors though the target had
/// been four spreads away.
#[test]
fn a_lost_track_says_nothing_of_bias_and_scale() {
    for (seed, bits) in [(2139, 1), (2139, 2), (20808, 1)] {
        let outcome = walk(&Room::random(seed), seed, Travel::Bits(bits), RangeSettings::default());
        println!("{outcome:?}");
        assert!(outcome.longest_wrong < LONG, "{outcome:?}");
        assert!(10 * outcome.held > 8 * outcome.rows, "{outcome:?}");
    }
}

/// Defect: where anchors are nearly on a line, a target that crossed it was followed on the other side, 50 m off in the end, under a narrow band.
#[test]
fn a_target_that_crosses_a_line_of_anchors_is_followed() {
    let mut long = Room::random(40344);
    long.long = Some(long_anchor(&long, 40344));
    for (room, travel) in [(&Room::random(40344), Travel::Bits(2)), (&long, Travel::Full)] {
        let outcome = walk(room, 40344, travel, RangeSettings::default());
        let rms = (2.0 * outcome.squares / outcome.rows as f64).sqrt();
        assert!(outcome.longest_wrong < LONG && rms < 4.0, "{rms}, {outcome:?}");
    }
}

/// Defect: an explanation by one long anchor of four leaves three, which explain almost anything. It lost a little evidence with each range, since its
/// places are a long curve, and a narrow wrong place was left; or it gained as little. Or four such explanations gained, and the first of them to gain enough was
/// left alone.
#[test]
fn little_evidence_decides_nothing_among_four_anchors() {
    for seed in [20031, 20249, 20326, 20016] {
        let mut room = Room::random(seed);
        room.long = Some(long_anchor(&room, seed));
        let outcome = walk(&room, seed, Travel::Full, RangeSettings::default());
        println!("{outcome:?}");
        assert!(outcome.longest_wrong < LONG, "{outcome:?}");
    }
}

/// Defect: while a target rests, an explanation by one long anchor of five did not estimate the error of scale though the other four tell it. It lost
/// evidence by that, and a narrow wrong place was left for 74 ranges.
#[test]
fn a_resting_target_tells_the_long_anchor_of_five() {
    for seed in [60365, 910_212] {
        let mut room = Room::random(seed);
        room.long = Some(long_anchor(&room, seed));
        let outcome = walk(&room, seed, Travel::Full, RangeSettings::default());
        println!("{outcome:?}");
        assert!(outcome.longest_wrong < LONG && 2 * outcome.held > outcome.rows, "{outcome:?}");
    }
}

/// Defect: exchanged names among four anchors with known bias and scale left a wrong place under a narrow band, and no sign of it.
#[test]
fn residuals_last_where_anchors_are_exchanged() {
    let settings = RangeSettings {
        bias: Some(0.0),
        scale: 0.0,
        ..RangeSettings::default()
    };
    let anchors = &hall()[..4];
    let told = |is_exchanged: bool| {
        let mut rng = Stream::new(12).named("exchanged").rng();
        let mut said = anchors.to_vec();
        if is_exchanged {
            (said[0].1, said[1].1) = (said[1].1, said[0].1);
        }
        let mut tracker = RangeTracker::new(said, Travel::Full, settings).unwrap();
        for k in 0..400 {
            let time = 0.2 * k as f64;
            let (x, y) = (5.0 + 3.0 * (0.3 * time).sin(), 4.0 + 2.0 * (0.2 * time).cos());
            let (name, place) = &anchors[k % 4];
            let range = (Vector3::new(x, y, 0.0) - place).norm() + 0.1 * rng.sample::<f64, _>(StandardNormal);
            tracker.push(time, name, range).unwrap();
        }
        let lasting = |(name, _): &(String, Vector3<f64>)| tracker.lasting_residuals(name).unwrap();
        anchors.iter().filter_map(lasting).count()
    };
    let (right, exchanged) = (told(false), told(true));
    assert!(right == 0 && exchanged >= 2, "{right}, {exchanged}");
}

/// Defect: one anchor whose ranges are long for good drew the place away, with a narrow band: 74 % of the truths were held, and in 12 of 60 rooms
/// the place was wrong for twenty ranges and more.
#[test]
fn a_long_anchor_is_found_or_the_band_holds() {
    let (mut rows, mut held, mut wrong, mut named) = (0, 0, 0, 0);
    for seed in 0..16 {
        let mut room = Room::random(seed);
        if room.anchors.len() < 4 {
            continue;
        }
        room.long = Some((seed as usize, 1.0 + 0.1 * seed as f64));
        room.noise = room.noise.min(0.2);
        let outcome = walk(&room, seed, Travel::Full, RangeSettings::default());
        rows += outcome.rows;
        held += outcome.held;
        wrong += usize::from(outcome.longest_wrong >= LONG);
        named += usize::from(outcome.own_bias.is_some_and(|found| found > 0.0));
    }
    println!("{held} of {rows}, wrong in {wrong}, named in {named}");
    assert!(held * 100 > rows * 88 && wrong <= 1 && named > 5, "{held} of {rows}, {wrong}, {named}");
}

/// Defect: with 2 bits, ranges of which it is doubtful whether they depend on the distance left a covariance that was not positive definite.
#[test]
fn doubtful_ranges_leave_a_covariance() {
    let settings = RangeSettings {
        anchor_bias: Some(0.0),
        ..RangeSettings::default()
    };
    // `walk` asserts that the error can be normalised.
    let outcome = walk(&Room::random(141), 141, Travel::Bits(2), settings);
    assert!(outcome.rows > 0 && outcome.longest_wrong < LONG, "{outcome:?}");
}

/// Three ranges without error that never change leave a curve of places when bias and scale are unknown: the band holds the true one for good.
#[test]
fn a_still_target_of_three_anchors_stays_in_the_band() {
    for (places, truth) in [
        ([[80.0, 33.0], [80.0, 57.0], [52.0, 57.0]], [55.0, 35.0]),
        ([[0.0, 0.0], [12.0, 1.0], [4.0, 9.0]], [6.0, 3.5]),
        ([[0.0, 0.0], [12.0, 1.0], [4.0, 9.0]], [2.5, 5.5]),
    ] {
        let truth = Vector3::new(truth[0], truth[1], 0.0);
        let anchors = places.map(|[x, y]| (format!("{x} {y}"), Vector3::new(x, y, 0.0)));
        let mut tracker = RangeTracker::new(anchors.clone(), Travel::Full, RangeSettings::default()).unwrap();
        let (mut held, mut rows) = (0, 0);
        for k in 0..300 {
            let (name, place) = &anchors[k % 3];
            let Some(found) = tracker.push(k as f64, name, (truth - place).norm()).unwrap() else {
                continue;
            };
            rows += 1;
            let is_held = (0..2).all(|i| (found.bands[i].0..=found.bands[i].1).contains(&truth[i]));
            held += usize::from(is_held);
        }
        println!("{truth:?}: {held} of {rows}");
        assert!(rows > 290 && held == rows, "{truth:?}: {held} of {rows}");
    }
}

/// Defect: while a target rested, the error of scale went to -.3 and the place with it, half a metre off within a minute, with a narrow band.
#[test]
fn a_still_target_of_four_anchors_does_not_drift() {
    let anchors =
        [[0.0, 0.0], [10.0, 0.0], [10.0, 8.0], [0.0, 8.0]].map(|[x, y]| (format!("{x} {y}"), Vector3::new(x, y, 0.0)));
    for (seed, truth) in [[7.9, 2.2], [3.1, 5.6], [1.5, 1.2], [8.6, 6.9]].into_iter().enumerate() {
        let truth = Vector3::new(truth[0], truth[1], 0.0);
        let mut rng = Stream::new(seed as u64).named("still").rng();
        let mut tracker = RangeTracker::new(anchors.clone(), Travel::Full, RangeSettings::default()).unwrap();
        let (mut held, mut rows, mut last) = (0, 0, None);
        for k in 0..2400 {
            let (name, place) = &anchors[k % 4];
            let range = (truth - place).norm() + 0.03 * rng.sample::<f64, _>(StandardNormal);
            let Some(found) = tracker.push((k / 4) as f64 * 0.1, name, range).unwrap() else {
                continue;
            };
            rows += 1;
            held += (0..2)
                .filter(|i| (found.bands[*i].0..=found.bands[*i].1).contains(&truth[*i]))
                .count();
            last = Some(found);
        }
        let last = last.unwrap();
        let off = (last.position - truth).norm();
        println!("{truth:?}: {held} of {}, {off:.3} off, scale {:.3}", 2 * rows, last.scale);
        assert!(off < 0.1 && 10 * held > 8 * 2 * rows, "{truth:?}: {held} of {}, {off}", 2 * rows);
    }
}

/// Defect: the first range of each instant, which tells the clock alone, was judged as if it told the place: every ninth instant the track was
/// lost.
#[test]
fn an_unknown_clock_loses_no_track() {
    let places = [
        [0.0, 0.0],
        [21.0, 1.0],
        [19.0, 16.0],
        [-1.0, 14.0],
        [9.0, 20.0],
        [26.0, 7.0],
    ];
    let anchors = places.map(|[x, y]| (format!("{x} {y}"), Vector3::new(x, y, 0.0)));
    let settings = RangeSettings {
        unknown_clock: true,
        ..RangeSettings::default()
    };
    let mut tracker = RangeTracker::new(anchors.clone(), Travel::Full, settings).unwrap();
    let mut rng = Stream::new(16).named("clock").rng();
    let model = ContinuousLinear::forgotten_velocity_2d(0.5, 6.0).unwrap();
    let (mut state, mut clock) = (Vector4::new(10.0, 0.3, 8.0, 0.2), 500.0);
    let (mut squares, mut held, mut rows) = (0.0, 0, 0);
    for k in 0..200 {
        state = model.over(0.5).unwrap().propagate(&mut rng, &state);
        clock += 5.0 * rng.sample::<f64, _>(StandardNormal);
        let truth = Vector3::new(state[0], state[2], 0.0);
        for (name, place) in &anchors {
            let range = (truth - place).norm() + clock + 0.1 * rng.sample::<f64, _>(StandardNormal);
            let Some(found) = tracker.push(0.5 * f64::from(k), name, range).unwrap() else {
                continue;
            };
            rows += 1;
            squares += (found.position - truth).norm_squared();
            held += usize::from((0..2).all(|i| (found.bands[i].0..=found.bands[i].1).contains(&truth[i])));
        }
    }
    let rms = (squares / f64::from(rows)).sqrt();
    assert!(
        tracker.losses() == 0 && rms < 0.4 && held * 10 > rows as usize * 8,
        "{rms}, {held} of {rows}, {}",
        tracker.losses()
    );
}

const HALL: [[f64; 2]; 5] = [[0.0, 0.0], [14.0, 1.0], [13.0, 10.0], [-1.0, 9.0], [6.0, 12.0]];

fn hall() -> Vec<(String, Vector3<f64>)> {
    let place = |(i, [x, y]): (usize, &[f64; 2])| (format!("h{i}"), Vector3::new(*x, *y, 0.0));
    HALL.iter().enumerate().map(place).collect()
}

/// Defect: ranges with a delay of 150 m put the target 100 m away with an error of scale of half, and no row was doubtful, since such ranges do not tell
/// the bias.
#[test]
fn a_scale_far_from_its_prior_is_doubtful() {
    let anchors = hall();
    let mut tracker = RangeTracker::new(anchors.clone(), Travel::Full, RangeSettings::default()).unwrap();
    let mut doubtful = 0;
    for k in 0..300 {
        let (name, place) = &anchors[k % 5];
        let truth = Vector3::new(5.0 + 3.0 * (0.02 * k as f64).sin(), 4.0 + 2.0 * (0.03 * k as f64).cos(), 0.0);
        let range = (truth - place).norm() + 150.0 + 0.1 * (2.4 * k as f64).sin();
        let found = tracker.push(0.25 * k as f64, name, range).unwrap();
        doubtful += usize::from(found.is_some_and(|found| found.is_doubtful || found.lost));
    }
    assert!(doubtful > 200, "{doubtful} of 300");
}

/// Defect: ranges of a target at rest, rounded to half a metre, were taken for hundreds of pieces of evidence: the target was 6.5 m higher than the
/// anchors, and 2 m beside its place.
#[test]
fn rounded_ranges_at_rest_tell_no_height() {
    let (anchors, truth) = (hall(), Vector3::new(4.2, 3.3, 0.0));
    let rounded = |k: usize| (2.0 * (truth - anchors[k % 5].1).norm()).round() / 2.0;
    let ranges: Vec<(f64, &str, f64)> = (0..400)
        .map(|k| (0.25 * k as f64, anchors[k % 5].0.as_str(), rounded(k)))
        .collect();
    assert_eq!(height_of(&anchors, RangeSettings::default(), &ranges).unwrap(), None);
}

/// Anchors whose places no number of a range's size can tell are refused for that, and not as if they stood at one place.
#[test]
fn anchors_in_an_absurd_unit_are_refused_for_their_unit() {
    let refusal = |unit: f64| {
        let anchors = hall().into_iter().map(|(name, place)| (name, unit * place));
        let tracker = RangeTracker::new(anchors, Travel::Full, RangeSettings::default());
        tracker.map(|_| ()).map_err(|error| error.to_string())
    };
    for unit in [1e200, 1e-200] {
        let found = refusal(unit).unwrap_err();
        assert!(found.contains("unit") && !found.contains("one place"), "{found}");
    }
    assert!(refusal(0.0).unwrap_err().contains("one place"));
    assert!([1e12, 1e-9].into_iter().all(|unit| refusal(unit).is_ok()));
}

/// Rows, coordinates held, the longest time wrong and the last error of a target whose ranges have this bias, scale and noise.
fn followed(
    places: &[[f64; 2]],
    truth: &[[f64; 2]],
    (bias, scale, noise): (f64, f64, f64),
    seed: u64,
) -> (usize, usize, usize, f64) {
    let place = |(i, [x, y]): (usize, &[f64; 2])| (format!("p{i}"), Vector3::new(*x, *y, 0.0));
    let anchors: Vec<(String, Vector3<f64>)> = places.iter().enumerate().map(place).collect();
    let mut rng = Stream::new(seed).named("followed").rng();
    let mut tracker = RangeTracker::new(anchors.clone(), Travel::Full, RangeSettings::default()).unwrap();
    let (mut rows, mut held, mut wrong, mut longest, mut off) = (0, 0, 0, 0, f64::NAN);
    for (k, [x, y]) in truth.iter().enumerate() {
        let (truth, (name, place)) = (Vector3::new(*x, *y, 0.0), &anchors[k % anchors.len()]);
        let range = (1.0 + scale) * (truth - place).norm() + bias + noise * rng.sample::<f64, _>(StandardNormal);
        let Some(found) = tracker.push(0.1 * k as f64, name, range).unwrap() else {
            continue;
        };
        rows += 2;
        held += (0..2)
            .filter(|i| (found.bands[*i].0..=found.bands[*i].1).contains(&truth[*i]))
            .count();
        let is_wrong = found.normalised_error(&truth).unwrap() > WRONG && !found.lost;
        wrong = if is_wrong { wrong + 1 } else { 0 };
        longest = longest.max(wrong);
        off = (found.position - truth).norm();
    }
    (rows, held, longest, off)
}

/// Defect: the slowest speed of the bank was that of a slow walk. A target that rested while bias and scale were unknown was drawn metres away,
/// under a narrow band.
#[test]
fn a_target_that_rests_first_is_not_drawn_away() {
    let places = [[0.0, 0.0], [30.0, 2.0], [28.0, 24.0], [-2.0, 20.0]];
    for (seed, place) in [[20.0, 7.0], [4.0, 16.0]].into_iter().enumerate() {
        let mut truth = vec![place; 1000];
        // It walks in the end.
        truth.extend((1..100).map(|k| [place[0] + 0.08 * f64::from(k), place[1]]));
        let (_, _, longest, off) = followed(&places, &truth, (0.3, 0.03, 0.05), seed as u64);
        assert!(longest < LONG && off < 0.5, "{place:?}: {longest}, {off}");
    }
}

/// Defect: of anchors on a line ranges never tell the side, and one side was dropped while the target was near the line.
#[test]
fn anchors_on_a_line_leave_both_sides() {
    let places: Vec<[f64; 2]> = (0..6).map(|i| [8.0 * f64::from(i), 0.0]).collect();
    let truth: Vec<[f64; 2]> = (0..1200)
        .map(|k| {
            let time = 0.1 * f64::from(k);
            [20.0 + 18.0 * (0.05 * time).sin(), 2.2 + 2.0 * (0.11 * time).sin()]
        })
        .collect();
    let (rows, held, longest, _) = followed(&places, &truth, (0.1, 0.0, 0.1), 3);
    assert!(longest < LONG && 10 * held > 9 * rows, "{held} of {rows}, {longest}");
}

/// The height of a target that climbs, with anchors of several heights.
#[test]
fn a_height_that_changes_is_told() {
    let anchors: Vec<(String, Vector3<f64>)> = hall()
        .into_iter()
        .zip([0.0, 6.0, 0.5, 7.0, 1.0])
        .map(|((name, place), z)| (name, place + z * Vector3::z()))
        .collect();
    let mut rng = Stream::new(31).named("climb").rng();
    let ranges: Vec<(f64, &str, f64)> = (0..400)
        .map(|k| {
            let (time, (name, place)) = (0.1 * k as f64, &anchors[k % 5]);
            let truth = Vector3::new(
                6.0 + 5.0 * (0.4 * time).sin(),
                5.0 + 4.0 * (0.3 * time).cos(),
                6.0 - 4.0 * (0.2 * time).cos(),
            );
            (time, name.as_str(), (truth - place).norm() + 0.03 * rng.sample::<f64, _>(StandardNormal))
        })
        .collect();
    let settings = RangeSettings {
        height: Height::Known(4.0),
        ..RangeSettings::default()
    };
    let found = mistake_of(&anchors, settings, &ranges).unwrap();
    assert!(
        matches!(found, Some(Mistake::HeightChanges { mean, .. }) if (2.0..10.0).contains(&mean)),
        "{found:?}"
    );
}

/// Ranges of the hall that a table has wrong are explained by what is wrong, and right ones, or one long anchor, by nothing.
#[test]
fn mistakes_of_tables_are_found() {
    let anchors = hall();
    let mut rng = Stream::new(23).named("mistakes").rng();
    let found =
        |anchors: &[(String, Vector3<f64>)], change: &dyn Fn(&str, f64) -> f64, noise: &mut dyn FnMut() -> f64| {
            let names: Vec<String> = (0..5).map(|i| format!("h{i}")).collect();
            let place = |name: &str| hall().into_iter().find(|(known, _)| known == name).unwrap().1;
            let ranges: Vec<(f64, &str, f64)> = (0..300)
                .map(|k| {
                    let (time, name) = (0.1 * k as f64, names[k % 5].as_str());
                    let truth = Vector3::new(6.0 + 3.0 * (0.2 * time).sin(), 5.0 + 2.5 * (0.15 * time).cos(), 0.0);
                    (time, name, change(name, (truth - place(name)).norm() + 0.1 + 0.05 * noise()))
                })
                .collect();
            mistake_of(anchors, RangeSettings::default(), &ranges).unwrap()
        };
    let mut noise = || rng.sample::<f64, _>(StandardNormal);
    let as_they_are = |_: &str, range: f64| range;
    assert_eq!(found(&anchors, &as_they_are, &mut noise), None);
    assert_eq!(found(&anchors, &|name, range| if name == "h3" { range + 1.5 } else { range }, &mut noise), None);
    let mut swapped = anchors.clone();
    (swapped[1].1, swapped[2].1) = (anchors[2].1, anchors[1].1);
    assert_eq!(found(&swapped, &as_they_are, &mut noise), Some(Mistake::Swapped("h1".to_owned(), "h2".to_owned())));
    let mut turned = anchors.clone();
    turned[1].1 = Vector3::new(1.0, 14.0, 0.0);
    assert_eq!(found(&turned, &as_they_are, &mut noise), Some(Mistake::Axes("h1".to_owned())));
    assert_eq!(found(&anchors, &|_, range| range * range, &mut noise), Some(Mistake::Squared));
    assert_eq!(found(&anchors, &|_, range| 2.0 * range, &mut noise), Some(Mistake::Doubled));
    assert_eq!(found(&anchors, &|_, range| 100.0 * range, &mut noise), Some(Mistake::Unit(0.01)));
    assert_eq!(found(&anchors, &|_, range| range / 0.149_896_229, &mut noise), Some(Mistake::RoundTrip));
    // Where an anchor is not heard, nothing is exchanged with it.
    let mut unheard = anchors.clone();
    unheard[1].1 = anchors[2].1 + Vector3::new(1.0, 1.0, 0.0);
    unheard.push(("silent".to_owned(), anchors[1].1));
    assert_eq!(found(&unheard, &as_they_are, &mut noise), None);
}

/// Defect: under a height that is not the target's, an anchor was told to be too long or too short.
#[test]
fn a_wrong_height_is_told_as_one() {
    let anchors: Vec<(String, Vector3<f64>)> = hall()
        .into_iter()
        .map(|(name, place)| (name, place + 2.6 * Vector3::z()))
        .collect();
    let mut rng = Stream::new(29).named("height").rng();
    let ranges: Vec<(f64, &str, f64)> = (0..400)
        .map(|k| {
            let (time, (name, place)) = (0.1 * k as f64, &anchors[k % 5]);
            let truth = Vector3::new(6.0 + 5.0 * (0.4 * time).sin(), 5.0 + 4.0 * (0.3 * time).cos(), 0.6);
            (time, name.as_str(), (truth - place).norm() + 0.03 * rng.sample::<f64, _>(StandardNormal))
        })
        .collect();
    let found = |height: f64| {
        let settings = RangeSettings {
            height: Height::Known(height),
            ..RangeSettings::default()
        };
        mistake_of(&anchors, settings, &ranges).unwrap()
    };
    let wrong = found(2.6);
    assert!(matches!(wrong, Some(Mistake::Height(height)) if (height - 0.6).abs() < 0.3), "{wrong:?}");
    assert_eq!(found(0.6), None);
}

/// Four minutes in the hall in which two anchors are late together, again and again. Returns rows, coordinates held, the longest time wrong, and the root
/// mean square of the error.
fn late_together(seed: u64) -> (usize, usize, usize, f64) {
    let anchors = hall();
    let mut rng = Stream::new(seed).named("late").rng();
    let model = ContinuousLinear::forgotten_velocity_2d(0.7, 6.0).unwrap();
    let mut state = Vector4::new(6.0, 0.0, 5.0, 0.0);
    let mut tracker = RangeTracker::new(anchors.clone(), Travel::Full, RangeSettings::default()).unwrap();
    let (mut lateness, mut held, mut rows, mut wrong, mut longest, mut squares) = (0.0, 0, 0, 0, 0, 0.0);
    for k in 0..1200_usize {
        let time = 0.2 * k as f64;
        state = model.over(0.2).unwrap().propagate(&mut rng, &state);
        if lateness > 0.0 && rng.random::<f64>() < 0.025 {
            lateness = 0.0;
        } else if lateness == 0.0 && time > 20.0 && rng.random::<f64>() < 0.017 {
            lateness = 0.5 + 2.5 * rng.random::<f64>();
        }
        let own = [0.0, 0.0, 0.7, 1.0, 0.0][k % 5] * lateness;
        let truth = Vector3::new(state[0], state[2], 0.0);
        let (name, place) = &anchors[k % 5];
        let range = (truth - place).norm() + own + 0.2 + 0.04 * rng.sample::<f64, _>(StandardNormal);
        let Some(found) = tracker.push(time, name, range).unwrap() else {
            continue;
        };
        rows += 1;
        held += (0..2)
            .filter(|i| (found.bands[*i].0..=found.bands[*i].1).contains(&truth[*i]))
            .count();
        squares += (found.position - truth).norm_squared();
        let is_wrong = found.normalised_error(&truth).unwrap() > WRONG && !found.lost;
        wrong = if is_wrong { wrong + 1 } else { 0 };
        longest = longest.max(wrong);
    }
    (rows, held, longest, (squares / rows as f64).sqrt())
}

/// Defect: the first range of an anchor that became late was taken for one that the target had moved, so that good anchors contradicted it and were left
/// out: the place was metres off for minutes.
#[test]
fn anchors_that_are_late_for_a_while_are_left_out() {
    let (mut rows, mut held) = (0, 0);
    for seed in [0, 1, 2, 24, 133, 171] {
        let found = late_together(seed);
        println!("{found:?}");
        assert!(found.2 < LONG && found.3 < 1.0, "seed {seed}: {found:?}");
        rows += 2 * found.0;
        held += found.1;
    }
    assert!(100 * held > 90 * rows, "{held} of {rows}");
}

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().and_then(|number| number.parse().ok())
}

/// The measurement in full: `ROOMS` rooms from seed `FROM` on, with the default settings.
#[test]
#[ignore = "minutes"]
fn four_hundred_rooms() {
    let (from, rooms) = (number("FROM").unwrap_or(0), number("ROOMS").unwrap_or(400));
    let found = TRAVELS.map(|travel| (travel, measure(from..from + rooms, travel, RangeSettings::default(), false)));
    for (travel, (share, wrong)) in found {
        assert!(wrong == 0, "{travel:?}: {wrong} rooms");
        assert!((0.93..=0.97).contains(&share), "{travel:?}: bands hold {share}");
    }
}

/// The same with one anchor that is too long for good.
#[test]
#[ignore = "minutes"]
fn rooms_with_a_long_anchor() {
    let (from, rooms) = (number("FROM").unwrap_or(0), number("ROOMS").unwrap_or(120));
    let (share, wrong) = measure(from..from + rooms, Travel::Full, RangeSettings::default(), true);
    assert!(wrong == 0, "{wrong} rooms");
    assert!((0.93..=0.97).contains(&share), "bands hold {share}");
}

/// A target that creeps for four minutes along a line in a room of four anchors. Returns rows, rows held per coordinate, and the longest time wrong.
fn creep(seed: u64, speed: Option<f64>, clock: bool) -> (usize, usize, usize) {
    let mut rng = Stream::new(seed).named("creep").rng();
    let anchors =
        [[0.0, 0.0], [10.0, 0.0], [10.0, 8.0], [0.0, 8.0]].map(|[x, y]| (format!("{x} {y}"), Vector3::new(x, y, 0.0)));
    let mut even = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let start = Vector3::new(even(1.0, 9.0), even(1.0, 7.0), 0.0);
    let speed = speed.unwrap_or_else(|| 1e-4 * 500.0_f64.powf(even(0.0, 1.0)));
    let heading = even(0.0, std::f64::consts::TAU);
    let velocity = speed * Vector3::new(heading.cos(), heading.sin(), 0.0);
    let settings = RangeSettings {
        unknown_clock: clock,
        ..RangeSettings::default()
    };
    let mut tracker = RangeTracker::new(anchors.clone(), Travel::Full, settings).unwrap();
    let noise = 0.02 * 5.0_f64.powf(rng.random::<f64>());
    let (mut held, mut rows, mut wrong, mut longest, mut offset) = (0, 0, 0, 0, 500.0);
    for k in 0..2400 {
        let time = 0.1 * (k / 4) as f64;
        let truth = start + time * velocity;
        if clock && k % 4 == 0 {
            offset += 5.0 * rng.sample::<f64, _>(StandardNormal);
        }
        let (name, place) = &anchors[k % 4];
        let delay = if clock { offset } else { 0.0 };
        let range = (truth - place).norm() + delay + noise * rng.sample::<f64, _>(StandardNormal);
        let Some(found) = tracker.push(time, name, range).unwrap() else {
            continue;
        };
        rows += 2;
        held += (0..2)
            .filter(|i| (found.bands[*i].0..=found.bands[*i].1).contains(&truth[*i]))
            .count();
        let nees = found.normalised_error(&truth).unwrap();
        wrong = if nees > WRONG && !found.lost { wrong + 1 } else { 0 };
        longest = longest.max(wrong);
    }
    (rows, held, longest)
}

/// Prints the share held over 50 places and speeds from .1 mm to 5 cm a second, and of targets that rest, with and without an unknown clock.
#[test]
#[ignore = "a minute"]
fn fifty_creeping_targets() {
    for (speed, clock) in [(None, false), (Some(0.0), false), (Some(0.0), true), (None, true)] {
        let found: Vec<(usize, usize, usize)> = std::thread::scope(|scope| {
            let runs = [0, 1]
                .map(|odd| scope.spawn(move || (0..25).map(|k| creep(2 * k + odd, speed, clock)).collect::<Vec<_>>()));
            runs.into_iter().flat_map(|run| run.join().unwrap()).collect()
        });
        let shares: Vec<f64> = found
            .iter()
            .map(|(rows, held, _)| *held as f64 / *rows as f64)
            .collect();
        let mean = shares.iter().sum::<f64>() / shares.len() as f64;
        let variance =
            shares.iter().map(|share| (share - mean).powi(2)).sum::<f64>() / (shares.len() * (shares.len() - 1)) as f64;
        let wrong = found.iter().filter(|(_, _, longest)| *longest >= LONG).count();
        let least = shares.iter().copied().fold(1.0, f64::min);
        println!(
            "speed {speed:?}, clock {clock}: held {mean:.4} +- {:.4}, least {least:.3}, wrong in {wrong}",
            variance.sqrt()
        );
    }
}
