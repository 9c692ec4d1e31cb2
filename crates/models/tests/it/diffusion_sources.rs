//! Sources over every ground: gradients, closest distances, releases in time, contours and tables.

use fewbits_models::diffusion::{
    Air, Axis, Flux, Ground, ImpulseResponse, Profile, Release, Space, Wall, contour_radius, disk_source,
    moving_source, step_response,
};
use fewbits_numerics::quadrature::Rule;
use nalgebra::{Vector2, Vector3};
use std::cell::Cell;
use std::f64::consts::{PI, TAU};

fn close(got: f64, want: f64, tolerance: f64) {
    assert!((got - want).abs() <= tolerance * want.abs(), "{got}, expected {want}");
}

/// Ground that takes nearly nothing away is integrated and differenced; impermeable ground has closed forms.
#[test]
fn differences_over_permeable_ground_are_the_closed_gradient() {
    let wind = Vector3::new(0.9, -0.4, 0.0);
    let closed = Air::new(1.4, wind, Ground::Impermeable).unwrap();
    let tight = Air::new(1.4, wind, Ground::Wall(Wall::permeable(1e-13).unwrap())).unwrap();
    let also_closed = Air::new(1.4, wind, Ground::Wall(Wall::IMPERMEABLE)).unwrap();
    for (field, source, age) in [
        (Vector3::new(6.3, 4.1, 0.7), Vector3::new(4.2, 3.8, 0.9), 2.3),
        (Vector3::new(6.3, 4.1, 0.7), Vector3::new(4.2, 3.8, 0.0), 2.3),
        (Vector3::new(3.1, 4.9, 0.0), Vector3::new(4.2, 3.8, 1e-7), 5.0),
        // So early that the concentration falls by a factor of ten within a hundredth of the distance.
        (Vector3::new(33.0, -8.0, 3.0), Vector3::new(4.2, 3.8, 2.0), 0.35),
        (Vector3::new(33.0, -8.0, 3.0), Vector3::new(4.2, 3.8, 0.0), 0.35),
        // Closer than counts: moved out along x.
        (Vector3::new(0.5, 0.3, 1.1), Vector3::new(0.45, 0.3, 1.1), 2.0),
    ] {
        let (want, got) = (closed.source_gradient(&field, &source, age), tight.source_gradient(&field, &source, age));
        close(got.value, want.value, 1e-10);
        assert!((got.gradient - want.gradient).amax() < 1e-6 * want.gradient.amax(), "{got:?} {want:?}");
        assert_eq!(also_closed.source_gradient(&field, &source, age), want);
    }
    // On the ground the source obeys the law of the wall as the field does.
    let lossy = Air::new(1.4, wind, Ground::Wall(Wall::permeable(0.6).unwrap())).unwrap();
    let (field, source) = (Vector3::new(6.3, 4.1, 0.7), Vector3::new(4.2, 3.8, 0.0));
    let on_ground = lossy.source_gradient(&field, &source, 2.3);
    close(on_ground.gradient.z, 0.6 / 1.4 * on_ground.value, 1e-6);
}

#[test]
fn nothing_is_below_the_ground_and_nothing_before() {
    let (above, below) = (Vector3::new(1.3, 0.4, 0.8), Vector3::new(1.1, 0.9, -0.2));
    let place = Vector3::new(0.2, -0.3, 0.6);
    for ground in [
        Ground::Impermeable,
        Ground::Wall(Wall::ABSORBING),
        Ground::Wall(Wall::permeable(0.3).unwrap()),
    ] {
        let air = Air::new(1.4, Vector3::new(0.3, 0.2, 0.0), ground).unwrap();
        assert!(air.concentration(&above, &place, 2.0) > 0.0);
        for (field, source, age) in [
            (above, below, 2.0),
            (below, above, 2.0),
            (above, place, 0.0),
            (above, place, -2.0),
        ] {
            assert_eq!(air.concentration(&field, &source, age), 0.0);
            let gradient = air.source_gradient(&field, &source, age);
            assert!(gradient.value == 0.0 && gradient.gradient == Vector3::zeros());
            assert_eq!(air.green(&field, &source, age), 0.0);
        }
        assert!(Air::new(1.4, Vector3::new(0.3, 0.2, 0.1), ground).is_err());
    }
    let open = Air::new(1.4, Vector3::new(0.3, 0.2, 0.1), Ground::None).unwrap();
    assert!(open.concentration(&above, &below, 2.0) > 0.0 && open.source_gradient(&below, &above, 2.0).value > 0.0);
    // Over absorbing ground nothing is left on it, of a source on it nothing anywhere.
    let absorbing = Air::new(1.4, Vector3::zeros(), Ground::Wall(Wall::ABSORBING)).unwrap();
    let (on_ground, high) = (Vector3::new(1.3, 0.4, 0.0), Vector3::new(0.1, 0.2, 0.7));
    assert_eq!(absorbing.concentration(&high, &on_ground, 3.0), 0.0);
    assert!(absorbing.concentration(&on_ground, &high, 3.0) < 1e-15);
}

