//! Laws of the Green's functions: mass, reciprocity, walls, and closed forms against quadrature.

use fewbits_models::diffusion::{Air, Axis, Flux, Ground, ImpulseResponse, Release, Space, Wall, step_response};
use fewbits_numerics::quadrature::Rule;
use nalgebra::Vector3;
use proptest::prelude::*;
use std::f64::consts::TAU;

fn mass(axis: &Axis, low: f64, high: f64, source: f64, age: f64) -> f64 {
    Rule::gauss_legendre(20).composite(low, high, 60, |z| axis.green(z, source, age))
}

proptest! {
    // One case in 4 of `PROPTEST_CASES`: they are dear.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.div_ceil(4), ..ProptestConfig::default() })]

    /// Nothing depends on the unit of length or time.
    #[test]
    fn half_space_scales(z in 0.0..3.0f64, z0 in 0.0..3.0f64, t in 0.1..5.0f64, loss in 0.0..8.0f64, unit in prop::sample::select(vec![1e-4, 1.0, 1e4])) {
        let base = Axis::half_space(1.0, Wall::permeable(loss).unwrap()).unwrap().green(z, z0, t);
        let scaled = Axis::half_space(unit * unit, Wall::permeable(loss * unit).unwrap()).unwrap().green(z * unit, z0 * unit, t);
        prop_assert!((scaled * unit - base).abs() <= 1e-12 * base);
    }

    /// Erratum `diffusive-5`.
    #[test]
    fn mass_is_kept_or_lost(z0 in 0.0..4.0f64, t in 0.05..3.0f64, loss in 0.0..6.0f64, v in -1.5..1.5f64) {
        let reach = z0 + 1.5 * t + 14.0 * (2.0 * 1.3 * t).sqrt();
        let tight = Axis::half_space(1.3, Wall::IMPERMEABLE).unwrap().with_wind(v, Flux::Total).unwrap();
        prop_assert!((mass(&tight, 0.0, reach, z0, t) - 1.0).abs() < 1e-9);
        let lossy = Axis::half_space(1.3, Wall::permeable(loss).unwrap()).unwrap().with_wind(v, Flux::Total).unwrap();
        let (early, late) = (mass(&lossy, 0.0, reach, z0, t), mass(&lossy, 0.0, reach * 1.5, z0, 1.5 * t));
        prop_assert!(early <= 1.0 + 1e-9 && late <= early + 1e-9 && late >= 0.0);
    }

    #[test]
    fn reciprocity(a in 0.0..1.0f64, b in 0.0..1.0f64, t in 0.002..2.0f64, loss in 0.0..50.0f64) {
        for wall in [Wall::permeable(loss).unwrap(), Wall::ABSORBING] {
            let axis = Axis::half_space(0.7, wall).unwrap();
            let (there, back) = (axis.green(a, b, t), axis.green(b, a, t));
            prop_assert!((there - back).abs() <= 1e-12 * there.max(1e-3) && there >= 0.0);
        }
    }

    /// `kappa dc/dz = (loss + v) c` at the wall for the total flux, `loss c` for the diffusive flux.
    #[test]
    fn wall_law(z0 in 0.3..2.0f64, t in 0.2..2.0f64, loss in 0.0..5.0f64, v in -1.0..1.0f64) {
        for (flux, law) in [(Flux::Total, loss + v), (Flux::Diffusive, loss)] {
            let axis = Axis::half_space(1.3, Wall::permeable(loss).unwrap()).unwrap().with_wind(v, flux).unwrap();
            let c = |z: f64| axis.green(z, z0, t);
            let h = 1e-3;
            let slope = (-25.0 * c(0.0) + 48.0 * c(h) - 36.0 * c(2.0 * h) + 16.0 * c(3.0 * h) - 3.0 * c(4.0 * h)) / (12.0 * h);
            prop_assert!((1.3 * slope - law * c(0.0)).abs() < 1e-7);
        }
    }
}

/// The printed wall law creates mass in wind away from the wall; the law of the total flux keeps it.
/// Erratum `diffusive-6`.
#[test]
fn wind_across_the_wall() {
    let axis = |flux, loss| {
        Axis::half_space(1.3, Wall::permeable(loss).unwrap())
            .unwrap()
            .with_wind(1.5, flux)
            .unwrap()
    };
    let printed = mass(&axis(Flux::Diffusive, 0.2), 0.0, 30.0, 1.0, 1.0);
    assert!((printed - 1.345).abs() < 5e-4, "{printed}");
    assert!(mass(&axis(Flux::Total, 0.2), 0.0, 30.0, 1.0, 1.0) < 1.0);
    assert!((mass(&axis(Flux::Total, 0.0), 0.0, 30.0, 1.0, 1.0) - 1.0).abs() < 1e-10);
}

