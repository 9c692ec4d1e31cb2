//! One coordinate between two walls, `0 <= z <= length`.

use std::f64::consts::PI;

/// A wall of a slab.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SlabWall {
    /// Nothing passes.
    Impermeable,
    /// Everything is taken away.
    Absorbing,
}

/// Above this `kappa t / length^2` the eigenfunctions converge faster than the images.
const EIGEN_FROM: f64 = 0.2;

/// Images below the switch, eigenfunctions above; both agree to rounding around it.
pub fn green(z: f64, z0: f64, age: f64, diffusivity: f64, length: f64, walls: [SlabWall; 2]) -> f64 {
    let inside = 0.0..=length;
    if age <= 0.0 || !inside.contains(&z) || !inside.contains(&z0) {
        return 0.0;
    }
    let scaled = diffusivity * age / (length * length);
    let (a, b) = (z / length, z0 / length);
    let unit = if scaled > EIGEN_FROM {
        eigen(a, b, scaled, walls)
    } else {
        images(a, b, scaled, walls)
    };
    // A sum of alternating images may leave a rounding error below zero.
    (unit / length).max(0.0)
}

fn images(z: f64, z0: f64, scaled: f64, walls: [SlabWall; 2]) -> f64 {
    use SlabWall::{Absorbing, Impermeable};
    let term = |at: f64| (-(z - at) * (z - at) / (4.0 * scaled)).exp();
    let mut sum = 0.0;
    // At `scaled = 0.2` an image at distance 2 n is below exp(-5 (n - 1/2)^2 * 4 / 4).
    for n in -4_i32..=4 {
        let shift = f64::from(2 * n);
        let alternating = if n % 2 == 0 { 1.0 } else { -1.0 };
        let (own, mirrored) = match walls {
            [Impermeable, Impermeable] => (1.0, 1.0),
            [Absorbing, Absorbing] => (1.0, -1.0),
            [Impermeable, Absorbing] => (alternating, alternating),
            [Absorbing, Impermeable] => (alternating, -alternating),
        };
        sum += own * term(z0 + shift) + mirrored * term(-z0 + shift);
    }
    sum / (4.0 * PI * scaled).sqrt()
}

fn eigen(z: f64, z0: f64, scaled: f64, walls: [SlabWall; 2]) -> f64 {
    use SlabWall::{Absorbing, Impermeable};
    let mut sum = if walls == [Impermeable; 2] { 1.0 } else { 0.0 };
    for n in 1..=10 {
        let order = if walls[0] == walls[1] {
            f64::from(n)
        } else {
            f64::from(n) - 0.5
        };
        let wave = order * PI;
        let shape = match walls[0] {
            Impermeable => (wave * z).cos() * (wave * z0).cos(),
            Absorbing => (wave * z).sin() * (wave * z0).sin(),
        };
        sum += 2.0 * shape * (-wave * wave * scaled).exp();
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_meet_eigenfunctions() {
        use SlabWall::{Absorbing as A, Impermeable as I};
        for walls in [[I, I], [A, A], [I, A], [A, I]] {
            for (z, z0) in [(0.7, 0.4), (0.0, 0.1), (1.0, 0.9), (0.3, 0.3)] {
                for scaled in [0.15, 0.2] {
                    assert!((images(z, z0, scaled, walls) - eigen(z, z0, scaled, walls)).abs() < 3e-15);
                }
            }
        }
    }
}