/// Distances below the closest count as that, in the direction they have.
#[test]
fn the_pole_is_cut_off_along_the_ray() {
    let ray = Vector3::new(0.48, 0.6, -0.64);
    for wind in [Vector3::zeros(), Vector3::new(7.0, -3.0, 2.0)] {
        let air = Air::new(1.4, wind, Ground::None).unwrap();
        let air = air.with_closest(0.2).unwrap();
        let edge = air.concentration(&(ray * 0.2), &Vector3::zeros(), 3.0);
        close(air.concentration(&(ray * 0.05), &Vector3::zeros(), 3.0), edge, 1e-13);
        assert!(air.concentration(&(ray * 0.21), &Vector3::zeros(), 3.0) < edge);
        let middle = air.concentration(&Vector3::zeros(), &Vector3::zeros(), 3.0);
        assert!(middle > 0.0 && middle.is_finite());
    }
    assert!(
        Air::new(1.4, Vector3::zeros(), Ground::None)
            .unwrap()
            .with_closest(0.0)
            .is_err()
    );
    // The integral moves places that coincide apart along x.
    let air = Air::new(1.4, Vector3::new(7.0, -3.0, 0.0), Ground::None).unwrap();
    let place = Vector3::new(0.3, 0.4, 0.5);
    let moved = air.concentration(&(place + Vector3::x() * 0.3), &place, 3.0);
    close(step_response(&air, &place, &place, 3.0, 0.3), moved, 1e-11);
    close(step_response(&air, &(place + Vector3::y() * 0.2), &place, 3.0, 0.3), moved, 1e-11);
}

#[test]
fn axes_and_spaces_say_what_they_are() {
    let windy = |v| Axis::open(1.4).unwrap().with_wind(v, Flux::Total).unwrap();
    let space = Space::new([windy(0.7), windy(-0.2), Axis::half_space(1.4, Wall::ABSORBING).unwrap()]).unwrap();
    assert_eq!(space.diffusivity(), 1.4);
    assert!(Space::new([windy(0.7), windy(0.7), Axis::open(1.5).unwrap()]).is_err());
    assert!(windy(0.7).with_wind(f64::NAN, Flux::Total).is_err());
    // A Gaussian that the wind carries.
    let (x, t) = (0.9_f64, 1.3);
    let want = (-(x - 0.4 - 0.7 * t).powi(2) / (4.0 * 1.4 * t)).exp() / (4.0 * PI * 1.4 * t).sqrt();
    close(windy(0.7).green(x, 0.4, t), want, 1e-14);
    assert_eq!(windy(0.7).green(x, 0.4, 0.0), 0.0);
}