/// Closed forms against the integral of the Green's function over the age.
#[test]
fn closed_forms_are_their_integrals() {
    for (wind, ground) in [
        (Vector3::zeros(), Ground::None),
        (Vector3::new(-20.0, -10.0, 0.0), Ground::Impermeable),
        (Vector3::new(3.0, 1.0, -2.0), Ground::None),
        (Vector3::new(1.0, 0.0, 0.0), Ground::Wall(Wall::ABSORBING)),
    ] {
        let air = Air::new(40.0, wind, ground).unwrap();
        for (field, source, age) in [
            (Vector3::new(63.0, 38.0, 2.0), Vector3::new(73.0, 38.0, 1.0), 5.0),
            (Vector3::new(80.0, 40.0, 0.5), Vector3::new(73.0, 38.0, 0.2), 25.0),
            (Vector3::new(44.0, 52.0, 1.0), Vector3::new(73.0, 38.0, 3.0), 50.0),
        ] {
            let (closed, integral) =
                (air.concentration(&field, &source, age), step_response(&air, &field, &source, age, 1e-3));
            assert!((closed / integral - 1.0).abs() < 1e-10, "{wind:?} {ground:?}: {closed} {integral}");
        }
    }
}

#[test]
fn permeable_ground_between_its_limits() {
    let at = |wall: Wall, height: f64| {
        let air = Air::new(4.0, Vector3::zeros(), Ground::Wall(wall)).unwrap();
        air.concentration(&Vector3::new(3.0, 4.0, height), &Vector3::new(0.0, 0.0, 1.0), 10.0)
    };
    let tiny = at(Wall::permeable(1e-13).unwrap(), 0.5);
    assert!((tiny / at(Wall::IMPERMEABLE, 0.5) - 1.0).abs() < 1e-11);
    let huge = at(Wall::permeable(1e9).unwrap(), 0.5);
    assert!((huge / at(Wall::ABSORBING, 0.5) - 1.0).abs() < 1e-6);
    assert!(at(Wall::permeable(0.5).unwrap(), 0.5) < tiny);
}

#[test]
fn gradients_are_differences() {
    for (wind, ground) in [
        (Vector3::zeros(), Ground::Impermeable),
        (Vector3::new(-20.0, -10.0, 0.0), Ground::Impermeable),
        (Vector3::new(3.0, 1.0, 2.0), Ground::None),
        (Vector3::zeros(), Ground::Wall(Wall::ABSORBING)),
        (Vector3::new(0.5, 0.0, 0.0), Ground::Wall(Wall::permeable(4.0).unwrap())),
    ] {
        let air = Air::new(40.0, wind, ground).unwrap();
        let (field, source, age) = (Vector3::new(63.0, 41.0, 1.0), Vector3::new(70.0, 38.0, 2.0), 8.0);
        let got = air.source_gradient(&field, &source, age);
        assert!((got.value / air.concentration(&field, &source, age) - 1.0).abs() < 1e-12);
        for i in 0..3 {
            let h = 1e-4;
            let mut up = source;
            up[i] += h;
            let mut down = source;
            down[i] -= h;
            let slope = (air.concentration(&field, &up, age) - air.concentration(&field, &down, age)) / (2.0 * h);
            assert!((got.gradient[i] - slope).abs() < 2e-7 * got.gradient.norm(), "{wind:?} {ground:?} {i}");
        }
    }
}

/// Over impermeable ground all that was released is still there.
#[test]
fn released_mass_is_in_the_half_space() {
    let air = Air::new(40.0, Vector3::zeros(), Ground::Impermeable).unwrap();
    let age: f64 = 30.0;
    let reach = 14.0 * (2.0 * 40.0 * age).sqrt();
    let total = Rule::gauss_legendre(20).composite(0.0, reach, 100, |r| {
        TAU * r * r * air.concentration(&Vector3::new(r, 0.0, 0.0), &Vector3::zeros(), age)
    });
    assert!((total / age - 1.0).abs() < 1e-9);
}

