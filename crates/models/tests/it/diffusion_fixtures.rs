//! Reference values of the diffusion physics, computed by an independent program.

use crate::diffusion_entries::{beginning_with, number};
use fewbits_models::diffusion::{Air, Axis, Flux, Ground, Release, Wall, contour_radius, disk_source, moving_source};
use nalgebra::{Vector2, Vector3};
use serde_json::Value;

fn entries(prefix: &str) -> Vec<Value> {
    beginning_with(prefix, include_str!("../fixtures/diffusive.json"))
}

fn vector(entry: &Value, name: &str) -> Vector3<f64> {
    Vector3::from_fn(|i, _| entry["inputs"][name][i].as_f64().unwrap())
}

fn check(entry: &Value, got: f64) {
    assert_eq!(entry["tolerance_kind"], "rel_maxabs");
    let (want, tolerance) = (entry["value"].as_f64().unwrap(), entry["tolerance"].as_f64().unwrap());
    assert!((got - want).abs() <= tolerance * want.abs(), "{}: {got}, expected {want}", entry["id"]);
}

#[test]
fn half_space() {
    for e in entries("green1d_semi") {
        let flux = if e["inputs"]["flux"] == "total" {
            Flux::Total
        } else {
            Flux::Diffusive
        };
        let wall = Wall::permeable(number(&e, "alpha")).unwrap();
        let axis = Axis::half_space(number(&e, "kappa"), wall)
            .unwrap()
            .with_wind(number(&e, "v"), flux)
            .unwrap();
        check(&e, axis.green(number(&e, "z"), number(&e, "z0"), number(&e, "t")));
    }
}

#[test]
fn continuous_source() {
    for e in entries("cont_semi") {
        let air = Air::new(number(&e, "kappa"), vector(&e, "v"), Ground::Impermeable).unwrap();
        let c = air.concentration(&vector(&e, "r"), &vector(&e, "r0"), number(&e, "t"));
        check(&e, number(&e, "mu") * c);
    }
}

/// Erratum `diffusive-4`.
#[test]
fn finite_release() {
    for e in entries("cont_finite") {
        let air = Air::new(number(&e, "kappa"), Vector3::zeros(), Ground::Impermeable).unwrap();
        let release = Release::during(number(&e, "t_on"), number(&e, "t_off"), 1.0).unwrap();
        let (r, r0) = (vector(&e, "r"), vector(&e, "r0"));
        check(&e, release.concentration(number(&e, "t"), |age| air.concentration(&r, &r0, age)));
    }
}

#[test]
fn permeable_ground() {
    for e in entries("cont_permeable") {
        let wall = Wall::permeable(number(&e, "alpha")).unwrap();
        let air = Air::new(number(&e, "kappa"), Vector3::zeros(), Ground::Wall(wall)).unwrap();
        let r = Vector3::new(number(&e, "rho2").sqrt(), 0.0, number(&e, "z"));
        check(&e, air.concentration(&r, &Vector3::new(0.0, 0.0, number(&e, "z0")), number(&e, "t")));
    }
}

#[test]
fn moving_and_distributed_sources() {
    for e in entries("moving") {
        let air = Air::new(number(&e, "kappa"), Vector3::zeros(), Ground::Impermeable).unwrap();
        let (r, p, u) = (vector(&e, "r"), vector(&e, "p0"), vector(&e, "u"));
        check(&e, moving_source(&air, &r, &p, &u, number(&e, "t")).unwrap());
    }
    for e in entries("disk") {
        let air = Air::new(number(&e, "kappa"), Vector3::zeros(), Ground::Impermeable).unwrap();
        let centre = Vector2::from_fn(|i, _| e["inputs"]["centre"][i].as_f64().unwrap());
        let (r, radius) = (vector(&e, "r"), number(&e, "R"));
        check(&e, disk_source(&air, &r, (centre, 0.0), radius, number(&e, "t"), 16).unwrap());
    }
}

#[test]
fn envelope_radius() {
    for e in entries("envelope_radius") {
        let radius = contour_radius(number(&e, "mu"), number(&e, "c_star"), number(&e, "t"), number(&e, "kappa"));
        check(&e, radius.unwrap());
    }
}
