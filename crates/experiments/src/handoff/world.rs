//! The world of the figures: a target that turns a little at every step, sensors that measure how near it is. The unit of length is a step.

use crate::Error;
use fewbits_core::{Columns, Dynamics, Likelihood};
use fewbits_numerics::error::refuse;
use nalgebra::SVector;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use std::f64::consts::FRAC_PI_4;

/// A point of the plane.
pub type Point = SVector<f64, 2>;

/// Largest disturbance of a step along each axis, in steps.
pub const DISTURBANCE: f64 = 0.1;
/// A sensor nearer than this does not lead: its reading would be too sharp for any particle filter.
pub(super) const STAND_OFF: f64 = 0.7;
/// Standard deviation of the start along each axis.
pub const START: f64 = 0.25;

/// `x' = x + r0 ([cos th; sin th] + u)`, `th ~ U[-pi/4, pi/4]`, both components of `u ~ U[0, 0.1]`.
#[derive(Debug, Clone, Copy)]
pub struct Walk;

impl Dynamics<2> for Walk {
    fn mean(&self, state: &Point) -> Point {
        state + Point::new(FRAC_PI_4.sin() / FRAC_PI_4 + 0.5 * DISTURBANCE, 0.5 * DISTURBANCE)
    }

    fn propagate(&self, rng: &mut dyn Rng, state: &Point) -> Point {
        let (sin, cos) = rng.random_range(-FRAC_PI_4..FRAC_PI_4).sin_cos();
        let u: [f64; 2] = [rng.random_range(0.0..DISTURBANCE), rng.random_range(0.0..DISTURBANCE)];
        state + Point::new(cos + u[0], sin + u[1])
    }
}

/// What the leader measured: `y = 1/(|s - x| + 0.05) + v`, `v ~ N(0, variance)`.
#[derive(Debug, Clone, Copy)]
pub struct Reading {
    pub(super) sensor: Point,
    pub(super) value: f64,
    pub(super) variance: f64,
}

impl Likelihood<2> for Reading {
    fn log_likelihood(&self, state: &Point) -> f64 {
        let mut log = [0.0];
        self.add_log_likelihoods([&[state[0]], &[state[1]]], &mut log);
        log[0]
    }

    fn add_log_likelihoods(&self, states: Columns<'_, 2>, log_weights: &mut [f64]) {
        let half_precision = 0.5 / self.variance;
        let constant = -0.5 * (std::f64::consts::TAU * self.variance).ln();
        let points = states[0].iter().zip(states[1]);
        for (log, (x, y)) in log_weights.iter_mut().zip(points) {
            let (dx, dy) = (x - self.sensor[0], y - self.sensor[1]);
            let gap = self.value - 1.0 / ((dx * dx + dy * dy).sqrt() + 0.05);
            *log += constant - half_precision * gap * gap;
        }
    }
}

/// One world: sensors, the target's way, who led and what was read.
#[derive(Debug, Clone)]
pub struct World {
    pub(super) sensors: Vec<Point>,
    /// Positions from time 0 on.
    pub(super) track: Vec<Point>,
    /// Index of the leader at times 1, 2, ...
    pub(super) leaders: Vec<usize>,
    /// What the leaders read.
    pub readings: Vec<Reading>,
}

impl World {
    /// Draws a world of `steps` steps. The leader is the sensor nearest to the target among those that did not lead just before
    /// and are not too near.
    pub(super) fn draw<R: Rng>(rng: &mut R, sensors: usize, steps: usize, variance: f64) -> Result<Self, Error> {
        let length = steps as f64 + 1.0;
        let mut place = || Point::new(rng.random_range(-1.0..length), rng.random_range(-4.0..4.0));
        let places = (0..sensors).map(|_| place()).collect();
        let start = Point::from_fn(|_, _| START * rng.sample::<f64, _>(StandardNormal));
        let mut world = Self {
            sensors: places,
            track: vec![start],
            leaders: Vec::new(),
            readings: Vec::new(),
        };
        let mut position = start;
        for _ in 0..steps {
            position = Walk.propagate(rng, &position);
            let distance = |i: usize| (world.sensors[i] - position).norm();
            let able = (0..sensors).filter(|i| world.leaders.last() != Some(i) && distance(*i) >= STAND_OFF);
            let Some(leader) = able.min_by(|a, b| distance(*a).total_cmp(&distance(*b))) else {
                return refuse("sensors", sensors, "enough for a leader beyond the stand-off at every step");
            };
            let noise = variance.sqrt() * rng.sample::<f64, _>(StandardNormal);
            let value = 1.0 / (distance(leader) + 0.05) + noise;
            let sensor = world.sensors[leader];
            world.readings.push(Reading {
                sensor,
                value,
                variance,
            });
            world.leaders.push(leader);
            world.track.push(position);
        }
        Ok(world)
    }
}