/// A varying rate is its first value, and every later change from its own instant on.
#[test]
fn a_varying_rate_is_a_sum_of_steps() {
    for distance in [0.3, 2.9] {
        let air = Air::new(1.4, Vector3::new(0.8, 0.1, 0.0), Ground::None).unwrap();
        let (field, source) = (Vector3::new(distance, 0.0, 0.0), Vector3::zeros());
        let step = |age: f64| air.concentration(&field, &source, age);
        let (start, time) = (3.1, 9.7);
        let rate = |t: f64| 1.7 + 0.4 * t - 0.03 * t * t;
        let changes = Rule::gauss_legendre(40).composite(start, time, 200, |t| (0.4 - 0.06 * t) * step(time - t));
        let want = rate(start) * step(time - start) + changes;
        let calls = Cell::new(0);
        let impulse = |age: f64| {
            calls.set(calls.get() + 1);
            air.green(&field, &source, age)
        };
        let got = Release::varying(rate, start, time, (1.4, distance), impulse).unwrap();
        close(got, want, 1e-10);
        assert!(calls.get() <= 1000, "{} evaluations", calls.get());
        let at = |start, time| Release::varying(rate, start, time, (1.4, distance), impulse).unwrap();
        assert_eq!([at(3.1, 3.1), at(3.1, 2.0), at(3.1, 3.1 + 1e-9)], [0.0; 3]);
        assert!(Release::varying(rate, start, time, (0.0, distance), impulse).is_err());
        assert!(Release::varying(rate, start, time, (1.4, -distance), impulse).is_err());
        // A rate that is not a number is no reason to look for ever.
        calls.set(0);
        assert!(
            Release::varying(|_| f64::NAN, start, time, (1.4, distance), impulse)
                .unwrap()
                .is_nan()
        );
        assert!(calls.get() <= 1000, "{} evaluations", calls.get());
    }
}

#[test]
fn piecewise_rates_are_boxes() {
    let growth = |age: f64| age * age;
    let release = Release::piecewise(vec![1.0, 2.5, 4.0, f64::INFINITY], vec![0.7, 0.0, 1.9]).unwrap();
    for (time, want) in [
        (0.5, 0.0),
        (1.0, 0.0),
        (1.9, 0.7 * 0.81),
        (3.0, 0.7 * (4.0 - 0.25)),
        (5.0, 0.7 * (16.0 - 6.25) + 1.9),
    ] {
        assert!((release.concentration(time, growth) - want).abs() < 1e-13, "{time}");
    }
    let from = Release::during(0.3, f64::INFINITY, 2.0).unwrap();
    assert!((from.concentration(1.5, growth) - 2.0 * 1.44).abs() < 1e-14);
    // What falls with the age would leave less than nothing.
    let during = Release::during(0.3, 0.9, 2.0).unwrap();
    assert_eq!(during.concentration(1.5, |age| -age), 0.0);
    for (edges, rates) in [
        (vec![1.0, 1.0], vec![1.0]),
        (vec![2.0, 1.0], vec![1.0]),
        (vec![f64::NEG_INFINITY, 1.0], vec![1.0]),
        (vec![f64::NAN, 1.0], vec![1.0]),
        (vec![1.0, 2.0], vec![-0.1]),
        (vec![1.0, 2.0], vec![f64::INFINITY]),
        (vec![1.0, 2.0], vec![1.0, 1.0]),
        (vec![1.0], vec![]),
        (vec![], vec![]),
    ] {
        assert!(Release::piecewise(edges.clone(), rates.clone()).is_err(), "{edges:?} {rates:?}");
    }
}

#[test]
fn the_threshold_is_met_at_the_contour() {
    for (rate, threshold, age, diffusivity) in [(1.3, 1e-3, 60.0, 4.0), (0.7, 2e3, 5.0, 0.3), (1e-9, 1e-3, 1e12, 4.0)] {
        let radius = contour_radius(rate, threshold, age, diffusivity).unwrap();
        let there = rate * libm::erfc(radius / (4.0 * diffusivity * age).sqrt()) / (TAU * diffusivity * radius);
        close(there, threshold, 1e-12);
    }
    assert_eq!(contour_radius(1.3, 1e-3, 0.0, 4.0).unwrap(), 0.0);
    assert!(contour_radius(0.0, 1e-3, 1.0, 4.0).is_err() && contour_radius(1.0, -1e-3, 1.0, 4.0).is_err());
    assert!(contour_radius(1.0, 1e-3, 1.0, 0.0).is_err());
}

