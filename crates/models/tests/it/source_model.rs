//! The laws of `SourceModel`, on the air.

use fewbits_models::diffusion::{Air, Ground, Wall};
use fewbits_models::{Receptor, SourceModel};
use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;
use std::sync::Arc;

fn grounds() -> [Ground; 4] {
    [
        Ground::None,
        Ground::Impermeable,
        Ground::Wall(Wall::ABSORBING),
        Ground::Wall(Wall::permeable(0.8).unwrap()),
    ]
}

fn air(ground: usize, windy: bool) -> Air {
    let wind = if windy {
        Vector3::new(-2.0, 0.7, 0.0)
    } else {
        Vector3::zeros()
    };
    Air::new(4.0, wind, grounds()[ground]).unwrap()
}

fn at(place: Vector3<f64>) -> Receptor {
    air(0, false).receptor(&place).unwrap()
}

#[test]
fn shared_model_has_the_same_field() {
    let own = air(1, true);
    let shared: Arc<dyn SourceModel> = Arc::new(own);
    let (receptor, source) = (at(Vector3::new(3.0, 1.0, 0.5)), Vector3::new(-1.0, 2.0, 1.0));
    let (ages, mut out) = ([-1.0, 0.0, 0.3, 4.0, f64::INFINITY], [f64::NAN; 5]);
    shared.concentrations(&receptor, &source, &ages, &mut out);
    assert_eq!(out, ages.map(|age| own.concentration(&receptor.place, &source, age)));
    assert_eq!((out[0], out[1]), (0.0, 0.0));
    assert_eq!(shared.homogeneous(), own.homogeneous());
    assert!(!shared.admits(&Vector3::new(0.0, 0.0, -1.0), 0.0) && shared.admits(&source, 0.0));
}

/// The steady state in still open air is `1 / (4 pi kappa r)`.
#[test]
fn infinite_age_is_the_steady_state() {
    let c =
        SourceModel::concentration(&air(0, false), &at(Vector3::new(3.0, 4.0, 0.0)), &Vector3::zeros(), f64::INFINITY);
    assert!((c * 4.0 * std::f64::consts::PI * 4.0 * 5.0 - 1.0).abs() < 1e-12);
}

/// `d/dk` of `erfc(r / sqrt(4 k t)) / (4 pi k r)`.
#[test]
fn diffusivity_slope_of_open_air() {
    let (k, r, t) = (4.0_f64, 5.0_f64, 2.0_f64);
    let z = r / (4.0 * k * t).sqrt();
    let pi = std::f64::consts::PI;
    let exact = (-libm::erfc(z) / k + z * (-z * z).exp() / (k * pi.sqrt())) / (4.0 * pi * k * r);
    let got = air(0, false)
        .diffusivity_slope(&at(Vector3::new(3.0, 4.0, 0.0)), &Vector3::zeros(), t)
        .unwrap();
    assert!((got / exact - 1.0).abs() < 1e-8, "{got} {exact}");
}

proptest! {
    /// All sources of the square are within the variation of its centre, and it grows with the square.
    #[test]
    fn variation_covers_the_square(
        ground in 0_usize..4, windy: bool, x in -6.0..6.0f64, y in -6.0..6.0f64, height in 0.0..2.0f64,
        half in 0.01..3.0f64, u in -1.0..1.0f64, v in -1.0..1.0f64, age in 0.05..5.0f64,
    ) {
        // Permeable ground costs an integral for each place.
        prop_assume!(ground < 3 || x.abs() < 1.0);
        let air = air(ground, windy);
        let receptor = at(Vector3::new(0.0, 0.0, 0.4));
        let centre = Vector3::new(x, y, height);
        let here = air.concentration(&receptor.place, &centre, age);
        let moved = centre + Vector3::new(u * half, v * half, 0.0);
        let change = (air.concentration(&receptor.place, &moved, age) - here).abs();
        let allowed = air.variation(&receptor, &centre, half, age);
        prop_assert!(change <= 2.0 * allowed, "{change} {allowed}");
        prop_assert!(air.variation(&receptor, &centre, 1.5 * half, age) >= allowed);
    }

    /// Nothing depends on the distance but what `Homogeneous` says.
    #[test]
    fn homogeneous_field_is_a_profile_and_a_tilt(
        ground in 0_usize..3, windy: bool, r in 0.1..8.0f64, angle in 0.0..6.3f64, age in 0.05..5.0f64,
    ) {
        let air = air(ground, windy);
        let h = air.homogeneous().unwrap();
        let receptor = at(Vector3::new(1.0, -2.0, 0.4));
        let c = |offset: Vector2<f64>| {
            let source = Vector3::new(1.0 - offset.x, -2.0 - offset.y, 0.9);
            let tilt = (h.wind.dot(&offset) - h.wind.norm() * offset.norm()) / (2.0 * h.diffusivity);
            (air.concentration(&receptor.place, &source, age), tilt.exp())
        };
        let downwind = h.wind.try_normalize(0.0).unwrap_or_else(Vector2::x);
        let ((profile, one), (here, tilt)) = (c(downwind * r), c(Vector2::new(r * angle.cos(), r * angle.sin())));
        prop_assert!((one - 1.0).abs() < 1e-12);
        prop_assert!((here - profile * tilt).abs() <= 1e-10 * profile, "{here} {profile} {tilt}");
    }
}
