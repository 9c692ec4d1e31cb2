//! Balls and cylinders where the answer is known: before the wall is felt, at a wall that looks flat, and after long.

use crate::cylinder::Cylinder;
use crate::slab::SlabWall;
use crate::sphere::Sphere;
use fewbits_models::diffusion::{Axis, Wall};
use nalgebra::Vector3;
use std::f64::consts::PI;

const WALLS: [(SlabWall, Wall); 2] = [
    (SlabWall::Impermeable, Wall::IMPERMEABLE),
    (SlabWall::Absorbing, Wall::ABSORBING),
];
const RADIUS: f64 = 1.7;
const DIFFUSIVITY: f64 = 0.6;

/// The age at which `kappa t / a^2` is the given number.
fn age(scaled: f64) -> f64 {
    scaled * RADIUS * RADIUS / DIFFUSIVITY
}

/// Gaussian of `dimensions` dimensions about the place of release.
fn free(squared: f64, age: f64, dimensions: f64) -> f64 {
    let spread = 4.0 * DIFFUSIVITY * age;
    (-squared / spread).exp() / (PI * spread).powf(0.5 * dimensions)
}

/// Pairs of places away from the wall.
fn places() -> [[Vector3<f64>; 2]; 6] {
    let at = Vector3::new;
    [
        [Vector3::zeros(); 2],
        [Vector3::zeros(), at(0.1, -0.2, 0.3)],
        [at(1e-60, 2e-60, 0.0), at(0.1, -0.2, 0.3)],
        [at(0.3, 0.4, -0.2), at(0.1, 0.5, -0.35)],
        [at(-0.5, 0.2, 0.1), at(-0.3, 0.25, 0.4)],
        [at(0.05, 0.02, 0.01), at(-0.02, -0.03, 0.04)],
    ]
}

/// All zeros, norms and polynomials together add up to a Gaussian while no wall is felt, and so does what comes before the series.
#[test]
fn away_from_the_wall_a_ball_is_free_space() {
    for (wall, _) in WALLS {
        let ball = Sphere::new(RADIUS, DIFFUSIVITY, wall).unwrap();
        for [field, source] in places() {
            for t in [0.0015, 0.003, 0.0045].map(age) {
                let (got, want) = (ball.green(&field, &source, t), free((field - source).norm_squared(), t, 3.0));
                assert!((got - want).abs() < 1e-11 * free(0.0, t, 3.0), "{wall:?} {field} {source} {t}: {got} {want}");
            }
        }
    }
}

#[test]
fn away_from_the_wall_a_cylinder_is_free_space() {
    let polar = |x: &Vector3<f64>| [x.x.hypot(x.y), x.y.atan2(x.x)];
    for (wall, _) in WALLS {
        let pipe = Cylinder::new(RADIUS, DIFFUSIVITY, wall).unwrap();
        for [field, source] in places() {
            for t in [0.001, 0.0015, 0.0019].map(age) {
                let got = pipe.green(polar(&field), polar(&source), t);
                let want = free((field - source).xy().norm_squared(), t, 2.0);
                assert!((got - want).abs() < 1e-11 * free(0.0, t, 2.0), "{wall:?} {field} {source} {t}: {got} {want}");
            }
        }
    }
}

/// On the scale of a thousandth of the radius the wall is a plane: a half-space across it, free space along it.
#[test]
fn close_to_the_wall_bodies_are_half_spaces() {
    let t = age(2e-7);
    for (kind, wall) in WALLS {
        let ball = Sphere::new(RADIUS, DIFFUSIVITY, kind).unwrap();
        let pipe = Cylinder::new(RADIUS, DIFFUSIVITY, kind).unwrap();
        let across = Axis::half_space(DIFFUSIVITY, wall).unwrap();
        for (depth, other, along) in [(0.9e-3, 0.4e-3, 0.7e-3), (0.0, 0.5e-3, 0.3e-3), (1.1e-3, 0.0, -0.6e-3)] {
            let (depth, other) = (RADIUS * depth, RADIUS * other);
            let (inner, outer) = (RADIUS - depth, RADIUS - other);
            let along: f64 = along;
            let plane = across.green(depth, other, t);
            let scale = free(0.0, t, 1.0);
            let distance = RADIUS * along;
            let direction = Vector3::new(along.cos(), 0.8 * along.sin(), 0.6 * along.sin());
            let got = ball.green(&(direction * inner), &Vector3::new(outer, 0.0, 0.0), t);
            let want = plane * free(distance * distance, t, 2.0);
            assert!((got - want).abs() < 2e-3 * scale * free(0.0, t, 2.0), "{kind:?}: {got} {want}");
            let got = pipe.green([inner, 0.3 + along], [outer, 0.3], t);
            let want = plane * free(distance * distance, t, 1.0);
            assert!((got - want).abs() < 2e-3 * scale * free(0.0, t, 1.0), "{kind:?}: {got} {want}");
        }
    }
}