#[test]
fn tables_end_where_they_should() {
    let f = |r: f64| [(0.7 * r).sin(), 1.0 / (1.0 + r)];
    let table = Profile::new(5.3, 0.4, f).unwrap();
    assert!((table.end() - 5.3).abs() < 1e-14);
    assert_eq!((table.at(-0.3), table.at(9.0)), (table.at(0.0), table.at(5.3)));
    for r in [0.0, 0.1, 0.41, 2.9, 5.17, 5.3] {
        let (got, want) = (table.at(r), f(r));
        assert!((got[0] - want[0]).abs() < 1e-12 && (got[1] - want[1]).abs() < 1e-10, "{r}: {got:?} {want:?}");
    }
    // As many panels as the width asks for, and no more.
    let calls = Cell::new(0);
    let counted = |r: f64| {
        calls.set(calls.get() + 1);
        [r]
    };
    Profile::new(5.3, 0.4, counted).unwrap();
    assert_eq!(calls.get(), 10 * 14);
    assert!(Profile::new(5.3, 0.0, f).is_err() && Profile::new(5.3, 1.0, |_| [f64::INFINITY]).is_err());
}

/// A moving source in its own frame, and as the integral over what it left behind.
#[test]
fn a_moving_source_leaves_its_trail() {
    let wind = Vector3::new(0.5, -0.3, 0.0);
    let air = Air::new(1.4, wind, Ground::Impermeable).unwrap();
    let (field, start, velocity) =
        (Vector3::new(3.1, 1.2, 0.9), Vector3::new(0.2, -0.4, 0.3), Vector3::new(0.9, 0.4, 0.0));
    let age = 2.6;
    let got = moving_source(&air, &field, &start, &velocity, age).unwrap();
    let trail =
        Rule::gauss_legendre(40).composite(0.0, age, 30, |t| air.green(&field, &(start + velocity * t), age - t));
    close(got, trail, 1e-9);
    assert!(moving_source(&air, &field, &start, &Vector3::z(), age).is_err());
    assert!(moving_source(&air, &field, &start, &Vector3::repeat(f64::NAN), age).is_err());
}

/// Over any ground, and none: the integral over what was left behind.
#[test]
fn moving_source_keeps_the_airs_ground() {
    let (field, start, velocity) =
        (Vector3::new(3.1, 1.2, 0.9), Vector3::new(0.2, -0.4, 0.3), Vector3::new(0.9, 0.4, 0.0));
    let age = 2.6;
    let leaking = Ground::Wall(Wall::permeable(0.7).unwrap());
    for ground in [
        Ground::None,
        Ground::Impermeable,
        Ground::Wall(Wall::ABSORBING),
        leaking,
    ] {
        let air = Air::new(1.4, Vector3::new(0.5, -0.3, 0.0), ground).unwrap();
        let got = moving_source(&air, &field, &start, &velocity, age).unwrap();
        let trail =
            Rule::gauss_legendre(40).composite(0.0, age, 30, |t| air.green(&field, &(start + velocity * t), age - t));
        close(got, trail, 1e-9);
    }
}

/// The mean over the disk, by brute force in Cartesian coordinates.
#[test]
fn a_disk_is_the_mean_of_its_points() {
    let air = Air::new(1.4, Vector3::new(0.5, -0.3, 0.0), Ground::Impermeable).unwrap();
    let (field, centre, height, radius) = (Vector3::new(3.1, 1.2, 0.9), Vector2::new(0.2, -0.4), 0.3, 0.8);
    let rule = Rule::gauss_legendre(24);
    // x = radius sin(s) takes the square root out of the ends.
    let mean = rule.sum(-0.5 * PI, 0.5 * PI, |s| {
        let half = radius * s.cos();
        half * rule.sum(-half, half, |y| {
            air.concentration(&field, &Vector3::new(centre.x + radius * s.sin(), centre.y + y, height), 2.0)
        })
    }) / (PI * radius * radius);
    close(disk_source(&air, &field, (centre, height), radius, 2.0, 16).unwrap(), mean, 1e-9);
    assert!(disk_source(&air, &field, (centre, height), 0.0, 2.0, 16).is_err());
    assert!(disk_source(&air, &field, (centre, height), radius, 2.0, 0).is_err());
}