#[test]
fn a_smooth_rate_between_its_steps() {
    let air = Air::new(40.0, Vector3::zeros(), Ground::Impermeable).unwrap();
    let (field, source) = (Vector3::new(10.0, 0.0, 0.0), Vector3::zeros());
    let impulse = |age: f64| air.green(&field, &source, age);
    let constant = Release::varying(|_| 1.0, 0.0, 20.0, (40.0, 10.0), impulse).unwrap();
    assert!((constant / air.concentration(&field, &source, 20.0) - 1.0).abs() < 1e-11);
    let ramp = Release::varying(|t| t, 0.0, 20.0, (40.0, 10.0), impulse).unwrap();
    let steps = 4000;
    let edges: Vec<f64> = (0..=steps).map(|i| 20.0 * i as f64 / steps as f64).collect();
    let rates: Vec<f64> = edges.windows(2).map(|e| 0.5 * (e[0] + e[1])).collect();
    let stepped = Release::piecewise(edges, rates)
        .unwrap()
        .concentration(20.0, |age| air.concentration(&field, &source, age));
    assert!((ramp / stepped - 1.0).abs() < 1e-5);
}

#[test]
fn extremes_stay_finite() {
    for wind in [0.0, 1e-9, 20.0, 1e4] {
        for ground in [
            Ground::None,
            Ground::Impermeable,
            Ground::Wall(Wall::ABSORBING),
            Ground::Wall(Wall::permeable(2.0).unwrap()),
        ] {
            let air = Air::new(40.0, Vector3::new(wind, 0.0, 0.0), ground).unwrap();
            for distance in [0.0, 1e-9, 1.0, 1e3, 1e8] {
                for age in [-1.0, 0.0, 1e-12, 1.0, 1e9] {
                    for sign in [-1.0, 1.0] {
                        let (field, source) = (Vector3::new(sign * distance, 0.0, 0.0), Vector3::zeros());
                        let c = air.concentration(&field, &source, age);
                        assert!(c.is_finite() && c >= 0.0, "{wind} {ground:?} {distance} {age}: {c}");
                        let g = air.source_gradient(&field, &source, age);
                        assert!(
                            g.value.is_finite() && g.gradient.iter().all(|x| x.is_finite()),
                            "{wind} {ground:?} {distance} {age}: {g:?}"
                        );
                    }
                }
            }
        }
    }
    let steep = Axis::half_space(1.3, Wall::permeable(60.0).unwrap()).unwrap();
    assert!(steep.green(10.0, 1.0, 1.0) > 0.0);
    let space = Space::new([Axis::open(1.0).unwrap(); 3]).unwrap();
    assert_eq!(space.green(&Vector3::zeros(), &Vector3::zeros(), -1.0), 0.0);
    assert!(Axis::open(0.0).is_err() && Air::new(-1.0, Vector3::zeros(), Ground::None).is_err());
}

/// Defect: a wind of 1e167 m/s had concentrations that were no numbers.
#[test]
fn winds_beyond_the_range_of_squares_are_refused() {
    let air = |k: f64, wind: f64| Air::new(k, Vector3::new(wind, 0.0, 0.0), Ground::Impermeable);
    for (k, wind) in [
        (40.0, 1e167),
        (40.0, -1e61),
        (1e-61, 1.0),
        (1e300, 1.0),
        (40.0, f64::NAN),
    ] {
        assert!(air(k, wind).is_err(), "{k} {wind}");
    }
    assert!(air(40.0, 1.0).unwrap().with_closest(1e-61).is_err());
    for (k, wind, closest) in [
        (1e-60, 1e60, 1e-60),
        (1e60, 1e60, 1e60),
        (1e60, 1e-60, 1e-60),
        (1e-60, 0.0, 1e-60),
    ] {
        let air = air(k, wind).unwrap().with_closest(closest).unwrap();
        for distance in [-f64::MAX, -1e60, -1.0, 0.0, 1e-300, 1.0, 1e60, 1e100, f64::MAX] {
            for age in [5e-324, 1e-60, 1.0, 1e60, f64::MAX, f64::INFINITY] {
                let (field, source) = (Vector3::new(distance, 0.0, 0.0), Vector3::zeros());
                let g = air.source_gradient(&field, &source, age);
                let numbers = [
                    g.value,
                    g.gradient.x,
                    g.gradient.y,
                    air.concentration(&field, &source, age),
                ];
                assert!(numbers.iter().all(|x| x.is_finite()), "{air:?} {distance} {age}: {numbers:?}");
            }
        }
    }
    // An infinite age is the steady state: exp(-(r - x) v / 2 k) / (2 pi k r) above impermeable ground.
    let windy = air(40.0, 20.0).unwrap();
    let steady = windy.concentration(&Vector3::new(-3.0, 4.0, 0.0), &Vector3::zeros(), f64::INFINITY);
    let expected = (-(5.0 + 3.0) * 20.0_f64 / 80.0).exp() / (2.0 * std::f64::consts::PI * 40.0 * 5.0);
    assert!((steady / expected - 1.0).abs() < 1e-12, "{steady} {expected}");
}
