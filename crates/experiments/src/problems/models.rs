//! Dynamics and sensing of the problems, each written once over a generic number.

use fewbits_models::{Differentiable, Number};

/// Straight motion of `[x, x velocity, y, y velocity]` over one step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Straight;

impl Differentiable<4, 4> for Straight {
    fn at<N: Number>(&self, x: &[N; 4]) -> [N; 4] {
        [x[0] + x[1], x[1], x[2] + x[3], x[3]]
    }
}

/// The same with a turn rate as fifth coordinate, by Euler steps of the heading and a series of the turn that is smooth at zero.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turning;

impl Differentiable<5, 5> for Turning {
    fn at<N: Number>(&self, x: &[N; 5]) -> [N; 5] {
        let (w, w2) = (x[4], x[4] * x[4]);
        // sin w / w and (1 - cos w) / w.
        let along = -w2 / 6.0 + w2 * w2 / 120.0 + 1.0;
        let across = w * 0.5 - w * w2 / 24.0 + w * w2 * w2 / 720.0;
        let (sin, cos) = (w.sin(), w.cos());
        [
            x[0] + x[1] * along - x[3] * across,
            x[1] * cos - x[3] * sin,
            x[2] + x[1] * across + x[3] * along,
            x[1] * sin + x[3] * cos,
            w,
        ]
    }
}

/// A damped pendulum of one metre.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pendulum;

impl Differentiable<2, 2> for Pendulum {
    fn at<N: Number>(&self, x: &[N; 2]) -> [N; 2] {
        [x[1], -x[0].sin() * 9.81 - x[1] * 0.1]
    }
}

/// Duffing's oscillator: two wells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Duffing;

impl Differentiable<2, 2> for Duffing {
    fn at<N: Number>(&self, x: &[N; 2]) -> [N; 2] {
        [x[1], x[0] - x[0] * x[0] * x[0] - x[1] * 0.3]
    }
}

/// Van der Pol's oscillator.
#[derive(Debug, Clone, Copy)]
pub(super) struct VanDerPol;

impl Differentiable<2, 2> for VanDerPol {
    fn at<N: Number>(&self, x: &[N; 2]) -> [N; 2] {
        [x[1], (-(x[0] * x[0]) + 1.0) * x[1] - x[0]]
    }
}

/// Lorenz' system.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lorenz;

impl Differentiable<3, 3> for Lorenz {
    fn at<N: Number>(&self, x: &[N; 3]) -> [N; 3] {
        [
            (x[1] - x[0]) * 10.0,
            x[0] * (-x[2] + 28.0) - x[1],
            x[0] * x[1] - x[2] * (8.0 / 3.0),
        ]
    }
}

/// A body that falls through the atmosphere: height in km, speed downwards in km/s, logarithm of its drag.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fall;

impl Differentiable<3, 3> for Fall {
    fn at<N: Number>(&self, x: &[N; 3]) -> [N; 3] {
        let drag = (-x[0] / 6.1 + x[2]).exp() * x[1] * x[1] * 0.5;
        [-x[1], -drag + 0.0098, x[0] * 0.0]
    }
}

/// The growth model of Netto, Gimeno and Mendes (1978) in the step that `cosine = cos(1.2 k)` belongs to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Growth {
    pub(super) cosine: f64,
}

impl Differentiable<1, 1> for Growth {
    fn at<N: Number>(&self, x: &[N; 1]) -> [N; 1] {
        [x[0] * 0.5 + x[0] * 25.0 / (x[0] * x[0] + 1.0) + 8.0 * self.cosine]
    }
}

/// What one sensor measures. Positions are the coordinates 0 and 2.
#[derive(Debug, Clone, Copy)]
pub(super) enum Measure {
    /// Bearing of the target from a place, from the y axis.
    Bearing([f64; 2]),
    /// Distance from a place.
    Range([f64; 2]),
    /// A coordinate.
    Coordinate(usize),
    /// The sine of the first coordinate.
    Sine,
    /// Distance to a height, from a place on the ground this far away.
    Slant(f64),
    /// A twentieth of the square of the first coordinate.
    Square,
}

impl<const D: usize> Differentiable<D, 1> for Measure {
    fn at<N: Number>(&self, x: &[N; D]) -> [N; 1] {
        let from = |place: &[f64; 2]| (x[0] - place[0], x[2.min(D - 1)] - place[1]);
        [match self {
            Self::Bearing(place) => {
                let (dx, dy) = from(place);
                dx.atan2(dy)
            }
            Self::Range(place) => {
                let (dx, dy) = from(place);
                (dx * dx + dy * dy).sqrt()
            }
            Self::Coordinate(axis) => x[*axis],
            Self::Sine => x[0].sin(),
            Self::Slant(away) => (x[0] * x[0] + away * away).sqrt(),
            Self::Square => x[0] * x[0] / 20.0,
        }]
    }
}