/// What is left in an absorbing ball of a release at its centre is a Fourier series in the radius; an impermeable body ends up
/// evenly filled.
#[test]
fn late_concentrations_are_the_slowest_modes() {
    let absorbing = Sphere::new(RADIUS, DIFFUSIVITY, SlabWall::Absorbing).unwrap();
    for (r, scaled) in [(0.3_f64, 0.02), (1.2, 0.07), (1.5, 0.3)] {
        let term = |n: f64| n * (n * PI * r / RADIUS).sin() * (-n * n * PI * PI * scaled).exp();
        let want = (1..40).map(|n| term(f64::from(n))).sum::<f64>() / (2.0 * RADIUS * RADIUS * r);
        let field = Vector3::new(0.48, 0.6, -0.64) * r;
        let (got, back) = (
            absorbing.green(&field, &Vector3::zeros(), age(scaled)),
            absorbing.green(&Vector3::zeros(), &field, age(scaled)),
        );
        assert!((got / want - 1.0).abs() < 1e-11 && (back / want - 1.0).abs() < 1e-11, "{got} {back} {want}");
    }
    let (field, source) = (Vector3::new(0.3, -1.0, 0.2), Vector3::new(-0.7, 0.2, 0.9));
    let ball = Sphere::new(RADIUS, DIFFUSIVITY, SlabWall::Impermeable).unwrap();
    assert!((ball.green(&field, &source, age(30.0)) * 4.0 / 3.0 * PI * RADIUS.powi(3) - 1.0).abs() < 1e-13);
    let pipe = Cylinder::new(RADIUS, DIFFUSIVITY, SlabWall::Impermeable).unwrap();
    assert!((pipe.green([1.3, 0.2], [0.4, 2.9], age(30.0)) * PI * RADIUS * RADIUS - 1.0).abs() < 1e-13);
}

#[test]
fn nothing_is_outside_and_nothing_before() {
    for (kind, _) in WALLS {
        let ball = Sphere::new(RADIUS, DIFFUSIVITY, kind).unwrap();
        let pipe = Cylinder::new(RADIUS, DIFFUSIVITY, kind).unwrap();
        let (inside, outside) = (Vector3::new(0.9, 0.4, -0.3), Vector3::new(0.9, 1.4, -0.5));
        assert!(ball.green(&inside, &inside, age(1e-3)) > 0.0 && pipe.green([1.1, 0.3], [1.1, 0.3], age(1e-3)) > 0.0);
        for t in [0.0, -age(1e-3)] {
            assert_eq!(ball.green(&inside, &inside, t), 0.0);
            assert_eq!(pipe.green([1.1, 0.3], [1.1, 0.3], t), 0.0);
        }
        assert_eq!([ball.green(&inside, &outside, 0.1), ball.green(&outside, &inside, 0.1)], [0.0; 2]);
        assert_eq!(
            [
                pipe.green([1.1, 0.3], [1.8, 0.3], 0.1),
                pipe.green([1.8, 0.3], [1.1, 0.3], 0.1)
            ],
            [0.0; 2]
        );
        assert_eq!(pipe.green([-0.1, 0.3], [1.1, 0.3], 0.1), 0.0);
    }
    assert!(
        Sphere::new(0.0, 1.0, SlabWall::Absorbing).is_err() && Sphere::new(1.0, -1.0, SlabWall::Absorbing).is_err()
    );
    assert!(Cylinder::new(1.0, 0.0, SlabWall::Absorbing).is_err());
}
